"""Velocities that were recorded beside the positions: the quieter of both at every frequency, told
where they disagree, the same rows by blocks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import TRUE, motion
from problems import resolved

from runtime import identify
from runtime.compose import observe, plausibility
from runtime.core.record import Record
from runtime.core.signals.filters import filtered_states
from runtime.core.signals.velocities import agreement
from runtime.core.study import Lowpass
from runtime.study import Signals, Study

RATE, N = 500.0, 8000
STEP, NOISE = 2e-3, 4e-3  # rad, rad/s


def record(seed=0, gain=1.0, lag=0.0, step=STEP):
    """Coarse positions, quiet velocities."""
    t, rng = np.arange(N) / RATE, np.random.default_rng(seed)
    q, *_ = motion(t)
    tau = (planar.observation_matrix(*motion(t)) @ TRUE).reshape(2, -1).T
    v = gain * motion(t - lag)[1] + NOISE * rng.standard_normal((N, 2))
    tau = tau + 0.05 * rng.standard_normal((N, 2))
    return Record(t, step * np.round(q / step), tau, qd=v)


STUDY = Study(signals=Signals(median=1, lowpass=Lowpass(cutoff=20)))


def test_the_quieter_of_both_at_every_frequency():
    """Errors of velocity and acceleration below those of either alone."""
    t = np.arange(N) / RATE
    _, qd, qdd = motion(t)
    given, inner = record(), slice(400, -400)
    v = given.channels["qd"]
    study, text = resolved(STUDY, [given])
    assert "Recorded velocities take over above" in text

    def errors(signals):
        states = filtered_states(given.q, RATE, signals, v)
        return [
            float(np.sqrt(np.mean((x - y)[inner] ** 2)))
            for x, y in ((states.qd, qd), (states.qdd, qdd))
        ]

    both = errors(study.signals)
    for alone in ("differences", 1e-2):  # of the positions, of the velocities
        other = errors(replace(study.signals, velocity=alone))
        assert all(np.less_equal(both, np.array(other) * 1.02)), (alone, both, other)
    assert both[1] < 0.5 * errors(replace(study.signals, velocity="differences"))[1]


def test_parameters_are_nearer_to_the_truth():
    low = Lowpass(cutoff=40)
    study = Study(signals=Signals(lowpass=low))
    off = Study(signals=Signals(lowpass=low, velocity="differences"))
    errors = []
    for settings in (study, off):
        X = [
            identify(planar, record(seed), settings, plausible=False).estimate.X
            for seed in range(3)
        ]
        errors.append(np.abs(np.mean(X, axis=0) - TRUE)[[0, 5]].max())
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize(("gain", "lag"), [(1.2, 0.0), (1.0, 0.05), (np.pi / 180, 0.0), (-1, 0)])
def test_what_disagrees_is_told_and_not_used(gain, lag):
    given = record(gain=gain, lag=lag)
    told = plausibility(planar, given, STUDY)
    (check,) = (c for c in told.checks() if "recorded velocities" in c.question)
    assert check.state == "doubtful"
    study, text = resolved(STUDY, [given])
    assert "of joint 1, 2 disagree" in text and study.signals.velocity == (RATE / 2, RATE / 2)
    X, Y = (observe(planar, x, study) for x in (given, replace(given, qd=None)))
    np.testing.assert_array_equal(X.W, Y.W)


@pytest.mark.parametrize("gain", [180 / np.pi, -1.0, 0.5])
def test_a_delay_is_in_seconds_whatever_the_unit_of_the_velocity(gain):
    given = record(gain=gain, lag=0.025)
    found = agreement(given.q, given.channels["qd"], given.rate, STUDY.signals)
    np.testing.assert_allclose(found.lag, 0.025, atol=2e-3)
    np.testing.assert_allclose(found.gain, gain, rtol=0.04)


def test_good_velocities_are_told_so():
    told = plausibility(planar, record(), STUDY)
    (check,) = (c for c in told.checks() if "recorded velocities" in c.question)
    assert check.state == "good" and "1.000 times the derivative" in check.finding


def test_without_recorded_velocities_nothing_changes():
    given = replace(record(), qd=None)
    study, text = resolved(STUDY, [given])
    assert study.signals.velocity == "auto" and not text
