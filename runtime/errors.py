"""What `runtime` raises on bad input: one root, a ValueError, with the offending place as attributes.

A message says what was given, where, what was expected and what to do. Numerical outcomes (rank loss, no convergence) are not errors:
they are a status of the Estimate.
"""

from __future__ import annotations

LONGEST = 2000  # characters of a message: a file may hold names of any length


def printable(text: str) -> str:
    """`text` as a terminal may show it: what controls one (escape sequences, changes of direction) spelled out, the middle of a long one left out."""
    for _ in range(2):  # spelled out, a text may be too long again
        if len(text) > LONGEST:
            text = f"{text[: LONGEST - 400]} ... {text[-300:]}"
        if not text.isprintable():
            text = "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" for c in text)
    return text


def first_line(error: BaseException) -> str:
    """What another library said of a file, in one line."""
    return str(error).partition("\n")[0] or type(error).__name__


class InputError(ValueError):
    """Data or settings that cannot be used.

    Parameters
    ----------
    message : what was found, what was expected, what to do.
    file : name of the file; column : name of the column; row : what counts rows and which, e.g. "line 12" or "sample 40".
    """

    def __init__(self, message: str, *, file: str | None = None, column: str | None = None, row: str | None = None) -> None:
        self.message, self.file, self.column, self.row = message, file, column, row
        place = ", ".join(part for part in (file, None if column is None else f"column {column!r}", row) if part)
        super().__init__(printable(f"{place}: {message}" if place else message))


class SettingsError(InputError):
    """A study setting that is unknown, of another type or out of range; `path` holds its keys, `line` its line in the study file."""

    def __init__(self, message: str, *, path: tuple[str | int, ...] = (), file: str | None = None, line: int | None = None) -> None:
        self.path, self.line, self.reason = path, line, message
        key = "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in path).lstrip(".")
        super().__init__(f"{key}: {message}" if key else message, file=file, row=None if line is None else f"line {line}")


class ModelError(InputError):
    """A module that is not an emitted model, or not the one a function needs."""


class DataUnavailableError(InputError):
    """A dataset that none of the places looked at holds; `tried` lists them with what went wrong in each."""

    def __init__(self, message: str, *, tried: tuple[str, ...] = ()) -> None:
        self.tried = tried
        super().__init__(message)
