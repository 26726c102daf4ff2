"""Columns of a text file: comma, semicolon, tab or blanks between numbers, one header line or none, `#` before comments; decimals with a point, or with a
comma where that is said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import TextIOWrapper
from itertools import islice
from pathlib import Path

import numpy as np

from runtime.errors import InputError
from runtime.files import opened
from runtime.records.formats.naming import WIDEST, check_names

Array = np.ndarray

LONGEST = 1_000_000  # characters of a line: so many fields of a hundred digits each
UTF8 = "save it so (Excel: CSV UTF-8; elsewhere: iconv -f CP1252 -t UTF-8)"
MOST = 5_000_000  # lines held at once, some 80 bytes each beside their text


@dataclass(frozen=True, eq=False)
class TextTable:
    """Lines of a text file with their numbers in the file; columns are turned into numbers when asked for."""

    file: str
    names: tuple[str, ...]
    lines: tuple[str, ...]
    line_numbers: Sequence[int]
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
                    hint = self._hint(k, fields[i])
                    return InputError(f"{what}; expected a number{hint}", file=self.file, column=self.names[i], row=f"line {k}")
        return InputError("a field that is not a number", file=self.file)

    def _hint(self, number: int, field: str) -> str:
        if "," in field:
            return "; write decimals with a point, or set record.decimal: ','"
        return "; put # before a second line of names or units" if number == self.line_numbers[0] and field else ""


@dataclass(frozen=True, eq=False)
class TextBlocks:
    """A text file that is read by blocks of lines."""

    path: Path
    file: str
    names: tuple[str, ...]
    delimiter: str | None
    has_header: bool
    decimal: str

    def samples(self, names: Sequence[str]) -> int:
        """Length of the columns."""
        check_names(names, self.names, self.file)
        return sum(1 for _ in self._lines())

    def blocks(self, names: Sequence[str], size: int) -> Iterator[TextTable]:
        """Tables of `size` lines each, in order; `names` are looked up when columns are asked for."""
        check_names(names, self.names, self.file)
        lines = self._lines()
        while block := list(islice(lines, size)):
            numbers, found = zip(*block, strict=True)
            yield _table(found, numbers, self.names, self.delimiter, self.decimal, self.file)

    def _lines(self) -> Iterator[tuple[int, str]]:
        return islice(_numbered_lines(self.path), 1 if self.has_header else 0, None)


def text_blocks(path: Path, file: str, decimal: str = ".") -> TextBlocks:
    """A text file to be read by blocks; its first line tells the columns, as in `read_text`."""
    first = next(_numbered_lines(path), None)
    if first is None:
        raise InputError("no line of numbers", file=file)
    names, has_header, delimiter = _header(first[1], decimal, file)
    return TextBlocks(path, file, names, delimiter, has_header, decimal)


def _numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines that hold something, comments aside, with their numbers from 1."""
    try:
        with opened(path) as stream, TextIOWrapper(stream, encoding="utf-8-sig") as text:
            for k, raw in enumerate(iter(lambda: text.readline(LONGEST + 1), ""), start=1):
                _require_short(len(raw), path.name, k)
                line = raw.strip()
                if line and not line.startswith("#"):
                    yield k, line
    except UnicodeDecodeError as e:
        raise InputError(f"not a text file in UTF-8 (byte {e.start} of a block); {UTF8}", file=path.name) from None


def read_text(data: bytes, file: str, decimal: str = ".") -> TextTable:
    """Table of the bytes of a text file; without a header line columns are called 1, 2, 3 ...   decimal : "." or ",", within numbers."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(f"not a text file in UTF-8 (byte {e.start}); {UTF8}", file=file) from None
    if max(text.count("\n"), text.count("\r")) > MOST:
        raise InputError(f"more than {MOST} lines; read them by blocks (stream: 65536 in the study file, or --block)", file=file)
    rows = (
        text.replace("\r\n", "\n").replace("\r", "\n").removesuffix("\n").split("\n")
    )  # as a file is read; splitlines knows more ends of lines
    longest = max(map(len, rows))
    _require_short(longest, file, next(k for k, row in enumerate(rows, start=1) if len(row) == longest))
    lines: Sequence[str] = tuple(map(str.strip, rows))
    numbers: Sequence[int] = range(1, len(lines) + 1)
    if "#" in text or not all(lines):
        kept = [(k, line) for k, line in zip(numbers, lines, strict=True) if line and not line.startswith("#")]
        numbers, lines = [k for k, _ in kept], [line for _, line in kept]
    if not lines:
        raise InputError("no line of numbers", file=file)
    names, has_header, delimiter = _header(lines[0], decimal, file)
    if has_header:
        numbers, lines = numbers[1:], lines[1:]
    if not lines:
        raise InputError(f"no line of numbers under the header {', '.join(names)}", file=file)
    return _table(lines, numbers, names, delimiter, decimal, file)


def _header(line: str, decimal: str, file: str) -> tuple[tuple[str, ...], bool, str | None]:
    """Names of the columns by the first line, whether it is a header, and the delimiter."""
    delimiter = _delimiter(line, decimal)
    header = _fields(line, delimiter)
    if len(header) > WIDEST:
        raise InputError(f"{len(header)} columns; at most {WIDEST} are read, write those you need into a file of their own", file=file)
    if all(_is_number(x.replace(decimal, ".")) for x in header):
        return tuple(str(i + 1) for i in range(len(header))), False, delimiter
    double = sorted(name for name, count in Counter(header).items() if count > 1)
    if double:
        raise InputError(f"header names {', '.join(double)} more than once", file=file)
    return tuple(header), True, delimiter


def _table(
    lines: Sequence[str], numbers: Sequence[int], names: tuple[str, ...], delimiter: str | None, decimal: str, file: str
) -> TextTable:
    """The table, if every line has one field per name; its numbers with a point."""
    widths = [len(line.split()) for line in lines] if delimiter is None else [line.count(delimiter) + 1 for line in lines]
    if widths.count(len(names)) < len(widths):
        k, width = next((k, width) for k, width in zip(numbers, widths, strict=True) if width != len(names))
        hint = "put # before lines that are neither names nor numbers"
        if delimiter == "," and width > len(names):
            hint = "if decimals are written with commas, separate columns by semicolons and set record.decimal: ','"
        raise InputError(f"{width} fields; expected {len(names)} ({', '.join(names)}); {hint}", file=file, row=f"line {k}")
    return TextTable(file, names, tuple(lines if decimal == "." else [line.replace(decimal, ".") for line in lines]), numbers, delimiter)


def _require_short(length: int, file: str, number: int) -> None:
    if length > LONGEST:
        raise InputError(f"a line of more than {LONGEST} characters; expected one sample a line", file=file, row=f"line {number}")


def _delimiter(line: str, decimal: str) -> str | None:
    return next((d for d in (";", "\t", ",") if d in line and d != decimal), None)


def _fields(line: str, delimiter: str | None) -> list[str]:
    return [x.strip().strip('"').strip() for x in line.split(delimiter)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
