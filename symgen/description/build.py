"""From the validated tables of a robot file to the frozen Robot: defaults filled in, expressions read with their symbols."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

from symgen.description.distal import khalil_frames
from symgen.description.expression import ONE, Expression
from symgen.description.forms import form_of, row_of
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, Drives, Element, Form, Frame, Loop, Path, Robot, Row, check_identifier
from symgen.description.schema import CONVENTIONS, DrivesTable, ElementTable, FrameRow, RobotFile
from symgen.errors import DescriptionError, ExpressionError

T = TypeVar("T")


def build(table: RobotFile, *, file: str, sha256: str) -> Robot:
    """The Robot of a robot file; DescriptionError carries the path of the field at fault."""
    for name in table.constants:
        check_identifier(name, ("constants", name))
    constants = set(table.constants)
    joints = {j for j, row in table.frames.items() if row.sigma != FIXED}
    variables = constants | {f"q{j}" for j in (*joints, *range(1, len(table.frames) + 1))}
    frames = tuple(_frame(j, row, constants, variables) for j, row in sorted(table.frames.items()))
    massless = set(table.massless)
    if table.convention not in CONVENTIONS:
        raise DescriptionError(f"convention: found {table.convention!r}; expected {' or '.join(CONVENTIONS)}", path=("convention",))
    if table.convention == "distal":
        if table.loops:
            raise DescriptionError("loops: cut frames of a distal table have no place; write it by Khalil's convention", path=("loops",))
        frames = khalil_frames(frames)
        massless |= {f.j for f in frames[len(table.frames) :]}
    actuated = tuple(f.j for f in frames if f.mu)
    gx, gy, gz = (_read(text, constants, ("gravity", k)) for k, text in enumerate(table.gravity))
    for k, j in enumerate(table.massless):
        if j not in table.frames:
            raise DescriptionError(f"massless: link {j} does not exist; frames are {sorted(table.frames)}", path=("massless", k))
    return Robot(
        name=table.name,
        title=table.title,
        source=table.source,
        gravity=(gx, gy, gz),
        constants=table.constants,
        frames=frames,
        elements=tuple(_element(family, row, tuple(sorted(joints)), actuated, variables) for family, row in table.elements.items()),
        loops=tuple(
            Loop(row.cut, row.twin, {_joint(q, ("loops", k, "start", q)): value for q, value in row.start.items()})
            for k, row in enumerate(table.loops)
        ),
        constraints={_joint(q, ("constraints", q)): _read(text, variables, ("constraints", q)) for q, text in table.constraints.items()},
        massless=frozenset(massless),
        drives=None if table.drives is None else _drives(table.drives, len(actuated)),
        limits={name: tuple(row) for name in ("q", "qd", "qdd", "tau") if (row := getattr(table.limits, name)) is not None},
        values=table.values,
        labels=table.labels,
        file=file,
        sha256=sha256,
    )


def _read(text: str, symbols: Iterable[str], path: Path) -> Expression:
    try:
        return parse(text, symbols)
    except ExpressionError as error:
        raise DescriptionError(f"{'.'.join(str(key) for key in path)}: {error}", path=path) from error


def _joint(q: str, path: Path) -> int:
    if not re.fullmatch(r"q[1-9][0-9]{0,8}", q):
        raise DescriptionError(f"{'.'.join(str(key) for key in path)}: {q!r} is no joint; expected q1, q2, ...", path=path)
    return int(q[1:])


def _frame(j: int, row: FrameRow, constants: set[str], variables: set[str]) -> Frame:
    mu = row.mu if row.mu is not None else int(row.sigma != FIXED)
    fields = {
        name: _read(getattr(row, name), variables | {f"q{j}"} if name in ("theta", "r") else constants, ("frames", j, name))
        for name in ("gamma", "b", "alpha", "d", "theta", "r")
    }
    return Frame(j, row.ant, row.sigma, mu, **fields)


def _element(family: str, row: ElementTable, joints: tuple[int, ...], actuated: tuple[int, ...], symbols: set[str]) -> Element:
    if row.along == "all":
        along: dict[int, Row] = {j: {j: ONE} for j in actuated}
    else:
        along = _combine(row_of, row.along, joints, symbols, ("elements", family, "along"))
    form: dict[int, Form] = _combine(form_of, row.form, joints, symbols, ("elements", family, "form"))
    return Element(family, row.kind, along, form, row.when)


def _combine(
    reduce: Callable[[Expression, tuple[int, ...]], T], texts: Mapping[int, str], joints: tuple[int, ...], symbols: set[str], path: Path
) -> dict[int, T]:
    """{j: text} to {j: row or form}."""
    result: dict[int, T] = {}
    for j, text in texts.items():
        try:
            result[j] = reduce(_read(text, symbols, (*path, j)), joints)
        except ValueError as error:
            raise DescriptionError(f"{'.'.join(str(key) for key in (*path, j))}: {error}", path=(*path, j)) from error
    return result


def _drives(table: DrivesTable, n: int) -> Drives:
    constant = table.torque_constant
    return Drives(
        ratio=tuple(tuple(row) for row in table.ratio),
        offset=(0.0,) * n if table.offset is None else tuple(table.offset),
        torque_constant=tuple(constant) if isinstance(constant, list) else (constant,) * n,
    )
