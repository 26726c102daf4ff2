"""Formulas in MathML. Every piece is made by `element`, which escapes whatever is not MathML already: no name can bring in markup.

A formula is one <math> per term, so that a browser may break the line between terms. Parameters carry their name in `data-p`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from html import escape

from symgen.description.expression import ONE, Call, Expression, decimal
from symgen.regroup.regrouping import shared
from symgen.report.symbols import GREEK, symbol

MINUS = "−"


class MathML(str):
    """Markup that is complete and escaped; templates leave it as it is."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def element(tag: str, *children: str, **attributes: str) -> MathML:
    """<tag attributes>children</tag>; text children and attribute values are escaped, `data_p` is written data-p."""
    inside = "".join(c if isinstance(c, MathML) else escape(c) for c in children)
    given = "".join(f' {name.replace("_", "-")}="{escape(value)}"' for name, value in attributes.items())
    return MathML(f"<{tag}{given}>{inside}</{tag}>")


THIN = element("mspace", width="0.14em")
TIMES = (element("mo", "\u2062"), THIN)


def formula(combination: Mapping[str, Expression]) -> list[MathML]:
    """The terms of a regrouping formula in the order of the text, one <math> each, from the second on with their sign."""
    terms: list[MathML] = []
    for c, names in shared(combination).items():
        if c in (ONE, -ONE):
            for n in names:
                terms.append(_signed((c == ONE) != n.startswith("-"), [parameter(n.lstrip("-"))], not terms))
            continue
        negative = len(c.terms) == 1 and next(iter(c.terms.values())) < 0
        factor = expression(-c if negative else c)
        parts = [factor if len(c.terms) == 1 else _bracketed(factor)]
        several = row(_sum(names))
        parts += [*TIMES, _bracketed(several) if len(names) > 1 else several]
        terms.append(_signed(not negative, parts, not terms))
    return terms


def row(parts: list[MathML]) -> MathML:
    """The parts side by side."""
    return parts[0] if len(parts) == 1 else element("mrow", *parts)


def math(content: MathML) -> MathML:
    """A formula on its own."""
    return element("math", content)


def parameter(name: str) -> MathML:
    """A standard or base parameter that can be pointed at."""
    return _subscripted(name, data_p=name)


def name(text: str) -> MathML:
    """Any other symbol."""
    return _subscripted(text)


def expression(e: Expression) -> MathML:
    """A constant expression, or one linear in joint positions."""
    parts: list[MathML] = []
    for m, c in e.terms.items():
        if c < 0:
            parts.append(element("mo", MINUS, form="infix" if parts else "prefix"))
        elif parts:
            parts.append(element("mo", "+", form="infix"))
        parts.append(_term(m, abs(c)))
    return row(parts) if parts else element("mn", "0")


def _signed(positive: bool, parts: list[MathML], first: bool) -> MathML:
    sign = [] if first and positive else [element("mo", "+" if positive else MINUS, form="prefix" if first else "infix")]
    return element("math", row([*sign, *parts]))


def _sum(names: list[str]) -> list[MathML]:
    parts: list[MathML] = []
    for n in names:
        if n.startswith("-") or parts:
            parts.append(element("mo", MINUS if n.startswith("-") else "+", form="infix" if parts else "prefix"))
        parts.append(parameter(n.lstrip("-")))
    return parts


def _bracketed(inner: MathML) -> MathML:
    return element("mrow", element("mo", "("), inner, element("mo", ")"))


def _subscripted(text: str, **attributes: str) -> MathML:
    letter, subscript = symbol(text)
    base = GREEK.get(letter, letter)
    if not subscript:
        return element("mi", base, **attributes)
    pieces = [element("mn" if p.isdigit() else "mi", p) for p in re.findall(r"\d+|\D+", subscript)]
    return element("msub", element("mi", base), row(pieces), **attributes)


def _term(m: tuple[tuple[str | Call, int], ...], c: Fraction) -> MathML:
    up = [_power(a, n) for a, n in m if n > 0 and not _inverse(a)]
    down = [_power(a, -n) for a, n in m if n < 0] + [_power(a, n) for a, n in m if n > 0 and _inverse(a)]
    top, _, bottom = decimal(c).partition("/")
    if bottom:
        down.insert(0, element("mn", bottom))
    if top != "1" or not up:
        up.insert(0, element("mn", top))
    over = row(_product(up))
    return element("mfrac", over, row(_product(down))) if down else over


def _inverse(a: str | Call) -> bool:
    return isinstance(a, Call) and a.function == "inv"


def _product(factors: list[MathML]) -> list[MathML]:
    return [x for f in factors for x in (*TIMES, f)][len(TIMES) :]


def _power(a: str | Call, n: int) -> MathML:
    if isinstance(a, str):
        base = name(a)
    elif a.function == "sqrt":
        base = element("msqrt", expression(a.argument))
    elif a.function == "inv":
        base = _bracketed(expression(a.argument))
    else:
        head = element("mi", a.function)
        head = element("msup", head, element("mn", str(n))) if n != 1 else head
        argument = expression(a.argument)
        return element("mrow", head, element("mo", "\u2061"), THIN, argument if _simple(a.argument) else _bracketed(argument))
    return base if n == 1 else element("msup", base, element("mn", str(n)))


def _simple(e: Expression) -> bool:
    return e in map(Expression.symbol, e.symbols)
