"""What a cause needs before it is named, and what is asked of slow records."""

from __future__ import annotations

import sys
from math import pi
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
pytest.importorskip("pinocchio")

import truth_simulator as world
from truth_shared import emitted, record_of, study
from truth_simulator import Encoder, Truth, encoded, noise

import runtime


def judged(name, seed, spoil, motion="fourier", seconds=10.0, counts=0):
    """The plausibility of a spoiled record of a robot, values of the file some 30 % off."""
    robot = world.ROBOTS[name]
    truth, move = Truth(robot, seed), world.MOTIONS[motion](robot, seed, seconds=seconds)
    tau = truth.torque(move)
    q = encoded(robot, move, Encoder(2 * pi / counts), seed) if counts else move.q
    q, tau = spoil(q, tau + noise(tau, 0.0, 0.01, seed))
    model, variants = emitted(name)
    return runtime.plausibility(model, record_of(move, tau, q), study(), variants=variants)


def right(q, tau):
    return q, tau


def reversed_torques(q, tau):
    return q, -tau


def counterbalance(q, tau):
    """A spring at joint 2 of 60 % of its torque, which the model does not have."""
    tau = tau.copy()
    tau[:, 1] += 0.6 * np.abs(tau[:, 1]).max() * np.sin(q[:, 1] + 0.4)
    return q, tau


@pytest.mark.parametrize(("name", "seed"), [("anthropomorphic", 8), ("wrist", 9), ("panda", 10)])
def test_a_counterbalance_is_no_unit_of_the_torques(name, seed) -> None:
    causes = [one["cause"] for one in judged(name, seed, counterbalance).named_causes]
    assert not any("read as" in cause or "gravity" in cause for cause in causes), causes


@pytest.mark.parametrize(
    ("name", "seed", "motion", "counts"),
    [("panda", 7, "fourier", 0), ("panda", 7, "slow", 0), ("wrist", 7, "slow", 500)],
)
def test_reversed_torques_are_named_first(name, seed, motion, counts) -> None:
    found = judged(name, seed, reversed_torques, motion, 12.0, counts)
    assert found.named_causes[0]["cause"] == "all torques have the wrong sign"


@pytest.mark.parametrize(
    ("name", "k", "counts"),
    [
        ("wrist", 268, 500),
        ("panda", 415, 1000),
        ("anthropomorphic", 121, 500),
        ("scara", 184, 2000),
    ],
)
def test_slow_motion_with_coarse_encoders_has_no_cause(name, k, counts) -> None:
    assert not judged(name, 1_000_000 + k, right, "slow", 10.0, counts).named_causes


@pytest.mark.parametrize("name", ["panda", "wrist"])
def test_slow_records_are_asked_for_causes(name) -> None:
    found = judged(name, 11, right, "slow", 10.0, 2000)
    assert not [c for c in found.checks() if c.finding.startswith("Not checked: too few")]
