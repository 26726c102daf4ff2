"""Conversion of results to JSON: first to mappings of plain values, then to text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

import numpy as np

from runtime.core.errors import encodable


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
