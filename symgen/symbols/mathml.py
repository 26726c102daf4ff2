"""MathML by SymPy's printer, with our letters. Every name is escaped: none can bring in markup.

A formula is one <math> per term, so that a browser may break the line between terms. Parameters
carry their name in `data-p`.
"""

from __future__ import annotations

import re
from html import escape, unescape
from typing import Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE

from symgen.symbols import text, trees
from symgen.symbols.letters import DOTS, GREEK, letter
from symgen.symbols.trees import Tree

MINUS_SIGN = "−"
DOT = {"dot": "˙", "ddot": "¨"}
_ENTITY = re.compile(r"&(?!amp;|lt;|gt;|quot;|apos;)\w+;")  # which XML does not know


class MathML(str):
    """Markup that is complete and escaped; templates leave it as it is."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


class Presentation(MathMLPresentationPrinter):  # type: ignore[misc]
    """SymPy's presentation MathML with the subscripts of the literature."""

    def element(self, tag: str, *children: Any, **attributes: str) -> Any:
        """A node; texts among its children, and the values of attributes, are escaped."""
        made = self.dom.createElement(tag)
        for name, value in attributes.items():
            made.setAttribute(name, value)
        for x in children:
            made.appendChild(self.dom.createTextNode(escape(x)) if isinstance(x, str) else x)
        return made

    def _l_paren(self) -> Any:
        return self.element("mo", "(", stretchy="false")

    def _r_paren(self) -> Any:
        return self.element("mo", ")", stretchy="false")

    def row(self, *parts: Any) -> Any:
        """The parts side by side."""
        return parts[0] if len(parts) == 1 else self.element("mrow", *parts)

    def term(self, x: Tree, *, first: bool = True) -> Any:
        """A term of a sum with its sign; none before a first one that is added."""
        minus = trees.is_negative(x)
        inside = self._print(trees.negative(x) if minus else x)
        if first and not minus:
            return inside
        form = "prefix" if first else "infix"
        return self.row(self.element("mo", MINUS_SIGN if minus else "+", form=form), inside)

    def _print_Add(self, x: Tree, order: str | None = None) -> Any:
        return self.row(*(self.term(y, first=not k) for k, y in enumerate(x.args)))

    def _print_Mul(self, x: Tree) -> Any:
        if trees.is_negative(x):
            return self.term(x)
        number, _ = text.split_sign(x)
        if number == 1 and not all(y.is_Integer or y.free_symbols for y in x.args):
            return self.row(*super()._print_Mul(x).childNodes)  # pi/2
        parts: list[Any] = []
        for y in x.args:
            times = [self.element("mo", "\u2062"), self.element("mspace", width="0.14em")]
            if text.text(y)[0].isdigit():
                times = [self.element("mo", "·")]
            parts += [
                *(times if parts else ()),
                self.parenthesize(y, PRECEDENCE["Mul"], strict=True),
            ]
        return self.row(*parts)

    def _print_Symbol(self, x: Tree, **attributes: str) -> Any:
        stem, subscript = letter(x.name)
        if stem in DOTS:
            dots = self.element("mo", DOT[DOTS[stem]])
            base = self.element("mover", self.element("mi", "q"), dots, accent="true")
        else:
            shown = GREEK.get(stem, stem.replace("'", "\u2032"))
            base = self.element("mn" if stem[0].isdigit() else "mi", shown)
        if subscript:
            pieces = re.findall(rf"\d[\d,{MINUS_SIGN}]*|[^\d]+", subscript.replace("-", MINUS_SIGN))
            below = [self.element("mn" if p[0].isdigit() else "mi", p) for p in pieces]
            base = self.element("msub", base, self.row(*below))
        for name, value in attributes.items():
            base.setAttribute(name, value)
        return base

    def _print_Parameter(self, x: Tree) -> Any:
        return self._print_Symbol(x, **{"data-p": x.name})

    def _print_Rational(self, x: Tree) -> Any:
        digits = text.text(x)
        return super()._print_Rational(x) if "/" in digits else self.element("mn", digits)


_PRINTER = Presentation({"order": "none"})


def math(x: Tree) -> MathML:
    """An expression on its own."""
    return _markup(_PRINTER._print(x))


def terms(x: Tree) -> list[MathML]:
    """The terms of an expression in their order, one <math> each, with their signs."""
    return [_markup(_PRINTER.term(y, first=not k)) for k, y in enumerate(sympy.Add.make_args(x))]


def _markup(node: Any) -> MathML:
    inside = _ENTITY.sub(lambda match: unescape(match[0]), node.toxml())
    return MathML(f"<math>{inside}</math>")
