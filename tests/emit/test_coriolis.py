"""C(q, qd) by composite links: that of the accelerations at unit rates entry by entry over F_p, and its count."""

from __future__ import annotations

import pytest
from campaign import sampled

from oracles.random_parallelograms import random_parallelogram
from oracles.random_robots import random_robot
from symgen.derive.derivation import derive
from symgen.derive.energies import AtRates
from symgen.derive.models import MODELS, Request, rewriting
from symgen.derive.newton_euler import joint_torques
from symgen.description import Robot, load_robot, packaged_robots


def assert_equal_over_F_p(robot: Robot) -> None:
    """Column k is the torques of the accelerations of a unit rate of joint k: nodes of one value over F_p are one node of a rewriting."""
    d, request = derive(robot), Request({name: name for name in robot.parameters})
    rewrite = rewriting(d, request)
    composite = MODELS["coriolis"].values(d, request, rewrite)
    found = {e.place: e.value for e in composite.entries}
    for k, joint in enumerate(robot.joints):
        column = d.actuated(joint_torques(AtRates(d.motion, {joint: 1}, joint), d.chi))
        values = rewrite.copied(list(column.values()))
        for i, value in enumerate(values):
            assert str(found[i, k]) == str(value), (robot.name, i, k)


@pytest.mark.parametrize("name", packaged_robots())
def test_packaged_robots_over_F_p(name: str) -> None:
    robot = load_robot(name)
    if not derive(robot).closure.tied:
        assert_equal_over_F_p(robot)


@pytest.mark.parametrize("make", [random_robot, random_parallelogram])
@pytest.mark.parametrize("seed", sampled(range(12), 3))
def test_random_robots_over_F_p(make, seed: int) -> None:
    assert_equal_over_F_p(make(seed))
