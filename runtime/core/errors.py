"""What `runtime` raises on bad input: one root, a ValueError, with the offending place as attributes.

A message says what was given, where, what was expected and what to do. Numerical outcomes (rank
loss, no convergence) are not errors:
they are a status of the Estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LONGEST = 2000  # characters of a message: a file may hold names of any length


def printable(text: str) -> str:
    """`text` for a terminal: control characters as escapes, a long text without its middle."""
    for _ in range(2):  # spelled out, a text may be too long again
        if len(text) > LONGEST:
            text = f"{text[: LONGEST - 400]} ... {text[-300:]}"
        if not text.isprintable():
            text = "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" for c in text)
    return text


def encodable(text: str) -> str:
    """`text` with bytes that are not UTF-8 (lone surrogates of file names) as JSON escapes."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def first_line(error: BaseException) -> str:
    """First line of the message of an error of another library."""
    return str(error).partition("\n")[0] or type(error).__name__


class InputError(ValueError):
    """Data or settings that cannot be used.

    Parameters
    ----------
    message : str
        What was given, what was expected, what to do.
    file : str, optional
        Name of the file.
    column : str, optional
        Name of the column.
    row : str, optional
        Place in the file, such as "line 12" or "sample 40".
    remedy : mapping, optional
        Settings of the record that are likely to cure it (`runtime.study.suggested`).
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        column: str | None = None,
        row: str | None = None,
        remedy: Mapping[str, Any] | None = None,
    ) -> None:
        self.message = printable(message)
        self.file, self.column, self.row = file, column, row
        self.remedy = remedy
        place = ", ".join(
            part for part in (file, None if column is None else f"column {column!r}", row) if part
        )
        super().__init__(printable(f"{place}: {self.message}" if place else self.message))


class SettingsError(InputError):
    """A setting that is unknown, of another type or out of range.

    Parameters
    ----------
    message : str
        What was given, what was expected, what to do.
    path : tuple of str and int
        Keys that lead to the setting.
    file : str, optional
        Name of the study file.
    line : int, optional
        Line of the setting in that file, from 1.
    """

    def __init__(
        self,
        message: str,
        *,
        path: tuple[str | int, ...] = (),
        file: str | None = None,
        line: int | None = None,
    ) -> None:
        self.path, self.line, self.reason = path, line, message
        key = "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in path).lstrip(".")
        super().__init__(
            f"{key}: {message}" if key else message,
            file=file,
            row=None if line is None else f"line {line}",
        )


class ModelError(InputError):
    """A module that is not an emitted model, or lacks what a function needs."""


class DataUnavailableError(InputError):
    """A dataset that is neither on this machine nor at its source.

    `tried` lists the places and the error of each.
    """

    def __init__(self, message: str, *, tried: tuple[str, ...] = ()) -> None:
        self.tried = tried
        super().__init__(message)


def instant(t: float) -> str:
    """A time, s, for messages: six digits, or to the millisecond if it counts from an epoch."""
    return f"{t:g}" if abs(t) < 1e5 else f"{t:.3f}"
