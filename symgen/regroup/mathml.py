"""Formulas in MathML. Every piece is made by `element`, which escapes whatever is not MathML already: no name can bring in markup.

A formula is one <math> per term, so that a browser may break the line between terms. Parameters carry their name in `data-p`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

from symgen.description.expression import Expression
from symgen.regroup.formula import Formula, Printer, Signed
from symgen.regroup.symbols import GREEK, symbol

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


class MathMLPrinter(Printer[MathML]):
    """Presentation MathML without the <math> around it."""

    def symbol(self, name: str) -> MathML:
        return _subscripted(name)

    def parameter(self, name: str) -> MathML:
        return _subscripted(name, data_p=name)

    def number(self, digits: str) -> MathML:
        return element("mn", digits)

    def call(self, function: str, argument: Expression, n: int) -> MathML:
        inside = self.expression(argument)
        if function == "sqrt":
            return element("msqrt", inside) if n == 1 else self.raised(element("msqrt", inside), n)
        head = element("mi", function) if n == 1 else self.raised(element("mi", function), n)
        simple = argument in map(Expression.symbol, argument.symbols)
        return element("mrow", head, element("mo", "\u2061"), THIN, inside if simple else self.bracketed(inside))

    def raised(self, base: MathML, n: int) -> MathML:
        return element("msup", base, self.number(str(n)))

    def bracketed(self, inside: MathML) -> MathML:
        return element("mrow", element("mo", "("), inside, element("mo", ")"))

    def product(self, factors: Sequence[MathML]) -> MathML:
        return row([x for f in factors for x in (*TIMES, f)][len(TIMES) :])

    def quotient(self, up: Sequence[MathML], down: Sequence[MathML]) -> MathML:
        return element("mfrac", self.product(up), self.product(down))

    def sum(self, terms: Sequence[Signed[MathML]]) -> MathML:
        return row([piece for k, (added, term) in enumerate(terms) for piece in (*_sign(added, not k), term)])


PRINTER = MathMLPrinter()
parameter = PRINTER.parameter
name = PRINTER.symbol
expression = PRINTER.expression


def formula(f: Formula) -> list[MathML]:
    """The terms of a formula in the order of the text, one <math> each, from the second on with their sign."""
    return signed_terms(PRINTER.terms(f))


def signed_terms(terms: Sequence[Signed[MathML]]) -> list[MathML]:
    """Terms, one <math> each, so that a browser may break the line between them."""
    return [math(row([*_sign(added, not k), term])) for k, (added, term) in enumerate(terms)]


def row(parts: Sequence[MathML]) -> MathML:
    """The parts side by side."""
    return parts[0] if len(parts) == 1 else element("mrow", *parts)


def math(content: MathML) -> MathML:
    """A formula on its own."""
    return element("math", content)


def _sign(added: bool, first: bool) -> list[MathML]:
    return [] if first and added else [element("mo", "+" if added else MINUS, form="prefix" if first else "infix")]


def _subscripted(text: str, **attributes: str) -> MathML:
    letter, subscript = symbol(text)
    base = GREEK.get(letter, letter)
    if not subscript:
        return element("mi", base, **attributes)
    pieces = [element("mn" if p.isdigit() else "mi", p) for p in re.findall(r"\d+|\D+", subscript)]
    return element("msub", element("mi", base), row(pieces), **attributes)
