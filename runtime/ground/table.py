"""A table of texts, printed as aligned text, in a notebook as HTML, or on the page of a report.

The parameters of an Estimate are also written in LaTeX, like Table 2 of the chapter (package
booktabs). No name, unit or label is interpreted as LaTeX: a text that has none of the known forms
below is escaped, character by character.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from math import floor, isfinite, log10
from typing import Any

import numpy as np

from runtime.ground.markup import Markup, element, symbol, unit

LINE = 80  # characters of a line


@dataclass(frozen=True)
class Table:
    """A table whose cells are text or HTML (Markup), for terminal, page and notebook.

    Attributes
    ----------
    caption : str
    header : sequence of str
    rows : sequence of sequences of str
        The first cell names the row and is aligned left, the others right.
    note : str
        Text that follows the table.
    wide : sequence of int
        Numbers, from 0, of columns of words, which are aligned left.
    sortable : bool
        Whether a page sorts the rows by any column, if scripts run.
    stacked : bool
        Whether every row becomes a block of lines on a narrow screen.
    symbols : bool
        Whether the first cells are names of parameters, which HTML prints with their subscripts.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    wide: Sequence[int] = ()
    sortable: bool = False
    stacked: bool = False
    symbols: bool = False

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.header)]
        if wrong:
            raise ValueError(
                f"table {self.caption!r}: {len(wrong[0])} cells in {tuple(wrong[0])}; expected "
                f"{len(self.header)}, {self.header}"
            )

    def to_text(self) -> str:
        """Write the table as plain text, with the header and without the caption."""
        return aligned([self.header, *self.rows])

    def to_html(self) -> Markup:
        """Write the table as an HTML element that needs no style sheet."""
        written = [
            symbol if k == 0 and self.symbols else unit if name == "unit" else str
            for k, name in enumerate(self.header)
        ]
        body = [
            [
                write(cell) if type(cell) is str else cell
                for write, cell in zip(written, row, strict=True)
            ]
            for row in self.rows
        ]
        head = element("thead", self._row("th", self.header))
        return element("table", head, element("tbody", *(self._row("td", row) for row in body)))

    def _row(self, tag: str, cells: Sequence[str]) -> Markup:
        sides = ("left" if k == 0 or k in self.wide else "right" for k in range(len(cells)))
        return element(
            "tr",
            *(
                element(tag, c, style=f"padding:0 0.6em;text-align:{side}")
                for c, side in zip(cells, sides, strict=True)
            ),
        )


def number(value: float, form: str = ".4g") -> str:
    """Write a number as text, with four digits by default; "-" if it is not finite."""
    return format(value, form) if isfinite(value) else "-"


def percentage(percent: float, relative: float, form: str = ".2f") -> str:
    """Write a number in % of the value of a parameter; "-" if its 95 % interval contains zero.

    relative : standard deviation of the parameter, % of its value.
    """
    return number(percent, form) if 1.96 * relative < 100 else "-"


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """Write cells as aligned columns of text: the first column aligned left, the others right."""
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]
    text = []
    for line in lines:
        cells = [
            line[0].ljust(widths[0]),
            *(cell.rjust(width) for cell, width in zip(line[1:], widths[1:], strict=True)),
        ]
        text.append("  ".join(cells).rstrip())
    return "\n".join(text)


def in_lines(cells: Sequence[str]) -> list[str]:
    """Pad cells of text to equal width, and join them into lines of at most 80 characters."""
    width = max(map(len, cells), default=0) + 2
    many = max((LINE + 2) // width, 1)
    rows = [cells[k : k + many] for k in range(0, len(cells), many)]
    return ["".join(cell.ljust(width) for cell in row).rstrip() for row in rows]


def with_intervals(
    names: Sequence[str],
    values: Iterable[float],
    sigma: Iterable[float],
    units: Sequence[str] = (),
) -> list[str]:
    """Write name, value, half of the 95 % interval and unit of each parameter, in aligned cells.

    Digits end at the second digit of the interval.

    >>> with_intervals(["ZZ1R", "FV1"], [1.79263, 8.0], [0.0104, 0.2], ["kg*m**2", "N*m*s/rad"])
    ['ZZ1R  1.793 +- 0.020  kg*m**2', 'FV1   8.00  +- 0.39   N*m*s/rad']
    """
    pairs = [interval(x, 1.96 * s) for x, s in zip(values, sigma, strict=True)]
    columns = [list(names), *map(list, zip(*pairs, strict=True)), list(units)]
    lead = ("", "", "+- ", "")
    padded = [
        [mark + cell.ljust(max(map(len, column))) for cell in column]
        for mark, column in zip(lead, columns, strict=True)
        if column
    ]
    gaps = ("  ", " ", "  ", "")
    rows = zip(*padded, strict=True)
    return ["".join(map("".join, zip(row, gaps, strict=False))).rstrip() for row in rows]


def interval(value: float, half: float) -> tuple[str, str]:
    """Write a value and the half-width of its interval, rounded to two digits of the half-width."""
    if not (isfinite(half) and half > 0 and isfinite(value)):
        return f"{value:.4g}", f"{half:.2g}"
    place = floor(log10(half)) - 1
    rounded = round(value, -place) + 0.0
    if -7 <= place <= 0 and abs(value) < 1e7:
        return f"{rounded:.{-place}f}", f"{half:.{-place}f}"
    return f"{rounded:.6g}", f"{half:.2g}"


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Write comma-separated values under a header; numbers keep all digits, None becomes empty."""
    stream = StringIO()
    csv.writer(stream, lineterminator="\n").writerows([header, *rows])
    return stream.getvalue()


def notebook(paragraphs: Sequence[str], *tables: Table) -> Markup:
    """Write a result as HTML for a notebook: paragraphs, the first table, then folded tables.

    Every text is escaped.
    """
    folds = [
        element("details", element("summary", table.caption), table.to_html())
        for table in tables[1:]
    ]
    return element(
        "div",
        *(element("p", text) for text in paragraphs),
        *(table.to_html() for table in tables[:1]),
        *folds,
    )


Array = np.ndarray

SPECIAL = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    **{c: "\\" + c for c in "&%$#_{}"},
}
UNIT = re.compile(r"[A-Za-z]+(?:\*\*-?\d+)?(?:[*/][A-Za-z]+(?:\*\*-?\d+)?)*")
NAME = re.compile(r"([A-Za-z]+)(\d[0-9_]*R?)")


def escaped(text: str) -> str:
    """Escape a text so that LaTeX prints it on one line; unprintable characters become "?"."""
    return "".join(
        SPECIAL.get(c, c if c.isprintable() else " " if c.isspace() else "?") for c in text
    )


def name_cell(name: str) -> str:
    """Write the name of a parameter in LaTeX: ZZ1R becomes ZZ with the subscript 1R.

    A text of another form is escaped.
    """
    parts = NAME.fullmatch(name)
    return (
        escaped(name)
        if parts is None
        else rf"$\mathrm{{{parts[1]}}}_{{\mathrm{{{escaped(parts[2])}}}}}$"
    )


def unit_cell(unit: str) -> str:
    """Write a unit in brackets, such as (kg m^2), to follow a name; "" if there is no unit."""
    if not unit:
        return ""
    if not UNIT.fullmatch(unit):
        return f" ({escaped(unit)})"
    text = re.sub(r"\*\*(-?\d+)", r"^{\1}", unit).replace("*", r"\,")
    return rf" ($\mathrm{{{text}}}$)"


def number_cell(value: float, form: str = ".4g") -> str:
    """Write a number in LaTeX, with a power of ten if needed; "--" if it is not finite."""
    if not isfinite(value):
        return "--"
    digits, _, power = format(value, form).partition("e")
    return rf"${digits} \cdot 10^{{{int(power)}}}$" if power else f"${digits}$"


def parameter_table(
    names: Sequence[str],
    X: Array,
    relative_sigma: Array,
    units: Mapping[str, str],
    *,
    blocks: int = 1,
) -> str:
    """Write the parameters in LaTeX as in Table 2 of the chapter: name (unit), value, %sigma.

    Parameters
    ----------
    X : ndarray, shape (b,), SI
        Values.
    relative_sigma : ndarray, shape (b,), %
        Relative standard deviations.
    units : mapping of str
        Units by name.
    blocks : int
        Number of blocks side by side, each with the three columns; with two blocks, 60 parameters
        fit on a page.
    """
    lines = [
        (name_cell(name) + unit_cell(units.get(name, "")), number_cell(x), number_cell(s, ".3f"))
        for name, x, s in zip(names, X, relative_sigma, strict=True)
    ]
    height = -(-len(lines) // blocks)
    columns = [lines[k * height : (k + 1) * height] for k in range(blocks)]
    rows = [
        [cell for part in columns for cell in (part[i] if i < len(part) else ("", "", ""))]
        for i in range(height)
    ]
    header = (
        "Mechanical parameters",
        "Value",
        r"Relative deviation \%$\sigma$" if blocks == 1 else r"\%$\sigma$",
    )
    head, *body = (" & ".join(cells) + r" \\" for cells in (header * blocks, *rows))
    begin = rf"\begin{{tabular}}{{{'lrr' * blocks}}}"
    text = [begin, r"\toprule", head, r"\midrule", *body, r"\bottomrule", r"\end{tabular}"]
    return "\n".join(text) + "\n"
