"""Formulas in a notebook: a table in MathML; nothing in a name is markup."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from symgen.regroup import mathml
from symgen.regroup.formula import Formula
from symgen.regroup.mathml import MathML, element

LEFT = "padding:0 0.6em;text-align:left"


def table(title: str, counts: str, formulas: Mapping[str, Formula], lists: Mapping[str, Sequence[str]]) -> str:
    """`title: counts`, the `formulas` by name, then the names of each list under its head."""
    rows = [_row("td", _symbol(name), MathML(" ".join(mathml.formula(f)))) for name, f in formulas.items()]
    parts = [element("p", element("b", title), f": {counts}")]
    if rows:
        parts.append(element("table", element("thead", _row("th", "base parameter", "formula")), element("tbody", *rows)))
    parts += [element("p", f"{head}: ", MathML(" ".join(map(_symbol, names)))) for head, names in lists.items() if names]
    return element("div", *parts)


def _symbol(name: str) -> MathML:
    return mathml.math(mathml.parameter(name))


def _row(tag: str, *cells: str) -> MathML:
    return element("tr", *(element(tag, cell, style=LEFT) for cell in cells))
