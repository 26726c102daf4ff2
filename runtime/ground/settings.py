"""Settings: frozen dataclasses whose values pydantic checks, and their conversion from mappings.

    class Lowpass(Settings):
        cutoff: Positive = 50.0

    Lowpass(cutoff=-1)                       # SettingsError: cutoff: -1; expected more than 0
    structure(Lowpass, {"cutoff": "2*50"})   # Lowpass(cutoff=100.0)

A number may be an arithmetic text (`2*pi/10000`) of numbers, pi, the operators + - * / ** and
parentheses. The text is parsed to a syntax tree, and the tree is evaluated; no text is ever
executed as code. A single value means a list of one value. An integer is accepted where a text is
expected.
"""

from __future__ import annotations

import ast
import inspect
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, fields
from functools import cache
from numbers import Integral
from typing import Annotated, Any, TypeAlias, TypeVar, dataclass_transform

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs

from runtime.ground.documents import plain
from runtime.ground.errors import SettingsError
from runtime.ground.limits import LIMIT
from runtime.ground.settings_errors import gone, settings_error, shown

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def number(text: str) -> float:
    """Compute the value of an arithmetic expression such as "2*pi/1000".

    Raise ValueError for any other text, and if the value is not finite and real.
    """
    if len(text) > LIMIT.NUMBER_CHARACTERS:
        raise ValueError(
            f"a number of {len(text)} characters; expected at most {LIMIT.NUMBER_CHARACTERS}"
        )
    try:
        with warnings.catch_warnings(
            action="ignore"
        ):  # of Python, about numbers that run into words
            value = _value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"{text!r} is not a number; write e.g. 1e-3 or 2*pi/10000") from None
    except (ZeroDivisionError, OverflowError) as e:
        raise ValueError(f"{text!r} has no finite value ({e})") from None
    if isinstance(value, complex) or not math.isfinite(value):
        raise ValueError(f"{text!r} has no finite real value")
    return value


def _value(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as x) if not isinstance(x, bool):
            return float(x)
        case ast.Name(id="pi"):
            return math.pi
        case ast.UnaryOp(op=ast.USub(), operand=x):
            return -_value(x)
        case ast.UnaryOp(op=ast.UAdd(), operand=x):
            return _value(x)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left), _value(right))
    raise ValueError(
        f"{ast.unparse(node)!r} is not allowed in a number; use numbers, pi, + - * / ** ( )"
    )


T = TypeVar("T")
Path = tuple[str | int, ...]
CONFIG = ConfigDict(extra="forbid", defer_build=True)  # built when the first instance is made


LIMITS = {
    "gt": "exclusiveMinimum",
    "ge": "minimum",
    "lt": "exclusiveMaximum",
    "le": "maximum",
}
"""Names of pydantic, which it leaves beside a type of its users, and of JSON Schema."""


class Written:
    """Type annotation for the JSON Schema: in a file, values of this type may have several forms.

    For instance, a number may also be written as a text.

    Parameters
    ----------
    form : callable
        Function from the JSON Schema of the type to the JSON Schema of all its forms in a file.
    """

    def __init__(self, form: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
        self.form = form

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        return self.form(handler(schema))


def _number(value: Any) -> Any:
    try:
        return number(value) if isinstance(value, str) else value
    except ValueError as e:
        raise ValueError(f"{e}; expected a number") from None


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


def not_tiny(value: float) -> float:
    if 0 < value < 1 / LARGEST:
        raise SettingsError(f"{value:g} is too small; expected at least {1 / LARGEST:g}")
    return value


def _text(value: Any) -> Any:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _list(value: Any) -> Any:
    several = value is None or (
        isinstance(value, Iterable) and not isinstance(value, str | Mapping)
    )
    return value if several else (value,)


LARGEST = 1e12
"""Largest number of a setting, SI, and one over the smallest positive one: what lies beyond is a
slip of units or keys, and its powers overflow."""
MOST = 1_000_000
"""Largest count."""
Real = Annotated[
    float,
    Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST),
    BeforeValidator(_number),
    Written(lambda s: {**s, "type": ["number", "string"]}),
]
Positive = Annotated[Real, Field(gt=0), AfterValidator(not_tiny)]
NotNegative = Annotated[Real, Field(ge=0)]
Whole = Annotated[int, Field(strict=True), BeforeValidator(_whole)]
Count = Annotated[Whole, Field(ge=1, le=MOST)]
Seed = Annotated[Whole, Field(ge=0, lt=2**63)]
Flag = Annotated[bool, Field(strict=True)]
Text = Annotated[
    str, BeforeValidator(_text), Written(lambda s: {**s, "type": ["string", "integer"]})
]
PerJoint: TypeAlias = T | tuple[T, ...]
"""One value for all joints, or one per joint."""
Many = Annotated[
    tuple[T, ...], BeforeValidator(_list), Written(lambda s: {"anyOf": [s, s["items"]]})
]
"""A list; one value stands for a list of one."""


def require(ok: bool, message: str, *path: str | int) -> None:
    """Raise SettingsError for the setting at `path` (its keys) if the condition `ok` is false.

    In __post_init__, `path` starts at the settings that call this function.
    """
    if not ok:
        raise SettingsError(message, path=path)


def _odd(value: int) -> int:
    require(value % 2 == 1, f"{value}; expected an odd window, 1 for no median filter")
    return value


def _in_order(window: tuple[float | None, float | None]) -> tuple[float | None, float | None]:
    t0, t1 = window
    require(t0 is None or t1 is None or t0 < t1, f"[{t0}, {t1}]; expected the earlier time first")
    return window


OddWindow = Annotated[Whole, Field(ge=1, le=9999), AfterValidator(_odd)]
Interval = Annotated[tuple[Real | None, Real | None], AfterValidator(_in_order)]
"""[t0, t1] in s; null leaves an end open."""


class SettingsType(type):
    """Metaclass of settings: an invalid value raises a SettingsError, not an error of pydantic.

    The error names the key and the expected value.
    """

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        try:
            return super().__call__(*args, **kwargs)
        except ValidationError as e:
            problem = settings_error(e, {**dict(enumerate(args)), **kwargs})
            names: dict[str | int, str | int] = dict(enumerate(f.name for f in fields(cls)))  # type: ignore[arg-type]
            raise SettingsError(
                problem.reason,
                path=tuple(names.get(k, k) for k in problem.path[:1]) + problem.path[1:],
            ) from None


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
@dataclass(frozen=True, config=CONFIG)
class Settings(metaclass=SettingsType):
    """Base class of all settings: a subclass is a frozen dataclass with valid values only."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, config=CONFIG)(cls)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        """Return the JSON Schema of pydantic, with a description of each key from the docstring."""
        made: dict[str, Any] = _with_limits(handler.resolve_ref_schema(handler(schema)))
        texts = [
            inspect.getdoc(base) or ""
            for base in reversed(cls.__mro__)
            if issubclass(base, Settings)
        ]
        parts = [text.partition("\n\nAttributes\n----------\n") for text in texts]
        made["description"] = " ".join(parts[-1][0].split())
        attributes = "\n".join(part[2] for part in parts)
        entries = re.findall(r"^(\w[\w, ]*) : (.*)\n((?: +.*\n?)*)", attributes, re.MULTILINE)
        for keys, form, meaning in entries:
            unit = form.partition(", ")[2]
            said = " ".join(meaning.split()) + (f" [{unit}]" if unit else "")
            for key in keys.split(", "):
                made["properties"][key] = {**made["properties"][key], "description": said}
        return made

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, value: Any) -> Any:
        given = value.kwargs or {} if isinstance(value, ArgsKwargs) else value
        if isinstance(given, cls):
            return given
        names = [f.name for f in fields(cls)]
        if not isinstance(given, Mapping):
            raise SettingsError(
                f"{shown(given)}; expected a mapping with some of {', '.join(names)}"
            )
        if unknown := [str(k) for k in given if k not in names]:
            several = "s" if len(unknown) > 1 else ""
            raise SettingsError(
                f"unknown key{several} {', '.join(unknown)}; known: {', '.join(names)}",
                path=(unknown[0],),
            )
        return value


def _with_limits(schema: Any) -> Any:
    """Rename the limits of pydantic to those of JSON Schema: "ge" becomes "minimum", and so on."""
    if isinstance(schema, dict):
        return {LIMITS.get(key, key): _with_limits(value) for key, value in schema.items()}
    return [_with_limits(item) for item in schema] if isinstance(schema, list) else schema


_adapter = cache(TypeAdapter)  # what checks mappings against a class of settings


def structure(cls: type[T], value: Any, path: Path = ()) -> T:
    """Make settings from a mapping, and check every value.

    Parameters
    ----------
    cls : type
        A subclass of Settings.
    value : mapping
        The content of a file.
    path : tuple of str and int
        Keys that lead to `value` in its file.

    Raises
    ------
    SettingsError
        The mapping has unknown keys, values of a wrong type or values out of range; the error gives
        the path of the key.
    """
    try:
        return _adapter(cls).validate_python(value)  # type: ignore[arg-type, no-any-return]
    except ValidationError as e:
        error = settings_error(e, value, path)
        reason = gone(error.path, _value_at(error.path[len(path) :], value)) or error.reason
        raise SettingsError(reason, path=error.path) from None


def _value_at(path: Path, value: Any) -> Any:
    """Return the value to which the keys `path` lead in nested mappings; None without a value."""
    for key in path:
        if isinstance(value, Mapping):
            value = (
                value if isinstance(key, int) else value.get(key)
            )  # one stands for a list of one
        elif isinstance(value, list | tuple) and isinstance(key, int) and key < len(value):
            value = value[key]
        else:
            return None
    return value


def to_mapping(settings: Any) -> dict[str, Any]:
    """Convert a Study, or a section of it, to a complete mapping of plain values.

    Plain values are dicts, lists, numbers and texts. The conversion can be reversed:

        study_from_mapping(to_mapping(s)) == s
    """
    return plain(settings)  # type: ignore[no-any-return]
