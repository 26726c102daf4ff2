"""Simulated TX40 records with a known truth, the `values` of the robot file, through the emitted
module, decimation and least squares.

The states are exact, so least squares is unbiased: noise-free torques give the parameters back, and
over many records with torque noise the stated deviations are those of the scatter.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import sampled

from runtime.compose import estimate_of
from runtime.core.model import load_model
from runtime.core.record import Record
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import select_rows
from runtime.core.signals.filters import States
from runtime.core.study import EstimateSettings
from runtime.study import study_from_mapping

RATE, N = 500.0, 4000
NOISE = np.array([3.0, 3.0, 2.0, 0.8, 0.8, 0.5])  # N m, of each joint
STUDY = study_from_mapping(
    {"signals": {"median": 1, "lowpass": None, "decimate": {"factor": 5}}, "rows": {"trim": 0}}
)


@pytest.fixture(scope="module")
def tx40():
    return load_model(Path(__file__).resolve().parents[2] / "generated" / "tx40.py")


@pytest.fixture(scope="module")
def states() -> States:
    """Sums of sinusoids, exact with their derivatives: five per joint."""
    rng = np.random.default_rng(8)
    t = np.arange(N) / RATE
    w = 2 * np.pi * np.arange(1, 6)[:, None] / (N / RATE) * rng.integers(1, 4, (6, 1, 1))
    a, b = rng.standard_normal((2, 6, 5, 1)) / np.arange(1, 6)[:, None]
    q = (a * np.sin(w * t) + b * np.cos(w * t)).sum(1).T
    qd = (w * (a * np.cos(w * t) - b * np.sin(w * t))).sum(1).T
    qdd = (-(w**2) * (a * np.sin(w * t) + b * np.cos(w * t))).sum(1).T
    return States(q, qd, qdd)


@pytest.fixture(scope="module")
def truth(tx40):
    return tx40.base_parameters(tx40.VALUES)


@pytest.fixture(scope="module")
def clean(tx40, states, truth):
    """Torques (N, 6), rows and the noise-free observation."""
    tau = tx40.inverse_dynamics(states.q, states.qd, states.qdd, truth)
    record = Record(np.arange(N) / RATE, states.q, tau, rate=RATE)
    selection = select_rows(record, states.qd, STUDY.signals, STUDY.rows)
    return (
        tau,
        selection,
        observation_of(Columns(tx40), states, decimated_torque(tau, selection), selection),
    )


def test_noise_free_records_give_the_parameters_back(clean, truth) -> None:
    found = estimate_of(clean[2], EstimateSettings())
    assert found.status == "ok" and found.rank == 60
    assert np.abs(found.X - truth).max() <= 1e-9 * np.abs(truth).max()


@pytest.mark.parametrize("runs", [40, *sampled([200], 0, more=0)])
@pytest.mark.parametrize("method", ["ols", "wls"])
def test_stated_sigma_is_the_scatter_over_records(clean, truth, method: str, runs: int) -> None:
    """z = (X - truth)/sigma has variance 1. OLS with unequal joints: the correlation-corrected
    sigma; WLS: that of eq. (10) too.

    The decimation filter passes 0.8 of the new band, so neighbouring rows are correlated by some
    per cent: bounds of 15 % on the mean over the parameters and of 35 % on each (200 runs: 10 % at
    two deviations; 40 runs: 22 %).
    """
    tau, selection, seen = clean
    settings = EstimateSettings(method=method, weights="joint" if method == "wls" else "none")
    plain, corrected = [], []
    for seed in range(runs):
        noise = NOISE * np.random.default_rng(1000 + seed).standard_normal(tau.shape)
        Y = decimated_torque(tau + noise, selection).reshape(-1)
        found = estimate_of(replace(seen, Y=Y), settings)
        plain.append((found.X - truth) / found.sigma)
        corrected.append((found.X - truth) / found.sigma_corrected)
    z = np.sqrt(np.mean(np.square(corrected), axis=0))
    assert 0.85 < z.mean() < 1.15
    assert z.min() > 0.65 and z.max() < 1.35
    assert np.abs(np.mean(corrected, axis=0)).max() < 4.5 / np.sqrt(runs)  # no bias
    if method == "wls":
        assert 0.85 < np.sqrt(np.mean(np.square(plain))) < 1.15
