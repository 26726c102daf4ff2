"""Runs of resolution studies of a simulated record: moved positions, order of the columns, steps that are too large."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from problems import linear_system

from runtime import load_model
from runtime.advisor.coarse_encoders import CoarseEncoders
from runtime.compose import cestac, problem
from runtime.core.cestac.perturbed import system_of
from runtime.core.model import GeneratedModel
from runtime.core.record import Origin, Record
from runtime.core.rows.regressor import Columns
from runtime.core.study import EstimateSettings, Lowpass
from runtime.ground.errors import InputError
from runtime.study import CestacSettings, Rows, Signals, Study


@pytest.fixture(scope="module")
def planar() -> GeneratedModel:
    return load_model("planar_2r", folder=Path(__file__).parents[2] / "generated")


def record_of(model: GeneratedModel, N: int, seed: int, rate: float = 1000.0) -> Record:
    """A simulated record: sums of sinusoids, torques of random parameters and noise."""
    rng, n, t = np.random.default_rng(seed), len(model.JOINTS), np.arange(N) / rate
    a, w, p = (
        rng.uniform(0.3, 1.0, (4, n)),
        rng.uniform(1.0, 9.0, (4, n)),
        rng.uniform(0, 6, (4, n)),
    )
    angle = t[:, None, None] * w + p
    q, qd, qdd = (
        (a * np.sin(angle)).sum(1),
        (a * w * np.cos(angle)).sum(1),
        -(a * w**2 * np.sin(angle)).sum(1),
    )
    tau = model.regressor(q, qd, qdd) @ rng.uniform(
        0.2, 2.0, len(model.BASE_PARAMETERS)
    ) + 0.05 * rng.standard_normal((N, n))
    return Record(
        t, q, tau, rate=rate, name="simulated", origin=Origin({"simulated.csv": "ab" * 32})
    )


def study(signals: Signals | None = None, rows: Rows | None = None, **settings: object) -> Study:
    chosen = CestacSettings(**{"delta": (1e-4, 2e-4), "runs": 2, "columns": "all", **settings})
    return Study(
        signals=signals or Signals(median=1, lowpass=Lowpass(cutoff=20)),
        rows=rows or Rows(),
        cestac=chosen,
    )


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_positions_moved_by_an_encoder(planar, method):
    """One encoder coarse: the whole pipeline on moved positions."""
    settings = replace(study(median=1), estimate=EstimateSettings(method))
    record, step = record_of(planar, 1500, 4), 1e-3
    q = record.q.copy()
    q[:, 1] = step * np.round(q[:, 1] / step)
    whole, names = problem(planar, record, settings), planar.BASE_PARAMETERS
    real = CoarseEncoders(whole, names, None, "phase", whole.reader)
    found = real.reference * real.ratios([real._counts(step, np.zeros(2), (1,), ())], (1,))[0]
    task = real.task
    system = system_of(Columns(planar, task.names), task, [q], [task.records[0].torque])
    right = linear_system(system, settings.estimate).solve().X
    np.testing.assert_allclose(found, right, rtol=1e-9)
    assert abs(found / real.reference - 1).max() > 1e-5


def test_columns_in_an_order_of_their_own(planar):
    record, names = record_of(planar, 1500, 1), tuple(reversed(planar.BASE_PARAMETERS[2:]))
    assert cestac(planar, record, study(columns=names)).names[: len(names)] == names


def test_steps_that_overflow_are_an_error(planar):
    with pytest.raises(InputError, match="expected at most 1000"):
        cestac(planar, record_of(planar, 1500, 4), study(delta=(1e308,)))
