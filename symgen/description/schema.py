"""JSON Schema of robot files, and conversion of the data in a robot file to a Robot.

Error messages name the wrong field.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from symgen.description.fields import Declared, Given, Path, dotted
from symgen.description.naming import check_identifier
from symgen.description.robot import Robot
from symgen.errors import DescriptionError, SymgenError

SCHEMA = 1  # version of the robot file
READER = TypeAdapter(Robot)  # its validators are built when the first file is read
CONVENTIONS = {
    "proximal": "Khalil and Kleinfinger",
    "distal": "classic DH, with its a as d and its d as r",
}


def robot_of(data: Mapping[str, Any], file: str, sha256: str) -> Robot:
    """Build the Robot from the data of a robot file, and check all fields.

    Raises DescriptionError with the path of the wrong field.
    """
    data = {"file": Given(file), "sha256": Given(sha256), **data}
    columns = data.get("columns") or {}
    data = _with_columns(data)
    convention = data.pop("convention", "proximal")
    if convention not in CONVENTIONS:
        raise DescriptionError(
            f"convention: found {convention!r:.60}; expected {' or '.join(CONVENTIONS)}",
            path=("convention",),
        )
    del data["symgen"]
    constants, rows = (
        [*table] if isinstance(table := data.get(key), dict) else []
        for key in ("constants", "frames")
    )
    constants = [name for name in constants if isinstance(name, str)]  # others are refused below
    for name in constants:
        check_identifier(name, ("constants", name))
    joints = {f"q{j}" for j in (*rows, *range(1, len(rows) + 1))}
    distal = convention == "distal"
    if distal and data.get("loops"):
        raise DescriptionError(
            "loops: a distal table cannot describe closed loops; write the table in Khalil's convention",
            path=("loops",),
        )
    data = {"distal": Given(len(rows) * distal), **data}
    declared = Declared(frozenset(constants), frozenset(joints.union(constants)), len(rows), distal)
    try:
        robot = READER.validate_python(data, context=declared)
        if distal and robot.values:
            from symgen.description.distal_values import khalil_values

            return replace(robot, values=khalil_values(robot))
        return robot
    except (ValidationError, DescriptionError) as error:
        wrong = explain(error) if isinstance(error, ValidationError) else error
        if wrong.path[:1] == ("elements",) and wrong.path[1:2] and wrong.path[1] in columns:
            path: Path = ("columns", *wrong.path[1:])
            wrong = DescriptionError(wrong.message.replace("elements.", "columns.", 1), path=path)
        raise wrong from error


def _with_columns(data: dict[str, Any]) -> dict[str, Any]:
    """Move each entry of the table `columns` of a robot file to the table `elements`.

    Both tables describe torques on the joints; in `columns`, the user gives the law.
    """
    columns, elements = data.pop("columns", {}), data.get("elements", {})
    if not columns:
        return data
    for table, key in ((columns, "columns"), (elements, "elements")):
        if not isinstance(table, dict):
            raise DescriptionError(f"{key}: found {table!r:.60}; expected a table", path=(key,))
    if both := [name for name in columns if name in elements]:
        raise DescriptionError(
            f"columns: {both[0]!r} is already the name of an entry of `elements` (friction, spring, ...); give the column another name",
            path=("columns", both[0]),
        )
    return {**data, "elements": {**elements, **columns}}


@cache
def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of robot files, by which editors check and complete a file."""
    schema = READER.json_schema()
    version = {"description": "schema version", "title": "Symgen", "type": "integer"}
    convention = {
        "default": "proximal",
        "description": "; ".join(f"{name}: {text}" for name, text in CONVENTIONS.items()),
        "enum": list(CONVENTIONS),
        "title": "Convention",
        "type": "string",
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "RobotFile",
        "description": f"A robot file, schema version {SCHEMA}.",
        "properties": {
            "symgen": version,
            **schema["properties"],
            "columns": schema["properties"]["elements"]
            | {
                "title": "Columns",
                "description": "torques of your own: {SP: {along: 2, torque: sin(q), unit: N*m}}",
            },
            "convention": convention,
        },
        "required": ["symgen", *schema["required"]],
    }


_EXPECTED = {
    "int_type": "a whole number",
    "string_type": "text; put it between quotes",
    "dict_type": "a table {key: value}",
    "dataclass_type": "a table {key: value}",
    "list_type": "a list [a, b, ...]",
    "literal_error": "`all` or a table such as {1: q1}",
}
_UNKNOWN, _OURS = "unexpected_keyword_argument", "described"


def explain(error: ValidationError) -> DescriptionError:
    """Convert a pydantic error to a DescriptionError that explains its most important problem.

    An unknown key comes first, because a misspelt key also makes another key missing. Errors inside
    expressions come last.
    """
    first = min(
        error.errors(include_url=False), key=lambda e: (e["type"] != _UNKNOWN, e["type"] == _OURS)
    )
    path = tuple(
        key
        for key in first["loc"]
        if key != "[key]" and not str(key).startswith(("dict[", "list[", "literal[", "function-"))
    )
    place, kind = dotted(path) or "robot file", first["type"]
    if kind == _OURS:
        ours: SymgenError = first["ctx"]["error"]
        path += getattr(ours, "path", ())
        return DescriptionError(f"{dotted(path)}: {ours}", path=path)
    if kind == _UNKNOWN:
        keys = _keys(path[:-1])
        close = difflib.get_close_matches(str(path[-1]), keys, 1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        if path[0] in ("record", "signals") and len(path) == 1:
            hint = "; this is a study file: the robot comes first, then the record or study"
        message = f"{place}: unknown key {path[-1]!r}; expected {', '.join(keys)}{hint}"
        return DescriptionError(message, path=path)
    if kind == "missing":
        table = dotted(path[:-1]) or "robot file"
        return DescriptionError(f"{table}: key {path[-1]!r} is missing; add it", path=path[:-1])
    given = repr(first["input"])
    if len(given) > 60:
        given = given[:60] + " ..."
    if kind in ("too_short", "too_long"):
        limits = first["ctx"]
        expected = f"{limits.get('min_length', limits.get('max_length'))} entries"
    elif kind == "string_type" and first["loc"][-1] == "[key]":
        expected = "a name"
    else:
        expected = _EXPECTED.get(kind, "")
    text = f"expected {expected}" if expected else first["msg"].removeprefix("Value error, ")
    return DescriptionError(
        f"{place}: found {given}; {text}{_advice(path, first['input'], text)}", path=path
    )


def _advice(path: Path, given: Any, message: str) -> str:
    """Return a hint if a wrong value shows what the user probably meant, else ""."""
    if path[-1:] == ("sigma",):
        return ": 0 revolute, 1 prismatic, 2 fixed"
    if path[:2] == ("drives", "ratio"):
        return "; give ratio one row per motor, [[100, 0], [0, 80]], or one number per motor, [100, 80]"
    if path[:1] == ("constants",) and isinstance(given, int):
        return "; a decimal comma? write 0.06, not 0,06"
    if path[:1] == ("constants",) and "undeclared symbol" in message:
        return "; a constant is one number; write an expression of constants where it is used"
    return ""


def _keys(path: Path) -> list[str]:
    """List the keys that the table at `path` in a robot file may have."""
    schema = json_schema()
    if path:
        table = schema["properties"][str(path[0])]
        reference = json.dumps(table).partition("#/$defs/")[2].partition('"')[0]
        schema = schema["$defs"][reference]
    return list(schema["properties"])
