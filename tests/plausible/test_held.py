"""A controller that repeats samples: named as such, and no lost counts."""

from __future__ import annotations

import numpy as np
import pytest

import runtime
import symgen
from runtime.packets.held import held_positions
from runtime.study import study_from_mapping

T = np.arange(0, 21, 0.002)
STEP = 2 * np.pi / 20000


def motion():
    w = 2 * np.pi * np.array([[0.2, 0.5], [0.3, 0.8]])
    a = np.array([[0.6, 0.3], [0.7, 0.2]])
    phase = w * T[:, None, None] + np.array([0.0, 1.0])
    return [
        x.sum(-1) for x in (a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase))
    ]


def with_holds(q, count, length, seed=1):
    q, at = q.copy(), np.zeros(len(q), dtype=bool)
    rng = np.random.default_rng(seed)
    speed = np.abs(np.gradient(q, axis=0)).max(axis=1)
    for k in rng.choice(np.flatnonzero(speed > np.median(speed))[20:-20:40], count, replace=False):
        q[k + 1 : k + 1 + length] = q[k]
        at[k + 1 : k + 1 + length] = True
    return q, at


@pytest.fixture(scope="module")
def arm():
    return symgen.model("planar_2r")


@pytest.mark.parametrize(("count", "length"), [(14, 3), (5, 8), (40, 1)])
def test_held_samples_are_found(count, length) -> None:
    q = motion()[0]
    held, at = with_holds(q, count, length)
    np.testing.assert_array_equal(held_positions(held).any(axis=1), at)
    assert not held_positions(q).any()
    coarse = 0.0126 * np.round(q / 0.0126)
    assert not held_positions(coarse).any()


@pytest.mark.parametrize("count", [14, 60])
def test_they_are_replaced_and_told(arm, count) -> None:
    q, qd, qdd = motion()
    X = arm.base_parameters(arm.VALUES)
    rng = np.random.default_rng(2)
    tau = arm.inverse_dynamics(q, qd, qdd, X) + 0.05 * rng.standard_normal(q.shape)
    record = runtime.Record(T, with_holds(q, count, 6)[0], tau)
    result = runtime.identify(arm, record, study_from_mapping({}), plausible=True)
    checks = {check.question: check for check in result.checklist.checks}
    assert checks["Are the positions those of a motion?"].state == "good"
    told = checks["Is every row a measurement?"]
    assert told.state == "good"
    assert f"{count} packets were held: {6 * count} of {len(T)} rows" in told.finding


def test_the_reader_of_counts_takes_no_catch_up_for_lost_counts(arm) -> None:
    q, qd, qdd = motion()
    X = arm.base_parameters(arm.VALUES)
    counted = STEP * np.round(with_holds(q, 14, 6)[0] / STEP)
    record = runtime.Record(T, counted, arm.inverse_dynamics(q, qd, qdd, X))
    study = study_from_mapping({"signals": {"reader": "counts", "step": STEP}})
    observation = runtime.observe(arm, record, study)
    assert "lost" not in " ".join(observation.findings)
    read = runtime.estimate(arm, record, study)
    np.testing.assert_allclose(read.X, X, atol=0.01 * np.abs(X).max())
