"""Conversion of results to JSON, first to mappings of plain values, then to text; and reading of
results from JSON, with a check of every value.

A result has its kind and version in the key `schema`. A result of another kind or version and a
damaged file each raise one clear error. Unknown keys are ignored, so that a later version can add
keys under the same `schema`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, ClassVar, NoReturn, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, WithJsonSchema
from pydantic_core import core_schema

from runtime.ground.errors import InputError, encodable
from runtime.ground.settings_errors import settings_error


class Result:
    """Base class of result dataclasses, with functions that write a result as text and as JSON.

        class Delay(Result, keys="joints shift")

    keys : names of the fields and properties in JSON, in this order; "key:name" writes the field
    `name` under `key`. Default: all fields.

    schema : kind and version of the result, the first key in JSON; None for a part of another
    result.
    """

    _keys: ClassVar[str]
    _schema: ClassVar[str | int | None]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init_subclass__(cls, keys: str = "", schema: str | int | None = None) -> None:
        cls._keys, cls._schema = keys, schema

    def __str__(self) -> str:
        text: Any = getattr(self, "to_table", None) or getattr(self, "to_text", self.__repr__)
        return str(text())

    def summary(self) -> dict[str, Any]:
        """Return the result as a mapping: the content of its JSON text."""
        head = {} if self._schema is None else {"schema": self._schema}
        names = [word.partition(":") for word in self._keys.split() or self.__dataclass_fields__]
        return head | {key: getattr(self, name or key) for key, _, name in names}

    def to_json(self) -> str:
        """Write the result as JSON text."""
        return json_text(self.summary())


def plain(value: Any) -> Any:
    """Convert `value` to types of JSON: mappings, lists, texts and finite numbers.

    nan and infinity become null. A Result becomes its summary, another dataclass a mapping of its
    fields, an array a list, and any other object its text.
    """
    if isinstance(value, Result):
        return plain(value.summary())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def json_text(value: Any) -> str:
    """Write a value as JSON text, indented by two spaces, with lists of scalars on one line.

    The value is first converted by `plain`; the text ends with a newline.
    """
    return encodable(_render(plain(value), "")) + "\n"


def _render(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        items = [
            f"{deeper}{json.dumps(key, ensure_ascii=False)}: {_render(item, deeper)}"
            for key, item in value.items()
        ]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, list | dict) for item in value):
        return "[\n" + ",\n".join(deeper + _render(item, deeper) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


T = TypeVar("T")


class Numbers:
    """Type for pydantic: an array of floats, in JSON written as nested lists with null for nan.

    Parameters
    ----------
    kind : type
        Type of the nested lists.
    """

    def __init__(self, kind: Any) -> None:
        self.kind = kind

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(
            self.array, handler.generate_schema(self.kind)
        )

    def array(self, rows: list[Any]) -> np.ndarray:
        """Convert nested lists to an array of floats; a matrix without rows has shape (0, 0)."""
        return (
            np.array(rows, dtype=float) if rows or self.kind == list[Number] else np.empty((0, 0))
        )


_FORM = WithJsonSchema({"type": ["number", "null"]})
_FINITE = Field(strict=True, allow_inf_nan=False)
Number = Annotated[Annotated[float, _FINITE] | None, _FORM]
NanIfNull = Annotated[
    float, Field(strict=True), BeforeValidator(lambda x: math.nan if x is None else x), _FORM
]
InfIfNull = Annotated[
    float, Field(strict=True), BeforeValidator(lambda x: math.inf if x is None else x), _FORM
]
Vector = Annotated[np.ndarray, Numbers(list[Number])]
Matrix = Annotated[np.ndarray, Numbers(list[list[Number]])]
Whole = Annotated[
    int, Field(strict=True, ge=0, lt=2**63), WithJsonSchema({"type": "integer", "minimum": 0})
]


def from_text(kind: type[T], text: str, schema: str, file: str) -> T:
    """Read a result, for instance an Estimate, from JSON text, and check its values.

    Parameters
    ----------
    kind : type
        Dataclass whose fields are keys of the result.
    text : str
        The JSON text.
    schema : str
        Kind and version, such as "symgen-estimate/1".
    file : str
        Name of the file in messages.

    Raises
    ------
    InputError
        The text is not JSON, has another kind or version, is incomplete, or holds wrong values.
    """
    try:
        data = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as e:
        raise InputError(f"the text is not JSON: {e}", file=file) from e
    given = data.get("schema") if isinstance(data, dict) else None
    if not isinstance(given, str) or given.partition("/")[0] != schema.partition("/")[0]:
        raise InputError(
            f"the schema is {given!r:.60}; expected {schema!r}: give a file that symgen wrote",
            file=file,
        )
    if given != schema:
        raise InputError(
            f"the schema is {given!r:.60}; this version of symgen reads {schema!r}: update symgen, or write the file again",
            file=file,
        )
    if missing := [f.name for f in fields(kind) if f.name not in data]:  # type: ignore[arg-type]
        raise InputError(
            f"the key {missing[0]!r} is missing, so the file is incomplete; run the command that wrote the file again",
            file=file,
        )
    try:
        result: T = TypeAdapter(kind).validate_python(data)
    except ValidationError as e:
        raise InputError(
            f"{settings_error(e, data)}; the file was edited, or another version of symgen wrote it; run the command that wrote the file again",
            file=file,
        ) from e
    return result


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number that JSON allows")
