"""Reading of JSON lines (.jsonl, .ndjson): one object per line, one line per sample.

    {"stamp": 0.005, "state": {"pos": [0.1, 0.2]}, "effort": [1.0, 2.0]}

An object in an object has the name state.pos; a list of k numbers in every line is an array (N, k),
and so are the numbers of a list of objects: [{"q": 0.1}, {"q": 0.2}] of motors is motors.q.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import opened
from runtime.reading.table import WIDEST, Array, Options, Table

EXPECTED = "expected one JSON object per line, with numbers or lists of numbers"


def read_json_lines(path: Path, options: Options) -> Table:
    """Read a file of JSON lines as a Table of named columns; null is a missing value, nan."""
    samples: list[dict[str, Any]] = []
    lines: list[int] = []
    for number, line in _lines(path):
        row = f"line {number}"
        try:
            sample = json.loads(line)
        except (ValueError, RecursionError) as e:
            raise InputError(
                f"the line is not JSON ({e}); {EXPECTED}"[:300], file=path.name, row=row
            ) from None
        if not isinstance(sample, dict):
            raise InputError(f"{str(line)[:40]!r}; {EXPECTED}", file=path.name, row=row)
        samples.append(dict(_flat("", sample)))
        lines.append(number)
    if not samples:
        raise InputError(f"the file has no samples; {EXPECTED}", file=path.name)
    names = list(dict.fromkeys(name for sample in samples for name in sample))
    if len(names) > WIDEST:
        raise InputError(f"the file has {len(names)} names; at most {WIDEST}", file=path.name)
    columns: dict[str, Array] = {}
    refused: dict[str, InputError] = {}
    empty: dict[str, str] = {}
    for name in names:
        values = [sample.get(name) for sample in samples]
        width = next((len(x) for x in values if isinstance(x, list)), 0)
        wrong = next((k for k, x in enumerate(values) if not _fits(x, width)), None)
        if wrong is not None or width > WIDEST:
            k = wrong or 0
            what = f"{json.dumps(values[k])[:40]} beside {json.dumps(values[0])[:40]}"
            message = f"{what}; expected a number, or as many numbers in a list, in every line"
            refused[name] = InputError(message, file=path.name, column=name, row=f"line {lines[k]}")
            continue
        for x, number in zip(values, lines, strict=True):
            if x is None:
                empty.setdefault(name, f"line {number}")
        missing = [np.nan] * width if width else np.nan
        columns[name] = np.array([missing if x is None else x for x in values], dtype=float)
    return Table(
        file=path.name,
        columns=columns,
        refused=refused,
        empty={name: row for name, row in empty.items() if columns[name].ndim == 1},
        row=lambda i: f"line {lines[i]}",
        what="the file",
    )


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        with opened(path) as stream, TextIOWrapper(stream, encoding="utf-8-sig") as text:
            for number, line in enumerate(text, 1):
                if line.strip():
                    yield number, line
    except UnicodeDecodeError:
        raise InputError(f"not a text in UTF-8; {EXPECTED}", file=path.name) from None


def _flat(prefix: str, sample: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield names and values of an object, and of the objects in it as name.key.

    The values of objects in a list, which have the same keys, are a list.
    """
    for key, value in sample.items():
        if isinstance(value, Mapping):
            yield from _flat(f"{prefix}{key}.", value)
        elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            objects = [dict(_flat(f"{prefix}{key}.", one)) for one in value]
            for name in objects[0]:
                yield name, [one.get(name) for one in objects]
        else:
            yield f"{prefix}{key}", value


def _fits(x: Any, width: int) -> bool:
    """Whether a value is a number, or a list of `width` numbers, or missing."""
    if x is None:
        return True
    if width:
        return isinstance(x, list) and len(x) == width and all(map(_is_number, x))
    return _is_number(x)


def _is_number(x: Any) -> bool:
    """Whether a value of JSON is a number that a float can hold."""
    return isinstance(x, bool | float) or (isinstance(x, int) and abs(x) < 10**300)
