"""Columns of a text file: comma, semicolon, tab or blanks between numbers, one header line or none, `#` before comments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.io.naming import check_names

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class TextTable:
    """Lines of a text file with their numbers in the file; columns are turned into numbers when asked for."""

    file: str
    names: tuple[str, ...]
    lines: tuple[str, ...]
    line_numbers: tuple[int, ...]
    delimiter: str | None

    def stack(self, names: Sequence[str]) -> Array:
        """The named columns, shape (N, k); a text that is no number raises InputError with its line."""
        indices = [self.names.index(name) for name in check_names(names, self.names, self.file)]
        try:
            x = np.loadtxt(self.lines, delimiter=self.delimiter, usecols=indices, ndmin=2, comments=None, quotechar='"')
        except ValueError:
            raise self._not_a_number(indices) from None
        return np.asarray(x)

    def scalar(self, name: str) -> float:
        """Text files store columns only."""
        raise InputError(f"no single number {name!r} in a text file; write the number itself in the settings", file=self.file)

    def row(self, i: int) -> str:
        return f"line {self.line_numbers[i]}"

    def _not_a_number(self, indices: list[int]) -> InputError:
        for line, k in zip(self.lines, self.line_numbers, strict=True):
            fields = _fields(line, self.delimiter)
            for i in indices:
                if not _is_number(fields[i]):
                    what = "an empty field" if not fields[i] else repr(fields[i])
                    hint = "; write decimals with a point" if "," in fields[i] else ""
                    return InputError(f"{what}; expected a number{hint}", file=self.file, column=self.names[i], row=f"line {k}")
        return InputError("a field that is not a number", file=self.file)


def read_text(data: bytes, file: str) -> TextTable:
    """Table of the bytes of a text file; without a header line columns are called 1, 2, 3 ..."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(f"not a text file in UTF-8 (byte {e.start})", file=file) from None
    numbered = [(k, line.strip()) for k, line in enumerate(text.splitlines(), start=1)]
    numbered = [(k, line) for k, line in numbered if line and not line.startswith("#")]
    if not numbered:
        raise InputError("no line of numbers", file=file)
    delimiter = _delimiter(numbered[0][1])
    header = _fields(numbered[0][1], delimiter)
    if all(_is_number(x) for x in header):
        names = tuple(str(i + 1) for i in range(len(header)))
    else:
        names, numbered = tuple(header), numbered[1:]
    if not numbered:
        raise InputError(f"no line of numbers under the header {', '.join(names)}", file=file)
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise InputError(f"header names {', '.join(double)} more than once", file=file)
    for k, line in numbered:
        width = len(_fields(line, delimiter)) if delimiter is None or '"' in line else line.count(delimiter) + 1
        if width != len(names):
            raise InputError(f"{width} fields; expected {len(names)} ({', '.join(names)})", file=file, row=f"line {k}")
    return TextTable(file, names, tuple(line for _, line in numbered), tuple(k for k, _ in numbered), delimiter)


def _delimiter(line: str) -> str | None:
    return next((d for d in (";", "\t", ",") if d in line), None)


def _fields(line: str, delimiter: str | None) -> list[str]:
    return [x.strip().strip('"').strip() for x in line.split(delimiter)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
