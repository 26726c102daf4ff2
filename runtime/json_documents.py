"""JSON results with a kind and a version in their `schema` key, read back: another kind, another version and damage are each one clear error.

The layouts are published in runtime/schemas/*.schema.json; a reader leaves out keys that it does not know, so that what is added later under the
same version does no harm.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, NoReturn

from runtime.errors import InputError
from runtime.files import require_file

LARGEST = 200_000_000  # bytes of a JSON result; that of 1000 parameters has 30 million
KINDS = ("estimate", "cestac")


def schema_text(kind: str) -> str:
    """The JSON Schema of estimate.json or cestac.json."""
    return files("runtime").joinpath("schemas", f"{kind}.schema.json").read_text(encoding="utf-8")


def read_document(path: Path, schema: str) -> Mapping[str, Any]:
    """`document` of a file."""
    try:
        if require_file(path) > LARGEST:
            raise InputError(f"more than {LARGEST} bytes; expected a result of symgen", file=str(path))
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"cannot be read: {getattr(e, 'strerror', None) or e}", file=str(path)) from e
    return document(text, schema, str(path))


def document(text: str, schema: str, file: str) -> Mapping[str, Any]:
    """The mapping of a JSON text whose `schema` is the wanted one, such as "symgen-estimate/1"; InputError else."""
    try:
        data = json.loads(text, parse_constant=_refused)
    except (ValueError, RecursionError) as e:
        raise InputError(f"not JSON: {e}", file=file) from e
    found = data.get("schema") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(found, str) or found.partition("/")[0] != schema.partition("/")[0]:
        raise InputError(f"its schema is {found!r:.60}; expected {schema!r}, as symgen writes it", file=file)
    if found != schema:
        raise InputError(f"has schema {found!r:.60}; this version reads {schema!r}: update symgen, or make the file again", file=file)
    return data


def _refused(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")
