r"""Parameter table of an Estimate in LaTeX, like Table 2 of the chapter (package booktabs).

No name, unit or label is interpreted as LaTeX: a text without one of the known forms below is
escaped, character by character.
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
    if not math.isfinite(value):
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
