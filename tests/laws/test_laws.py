"""Scalars of laws by variable projection: against scipy's least squares on all unknowns at once,
against truth, and what is said where a record does not determine one.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from campaign import campaign
from scipy.optimize import least_squares

import runtime
import symgen
from runtime.compose import problem
from runtime.laws.projection import LawProblem, Projection
from runtime.laws.scalars import fit_laws

ARM = """
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {g: 9.81, L: 0.4}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0, theta: q2, r: 0}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
columns:
  STR: {kind: stribeck, along: all, fit: {vs: {bounds: [0.01, 1]}}}
  CG: {kind: cogging, along: 2, fit: {order: 9, phase: {bounds: [-3.2, 3.2], grid: 7}}}
"""
TRUE = {"vs1": 0.08, "vs2": 0.15, "phase2": 0.7}
X_TRUE = {
    "FV1": 2.0, "FS1": 3.0, "FV2": 1.5, "FS2": 2.0, "STR1": 2.0, "STR2": 1.5, "CG2": 0.4,
}  # fmt: skip
STUDY = runtime.study.study_from_mapping(
    {"signals": {"median": 1, "lowpass": None, "decimate": None}, "rows": {"trim": 0}}
)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.yaml"
    path.write_text(ARM)
    return symgen.model(path)


def motion(seconds: float = 20.0, rate: float = 200.0, seed: int = 1):
    """Positions, rates and accelerations of sums of sines, slow and fast."""
    rng, t = np.random.default_rng(seed), np.arange(int(seconds * rate)) / rate
    q = np.zeros((3, len(t), 2))
    for j in range(2):
        for k, w in enumerate(2 * np.pi * np.array([0.05, 0.15, 0.35, 0.6])):
            a, phase = 0.5 / (k + 1), rng.uniform(0, 2 * np.pi)
            q[0, :, j] += a * np.sin(w * t + phase)
            q[1, :, j] += a * w * np.cos(w * t + phase)
            q[2, :, j] -= a * w**2 * np.sin(w * t + phase)
    return t, q


def parameters(model, **changes: float):
    X = dict.fromkeys(model.BASE_PARAMETERS, 0.3) | X_TRUE | changes
    return np.array([X[name] for name in model.BASE_PARAMETERS])


def record_of(model, noise: float, seed: int = 1, **changes: float):
    t, (q, qd, qdd) = motion(seed=seed)
    tau = model.inverse_dynamics(q, qd, qdd, parameters(model, **changes), **TRUE)
    tau = tau + noise * np.random.default_rng([seed, 9]).standard_normal(tau.shape)
    return runtime.Record(t, q, tau, rate=200.0, name="arm")


@campaign
def test_variable_projection_is_least_squares_on_everything(model) -> None:
    """The same minimum of X and scalars together, found by scipy from 20 other starts."""
    own = [problem(model, record_of(model, 0.2), STUDY).prepared[0]]
    laws = LawProblem(model, own, model.BASE_PARAMETERS)
    rows = np.ones(len(laws.Y), dtype=bool)
    u, cost, _ = Projection(laws, rows, np.ones(len(rows))).fitted([[0], [1], [2]])
    fit = fit_laws(model, own)
    np.testing.assert_allclose([*fit.constants.values()], laws.values(u), rtol=1e-6)
    b, Y = len(laws.names), laws.Y

    def system(v):
        W = laws.W.copy()
        for c in laws.moving:
            W[:, c] = laws.column(c, v)
        return W

    best = np.inf
    for start in np.random.default_rng(5).uniform(laws.lower, laws.upper, (20, 3)):
        everything = least_squares(
            lambda x: Y - system(x[b:]) @ x[:b],
            np.concatenate([np.linalg.lstsq(system(start), Y, rcond=None)[0], start]),
            bounds=(
                [*[-np.inf] * b, *laws.lower],
                [*[np.inf] * b, *laws.upper],
            ),
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-12,
        )
        best = min(best, 2 * everything.cost)
    assert cost == pytest.approx(best, rel=1e-8)


def test_kaufmans_jacobian_leads_to_a_stationary_point(model) -> None:
    """The gradient of the projected squares is zero there, by differences of the squares."""
    own = [problem(model, record_of(model, 0.2), STUDY).prepared[0]]
    laws = LawProblem(model, own, model.BASE_PARAMETERS)
    rows = np.ones(len(laws.Y), dtype=bool)
    projection = Projection(laws, rows, np.ones(len(rows)))
    u, cost, _ = projection.fitted([[0], [1], [2]])
    for k in range(3):
        h = np.eye(3)[k] * 1e-4
        ahead, behind = (np.sum(projection.residual(u + s * h) ** 2) for s in (1, -1))
        curvature = (ahead + behind - 2 * cost) / 1e-8
        assert curvature > 0 and abs(ahead - behind) / 2e-4 < 1e-3 * curvature


def test_scalars_come_back_with_their_deviations(model) -> None:
    fit = fit_laws(model, [problem(model, record_of(model, 0.2), STUDY).prepared[0]])
    for scalar in fit.scalars:
        assert not scalar.doubt
        assert abs(scalar.value - TRUE[scalar.name]) < 4 * scalar.sigma
        assert scalar.sigma < 0.2 * abs(scalar.value)
    assert all(test.earned for test in fit.tests)
    assert {test.parameter for test in fit.tests} == {"STR1", "STR2", "CG2"}


def test_several_minima_are_told(model) -> None:
    """Cogging with a negative amplitude is the same half a turn away: two minima as good."""
    fit = fit_laws(model, [problem(model, record_of(model, 0.05), STUDY).prepared[0]])
    phase = fit.scalars[-1]
    assert phase.minima
    assert min(abs(abs(x - phase.value) - np.pi) for x in phase.minima) < 0.05


def test_a_law_that_is_not_there_is_a_sentence(model) -> None:
    record = record_of(model, 0.2, STR1=0.0)
    fit = fit_laws(model, [problem(model, record, STUDY).prepared[0]])
    first, second = fit.scalars[:2]
    assert first.doubt.startswith("not determined") and not second.doubt
    assert not fit.tests[0].earned
    text = "\n".join(table.to_text() for table in fit.tables())
    assert "does not show the law" in text


def test_methods_that_simulate_refuse_scalars(model) -> None:
    study = runtime.study.study_from_mapping({"estimate": {"method": "iv"}})
    with pytest.raises(runtime.InputError, match="iv cannot fit the constants of a law"):
        runtime.identify(model, record_of(model, 0.1), study)


def test_identify_takes_the_scalars_and_tells_them(model) -> None:
    result = runtime.identify(model, record_of(model, 0.1), STUDY)
    assert result.part("laws") is not None
    assert result.model.CONSTANTS["vs2"] == result.part("laws").constants["vs2"]
    assert abs(result.estimate["STR2"] - 1.5) < 0.3
    assert "vs2 0.1" in result.brief() and "unseen with %" in result.to_text()
    assert json.loads(result.to_json())["laws"]["scalars"][0]["name"] == "vs1"
