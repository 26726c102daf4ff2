"""Least squares: exact data, oracle, statistics, weights, rank, down-dating."""

from dataclasses import replace

import numpy as np
import planar_2r_model as planar
import pytest
from campaign import campaign
from hypothesis import given
from hypothesis import strategies as st
from planar_data import OLS, TRUE, WLS, observation, one_joint_at_rest
from problems import linear_system
from scipy.signal import lfilter

from runtime.compose import METHODS, estimate_of
from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.least_squares.solution import null_groups, solve
from runtime.core.rows.factor import Factor, factor, merged
from runtime.core.rows.observation import split_rows
from runtime.core.study import EstimateSettings
from runtime.ground.errors import SettingsError

EVERY = [
    OLS,
    WLS,
    EstimateSettings(method="wls", weights="iterated"),
    EstimateSettings(method="wls", weights="covariance"),
]
KINDS = ["ols", "wls", "wls iterated", "wls covariance"]


@pytest.mark.parametrize("settings", EVERY[:3], ids=KINDS[:3])
def test_exact_data_return_the_parameters(settings):
    found = estimate_of(observation(), settings, model=planar)
    assert found.status == "ok"
    assert np.allclose(found.X, TRUE, rtol=1e-9, atol=0)  # cond 1e2, rounding 1e-16
    assert found.relative_error < 1e-10


def test_exact_data_have_no_residual_covariance():
    found = estimate_of(observation(), EVERY[3])
    assert np.allclose(found.X, TRUE, rtol=1e-9, atol=0)


@pytest.mark.parametrize("settings", EVERY, ids=KINDS)
def test_noisy_data_stay_within_five_deviations(settings):
    found = estimate_of(observation(noise=(0.3, 0.05), seed=4), settings)
    assert np.all(np.abs(found.X - TRUE) < 5 * found.sigma)


def test_ordinary_equals_lstsq_and_its_formulas():
    seen = observation(noise=(0.3, 0.05), seed=1)
    W, Y = seen.W, seen.Y
    X, *_ = np.linalg.lstsq(W, Y, rcond=None)
    found = estimate_of(seen, OLS)
    variance = np.sum((Y - W @ X) ** 2) / (len(Y) - 10)  # eq. (9)
    covariance = variance * np.linalg.inv(
        W.T @ W
    )  # eq. (10), the textbook form: an oracle, not the method
    assert np.allclose(found.X, X, rtol=1e-11)
    assert np.isclose(found.sigma_rho, np.sqrt(variance), rtol=1e-11)
    assert np.allclose(found.covariance, covariance, rtol=1e-9)
    assert np.allclose(
        found.relative_sigma, 100 * np.sqrt(np.diag(covariance)) / np.abs(X), rtol=1e-9
    )
    assert np.isclose(found.cond, np.linalg.cond(W), rtol=1e-9)
    assert np.isclose(found.cond_unit, np.linalg.cond(W / np.linalg.norm(W, axis=0)), rtol=1e-9)
    assert np.isclose(
        found.relative_error, 100 * np.linalg.norm(Y - W @ X) / np.linalg.norm(Y), rtol=1e-11
    )
    for j, fit in enumerate(found.per_joint):
        rows = seen.joint(j)
        assert np.isclose(fit.residual_norm, np.linalg.norm(Y[rows] - W[rows] @ X), rtol=1e-10)
    assert np.isclose(
        np.sqrt(sum(fit.residual_norm**2 for fit in found.per_joint)), found.residual_norm
    )


def test_weighted_equals_lstsq_of_divided_rows():
    seen = observation(noise=(0.4, 0.02), seed=2)
    scale = []
    for j in range(2):
        own = seen.W[seen.joint(j)]
        _, square, rank, _ = np.linalg.lstsq(
            own[:, own.any(axis=0)], seen.Y[seen.joint(j)], rcond=None
        )
        scale.append(np.sqrt(square[0] / (300 - rank)))
    s = np.repeat(scale, 300)
    X, *_ = np.linalg.lstsq(seen.W / s[:, None], seen.Y / s, rcond=None)
    found = estimate_of(seen, WLS)
    assert np.allclose([fit.scale for fit in found.per_joint], scale, rtol=1e-10)
    assert np.allclose(found.X, X, rtol=1e-10)
    assert np.allclose(
        found.covariance, np.linalg.inv((seen.W / s[:, None] ** 2).T @ seen.W), rtol=1e-8
    )
    assert 0.8 < found.sigma_rho < 1.2  # residuals of a weighted system have unit variance


def test_covariance_weights_equal_generalised_least_squares():
    mixing = np.array([[0.3, 0.0], [0.12, 0.05]])
    seen = observation(noise=(1.0, 1.0), colour=lambda white: mixing @ white, seed=3)
    X, *_ = np.linalg.lstsq(seen.W, seen.Y, rcond=None)
    E = (seen.Y - seen.W @ X).reshape(2, -1)
    V = np.kron(np.linalg.inv(E @ E.T / (300 - 10 / 2)), np.eye(300))
    expected = np.linalg.solve(seen.W.T @ V @ seen.W, seen.W.T @ V @ seen.Y)
    found = estimate_of(seen, EVERY[3])
    assert np.allclose(found.X, expected, rtol=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(seen.W.T @ V @ seen.W), rtol=1e-8)


@campaign
def test_stated_sigma_matches_the_scatter_of_200_runs():
    # per parameter sum z^2 is chi2(200); 1e-4 and 1 - 1e-4 quantiles over 10 parameters: 1 in 500
    # that a correct code fails, the seed is fixed
    low, high = 131.4, 287.4  # scipy.stats.chi2.ppf([5e-5, 1 - 5e-5], 200)
    for settings, stated in ((OLS, "sigma"), (WLS, "sigma"), (OLS, "sigma_corrected")):
        noise = (0.2, 0.2) if settings is OLS else (0.4, 0.03)
        fits = [estimate_of(observation(N=150, noise=noise, seed=s), settings) for s in range(200)]
        z2 = np.array([((fit.X - TRUE) / getattr(fit, stated)) ** 2 for fit in fits]).sum(axis=0)
        slack = (
            1.15 if stated == "sigma_corrected" else 1.02
        )  # sigma itself is estimated, from 30 blocks: t instead of normal
        assert np.all(z2 > low / slack) and np.all(z2 < high * slack), (stated, z2)


def test_corrected_sigma_follows_correlated_residuals():
    """First-order coloured noise: (10) states too little, the block covariance the right order."""
    a = 0.8

    def colour(white):
        return np.sqrt(1 - a**2) * lfilter([1], [1, -a], white, axis=1)

    fits = [
        estimate_of(observation(N=600, rate=30, noise=(0.3, 0.3), seed=s, colour=colour), OLS)
        for s in range(200)
    ]
    scatter = np.std([fit.X for fit in fits], axis=0, ddof=1)
    stated = np.mean([fit.sigma for fit in fits], axis=0)
    corrected = np.mean([fit.sigma_corrected for fit in fits], axis=0)
    assert (scatter / stated).max() > 1.6
    assert np.all(scatter / corrected < 1.35) and np.all(scatter / corrected > 0.75)


def test_corrected_sigma_with_as_many_parameters_as_blocks():
    """60 parameters, 50 blocks, residuals correlated by 0.8 from row to row: the jackknife states
    the scatter, blocks as they are 0.8 of it.
    """
    rng = np.random.default_rng(11)
    N, b, K, runs = 1000, 60, 50, 80
    r, W = (
        2 * N,
        np.vstack([lfilter([1], [1, -0.9], rng.standard_normal((N, b)), axis=0) for _ in range(2)]),
    )
    blocks, T = (
        np.tile(np.repeat(np.arange(K), N // K), 2),
        np.linalg.inv(np.linalg.qr(W, mode="r")),
    )
    found, jackknife, plain = [], [], []
    for _ in range(runs):
        Y = lfilter([0.6], [1, -0.8], rng.standard_normal((2, N + 100)))[:, 100:].ravel()
        X = T @ T.T @ (W.T @ Y)
        found.append(X)
        jackknife.append(
            np.diag(block_covariance(split_rows(np.column_stack([W, Y]), blocks), X, T))
        )
        g = (
            np.array(
                [
                    rows[:, :-1].T @ (rows[:, -1] - rows[:, :-1] @ X)
                    for rows in split_rows(np.column_stack([W, Y]), blocks)
                ]
            )
            @ T
            @ T.T
        )
        plain.append((g**2).sum(axis=0) * K / (K - 1) * (r - 1) / (r - b))
    real = np.var(found, axis=0, ddof=1)
    assert np.median(np.sqrt(np.mean(jackknife, axis=0) / real)) == pytest.approx(1.0, abs=0.1)
    assert np.median(np.sqrt(np.mean(plain, axis=0) / real)) < 0.85


def test_a_block_that_alone_knows_a_parameter_is_left_out_for_the_others():
    """Five rows a block, so that leverages are large: refits without each block, and no deviation
    for the parameter that only the first of them sees.
    """
    rng = np.random.default_rng(4)
    W, Y = rng.standard_normal((30, 4)), rng.standard_normal(30)
    W[5:, 3] = 0
    blocks = np.split(np.column_stack([W, Y]), 6)
    X, T = np.linalg.lstsq(W, Y, rcond=None)[0], np.linalg.inv(np.linalg.qr(W, mode="r"))
    changes = []
    for k in range(6):
        rest = np.vstack([rows for i, rows in enumerate(blocks) if i != k])
        changes.append(X[:3] - np.linalg.lstsq(rest[:, :-1], rest[:, -1], rcond=None)[0][:3])
    expected = 5 / 6 * sum(np.outer(change, change) for change in changes)
    covariance = block_covariance(blocks, X, T)
    np.testing.assert_allclose(covariance[:3, :3], expected, rtol=1e-9)
    assert np.isnan(covariance[3, 3])


def test_corrected_sigma_is_that_of_estimates_without_one_block():
    """The jackknife from its definition, with the weights of the joints; nothing where one block
    alone determines a parameter.
    """
    seen = observation(N=120, noise=(0.4, 0.03), seed=8)
    settings = EstimateSettings("wls", options={"block": 0.5})
    fit = estimate_of(seen, settings)
    s, blocks = np.repeat([joint.scale for joint in fit.per_joint], 120), seen.blocks(0.5)
    K = blocks.max() + 1
    W, Y = seen.W / s[:, None], seen.Y / s
    without = np.array(
        [np.linalg.lstsq(W[blocks != k], Y[blocks != k], rcond=None)[0] for k in range(K)]
    )
    assert np.allclose(
        fit.sigma_corrected, np.sqrt((K - 1) / K * ((without - fit.X) ** 2).sum(axis=0)), rtol=1e-8
    )
    W = seen.W.copy()
    W[:, seen.names.index("FS2")] = np.where(blocks == 2, W[:, seen.names.index("FS2")], 0.0)
    alone = estimate_of(replace(seen, W=W), settings)
    assert np.isnan(alone.sigma_corrected).sum() == 1 and np.isnan(
        alone.sigma_corrected[alone.names.index("FS2")]
    )


def test_blocks_gather_all_joints_of_an_interval():
    seen = observation(N=40, rate=10)
    blocks = seen.blocks(1.0)
    assert np.array_equal(blocks[:40], np.repeat(np.arange(4), 10))
    assert np.array_equal(blocks[:40], blocks[40:])
    two = replace(seen, record=np.tile(np.repeat([0, 1], 20), 2))
    assert len(set(two.blocks(1.5))) == 4  # 2 s each: no block spans two records


@given(st.floats(1e-4, 1e4), st.floats(1e-4, 1e4), st.integers(0, 1000))
def test_weighted_estimate_ignores_the_scale_of_a_joint(c1, c2, seed):
    seen = observation(N=80, noise=(0.3, 0.05), seed=seed)
    c = np.repeat([c1, c2], 80)
    scaled = replace(seen, W=seen.W * c[:, None], Y=seen.Y * c)
    first, second = estimate_of(seen, WLS), estimate_of(scaled, WLS)
    assert np.allclose(first.X, second.X, rtol=1e-9)
    assert np.allclose(first.sigma, second.sigma, rtol=1e-9)


def test_iterated_weights_reach_a_fixed_point():
    found = estimate_of(observation(noise=(0.4, 0.03), seed=5), EVERY[2])
    assert found.status == "ok" and 1 <= found.iterations < 10
    assert np.allclose(
        [fit.scale for fit in found.per_joint],
        [fit.sigma_rho for fit in found.per_joint],
        rtol=2e-3,
    )
    stopped = estimate_of(
        observation(noise=(0.4, 0.03), seed=5), replace(EVERY[2], options={"passes": 1})
    )
    assert stopped.status in ("ok", "not-converged")


def test_downdating_equals_refactoring():
    seen = observation(noise=(0.3, 0.05), seed=6)
    whole = factor(seen.W, seen.Y, seen.rows, seen.names)
    dropped = whole.drop("MY1").drop("FS2").drop("ZZ1R")
    kept = [i for i, name in enumerate(seen.names) if name not in ("MY1", "FS2", "ZZ1R")]
    fresh = factor(seen.W[:, kept], seen.Y, seen.rows, [seen.names[i] for i in kept])
    assert dropped.names == fresh.names
    assert np.allclose(dropped.R, np.triu(dropped.R))
    assert np.allclose(np.abs(dropped.R), np.abs(fresh.R), atol=1e-11 * np.abs(fresh.R).max())
    X = solve(dropped).X
    assert np.allclose(X, solve(fresh).X, rtol=1e-10)
    for a, b in zip(dropped.joints, fresh.joints, strict=True):
        assert np.isclose(a.residual_norm(X), b.residual_norm(X), rtol=1e-10)
    assert np.allclose(solve(whole.select(fresh.names)).X, X, rtol=1e-10)


def test_parts_combine_to_the_whole():
    seen = observation(N=200, noise=(0.3, 0.05), seed=7)
    half = [np.r_[0:90, 200:290], np.r_[90:200, 290:400]]
    parts = [factor(seen.W[rows], seen.Y[rows], (len(rows) // 2,) * 2, seen.names) for rows in half]
    both, whole = (
        Factor.of(seen.names, merged(part.joints for part in parts)),
        factor(seen.W, seen.Y, seen.rows, seen.names),
    )
    X = solve(whole).X
    assert both.rows == whole.rows
    assert np.allclose(solve(both).X, X, rtol=1e-10)
    assert np.allclose(
        [j.residual_norm(X) for j in both.joints],
        [j.residual_norm(X) for j in whole.joints],
        rtol=1e-10,
    )


@pytest.mark.parametrize("settings", EVERY[:3], ids=KINDS[:3])
def test_rank_loss_names_the_parameters(settings):
    """Joint 2 at rest at q2 = 0: no friction of joint 2; inertias and first moments of the two
    links merge.
    """
    found = estimate_of(observation(motion=one_joint_at_rest, noise=(0.1, 0.1)), settings)
    assert found.status == "rank-deficient"
    assert found.rank < 10
    assert {("FV2",), ("FS2",)} <= set(found.groups)
    assert np.isinf(found.cond)
    assert "FV2, FS2" in found.message and "separated" not in found.message.split("Likely")[1]
    determined = [name for name in found.names if not any(name in group for group in found.groups)]
    assert {"FV1", "FS1"} <= set(determined)
    assert np.all(np.isfinite([found.sigma[found.names.index(name)] for name in determined]))
    assert all(
        np.isnan(found.sigma[found.names.index(name)]) for group in found.groups for name in group
    )
    for fit, residual in zip(found.per_joint, (0.1, 0.1), strict=True):
        assert np.isclose(fit.sigma_rho, residual, rtol=0.2)


def test_rank_loss_groups_are_separate():
    seen = observation(noise=(0.1, 0.1))
    W = seen.W.copy()
    W[:, 2] = 3e4 * W[:, 1]  # units must not matter
    W[:, 9] = 1e-3 * W[:, 8]
    found = estimate_of(replace(seen, W=W), OLS)
    assert found.rank == 8
    assert set(found.groups) == {("MX1R", "MY1"), ("FV2", "FS2")}
    assert "(MX1R, MY1)" in found.message


def test_null_groups_follow_the_projector_not_the_basis():
    rng = np.random.default_rng(0)
    basis = np.zeros((2, 5))
    basis[0, [0, 1]], basis[1, [2, 4]] = np.sqrt(0.5), (0.6, 0.8)
    turn, _ = np.linalg.qr(rng.standard_normal((2, 2)))
    assert null_groups(turn @ basis, "abcde") == (("a", "b"), ("c", "e"))


def test_few_rows_are_a_status():
    seen = observation(N=5)
    found = estimate_of(seen, OLS)
    assert found.status in ("no-redundancy", "rank-deficient")
    assert np.all(np.isnan(found.sigma))
    assert found.message


@pytest.mark.parametrize("settings", EVERY[:3], ids=KINDS[:3])
def test_a_joint_without_rows_is_left_out(settings):
    """All rows of joint 1 dropped (low speed): friction of joint 1 has no effect, the rest is
    estimated from joint 2.
    """
    seen = observation(noise=(0.1, 0.1)).where(np.repeat([False, True], 300))
    found = estimate_of(seen, settings)
    assert [fit.rows for fit in found.per_joint] == [0, 300]
    assert found.status == "rank-deficient"
    assert {("FV1",), ("FS1",), ("ZZ1R",)} <= set(found.groups)
    assert abs(found["FV2"] - TRUE[8]) < 5 * found.sigma[8]
    assert "null" in found.to_json() and "-" in str(found)


def test_columns_restrict_the_estimate():
    seen = observation(noise=(0.1, 0.1))
    kept = ("ZZ1R", "FV1", "FS1", "MX1R", "ZZ2", "MX2", "FV2", "FS2")
    found = estimate_of(seen, EstimateSettings(columns=kept))
    fresh, *_ = np.linalg.lstsq(
        seen.W[:, [seen.names.index(name) for name in kept]], seen.Y, rcond=None
    )
    assert found.names == kept
    assert np.allclose(found.X, fresh, rtol=1e-10)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (EstimateSettings(method="didim"), "section `controller`"),
        (EstimateSettings(weights="joint"), "other weights need method wls"),
        (EstimateSettings(columns=("ZZ9",)), "no parameter ZZ9"),
        (EstimateSettings(options={"colour": 1}), "unknown key colour"),
        (EstimateSettings(options={"block": -1}), "expected more than 0"),
    ],
)
def test_wrong_settings_say_what_to_do(settings, text):
    with pytest.raises(SettingsError, match=text):
        estimate_of(observation(N=50), settings)


def test_covariance_weights_of_joints_that_rest_at_different_times():
    """Generalised least squares with the dense covariance of the rows that are left."""
    mixing = np.array([[0.3, 0.0], [0.12, 0.05]])
    seen = observation(noise=(1.0, 1.0), colour=lambda white: mixing @ white, seed=3)
    seen = seen.where(np.r_[np.arange(300) >= 40, abs(np.arange(300) - 250) > 30])
    X, *_ = np.linalg.lstsq(seen.W, seen.Y, rcond=None)
    E = np.zeros((2, 300))
    instant = np.searchsorted(np.unique(seen.t), seen.t)
    E[seen.joints, instant] = seen.Y - seen.W @ X
    both = (E != 0).astype(float)
    Omega = E @ E.T / (both @ both.T - 10 / 2)
    V = np.linalg.inv(Omega[seen.joints[:, None], seen.joints] * (instant[:, None] == instant))
    expected = np.linalg.solve(seen.W.T @ V @ seen.W, seen.W.T @ V @ seen.Y)
    found = estimate_of(seen, EVERY[3])
    assert seen.rows == (260, 239)
    np.testing.assert_allclose(found.X, expected, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(seen.W.T @ V @ seen.W), rtol=1e-7)
    assert np.isfinite(found.sigma_corrected).all()


def test_wrong_shapes_name_both():
    seen = observation(N=50)
    with pytest.raises(ValueError, match=r"\(100, 10\).*\(99,\)"):
        factor(seen.W, seen.Y[:-1], seen.rows, seen.names)
    with pytest.raises(ValueError, match="not finite"):
        factor(seen.W * np.nan, seen.Y, seen.rows, seen.names)


def test_each_joint_is_factored_on_its_own_columns():
    system = linear_system(observation(), OLS)
    assert [list(joint.columns) for joint in system.raw.joints] == [
        list(np.flatnonzero(planar.STRUCTURE[:, j])) for j in range(2)
    ]
    assert {name for name, method in METHODS.items() if method.linear} == {"ols", "wls"}
