r"""LaTeX tables as the chapter prints them, for \usepackage{booktabs}: Table 2 of an Estimate, Tables 3 and 4 of a resolution study, Table 7 of its errors.

No name, unit or label is read as LaTeX: texts that have none of the forms known below are escaped, character by character.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

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
    """Any text as one line that LaTeX prints as it is; characters that cannot be printed become ?."""
    return "".join(SPECIAL.get(c, c if c.isprintable() else " " if c.isspace() else "?") for c in text)


def name_cell(name: str) -> str:
    """ZZ1R as ZZ with the subscript 1R; any other text as it is."""
    parts = NAME.fullmatch(name)
    return escaped(name) if parts is None else rf"$\mathrm{{{parts[1]}}}_{{\mathrm{{{escaped(parts[2])}}}}}$"


def unit_cell(unit: str) -> str:
    """(kg m^2) behind a name; nothing for no unit."""
    if not unit:
        return ""
    if not UNIT.fullmatch(unit):
        return f" ({escaped(unit)})"
    text = re.sub(r"\*\*(-?\d+)", r"^{\1}", unit).replace("*", r"\,")
    return rf" ($\mathrm{{{text}}}$)"


def number_cell(value: float, form: str = ".4g") -> str:
    """A number in mathematics, powers of ten as such; -- where there is none."""
    if not math.isfinite(value):
        return "--"
    digits, _, power = format(value, form).partition("e")
    return rf"${digits} \cdot 10^{{{int(power)}}}$" if power else f"${digits}$"


def level_cell(label: str) -> str:
    """2*pi/10000 and Phi 0.01 of a level of a resolution study."""
    if step := re.fullmatch(r"2\*pi/(\d+)", label):
        return rf"$\Delta = 2\pi/{step[1]}$"
    if torque := re.fullmatch(r"Phi ([0-9.e+-]+)", label):
        return rf"$\Phi = {number_cell(float(torque[1]))[1:]}"
    try:
        return rf"$\Delta = {number_cell(float(label))[1:]}"
    except ValueError:
        return escaped(label)


def parameter_table(names: Sequence[str], X: Array, relative_sigma: Array, units: Mapping[str, str], *, blocks: int = 1) -> str:
    """Table 2: name (unit), value, %sigma.

    Parameters
    ----------
    X : ndarray, shape (b,), SI
        Values.
    relative_sigma : ndarray, shape (b,), %
        Relative deviations.
    units : mapping of str
        Units by name.
    blocks : int
        Number of blocks side by side, each with the three columns; 60 parameters fit a page in two.
    """
    lines = [
        (name_cell(name) + unit_cell(units.get(name, "")), number_cell(x), number_cell(s, ".3f"))
        for name, x, s in zip(names, X, relative_sigma, strict=True)
    ]
    height = -(-len(lines) // blocks)
    columns = [lines[k * height : (k + 1) * height] for k in range(blocks)]
    rows = [[cell for part in columns for cell in (part[i] if i < len(part) else ("", "", ""))] for i in range(height)]
    header = ("Mechanical parameters", "Value", r"Relative deviation \%$\sigma$" if blocks == 1 else r"\%$\sigma$")
    return tabular("lrr" * blocks, header * blocks, [rows])


def level_table(
    names: Sequence[str], units: Mapping[str, str], labels: Sequence[str], columns: Array, last: Sequence[tuple[str, Array]]
) -> str:
    r"""Tables 3 and 4: the mean value at each level, then lines in per cent below a rule.

    Parameters
    ----------
    columns : ndarray, shape (levels, b), SI
        Mean values.
    last : sequence of pairs of str and ndarray, shape (levels,), %
        Lines below the rule, such as "%e($\rho$)" and its values.
    """
    header = ("Mechanical parameters", *(f"Value with {level_cell(label)}" for label in labels))
    rows = [[name_cell(n) + unit_cell(units.get(n, "")), *map(number_cell, columns[:, i])] for i, n in enumerate(names)]
    return tabular("l" + "r" * len(labels), header, [rows, _percent_rows(last)])


def error_table(names: Sequence[str], labels: Sequence[str], errors: Array, last: Sequence[tuple[str, Array]]) -> str:
    """Table 7: %e of each parameter at each level; errors, shape (levels, b), in %."""
    header = ("Parameters", *(level_cell(label) for label in labels))
    rows = [[rf"\%e({name_cell(n)})", *(_percent(x) for x in errors[:, i])] for i, n in enumerate(names)]
    return tabular("l" + "r" * len(labels), header, [rows, _percent_rows(last)])


def tabular(alignment: str, header: Sequence[str], parts: Sequence[Sequence[Sequence[str]]]) -> str:
    """A tabular of booktabs; a rule between the parts."""
    body = [r"\begin{tabular}{" + alignment + "}", r"\toprule", _line(header)]
    for part in parts:
        body += [r"\midrule", *map(_line, part)]
    return "\n".join([*body, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _line(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"


def _percent_rows(rows: Sequence[tuple[str, Array]]) -> list[list[str]]:
    return [[head, *map(_percent, values)] for head, values in rows]


def _percent(value: float) -> str:
    return f"{number_cell(value, '.2f')}\\,\\%" if math.isfinite(value) else "--"
