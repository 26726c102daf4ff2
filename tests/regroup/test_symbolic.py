"""Formulas in sympy: what is printed, read by sympy, is what is exported."""

from __future__ import annotations

import pytest
import sympy

from oracles.random_robots import random_robot
from symgen.description import load_robot
from symgen.regroup.regrouping import regroup
from symgen.regroup.symbolic import sympy_formulas

ROBOTS = [load_robot("tx40"), load_robot("two_branch"), *(random_robot(seed) for seed in (4, 7, 9, 13, 43, 113))]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_export_equals_text(robot) -> None:
    regrouping = regroup(robot)
    exported = sympy_formulas(regrouping)
    names = {name: sympy.Symbol(name, real=True) for name in (*robot.parameters, *robot.constants)}
    for b in regrouping.base:
        read = sympy.sympify(b.formula, locals=names, rational=True)  # our own text, not a user's
        assert sympy.expand(read - exported[b.name]) == 0, b.name
