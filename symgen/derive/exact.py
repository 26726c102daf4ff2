"""Robots over the prime field F_p: an algebra in which random states and geometries are exact.

p < 2**31, so products fit in int64. p = 3 (mod 4): 1 + t**2 is never 0 and every angle is a point
((1 - t**2)/(1 + t**2), 2t/(1 + t**2)) of the unit circle. The points form a group of order p + 1; p
is chosen so that this order is a multiple of 2D, D the common denominator of the robot's fractions
of pi: pi/3 or pi/4 are then exact roots of unity of F_p, not approximations.

Every other fixed angle is a whole multiple of a unit, a random point (`derive.angles`).

Square roots of rationals lie in the cyclotomic field of the fractions of pi and are taken from the
same root of unity, so that sqrt(3)/2 is cos(pi/6) and never -cos(pi/6). For an odd prime l, by
Gauss, with the Legendre symbol (k/l) (Ireland and Rosen, A Classical Introduction to Modern Number
Theory, 6.4):

    sqrt(l) = sum_k (k/l) cos(2 pi k/l)  if l = 1 (mod 4),      sum_k (k/l) sin(2 pi k/l)
            if l = 3 (mod 4),      sqrt(2) = 2 cos(pi/4).

pi as a number is a random residue: it is transcendental. A `Number` has its value, or a residue
where `geometry` gives one.

Functions of laws that F_p does not have (exp, tanh, sin of half an angle, sign of a position) are
x -> (x + k)**m with a k of the function and one large m: equal where what they are of is equal, and
related in no other way. What else relates them shows in numbers (`regroup.regrouping`).

Directions of motion: sign(sd) = 2b - 1 with b = 1 forward, 0 backward, one b for each class of
proportional rows G; max(sd, 0) = b sd. A torque is a polynomial of degree one in each b, hence zero
for b = 0, 1 if and only if it is the zero polynomial; b is drawn from F_p as every other variable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import lru_cache
from itertools import islice
from math import lcm

import numpy as np

from symgen.derive.angles import (
    LARGEST_RADICAND,
    PI,
    Unit,
    Variable,
    is_prime,
    nested_roots,
    radicands,
    units_of,
)
from symgen.derive.closure import parts
from symgen.derive.scalar import Scalar, Turn, Unnamed
from symgen.description.expression import Call, Expression, Number, call, quarter_turns
from symgen.description.robot import Robot
from symgen.errors import SymgenError

Array = np.ndarray
KEY, OPAQUE_POWER = 40_503, 479_001_599  # of functions that F_p does not have; the latter a prime
FEW, MOST_PRIMES = 12, 300  # draws over a prime, and primes looked at, for nested square roots


class Fp:
    """Elements of F_p, an int64 array of any shape."""

    __array_ufunc__ = None
    __slots__ = ("p", "x")

    def __init__(self, x: Array, p: int) -> None:
        self.x, self.p = x, p

    def _lift(self, other: Fp | int) -> Array | int:
        return other.x if isinstance(other, Fp) else other % self.p

    def __add__(self, other: Fp | int) -> Fp:
        return Fp((self.x + self._lift(other)) % self.p, self.p)

    def __sub__(self, other: Fp | int) -> Fp:
        return Fp((self.x - self._lift(other)) % self.p, self.p)

    def __rsub__(self, other: int) -> Fp:
        return Fp((other - self.x) % self.p, self.p)

    def __mul__(self, other: Fp | int) -> Fp:
        return Fp(self.x * self._lift(other) % self.p, self.p)

    def __neg__(self) -> Fp:
        return Fp(-self.x % self.p, self.p)

    def __truediv__(self, other: Fp) -> Fp:
        return self * Fp(power(other.x, self.p - 2, self.p), self.p)

    __radd__, __rmul__ = __add__, __mul__


def power(x: Array, n: int, p: int) -> Array:
    """x**n mod p, elementwise."""
    result = np.ones_like(x)
    while n:
        if n & 1:
            result = result * x % p
        x = x * x % p
        n >>= 1
    return result


Point = tuple[Array, Array]  # (cos, sin) over F_p


class Draw(Unnamed):
    """One random robot and `samples` random states over F_p: an Algebra of the derivation.

    `geometry` gives residues, shape (count, 1), for constants by name and for half-angle tangents
    of fixed angles by their unit: `count` robots in the same states. Without it everything is
    random and redrawn until every square root exists, `attempts` times at most.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int,
        samples: int,
        *,
        p: int | None = None,
        geometry: Mapping[Variable, Array] | None = None,
        count: int = 0,
        attempts: int = 200,
    ) -> None:
        self.robot, self.samples = robot, samples
        self.shape: tuple[int, ...] = (count, samples) if count else (samples,)
        self._geometry = dict(geometry or {})
        self.units = units_of(robot)
        self.p = p if p is not None else primes_for(robot, 1)[0]
        self.rng = np.random.default_rng(seed)
        self.complete = False
        for _ in range(attempts):
            names = (*robot.constants, "pi")
            self._constants = {
                name: self._geometry[name] if name in self._geometry else self._random(1)
                for name in names
            }
            self._angles: dict[Unit, Point] = {}
            self._root: Point | None = None
            self.complete = self._roots_exist()
            if self.complete:
                break
        self._rate: dict[tuple[int, int], Array] = {}
        self._channels: dict[str, Array] = {}
        self._directions: dict[tuple[tuple[int, tuple[int, ...]], ...], Array] = {}
        self._q = {j: self._random(samples) for j in robot.moving}
        self._qd = {j: self._random(samples) for j in robot.moving}
        self._qdd = {j: self._random(samples) for j in robot.moving}
        self.parts = dict.fromkeys(robot.moving, parts(robot))
        self._point = {j: self._circle(samples) for j in robot.moving}  # of q_j/parts

    def _random(self, size: int) -> Array:
        return self.rng.integers(1, self.p, size)

    def _fp(self, x: Array) -> Fp:
        return Fp(x, self.p)

    def _circle(self, size: int) -> Point:
        return self._point_at(self._random(size))

    def _point_at(self, t: Array) -> Point:
        inverse = power((1 + t * t) % self.p, self.p - 2, self.p)
        return (1 - t * t) % self.p * inverse % self.p, 2 * t % self.p * inverse % self.p

    def _turned(self, a: Point, b: Point) -> Point:
        p = self.p
        return (a[0] * b[0] - a[1] * b[1] % p) % p, (a[0] * b[1] + a[1] * b[0] % p) % p

    def _multiple(self, a: Point, n: int) -> Point:
        """The point of the angle n a."""
        if n < 0:
            a, n = (a[0], -a[1] % self.p), -n
        if n == 1:
            return a
        result: Point = (np.ones_like(a[0]), np.zeros_like(a[0]))
        while n:
            if n & 1:
                result = self._turned(result, a)
            a = self._turned(a, a)
            n >>= 1
        return result

    def _unit(self, unit: Unit) -> Point:
        """The point of a unit angle; of pi/D a root of unity of order 2D."""
        if unit not in self._angles:
            if unit in self._geometry:
                self._angles[unit] = self._point_at(self._geometry[unit])
            else:
                whole = unit == (PI, Fraction(1, self.units.D))
                self._angles[unit] = self._half_turn() if whole else self._circle(1)
        return self._angles[unit]

    def _half_turn(self) -> Point:
        """The point of the angle pi/D, a root of unity of order 2D."""
        if self._root is None:
            self._root = self._root_of_unity(2 * self.units.D)
        return self._root

    def _sqrt_of_prime(self, l: int) -> Array:
        """sqrt(l) as a sum of cosines or sines, see the head of this module."""
        D = self.units.D
        if l == 2:
            return 2 * self._multiple(self._half_turn(), D // 4)[0] % self.p
        turn = self._multiple(self._half_turn(), 2 * D // l)
        total = np.zeros(1, dtype=np.int64)
        for k in range(1, l):
            legendre = 1 if pow(k, (l - 1) // 2, l) == 1 else -1
            total = (total + legendre * self._multiple(turn, k)[l % 4 == 3]) % self.p
        return total

    def _sqrt(self, x: Fp) -> Fp:
        root = power(x.x, (self.p + 1) // 4, self.p)
        if (root * root % self.p != x.x).any():
            raise ArithmeticError("no square root in this draw")
        return self._fp(root)

    def _root_of_unity(self, order: int) -> Point:
        """A point of that order, a multiple of 4, a quarter of which is (0, 1)."""
        while True:
            root = self._multiple(self._circle(1), (self.p + 1) // order)
            primitive = all(
                self._multiple(root, order // k)[0][0] != 1
                for k in range(2, order + 1)
                if order % k == 0
            )
            if primitive and self._multiple(root, order // 4)[1][0] == 1:
                return root

    def _angle(self, e: Expression) -> Point:
        """(cos, sin) of a constant angle."""
        turns, rest = quarter_turns(e)
        quarter = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns % 4]
        point: Point = (np.array([quarter[0] % self.p]), np.array([quarter[1] % self.p]))
        for unit, k in self.units.of(rest):
            point = self._turned(point, self._multiple(self._unit(unit), k))
        return point

    def _roots_exist(self) -> bool:
        try:
            for f in self.robot.frames:
                for e in (f.b, f.d, f.r0):
                    self.constant(e)
        except ArithmeticError:
            return False
        return True

    def residues(self, value: Scalar) -> Array:
        """A scalar as it is drawn: one residue, or one for each geometry or state."""
        return value.x if isinstance(value, Fp) else np.array([value % self.p])

    def spread(self, value: Scalar) -> Array:
        """A scalar at all geometries and states, of shape `shape`."""
        return np.broadcast_to(self.residues(value), self.shape)

    # --- Algebra ---

    def constant(self, e: Expression) -> Scalar:
        c = e.constant
        if c is not None and c in (0, 1, -1):
            return int(c)
        return e.evaluate(
            lambda name: self._fp(self._constants[name]), self._call, self._number, self._atom
        )

    def _atom(self, number: Number) -> Fp:
        return (
            self._fp(self._geometry[number])
            if number in self._geometry
            else self._number(number.value)
        )

    def _number(self, c: Fraction) -> Fp:
        return self._fp(np.array([c.numerator * pow(c.denominator, -1, self.p) % self.p]))

    def _call(self, function: str, argument: Expression) -> Fp:
        if function in ("cos", "sin"):
            return self._fp(self._angle(argument)[function == "sin"])
        root = Call(function, argument)
        if root in self._geometry:
            return self._fp(self._geometry[root])
        c = argument.constant
        if function == "sqrt" and c is not None and (c == 2 or 2 < c < LARGEST_RADICAND):
            return self._fp(self._sqrt_of_prime(int(c)))
        x = self.constant(argument)
        value = x if isinstance(x, Fp) else self._number(Fraction(x))
        if function == "inv":
            return self._fp(power(value.x, self.p - 2, self.p))
        return self._sqrt(value)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        if not turn:
            c, s = (self.constant(call(name, offset)) for name in ("cos", "sin"))
            return c, s
        point = self._angle(offset)
        for j, n in turn:
            if (whole := n * self.parts[j]).denominator > 1:
                raise ArithmeticError(f"a hinge turns {n} times with q{j}, which loops alone tie")
            point = self._turned(point, self._multiple(self._point[j], int(whole)))
        return self._fp(point[0]), self._fp(point[1])

    def q(self, j: int) -> Fp:
        return self._fp(self._q[j])

    def qd(self, j: int) -> Fp:
        return self._fp(self._qd[j])

    def qdd(self, j: int) -> Fp:
        return self._fp(self._qdd[j])

    def channel(self, name: str) -> Fp:
        return self._fp(self._channels.setdefault(name, self._random(self.samples)))

    def rate(self, u: int, i: int) -> Scalar:
        """Any value: no general loop closes here, this proves identities of the open tree alone."""
        return self._fp(self._rate.setdefault((u, i), self._random(self.samples)))

    def _forward(self, row: tuple[tuple[int, Expression], ...]) -> tuple[Fp, int]:
        """b of the direction class of a row, and whether the row runs along it (1) or not (-1)."""
        lead = row[0][1]
        orientation = 1 if lead.value(self.robot.constants) > 0 else -1
        inverse = power(self.residues(self.constant(lead)), self.p - 2, self.p)
        key = tuple(
            (i, tuple(np.unique(self.residues(self.constant(g)) * inverse % self.p)))
            for i, g in row
        )
        if key not in self._directions:
            self._directions[key] = self._random(self.samples)
        b = self._fp(self._directions[key])
        return b, orientation

    def sign(self, rate: Scalar, row: tuple[tuple[int, Expression], ...]) -> Fp:
        b, orientation = self._forward(row)
        return (b + b - 1) * orientation

    def function(self, op: str, *operands: Scalar) -> Fp:
        """A function of a law, see the head of this module."""
        x = [self.residues(value) for value in operands]
        if op == "inv":
            return self._fp(power(x[0], self.p - 2, self.p))
        total = sum((value * KEY**k % self.p for k, value in enumerate(x)), sum(op.encode()) * KEY)
        value = power(total % self.p, OPAQUE_POWER, self.p)
        return self._fp((2 * value - 1) % self.p if op == "sign" else value)

    def one_sided(
        self, rate: Scalar, row: tuple[tuple[int, Expression], ...], when: str
    ) -> tuple[Scalar, Scalar]:
        b, orientation = self._forward(row)
        if orientation < 0:
            b = 1 - b
        return (b, b * rate) if when == "positive" else (b - 1, (1 - b) * rate)


@lru_cache
def primes_for(robot: Robot, count: int, seed: int | None = None) -> tuple[int, ...]:
    """`count` primes p < 2**31 with p = -1 modulo 4 and 2D, over which the square roots of the
    robot exist: the largest, or below a random place.

    Raises SymgenError where so many of them nest that none of MOST_PRIMES has all.
    """
    nested, primes = nested_roots(robot), []
    for p in islice(candidates(robot, seed), MOST_PRIMES):
        if not nested or Draw(robot, 5, 1, p=p, attempts=FEW).complete:
            primes.append(p)
        if len(primes) == count:
            return tuple(primes)
    raise SymgenError(
        f"robot {robot.name}: no prime found over which angles pi/{units_of(robot).D} and all its "
        "square roots exist; write some of them as decimals"
    )


def candidates(robot: Robot, seed: int | None = None) -> Iterator[int]:
    """Primes with p = -1 modulo 4 and 2D over which the large radicands are squares: downwards from
    the largest, or from a random place.
    """
    step = lcm(4, 2 * units_of(robot).D)
    top = 2**31 if seed is None else int(np.random.default_rng(seed).integers(2**30, 2**31))
    squares = [c for c in radicands(robot) if c >= LARGEST_RADICAND]
    for p in range(top // step * step - 1, 2**20, -step):
        if is_prime(p) and all(pow(c, (p - 1) // 2, p) == 1 for c in squares):
            yield p
