"""Total least squares with exact columns: against the minimum of its own criterion, on simulated
encoders, and where it has to decline.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planar_data import OLS, TRUE, WLS, observation
from scipy.optimize import minimize

from runtime.errors import SettingsError
from runtime.identification.identification import identify
from runtime.loop.methods import estimate_of
from runtime.model.generated import load_model
from runtime.records.record import Origin, Record
from runtime.rows.observation import stack
from runtime.rows.observe import observe
from runtime.rows.position_errors import with_errors
from runtime.settings.study import EstimateSettings, Lowpass, Rows, Signals, Study

EMPS = load_model(Path(__file__).resolve().parents[2] / "generated" / "emps.py")
X_EMPS = np.array([95.0, 203.0, 20.0, -3.0])
NAMES = ("M1R", "FV1", "FS1", "OFFSET1")
STUDY = Study(
    signals=Signals(median=1, lowpass=Lowpass(cutoff=80, on=("q",))),
    rows=Rows(trim=6, low_speed=0.02),
)


def tls(weights="none", **options):
    return EstimateSettings("tls", weights, "all", {"bootstrap": 0, **options})


def axis(seed, error, noise=2.0, N=8000):
    """One prismatic axis at 1 kHz; positions with white errors of deviation `error`, m, forces with
    white noise of `noise`, N.
    """
    t = np.arange(N) / 1000
    q = 0.1 * np.sin(2 * np.pi * 0.6 * t) + 0.02 * np.sin(2 * np.pi * 2.1 * t + 0.4)
    qd = 0.12 * np.pi * np.cos(1.2 * np.pi * t) + 0.084 * np.pi * np.cos(4.2 * np.pi * t + 0.4)
    qdd = -0.144 * np.pi**2 * np.sin(1.2 * np.pi * t) - 0.3528 * np.pi**2 * np.sin(
        4.2 * np.pi * t + 0.4
    )
    D = EMPS.regressor(q[:, None], qd[:, None], qdd[:, None])[:, 0]
    rng = np.random.default_rng(seed)
    tau = D @ X_EMPS + noise * rng.standard_normal(N)
    return Record(
        t,
        q + error * rng.standard_normal(N),
        tau,
        rate=1000.0,
        name="axis",
        origin=Origin({"axis": "0" * 64}),
    )


def rows(seed, error, assumed=None):
    record = axis(seed, error)
    return with_errors(
        EMPS, record, STUDY, observe(EMPS, record, STUDY), error if assumed is None else assumed
    )


def disturbed(C, seed=0, noise=(0.3, 0.1), N=2000):
    """Planar observation whose columns ZZ1R, ZZ2, FV1 carry errors of covariance C in every row of
    joint 1 and 2.
    """
    seen = observation(N=N, rate=100.0, noise=noise, seed=seed)
    columns = [seen.names.index(name) for name in ("ZZ1R", "ZZ2", "FV1")]
    W = seen.W.copy()
    error = np.random.default_rng(seed + 1).multivariate_normal(np.zeros(3), C, size=len(W))
    W[:, columns] += error
    full = np.zeros((2, len(seen.names), len(seen.names)))
    full[np.ix_([0, 1], columns, columns)] = C
    return replace(seen, W=W, errors=full), columns


C3 = np.array([[0.9, 0.2, -0.1], [0.2, 0.5, 0.05], [-0.1, 0.05, 0.2]])


def test_no_noisy_column_is_least_squares():
    seen, _ = disturbed(C3)
    for weights, plain in (
        ("none", OLS),
        ("joint", WLS),
        ("iterated", EstimateSettings("wls", "iterated")),
    ):
        found = estimate_of(seen, tls(weights, position_error=0.0))
        assert np.array_equal(found.X, estimate_of(seen, plain).X) and found.details["noisy"] == []
    exact = replace(seen, errors=np.zeros_like(seen.errors))
    assert np.array_equal(estimate_of(exact, tls(position_error=1.0)).X, estimate_of(seen, OLS).X)


def test_small_errors_come_near_to_least_squares():
    seen, _ = disturbed(1e-12 * C3)
    assert np.allclose(
        estimate_of(seen, tls(position_error=1.0)).X, estimate_of(seen, OLS).X, rtol=1e-6
    )
    assert np.allclose(
        estimate_of(seen, tls("joint", position_error=1.0)).X, estimate_of(seen, WLS).X, rtol=0.02
    )  # t_j and s_j differ a little


def test_exact_data_give_the_parameters_whatever_errors_are_assumed():
    seen = observation()
    errors = np.zeros((2, len(TRUE), len(TRUE)))
    errors[:, :3, :3] = 1e-4 * C3
    found = estimate_of(replace(seen, errors=errors), tls(position_error=1.0, torque_error=0.1))
    assert np.allclose(found.X, TRUE, rtol=1e-8) and found.details["noisy"] == list(seen.names[:3])


def test_minimum_of_the_rayleigh_quotient():
    """sum_j |Y_j - W_j X|^2 / t_j^2 / (1 + X_2' C X_2): what total least squares with known errors
    minimises, minimised by scipy.
    """
    seen, columns = disturbed(0.01 * C3)
    t = np.array([0.4, 0.2])
    found = estimate_of(seen, tls("joint", position_error=1.0, torque_error=tuple(t)))
    row = np.repeat(t, seen.rows)
    C = 0.01 * C3 * np.mean(t**-2.0)
    scale = np.abs(TRUE) + 0.1

    def cost(z):
        X = z * scale
        return (
            np.sum(((seen.Y - seen.W @ X) / row) ** 2)
            / (1 + X[columns] @ C @ X[columns])
            / len(row)
        )

    start = minimize(cost, estimate_of(seen, WLS).X / scale, method="BFGS", options={"gtol": 1e-10})
    best = minimize(
        cost,
        start.x,
        method="Nelder-Mead",
        options={"xatol": 1e-10, "fatol": 1e-15, "maxiter": 20000, "adaptive": True},
    )
    assert cost(found.X / scale) <= best.fun * (1 + 1e-9)
    assert np.allclose(found.X, best.x * scale, rtol=1e-3, atol=1e-4)


def test_errors_in_columns_bias_least_squares_and_not_tls():
    ordinary, corrected, sigma = [], [], []
    for seed in range(60):
        seen, _ = disturbed(C3, seed=seed, N=500)
        ordinary.append(estimate_of(seen, OLS).X)
        found = estimate_of(seen, tls(position_error=1.0, bootstrap=30))
        corrected.append(found.X)
        sigma.append(found.sigma)
    biased, right = np.mean(ordinary, axis=0) - TRUE, np.mean(corrected, axis=0) - TRUE
    scatter = np.std(corrected, axis=0, ddof=1)
    assert abs(biased[0] / TRUE[0]) > 0.05
    assert np.all(np.abs(right) < 4 * scatter / np.sqrt(60) + 0.1 * np.abs(biased))
    assert np.median(np.mean(sigma, axis=0) / scatter) == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize("error", [2e-5, 4e-5])
def test_simulated_encoder(error):
    """Positions of an axis through the filters of the identification: OLS loses mass, TLS with the
    covariance of the filters does not.
    """
    ordinary, corrected = [], []
    for seed in range(12):
        seen = rows(seed, error)
        ordinary.append(estimate_of(seen, OLS)["M1R"])
        corrected.append(estimate_of(seen, tls(position_error=error), model=EMPS)["M1R"])
    lost, left = np.mean(ordinary) - X_EMPS[0], np.mean(corrected) - X_EMPS[0]
    assert lost < -0.04 * X_EMPS[0]
    assert abs(left) < 0.1 * abs(lost)


def test_torque_noise_is_what_the_positions_leave():
    found = estimate_of(rows(0, 2e-7), tls(position_error=2e-7))
    assert found.details["exact"] == ["FS1", "OFFSET1"] and found.details["noisy"] == ["M1R", "FV1"]
    assert found.details["torque_error"][0] == pytest.approx(
        estimate_of(rows(0, 0.0), OLS).sigma_rho, rel=0.05
    )


def test_errors_assumed_that_hide_the_parameters_are_declined():
    seen = rows(0, 2e-3)
    found = estimate_of(seen, tls(position_error=2e-3))
    assert found.status == "ill-posed" and "no usable solution" in found.message
    assert np.array_equal(found.X, estimate_of(seen, OLS).X)


def test_whole_identification(tmp_path):
    """errors travel through stacking, essential columns and windows."""
    study = replace(STUDY, estimate=tls(position_error=1e-5))
    found = identify(EMPS, [axis(1, 1e-5), axis(2, 1e-5)], study, provenance={"simulated": True})
    assert found.estimate.method == "tls" and found.estimate["M1R"] == pytest.approx(95, rel=0.02)
    one, other = rows(1, 1e-5), rows(2, 1e-5)
    both = stack([one, other])
    assert np.allclose(
        both.errors, (one.errors * one.rows[0] + other.errors * other.rows[0]) / both.rows[0]
    )
    assert (
        both.columns(("FV1", "M1R")).errors.shape == (1, 2, 2)
        and stack([one, replace(other, errors=None)]).errors is None
    )


def test_bad_settings():
    seen, _ = disturbed(C3)
    for settings, words in (
        (EstimateSettings("tls"), "position_error"),
        (tls(position_error=-1.0), "position_error: -1.0; expected at least 0"),
        (tls(position_error=1.0, torque_error=(1.0, 1.0, 1.0)), "one or 2"),
        (tls(position_error=1.0, torque_error=0.0), "torque_error: 0.0; expected more than 0"),
        (tls("covariance", position_error=1.0), "covariance"),
        (tls(position_error=1.0, step=2), "step"),
    ):
        with pytest.raises(SettingsError, match=words):
            estimate_of(seen, settings)
    with pytest.raises(SettingsError, match="with_errors"):
        estimate_of(replace(seen, errors=None), tls(position_error=1.0))
    with pytest.raises(SettingsError, match="median"):
        with_errors(EMPS, axis(0, 0.0), replace(STUDY, signals=Signals()), rows(0, 1e-5), 1e-5)
