"""A robot whose numbers are kept as written: 0.4318 becomes an atom of the formulas, 0.4318**2*M2 in place of 0.18645124*M2.

Lengths, gravity, mimic ratios and the rows of elements are polynomials over constants; each rational coefficient c of theirs that is no small whole number becomes sign(c) `Number(|c|)`. Equal numbers are one atom. So does a decimal angle, and a fraction of pi with a large denominator: 0.35 + 0.7 is a sum of two angles that exact arithmetic takes for any two. The atoms have two uses: formulas read like the robot file, and coefficients are recognised at random values of the atoms, as functions of low degree, where the digits of a number are too long for rational reconstruction. What is recognised is then checked at the numbers themselves (`certificate`).
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
    """`robot` with the numbers of its lengths, gravity, ratios, element rows and angles as `Number` atoms.

    Ratios as they are where one relation is put into another, whose angles need them.
    """
    followed = {a for e in robot.constraints.values() for a in e.atoms}
    chained = any(f"q{j}" in followed for j in robot.constraints)
    result = mapped(robot, keep_rationals, kept_angle)
    if not chained:
        return result
    return replace(result, constraints={j: kept_angle(e) for j, e in robot.constraints.items()})


def keep_rationals(e: Expression) -> Expression:
    """The same polynomial with its rational coefficients as atoms, those inside square roots and inverses too."""
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
    """The same angle with its decimals as atoms, and its fractions of pi with a large denominator.

    A joint's ratio stays a number.
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
    """A positive number as an atom."""
    return Expression({((Number(c), 1),): Fraction(1)})


def _atom(c: Fraction) -> Expression:
    if c.denominator == 1 and c.numerator <= LARGEST_WHOLE:
        return Expression.number(c)
    return number_atom(c)


def numbers_of(robot: Robot) -> tuple[Number, ...]:
    """The Number atoms of a robot made by `numbered`, in the order of the file."""
    return tuple(dict.fromkeys(a for a in atoms_of(robot) if isinstance(a, Number)))
