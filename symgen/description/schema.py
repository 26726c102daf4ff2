"""The robot file as pydantic models: which keys exist, of which type; meaning is checked by `robot.Robot`.

Expressions stay text here (`Symbolic`) and are read by `expression.parse` when their symbols are known; constant expressions
(`Number`: 0.225, pi/2, 2*pi/10000) become floats at once.
"""

from __future__ import annotations

import difflib
import json
import math
import pathlib
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, WithJsonSchema

from symgen.description.grammar import parse
from symgen.description.robot import DIRECTIONS, KINDS, Path
from symgen.errors import ExpressionError

SCHEMA = 1  # version of the robot file
CONVENTIONS = ("proximal", "distal")


def _symbolic(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError("expected a number or an expression such as q1, -pi/2 or D3 + 0.1")
    return value if isinstance(value, str) else repr(value)


def _number(value: Any) -> float:
    text = _symbolic(value)
    try:
        number = float(parse(text, ()))
    except ExpressionError as error:
        raise ValueError(f"expected a number or a constant expression such as pi/2; {error}") from error
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise ValueError("expected a number; this expression has no finite real value") from error
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number


def _interval(value: Any) -> tuple[float, float]:
    if isinstance(value, list):
        if len(value) != 2:
            raise ValueError("expected [lower, upper], or one number for +- that number")
        return _number(value[0]), _number(value[1])
    return -_number(value), _number(value)


_TEXT_OR_NUMBER = WithJsonSchema({"type": ["number", "string"]})
Symbolic = Annotated[str, BeforeValidator(_symbolic), _TEXT_OR_NUMBER]
Number = Annotated[float, BeforeValidator(_number), _TEXT_OR_NUMBER]
Interval = Annotated[tuple[float, float], BeforeValidator(_interval), WithJsonSchema({"type": ["number", "string", "array"]})]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class FrameRow(_Table):
    """One row of the table of Khalil and Kleinfinger."""

    ant: int = Field(description="antecedent frame, 0 for the base")
    sigma: int = Field(description="0 revolute, 1 prismatic, 2 fixed")
    mu: int | None = Field(default=None, description="1 actuated, 0 passive; default 1, for a fixed frame 0")
    gamma: Symbolic = Field(default="0", description="rotation about z of the antecedent frame first, rad; of trees and loops only")
    b: Symbolic = Field(default="0", description="distance along that z, m; of trees and loops only")
    alpha: Symbolic = Field(description="angle between the z axes, about x, rad: pi/2")
    d: Symbolic = Field(description="distance between the z axes, along x, m: D2")
    theta: Symbolic = Field(description="angle between the x axes, about z_j, rad; q1 or q1 + pi/2 where sigma is 0")
    r: Symbolic = Field(description="distance between the x axes, along z_j, m; q1 or q1 + R1 where sigma is 1")


class LoopRow(_Table):
    """A closed loop: frame `twin`, fixed, coincides with the frame of the cut joint."""

    cut: int = Field(description="number of the cut joint: passive, without a link")
    twin: int = Field(description="number of the fixed frame (sigma 2) at the same place on the other branch")
    start: dict[str, Number] = Field(default={}, description="picks the assembly mode: {q3: 1.2}")


class ElementTable(_Table):
    """Inertia, friction, offset or spring on the joint coordinates."""

    kind: str = Field(description=f"one of {', '.join(KINDS)}", json_schema_extra={"enum": list(KINDS)})
    along: Literal["all"] | dict[int, Symbolic] = Field(
        default={}, description="{6: q5 + q6} (6 numbers the parameter, FSM6), or all: every actuated joint"
    )
    form: dict[int, Symbolic] = Field(default={}, description="quadratic forms: {6: q6**2 + 2*q5*q6}")
    when: str | None = Field(
        default=None, description="direction of motion: positive or negative", json_schema_extra={"enum": [*DIRECTIONS, None]}
    )


class DrivesTable(_Table):
    """qm = ratio (q - offset), tau = ratio' (torque_constant * u)."""

    ratio: list[list[Number]] = Field(description="one row per motor: [[100, 0], [0, 80]]; rad per m for a prismatic joint")
    offset: list[Number] | None = Field(default=None, description="joint positions where the motors read 0; default 0")
    torque_constant: list[Number] | Number = Field(default=1.0, description="N m/A; a number, or one per motor")


class LimitsTable(_Table):
    """For exciting trajectories, one entry per actuated joint."""

    q: list[Interval] | None = Field(default=None, description="[lower, upper], or one number for +- that number")
    qd: list[Number] | None = Field(default=None, description="largest speeds, rad/s or m/s")
    qdd: list[Number] | None = Field(default=None, description="largest accelerations, rad/s^2 or m/s^2")
    tau: list[Number] | None = Field(default=None, description="largest torques, N m or N")


class RobotFile(_Table):
    """A robot file, schema version 1."""

    symgen: int = Field(description="schema version")
    name: str = Field(description="identifier; names the emitted module")
    title: str = Field(default="", description="one line, printed above results")
    source: str = Field(default="", description="where the table comes from")
    gravity: list[Symbolic] = Field(description="acceleration of gravity in frame 0: [0, 0, -g]", min_length=3, max_length=3)
    constants: dict[str, Number] = Field(
        default={}, description="lengths and angles by name, numbers only: {D2: 0.5, g: 9.81}; names stay in the formulas"
    )
    convention: str = Field(
        default="proximal",
        description="proximal: Khalil and Kleinfinger; distal: classic DH, with its a as d and its d as r",
        json_schema_extra={"enum": list(CONVENTIONS)},
    )
    frames: dict[int, FrameRow] = Field(description="1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}")
    loops: list[LoopRow] = Field(default=[], description="[{cut: 6, twin: 7}]")
    constraints: dict[str, Symbolic] = Field(default={}, description="passive joints: {q3: q5 - q2 + pi}")
    massless: list[int] = Field(default=[], description="links without inertial parameters")
    elements: dict[str, ElementTable] = Field(default={}, description="FV: {kind: viscous, along: all} makes FV1, FV2 ...")
    drives: DrivesTable | None = Field(default=None, description="motors to joints, for measured records")
    limits: LimitsTable = Field(
        default_factory=LimitsTable, description="for exciting trajectories; the sliders of the page take those of q"
    )
    values: dict[str, Number] = Field(
        default={}, description="standard parameters you know, SI: {M1: 2.0, ZZ1: 0.17}; never used in the derivation"
    )
    labels: dict[int, str] = Field(
        default={},
        description="{1: shoulder_pan, 2: elbow}: names of joints in other programs, shown in tables; `q: names` of a study finds columns by them",
    )


def json_schema() -> dict[str, Any]:
    """JSON Schema of a robot file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **RobotFile.model_json_schema()}


def schema_text() -> str:
    """The text of robot.schema.json, which is installed beside this module."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


def schema_file() -> pathlib.Path:
    """The installed robot.schema.json."""
    return pathlib.Path(__file__).with_name("robot.schema.json")


_EXPECTED = {
    "int_type": "a whole number",
    "string_type": "text; put it between quotes",
    "dict_type": "a table {key: value}",
    "model_type": "a table {key: value}",
    "list_type": "a list [a, b, ...]",
    "literal_error": "`all` or a table such as {1: q1}",
}


def explain(error: ValidationError) -> tuple[str, Path]:
    """Message and path of the first thing that is wrong; a misspelt key comes before the one it leaves missing."""
    first = min(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    path = tuple(key for key in first["loc"] if key != "[key]" and not str(key).startswith(("dict[", "list[", "literal[", "function-")))
    place, kind = ".".join(str(key) for key in path) or "robot file", first["type"]
    if kind == "extra_forbidden":
        keys = _keys(path[:-1])
        close = difflib.get_close_matches(str(path[-1]), keys, 1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        if path[0] in ("record", "signals") and len(path) == 1:
            hint = "; this is a study file: the robot comes first, then the record or study"
        return f"{place}: unknown key {path[-1]!r}; expected {', '.join(keys)}{hint}", path
    if kind == "missing":
        return f"{'.'.join(str(key) for key in path[:-1]) or 'robot file'}: key {path[-1]!r} is missing; add it", path[:-1]
    given = repr(first["input"])
    if len(given) > 60:
        given = given[:60] + " ..."
    if kind in ("too_short", "too_long"):
        limits = first["ctx"]
        return f"{place}: found {given}; expected {limits.get('min_length', limits.get('max_length'))} entries", path
    expected = "a name" if kind == "string_type" and first["loc"][-1] == "[key]" else _EXPECTED.get(kind)
    text = f"expected {expected}" if expected else first["msg"].removeprefix("Value error, ")
    return f"{place}: found {given}; {text}{_advice(path, first['input'])}", path


def _advice(path: Path, given: Any) -> str:
    """What to write instead, where a value of the wrong type shows what was meant."""
    if path[-1:] == ("sigma",):
        return ": 0 revolute, 1 prismatic, 2 fixed"
    if path[:2] == ("drives", "ratio") and len(path) == 3:
        return "; ratio has one row per motor: [[100, 0], [0, 80]]"
    if path[:1] == ("constants",) and isinstance(given, int):
        return "; a decimal comma? write 0.06, not 0,06"
    if path[:1] == ("constants",) and isinstance(given, str) and len(path) == 2:
        return (
            "; a constant is a number of its own: sums of constants stand where they are used" if "undeclared" in _constant(given) else ""
        )
    return ""


def _constant(text: str) -> str:
    """Why `text` is no constant expression, else ""."""
    try:
        parse(text, ())
    except ExpressionError as error:
        return str(error)
    return ""


def _keys(path: Path) -> list[str]:
    """The keys a table may have."""
    tables: dict[str, type[_Table]] = {
        "frames": FrameRow,
        "loops": LoopRow,
        "elements": ElementTable,
        "drives": DrivesTable,
        "limits": LimitsTable,
    }
    return list((tables[str(path[0])] if path else RobotFile).model_fields)
