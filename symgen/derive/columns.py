"""The columns of the standard regressor, by name: Gamma_a = sum_k D_k chi_k in the actuated
joints.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from symgen.derive.elements import element_column
from symgen.derive.newton_euler import Motion
from symgen.derive.regressor import Axes
from symgen.derive.scalar import Scalar
from symgen.derive.time_limit import require_time
from symgen.description.expression import Expression
from symgen.description.robot import INERTIAL, KINDS, PRISMATIC, Element, Robot, parameter

UNITS_OF_LINKS = {"M": "kg", "MX": "kg*m", "MY": "kg*m", "MZ": "kg*m"}


@lru_cache(maxsize=16)
def inertial_names(robot: Robot) -> dict[str, tuple[str, int]]:
    """{name: (inertial parameter, link)}."""
    return {parameter(p, j): (p, j) for j in robot.links for p in INERTIAL}


def element_names(robot: Robot) -> dict[str, tuple[Element, int]]:
    """{name: (element, key)}."""
    return {parameter(e.family, j): (e, j) for e in robot.elements for j in e.keys}


def acting(e: Element, j: int) -> dict[Any, Expression]:
    """Row {joint: G}, or form {(i, k): B}, i <= k, of an element's key."""
    form = {place: b for place, b in sorted(e.form.get(j, {}).items()) if place[0] <= place[1]}
    return form or dict(e.along[j])


def unit(robot: Robot, name: str) -> str:
    """Unit of a standard parameter, by family and by what its joint does."""
    inertial = inertial_names(robot)
    if name in inertial:
        return UNITS_OF_LINKS.get(inertial[name][0], "kg*m**2")
    e, j = element_names(robot)[name]
    return e.unit or KINDS[e.kind].units[robot.frame(j).sigma == PRISMATIC]


def columns(motion: Motion, names: Iterable[str]) -> dict[str, dict[int, Scalar]]:
    """{name: {actuated joint: D}} of the standard parameters `names`."""
    robot, closure, algebra = motion.robot, motion.geometry.closure, motion.algebra
    inertial, elements = inertial_names(robot), element_names(robot)
    axes = Axes(motion)
    algebra.section("Contributions that several joints share")
    result: dict[str, dict[int, Scalar]] = {}
    for name in names:
        require_time()
        tree = (
            axes.column(*inertial[name])
            if name in inertial
            else element_column(motion, *elements[name])
        )
        result[name] = closure.project(algebra, tree)
    return result
