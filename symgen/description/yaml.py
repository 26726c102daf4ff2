"""Robot files: YAML 1.2 text to plain data with line numbers, from there to a checked Robot, and
back to a text that reads as the same Robot.

Only what a table of numbers needs is read: mappings, lists and scalars of the core schema. Tags,
anchors and aliases, merge
keys, repeated keys, second documents and non-finite numbers are refused, so that a file means what
it shows. Whatever the
bytes are, the only exception that leaves this module is DescriptionError, with file and line.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from symgen.description.advice import yaml_advice
from symgen.description.element import Element
from symgen.description.expression import ONE
from symgen.description.fields import Path, located
from symgen.description.parts import GEOMETRY, Form, Row
from symgen.description.robot import Robot
from symgen.description.schema import SCHEMA, robot_of
from symgen.errors import DescriptionError

MAX_BYTES, MAX_NESTING, MAX_SCALAR = 200_000, 12, 4000

_INTEGER = re.compile(r"[-+]?[0-9]{1,15}\Z")
_DECIMAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,3})?\Z")
CONSTANTS: dict[str, bool | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
CONSTANTS |= {
    word: value
    for value, words in ((True, "true True TRUE"), (False, "false False FALSE"))
    for word in words.split()
}


WORDS = ("null", "true", "false", "yes", "no", "on", "off")  # of YAML, of version 1.1 too
DRIVES = ("ratio", "offset", "torque_constant")
BY_ROW = ("frames", "elements", "limits", "values", "labels")


def parse_robot(content: bytes, file: str) -> Robot:
    """The robot described by the bytes of a file called `file`."""
    lines: dict[Path, int] = {}

    def line(path: Path) -> int:
        places = (path[:k] for k in range(len(path), -1, -1))
        return next((lines[place] for place in places if place in lines), 1)

    with located(file, line):
        data = _document(content, lines)
        _check_version(data)
        return robot_of(data, file, hashlib.sha256(content).hexdigest())


def _check_version(data: Any) -> None:
    if not isinstance(data, dict):
        raise DescriptionError(
            f"found {'nothing' if data is None else repr(data)[:60]}; expected a robot file: a "
            f"table that starts with `symgen: {SCHEMA}`"
        )
    version = data.get("symgen")
    if isinstance(version, bool) or version != SCHEMA:
        given = f"symgen: {version!r}"[:60] if "symgen" in data else "no key `symgen`"
        raise DescriptionError(
            f"{given}; expected `symgen: {SCHEMA}`, the schema version this release reads",
            path=("symgen",),
        )


def _document(content: bytes, lines: dict[Path, int]) -> Any:
    """Plain data of the one document in `content`; `lines` receives the line of every key path."""
    if len(content) > MAX_BYTES:
        raise DescriptionError(f"more than {MAX_BYTES} bytes; a robot file has a few thousand")
    try:
        events = _plain(YAML(typ="safe", pure=True).parse(content.decode("utf-8-sig")))
        next(events)  # start of the stream
        if not isinstance(next(events), DocumentStartEvent):
            return None
        data = _value(next(events), events, (), lines)
        next(events)  # end of the document
        if isinstance(more := next(events), DocumentStartEvent):
            raise DescriptionError(
                "a second document starts here; a robot file holds one", line=_line(more)
            )
        return data
    except DescriptionError:
        raise
    except UnicodeDecodeError as error:
        line, byte = content.count(b"\n", 0, error.start) + 1, content[error.start]
        message = f"byte 0x{byte:02x} is not UTF-8; save the file as UTF-8"
        raise DescriptionError(message, line=line) from error
    except MarkedYAMLError as error:
        mark, problem = (
            error.problem_mark or error.context_mark,
            str(error.problem or error.context),
        )
        raise DescriptionError(
            f"not YAML: {problem}{yaml_advice(problem)}", line=mark.line + 1 if mark else None
        ) from error
    except Exception as error:  # on malformed text the scanner raises IndexError and others too
        first = (str(error) or type(error).__name__).splitlines()[0]
        raise DescriptionError(f"not YAML: {first}") from error


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1


def _plain(events: Iterator[Event]) -> Iterator[Event]:
    """The events, without what makes a file mean more than it shows."""
    for event in events:
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None:
            message = "anchors and aliases (& and *) are not read; write the value out"
            raise DescriptionError(message, line=_line(event))
        if getattr(event, "tag", None) not in (None, "!"):
            raise DescriptionError("tags (!) are not read; write a plain value", line=_line(event))
        yield event


def _value(event: Event, events: Iterator[Event], path: Path, lines: dict[Path, int]) -> Any:
    """Plain data of the value that starts with `event`."""
    lines.setdefault(path, _line(event))
    if len(path) > MAX_NESTING:
        raise DescriptionError(f"nested more than {MAX_NESTING} deep", line=_line(event))
    if isinstance(event, MappingStartEvent):
        return _mapping(events, path, lines)
    if not isinstance(event, SequenceStartEvent):
        return _scalar(event)
    items: list[Any] = []
    while not isinstance(item := next(events), SequenceEndEvent):
        items.append(_value(item, events, (*path, len(items)), lines))
    return items


def _mapping(events: Iterator[Event], path: Path, lines: dict[Path, int]) -> dict[Any, Any]:
    table: dict[Any, Any] = {}
    while not isinstance(event := next(events), MappingEndEvent):
        key: Any = _scalar(event) if isinstance(event, ScalarEvent) else None
        message = ""
        if not isinstance(key, int | str) or isinstance(key, bool) or key == "<<":
            given = getattr(event, "value", "[...]")
            message = f"key {given!r:.40}: expected a name or a whole number"
        elif key in table:
            first = lines[(*path, key)]
            message = f"key {key!r} is given twice (first on line {first}); keep one"
        if message:
            raise DescriptionError(message, line=_line(event))
        lines[(*path, key)] = _line(event)
        table[key] = _value(next(events), events, (*path, key), lines)
    return table


def _scalar(event: Any) -> Any:
    """null, bool, int and float of the YAML 1.2 core schema when plain, else text."""
    text: str = event.value
    if len(text) > MAX_SCALAR:
        message = f"text of {len(text)} characters; at most {MAX_SCALAR} are read"
        raise DescriptionError(message, line=_line(event))
    if event.style is not None:
        return text
    if text in CONSTANTS:
        return CONSTANTS[text]
    if _INTEGER.match(text):
        return int(text)
    decimal = _DECIMAL.match(text)
    return number if decimal and (number := float(text)) - number == 0 else text


def tables_of(robot: Robot) -> dict[str, Any]:
    """The tables of a robot file, by their keys; expressions are not yet text."""
    drives = robot.drives
    return {
        "symgen": SCHEMA,
        "name": robot.name,
        "title": json.dumps(robot.title, ensure_ascii=False) if robot.title else "",
        "source": json.dumps(robot.source, ensure_ascii=False) if robot.source else "",
        "gravity": robot.gravity,
        "constants": robot.constants,
        "frames": {
            f.j: {
                key: value
                for key in ("ant", "sigma", "mu", *GEOMETRY)
                if (value := getattr(f, key)) or key not in ("gamma", "b")
            }
            for f in robot.frames
        },
        "loops": [
            {"cut": loop.cut, "twin": loop.twin}
            | ({"start": {f"q{j}": x for j, x in loop.start.items()}} if loop.start else {})
            for loop in robot.loops
        ],
        "constraints": {f"q{j}": e for j, e in robot.constraints.items()},
        "massless": sorted(robot.massless),
        "elements": {e.family: _element(robot, e) for e in robot.elements},
        "drives": {} if drives is None else {key: getattr(drives, key) for key in DRIVES},
        "limits": robot.limits,
        "values": robot.values,
        "assume": dict.fromkeys(sorted(robot.assume), 0),
        "labels": {j: json.dumps(x, ensure_ascii=False) for j, x in robot.labels.items()},
    }


def write_yaml(robot: Robot, *, comments: Sequence[str] = ()) -> str:
    """Text of the file; `comments` are lines that stand first, each after a #."""
    lines = [f"# {line}" for line in comments]
    for key, table in tables_of(robot).items():
        if key in BY_ROW and table:
            lines += [f"{key}:", *(f"  {flow(k)}: {flow(row)}" for k, row in table.items())]
        elif key == "loops" and table:
            lines += ["loops:", *(f"  - {flow(loop)}" for loop in table)]
        elif table or key == "constants":
            lines.append(f"{key}: {flow(table)}")
    return "\n".join(lines) + "\n"


def flow(value: Any) -> str:
    """A value on one line; a name that YAML reads as something else between quotes."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{flow(key)}: {flow(x)}' for key, x in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(flow, value))}]"
    text = str(value)
    return f'"{text}"' if text.lower() in WORDS else text


def _element(robot: Robot, e: Element) -> dict[str, Any]:
    everywhere = e.along == {j: {j: ONE} for j in robot.joints}
    along = "all" if everywhere else {j: _row(row) for j, row in e.along.items()}
    form = {j: _form(form) for j, form in e.form.items()}
    table = {"kind": e.kind, "along": along, "form": form, "when": e.when}
    texts = {"torque": e.torque, "energy": e.energy, "unit": e.unit or None}
    table |= {key: json.dumps(str(x)) for key, x in texts.items() if x is not None}
    scalars = {
        name: x.value if x.fixed else {"bounds": x.bounds, "start": x.value, "grid": x.grid}
        for name, x in e.fit.items()
    }
    return {key: value for key, value in {**table, "fit": scalars}.items() if value}


def _row(row: Row) -> str:
    return " + ".join(f"q{j}" if c == ONE else f"({c})*q{j}" for j, c in row.items())


def _form(form: Form) -> str:
    """q' B q, each pair once."""
    terms = [(i, j, c if i == j else c * 2) for (i, j), c in form.items() if i <= j]
    return " + ".join(f"q{i}*q{j}" if c == ONE else f"({c})*q{i}*q{j}" for i, j, c in terms)
