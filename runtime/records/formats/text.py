"""Columns of a text file: comma, semicolon, tab or blanks between numbers, one header line or none,
`#` before comments; decimals with a point, or with a
comma where that is said."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import TextIOWrapper
from itertools import islice

import numpy as np

from runtime.errors import InputError
from runtime.files import opened
from runtime.records.formats.columns import WIDEST, Array, Groups, Source, Table
from runtime.records.missing import COUNTS
from runtime.records.stream import Queue

LONGEST = 1_000_000  # characters of a line: so many fields of a hundred digits each
HELD = 2**25  # bytes of a file whose numbers are all kept: they are read once
PIECE = 2**22  # bytes of a longer one, read at a time
MOST_EMPTY = 5_000_000  # lines without a number
CLOCK = re.compile(r"\d:\d\d|\d{4}-\d\d-\d\d")  # a time of day, a date
UTF8 = "save it so (Excel: CSV UTF-8; elsewhere: iconv -f CP1252 -t UTF-8)"


@dataclass(eq=False, kw_only=True)
class TextTable(Table):
    """Lines of a text file. Where nothing but numbers stand under the header NumPy reads them, of a
    file of at most HELD bytes at once and once,
    of a longer one in pieces. From the first piece on that holds anything else, or is wrong, each
    line is read by itself, and what is wrong with it
    is told by line and column."""

    what = "a text file"

    source: Source
    delimiter: str | None
    has_header: bool

    def samples(self, groups: Groups) -> int:
        self.require([name for group in groups for name in group])
        count = self._count if self._numbers is None else len(self._numbers)
        if not count:
            raise InputError(
                f"no line of numbers under the header {', '.join(self.names)}", file=self.file
            )
        return count

    def in_any_order(self) -> bool:
        return self._numbers is not None or (self._places is not None and not self.source.packed)

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        indices = [self.names.index(name) for name in names]
        if self._numbers is not None:
            held = self._numbers[:stop]
            yield from (
                [held[a : a + size, i] for i in indices] for a in range(start, len(held), size)
            )
            return
        waiting, done = Queue(), start
        try:
            for numbers in self._read(start, stop):
                waiting.put(numbers[:, indices])
                while waiting.count >= size:
                    yield list(waiting.take(size).T)
                    done += size
        except ValueError:
            yield from self._parts_by_lines(indices, size, done, stop)
        else:
            if waiting.count:
                yield list(waiting.take(waiting.count).T)

    def _read(self, start: int, stop: int | None) -> Iterator[Array]:
        """Numbers of the samples [start, stop), shape (B, len(names)), in pieces; ValueError where
        there is anything else.
        """
        first, offset = (
            max(place for place in self._places or [(0, 0)] if place[0] <= start)
            if start
            else (0, 0)
        )
        for _, piece in self._pieces(offset):
            numbers = self._loaded(piece)
            yield numbers[max(start - first, 0) : None if stop is None else stop - first]
            first += len(numbers)
            if stop is not None and first >= stop:
                return

    def _parts_by_lines(
        self, indices: list[int], size: int, start: int, stop: int | None
    ) -> Iterator[Sequence[Array]]:
        """The samples [start, stop)."""
        lines = islice(self._lines(), start, stop)
        while block := list(islice(lines, size)):
            numbers, texts = zip(*block, strict=True)
            self.require_widths(numbers, texts)
            plain: Sequence[str] = texts
            if self.source.decimal != ".":
                self._require_no_points(indices, numbers, texts)
                plain = [text.replace(self.source.decimal, ".") for text in texts]
            try:
                yield list(
                    np.loadtxt(
                        plain,
                        delimiter=self.delimiter,
                        usecols=indices,
                        ndmin=2,
                        comments=None,
                        quotechar='"',
                    ).T
                )
            except ValueError:
                if error := self._not_a_number(indices, numbers, plain):
                    raise error from None
                plain = [_with_nan(text, self.delimiter) for text in plain]
                yield list(
                    np.loadtxt(
                        plain,
                        delimiter=self.delimiter,
                        usecols=indices,
                        ndmin=2,
                        comments=None,
                        quotechar='"',
                    ).T
                )

    def _pieces(self, offset: int = 0) -> Iterator[tuple[int, str]]:
        """What stands under the header, or from byte `offset` on, in pieces of whole lines, and the
        byte where each begins; ValueError where a line is
        no line of numbers with decimal points."""
        if self.source.decimal != ".":
            raise ValueError("decimal comma")
        with opened(self.source.path) as stream:
            rest = b""
            if not offset:
                lines_of_text = (
                    line.removeprefix(BOM_UTF8)
                    for line in iter(lambda: stream.readline(LONGEST + 1), b"")
                )
                first = next(
                    (
                        line
                        for line in lines_of_text
                        if line.strip() and not line.lstrip().startswith(b"#")
                    ),
                    b"",
                )
                if b"\r" in first.rstrip():
                    raise ValueError("lines that end with a carriage return alone")
                rest = b"" if self.has_header else first
            else:
                stream.seek(offset)
            begin = stream.tell() - len(rest)
            while block := stream.read(PIECE):
                lines, newline, rest = (rest + block).rpartition(b"\n")
                if newline:
                    yield begin, _regular(lines)
                    begin += len(lines) + 1
            if rest:
                yield begin, _regular(rest)

    def _loaded(self, lines: str) -> Array:
        """Numbers, shape (B, len(names)); ValueError where there is anything else."""
        try:
            numbers = self._plain(lines)
        except ValueError:
            if not self.missing:
                raise
            numbers = self._plain(_with_nan(lines, self.delimiter))
            if np.isnan(numbers[:, [name not in self.positions for name in self.names]]).any():
                raise
        return numbers

    def _plain(self, lines: str) -> Array:
        quote = '"' if '"' in lines else None
        numbers = np.loadtxt(
            lines.split("\n"), delimiter=self.delimiter, ndmin=2, comments=None, quotechar=quote
        )
        if numbers.shape[1] != len(self.names):
            raise ValueError("columns")
        return numbers

    @cached_property
    def _count(self) -> int:
        """Lines of numbers."""
        return sum(1 for _ in self._lines()) if self._places is None else self._places[-1][0]

    @cached_property
    def _places(self) -> list[tuple[int, int]] | None:
        """Number of the first sample of each piece of the file and the byte where it begins, then
        their end; None where a line holds anything else.
        """
        places, samples = [], 0
        try:
            for begin, piece in self._pieces():
                places.append((samples, begin))
                samples += piece.count("\n") + 1
        except ValueError:
            return None
        return [*places, (samples, self.source.size)]

    @cached_property
    def _numbers(self) -> Array | None:
        """Every column, shape (N, len(names)); None where the file is long, or something in it is
        neither a number nor the header.
        """
        try:
            with opened(self.source.path) as stream:
                whole = stream.read(HELD + 1)
            if len(whole) > HELD:
                return None
            text = _one_newline(whole.decode("utf-8-sig")).lstrip()
            lines = text.partition("\n")[2] if self.has_header else text
            if "#" in text or self.source.decimal != "." or not lines or lines.isspace():
                return None
            return self._loaded(lines)
        except ValueError:  # the file is read again by lines, which tells where
            return None

    def row(self, i: int) -> str:
        return f"line {next(islice(self._lines(), i, None))[0]}"

    def _lines(self) -> Iterator[tuple[int, str]]:
        return islice(_numbered_lines(self.source), 1 if self.has_header else 0, None)

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

    def require_widths(self, numbers: Sequence[int], lines: Sequence[str]) -> None:
        """Raise InputError unless every line has one field per name."""
        widths = [
            len(line.split()) if self.delimiter is None else line.count(self.delimiter) + 1
            for line in lines
        ]
        if widths.count(len(self.names)) < len(widths):
            k, width = next(
                (k, width)
                for k, width in zip(numbers, widths, strict=True)
                if width != len(self.names)
            )
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

    def _require_no_points(
        self, indices: list[int], numbers: Sequence[int], lines: Sequence[str]
    ) -> None:
        """Raise InputError where a field has a point beside decimal commas: 1.234 may be a
        thousand.
        """
        for k, line in zip(numbers, lines, strict=True):
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
        self, indices: list[int], numbers: Sequence[int], lines: Sequence[str]
    ) -> InputError | None:
        """What is wrong with the first field that is not a number; None where all of them are empty
        ones of positions, which may be missing.
        """
        for k, line in zip(numbers, lines, strict=True):
            fields = _fields(line, self.delimiter)
            for i in indices:
                position = not fields[i] and self.names[i] in self.positions
                if not _is_number(fields[i]) and not (position and self.missing):
                    what = "an empty field" if not fields[i] else repr(fields[i])
                    hint = (
                        "; put # before a second line of names or units"
                        if k == next(self._lines())[0] and fields[i]
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
                    )
        return None if self.missing else InputError("a field that is not a number", file=self.file)


def open_text(source: Source) -> TextTable:
    """Table of a text file; without a header line the columns are called 1, 2, 3 ..."""
    first = next(_numbered_lines(source), None)
    if first is None:
        raise InputError("no line of numbers", file=source.file)
    delimiter = next((d for d in (";", "\t", ",") if d in first[1] and d != source.decimal), None)
    header = _fields(first[1], delimiter)
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
    table.require_widths(
        *zip(*islice(_numbered_lines(source), 2), strict=True)
    )  # a title is no header
    return table


def _numbered_lines(source: Source) -> Iterator[tuple[int, str]]:
    """Lines that hold something, comments aside, with their numbers from 1."""
    empty = 0
    try:
        with opened(source.path) as stream, TextIOWrapper(stream, encoding="utf-8-sig") as text:
            for k, raw in enumerate(iter(lambda: text.readline(LONGEST + 1), ""), start=1):
                if len(raw) > LONGEST:
                    raise InputError(
                        f"a line of more than {LONGEST} characters; expected one sample a line",
                        file=source.file,
                        row=f"line {k}",
                    )
                line = raw.strip()
                if line and not line.startswith("#"):
                    yield k, line
                    continue
                empty += 1
                if empty > MOST_EMPTY:
                    raise InputError(
                        (
                            f"more than {MOST_EMPTY} lines are empty or comments; expected one "
                            "sample "
                            "a line"
                        ),
                        file=source.file,
                    )
    except UnicodeDecodeError as e:
        raise InputError(
            f"not a text file in UTF-8 (byte {e.start} of a block); {UTF8}", file=source.file
        ) from None


def _regular(lines: bytes) -> str:
    """The lines without empty ones at their ends; ValueError where one of them is empty, indented
    or a comment, or none is left.
    """
    text = _one_newline(lines.decode()).strip("\n")
    if "#" in text or not text or text[0].isspace() or re.search(r"\n\s", text):
        raise ValueError("lines of another kind")
    return text


def _one_newline(text: str) -> str:
    """The text with "\\n" at the end of every line."""
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


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
