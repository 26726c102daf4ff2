"""Fixed angles and square roots of a robot over F_p: the unit angles, the radicands, and the primes
in which all of them exist.

Fractions of pi with a moderate denominator are whole multiples of pi/D, a root of unity of F_p.
Every other fixed angle is a whole multiple of a
unit that is drawn at random: radians and multiples of constants (transcendental against all
algebraic numbers), and fractions of pi with a
large denominator, whose minimal polynomial has a degree of the order of that denominator. Multiples
are at most LARGEST_MULTIPLE, so that
degrees stay small against p.
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
# roots of larger primes are drawn by themselves: their fields share nothing with angles of small
# denominator
LARGEST_RADICAND = 100
LARGEST_DENOMINATOR, LARGEST_ORDER = (
    360,
    100_000,
)  # of a fraction of pi, and of all of them together
LARGEST_MULTIPLE = 16  # of a unit angle
SMALL = [k for n in range(1, LARGEST_MULTIPLE + 1) for k in (n, -n)]
FEW = 4  # of each of two unit angles in a sum
Unit = tuple[Monomial, Fraction]  # the angle fraction * monomial
Variable = (
    str | Number | Call | Unit
)  # what a geometry may give: a constant, "pi", a number, a square root, a unit angle


def fixed_angles(robot: Robot) -> tuple[Expression, ...]:
    """The distinct fixed angles of a robot that are no quarter turns, quarter turns taken off and
    the leading sign positive.
    """
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
        self.D = 2
        for l in radicands(robot):
            self.D = lcm(self.D, 4 if l == 2 else l if l < LARGEST_RADICAND else 1)
        self.free: dict[Monomial, list[Fraction]] = {}
        self.multiples: dict[
            Monomial, dict[Fraction, tuple[Fraction, int]]
        ] = {}  # {multiple of a free unit, without turns: (unit, k)}
        self.sums: dict[tuple[Monomial, Fraction], list[tuple[Unit, int]]] = {}
        self.written: dict[
            tuple[Monomial, Fraction], list[tuple[Unit, int]]
        ] = {}  # amounts looked at once
        angles = fixed_angles(robot)
        for c in sorted(
            {e.terms.get(PI, Fraction(0)) for e in angles}, key=lambda c: c.denominator
        ):
            if c.denominator <= LARGEST_DENOMINATOR and lcm(self.D, c.denominator) <= LARGEST_ORDER:
                self.D = lcm(self.D, c.denominator)
        for m in dict.fromkeys(m for e in angles for m in e.terms if m != PI):
            amounts = [abs(e.terms[m]) for e in angles if m in e.terms]
            common = lcm(*(c.denominator for c in amounts))
            unit = Fraction(gcd(*(int(c * common) for c in amounts)), common)
            if max(amounts) / unit <= LARGEST_MULTIPLE:
                self._new(m, unit)
        for e in angles:
            self.of(e)
        self._add_sums(robot)

    def _add_sums(self, robot: Robot) -> None:
        """Sums of the angles about parallel axes in a row are those sums, not new units (`Geometry`
        turns by them at once).
        """
        angles: dict[int, tuple[Expression, ...]] = {}
        for f in robot.frames:
            following = robot.constraints.get(f.j) if f.sigma == REVOLUTE else None
            constant = (
                Expression()
                if following is None
                else following.substitute({f"q{i}": Expression() for i in robot.moving})
            )
            parallel = not f.alpha
            before = angles.get(f.ant, ()) if parallel else ()
            angles[f.j] = (*before, f.theta0 + constant + (f.gamma if parallel else Expression()))
            total = sum(angles[f.j], Expression())
            for m, c in total.terms.items() if before else ():
                if m != PI and (m, c) not in self.sums:
                    parts = [self._multiples(m, e.terms[m]) for e in angles[f.j] if m in e.terms]
                    whole: dict[Unit, int] = {}
                    for unit, k in (pair for part in parts for pair in part):
                        whole[unit] = whole.get(unit, 0) + k
                    self.sums |= {
                        (m, sign * c): [(unit, sign * k) for unit, k in whole.items() if k]
                        for sign in (1, -1)
                    }

    @property
    def all(self) -> list[Unit]:
        """pi/D, then the free ones."""
        return [
            (PI, Fraction(1, self.D)),
            *((m, c) for m, units in self.free.items() for c in units),
        ]

    def of(self, angle: Expression) -> list[tuple[Unit, int]]:
        """[(unit, whole multiple)]; an amount that is no small multiple of units becomes a
        unit.
        """
        return [(unit, k) for m, c in angle.terms.items() for unit, k in self._multiples(m, c)]

    def _multiples(self, m: Monomial, c: Fraction) -> list[tuple[Unit, int]]:
        turns = [((PI, Fraction(1, self.D)), int(c * self.D))]
        if m == PI and (c * self.D).denominator == 1:
            return turns
        if (m, c) in self.sums:
            return self.sums[m, c]
        if (m, c) not in self.written:
            parts = self._in_units(m, c)
            if parts is None:
                self._new(m, abs(c))
                parts = [((m, abs(c)), 1 if c > 0 else -1)]
            self.written[m, c] = parts
        return self.written[m, c]

    def _in_units(self, m: Monomial, c: Fraction) -> list[tuple[Unit, int]] | None:
        """c as a multiple of one free unit or of two, and of pi/D, if it is one."""
        multiples = self.multiples.get(m, {})
        if (hit := multiples.get(self._part(m, c))) is not None:
            return self._with_turns(m, c, [hit])
        for u in self.free.get(m, ()):
            for k in SMALL[: 2 * FEW]:
                hit = multiples.get(self._part(m, c - k * u))
                if hit is not None and abs(hit[1]) <= FEW:
                    return self._with_turns(m, c, [(u, k), hit])
        return None

    def _part(self, m: Monomial, c: Fraction) -> Fraction:
        """What is left of an amount without the multiples of pi/D."""
        return c % Fraction(1, self.D) if m == PI else c

    def _with_turns(
        self, m: Monomial, c: Fraction, parts: list[tuple[Fraction, int]]
    ) -> list[tuple[Unit, int]]:
        rest = (c - sum(k * u for u, k in parts)) * self.D
        return [((m, u), k) for u, k in parts] + (
            [((PI, Fraction(1, self.D)), int(rest))] if rest else []
        )

    def _new(self, m: Monomial, unit: Fraction) -> None:
        self.free.setdefault(m, []).append(unit)
        multiples = self.multiples.setdefault(m, {})
        for k in SMALL:
            multiples.setdefault(self._part(m, k * unit), (unit, k))


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
    """Atoms of lengths, gravity, relations and rows of elements, and of what functions among them
    are of.
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
    """The whole numbers under square roots: primes, and what no small prime divides."""
    arguments = {a.argument.constant for a in _calls(robot) if a.function == "sqrt"}
    return tuple(sorted({int(c) for c in arguments if c is not None}))


def nested_roots(robot: Robot) -> bool:
    """Whether there are square roots of numbers that hold square roots themselves."""
    return any(
        a.function == "sqrt"
        and not a.argument.symbols
        and any(isinstance(b, Call) for b in a.argument.atoms)
        for a in _calls(robot)
    )


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
