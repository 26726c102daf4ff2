"""Reader and writer of robot files in YAML 1.2.

A text is read as plain data with line numbers and then converted to a checked Robot. A written text
is read as the same Robot. Only mappings, lists and scalars of the core schema are read. Tags,
anchors and aliases, merge keys, repeated keys, second documents and non-finite numbers are refused,
so that a file means what it shows. Whatever the bytes are, the only exception that leaves this
module is DescriptionError, with file and line.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ruamel.yaml import YAML, MappingNode, Node, ScalarNode
from ruamel.yaml.error import MarkedYAMLError

from symgen.description.element import Element
from symgen.description.expression import ONE
from symgen.description.fields import Path, located
from symgen.description.parts import GEOMETRY, Form, Row
from symgen.description.robot import Robot
from symgen.description.schema import SCHEMA, robot_of
from symgen.errors import DescriptionError

MAX_BYTES, MAX_NESTING, MAX_SCALAR = 200_000, 12, 4000

INTEGER = re.compile(r"[-+]?[0-9]{1,15}\Z")
DECIMAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,3})?\Z")
CONSTANTS: dict[str, bool | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
CONSTANTS |= {
    word: value
    for value, words in ((True, "true True TRUE"), (False, "false False FALSE"))
    for word in words.split()
}


ANCHORS = "anchors and aliases (& and *) are not supported; write the value itself"
_ADVICE = {  # what the scanner says: what to change
    "'\\t'": "there is a tab here; indent with spaces",
    "mapping values are not allowed here": (
        "a second `: ` on this line; put text that contains `: ` between quotes"
    ),
    "but found '<block mapping start>'": (
        "this line has another indent than the lines above; "
        "give all rows of one table the same indent"
    ),
    "<block end>, ": (
        "the lines above are a list (-) or have another indent; write every row as `1: {...}`, "
        "with the same indent"
    ),
    "found another document": "a second document starts here; a robot file holds one",
    "found undefined alias": ANCHORS,
    "expected ',' or '}'": "look here, or at the end of the row above, for a missing , or }",
    "expected ',' or ']'": "look here, or at the end of the row above, for a missing , or ]",
}
WORDS = ("null", "true", "false", "yes", "no", "on", "off")  # of YAML, of version 1.1 too
DRIVES = ("ratio", "offset", "torque_constant")
BY_ROW = ("frames", "elements", "limits", "values", "labels")


def parse_robot(content: bytes, file: str) -> Robot:
    """Read a robot from the bytes of a file called `file`."""
    if not isinstance(content, bytes):
        raise DescriptionError(
            f"content is of type {type(content).__name__}; expected the bytes of a robot file "
            "(for a text: text.encode()); use load_robot to read a file by its path"
        )
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
    """Parse `content` as one YAML document and return its data as Python objects.

    `lines` receives the line number of every key path.
    """
    if len(content) > MAX_BYTES:
        raise DescriptionError(
            f"the file has more than {MAX_BYTES} bytes; a robot file has a few thousand"
        )
    try:
        yaml = YAML(typ="safe", pure=True)
        node = yaml.compose(content.decode("utf-8-sig"))
        return None if node is None else _value(node, (), lines, yaml.resolver)
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
        advice = next((f"; {text}" for part, text in _ADVICE.items() if part in problem), "")
        raise DescriptionError(
            f"not YAML: {problem}{advice}", line=mark.line + 1 if mark else None
        ) from error
    except RecursionError as error:
        raise DescriptionError(
            f"tables and lists are nested more than {MAX_NESTING} deep"
        ) from error
    except Exception as error:  # on malformed text the scanner raises IndexError and others too
        first = (str(error) or type(error).__name__).splitlines()[0]
        raise DescriptionError(f"not YAML: {first}") from error


def _value(node: Node, path: Path, lines: dict[Path, int], resolver: Any) -> Any:
    """Convert a YAML node to plain Python data, and store the line number of every key path in
    `lines`.
    """
    line = node.start_mark.line + 1
    lines.setdefault(path, line)
    if len(path) > MAX_NESTING:
        raise DescriptionError(
            f"tables and lists are nested more than {MAX_NESTING} deep", line=line
        )
    if node.anchor is not None:
        raise DescriptionError(ANCHORS, line=line)
    plain = (node.style is None, True) if isinstance(node, ScalarNode) else True
    if node.tag != resolver.resolve(type(node), node.value, plain):
        raise DescriptionError("tags (!) are not read; write a plain value", line=line)
    if isinstance(node, ScalarNode):
        return _scalar(node, line)
    if not isinstance(node, MappingNode):
        return [_value(item, (*path, k), lines, resolver) for k, item in enumerate(node.value)]
    table: dict[Any, Any] = {}
    for name, item in node.value:
        line = name.start_mark.line + 1
        key = _scalar(name, line) if isinstance(name, ScalarNode) else None
        if not isinstance(key, int | str) or isinstance(key, bool) or key == "<<":
            given = name.value if isinstance(name, ScalarNode) else "[...]"
            raise DescriptionError(
                f"key {given!r:.40}: expected a name or a whole number", line=line
            )
        if key in table:
            first = lines[(*path, key)]
            raise DescriptionError(
                f"key {key!r} is given twice (first on line {first}); keep one", line=line
            )
        lines[(*path, key)] = line
        table[key] = _value(item, (*path, key), lines, resolver)
    return table


def _scalar(node: ScalarNode, line: int) -> Any:
    """Convert an unquoted YAML value to None, bool, int or float by the rules of YAML 1.2, else to
    text.
    """
    text: str = node.value
    if len(text) > MAX_SCALAR:
        raise DescriptionError(
            f"the text has {len(text)} characters; the limit is {MAX_SCALAR}", line=line
        )
    if node.style is not None:
        return text
    if text in CONSTANTS:
        return CONSTANTS[text]
    if INTEGER.match(text):
        return int(text)
    decimal = DECIMAL.match(text)
    return number if decimal and (number := float(text)) - number == 0 else text


def tables_of(robot: Robot) -> dict[str, Any]:
    """Return the data of a robot file that describes `robot`, by key, with Expression objects, not
    texts.
    """
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
        "drives": {
            key: x
            for key in DRIVES
            if drives is not None and (x := getattr(drives, key)) is not None
        },
        "limits": robot.limits,
        "values": robot.values,
        "assume": dict.fromkeys(sorted(robot.assume), 0),
        "labels": {j: json.dumps(x, ensure_ascii=False) for j, x in robot.labels.items()},
    }


def write_yaml(robot: Robot, *, comments: Sequence[str] = ()) -> str:
    """Return the robot file of `robot` as text; `comments` are its first lines, after a #."""
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
    """Write a value on one line of YAML; reserved words such as yes and no get quotes."""
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
    """Write the quadratic form q' B q as text, with each product q_i q_j once."""
    terms = [(i, j, c if i == j else c * 2) for (i, j), c in form.items() if i <= j]
    return " + ".join(f"q{i}*q{j}" if c == ONE else f"({c})*q{i}*q{j}" for i, j, c in terms)
