"""Robust least squares: against a minimisation of Huber's and Tukey's criteria, on outliers, on the
EMPS record.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign
from planar_data import OLS, TRUE, observation
from scipy.optimize import least_squares

from runtime.compose import estimate_of, observe
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import load_model
from runtime.core.study import EstimateSettings
from runtime.ground.errors import SettingsError
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.robust import slope, weight
from runtime.study import study_from_mapping

HUBER = EstimateSettings(method="irls")
TUKEY = EstimateSettings(method="irls", options={"loss": "tukey"})


def with_outliers(share=0.05, size=20.0, seed=4, N=1500):
    """Some rows of joint 2 are off by `size` N m, always the same way."""
    seen = observation(N=N, rate=100.0, noise=(0.4, 0.1), seed=seed)
    Y = seen.Y.copy()
    hit = np.random.default_rng(seed).choice(np.arange(N, 2 * N), int(share * N), replace=False)
    Y[hit] += size
    return replace(seen, Y=Y)


@pytest.mark.parametrize("settings", [HUBER, TUKEY])
def test_exact_data_give_the_parameters(settings):
    found = estimate_of(observation(), settings)
    assert found.status == "ok" and np.allclose(found.X, TRUE, rtol=1e-9)


@pytest.mark.parametrize(("settings", "loss"), [(HUBER, "huber"), (TUKEY, "tukey")])
def test_minimum_of_the_criterion(settings, loss):
    """scipy minimises sum rho(e/S) with the scales found; rows are many, so that leverage hardly
    counts.
    """
    seen = with_outliers()
    found = estimate_of(seen, settings)
    S = np.repeat(found.details["scales"], seen.rows)
    c = {"huber": 1.345, "tukey": 4.685}[loss]

    def tukey(z):
        v = np.minimum(z, 1.0)
        inside = z < 1
        return np.array(
            [
                (1 - (1 - v) ** 3) / 3,
                np.where(inside, (1 - v) ** 2, 0),
                np.where(inside, -2 * (1 - v), 0),
            ]
        )

    minimum = least_squares(
        lambda X: (seen.Y - seen.W @ X) / S,
        found.X + found.sigma,
        loss="huber" if loss == "huber" else tukey,
        f_scale=c,
        xtol=1e-14,
        ftol=1e-14,
    )
    assert np.max(np.abs(found.X - minimum.x) / found.sigma) < 0.05


@pytest.mark.parametrize("settings", [HUBER, TUKEY])
def test_outliers_count_less_and_are_told(settings):
    seen = with_outliers()
    found, plain = estimate_of(seen, settings), estimate_of(seen, OLS)
    assert np.linalg.norm(found.X - TRUE) < 0.25 * np.linalg.norm(plain.X - TRUE)
    assert found.details["down_weighted"]["2"] > 0.045 > 0.02 > found.details["down_weighted"]["1"]
    assert "joint 2" in found.message and "Share of rows" in found.message
    assert (
        Estimate.from_json(found.to_json()).details["down_weighted"]
        == found.details["down_weighted"]
    )


@campaign
@pytest.mark.parametrize("settings", [HUBER, pytest.param(TUKEY, marks=pytest.mark.campaign)])
def test_normal_noise_costs_five_per_cent_and_sigma_matches_the_scatter(settings):
    runs = [
        estimate_of(observation(N=400, rate=40.0, noise=(0.3, 0.2), seed=k), settings)
        for k in range(150)
    ]
    scatter = np.std([run.X for run in runs], axis=0, ddof=1)
    ratio = scatter / np.mean([run.sigma for run in runs], axis=0)
    assert np.all((ratio > 0.8) & (ratio < 1.25))  # 150 runs: 6 % one sigma
    assert np.median(
        np.mean([run.sigma_corrected for run in runs], axis=0) / scatter
    ) == pytest.approx(1, abs=0.15)
    weighted = [
        estimate_of(
            observation(N=400, rate=40.0, noise=(0.3, 0.2), seed=k), EstimateSettings(method="wls")
        ).X
        for k in range(150)
    ]
    efficiency = np.median(np.var(weighted, axis=0) / np.var([run.X for run in runs], axis=0))
    assert 0.88 < efficiency < 1.01  # 95 % by the tuning constants


def test_scaling_of_one_joint_changes_nothing():
    seen = with_outliers()
    factor = np.repeat([1.0, 1000.0], seen.rows)
    scaled = replace(seen, W=seen.W * factor[:, None], Y=seen.Y * factor)
    one, other = estimate_of(seen, HUBER), estimate_of(scaled, HUBER)
    assert np.allclose(one.X, other.X, rtol=1e-9) and np.allclose(one.sigma, other.sigma, rtol=1e-7)


def test_weights_are_psi_over_u():
    u = np.array([-9.0, -2.0, -0.3, 0.3, 1.0, 4.0])
    for loss, c in (("huber", 1.345), ("tukey", 4.685)):
        step = 1e-6
        difference = (
            weight(u + step, loss, c) * (u + step) - weight(u - step, loss, c) * (u - step)
        ) / (2 * step)
        assert np.allclose(slope(u, loss, c), difference, atol=1e-6)


def test_rank_loss_and_bad_options():
    seen = observation()
    lost = replace(seen, W=np.column_stack([seen.W[:, 0], seen.W[:, :-1]]))
    assert estimate_of(lost, HUBER).status == "rank-deficient"
    assert (
        estimate_of(with_outliers(), EstimateSettings(method="irls", options={"passes": 1})).status
        == "not-converged"
    )
    for options, words in (
        ({"loss": "cauchy"}, "huber"),
        ({"tuning": -1}, "tuning: -1; expected more than 0"),
        ({"k": 1}, "tuning"),
    ):
        with pytest.raises(SettingsError, match=words):
            estimate_of(seen, EstimateSettings(method="irls", options=options))
    with pytest.raises(SettingsError, match="its own weights"):
        estimate_of(seen, EstimateSettings(method="irls", weights="joint"))


def test_emps_record(emps_data):
    study = study_from_mapping(dataset_study("emps"))
    model = load_model(Path(__file__).resolve().parents[1] / "generated" / "emps.py")
    seen = observe(model, read_records(study.record, model)[0], study)
    plain = estimate_of(seen, study.estimate)
    for settings in (HUBER, TUKEY):
        found = estimate_of(seen, settings, model=model)
        assert found.status == "ok" and np.allclose(found.X, plain.X, rtol=0.07)
        assert found.relative_error < 1.05 * plain.relative_error
