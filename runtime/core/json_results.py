"""Reading of results from JSON, with a check of every value.

A result has its kind and version in the key `schema`. Another kind, another version and a damaged
file each raise one clear error. Unknown keys are ignored, so that a later version can add keys
under the same `schema`.
"""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import Annotated, Any, NoReturn, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, WithJsonSchema
from pydantic_core import core_schema

from runtime.core.errors import InputError
from runtime.core.settings_errors import settings_error

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
        raise InputError(f"not JSON: {e}", file=file) from e
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
