"""Text of a `.par` file of SYMORO for a Robot, with notes on what the format has no place for; `par.py` tells the format."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from symgen.description.expression import Expression
from symgen.description.par import FAMILIES, GEOMETRIC, NAMES_ONLY, WRENCH
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, REVOLUTE, Robot, one_joint_parameters, parameter
from symgen.errors import DescriptionError


def write_par(robot: Robot) -> tuple[str, tuple[str, ...]]:
    """Text of the file, and what of `robot` it does not carry.

    Raises DescriptionError where the file would describe another mechanism: relations of passive joints beside the loops, cut joints
    that are not the last joints, a constant with the name of a joint variable.
    """
    NF, cuts = len(robot.frames), len(robot.loops)
    NJ, NL = NF - cuts, NF - 2 * cuts
    _check(robot, NL, NJ)
    columns = {key: [_geometric(robot, j, key) for j in range(1, NF + 1)] for key in GEOMETRIC}
    inertial = {parameter(p, j) for j in robot.links for p in INERTIAL}
    written = {name for name in inertial | one_joint_parameters(robot, ("Ia", "FV", "FS")) if int(re.sub(r"\D", "", name)) <= NL}
    lines = [
        f"(* Robotname = '{robot.name}' *)",
        *_numbers("constants", robot.constants),
        *_numbers("values", {name: value for name, value in robot.values.items() if name in written}),
        *(
            line
            for k, loop in enumerate(robot.loops, start=1)
            for line in _numbers(f"start {k}", {f"q{j}": x for j, x in loop.start.items()})
        ),
        f"NL = {NL}",
        f"NJ = {NJ}",
        f"NF = {NF}",
        f"Type = {2 if cuts else int(any(f.ant != f.j - 1 for f in robot.frames))}",
        "is_mobile = 0",
        "",
        "(* Geometric parameters *)",
        *(_row(key, column) for key, column in columns.items()),
        "",
        "(* Dynamic parameters and external forces *)",
        *(_row(name, (_symbol(name, family, j, written) for j in range(1, NL + 1))) for name, family in FAMILIES.items()),
        *(_row(key, ["0"] * NL) for key in WRENCH),
        "",
        "(* Joint parameters *)",
        *(_row(key, (f"{key}{j}" for j in range(1, NJ + 1))) for key in NAMES_ONLY),
        "",
        "(* Speed and acceleration of the base *)",
        *(_row(key, "000") for key in ("W0", "WP0", "V0", "VP0")),
        "",
        "(* Acceleration of gravity *)",
        _row("G", map(str, robot.gravity)),
        "",
        "(* Transformation of 0 frame position fT0 *)",
        _row("Z", "1000010000100001"),
        "",
        "(* End of definition *)",
    ]
    return "\n".join(lines) + "\n", _losses(robot, written)


def _check(robot: Robot, NL: int, NJ: int) -> None:
    if robot.constraints:
        relations = ", ".join(f"q{j} = {e}" for j, e in robot.constraints.items())
        raise DescriptionError(
            f"{robot.name}: a .par file has no place for {relations}; without it the mechanism would be another; a loop with a cut joint and its twin has a place"
        )
    if [(loop.cut, loop.twin) for loop in robot.loops] != [(k, k + NJ - NL) for k in range(NL + 1, NJ + 1)]:
        raise DescriptionError(
            f"{robot.name}: cut joints and twins are {[(loop.cut, loop.twin) for loop in robot.loops]}; a .par file numbers links first, then the "
            "cut joints, then their twins in the same order: renumber the frames"
        )
    variables = {_variable(robot, f.j) for f in robot.frames if f.sigma != FIXED}
    if taken := sorted(name for name in robot.constants if name in variables):
        raise DescriptionError(f"{robot.name}: constant {taken[0]} would be a joint variable in a .par file; rename it")


def _variable(robot: Robot, j: int) -> str:
    return f"r{j}" if robot.frame(j).sigma == PRISMATIC else f"th{j}"


def _geometric(robot: Robot, j: int, key: str) -> str:
    f = robot.frame(j)
    value = getattr(f, key)
    if (key, f.sigma) in {("theta", REVOLUTE), ("r", PRISMATIC)}:
        value = value.substitute({f.q: Expression.symbol(_variable(robot, j))})
    return str(value)


def _row(key: str, entries: Iterable[str]) -> str:
    return f"{key} = {{{','.join(entries)}}}"


def _numbers(what: str, table: Mapping[str, float]) -> list[str]:
    return [f"(* {what}: " + ", ".join(f"{name} = {value!r}" for name, value in table.items()) + " *)"] if table else []


def _symbol(name: str, family: str, j: int, written: set[str]) -> str:
    return f"{name}{j}" if parameter(family, j) in written else "0"


def _losses(robot: Robot, written: set[str]) -> tuple[str, ...]:
    notes = []
    if lost := [name for name in robot.parameters if name not in written]:
        notes.append(f"parameters without a place in the format, left out: {', '.join(lost)}")
    notes += [f"{what} not carried" for what in ("title", "source", "drives", "limits", "labels") if getattr(robot, what)]
    if robot.constants or robot.values or any(loop.start for loop in robot.loops):
        notes.append("numbers of constants, values and start stand in comments, which SYMORO skips and symgen reads")
    return tuple(notes)
