"""Text of a robot file (YAML) for a Robot: read again, the same Robot."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence

from symgen.description.expression import ONE
from symgen.description.robot import Element, Form, Robot, Row
from symgen.description.schema import SCHEMA


def write_yaml(robot: Robot, *, comments: Sequence[str] = ()) -> str:
    """Text of the file; `comments` are lines that stand first, each after a #."""
    lines = [f"# {line}" for line in comments]
    lines += [f"symgen: {SCHEMA}", f"name: {robot.name}"]
    lines += [f"{key}: {json.dumps(text, ensure_ascii=False)}" for key in ("title", "source") if (text := getattr(robot, key))]
    lines += [f"gravity: [{', '.join(map(str, robot.gravity))}]", f"constants: {_table(robot.constants)}", "frames:"]
    for f in robot.frames:
        row = {key: getattr(f, key) for key in ("ant", "sigma", "mu", "gamma", "b", "alpha", "d", "theta", "r")}
        lines.append(f"  {f.j}: {_table({key: value for key, value in row.items() if value or key not in ('gamma', 'b')})}")
    if robot.loops:
        lines.append("loops:")
    for loop in robot.loops:
        start = f", start: {_table({f'q{j}': x for j, x in loop.start.items()})}" if loop.start else ""
        lines.append(f"  - {{cut: {loop.cut}, twin: {loop.twin}{start}}}")
    if robot.constraints:
        lines.append(f"constraints: {_table({f'q{j}': e for j, e in robot.constraints.items()})}")
    if robot.massless:
        lines.append(f"massless: {sorted(robot.massless)}")
    if robot.elements:
        lines.append("elements:")
    lines += [f"  {e.family}: {_element(robot, e)}" for e in robot.elements]
    if robot.drives is not None:
        ratio, offset, constant = ([*map(_numbers, robot.drives.ratio)], robot.drives.offset, robot.drives.torque_constant)
        lines.append(f"drives: {{ratio: [{', '.join(ratio)}], offset: {_numbers(offset)}, torque_constant: {_numbers(constant)}}}")
    if robot.limits:
        lines.append("limits:")
    lines += [f"  {key}: [{', '.join(_entry(x) for x in row)}]" for key, row in robot.limits.items()]
    if robot.values:
        lines.append("values:")
    lines += [f"  {name}: {value!r}" for name, value in robot.values.items()]
    if robot.labels:
        lines.append("labels:")
    lines += [f"  {j}: {json.dumps(text, ensure_ascii=False)}" for j, text in robot.labels.items()]
    return "\n".join(lines) + "\n"


def _table(table: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in table.items()) + "}"


def _numbers(row: Iterable[float]) -> str:
    return f"[{', '.join(map(repr, row))}]"


def _entry(x: object) -> str:
    return _numbers(x) if isinstance(x, tuple) else repr(x)


def _element(robot: Robot, e: Element) -> str:
    parts = [f"kind: {e.kind}"]
    if e.along == {j: {j: ONE} for j in robot.joints}:
        parts.append("along: all")
    elif e.along:
        parts.append(f"along: {_table({str(j): _row(row) for j, row in e.along.items()})}")
    if e.form:
        parts.append(f"form: {_table({str(j): _form(form) for j, form in e.form.items()})}")
    if e.when is not None:
        parts.append(f"when: {e.when}")
    return f"{{{', '.join(parts)}}}"


def _row(row: Row) -> str:
    return " + ".join(f"q{j}" if c == ONE else f"({c})*q{j}" for j, c in row.items())


def _form(form: Form) -> str:
    """q' B q, each pair once."""
    terms = [(i, j, c if i == j else c * 2) for (i, j), c in form.items() if i <= j]
    return " + ".join(f"q{i}*q{j}" if c == ONE else f"({c})*q{i}*q{j}" for i, j, c in terms)
