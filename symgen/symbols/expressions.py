"""SymPy expressions that SymPy does not rearrange: sums stay in their order, products factored.

SymPy's printers print them unchanged with order="none". `evaluated` converts them to ordinary SymPy
objects.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import sympy

from symgen.description.expression import FUNCTIONS, ONE, Call, Expression, Monomial, Number
from symgen.regroup.regrouping import Formula, Regrouping

Tree = Any  # a SymPy expression that is not evaluated
DIGITS = 15
MINUS = sympy.S.NegativeOne


class Parameter(sympy.Symbol):  # type: ignore[misc]
    """Symbol of a parameter in a formula; MathML marks it with the attribute `data-p`."""

    __slots__ = ()


def symbol(name: str) -> Tree:
    """Make a SymPy symbol (a real variable) from a name; the name pi gives the number pi."""
    return sympy.pi if name == "pi" else sympy.Symbol(name, real=True)


def parameter(name: str) -> Tree:
    """Make a SymPy symbol (a real variable) from the name of a parameter."""
    return Parameter(name, real=True)


def rational(c: Fraction) -> Tree:
    """Convert a fraction to an exact SymPy number."""
    return sympy.Rational(c.numerator, c.denominator)


def product(c: Fraction, factors: Iterable[Tree]) -> Tree:
    """Multiply the number c by the factors; a minus sign stays in front of the whole product."""
    written = [f for f in factors if f != 1]
    if not written:
        number = Number(abs(c))
        return signed(c, power(number, 1)) if "." in number.text else rational(c)
    if abs(c) != 1:
        written.insert(0, rational(abs(c)))
    return signed(c, sympy.Mul(*written, evaluate=False))


def signed(c: Fraction, x: Tree) -> Tree:
    """Return x if c is positive, else -x."""
    return x if c > 0 else negative(x)


def negative(x: Tree) -> Tree:
    """Negate x without changing the order of its factors."""
    if x.is_Number:
        return -x
    if is_negative(x):
        first, *rest = x.args
        factors = rest if first is MINUS else (-first, *rest)
        return sympy.Mul(*factors, evaluate=False) if len(factors) > 1 else factors[0]
    return sympy.Mul(MINUS, x, evaluate=False)


def is_negative(x: Tree) -> bool:
    """Whether the printed form of x starts with a minus sign."""
    first = x.args[0] if x.is_Mul else x
    return bool(first.is_Number and first.is_negative)


def total(terms: Iterable[Tree]) -> Tree:
    """Add the terms in their order. A term that is itself a sum is added term by term."""
    flat = [x for term in terms for x in (term.args if term.is_Add else (term,))]
    return sympy.Add(*flat, evaluate=False)


def expression(e: Expression) -> Tree:
    """Convert an expression that is constant, or linear in joint positions, to a SymPy expression.

    The order of its terms is the order of its printed text.
    """
    return total(product(c, _factors(m)) for m, c in e.ordered)


def _factors(m: Monomial) -> list[Tree]:
    return [power(a, n) for a, n in m]


def power(a: str | Number | Call, n: int) -> Tree:
    """Raise a symbol, a function, or a number to the power n.

    A number is written as in the robot file.
    """
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
    """Apply a function to SymPy expressions; `op` is the name of the function in robot files."""
    return getattr(sympy, FUNCTIONS[op].sympy)(*operands, evaluate=False)


def formula(f: Formula) -> Tree:
    """Convert the regrouping formula of a base parameter to a SymPy expression.

    Parameters with the same coefficient share it in brackets, as in eq. (27).
    """
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
    """Return the cosine (letter C) or the sine (letter S) of angle e in SymPy, without evaluating
    it.
    """
    return (sympy.cos if letter == "C" else sympy.sin)(expression(e), evaluate=False)


def equation(left: Tree, right: Tree) -> Tree:
    """Make the SymPy equation left = right without evaluating it."""
    return sympy.Eq(left, right, evaluate=False)


def evaluated(x: Tree, values: Mapping[str, Any]) -> Any:
    """Convert an expression to an ordinary, evaluated SymPy object.

    `values` replace some of its symbols, by name.
    """
    if x.args:
        return x.func(*(evaluated(y, values) for y in x.args))
    if not x.is_Symbol:
        return x
    if not x.name[0].isidentifier():
        return sympy.Rational(x.name.strip("()"))
    return values.get(x.name, symbol(x.name))


def in_decimals(regrouping: Regrouping) -> Regrouping:
    """Convert the numerical coefficients of the regrouping formulas to decimals, for display.

    The decimals have 15 digits. Coefficients that contain symbols are not changed.
    """

    base = (
        replace(b, combination={name: rounded(c) for name, c in b.combination.items()})
        for b in regrouping.base
    )
    steps = ((source, target, rounded(c)) for source, target, c in regrouping.steps)
    return replace(regrouping, base=tuple(base), steps=tuple(steps))


def rounded(c: Expression, digits: int = DIGITS) -> Expression:
    """Convert an expression without symbols to a decimal number; others are not changed."""
    if c.symbols:
        return c
    return Expression.number(str(sympy.N(evaluated(expression(c), {}), digits)))


def size(x: Tree) -> int:
    """Count the terms of a SymPy expression as it is written, without multiplying out products."""
    if x.is_Add:
        return sum(map(size, x.args))
    return 1 + sum(size(y) - 1 for y in x.args) if x.is_Mul else 1
