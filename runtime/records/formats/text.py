"""Columns of a text file: comma, semicolon, tab or blanks between numbers, one header line or none,
`#` before comments; decimals with a point, or with a
comma where that is said."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import TextIOWrapper
from itertools import chain, islice

import numpy as np

from runtime.errors import InputError
from runtime.files import opened
from runtime.records.formats.columns import WIDEST, Array, Groups, Source, Table
from runtime.records.missing import COUNTS

LONGEST = 1_000_000  # characters of a line: so many fields of a hundred digits each
PIECE = 2**22  # characters read at a time
HEAD = 2**13  # of which names and delimiter are told
MOST_EMPTY = 5_000_000  # lines without a number
CLOCK = re.compile(r"\d:\d\d|\d{4}-\d\d-\d\d")  # a time of day, a date
UTF8 = "save it so (Excel: CSV UTF-8; elsewhere: iconv -f CP1252 -t UTF-8)"
Place = tuple[int, str, int]  # number of a line, what is read of it, where the rest stands
BEGIN: Place = (1, "", 0)
Piece = tuple[Place, Iterator[int], list[str]]  # where it begins, numbers of its lines, the lines


@dataclass(eq=False, kw_only=True)
class TextTable(Table):
    """Lines of a text file, a sample each, read in pieces by NumPy; what is wrong with one is told
    by line and column.
    """

    what = "a text file"

    source: Source
    delimiter: str | None
    has_header: bool

    def samples(self, groups: Groups) -> int:
        self.require([name for group in groups for name in group])
        count, _ = self._places[-1]
        if not count:
            raise InputError(
                f"no line of numbers under the header {', '.join(self.names)}", file=self.file
            )
        return count

    def widths(self, groups: Groups) -> list[int]:
        return [len(group) for group in groups]

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        indices = [self.names.index(name) for name in names]
        waiting = np.empty((0, len(names)))
        first, place = [known for known in self._places[:-1] if known[0] <= start][-1]
        for _, numbers, lines in self._pieces(place):
            skipped = max(start - first, 0)
            own = lines[skipped : None if stop is None else max(stop - first, 0)]
            if own:
                loaded = self._loaded(indices, islice(numbers, skipped, None), own)
                waiting = np.concatenate([waiting, loaded])
            while len(waiting) >= size:
                yield list(waiting[:size].T)
                waiting = waiting[size:]
            first += len(lines)
            if stop is not None and first >= stop:
                break
        if len(waiting):
            yield list(waiting.T)

    def _loaded(self, indices: list[int], numbers: Iterator[int], lines: list[str]) -> Array:
        """Numbers of these columns, shape (len(lines), len(indices))."""
        if self.source.decimal == ".":
            with suppress(ValueError):
                whole = _numbers(lines, self.delimiter)
                if whole.shape == (len(lines), len(self.names)):
                    return whole[:, indices]
        numbered = [*zip(numbers, lines, strict=False)]
        if open_quote := next((k for k, line in numbered if line.count('"') % 2), None):
            message = "a quotation mark that its line does not close; expected one sample a line"
            raise InputError(message, file=self.file, row=f"line {open_quote}")
        self.require_widths(numbered)
        if self.source.decimal != ".":
            self._require_no_points(indices, numbered)
            numbered = [(k, line.replace(self.source.decimal, ".")) for k, line in numbered]
        try:
            return _numbers([line for _, line in numbered], self.delimiter, indices)
        except ValueError:
            if error := self._not_a_number(indices, numbered):
                raise error from None
            filled = [_with_nan(line, self.delimiter) for _, line in numbered]
            return _numbers(filled, self.delimiter, indices)

    def _pieces(self, place: Place = BEGIN) -> Iterator[Piece]:
        """Lines of numbers, by pieces of the file, from the one that begins at `place`."""
        header = self.has_header and place == BEGIN
        for begin, numbers, lines in _pieces(self.source, place):
            under = header and bool(lines)
            yield begin, islice(numbers, under, None), lines[under:]
            header = header and not under

    @cached_property
    def _places(self) -> list[tuple[int, Place]]:
        """Samples ahead of each piece and where it begins; last the number of all samples."""
        places, count = [], 0
        for place, _, lines in self._pieces():
            places.append((count, place))
            count += len(lines)
        return [*places, (count, BEGIN)]

    def row(self, i: int) -> str:
        numbers = chain.from_iterable(numbers for _, numbers, _ in self._pieces())
        return f"line {next(islice(numbers, i, None))}"

    def require(self, names: Sequence[str]) -> None:
        """Raise InputError unless these columns are there."""
        if names and self.has_header and not {*names} & {*self.names}:
            raise InputError(
                (
                    f"no column {', '.join(names)}; the first line has {', '.join(self.names)}; "
                    "put # "
                    "before lines above the names"
                ),
                file=self.file,
            )
        super().require(names)

    def require_widths(self, numbered: Sequence[tuple[int, str]]) -> None:
        """Raise InputError unless every line has one field per name."""
        for k, line in numbered:
            width = len(_fields(line, self.delimiter))
            if width == len(self.names):
                continue
            hint = "put # before lines that are neither names nor numbers"
            if self.delimiter == "," and width > len(self.names):
                hint = (
                    "if decimals are written with commas, separate columns by semicolons and "
                    "set record.decimal: ','"
                )
            raise InputError(
                f"{width} fields; expected {len(self.names)} ({', '.join(self.names)}); {hint}",
                file=self.file,
                row=f"line {k}",
            )

    def _require_no_points(self, indices: list[int], numbered: Sequence[tuple[int, str]]) -> None:
        """Raise InputError where a field has a point beside decimal commas: 1.234 may be a
        thousand.
        """
        for k, line in numbered:
            if "." in line:
                fields = _fields(line, self.delimiter)
                for i in (i for i in indices if "." in fields[i]):
                    hint = (
                        "write numbers without separators of thousands, or set record.decimal: '.'"
                    )
                    raise InputError(
                        f"{fields[i]!r} holds a point, decimals are said to have a comma; {hint}",
                        file=self.file,
                        column=self.names[i],
                        row=f"line {k}",
                    )

    def _not_a_number(
        self, indices: list[int], numbered: Sequence[tuple[int, str]]
    ) -> InputError | None:
        """What is wrong with the first field that is not a number; None where all of them are empty
        ones of positions, which may be missing.
        """
        for k, line in numbered:
            fields = _fields(line, self.delimiter)
            for i in indices:
                position = not fields[i] and self.names[i] in self.positions
                if not _is_number(fields[i]) and not (position and self.missing):
                    what = "an empty field" if not fields[i] else repr(fields[i])
                    hint = (
                        "; put # before a second line of names or units"
                        if fields[i] and self.row(0) == f"line {k}"
                        else ""
                    )
                    if position:
                        hint = f", or repair or cut the record; {COUNTS}"
                    if CLOCK.search(fields[i]):
                        hint = (
                            "; no date or time of day is read: write seconds, or give "
                            "record.rate without columns.t"
                        )
                    if "," in fields[i]:
                        hint = "; write decimals with a point, or set record.decimal: ','"
                    return InputError(
                        f"{what}; expected a number{hint}",
                        file=self.file,
                        column=self.names[i],
                        row=f"line {k}",
                        remedy={"decimal": ","} if "," in fields[i] else None,
                    )
        return None if self.missing else InputError("a field that is not a number", file=self.file)


def open_text(source: Source) -> TextTable:
    """Table of a text file; without a header line the columns are called 1, 2, 3 ..."""
    lines_of = (zip(*piece[1:], strict=True) for piece in _pieces(source, BEGIN, HEAD))
    head = [*islice(chain.from_iterable(lines_of), 2)]
    if not head:
        raise InputError("no line of numbers", file=source.file)
    first = head[0][1]
    delimiter = next((d for d in (";", "\t", ",") if d in first and d != source.decimal), None)
    header = _fields(first, delimiter)
    if len(header) > WIDEST:
        raise InputError(
            (
                f"{len(header)} columns; at most {WIDEST} are read, write those you need into a "
                "file "
                "of their own"
            ),
            file=source.file,
        )
    has_header = not all(_is_number(x.replace(source.decimal, ".")) for x in header)
    names = tuple(header) if has_header else tuple(str(i + 1) for i in range(len(header)))
    double = sorted(name for name, count in Counter(names).items() if count > 1)
    if double:
        raise InputError(f"header names {', '.join(double)} more than once", file=source.file)
    table = TextTable(
        file=source.file,
        size=source.size,
        names=names,
        source=source,
        delimiter=delimiter,
        has_header=has_header,
    )
    table.require_widths(head)  # a title is no header
    return table


def _pieces(source: Source, place: Place, size: int = PIECE) -> Iterator[Piece]:
    """Lines that hold something, comments aside, by pieces of `size` characters of the file, from
    the one that begins at `place`.
    """
    first, rest, begin = place
    empty = 0
    try:
        with opened(source.path) as stream, TextIOWrapper(stream, encoding="utf-8-sig") as text:
            text.seek(begin)
            for piece in chain(iter(lambda: text.read(size), ""), ["\n"]):
                *lines, rest = (rest + piece).split("\n")
                if max(map(len, (*lines, rest))) > LONGEST:
                    long = next(k for k, x in enumerate((*lines, rest), first) if len(x) > LONGEST)
                    raise InputError(
                        f"a line of more than {LONGEST} characters; expected one sample a line",
                        file=source.file,
                        row=f"line {long}",
                    )
                lines = [*map(str.strip, lines)]
                filled = [line for line in lines if line and line[0] != "#"]
                numbers = (k for k, x in enumerate(lines, first) if x and x[0] != "#")
                first, empty = first + len(lines), empty + len(lines) - len(filled)
                if empty > MOST_EMPTY:
                    raise InputError(
                        (
                            f"more than {MOST_EMPTY} lines are empty or comments; expected one "
                            "sample "
                            "a line"
                        ),
                        file=source.file,
                    )
                yield place, numbers, filled
                place = first, rest, text.tell()
    except UnicodeDecodeError as e:
        raise InputError(
            f"not a text file in UTF-8 (byte {e.start} of a block); {UTF8}", file=source.file
        ) from None


def _numbers(lines: list[str], delimiter: str | None, columns: list[int] | None = None) -> Array:
    """Numbers of these columns, shape (len(lines), len(columns)), default: of all; ValueError where
    there is anything else.
    """
    return np.loadtxt(
        lines, delimiter=delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"'
    )


def _with_nan(text: str, delimiter: str | None) -> str:
    """The lines with nan in empty fields, quoted ones too; blanks leave no field empty."""
    if delimiter is None:
        return text
    d, nothing = re.escape(delimiter), r' *(?:"")? *'
    return re.sub(rf"(?m)(?:^|(?<={d})){nothing}(?={d})|(?<={d}){nothing}$", "nan", text)


def _fields(line: str, delimiter: str | None) -> list[str]:
    return [x.strip().strip('"').strip() for x in line.split(delimiter)]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
