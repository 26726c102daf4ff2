"""Rows that repeat the packets of a slower bus are left out; right records stay as they are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import planar_arm
import pytest

import symgen
from runtime.compose import estimate, identify, problem, read_record
from runtime.core.record import Record
from runtime.ground.errors import InputError
from runtime.packets.held import held_positions
from runtime.packets.packets import slowest_bus
from runtime.study import study_from_mapping

RATE = 500.0  # Hz
STEP = 2 * np.pi / 65536  # rad
STUDY = study_from_mapping({})
DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASE = Path(DATA).parent / "cases5" / "held_rows"


@pytest.fixture(scope="module")
def arm():
    return planar_arm.arm()


def motion(seed):
    """t, q, qd, qdd of five sines of each joint at RATE."""
    t, rng = np.arange(8000) / RATE, np.random.default_rng(seed)
    a, phase = rng.uniform(0.1, 0.4, (5, 2)), rng.uniform(0, 6, (5, 2))
    w = 2 * np.pi * 0.2 * np.arange(1, 6)[:, None]
    angle = w * t[:, None, None] + phase
    waves = (a * np.sin(angle), a * w * np.cos(angle), -a * w**2 * np.sin(angle))
    return t, *(x.sum(axis=1) for x in waves)


def with_noise(tau, seed=1):
    return tau + 0.03 * np.random.default_rng(seed).standard_normal(tau.shape)


def measured(arm, seed=0):
    """t, q, tau of a right record: encoders with steps, torques with noise."""
    t, q, qd, qdd = motion(seed)
    tau = arm.inverse_dynamics(q, qd, qdd, planar_arm.parameters(arm))
    return t, STEP * np.round(q / STEP), with_noise(tau)


def repeated(x, period, phase=0.0):
    """The last packet of a bus of that period, rows, in each row of a log."""
    first = np.floor((np.arange(len(x)) - phase) / period) * period + phase
    return np.stack([np.interp(first, np.arange(len(x)), column) for column in x.T], axis=1)


def errors(arm, record):
    """Largest error of the parameters, of the largest parameter; notes on packets."""
    whole = problem(arm, record, STUDY)
    found = estimate(arm, record, STUDY)
    X = planar_arm.parameters(arm)
    note = whole.noted("packets")
    return np.abs(found.X - X).max() / np.abs(X).max(), "" if note is None else note.text, whole


@pytest.mark.parametrize("period", [10.0, 4.0, 20 / 3, 2.5, 4 / 3])
@pytest.mark.parametrize("what", ["rows", "positions", "torques"])
def test_packets_of_a_slower_bus_are_used_once(arm, what, period) -> None:
    """A log of 500 Hz; torques alone are told if half a period of the bus is a delay that shows."""
    t, q, tau = measured(arm)
    positions = q if what == "torques" else repeated(q, period)
    torques = tau if what == "positions" else repeated(tau, period)
    error, told, whole = errors(arm, Record(t, positions, torques, rate=RATE))
    assert error < 0.03
    if what != "torques" or period >= 4:
        assert f"change once in {period:.4g} rows" in told
        assert whole.records[0].rate == pytest.approx(RATE / period, rel=1e-3)
        assert f"{len(t) - len(whole.records[0])} of {len(t)} rows" in told


def test_torques_that_the_drives_hold_are_measured_in_every_row(arm) -> None:
    """The motion is that of the held torque: dropping rows would make the torque early."""
    rng, period, dt = np.random.default_rng(4), 20, 1 / RATE
    X, q, qd = planar_arm.parameters(arm), np.array([0.2, -0.4]), np.zeros(2)
    target = motion(3)
    Q, TAU = [], []
    for k in range(len(target[0])):
        if k % period == 0:
            tau = 60 * (target[1][k] - q) + 8 * (target[2][k] - qd) + 3 * rng.standard_normal(2)
        Q.append(q)
        TAU.append(tau)
        for _ in range(2):
            qdd = arm.forward_dynamics(q, qd, tau, X)
            qd = qd + dt / 2 * qdd
            q = q + dt / 2 * qd
    record = Record(target[0], np.array(Q), np.array(TAU), rate=RATE)
    bus = slowest_bus(record)
    assert bus is not None and bus.tau and not bus.q
    whole = problem(arm, record, STUDY)
    assert whole.noted("packets") is None and whole.records[0] is record


@pytest.mark.parametrize(("count", "length"), [(14, 3), (40, 1), (20, 8)])
def test_held_packets_are_replaced(arm, count, length) -> None:
    t, q, tau = measured(arm)
    rng = np.random.default_rng(5)
    speed = np.abs(np.gradient(q, axis=0)).max(axis=1)
    fast = np.flatnonzero(speed > np.median(speed))
    for k in rng.choice(fast[(fast > 40) & (fast < len(q) - 40)][::40], count, replace=False):
        q[k + 1 : k + 1 + length], tau[k + 1 : k + 1 + length] = q[k], tau[k]
    record = Record(t, q, tau, rate=RATE)
    error, told, whole = errors(arm, record)
    assert error < 0.02 and f"{count} packets were held: {count * length} of {len(t)} rows" in told
    assert not held_positions(whole.records[0].q).any()
    result = identify(arm, record, STUDY, plausible=True)
    assert result.checklist.state == "good", result.checklist.doubt
    assert "packets were held" in str(result)


def test_packets_of_different_times_are_refused(arm) -> None:
    t, q, tau = measured(arm)
    apart = np.column_stack([repeated(q, 10.0)[:, 0], repeated(q, 10.0, 5.0)[:, 1]])
    for positions, torques in ((apart, tau), (repeated(q, 4.0), repeated(tau, 10.0))):
        with pytest.raises(InputError, match="measured at different times; log each packet once"):
            problem(arm, Record(t, positions, torques, rate=RATE), STUDY)


def test_positions_that_repeat_at_no_uniform_times_are_refused(arm) -> None:
    t, q, tau = measured(arm)
    new = np.cumsum(np.random.default_rng(6).integers(3, 15, len(t)))
    last = np.searchsorted(new, np.arange(len(t)), side="right") - 1
    rows = np.where(last < 0, 0, new[last])
    with pytest.raises(InputError, match="at no uniform times"):
        problem(arm, Record(t, q[rows], tau[rows], rate=RATE), STUDY)


@pytest.mark.parametrize("step", [0.0, 2 * np.pi / 500, 2 * np.pi / 4096])
@pytest.mark.parametrize("torque_step", [0.0, 0.5])
@pytest.mark.parametrize("slow", [1.0, 0.1])
@pytest.mark.parametrize("stands", [False, True])
def test_right_records_stay_as_they_are(arm, step, torque_step, slow, stands) -> None:
    """Coarse encoders, slow motion, coarse torques, a joint that stands."""
    t, q, qd, qdd = motion(7)
    q, qd, qdd = slow * q, slow * qd, slow * qdd
    if stands:
        q[:, 1], qd[:, 1], qdd[:, 1] = 0.3, 0.0, 0.0
    tau = with_noise(arm.inverse_dynamics(q, qd, qdd, planar_arm.parameters(arm)))
    if torque_step:
        tau = torque_step * np.round(tau / torque_step)
    if step:
        q = step * np.round((q + step * np.random.default_rng(8).standard_normal(q.shape)) / step)
    record = Record(t, q, tau, rate=RATE)
    whole = problem(arm, record, STUDY)
    assert whole.noted("packets") is None and whole.records[0] is record


def test_the_shared_case_is_read_at_the_rate_of_its_bus() -> None:
    if not CASE.is_dir() and not os.environ.get("SYMGEN_REQUIRE_DATA"):
        pytest.skip(f"{CASE} is not there")
    model = symgen.model(CASE / "two.urdf")
    record = read_record(CASE / "log.csv.gz")
    result = identify(model, record, STUDY, plausible=True)
    assert result.checklist.answer == "Yes, as far as judged", result.checklist.doubt
    told = result.problem.noted("packets").text
    assert "change once in 10 rows" in told and "20 Hz; 5400 of 6000 rows" in told
    fit = result.model_estimate
    sigma = dict(zip(fit.names, fit.sigma_corrected, strict=True))
    for name, true in {"ZZ1R": 0.1887, "MX1R": 0.540, "ZZ2": 0.0180, "MX2": 0.100}.items():
        assert abs(fit[name] - true) < min(1.96 * sigma[name], 0.05 * true), name
