"""LINKS and ELEMENTS of emitted modules against the robot they stem from."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from campaign import sampled

from oracles.pinocchio_model import element_columns
from oracles.random_robots import random_robot
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_module


def constants(robot) -> dict:
    text = generate_module(robot)
    module = ModuleType(robot.name)
    exec(compile(text, robot.name, "exec"), module.__dict__)  # noqa: S102 (our own output)
    return {"LINKS": module.LINKS, "ELEMENTS": module.ELEMENTS}


def column(entry, place, qd, qdd, q) -> np.ndarray:
    """Torque column of one element from its emitted entry: Gamma += G' x, or B x."""
    kind, when, acts = entry
    x = {"inertia": qdd, "viscous": qd, "coulomb": qd, "stiffness": q, "offset": None}[kind]
    total = np.zeros(len(place))
    if any(isinstance(key, tuple) for key in acts):
        for (i, j), b in acts.items():
            total[place[i]] += b * x[place[j]]
            if i != j:
                total[place[j]] += b * x[place[i]]
        return total
    for i, g in acts.items():
        total[place[i]] = g
    s = 1.0 if x is None else float(total @ x)
    s = max(s, 0.0) if when == "positive" else min(s, 0.0) if when == "negative" else s
    return total * (np.sign(s) if kind == "coulomb" else s)


@pytest.mark.parametrize(
    "source", [*sampled(packaged_robots(), 2, always=("tx40",)), *sampled(range(30), 3)]
)
def test_tables_are_those_of_the_robot(source) -> None:
    robot = load_robot(source) if isinstance(source, str) else random_robot(source)
    found = constants(robot)
    assert found["LINKS"] == robot.links
    assert all(
        f"{family}{j}" in robot.parameters for j in found["LINKS"] for family in ("XX", "MX", "M")
    )
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.standard_normal((3, len(robot.moving)))
    expected = element_columns(robot, q, qd, qdd)
    assert set(found["ELEMENTS"]) == set(expected)
    place = {j: k for k, j in enumerate(robot.moving)}
    for name, entry in found["ELEMENTS"].items():
        np.testing.assert_allclose(
            column(entry, place, qd, qdd, q), expected[name], rtol=1e-14, err_msg=name
        )
