"""SymPy expressions that stay as they are written: sums in their order, products factored.

SymPy's printers write them so with order="none"; `evaluated` makes ordinary objects of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import sympy

from symgen.description.expression import FUNCTIONS, ONE, Call, Expression, Monomial, Number
from symgen.regroup.formula import Formula
from symgen.regroup.regrouping import Regrouping

Tree = Any  # a SymPy expression that is not evaluated
DIGITS = 15
MINUS = sympy.S.NegativeOne


class Parameter(sympy.Symbol):  # type: ignore[misc]
    """A parameter in a formula, which MathML names in `data-p`."""

    __slots__ = ()


def symbol(name: str) -> Tree:
    """The real symbol of a name; pi is pi."""
    return sympy.pi if name == "pi" else sympy.Symbol(name, real=True)


def parameter(name: str) -> Tree:
    """The real symbol of a parameter."""
    return Parameter(name, real=True)


def rational(c: Fraction) -> Tree:
    """A number, exact."""
    return sympy.Rational(c.numerator, c.denominator)


def product(c: Fraction, factors: Iterable[Tree]) -> Tree:
    """c times the factors, with a minus in front of the whole product."""
    written = [f for f in factors if f != 1]
    if not written:
        return rational(c) if c.denominator == 1 else signed(c, power(Number(abs(c)), 1))
    if abs(c) != 1:
        written.insert(0, rational(abs(c)))
    return signed(c, sympy.Mul(*written, evaluate=False))


def signed(c: Fraction, x: Tree) -> Tree:
    """x with the sign of c."""
    return x if c > 0 else negative(x)


def negative(x: Tree) -> Tree:
    """-x, its order kept."""
    if x.is_Number:
        return -x
    return x.args[1] if is_negative(x) else sympy.Mul(MINUS, x, evaluate=False)


def is_negative(x: Tree) -> bool:
    """Whether x begins with a minus."""
    return bool(x.is_negative if x.is_Number else x.is_Mul and x.args[0] is MINUS)


def total(terms: Iterable[Tree]) -> Tree:
    """Sum of the terms in their order; terms of an inner sum stay together."""
    flat = [x for term in terms for x in (term.args if term.is_Add else (term,))]
    return sympy.Add(*flat, evaluate=False)


def expression(e: Expression) -> Tree:
    """A constant expression, or one linear in joint positions, in the order of its text."""
    return total(product(c, _factors(m)) for m, c in e.ordered)


def _factors(m: Monomial) -> list[Tree]:
    return [power(a, n) for a, n in m]


def power(a: str | Number | Call, n: int) -> Tree:
    """A symbol, a function, or a number as the robot file writes it, to the power n."""
    if isinstance(a, Number):
        base = sympy.Symbol(a.text)
    elif isinstance(a, str):
        base = symbol(a)
    elif a.function == "inv":
        base, n = expression(a.argument), -n
    else:
        base = getattr(sympy, a.function)(expression(a.argument), evaluate=False)
    return base if n == 1 else sympy.Pow(base, n, evaluate=False)


def function(op: str, operands: list[Tree]) -> Tree:
    """A function of expressions, by its name there."""
    return getattr(sympy, FUNCTIONS[op].sympy)(*operands, evaluate=False)


def formula(f: Formula) -> Tree:
    """A regrouping formula: parameters with one coefficient share it in brackets, as in eq. (27)."""
    terms = []
    for c, members in f.groups():
        first = members[0][0]
        inside = total(
            parameter(name) if added == first else negative(parameter(name))
            for added, name in members
        )
        c = c if first else -c
        if c in (ONE, -ONE):
            terms += [x if c == ONE else negative(x) for x in sympy.Add.make_args(inside)]
        elif len(c.terms) == 1:
            ((m, number),) = c.terms.items()
            terms.append(product(number, [*_factors(m), inside]))
        else:
            terms.append(product(Fraction(1), [expression(c), inside]))
    return total(terms)


def angle(letter: str, e: Expression) -> Tree:
    """The cosine (C) or sine (S) of an angle."""
    return (sympy.cos if letter == "C" else sympy.sin)(expression(e), evaluate=False)


def equation(left: Tree, right: Tree) -> Tree:
    """left = right."""
    return sympy.Eq(left, right, evaluate=False)


def evaluated(x: Tree, values: Mapping[str, Any]) -> Any:
    """The same as an ordinary object of SymPy, with `values` in the place of some symbols."""
    if x.args:
        return x.func(*(evaluated(y, values) for y in x.args))
    if not x.is_Symbol:
        return x
    if not x.name[0].isidentifier():
        return sympy.Rational(x.name.strip("()"))
    return values.get(x.name, symbol(x.name))


def in_decimals(regrouping: Regrouping) -> Regrouping:
    """The same formulas to be read: each coefficient without a symbol as a decimal of DIGITS digits."""

    def rounded(c: Expression) -> Expression:
        digits = sympy.N(evaluated(expression(c), {}), DIGITS)
        return c if c.symbols else Expression.number(str(digits))

    base = (
        replace(b, combination={name: rounded(c) for name, c in b.combination.items()})
        for b in regrouping.base
    )
    steps = ((source, target, rounded(c)) for source, target, c in regrouping.steps)
    return replace(regrouping, base=tuple(base), steps=tuple(steps))


def size(x: Tree) -> int:
    """Terms as they are written."""
    if x.is_Add:
        return sum(map(size, x.args))
    return 1 + sum(size(y) - 1 for y in x.args) if x.is_Mul else 1
