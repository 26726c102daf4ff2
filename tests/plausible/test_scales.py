"""The scale of the position of one joint, lengths that are 10 % off, two columns that are one, and
torques that no drive has: each named, and nothing else beside it.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import slip_cases

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

import slips_simulated
import truth
from truth_simulator import Truth


@pytest.fixture(scope="module")
def right() -> slip_cases.Case:
    return slip_cases.palletiser()


@pytest.fixture(scope="module")
def arm() -> slips_simulated.Simulated:
    return slips_simulated.Simulated("wrist")


def causes(case: slip_cases.Case) -> list[str]:
    return [one["cause"] for one in case.judged().named_causes]


@pytest.mark.parametrize(("joint", "scale"), [(2, 1.1), (3, 0.9), (4, 2.0), (2, 0.5)])
def test_the_scale_of_a_position_is_named_with_its_size(
    right: slip_cases.Case, joint: int, scale: float
) -> None:
    """It was read as a delay or a coupling. Motor side, about the zero of the encoder."""
    q = np.where(np.arange(right.q.shape[1]) == joint - 1, scale, 1.0) * right.q
    (cause,) = causes(replace(right, q=q))
    text, factor = cause.rsplit(" ", 1)
    assert text == f"the position of joint {joint} must be multiplied by"
    assert float(factor) == pytest.approx(1 / scale, rel=0.03)


def test_a_length_ten_per_cent_off_is_named(arm: slips_simulated.Simulated) -> None:
    (cause,) = causes(arm.right.text("RL4: 0.55", "RL4: 0.605"))
    assert cause.startswith("r of frame 4 is 0.55") and cause.endswith(" rather than 0.605 m")


def test_a_factor_far_from_its_first_step_is_found() -> None:
    """Seven axes with few rows that count: the fit at half the factor began at weights that made it
    worse than none, and a spring of the joint was named.
    """
    row = truth.causes(56, truth.BASE["third"] + 56, "third")[0]
    assert row["named"] and not row["other causes"]


@pytest.mark.parametrize("side", ["joint", "motor"])
def test_two_columns_that_are_one_are_named(
    right: slip_cases.Case, arm: slips_simulated.Simulated, side: str
) -> None:
    """Columns of the file: those of motors with other gears are no equal positions of joints."""
    case = arm.right if side == "joint" else right
    found = replace(case, q=case.q[:, [0, 2, 2, *range(3, case.q.shape[1])]]).judged()
    assert not found.named
    assert "Positions of joints 2 and 3 are the same" in [one.finding for one in found.checks()]


def test_torques_with_the_wrong_sign_have_friction(right: slip_cases.Case) -> None:
    """The best physical robot of these has none: it cannot be negative."""
    checks = {one.question: one.state for one in replace(right, tau=-right.tau).judged().checks()}
    assert checks["Were the torques measured?"] == "good"


@pytest.mark.parametrize("friction", [True, False], ids=["with friction", "without friction"])
def test_torques_that_a_controller_computes_are_asked_about(
    arm: slips_simulated.Simulated, friction: bool
) -> None:
    """Its model has no noise, and may have no friction; the right study has both."""
    model = Truth(arm.robot, 0, bodies=arm.robot.nominal)
    tau = model.torque(arm.move) - (0 if friction else model.friction(arm.move.qd))
    found = replace(arm.right, tau=tau + arm.balance).judged()
    assert not found.named and found.worst is not None
    assert found.worst.question == "Were the torques measured?"
    assert ("noise" if friction else "No joint shows friction") in found.worst.finding
