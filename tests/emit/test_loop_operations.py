"""Operation counts of robots with parallelograms: at most what the theory notes state (regrouping
theory, section 6).

Base regressor of the inertial parameters and Ia (axis form), inverse dynamics of the inertial base
parameters (product form).
"""

from __future__ import annotations

import pytest

from symgen.description import load_robot
from symgen.emit.spec import function, is_inertial, is_inertial_or_actuator
from symgen.regroup.regrouping import regroup

LIMITS = {
    "haptic": (21, (145, 108), (169, 142)),
    "sr400": (42, (430, 328), (315, 287)),
}  # columns, (mul, add) of regressor and torques


@pytest.mark.parametrize("name", LIMITS)
def test_limits(name: str) -> None:
    regrouping = regroup(load_robot(name))
    robot, (count, regressor, torques) = regrouping.robot, LIMITS[name]
    own = tuple(filter(is_inertial_or_actuator(robot), regrouping.own))
    assert len(own) == count
    mul, add = function(regrouping, "regressor", is_inertial_or_actuator(robot)).operations
    assert mul <= regressor[0] and add <= regressor[1]
    mul, add = function(regrouping, "inverse_dynamics", is_inertial(robot)).operations
    assert mul <= torques[0] and add <= torques[1]
