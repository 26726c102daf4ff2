"""Formulas: sums of parameters with coefficients in Q(geometry). They stay expressions until a printer writes them.

A `Printer` walks a formula or a constant expression once and asks a language for its symbols, functions, powers, products, quotients and sums.
Plain text and Python are printed by the classes of this module, LaTeX by `latex`, MathML by `mathml`, a coloured terminal by the command line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic, TypeVar

from symgen.description.expression import ONE, Call, Expression, Monomial, Number, decimal

T = TypeVar("T")
Signed = tuple[bool, T]  # whether a term is added, and the term


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

    def groups(self) -> list[tuple[Expression, list[Signed[str]]]]:
        """Coefficients with the parameters that share one, as in eq. (27); those with the opposite one are subtracted."""
        groups: dict[Expression, list[Signed[str]]] = {}
        for name, c in self.combination.items():
            key = -c if -c in groups and c not in groups else c
            groups.setdefault(key, []).append((key == c, name))
        return list(groups.items())

    def mapping(self) -> dict[str, Any]:
        """The formula in JSON: its text and its terms."""
        return {"formula": str(self), "terms": [{"parameter": name, "coefficient": str(c)} for name, c in self.combination.items()]}

    def to_sympy(self) -> Any:
        """The formula as a sympy expression: exact rationals, real symbols under the names of the robot file. Imports sympy."""
        total: Any = 0
        for name, c in self.combination.items():
            total = total + sympy_expression(c) * sympy_expression(Expression.symbol(name))
        return total


def sympy_expression(e: Expression, known: Mapping[str, Any] | None = None) -> Any:
    """An expression in sympy: exact rationals, pi, real symbols; `known` are the values of some names. Imports sympy."""
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

    terms = (sympy.Mul(sympy.Rational(c.numerator, c.denominator), *(factor(a) ** n for a, n in m)) for m, c in e.terms.items())
    return sympy.Add(*terms)


class Printer(Generic[T]):
    """One language for formulas. A subclass says how its smallest pieces are written and how pieces are put together."""

    def formula(self, f: Formula) -> T:
        """The whole formula."""
        return self.sum(self.terms(f))

    def terms(self, f: Formula) -> list[Signed[T]]:
        """The terms outside brackets: parameters with coefficient 1 one by one, the others with the coefficient that they share."""
        terms: list[Signed[T]] = []
        for c, members in f.groups():
            inside = [(added, self.parameter(name)) for added, name in members]
            if c in (ONE, -ONE):
                terms += [((c == ONE) == added, piece) for added, piece in inside]
                continue
            added = len(c.terms) > 1 or min(c.terms.values()) > 0
            factor = self.expression(c) if added else self.expression(-c)
            pieces = [factor if len(c.terms) == 1 else self.bracketed(factor)]
            pieces.append(self.bracketed(self.sum(inside)) if len(inside) > 1 else inside[0][1])
            terms.append((added, self.product(pieces)))
        return terms

    def expression(self, e: Expression) -> T:
        """A constant expression, or one linear in joint positions."""
        return self.sum([(c > 0, self._term(m, abs(c))) for m, c in e.ordered]) if e else self.number("0")

    def _term(self, m: Monomial, c: Fraction) -> T:
        up: list[T] = []
        down: list[T] = []
        for a, n in m:
            inverse = isinstance(a, Call) and a.function == "inv"
            (up if (n > 0) != inverse else down).append(self._power(a, abs(n)))
        top, _, bottom = self.ratio(c).partition("/")
        if bottom:
            down.insert(0, self.number(bottom))
        if top != "1" or not up:
            up.insert(0, self.number(top))
        return self.quotient(up, down) if down else self.product(up)

    def _power(self, a: str | Number | Call, n: int) -> T:
        if isinstance(a, Call) and a.function != "inv":
            return self.call(a.function, a.argument, n)
        if isinstance(a, Number):
            top, _, bottom = decimal(a.value).partition("/")
            base = self.bracketed(self.quotient([self.number(top)], [self.number(bottom)])) if bottom else self.number(top)
            return base if n == 1 else self.raised(base, n)
        base = self.symbol(a) if isinstance(a, str) else self.bracketed(self.expression(a.argument))
        return base if n == 1 else self.raised(base, n)

    def ratio(self, c: Fraction) -> str:
        """A positive rational as a decimal or as p/q."""
        return decimal(c)

    def parameter(self, name: str) -> T:
        """A standard or base parameter."""
        return self.symbol(name)

    def symbol(self, name: str) -> T:
        """A constant, a joint position or pi."""
        raise NotImplementedError

    def number(self, digits: str) -> T:
        raise NotImplementedError

    def call(self, function: str, argument: Expression, n: int) -> T:
        """cos, sin or sqrt of an expression to the power n."""
        raise NotImplementedError

    def raised(self, base: T, n: int) -> T:
        raise NotImplementedError

    def bracketed(self, inside: T) -> T:
        raise NotImplementedError

    def product(self, factors: Sequence[T]) -> T:
        raise NotImplementedError

    def quotient(self, up: Sequence[T], down: Sequence[T]) -> T:
        raise NotImplementedError

    def sum(self, terms: Sequence[Signed[T]]) -> T:
        raise NotImplementedError


class Lines(Printer[str]):
    """Languages whose pieces are strings."""

    def number(self, digits: str) -> str:
        return digits

    def sum(self, terms: Sequence[Signed[str]]) -> str:
        (added, first), *rest = terms
        return ("" if added else "-") + first + "".join(f" {'+' if added else '-'} {term}" for added, term in rest)


class Plain(Lines):
    """The grammar of robot files."""

    def symbol(self, name: str) -> str:
        return name

    def call(self, function: str, argument: Expression, n: int) -> str:
        text = f"{function}({self.expression(argument)})"
        return text if n == 1 else self.raised(text, n)

    def raised(self, base: str, n: int) -> str:
        return f"{base}**{n}"

    def bracketed(self, inside: str) -> str:
        return f"({inside})"

    def product(self, factors: Sequence[str]) -> str:
        return "*".join(factors)

    def quotient(self, up: Sequence[str], down: Sequence[str]) -> str:
        return "/".join(["*".join(up), *down])


class Python(Plain):
    """Python with the functions of an array package.

    package : name of the package. lift : text before the argument of a function, "zero + " where a package takes arrays alone.
    """

    def __init__(self, package: str, lift: str = "") -> None:
        self.package, self.lift = package, lift

    def symbol(self, name: str) -> str:
        return f"{self.package}.pi" if name == "pi" else name

    def call(self, function: str, argument: Expression, n: int) -> str:
        text = f"{self.package}.{function}({self.lift}{self.expression(argument)})"
        return text if n == 1 else self.raised(text, n)
