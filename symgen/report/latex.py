"""Formulas in LaTeX, with the subscripts of the literature: ZZ1R is ZZ_{1R}, Ia1 is I_{a1}, FV2 is F_{v2}."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction

from symgen.description.expression import ONE, Call, Expression
from symgen.regroup.regrouping import shared
from symgen.report.symbols import symbol

GREEK = re.compile(r"(alpha|beta|gamma|delta|theta|phi|psi)")


def latex_name(name: str) -> str:
    """Symbol of a parameter or constant."""
    letter, subscript = symbol(name)
    text = GREEK.sub(r"\\\1 ", letter).replace("_", r"\_").strip()
    return f"{text}_{{{subscript}}}" if subscript else text


def latex_expression(e: Expression) -> str:
    """A constant expression, fractions as \\frac."""
    text = ""
    for m, c in e.terms.items():
        term = _term(m, abs(c))
        text += ("-" if c < 0 else "") + term if not text else (" - " if c < 0 else " + ") + term
    return text or "0"


def _term(m: tuple[tuple[str | Call, int], ...], c: Fraction) -> str:
    up = [_power(a, n) for a, n in m if n > 0]
    down = [_power(a, -n) for a, n in m if n < 0]
    if c.numerator != 1 or not up:
        up.insert(0, str(c.numerator))
    if c.denominator != 1:
        down.insert(0, str(c.denominator))
    top = r"\,".join(up)
    return rf"\frac{{{top}}}{{{' '.join(down)}}}" if down else top


def _power(a: str | Call, n: int) -> str:
    if isinstance(a, Call):
        argument = latex_expression(a.argument)
        if a.function == "sqrt":
            base = rf"\sqrt{{{argument}}}"
        elif a.function == "inv":
            base = rf"\left({argument}\right)"
            n = -n
        else:
            return rf"\{a.function}^{{{n}}}\left({argument}\right)" if n != 1 else rf"\{a.function}\left({argument}\right)"
    else:
        base = r"\pi" if a == "pi" else latex_name(a)
    return base if n == 1 else f"{base}^{{{n}}}"


def latex_formula(combination: Mapping[str, Expression]) -> str:
    """The terms of the text formula, in its order."""
    text = ""
    for c, names in shared(combination).items():
        inner = _signed_sum([("-", latex_name(n[1:])) if n.startswith("-") else ("+", latex_name(n)) for n in names])
        several = rf"\left({inner}\right)" if len(names) > 1 else inner
        if c in (ONE, -ONE):
            term = inner if c == ONE else "-" + several
        else:
            factor = latex_expression(c) if len(c.terms) == 1 else rf"\left({latex_expression(c)}\right)"
            term = rf"{factor}\,{several}"
        text = term if not text else text + (f" - {term[1:]}" if term.startswith("-") else f" + {term}")
    return text


def _signed_sum(terms: list[tuple[str, str]]) -> str:
    first, *rest = terms
    return ("-" if first[0] == "-" else "") + first[1] + "".join(f" {sign} {name}" for sign, name in rest)
