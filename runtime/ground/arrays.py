"""Conversion of input arrays to float64; an array without real numbers raises an InputError.

    real(t, "t")        float64; InputError for dates, texts, complex or masked numbers, None,
                        ragged lists

Every array of a caller is converted here, because NumPy casts without a warning: a datetime64 would
become nanoseconds, a complex number would lose its imaginary part, and a masked array would lose
its mask.
"""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np

from runtime.ground.errors import InputError, first_line

Array = np.ndarray

CURES = {
    "b": "truth values; give numbers",
    "M": "dates; give seconds, (t - t[0]) / np.timedelta64(1, 's')",
    "m": "time spans; give seconds, t / np.timedelta64(1, 's')",
    "c": "complex numbers; give their real part",
    "U": "texts; read them as numbers first",
    "S": "texts; read them as numbers first",
    "T": "texts; read them as numbers first",
    "V": "records of several fields; give one array for each signal",
}
"""For each kind of dtype that is not real: what the array holds, and what to do."""


def real(x: Any, label: str, file: str | None = None) -> Array:
    """Convert x to float64 numbers; an array of float64 is returned without a copy.

    Parameters
    ----------
    x : array_like
        Real numbers, any shape.
    label : str
        Name of x in error messages.
    file : str, optional
        Name of the file that holds x, for error messages.

    Raises
    ------
    InputError
        x is not an array of real numbers; the message names its type or dtype.
    """
    if x is None or isinstance(x, str | bytes | dict | set | frozenset):
        raise InputError(f"{label} is {kind_of(x)}; expected an array of numbers", file=file)
    if isinstance(x, np.ma.MaskedArray) and np.ma.is_masked(x):
        count = int(np.ma.getmaskarray(x).sum())
        raise InputError(
            f"{label} has {count} masked values, but a record needs every value: cut the masked "
            "samples, or fill the masked values (x.filled(np.nan) and missing=np.isnan(q) where q "
            "is read as counts)",
            file=file,
        )
    if units := getattr(x, "units", getattr(x, "unit", None)):
        raise InputError(
            f"{label} has units ({units!s:.40}); give plain numbers in SI and rad, such as "
            f"{label}.to('rad').magnitude",
            file=file,
        )
    try:
        array = np.asarray(x)
        kind = array.dtype.kind
        if kind in CURES:
            raise InputError(f"{label} has dtype {array.dtype}, {CURES[kind]}", file=file)
        if kind == "O" and (wrong := [v for v in array.flat if not _is_real(v)]):
            raise InputError(f"{label} contains {kind_of(wrong[0])}; expected numbers", file=file)
        return np.asarray(array, dtype=float)
    except InputError:
        raise
    except Exception as e:  # whatever an array of another package raises becomes one kind of error
        raise InputError(
            f"{label}, {kind_of(x)}, is no array of real numbers: {first_line(e)}; expected rows of "
            "equal length",
            file=file,
        ) from e


def real_number(x: Any, label: str, file: str | None = None) -> float:
    """Return x as a float; raise InputError if x is not a real number."""
    if not _is_real(x):
        raise InputError(f"{label} is {kind_of(x)}; expected a number", file=file)
    try:
        return float(x)
    except OverflowError:
        raise InputError(f"{label} is beyond 1e308; expected a smaller number", file=file) from None


def _is_real(x: Any) -> bool:
    """Whether x is a real number; True and False do not count as numbers."""
    return isinstance(x, Real) and not isinstance(x, bool | np.bool_)


def kind_of(x: Any) -> str:
    """Describe a value and its type for messages: "None", "'250' (str)", "a list"."""
    if x is None:
        return "None"
    if isinstance(x, str | bytes | int | float | complex):
        return f"{x!r:.40} ({type(x).__name__})"
    article = "an" if type(x).__name__[0] in "aeiouAEIOU" else "a"
    return f"{article} {type(x).__name__}"


def require_kind(x: Any, kinds: type | tuple[type, ...], label: str, hint: str) -> None:
    """Raise InputError unless x has one of the given types.

    hint : text that says which type was expected, and how to get such a value.
    """
    if not isinstance(x, kinds):
        raise InputError(f"{label} is {kind_of(x)}; expected {hint}")
