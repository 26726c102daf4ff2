"""A robot at the values of its constants: symbols replaced by their numbers, for geometries at which the generic formulas do not hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

from symgen.description.expression import PI, Expression, twelfths
from symgen.description.robot import REVOLUTE, Robot

K = TypeVar("K")
WITHIN = 1e-9  # rad, of a multiple of pi/12: rounding of 1.5707963267948966


def at_values(robot: Robot, values: Mapping[str, Expression] | None = None) -> Robot:
    """`robot` with every constant as a number: decimals exactly, angles that are multiples of pi/12 as such; or some constants at given values.

    Parameters
    ----------
    robot : Robot
        With symbolic constants.
    values : mapping, optional
        Constants to replace, and by what; all of them by their numbers where left out.

    Returns
    -------
    Robot
        The same mechanism without these constants; base parameters and formulas are those that hold for these values alone.
    """
    values = _numbers(robot) if values is None else values

    def rows(table: Mapping[int, Mapping[K, Expression]]) -> dict[int, dict[K, Expression]]:
        return {j: {i: g.substitute(values) for i, g in row.items()} for j, row in table.items()}

    x, y, z = (e.substitute(values) for e in robot.gravity)
    return replace(
        robot,
        frames=tuple(
            replace(f, **{k: getattr(f, k).substitute(values) for k in ("gamma", "b", "alpha", "d", "theta", "r")}) for f in robot.frames
        ),
        gravity=(x, y, z),
        elements=tuple(replace(e, along=rows(e.along), form=rows(e.form)) for e in robot.elements),
        constraints={j: e.substitute(values) for j, e in robot.constraints.items()},
        constants={name: x for name, x in robot.constants.items() if name not in values},
    )


def _numbers(robot: Robot) -> dict[str, Expression]:
    """The constants as exact numbers."""
    in_angles = {s for f in robot.frames for e in (f.gamma, f.alpha, f.theta0) for s in e.symbols}
    in_angles |= {s for j, e in robot.constraints.items() if robot.frame(j).sigma == REVOLUTE for s in e.symbols}
    return {name: exact(value, angle=name in in_angles) for name, value in robot.constants.items()}


def exact(value: float, *, angle: bool = False) -> Expression:
    """A value as its shortest decimal, or an angle as a multiple of pi/12 where it is one."""
    if angle and value and (k := twelfths(value, WITHIN)) is not None and math.isfinite(value):
        return PI * Fraction(k, 12)
    return Expression.number(repr(float(value)))
