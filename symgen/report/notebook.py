"""A Regrouping in a notebook: its formulas as a table in MathML, and in LaTeX for documents made of notebooks."""

from __future__ import annotations

from symgen.regroup.regrouping import Regrouping
from symgen.report import mathml
from symgen.report.latex import latex_formula, latex_name
from symgen.report.mathml import MathML, element

LEFT = "padding:0 0.6em;text-align:left"


def regrouping_html(regrouping: Regrouping) -> str:
    """Table of the parameters that take in others, then those that stand as they are and those without effect; nothing in a name is markup."""
    robot = regrouping.robot
    formulas = [(b.name, mathml.formula(b.combination)) for b in regrouping.base if b.name != b.own]
    rows = [_row("td", _symbol(name), MathML(" ".join(terms))) for name, terms in formulas]
    parts = [element("p", element("b", robot.title or robot.name), f": {_counts(regrouping)}")]
    if rows:
        table = element("tbody", *rows)
        parts.append(element("table", element("thead", _row("th", "base parameter", "formula")), table))
    alone = [b.name for b in regrouping.base if b.name == b.own]
    parts += [_listed(head, names) for head, names in (("As they are", alone), ("No effect", regrouping.no_effect)) if names]
    return element("div", *parts)


def regrouping_latex(regrouping: Regrouping) -> str:
    r"""The formulas as an `aligned` environment in display mathematics."""
    rows = [rf"{latex_name(b.name)} &= {latex_formula(b.combination)} \\" for b in regrouping.base]
    return "\n".join([r"$$\begin{aligned}", *rows, r"\end{aligned}$$"])


def _counts(regrouping: Regrouping) -> str:
    return f"{len(regrouping)} base parameters of {len(regrouping.robot.parameters)}, {regrouping.method}"


def _symbol(name: str) -> MathML:
    return mathml.math(mathml.parameter(name))


def _listed(head: str, names: tuple[str, ...] | list[str]) -> MathML:
    return element("p", f"{head}: ", MathML(" ".join(map(_symbol, names))))


def _row(tag: str, *cells: str) -> MathML:
    return element("tr", *(element(tag, cell, style=LEFT) for cell in cells))
