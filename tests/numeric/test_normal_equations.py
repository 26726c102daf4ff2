"""Normal equations by joint: the digits they keep, against least squares in extended precision."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from runtime.estimators.normal_equations import JointRows, least_squares
from runtime.estimators.solution import solve
from runtime.limits import LIMIT
from runtime.model.generated import load_model

N = 2003


@lru_cache
def model():
    return load_model(Path(__file__).parents[2] / "generated" / "tx40.py")


@lru_cache
def states(swing):
    """q, qd, qdd, tau of a TX40 that swings slowly with the given amplitude, rad, with torque noise
    of 0.05 N m.
    """
    rng = np.random.default_rng(1)
    t = np.linspace(0, 10, N)[:, None]
    q, qd, qdd = np.zeros((3, N, 6))
    for f in (0.31, 0.83, 1.27):
        w, phase, a = 2 * np.pi * f * 0.1, rng.uniform(0, 6, 6), swing * rng.uniform(0.3, 1.0, 6)
        wt = w * t + phase
        q, qd, qdd = q + a * np.sin(wt), qd + a * w * np.cos(wt), qdd - a * w**2 * np.sin(wt)
    X = model().base_parameters(model().VALUES)
    tau = model().inverse_dynamics(q, qd, qdd, X) + rng.normal(scale=0.05, size=(N, 6))
    return q, qd, qdd, tau


@lru_cache
def extended(swing):
    """Least squares by refinement with residuals in extended precision, from the triangular factor;
    kappa of W with unit columns; W, Y.
    """
    q, qd, qdd, tau = states(swing)
    W, Y = model().observation_matrix(q, qd, qdd), tau.T.ravel()
    D = np.linalg.norm(W, axis=0)
    R = np.linalg.qr(W / D, mode="r")
    exact, X = (W / D).astype(np.longdouble), np.zeros(60, dtype=np.longdouble)
    for _ in range(12):
        g = (exact.T @ (Y - exact @ X)).astype(float)
        step = np.linalg.solve(R, np.linalg.solve(R.T, g))
        X = X + step
    assert np.linalg.norm(step) < 1e-17 * np.linalg.norm(X.astype(float)) * np.linalg.cond(R)
    return X / D, float(np.linalg.cond(R)), W, Y


def error(X, swing):
    exact = extended(swing)[0]
    return float(np.max(np.abs(X - exact)) / np.max(np.abs(exact)))


def columns():
    """C_j of the TX40, from STRUCTURE."""
    return tuple(np.flatnonzero(column) for column in np.asarray(model().STRUCTURE).T)


def rows_from(q, qd, qdd, tau):
    """[W_j[:, C_j] Y_j]' of every joint."""
    W = model().observation_matrix(q, qd, qdd).reshape(6, len(q), 60)
    joints = [np.vstack([W[j][:, C].T, tau[:, j]]) for j, C in enumerate(columns())]
    return JointRows(model().BASE_PARAMETERS, columns(), tuple(joints))


@lru_cache
def rows_of(swing):
    return rows_from(*states(swing))


def refined(rows, refinements):
    """X of the normal equations after some refinements."""
    equations = rows.normal()
    cholesky = equations.cholesky()
    X = cholesky.solve(equations.g)
    for _ in range(refinements):
        pairs = zip(rows.rows, rows.residuals(X), strict=True)
        X = X + cholesky.solve(equations.scattered([a[:-1] @ r for a, r in pairs]))
    return X


@pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision on this machine"
)
@pytest.mark.parametrize("swing", [3.0, 0.3, 0.1, 0.03])
def test_digits_by_condition_number(swing):
    """The table of the theory note (section 5): normal equations lose kappa^2 eps, one refinement
    gives the digits of QR back up to kappa 1e5.
    """
    _, kappa, W, Y = extended(swing)
    eps = np.finfo(float).eps
    rows = rows_of(swing)
    plain, once, twice = (error(refined(rows, k), swing) for k in (0, 1, 2))
    by_lstsq = error(np.linalg.lstsq(W, Y, rcond=None)[0], swing)
    by_factor = error(solve(rows.factor()).X, swing)
    print(
        f"kappa {kappa:.1e}: lstsq {by_lstsq:.1e} factor {by_factor:.1e}",
        *(f"{x:.1e}" for x in (plain, once, twice)),
    )
    assert plain < 10 * kappa**2 * eps
    assert once < max(10 * by_lstsq, (10 * kappa**2 * eps) ** 2, 1e-14)
    assert twice < max(10 * by_lstsq, (10 * kappa**2 * eps) ** 3, 1e-14)
    assert by_factor < 10 * by_lstsq + 1e-14
    solution = least_squares(rows, np.inf)
    assert 0.1 * kappa < solution.kappa < 10 * kappa
    np.testing.assert_array_equal(solution.X, refined(rows, 1))


def test_well_conditioned_rows_against_lstsq():
    """Equal to rounding times kappa."""
    q, qd, qdd, tau = states(3.0)
    W, Y = model().observation_matrix(q, qd, qdd), tau.T.ravel()
    exact = np.linalg.lstsq(W, Y, rcond=None)[0]
    found = least_squares(rows_of(3.0))
    assert found.method == "normal equations"
    np.testing.assert_allclose(found.X, exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    norms = np.linalg.norm((Y - W @ exact).reshape(6, -1), axis=1)
    np.testing.assert_allclose(found.residual_norms, norms, rtol=1e-10)


def test_residual_norms_of_an_exact_fit():
    """y'y - X'g would leave sqrt(eps) ||Y||; they are read from the rows."""
    q, qd, qdd, _ = states(3.0)
    X = np.arange(1.0, 61.0)
    tau = model().inverse_dynamics(q, qd, qdd, X)
    found = least_squares(rows_from(q, qd, qdd, tau))
    np.testing.assert_allclose(found.X, X, rtol=1e-11)
    assert (found.residual_norms < 1e-11 * np.linalg.norm(tau, axis=0)).all()


def test_ill_conditioned_rows_go_to_the_triangular_factor():
    found = least_squares(rows_of(0.1))
    assert found.method == "triangular factor" and found.kappa > LIMIT.NORMAL_EQUATIONS
    assert error(found.X, 0.1) < 1e-9


def test_rows_that_do_not_determine_every_parameter():
    q, qd, qdd, tau = (x.copy() for x in states(3.0))
    q[:, 5], qd[:, 5], qdd[:, 5] = 0.3, 0, 0
    found = least_squares(rows_from(q, qd, qdd, tau))
    W, Y = model().observation_matrix(q, qd, qdd), tau.T.ravel()
    assert found.method == "triangular factor" and np.isinf(found.kappa)
    best = np.linalg.norm(Y - W @ np.linalg.lstsq(W, Y, rcond=None)[0])
    np.testing.assert_allclose(np.linalg.norm(found.residual_norms), best, rtol=1e-9)


def test_factor_and_equations_have_the_gram_matrix_of_the_rows():
    q, qd, qdd, tau = states(3.0)
    whole = np.column_stack([model().observation_matrix(q, qd, qdd), tau.T.ravel()])
    rows = rows_of(3.0)
    equations, factor = rows.normal(), rows.factor()
    scale = np.outer(*2 * [np.linalg.norm(whole, axis=0)])
    np.testing.assert_allclose(
        equations.A / scale[:60, :60], (whole.T @ whole / scale)[:60, :60], atol=1e-13
    )
    np.testing.assert_allclose(
        equations.g / scale[:60, 60], (whole.T @ whole / scale)[:60, 60], atol=1e-13
    )
    np.testing.assert_allclose(factor.R.T @ factor.R / scale, whole.T @ whole / scale, atol=1e-13)
    assert factor.rows == 6 * N
