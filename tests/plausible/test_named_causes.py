"""Causes that were named wrongly: a gear ratio told as a length, coarse positions told as another
inertia, half the force of a slide told as right. Torques are pinocchio's.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import truth_simulator as world
from truth_shared import emitted, record_of
from truth_simulator import Encoder, Truth, encoded, fourier, noise, slow

import runtime
from runtime.core.result import Identification


def simulated(name, seed, motion=fourier, seconds=6.0):
    robot = world.ROBOTS[name]
    move = motion(robot, seed, seconds=seconds)
    tau = Truth(robot, seed).torque(move)
    return robot, move, tau + noise(tau, 0.0, 0.01, seed)


def identified(name, move, tau, q=None):
    model, variants = emitted(name)
    record = record_of(move, tau, q)
    return runtime.identify(model, record, variants=variants)


@pytest.mark.parametrize("factor", [1.25, 0.7])
def test_a_wrong_gear_ratio_is_named_as_such(factor):
    """Positions divided, torques multiplied by the factor."""
    robot, move, tau = simulated("anthropomorphic", 41)
    wrong = np.where(np.arange(robot.n) == 2, factor, 1.0)
    causes = identified("anthropomorphic", move, tau * wrong, move.q / wrong).part("plausibility")
    (first, *_) = causes.named_causes
    assert first["cause"].startswith("the gear ratio of joint 3")
    assert "drives.ratio" in first["remedy"]


def test_coarse_positions_say_nothing_of_inertia():
    robot, move, tau = simulated("scara", 43, motion=slow, seconds=8.0)
    q = encoded(robot, move, Encoder(2 * np.pi / 500), 43)
    result = identified("scara", move, tau, q)
    told = " ".join(c.finding for c in result.checklist.checks if c.state in ("no", "doubtful"))
    assert "inertia torque" not in told
    assert result.part("plausibility").named_causes == []


@pytest.mark.parametrize(("factor", "doubt"), [(0.5, True), (1.0, False)])
def test_half_the_force_of_a_slide_is_a_doubt(factor, doubt):
    robot, move, tau = simulated("cylindrical", 45)
    result = identified("cylindrical", move, tau * np.where(np.arange(robot.n) == 1, factor, 1.0))
    told = [c.finding for c in result.checklist.checks if c.finding.startswith("The weight")]
    assert bool(told) == doubt
    if doubt:
        assert "slide of joint 2" in told[0] and result.checklist.state != "good"


def test_sensors_behind_the_gears_judge_no_rotor():
    """They see neither friction nor rotors: a negative Ia names no sign or ratio."""
    behind = SimpleNamespace(sides=("joint", "link"))
    assert Identification.negative.fget(SimpleNamespace(records=(behind,))) == ()
