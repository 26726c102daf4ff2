"""Formulas in LaTeX, with the subscripts of the literature: ZZ1R is ZZ_{1R}, Ia1 is I_{a1}, FV2 is F_{v2}."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

from symgen.description.expression import Expression
from symgen.regroup.formula import Formula, Lines
from symgen.regroup.symbols import symbol

GREEK = re.compile(r"(alpha|beta|gamma|delta|theta|phi|psi)")


class Latex(Lines):
    """LaTeX, fractions as \\frac."""

    def symbol(self, name: str) -> str:
        return r"\pi" if name == "pi" else self.parameter(name)

    def parameter(self, name: str) -> str:
        letter, subscript = symbol(name)
        text = GREEK.sub(r"\\\1 ", letter).replace("_", r"\_").strip()
        return f"{text}_{{{subscript}}}" if subscript else text

    def ratio(self, c: Fraction) -> str:
        return str(c)

    def call(self, function: str, argument: Expression, n: int) -> str:
        inside = self.expression(argument)
        if function == "sqrt":
            return rf"\sqrt{{{inside}}}" if n == 1 else self.raised(rf"\sqrt{{{inside}}}", n)
        return (rf"\{function}" if n == 1 else self.raised(rf"\{function}", n)) + self.bracketed(inside)

    def raised(self, base: str, n: int) -> str:
        return f"{base}^{{{n}}}"

    def bracketed(self, inside: str) -> str:
        return rf"\left({inside}\right)"

    def product(self, factors: Sequence[str]) -> str:
        return r"\,".join(factors)

    def quotient(self, up: Sequence[str], down: Sequence[str]) -> str:
        return rf"\frac{{{self.product(up)}}}{{{' '.join(down)}}}"


def aligned(formulas: Iterable[tuple[str, Formula]]) -> str:
    r"""An `aligned` environment of the definitions (name, formula): ZZ_{1R} &= ZZ_{1} + I_{a1} + ..."""
    latex = Latex()
    rows = [rf"{latex.parameter(name)} &= {latex.formula(formula)} \\" for name, formula in formulas]
    return "\n".join([r"\begin{aligned}", *rows, r"\end{aligned}"])
