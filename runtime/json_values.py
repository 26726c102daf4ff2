"""Values of a JSON document, each of the type that is expected: ValueError says what was found instead."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def text(value: Any) -> str:
    """A text."""
    if not isinstance(value, str):
        raise ValueError(f"found {value!r:.60}; expected a text")
    return value


def items(value: Any) -> list[Any]:
    """A list."""
    if not isinstance(value, list):
        raise ValueError(f"found {value!r:.60}; expected a list")
    return value


def texts(value: Any) -> tuple[str, ...]:
    """A list of texts."""
    return tuple(map(text, items(value)))


def mapping(value: Any) -> Mapping[str, Any]:
    """An object of JSON."""
    if not isinstance(value, dict):
        raise ValueError(f"found {value!r:.60}; expected a mapping")
    return value


def whole(value: Any) -> int:
    """A count."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**63:
        raise ValueError(f"found {value!r:.60}; expected a whole number, 0 or more")
    return value


def number(value: Any, missing: float = math.nan) -> float:
    """A number; `missing` for null."""
    if value is None:
        return missing
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < math.inf:
        raise ValueError(f"found {value!r:.60}; expected a number or null")
    try:
        return float(value)
    except OverflowError as e:
        raise ValueError("found an integer beyond every double; expected a number or null") from e


def numbers(value: Any) -> np.ndarray:
    """A list of numbers, or of such lists of one length, as an array; nan for null."""
    rows = [[number(x) for x in row] if isinstance(row, list) else number(row) for row in items(value)]
    if len({len(row) if isinstance(row, list) else -1 for row in rows}) > 1:
        raise ValueError("lists of different length; expected one")
    return np.array(rows, dtype=float)
