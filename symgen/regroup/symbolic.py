"""Regrouping formulas as sympy expressions, for whoever wants to go on computing with them.

The derivation itself needs no computer algebra: this is the way out of it, and sympy is imported on first use.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from symgen.description.expression import Expression
from symgen.regroup.regrouping import Regrouping


def as_sympy(e: Expression) -> Any:
    """The same expression in sympy: exact rationals, constants as real symbols."""
    import sympy

    def number(c: Fraction) -> Any:
        return sympy.Rational(c.numerator, c.denominator)

    def symbol(name: str) -> Any:
        return sympy.pi if name == "pi" else sympy.Symbol(name, real=True)

    def function(name: str, argument: Expression) -> Any:
        x = as_sympy(argument)
        return 1 / x if name == "inv" else getattr(sympy, name)(x)

    return e.evaluate(symbol, function, number)


def sympy_formulas(regrouping: Regrouping) -> dict[str, Any]:
    """{base parameter: sympy expression in the standard parameters}."""
    import sympy

    return {b.name: sympy.Add(*(as_sympy(c) * sympy.Symbol(name, real=True) for name, c in b.combination.items())) for b in regrouping.base}
