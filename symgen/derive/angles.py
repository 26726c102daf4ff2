"""Fixed angles and square roots of a robot over F_p: the unit angles, the radicands, and the primes in which all of them exist.

Fractions of pi with a moderate denominator are whole multiples of pi/D, a root of unity of F_p. Every other fixed angle is a sum of monomials in constants and in numbers as they are written (`derive.numbers`); all multiples of one monomial are whole multiples of a unit angle that is drawn at random, since radians and multiples of constants are transcendental against all algebraic numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from math import gcd, lcm

from symgen.description.expression import Call, Expression, Monomial, Number, quarter_turns
from symgen.description.kinds import CHANNEL, STATE
from symgen.description.robot import REVOLUTE, Robot

PI: Monomial = (("pi", 1),)
# roots of larger primes are drawn by themselves: their fields share nothing with angles of small denominator
LARGEST_RADICAND = 100
LARGEST_DENOMINATOR = 360  # of a fraction of pi
LARGEST_ORDER = 100_000  # of all of them together
Unit = tuple[Monomial, Fraction]  # the angle fraction * monomial
# what a geometry may give: a constant, "pi", a number, a square root, a unit angle
Variable = str | Number | Call | Unit


def fixed_angles(robot: Robot) -> tuple[Expression, ...]:
    """The distinct fixed angles of a robot that are no quarter turns, quarter turns taken off and the leading sign positive."""
    angles: dict[Expression, None] = {}
    for e in _angles(robot):
        rest = quarter_turns(e)[1]
        if rest and -rest not in angles:
            angles[rest] = None
    return tuple(angles)


class Units:
    """The unit angles of a robot: `of` writes a fixed angle as a sum of whole multiples of them.

    pi/D is the first, D the common denominator of its moderate fractions of pi and of those that
    its square roots need.
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
        """pi/D, then the free ones."""
        return [(PI, Fraction(1, self.D)), *self.free.items()]

    def of(self, angle: Expression) -> list[tuple[Unit, int]]:
        """[(unit, whole multiple)]; an amount that is no multiple of its unit is a unit of its own."""
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
        """Whether an amount is a whole multiple of pi/D."""
        return m == PI and (c * self.D).denominator == 1


def _common(a: Fraction, b: Fraction) -> Fraction:
    """The largest amount of which both are whole multiples."""
    d = lcm(a.denominator, b.denominator)
    return Fraction(gcd(int(a * d), int(b * d)), d)


@lru_cache(maxsize=64)
def units_of(robot: Robot) -> Units:
    """The unit angles of `robot`."""
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
    """The constants of the angles in laws of columns, where these are whole turns of joints."""
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


def varies(a: str | Number | Call) -> bool:
    """Whether an atom of a law is no constant expression of robot files."""
    if isinstance(a, Call):
        exact = a.function in ("cos", "sin", "inv")
        return not exact or any(varies(b) for e in a.operands for b in e.atoms)
    return not isinstance(a, Number) and (a.startswith(CHANNEL) or bool(STATE.match(a)))


def rows_of(robot: Robot) -> list[Expression]:
    """The entries of the rows and forms of elements."""
    tables = [table for e in robot.elements for table in (e.along, e.form)]
    return [c for table in tables for row in table.values() for c in row.values()]


def atoms_of(robot: Robot) -> Iterator[str | Number | Call]:
    """Atoms of lengths, gravity, relations and rows of elements, and of what functions among them are of."""
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
    """The whole numbers under square roots: primes, and what no small prime divides."""
    arguments = {a.argument.constant for a in _calls(robot) if a.function == "sqrt"}
    return tuple(sorted({int(c) for c in arguments if c is not None}))


def roots_of(robot: Robot) -> tuple[Call, ...]:
    """The square roots in lengths, gravity, ratios and rows of elements."""
    return tuple(dict.fromkeys(a for a in _calls(robot) if a.function == "sqrt"))


def is_prime(n: int) -> bool:
    """Miller-Rabin with bases 2, 3, 5, 7: exact below 3.2e9."""
    if n < 2 or any(n % b == 0 for b in (2, 3, 5, 7) if n != b):
        return False
    d, s = n - 1, 0
    while d % 2 == 0:
        d, s = d // 2, s + 1
    for base in (2, 3, 5, 7):
        x = pow(base, d, n)
        if x in (1, n - 1):
            continue
        for _ in range(s - 1):
            x = x * x % n
            if x == n - 1:
                break
        else:
            return False
    return True
