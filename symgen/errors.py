"""The errors that symgen raises on purpose; all of them are SymgenError.

A message says which input was given, which was expected, where, and what to do; the wrong values
are attributes.
"""

from __future__ import annotations

import copyreg
from collections.abc import Iterable
from typing import Any

LONGEST = 2000  # characters of a message: a file may hold names of any length


class SymgenError(Exception):
    """Base class of all errors for bad input and for a derivation that cannot be completed."""

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the data from which pickle rebuilds the error without a call of __init__.

        The subclasses have an __init__ with more arguments than the message.
        """
        return copyreg.__newobj__, (type(self), *self.args), vars(self)  # type: ignore[attr-defined]


def printable(text: str) -> str:
    r"""Make a text safe to print on a terminal.

    Control characters (escape sequences, changes of direction) are written as codes such as \x1b,
    and the middle of a long text is left out.
    """
    for _ in range(2):  # spelled out, a text may be too long again
        if len(text) > LONGEST:
            text = f"{text[: LONGEST - 400]} ... {text[-300:]}"
        if not text.isprintable():
            text = "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" for c in text)
    return text


def require(given: object, kinds: type | tuple[type, ...], name: str, expected: str) -> None:
    """Raise SymgenError, in one sentence, unless the argument `name` has one of these types.

    True and False do not count as numbers. `expected` describes the possible values.
    """
    allowed = kinds if isinstance(kinds, tuple) else (kinds,)
    if not isinstance(given, allowed) or (isinstance(given, bool) and bool not in allowed):
        shown = repr(given) if isinstance(given, str | int | float | complex | None) else ""
        what = f"{shown:.40} ({type(given).__name__})" if shown else f"a {type(given).__name__}"
        raise SymgenError(f"{name} is {what}; expected {expected}")


def require_names(given: object, known: Iterable[str], name: str) -> None:
    """Raise SymgenError unless the argument `name` is a list of names among `known`."""
    known = tuple(known)
    require(given, (list, tuple, dict, set, frozenset), name, f"a list of {', '.join(known)}")
    for x in given:  # type: ignore[attr-defined]  # checked
        require_name(x, known, name)


def require_name(given: object, known: Iterable[str], name: str) -> None:
    """Raise SymgenError unless the argument `name` is one of the names `known`."""
    known = tuple(known)
    if not isinstance(given, str) or given not in known:
        shown = f"{given!r:.40}" if isinstance(given, str) else f"a {type(given).__name__}"
        raise SymgenError(f"{name} is {shown}; expected one of {', '.join(known)}")


class CertificateError(SymgenError):
    """Error raised if a check of generated formulas or code fails for a valid robot file.

    Parameters
    ----------
    message : str
        Sentence on the check that failed.
    certificate : object
        The Certificate.
    """

    def __init__(self, message: str, certificate: object) -> None:
        self.certificate = certificate
        super().__init__(message)


class DescriptionError(SymgenError):
    """Error for a robot file (or a Robot built in Python) that does not describe a mechanism.

    Parameters
    ----------
    message : str
        What was given, what was expected and what to do.
    path : tuple of str or int
        Keys that lead to the wrong field, e.g. ("frames", 4, "sigma"); a file reader turns them
        into a line.
    file : str, optional
        Name of the file.
    line : int, optional
        Line of the error in the file, from 1.
    """

    def __init__(
        self,
        message: str,
        *,
        path: tuple[str | int, ...] = (),
        file: str | None = None,
        line: int | None = None,
    ) -> None:
        self.message, self.path, self.file, self.line = message, path, file, line
        name = (file or "").replace("\n", "\\n")
        place = "" if file is None else f" ({name}{'' if line is None else f', line {line}'})"
        super().__init__(message + place)


class ExpressionError(SymgenError):
    """Error for a text that is not an expression of the robot-file grammar.

    Parameters
    ----------
    message : str
        Sentence on the text that was found and the text that was expected.
    text : str
        The whole expression.
    column : int, optional
        Column of the error in the expression, from 1.
    advice : str
        Sentence on a correct text, at the end of the message.
    """

    def __init__(
        self, message: str, *, text: str, column: int | None = None, advice: str = ""
    ) -> None:
        self.text, self.column = text, column
        place = "" if column is None else f" at column {column}"
        super().__init__(f"{message}{place} in {text[:80]!r}{advice}")
