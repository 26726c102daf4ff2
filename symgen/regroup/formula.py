"""Formulas: sums of parameters with coefficients in Q(geometry). They stay expressions until they
are written: as plain text or Python here, by the printers of SymPy in `symbols`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from symgen.description.expression import ONE, Call, Expression, Monomial, Number, decimal

Signed = tuple[bool, str]  # whether a term is added, and the term


@dataclass(frozen=True)
class Formula:
    """sum_k c_k chi_k.

    Attributes
    ----------
    combination : mapping
        Coefficient c_k, a constant expression, of each parameter chi_k, in the order of the text.
    """

    combination: Mapping[str, Expression]

    def __str__(self) -> str:
        return Plain().formula(self)

    def groups(self) -> list[tuple[Expression, list[Signed]]]:
        """Coefficients with the parameters that share one, as in eq. (27); those with the opposite
        one are subtracted.
        """
        groups: dict[Expression, list[Signed]] = {}
        for name, c in self.combination.items():
            key = -c if -c in groups and c not in groups else c
            groups.setdefault(key, []).append((key == c, name))
        return list(groups.items())

    def mapping(self) -> dict[str, Any]:
        """The formula in JSON: its text and its terms."""
        return {
            "formula": str(self),
            "terms": [
                {"parameter": name, "coefficient": str(c)} for name, c in self.combination.items()
            ],
        }

    def to_sympy(self) -> Any:
        """The formula as a sympy expression: exact rationals, real symbols under the names of the
        robot file. Imports sympy.
        """
        total: Any = 0
        for name, c in self.combination.items():
            total = total + sympy_expression(c) * sympy_expression(Expression.symbol(name))
        return total


def sympy_expression(e: Expression, known: Mapping[str, Any] | None = None) -> Any:
    """An expression in sympy: exact rationals, pi, real symbols; `known` are the values of some
    names. Imports sympy.
    """
    import sympy

    def symbol(name: str) -> Any:
        if known and name in known:
            return known[name]
        return sympy.pi if name == "pi" else sympy.Symbol(name, real=True)

    def factor(a: str | Number | Call) -> Any:
        if isinstance(a, str):
            return symbol(a)
        if isinstance(a, Number):
            return sympy.Rational(a.value.numerator, a.value.denominator)
        x = sympy_expression(a.argument, known)
        return 1 / x if a.function == "inv" else getattr(sympy, a.function)(x)

    terms = (
        sympy.Mul(sympy.Rational(c.numerator, c.denominator), *(factor(a) ** n for a, n in m))
        for m, c in e.terms.items()
    )
    return sympy.Add(*terms)


class Plain:
    """The grammar of robot files. A subclass says how symbols, functions and powers are written."""

    def formula(self, f: Formula) -> str:
        """The whole formula: parameters with coefficient 1 one by one, the others with the
        coefficient that they share.
        """
        terms: list[Signed] = []
        for c, members in f.groups():
            if c in (ONE, -ONE):
                terms += [((c == ONE) == added, name) for added, name in members]
                continue
            added = len(c.terms) > 1 or min(c.terms.values()) > 0
            factor = self.expression(c if added else -c)
            if len(c.terms) > 1:
                factor = f"({factor})"
            inside = _sum(members)
            terms.append(
                (added, f"{factor}*({inside})" if len(members) > 1 else f"{factor}*{inside}")
            )
        return _sum(terms)

    def expression(self, e: Expression) -> str:
        """A constant expression, or one linear in joint positions."""
        return _sum([(c > 0, self._term(m, abs(c))) for m, c in e.ordered]) if e else "0"

    def _term(self, m: Monomial, c: Fraction) -> str:
        up: list[str] = []
        down: list[str] = []
        for a, n in m:
            inverse = isinstance(a, Call) and a.function == "inv"
            (up if (n > 0) != inverse else down).append(self._power(a, abs(n)))
        top, _, bottom = decimal(c).partition("/")
        if bottom:
            down.insert(0, bottom)
        if top != "1" or not up:
            up.insert(0, top)
        return "/".join(["*".join(up), *down])

    def _power(self, a: str | Number | Call, n: int) -> str:
        if isinstance(a, Number):
            base = a.text
        elif isinstance(a, str):
            base = self.symbol(a)
        elif a.function == "inv":
            base = f"({self.expression(a.argument)})"
        else:
            base = self.call(a.function, a.argument)
        return base if n == 1 else f"{base}**{n}"

    def symbol(self, name: str) -> str:
        """A constant, a joint position or pi."""
        return name

    def call(self, function: str, argument: Expression) -> str:
        """cos, sin or sqrt of an expression."""
        return f"{function}({self.expression(argument)})"


class Python(Plain):
    """Python with the functions of an array package.

    package : name of the package. lift : text before the argument of a function, "zero + " where a
    package takes arrays alone.
    """

    def __init__(self, package: str, lift: str = "") -> None:
        self.package, self.lift = package, lift

    def symbol(self, name: str) -> str:
        return f"{self.package}.pi" if name == "pi" else name

    def call(self, function: str, argument: Expression) -> str:
        return f"{self.package}.{function}({self.lift}{self.expression(argument)})"


def _sum(terms: Sequence[Signed]) -> str:
    (added, first), *rest = terms
    return (
        ("" if added else "-")
        + first
        + "".join(f" {'+' if added else '-'} {term}" for added, term in rest)
    )
