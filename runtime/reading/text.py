"""Reading of text files with columns of numbers.

Columns are separated by commas, semicolons, tabs or blanks; a field in quotation marks may contain
the separator. There is one header line or none. `#`, or `%` before a blank, starts a comment, and a
comment just above the numbers with one name for each column is the header, as numpy.savetxt writes
it. A first line such as `sep=;` is left out. Decimals have a point, or a comma if the settings say
so. The text is UTF-8, or UTF-16 if it starts with the bytes ff fe or fe ff.

The text of `ros2 topic echo --csv` is recognised by its first line (`runtime.reading.echoed`).

NumPy parses a file whose fields are all numbers. Other files are read field by field: a column with
other texts raises an error only if it is used, with the first line of such a text.
"""

from __future__ import annotations

import csv
import re
from array import array
from collections import Counter, deque
from collections.abc import Iterator
from functools import partial
from io import TextIOWrapper
from itertools import chain, islice, takewhile
from pathlib import Path

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.echoed import is_echo, read_echo
from runtime.reading.files import opened
from runtime.reading.table import WIDEST, Array, Options, Table

CLOCK = re.compile(r"\d:\d\d|\d{4}-\d\d-\d\d")  # a time of day, a date
COMMENT = re.compile(r"#|%+(\s|$)")
SEPARATOR = re.compile(r"sep=.", re.IGNORECASE)  # first line of a file of Excel
UTF8 = "save it so (Excel: CSV UTF-8; elsewhere: iconv -f CP1252 -t UTF-8)"
SIGNATURES = {  # first bytes of files that are no text
    b"\x89PNG": "a picture (PNG), not a table",
    b"\xff\xd8\xff": "a picture (JPEG), not a table",
    b"GIF8": "a picture (GIF), not a table",
    b"%PDF": "a PDF, not a table",
    b"PK\x03\x04": "an Excel workbook or another zip archive; save the sheet as CSV UTF-8",
    b"\xd0\xcf\x11\xe0": "an Excel workbook; save the sheet as CSV UTF-8",
    b"\x89HDF": "an HDF5 file; give its name the ending .hdf5",
    b"PAR1": "a Parquet file; give its name the ending .parquet",
    b"\0\0\0\0": "a file of zeros, as after a crash; write the file again",
    b"SQLite format 3": "a database, perhaps a bag of ROS 2; give its name the ending .db3",
}
UTF16 = (b"\xff\xfe", b"\xfe\xff")  # first bytes of a text in UTF-16
BLOCK = 2**18  # characters read at a time, and the rest of their last line
Lines = Iterator[tuple[int, str]]  # number of a line, from 1, and what stands there


def read_text(path: Path, options: Options) -> Table:
    """Read a text file as a Table; without a header line the columns are called 1, 2, 3 ..."""
    file = path.name
    decimal = options.decimal
    _, first = next(_lines(path), (0, ""))
    if not first:
        raise InputError("the file has no line of numbers; expected one line per sample", file=file)
    if is_echo(first):
        return read_echo(file, _lines(path))
    delimiter = next((mark for mark in ";\t," if mark in first and mark != decimal), None)
    if _width(first, delimiter) > WIDEST:
        raise InputError(
            f"the file has {_width(first, delimiter)} columns; expected at most {WIDEST}, so write "
            "the needed columns into a separate file",
            file=file,
        )
    header = _fields(first, delimiter)
    has_header = any(_number(field, decimal) is None for field in header)
    names = tuple(header)
    if not has_header:
        names = _names_above(path, delimiter, decimal, len(header))
    double = sorted(name for name, count in Counter(names).items() if count > 1)
    if double:
        raise InputError(
            f"the header contains {', '.join(double)} more than once; rename these columns",
            file=file,
        )
    refused: dict[str, InputError] = {}
    empty: dict[str, str] = {}
    values = _parsed(path, has_header, delimiter, decimal)
    if values is None or values.shape[1] != len(names):
        lines = islice(_lines(path), has_header, None)
        values = _by_fields(file, lines, names, delimiter, decimal, refused, empty)
    if not len(values):
        raise InputError(
            f"the file has no line of numbers under the header {', '.join(names)[:200]}",
            file=file,
        )
    return Table(
        file=file,
        columns=dict(zip(names, values.T, strict=True)),
        refused=refused,
        empty=empty,
        row=partial(_row, path, has_header),
        has_header=has_header,
        numbered=True,
        what="a text file",
    )


def _lines(path: Path) -> Lines:
    """Yield the lines of a text file that are neither empty nor comments, with their numbers."""
    for number, line in _with_comments(path):
        if not (COMMENT.match(line) or (number == 1 and SEPARATOR.fullmatch(line))):
            yield number, line


def _names_above(path: Path, delimiter: str | None, decimal: str, width: int) -> tuple[str, ...]:
    """Read the names of columns from the comment just above the numbers; without them 1, 2, 3 ..."""
    comments = takewhile(lambda one: COMMENT.match(one[1]), _with_comments(path))
    last = deque((line for _, line in comments), maxlen=1)
    names = tuple(_fields(last[0].lstrip("#% \t"), delimiter)) if last else ()
    words = all(name and _number(name, decimal) is None for name in names)
    if words and len(names) == len({*names}) == width:
        return names
    return tuple(str(k + 1) for k in range(width))


def _with_comments(path: Path) -> Lines:
    """Yield the lines of a text file that are not empty, with their numbers."""
    number = 0
    try:
        encoding = _encoding(path)
        with opened(path) as stream, TextIOWrapper(stream, encoding=encoding) as text:
            while block := text.read(BLOCK) + text.readline():
                lines = enumerate(block.removesuffix("\n").split("\n"), number + 1)
                for number, line in lines:
                    if line and (line := line.strip()):
                        yield number, line
    except UnicodeDecodeError:
        raise _not_utf8(path) from None


def _encoding(path: Path) -> str:
    """Return the encoding of a text file: UTF-16 if its first bytes say so, else UTF-8.

    Raise InputError for a file whose first bytes are those of another kind of file.
    """
    with opened(path) as stream:
        head = stream.read(16)
    for first, what in SIGNATURES.items():
        if head.startswith(first):
            shown = head[:4].hex(" ")
            raise InputError(f"not a text file: the first bytes, {shown}, are those of {what}", file=path.name)  # fmt: skip
    return "utf-16" if head.startswith(UTF16) else "utf-8-sig"


def _not_utf8(path: Path) -> InputError:
    """Make the error for a text file that is not UTF-8; it names the first wrong byte and line."""
    if _encoding(path) == "utf-16":
        message = "damaged text in UTF-16; save it as UTF-8"
        return InputError(message, file=path.name)
    with opened(path) as stream:
        for number, line in enumerate(stream, 1):
            try:
                line.decode()
            except UnicodeDecodeError as e:
                byte = f"byte 0x{line[e.start]:02x}"
                message = f"not a text file in UTF-8 ({byte}); {UTF8}"
                return InputError(message, file=path.name, row=f"line {number}")
    return InputError(f"not a text file in UTF-8; {UTF8}", file=path.name)


def _row(path: Path, has_header: bool, i: int) -> str:
    """Name the line of the text file that contains sample i, for messages: "line 12"."""
    number, _ = next(islice(_lines(path), i + has_header, None))
    return f"line {number}"


def _parsed(path: Path, has_header: bool, delimiter: str | None, decimal: str) -> Array | None:
    """Parse all numbers of a text file by NumPy, shape (N, k).

    Return None if a field is not a number, or if lines have different numbers of fields.
    """
    lines = (line for _, line in islice(_lines(path), has_header, None))
    if decimal != ".":
        lines = (_with_point(line, decimal) for line in lines)
    try:
        first = next(lines, None)
        if first is None:
            return None
        return np.loadtxt(
            chain([first], lines), delimiter=delimiter, ndmin=2, comments=None, quotechar='"'
        )
    except InputError:
        raise
    except ValueError:
        return None


def _with_point(line: str, decimal: str) -> str:
    """Replace the decimal commas in a line of numbers by decimal points.

    Raise ValueError if the line has points already, since 1.234 may mean a thousand.
    """
    if "." in line:
        raise ValueError(
            "found a decimal point in a file with decimal commas; write all numbers "
            "with the same decimal sign"
        )
    return line.replace(decimal, ".")


def _by_fields(
    file: str,
    lines: Lines,
    names: tuple[str, ...],
    delimiter: str | None,
    decimal: str,
    refused: dict[str, InputError],
    empty: dict[str, str],
) -> Array:
    """Read the numbers of the lines, shape (N, k), with nan for fields that are not numbers.

    Columns with other texts are added to `refused`, columns with empty fields to `empty`.
    """
    numbers = array("d")
    for count, (number, line) in enumerate(lines):
        row = f"line {number}"
        width = _width(line, delimiter)
        if line.count('"') % 2:
            message = "a quotation mark is not closed on this line; expected one sample per line"
            raise InputError(message, file=file, row=row)
        if width != len(names):
            raise InputError(
                f"{width} fields; expected {len(names)} ({', '.join(names)}); "
                f"{_width_hint(delimiter, width > len(names))}",
                file=file,
                row=row,
            )
        fields = _fields(line, delimiter)
        values = [_number(field, decimal) for field in fields]
        if None in values:
            for name, field, value in zip(names, fields, values, strict=True):
                if value is None and not field:
                    empty.setdefault(name, row)
                elif value is None and name not in refused:
                    refused[name] = _no_number(file, name, row, field, decimal, first=count == 0)
        numbers.extend(np.nan if value is None else value for value in values)
    return np.frombuffer(numbers).reshape(-1, len(names)) if numbers else np.empty((0, len(names)))


def _width(line: str, delimiter: str | None) -> int:
    """Count the fields of a line of a text file."""
    return len(_fields(line, delimiter)) if '"' in line else len(line.split(delimiter))


def _fields(line: str, delimiter: str | None) -> list[str]:
    """Split a line into its fields; one in quotation marks may contain the delimiter."""
    fields = line.split(delimiter)
    if '"' in line and delimiter is not None:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [field.strip().strip('"').strip() for field in fields]


def _number(text: str, decimal: str) -> float | None:
    """Return the number in one field of a text file; None if the field is not a number."""
    if "_" in text or not text.isascii() or (decimal != "." and "." in text):
        return None
    try:
        return float(text if decimal == "." else text.replace(decimal, "."))
    except ValueError:
        return None


def _width_hint(delimiter: str | None, wider: bool) -> str:
    if delimiter == "," and wider:
        return "if decimals are written with commas, separate columns by semicolons and set record.decimal: ','"
    return "put # before lines that are neither names nor numbers"


def _no_number(
    file: str, name: str, row: str, field: str, decimal: str, *, first: bool
) -> InputError:
    """Make the error for a field of a text file that is not a number.

    first : whether the field belongs to the first sample.
    """
    what = f"{field!r}; expected a number"
    hint = ""
    remedy = None
    if decimal != "." and "." in field:
        what = f"{field!r} contains a point, but record.decimal is a comma"
        hint = "; write numbers without separators of thousands, or set record.decimal: '.'"
    elif "," in field:
        hint = "; write decimals with a point, or set record.decimal: ','"
        remedy = {"decimal": ","}
    elif CLOCK.search(field):
        hint = "; dates and times of day are not supported: write seconds, or give record.rate without columns.t"
    elif first:
        hint = "; put # before a second line of names or units"
    return InputError(what + hint, file=file, column=name, row=row, remedy=remedy)
