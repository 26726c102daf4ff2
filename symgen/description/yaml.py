"""Robot files in YAML 1.2: reading, writing, JSON Schema, and a template for a new robot.

A text is read as plain data with line numbers and then converted to a checked Robot. A written text
is read as the same Robot. Only mappings, lists and scalars of the core schema are read. Tags,
anchors and aliases, merge keys, repeated keys, second documents and non-finite numbers are refused,
so that a reader of the file sees everything that it means. Whatever the bytes are, the only
exception that `parse_robot` raises is DescriptionError, with file and line; its message names the
wrong field.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import PurePath
from typing import Any

from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML, MappingNode, Node, ScalarNode
from ruamel.yaml.error import MarkedYAMLError

from symgen.description.distal import khalil_values
from symgen.description.element import Element
from symgen.description.expression import ONE
from symgen.description.fields import Declared, Given, Path, dotted, located
from symgen.description.naming import check_identifier
from symgen.description.parts import GEOMETRY, Form, Row
from symgen.description.robot import Robot
from symgen.errors import DescriptionError, SymgenError, require

SCHEMA = 1  # version of the robot file
READER = TypeAdapter(Robot)  # its validators are built when the first file is read
CONVENTIONS = {
    "proximal": "Khalil and Kleinfinger",
    "distal": "classic DH, with its a as d and its d as r; `values` are then in the frames of that "
    "table, but every parameter that symgen prints or identifies is in Khalil's frame of its link",
}


# --- text to plain data ---

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
_YAML_ADVICE = {  # what the scanner says: what to change
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


def parse_robot(content: bytes, file: str) -> Robot:
    """Read a robot from the bytes of a file called `file`.

    Examples
    --------
    >>> import symgen
    >>> lines = ["symgen: 1", "name: pendulum", "gravity: [9.81, 0, 0]", "frames:"]
    >>> lines += ["  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}"]
    >>> text = "\\n".join(lines)
    >>> robot = symgen.parse_robot(text.encode(), "pendulum.yaml")
    >>> symgen.regrouping(robot).names
    ('ZZ1', 'MX1', 'MY1')
    """
    if not isinstance(content, bytes):
        raise DescriptionError(
            f"content is of type {type(content).__name__}; expected the bytes of a robot file "
            "(for a text: text.encode()); use load_robot to read a file by its path"
        )
    require(file, str, "file", "the name of the file, a text")
    lines: dict[Path, int] = {}

    def line(path: Path) -> int:
        places = (path[:k] for k in range(len(path), -1, -1))
        return next((lines[place] for place in places if place in lines), 1)

    with located(file, line):
        data = document(content, lines)
        _check_version(data)
        return described(data, file, hashlib.sha256(content).hexdigest())


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


def document(content: bytes, lines: dict[Path, int]) -> Any:
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
        advice = next((f"; {text}" for part, text in _YAML_ADVICE.items() if part in problem), "")
        raise DescriptionError(
            f"the text is not YAML: {problem}{advice}", line=mark.line + 1 if mark else None
        ) from error
    except RecursionError as error:
        raise DescriptionError(
            f"tables and lists are nested more than {MAX_NESTING} deep"
        ) from error
    except Exception as error:  # on malformed text the scanner raises IndexError and others too
        first = (str(error) or type(error).__name__).splitlines()[0]
        raise DescriptionError(f"the text is not YAML: {first}") from error


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


# --- plain data to a robot ---


def described(data: Mapping[str, Any], file: str, sha256: str) -> Robot:
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


# --- robot to text ---

WORDS = ("null", "true", "false", "yes", "no", "on", "off")  # of YAML, of version 1.1 too
DRIVES = ("ratio", "offset", "torque_constant")
BY_ROW = ("frames", "elements", "limits", "values", "labels")


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
        "base": robot.base if robot.base_moves else "",
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


def data_of(robot: Robot) -> dict[str, Any]:
    """Return the data of a robot file from which `described` makes `robot` again."""
    data: dict[str, Any] = document(write_yaml(robot).encode(), {})
    return data


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


# --- template ---

EDITORS = """\
# yaml-language-server: $schema=robot.schema.json
# Editors complete and check this file once you run: symgen schema > robot.schema.json
"""

_SKELETON = """\
# {name}: a robot file. Replace the two joints below by yours; what follows `frames` may go.
symgen: {schema}                          # version of this format
name: {name}
title: Two revolute joints in a vertical plane
source: where the table below comes from
gravity: [0, -g, 0]                # acceleration of gravity in frame 0, m/s^2: here y0 is up
constants: {{D2: 0.5, g: 9.81}}      # SI and rad; they stay symbols in all formulas

# One row per frame, modified Denavit-Hartenberg (Khalil and Kleinfinger 1986), from `ant` to j:
#     Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)
# gamma and b are 0 if left out. With `convention: distal`, classic Denavit-Hartenberg instead:
#     Rot(z, theta) Trans(z, r) Trans(x, d) Rot(x, alpha)
# sigma: 0 revolute (theta: q1, or q1 + constant), 1 prismatic (r: q1), 2 fixed.
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}}

# What acts on the joints besides the links. kind: inertia, viscous, coulomb, offset or stiffness.
# along: all, or {{2: q1 + q2}} for a motor that turns with two joints; viscous and coulomb also
# take `when: positive` or `negative`.
elements:
  Ia:     {{kind: inertia, along: all}}
  FV:     {{kind: viscous, along: all}}
  FS:     {{kind: coulomb, along: all}}
  OFFSET: {{kind: offset,  along: all}}

# Motors to joints, for measured records:
# qm = ratio (q - offset), tau = ratio' (torque_constant * u).
# drives: {{ratio: [[100, 0], [0, 100]], offset: [0, 0], torque_constant: [1, 1]}}

# For exciting trajectories: q as [lower, upper] or one number for +-; qd, qdd, tau: largest values.
# SI, of the joint: a motor of 3000 rpm behind a ratio of 100 allows 3000*2*pi/60/100 rad/s.
# limits: {{q: [pi, [-pi/2, pi/2]], qd: [3, 3], qdd: [10, 10], tau: [50, 20]}}

# Standard parameters you know, for simulation; inertia about the origin of the link frame.
# values: {{M1: 2.0, MX1: 0.5, ZZ1: 0.17}}
"""


def skeleton(name: str) -> str:
    """Return the text of a commented robot file for a two-joint robot called `name`.

    Raises DescriptionError if `name` is not an identifier.
    """
    check_identifier(name, ("name",))
    return _SKELETON.format(name=name, schema=SCHEMA)


def skeleton_for(file: PurePath) -> str:
    """Return the text of a commented template for the robot file `file`.

    Its first lines name the JSON Schema for editors. Raises DescriptionError if `file` does not end
    in .yaml or .yml, or if its name is not an identifier.
    """
    if file.suffix not in (".yaml", ".yml"):
        raise DescriptionError(f"{file}: a robot file ends in .yaml")
    return EDITORS + skeleton(file.stem)
