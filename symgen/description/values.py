"""Values that are not in the robot file: constants on the command line, and standard parameters.

Standard parameters come from a table or from an estimate.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from math import isfinite

from symgen.description.grammar import parse
from symgen.description.robot import Robot
from symgen.errors import DescriptionError


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
