"""Closed forms as text in the grammar of robot files, and what all printers share."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import sympy
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from symgen.description.expression import decimal
from symgen.symbols.trees import Tree


def split_sign(x: Tree) -> tuple[Any, Tree]:
    """(number, rest) of a product whose number stands before it: -1, or a fraction; else (1, x)."""
    number, rest = x.as_coeff_Mul()
    before = number == -1 or (not number.is_Integer and rest.free_symbols)
    return (number, rest) if before else (sympy.S.One, x)


class Ordered:
    """Products with their minus and fraction before them, decimals as decimals.

    A subclass says what stands between factors, and before one that begins with a digit.
    """

    times = visible = "*"

    def _print_Mul(self, x: Tree) -> str:
        number, rest = split_sign(x)
        if number == 1:
            return str(super()._print_Mul(x))  # type: ignore[misc]
        inside = self.parenthesize(rest, PRECEDENCE["Mul"], strict=True)  # type: ignore[attr-defined]
        if number == -1:
            return f"-{inside}"
        times = self.visible if inside[0].isdigit() else self.times
        return f"{self._print_Rational(number)}{times}{inside}"

    def _print_Rational(self, x: Tree) -> str:
        text = decimal(Fraction(x.p, x.q))
        return str(super()._print_Rational(x)) if "/" in text else text  # type: ignore[misc]


class Grammar(Ordered, StrPrinter):  # type: ignore[misc]
    """The grammar of robot files."""


_PRINTER = Grammar({"order": "none"})


def text(x: Tree) -> str:
    """An expression in the grammar of robot files."""
    return str(_PRINTER.doprint(x))
