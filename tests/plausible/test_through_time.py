"""Along one record: jumps of positions, torques cut off; records that only look like it are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import runtime
import symgen
from runtime.plausible.plausibility import Plausibility
from symgen.description.yaml import parse_robot

ARM = b"""\
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {L1: 0.4, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: L1, theta: q2, r: 0}
elements: {FV: {kind: viscous, along: all}, FS: {kind: coulomb, along: all}}
"""
MODEL = symgen.model(parse_robot(ARM, "arm"))


@pytest.fixture(scope="module")
def right() -> runtime.Record:
    """20 s at 500 Hz, 2 % of noise."""
    t = np.arange(10_000)[:, None] / 500
    w, a = np.array([[2.0, 2.6], [5.0, 4.1]]), np.array([[1.2, 0.9], [0.5, 0.6]])
    q, qd, qdd = (
        sum(a[k] * f(w[k] * t) * w[k] ** p for k in (0, 1))
        for p, f in ((0, np.sin), (1, np.cos), (2, lambda x: -np.sin(x)))
    )
    chi = dict.fromkeys(MODEL.STANDARD_PARAMETERS, 0.0)
    chi |= {
        "ZZ1": 0.5,
        "MX1": 1.0,
        "M2": 3.0,
        "MX2": 0.6,
        "ZZ2": 0.2,
        "FV1": 0.5,
        "FS1": 0.4,
        "FV2": 0.3,
        "FS2": 0.2,
    }
    tau = MODEL.inverse_dynamics(q, qd, qdd, MODEL.base_parameters(chi))
    return runtime.Record(
        t[:, 0],
        q,
        tau + 0.02 * tau.std(axis=0) * np.random.default_rng(0).standard_normal(tau.shape),
    )


def judged(record: runtime.Record) -> Plausibility:
    study = runtime.Study(signals={"lowpass": {"cutoff": 50}})
    return runtime.plausibility(MODEL, record, study)


def test_a_right_record_and_one_of_coarse_counts_are_left_alone(right: runtime.Record) -> None:
    assert judged(right).worst is None
    assert not any(
        "motion" in check.question
        for check in judged(replace(right, q=np.round(right.q / 0.06) * 0.06)).checks()
        if check.state == "no"
    )


@pytest.mark.parametrize(
    ("kept", "frozen", "joints", "remedy"),
    [
        ((0, 4000, 4200, 10_000), (0, 0), "Joints 1, 2 jump by", "samples are missing"),
        ((0, 10_000), (3000, 3300), "Joint 2 jumps by", "an encoder failed"),
    ],
)
def test_jumps_are_told(
    right: runtime.Record, kept: tuple[int, ...], frozen: tuple[int, int], joints: str, remedy: str
) -> None:
    q = right.q.copy()
    q[slice(*frozen), 1] = q[frozen[0], 1]
    rows = np.concatenate([np.arange(a, b) for a, b in zip(kept[::2], kept[1::2], strict=True)])
    worst = judged(runtime.Record(right.t[: len(rows)], q[rows], right.tau[rows])).worst
    assert worst is not None and worst.finding.startswith(joints) and remedy in worst.remedy
    assert f"at {right.t[frozen[1] or kept[1]] - 0.002:.4g} s" in worst.finding


def test_angles_that_wrap_are_told(right: runtime.Record) -> None:
    worst = judged(replace(right, q=np.mod(right.q, 2 * np.pi))).worst
    assert worst is not None and "unwrap: true" in worst.remedy


def test_clipped_torques_are_told(right: runtime.Record) -> None:
    bound = 0.6 * np.abs(right.tau).max(axis=0)
    worst = judged(replace(right, tau=np.clip(right.tau, -bound, bound))).worst
    assert (
        worst is not None
        and "largest or smallest value in" in worst.finding
        and "clipped" in worst.remedy
    )


def test_a_drive_at_its_limit_is_not_accused() -> None:
    """A mass driven to and fro by a force of one size: the force stays at its bounds, and is what
    acted.
    """
    robot = b"symgen: 1\nname: slide\ngravity: [0, 0, 0]\nframes: {1: {ant: 0, sigma: 1, alpha: 0, d: 0, theta: 0, r: q1}}\n"
    t = np.arange(8000) / 400
    force = np.where(np.mod(t, 2.0) < 1.0, 5.0, -5.0)
    q = np.cumsum(np.cumsum(force / 2.5) / 400 - 1.0) / 400
    found = runtime.plausibility(
        symgen.model(parse_robot(robot, "slide")), runtime.Record(t, q, force)
    )
    assert (
        any("largest or smallest value in" in check.finding for check in found.checks())
        and found.worst is None
    ), found.to_text()


def test_an_encoder_that_froze_and_came_back_is_told(right: runtime.Record) -> None:
    """The joint passes the value again when the encoder goes on: no step is large. Shorter ones, to
    50 ms, are packets that a controller held, and bridged.
    """
    q = right.q.copy()
    a = 2000 + int(np.argmax(right.q[2000:2400, 1] > 0.2))
    b = a + 40 + int(np.argmin(np.abs(right.q[a + 40 : a + 400, 1] - q[a, 1])))
    q[a:b, 1] = q[a, 1]
    worst = judged(replace(right, q=q)).worst
    assert worst is not None and "stays at one value" in worst.finding


def test_a_torque_that_never_changes_ends_the_questions(
    right: runtime.Record, recwarn: pytest.WarningsRecorder
) -> None:
    found = judged(replace(right, tau=right.tau * [1.0, 0.0] + [0.0, 3.0]))
    assert found.worst is not None and found.worst.finding == "The torque of joint 2 is constant"
    assert found.checks()[-1].finding == "Not checked: a torque never changes" and not recwarn.list
