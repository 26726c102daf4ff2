"""Constants of a robot as variables of exact arithmetic: fixed angles, square roots, decimal numbers.

Angles. A fraction of pi with a moderate denominator is a whole multiple of pi/D, which is a root of
unity of the field F_p of integers modulo a prime p. Every other fixed angle is a sum of monomials
in constants and in numbers kept as written. All multiples of one monomial are whole multiples of a
unit angle, which is drawn at random: cosines and sines of such angles satisfy no polynomial
equation with algebraic coefficients, because radians and multiples of constants are transcendental.

Numbers. Decimal numbers stay symbols: 0.4318**2*M2 in place of 0.18645124*M2. Lengths, gravity,
mimic ratios and the rows of elements are polynomials in the constants of the robot. A rational
coefficient c of such a polynomial becomes sign(c) `Number(|c|)`, an atom (a symbol that has this
value), unless c is a small whole number. Equal numbers are one atom. An angle written as a decimal
and a fraction of pi with a large denominator become atoms too: exact arithmetic treats 0.35 + 0.7
as the sum of two unrelated angles.

The atoms have two uses. The formulas look like the robot file. And coefficients are recognised as
functions of low degree at random values of the atoms, if the digits of a number are too long for
rational reconstruction. The recognised coefficients are then checked at the numbers themselves
(`certificate`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from math import gcd, lcm

from symgen.description.element import STATE, varies
from symgen.description.expression import Call, Expression, Monomial, Number, call, quarter_turns
from symgen.description.robot import REVOLUTE, Robot
from symgen.description.values import mapped

PI: Monomial = (("pi", 1),)
# roots of larger primes are drawn by themselves: their fields share nothing with angles of small denominator
LARGEST_RADICAND = 100
LARGEST_DENOMINATOR = 360  # of a fraction of pi
LARGEST_ORDER = 100_000  # of all of them together
Unit = tuple[Monomial, Fraction]  # the angle fraction * monomial
# what a geometry may give: a constant, "pi", a number, a square root, a unit angle
Variable = str | Number | Call | Unit


def fixed_angles(robot: Robot) -> tuple[Expression, ...]:
    """Return the constant angles of a robot, such as alpha, after removal of whole quarter turns.

    An angle and its opposite count once. An angle that is only a number of quarter turns is left
    out.
    """
    angles: dict[Expression, None] = {}
    for e in _angles(robot):
        rest = quarter_turns(e)[1]
        if rest and -rest not in angles:
            angles[rest] = None
    return tuple(angles)


class Units:
    """Unit angles of a robot, such as pi/12: each constant angle of the robot is a sum of whole
    multiples of unit angles.

    The first unit angle is pi/D. D is the common denominator of the fractions of pi with a moderate
    denominator and of the angles that the square roots need.
    """

    def __init__(self, robot: Robot) -> None:
        angles = fixed_angles(robot)
        self.D = 2
        for l in radicands(robot):
            self.D = lcm(self.D, 4 if l == 2 else l if l < LARGEST_RADICAND else 1)
        fractions = {e.terms.get(PI, Fraction(0)) for e in angles}
        for c in sorted(fractions, key=lambda c: c.denominator):
            if c.denominator <= LARGEST_DENOMINATOR and lcm(self.D, c.denominator) <= LARGEST_ORDER:
                self.D = lcm(self.D, c.denominator)
        self.free: dict[Monomial, Fraction] = {}
        for e in angles:
            for m, c in e.terms.items():
                if not self._is_turn(m, c):
                    self.free[m] = _common(self.free.get(m, abs(c)), abs(c))

    @property
    def all(self) -> list[Unit]:
        """List of all unit angles: first pi/D, with a common denominator D of the fixed angles,
        then others.
        """
        return [(PI, Fraction(1, self.D)), *self.free.items()]

    def of(self, angle: Expression) -> list[tuple[Unit, int]]:
        """Write a fixed angle as a sum of unit angles: a list of (unit angle, whole multiple).

        An amount that is no whole multiple of its unit angle becomes a unit angle itself.
        """
        parts: list[tuple[Unit, int]] = []
        for m, c in angle.terms.items():
            if self._is_turn(m, c):
                parts.append(((PI, Fraction(1, self.D)), int(c * self.D)))
                continue
            unit = self.free.get(m, abs(c))
            if (c / unit).denominator > 1:
                unit = abs(c)
            parts.append(((m, unit), int(c / unit)))
        return parts

    def _is_turn(self, m: Monomial, c: Fraction) -> bool:
        """Whether m is pi and the angle c*m is a whole multiple of the unit angle pi/D."""
        return m == PI and (c * self.D).denominator == 1


def _common(a: Fraction, b: Fraction) -> Fraction:
    """Return the largest fraction of which a and b are whole multiples: 1/6 for 1/2 and 2/3."""
    d = lcm(a.denominator, b.denominator)
    return Fraction(gcd(int(a * d), int(b * d)), d)


@lru_cache(maxsize=64)
def units_of(robot: Robot) -> Units:
    """Return the unit angles of a robot (see `Units`); they are computed once and stored."""
    return Units(robot)


def _angles(robot: Robot) -> Iterator[Expression]:
    for f in robot.frames:
        yield from (f.gamma, f.alpha, f.theta0)
    joints = {f"q{i}": Expression() for i in robot.moving}
    for j, e in robot.constraints.items():
        if robot.frame(j).sigma == REVOLUTE:
            yield e.substitute(joints)
    yield from (a.argument for a in _calls(robot) if a.function in ("cos", "sin"))
    yield from _angles_of_laws(robot)


def _angles_of_laws(robot: Robot) -> Iterator[Expression]:
    """Yield the constant part of the angle of each cosine and sine in the torque laws of the user.

    For the law cos(q1 + 0.3), for instance, the constant part is 0.3.
    """
    keys = [(e, j) for e in robot.elements if e.is_own for j in e.along]
    pending = [x for e, j in keys for x in (e.law(j), e.potential(j))]
    for law in pending:
        for a in law.atoms:
            if isinstance(a, Call):
                pending += a.operands
                if a.function in ("cos", "sin"):
                    yield Expression(
                        {
                            m: c
                            for m, c in a.argument.terms.items()
                            if not any(varies(b) for b, _ in m)
                        }
                    )


def rows_of(robot: Robot) -> list[Expression]:
    """Return the coefficients with which friction, springs and other elements act on the joints.

    The coefficients are the entries of the rows `along` and of the quadratic forms `form`.
    """
    tables = [table for e in robot.elements for table in (e.along, e.form)]
    return [c for table in tables for row in table.values() for c in row.values()]


def atoms_of(robot: Robot) -> Iterator[str | Number | Call]:
    """Yield the symbols, numbers and function calls in the constant expressions of a robot.

    The expressions are lengths, gravity, joint relations and element rows; fixed angles are left
    out. The argument of a function call, such as a square root, is searched too.
    """
    pending = [e for f in robot.frames for e in (f.b, f.d, f.r)]
    pending += [*robot.gravity, *robot.constraints.values(), *rows_of(robot)]
    for e in pending:
        for a in (a for m in e.terms for a, _ in m):
            yield a
            if isinstance(a, Call):
                pending.append(a.argument)


def _calls(robot: Robot) -> Iterator[Call]:
    return (a for a in atoms_of(robot) if isinstance(a, Call))


def radicands(robot: Robot) -> tuple[int, ...]:
    """Return the whole numbers whose square roots occur in a robot's description, smallest first.

    Each number is a prime, or has no small prime factor.
    """
    arguments = {a.argument.constant for a in _calls(robot) if a.function == "sqrt"}
    return tuple(sorted({int(c) for c in arguments if c is not None}))


def roots_of(robot: Robot) -> tuple[Call, ...]:
    """Return the square roots that occur in the lengths, gravity, joint relations and elements
    (friction, springs, ...) of a robot, each once.
    """
    return tuple(dict.fromkeys(a for a in _calls(robot) if a.function == "sqrt"))


LARGEST_WHOLE = 12  # whole numbers up to here are counts (2, 4) rather than lengths


@lru_cache(maxsize=64)
def numbered(robot: Robot) -> Robot:
    """Replace each decimal number of a robot by a symbol, so that formulas keep it as written.

    The numbers are those of its lengths, gravity, joint relations, element rows and angles. If one
    relation between joints is substituted into another, the ratios stay numbers, because the angles
    of the joints need these ratios.
    """
    followed = {a for e in robot.constraints.values() for a in e.atoms}
    chained = any(f"q{j}" in followed for j in robot.constraints)
    result = mapped(robot, keep_rationals, symbolic_angle)
    if not chained:
        return result
    return replace(result, constraints={j: symbolic_angle(e) for j, e in robot.constraints.items()})


def keep_rationals(e: Expression) -> Expression:
    """Replace each rational coefficient of a polynomial by a symbol that has the same value.

    Coefficients inside square roots and inverses are replaced too. Whole numbers up to 12
    (`LARGEST_WHOLE`) stay numbers.
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


def symbolic_angle(e: Expression) -> Expression:
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
