"""JSON results: written, read back with every value checked, and described by JSON Schemas that are
made from the types.

A result has its kind and version in the key `schema`. Another kind, another version and damage are
each one clear error. A reader leaves out
keys that it does not know, so that keys can be added under the same version. The schemas are
published in runtime/schemas/*.schema.json.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, ClassVar, NoReturn, TypeVar, get_type_hints

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, WithJsonSchema
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from runtime.errors import InputError, encodable, settings_error
from runtime.files import require_file

T = TypeVar("T")

LARGEST = 200_000_000  # bytes of a JSON result; that of 1000 parameters has 30 million
KINDS = ("study", "estimate", "cestac")
DIALECT = "https://json-schema.org/draft/2020-12/schema"
LIMITS = {
    "gt": "exclusiveMinimum",
    "ge": "minimum",
    "lt": "exclusiveMaximum",
    "le": "maximum",
}  # names of pydantic, of JSON Schema


class Numbers:
    """Annotation of an ndarray of floats: in JSON nested lists of numbers, null for nan.

    Parameters
    ----------
    kind : type
        The nested lists.
    """

    def __init__(self, kind: Any) -> None:
        self.kind = kind

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(
            self.array, handler.generate_schema(self.kind)
        )

    def array(self, rows: list[Any]) -> np.ndarray:
        """The numbers of nested lists; shape (0, 0) for a matrix without rows."""
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


class Result:
    """A dataclass with a text and a JSON text, whose keys it declares: `class Delay(Result,
    keys="joints
    shift")`.

    keys : fields and properties in the order of JSON, key:name where JSON calls one otherwise;
    default:
    all fields.   schema : kind and version, the first key; None: a part of another result.
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
        """What JSON holds of it, as a mapping."""
        head = {} if self._schema is None else {"schema": self._schema}
        names = [word.partition(":") for word in self._keys.split() or self.__dataclass_fields__]
        return head | {key: getattr(self, name or key) for key, _, name in names}

    def to_json(self) -> str:
        """JSON text of the summary."""
        return json_text(self.summary())


def plain(value: Any) -> Any:
    """`value` as JSON knows it: mappings, lists, text, finite numbers; what is not finite becomes
    null.

    Results become their summaries, other dataclasses mappings of their fields, arrays lists,
    anything
    else its text.
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
    """`plain(value)` as JSON, indented by two, lists of scalars on one line, with a final
    newline.
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


def read_text(path: str | Path) -> str:
    """The text of a file with a JSON result."""
    path = Path(path)
    try:
        if require_file(path) > LARGEST:
            raise InputError(
                f"more than {LARGEST} bytes; expected a result of symgen", file=str(path)
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(
            f"cannot be read: {getattr(e, 'strerror', None) or e}", file=str(path)
        ) from e


def from_text(kind: type[T], text: str, schema: str, file: str) -> T:
    """The result in a JSON text.

    Parameters
    ----------
    kind : type
        Dataclass whose fields are keys of the result.
    schema : str
        Kind and version, such as "symgen-estimate/1".
    file : str
        Name of the file in messages.

    Raises
    ------
    InputError
        Where the text is no JSON, of another kind or version, incomplete, or holds other values.
    """
    try:
        data = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as e:
        raise InputError(f"not JSON: {e}", file=file) from e
    given = data.get("schema") if isinstance(data, dict) else None
    if not isinstance(given, str) or given.partition("/")[0] != schema.partition("/")[0]:
        raise InputError(
            f"its schema is {given!r:.60}; expected {schema!r}, as symgen writes it", file=file
        )
    if given != schema:
        raise InputError(
            (
                f"has schema {given!r:.60}; this version reads {schema!r}: update symgen, or make "
                "the "
                "file again"
            ),
            file=file,
        )
    if missing := [f.name for f in fields(kind) if f.name not in data]:  # type: ignore[arg-type]
        raise InputError(f"no {missing[0]!r}; the file is incomplete", file=file)
    try:
        result: T = TypeAdapter(kind).validate_python(data)
    except ValidationError as e:
        raise InputError(f"{settings_error(e, data)}; the file was changed", file=file) from e
    return result


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def schema_text(kind: str) -> str:
    """The published JSON Schema of one of KINDS."""
    return files("runtime").joinpath("schemas", f"{kind}.schema.json").read_text(encoding="utf-8")


class SettingsSchema(GenerateJsonSchema):
    """Generator of the JSON Schema of settings; descriptions are those of the docstrings."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        """False: a title would repeat the key."""
        return False

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> dict[str, Any]:
        """The schema of a dataclass, its keys described."""
        made = super().dataclass_schema(schema)
        text, attributes = described(schema["cls"])
        for name, value in made["properties"].items():
            value.update({"description": attributes[name]} if name in attributes else {})
        return {
            "description": text,
            **{key: value for key, value in made.items() if key not in ("title", "description")},
        }


class ResultSchema(SettingsSchema):
    """Generator of the JSON Schema of results, in which null stands for a number that does not
    exist.
    """

    def float_schema(self, schema: core_schema.FloatSchema) -> dict[str, Any]:
        """A number or null."""
        return {"type": ["number", "null"]}


def described(kind: type) -> tuple[str, dict[str, str]]:
    """First paragraph of a docstring, and the text of every entry "name : type, unit" of its
    section Attributes, with its unit.
    """
    text, attributes = "", {}
    for cls in reversed(kind.__mro__):
        text, _, section = (inspect.cleandoc(cls.__dict__.get("__doc__") or "")).partition(
            "\n\nAttributes\n----------\n"
        )
        for names, form, meaning in re.findall(
            r"^(\w[\w, ]*) : (.*)\n((?:    .*\n?)*)", section, re.MULTILINE
        ):
            unit = form.partition(", ")[2]
            entry = " ".join(meaning.split()) + (f" [{unit}]" if unit else "")
            attributes.update(dict.fromkeys(names.split(", "), entry))
    return " ".join(text.split("\n\n")[0].split()), attributes


def json_schema(
    kind: type,
    title: str,
    description: str,
    *,
    const: str | None = None,
    computed: Sequence[str] = (),
    optional: Collection[str] = (),
) -> str:
    """Text of the JSON Schema of settings or of a result, made from its type.

    Parameters
    ----------
    kind : type
        Dataclass whose fields are the keys.
    title : str
        Name of the format.
    description : str
        What the format holds.
    const : str, optional
        Value of the key `schema` of a result; None for settings.
    computed : sequence of str
        Properties of `kind` that a result holds, too.
    optional : collection of str
        Keys that a result may lack.
    """
    generator = SettingsSchema if const is None else ResultSchema
    adapter: TypeAdapter[Any] = TypeAdapter(kind)
    made = _named(
        adapter.json_schema(
            schema_generator=generator, mode="validation" if const is None else "serialization"
        )
    )
    if const is not None:
        properties = {"schema": {"const": const}, **made["properties"]}
        for name in computed:
            getter = getattr(kind, name).fget
            kept = TypeAdapter(get_type_hints(getter, include_extras=True)["return"]).json_schema(
                schema_generator=ResultSchema
            )
            properties[name] = {"description": inspect.getdoc(getter), **_named(kept)}
        made |= {
            "properties": properties,
            "required": [name for name in properties if name not in optional],
        }
        made.pop("additionalProperties", None)
    head = {"$schema": DIALECT, "title": title, "description": description}
    return json_text({**head, **{key: value for key, value in made.items() if key not in head}})


def _named(value: Any) -> Any:
    """A JSON Schema with limits under the names of JSON Schema; pydantic leaves its own names
    beside a type of its users.
    """
    if isinstance(value, dict):
        return {
            LIMITS.get(key, key) if isinstance(item, int | float) else key: _named(item)
            for key, item in value.items()
        }
    return [_named(item) for item in value] if isinstance(value, list) else value
