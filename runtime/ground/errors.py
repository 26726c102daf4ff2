"""Errors that `runtime` raises on bad input: InputError, a ValueError, and its subclasses.

A message says what was given, where, what was expected and what to do; the place is also in the
attributes of the error. Numerical outcomes (rank loss, no convergence) are not errors: they are a
status of the Estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LONGEST = 2000  # characters of a message: a file may hold names of any length


def printable(text: str) -> str:
    """Make a text printable on a terminal: escape control characters, shorten a long text.

    A text that is too long loses its middle.
    """
    for _ in range(2):  # spelled out, a text may be too long again
        if len(text) > LONGEST:
            text = f"{text[: LONGEST - 400]} ... {text[-300:]}"
        if not text.isprintable():
            text = "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" for c in text)
    return text


def encodable(text: str) -> str:
    """Escape the bytes of a text that are not UTF-8, for instance in the name of a file.

    Python represents such bytes as lone surrogates.
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def first_line(error: BaseException) -> str:
    """Return the first line of the message of an error from another library.

    If the message is empty, return the type of the error.
    """
    return str(error).partition("\n")[0] or type(error).__name__


class InputError(ValueError):
    """Error: data or settings that cannot be used.

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
        Settings of the record that probably cure the error (`runtime.study.suggested`).
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
        named = None if file is None else " ".join(file.split("\n"))
        place = ", ".join(
            part for part in (named, None if column is None else f"column {column!r}", row) if part
        )
        super().__init__(printable(f"{place}: {self.message}" if place else self.message))


class RecordWarning(UserWarning):
    """Warning about a record that is read only in part: what was left out, and why."""


class SettingsError(InputError):
    """Error: a setting that is unknown, of a wrong type or out of range.

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
    """Error: a module that is not an emitted (generated) model, or that lacks a needed function."""


class MemoryTooSmallError(InputError):
    """Error: work that needs more memory than is available."""


class DataUnavailableError(InputError):
    """Error: a dataset that is neither on this machine nor at its source.

    `tried` lists the places that were tried, each with its error.
    """

    def __init__(self, message: str, *, tried: tuple[str, ...] = ()) -> None:
        self.tried = tried
        super().__init__(message)


def instant(t: float) -> str:
    """Write a time in s as text for messages: six digits, or down to milliseconds from 1e5 s.

    Only time stamps that count from an epoch such as 1970 exceed 1e5 s.
    """
    return f"{t:g}" if abs(t) < 1e5 else f"{t:.3f}"
