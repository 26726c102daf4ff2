"""Numbers for a robot: values in place of its symbolic constants, and standard parameters from tables.

If the numbers of lengths and angles make the geometry special, the formulas of the general robot do
not hold. Standard parameters come from a command line, a table or an estimate.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import isfinite
from typing import Any, TypeAlias, TypeVar

from symgen.description.expression import PI, Expression, twelfths
from symgen.description.grammar import parse
from symgen.description.parts import ANGLES, GEOMETRY
from symgen.description.robot import PRISMATIC, REVOLUTE, Element, Frame, Robot
from symgen.errors import DescriptionError

K = TypeVar("K")
Item = TypeVar("Item", Frame, Element, Robot)
Change: TypeAlias = Callable[[Expression], Expression]
WITHIN = 1e-6  # rad, of a multiple of pi/12: rounding of 1.570796


def at_values(robot: Robot, values: Mapping[str, Expression] | None = None) -> Robot:
    """Replace all constants of `robot` by numbers, or some by the expressions in `values`.

    Decimals are exact. An angle near a multiple of pi/12 becomes this multiple if `values` is left
    out.

    Parameters
    ----------
    robot : Robot
        A robot with symbolic constants.
    values : mapping, optional
        The constants to replace, each with its new value. By default, all constants are replaced by
        their numbers.

    Returns
    -------
    Robot
        The same mechanism without these constants. Its base parameters and formulas hold for these
        values alone. Fitted scalars of friction laws remain constants.
    """
    replaced = _numbers(robot) if values is None else values

    change = partial(substituted, values=replaced)
    scalars = {name for e in robot.elements for name in e.constants}  # of laws: they stay
    constants = {
        name: float(replaced.get(name, Expression.number(repr(x))))
        for name, x in robot.constants.items()
        if name not in replaced or name in scalars
    }
    elements = tuple(
        replace(e, torque=e.torque and change(e.torque), energy=e.energy and change(e.energy))
        for e in robot.elements
    )
    angle: Change = change if values is not None else lambda e: round_angle(change(e))
    return replace(mapped(replace(robot, elements=elements), change, angle), constants=constants)


def round_angle(e: Expression) -> Expression:
    """Replace the constant part of an angle by a multiple of pi/12 if it is near such a multiple.

    A joint variable stays: q1 + 1.570796 becomes q1 + pi/2.
    """
    c = e.terms.get((), Fraction(0))
    near = c and twelfths(float(c), WITHIN) is not None
    return e - c + exact(float(c), angle=True) if near else e


def substituted(e: Expression, values: Mapping[str, Expression]) -> Expression:
    """Replace the symbols of the expression `e` by the expressions in `values`.

    Raises DescriptionError if `e` has no finite real value at these values.
    """
    try:
        return e.substitute(values)
    except (ArithmeticError, ValueError) as error:
        given = ", ".join(f"{name} = {values[name]}" for name in sorted(e.symbols & values.keys()))
        raise DescriptionError(
            f"{e} has no finite real value at {given}; give another value"
        ) from error


def mapped(robot: Robot, length: Change, angle: Change = lambda e: e) -> Robot:
    """Return a copy of `robot` in which the function `length` is applied to all lengths, and
    `angle` to all angles.

    `length` is also applied to gravity and to the coefficients of elements. A constraint on a
    prismatic joint counts as a length, a constraint on a revolute joint as an angle.
    """

    def rows(table: Mapping[int, Mapping[K, Expression]]) -> dict[int, dict[K, Expression]]:
        return {j: {i: length(g) for i, g in row.items()} for j, row in table.items()}

    def frame(f: Frame) -> Frame:
        changes = {name: angle if name in ANGLES else length for name in GEOMETRY}
        return _with(f, **{name: change(getattr(f, name)) for name, change in changes.items()})

    x, y, z = map(length, robot.gravity)
    return _with(
        robot,
        frames=tuple(map(frame, robot.frames)),
        gravity=(x, y, z),
        elements=tuple(_with(e, along=rows(e.along), form=rows(e.form)) for e in robot.elements),
        constraints={
            j: (length if robot.frame(j).sigma == PRISMATIC else angle)(e)
            for j, e in robot.constraints.items()
        },
    )


def _with(item: Item, **fields: Any) -> Item:
    """Return the item with these fields: the item itself if it has them already, else a checked
    copy.
    """
    same = all(getattr(item, name) == value for name, value in fields.items())
    return item if same else replace(item, **fields)


def _numbers(robot: Robot) -> dict[str, Expression]:
    """Map the name of each constant to its value as an exact number.

    A constant that occurs in an angle becomes a multiple of pi/12 if it is near such a multiple.
    """
    in_angles = {s for f in robot.frames for e in (f.gamma, f.alpha, f.theta0) for s in e.symbols}
    in_angles |= {
        s
        for j, e in robot.constraints.items()
        if robot.frame(j).sigma == REVOLUTE
        for s in e.symbols
    }
    return {name: exact(value, angle=name in in_angles) for name, value in robot.constants.items()}


def exact(value: float, *, angle: bool = False) -> Expression:
    """Convert `value` to an exact expression: its shortest decimal, for instance 9/40 for 0.225.

    If `angle` is true and `value` is near a multiple of pi/12, the result is this multiple.
    """
    if angle and value and (k := twelfths(value, WITHIN)) is not None and math.isfinite(value):
        return PI * Fraction(k, 12)
    return Expression.number(repr(float(value)))


def assignment(text: str, option: str = "--constant") -> tuple[str, float]:
    """Split the text NAME=NUMBER of a command line option into the name and the number.

    The number may be a constant expression such as pi/2. Raises DescriptionError or
    ExpressionError.
    """
    name, equals, value = text.rpartition("=")
    try:
        if name.strip() and equals:
            return name.strip(), float(parse(value, ()))
    except (ValueError, ZeroDivisionError, OverflowError):
        pass
    raise DescriptionError(f"{option} {text}; expected NAME=NUMBER")


def values_of_csv(content: bytes, file: str) -> dict[str, float]:
    """Read standard parameters by name from CSV lines name,value or name,value,note.

    A header with these names may be the first line. Raises DescriptionError, with file and line, if
    a line has another form, or if there is no value.
    """
    values: dict[str, float] = {}
    try:
        rows = list(csv.reader(content.decode("utf-8-sig").splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DescriptionError(f"{file}: {error}; expected lines of name,value") from error
    for line, row in enumerate(rows, start=1):
        if row in ([], ["name", "value"], ["name", "value", "note"]):
            continue
        try:
            name, value = row[:2] if len(row) == 3 else row
            values[name] = float(value)
        except ValueError as error:
            raise DescriptionError(
                f"{file}, line {line}: found {','.join(row)[:60]!r}; expected name,value"
            ) from error
        if not isfinite(values[name]):
            raise DescriptionError(
                f"{file}, line {line}: {name[:60]} is {value[:60]}; expected a finite number"
            )
    if not values:
        raise DescriptionError(f"{file} contains no values; expected lines of name,value")
    return values


def with_values(robot: Robot, values: Mapping[str, float]) -> Robot:
    """Return a copy of `robot` with its parameter values replaced or extended by `values`."""
    return replace(robot, values={**robot.values, **values})


def with_estimate(robot: Robot, standard: object, file: str) -> Robot:
    """Return a copy of `robot` with the standard parameters of a physically feasible estimate.

    Parameters
    ----------
    standard : object
        `details["standard"]` of the estimate: a mapping from names to numbers.
    file : str
        File of the estimate, for messages.

    Raises
    ------
    DescriptionError
        The estimate has no standard parameters, or has parameters of another robot.
    """
    if not isinstance(standard, dict):
        raise DescriptionError(
            f"{file} has only base parameters, but standard parameters are needed; set estimate: "
            "{method: feasible} in the study and identify again"
        )
    for name, x in standard.items():
        if isinstance(x, bool) or not isinstance(x, int | float) or not abs(x) < 1e300:
            raise DescriptionError(
                f"{file}: details.standard: {name[:60]} is {x!r:.60}; expected a number; the file was edited, write it again with symgen identify"
            )
    if unknown := sorted(set(standard) - set(robot.parameters)):
        raise DescriptionError(
            f"{file}: {', '.join(unknown[:12])} are no parameters of {robot.name}; give the "
            "estimate of this robot"
        )
    return with_values(robot, {name: float(x) for name, x in standard.items()})
