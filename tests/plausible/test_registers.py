"""Torques without their sign: registers with a bit for the sign, two's complement, magnitudes."""

from __future__ import annotations

import numpy as np
import planar_arm
import pytest

import runtime
from runtime.plausible.registers import kinks_at_zero, register_bit

QUESTION = "Do the torques have their sign?"


@pytest.fixture(scope="module")
def arm():
    return planar_arm.arm()


def torques(arm, seed):
    t, q, qd, qdd = planar_arm.motion(seed, 20.0)
    tau = arm.inverse_dynamics(q, qd, qdd, planar_arm.parameters(arm))
    return t, q, tau + 0.03 * np.random.default_rng(seed).standard_normal(tau.shape)


def answer(arm, t, q, tau):
    found = runtime.plausibility(arm, runtime.Record(t, q, tau, rate=planar_arm.RATE))
    return next((c for c in found.checks() if c.question == QUESTION), None), found


@pytest.mark.parametrize("factor", [0.01, -0.004])
@pytest.mark.parametrize("complement", [False, True])
def test_a_bit_of_the_sign_is_told_with_its_decoding(arm, factor, complement) -> None:
    t, q, tau = torques(arm, 1)
    step = np.abs(tau).max(axis=0) / 900
    raw = np.round(tau / step)
    bit = 15 if complement else 10
    register = np.where(raw < 0, raw + 2**16 if complement else 2**bit - raw, raw)
    check, found = answer(arm, t, q, factor * register)
    assert check is not None and check.state == "no"
    said = f"raw - {2**16}" if complement else f"-(raw - {2**bit})"
    assert said in check.remedy and "joint 1, 2" in check.finding
    assert not found.named and "wrong sign" not in found.line


def test_magnitudes_are_told(arm) -> None:
    t, q, tau = torques(arm, 1)
    check, found = answer(arm, t, q, np.abs(tau))
    assert check is not None and check.state == "no" and "it is a magnitude" in check.finding
    assert not found.named


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("step", [0.0, 0.02])
def test_torques_above_zero_are_no_magnitudes(arm, seed, step) -> None:
    """Right torques, and those that a load keeps on one side of zero, down to touching it."""
    _, _, tau = torques(arm, seed)
    for above in (0.0, 1.0, 1.3):
        x = tau + above * np.abs(tau.min(axis=0))
        x = step * np.round(x / step) if step else x
        for own in x.T:
            assert register_bit(own) is None and kinks_at_zero(own, planar_arm.RATE) < 4
