"""Plain mappings to frozen dataclasses and back, with the path of the offending key in every error.

The type hints of a dataclass are its schema: dataclass, Literal, str, int, float, bool, tuple[X, ...], tuple[X, Y], Mapping, unions with None.
A float may be an arithmetic text (`2*pi/10000`), a field with a reader of its own what that understands (`30 rpm`); one value stands for a list of one; an integer key stands for its text.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from runtime.errors import InputError, SettingsError
from runtime.settings.arithmetic import number

T = TypeVar("T")
Path = tuple[str | int, ...]


def structure(cls: type[T], value: Any, path: Path = ()) -> T:
    """The dataclass `cls` of a mapping; raises SettingsError for unknown keys, wrong types and values it refuses."""
    if not isinstance(value, Mapping):
        raise SettingsError(f"{_show(value)}; expected a mapping with some of {', '.join(_names(cls))}", path=path)
    unknown = [str(k) for k in value if k not in _names(cls)]
    if unknown:
        raise SettingsError(
            f"unknown key{'s' if len(unknown) > 1 else ''} {', '.join(unknown)}; known: {', '.join(_names(cls))}", path=(*path, unknown[0])
        )
    needed = [f.name for f in fields(cls) if f.default is MISSING and f.default_factory is MISSING]  # type: ignore[arg-type]
    if missing := [name for name in needed if name not in value]:
        raise SettingsError(f"no key {', '.join(missing)}; add it", path=path)
    hints = get_type_hints(cls)
    read = {f.name: f.metadata["read"] for f in fields(cls) if "read" in f.metadata}  # type: ignore[arg-type]
    arguments = {k: _convert(hints[k], _read(read[k], v, (*path, k)) if k in read else v, (*path, k)) for k, v in value.items()}
    try:
        return cls(**arguments)
    except SettingsError as e:
        raise SettingsError(e.reason, path=(*path, *e.path)) from None
    except InputError as e:
        raise SettingsError(e.message, path=path) from None


def _read(reader: Callable[[Any], Any], value: Any, path: Path) -> Any:
    """The value as the reader of its field, `metadata={"read": ...}`, understands it."""
    try:
        return reader(value)
    except InputError as e:
        raise SettingsError(e.message, path=path) from None


def plain(value: Any) -> Any:
    """Tuples as lists, mappings as dicts, at every depth."""
    if isinstance(value, Mapping):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


def _names(cls: type) -> list[str]:
    return [f.name for f in fields(cls)]


def _convert(hint: Any, value: Any, path: Path) -> Any:
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        return _one_of(get_args(hint), value, path)
    if origin is Literal:
        if isinstance(value, bool) or value not in get_args(hint):
            raise SettingsError(f"{_show(value)}; expected {' or '.join(map(str, get_args(hint)))}", path=path)
        return value
    if origin is tuple:
        return _sequence(get_args(hint), value, path)
    if is_dataclass(hint):
        return structure(hint, value, path)  # type: ignore[arg-type]
    if origin is not None:  # Mapping
        if not isinstance(value, Mapping):
            raise SettingsError(f"{_show(value)}; expected a mapping", path=path)
        return {str(k): _convert(get_args(hint)[1], v, (*path, k)) for k, v in value.items()}
    return _scalar(hint, value, path)


def _one_of(hints: tuple[Any, ...], value: Any, path: Path) -> Any:
    """The first member of a union that takes the value; the error is that of the member of the value's own kind."""
    if value is None and type(None) in hints:
        return None
    errors: list[SettingsError] = []
    for hint in hints:
        if hint is not type(None):
            try:
                return _convert(hint, value, path)
            except SettingsError as e:
                errors.append(e)
    deepest = max(errors, key=lambda e: len(e.path))
    if len(deepest.path) > len(path) or len(errors) == 1:
        raise deepest
    expected = " or ".join(e.reason.split("; expected ", 1)[-1] for e in errors)
    raise SettingsError(f"{_show(value)}; expected {expected}", path=path)


def _sequence(hints: tuple[Any, ...], value: Any, path: Path) -> tuple[Any, ...]:
    many = len(hints) == 2 and hints[1] is Ellipsis
    if isinstance(value, list | tuple):
        values = list(value)
    elif many and value is not None:  # one value stands for a list of one
        return (_convert(hints[0], value, path),)
    else:
        raise SettingsError(f"{_show(value)}; expected a list{'' if many else f' of {len(hints)}'}", path=path)
    if not many and len(values) != len(hints):
        raise SettingsError(f"{len(values)} values; expected {len(hints)}", path=path)
    each = [hints[0]] * len(values) if many else hints
    return tuple(_convert(h, v, (*path, i)) for i, (h, v) in enumerate(zip(each, values, strict=True)))


def _scalar(hint: Any, value: Any, path: Path) -> Any:
    if hint is Any:
        return value
    if hint is bool and isinstance(value, bool):
        return value
    if hint is str and isinstance(value, str | int) and not isinstance(value, bool):
        return str(value)
    if hint is int and isinstance(value, int) and not isinstance(value, bool):
        return int(value)
    if hint is float and isinstance(value, int | float | str) and not isinstance(value, bool):
        try:
            return number(value if isinstance(value, str) else repr(float(value)))
        except (ValueError, OverflowError) as e:
            raise SettingsError(f"{e}; expected a number", path=path) from None
    expected = {int: "an integer", float: "a number", str: "a text", bool: "true or false"}[hint]
    raise SettingsError(f"{_show(value)}; expected {expected}", path=path)


def _show(value: Any) -> str:
    return repr(plain(value))[:80] if isinstance(value, Mapping | list | tuple) else repr(value)[:80]
