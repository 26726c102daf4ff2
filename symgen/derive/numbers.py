"""Robots in which decimal numbers stay symbols: 0.4318**2*M2 in place of 0.18645124*M2.

Lengths, gravity, mimic ratios and the rows of elements are polynomials in the constants of the
robot. A rational coefficient c of such a polynomial becomes sign(c) `Number(|c|)`, an atom (a
symbol that has this value), unless c is a small whole number. Equal numbers are one atom. An angle
written as a decimal and a fraction of pi with a large denominator become atoms too: exact
arithmetic treats 0.35 + 0.7 as the sum of two unrelated angles.

The atoms have two uses. The formulas look like the robot file. And coefficients are recognised as
functions of low degree at random values of the atoms, if the digits of a number are too long for
rational reconstruction. The recognised coefficients are then checked at the numbers themselves
(`certificate`).
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

from symgen.derive.angles import LARGEST_DENOMINATOR, atoms_of
from symgen.description.at_values import mapped
from symgen.description.expression import (
    Call,
    Expression,
    Number,
    call,
    quarter_turns,
)
from symgen.description.kinds import STATE
from symgen.description.robot import Robot

LARGEST_WHOLE = 12  # whole numbers up to here are counts (2, 4) rather than lengths


@lru_cache(maxsize=64)
def numbered(robot: Robot) -> Robot:
    """Replace each decimal number of a robot by a symbol, so that formulas keep it as written.

    The numbers are those of its lengths, gravity, joint relations, element rows and angles. If one
    relation between joints is put into another, the ratios stay numbers, because the angles of the
    joints need these ratios.
    """
    followed = {a for e in robot.constraints.values() for a in e.atoms}
    chained = any(f"q{j}" in followed for j in robot.constraints)
    result = mapped(robot, keep_rationals, kept_angle)
    if not chained:
        return result
    return replace(result, constraints={j: kept_angle(e) for j, e in robot.constraints.items()})


def keep_rationals(e: Expression) -> Expression:
    """Replace each rational coefficient of a polynomial by a symbol that has the same value.

    Coefficients inside square roots and inverses are replaced too. Whole numbers up to
    LARGEST_WHOLE stay numbers.
    """
    total = Expression()
    for m, c in e.terms.items():
        term = Expression({(): Fraction(1 if c > 0 else -1)}) * _atom(abs(c))
        for a, n in m:
            base = Expression({((a, 1),): Fraction(1)})
            if (
                isinstance(a, Call)
                and a.function in ("sqrt", "inv")
                and a.argument.constant is None
            ):
                base = call(a.function, keep_rationals(a.argument))
            term = term * base**n
        total = total + term
    return total


def kept_angle(e: Expression) -> Expression:
    """Replace decimal numbers in an angle, and fractions with a large denominator, by symbols.

    Quarter turns and the multiples of a joint angle stay numbers.
    """
    _, rest = quarter_turns(e)
    total = e - rest
    for m, c in rest.terms.items():
        term = Expression({m: c})
        joint = any(isinstance(a, str) and STATE.match(a) for a, _ in m)
        if not joint and (not m or c.denominator > LARGEST_DENOMINATOR):
            term = Expression({m: Fraction(1 if c > 0 else -1)}) * number_atom(abs(c))
        total = total + term
    return total


def number_atom(c: Fraction) -> Expression:
    """Return a positive number as an expression that consists of one symbol with this value."""
    return Expression({((Number(c), 1),): Fraction(1)})


def _atom(c: Fraction) -> Expression:
    if c.denominator == 1 and c.numerator <= LARGEST_WHOLE:
        return Expression.number(c)
    return number_atom(c)


def numbers_of(robot: Robot) -> tuple[Number, ...]:
    """Return the symbols that stand for numbers in the lengths, gravity, joint relations and
    elements (friction, springs, ...) of a robot, each once.
    """
    return tuple(dict.fromkeys(a for a in atoms_of(robot) if isinstance(a, Number)))
