"""Exact arithmetic modulo a prime p (field F_p), at random states and geometries of a robot.

The class `Draw` is a domain of graph nodes. p < 2**31, so products fit in int64. p = 3 (mod 4), so
1 + t**2 is never 0, and every t gives an angle, the point ((1 - t**2)/(1 + t**2), 2t/(1 + t**2)) of
the unit circle. These points form a group of order p + 1. p is chosen so that this order is a
multiple of 2D, with D the common denominator of the robot's fractions of pi. Then pi/3 or pi/4 are
exact roots of unity of F_p, not approximations. Every other fixed angle is a sum of multiples of
unit angles, which are random points (`derive.constants`).

Square roots of small primes are computed from the same root of unity, so that sqrt(3)/2 is
cos(pi/6) and never -cos(pi/6). For an odd prime l, by Gauss, with the Legendre symbol (k/l)
(Ireland and Rosen, A Classical Introduction to Modern Number Theory, 6.4):

    sqrt(l) = sum_k (k/l) cos(2 pi k/l)    if l = 1 (mod 4)
    sqrt(l) = sum_k (k/l) sin(2 pi k/l)    if l = 3 (mod 4)
    sqrt(2) = 2 cos(pi/4)

The square root of a larger number is a power of the number. The square root of an expression with
symbols is a random residue, independent of the expression: a relation that holds for any number
holds for the root. The number pi is a random residue, because pi is transcendental. A `Number` has
its value, or the residue that `geometry` gives for it.

F_p does not have all functions of torque laws: exp, tanh, sine of half an angle, sign of a
position. Such a function becomes x -> (x + k)**m, with a constant k of the function and one large
m. Its values are equal if its operands are equal; F_p sees no other relation between them. Any
other relation is found in floating point (`regroup.regrouping`).

Directions of motion: sign(sd) = 2b - 1 with b = 1 forward, 0 backward, one b for each class of
proportional rows G; max(sd, 0) = b sd. A torque is a polynomial of degree one in each b, hence zero
for b = 0, 1 if and only if it is the zero polynomial. So b is drawn from F_p like every other
variable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from hashlib import shake_128
from itertools import islice
from math import lcm

import numpy as np

from symgen.derive.algebra import GraphAlgebra, Scalar
from symgen.derive.closure import parts
from symgen.derive.constants import (
    LARGEST_RADICAND,
    PI,
    Unit,
    Variable,
    numbered,
    radicands,
    units_of,
)
from symgen.derive.graph import INV, POS, SIGN, SIN, SQRT, Angle, Node, Symbol, Velocity, interpret
from symgen.description.expression import Call, Expression, Number, quarter_turns
from symgen.description.robot import Robot
from symgen.errors import SymgenError

Array = np.ndarray
KEY, OPAQUE_POWER = 40_503, 479_001_599  # of functions that F_p does not have; the latter a prime


class Fp:
    """An array of elements of the field F_p (integers modulo p), with the operators + - *."""

    __array_ufunc__ = None
    __slots__ = ("p", "x")

    def __init__(self, x: Array, p: int) -> None:
        self.x = x
        self.p = p

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

    __radd__, __rmul__ = __add__, __mul__


def power(x: Array, n: int, p: int) -> Array:
    """Return x**n mod p, elementwise."""
    result = np.ones_like(x)
    while n:
        if n & 1:
            result = result * x % p
        x = x * x % p
        n >>= 1
    return result


Point = tuple[Array, Array]  # (cos, sin) over F_p


class Draw:
    """A random geometry of a robot and `samples` random states, with exact values modulo a prime p.

    A Draw is a domain for `interpret`. `geometry` gives residues, shape (count, 1), for constants
    by name, for numbers and square roots, and for half-angle tangents of the unit angles; this
    makes `count` robots in the same states. All other residues are random. Random residues depend
    on the seed and the name of the quantity, not on the order in which they are computed.
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
    ) -> None:
        self.robot = robot
        self.seed = seed
        self.samples = samples
        self.shape: tuple[int, ...] = (count, samples) if count else (samples,)
        self.written = numbered(robot)
        self.units = units_of(self.written)
        self.p = p if p is not None else primes_for(robot, 1)[0]
        self.parts = dict.fromkeys(robot.moving, parts(robot))
        self._geometry = dict(geometry or {})
        self._residues: dict[object, Array] = {}  # of symbols, square roots and directions
        self._points: dict[int | Unit, Point] = {}  # of q_j/parts, by joint, and of unit angles
        self._algebra = GraphAlgebra(robot)  # of constant expressions

    # --- a domain ---

    def symbol(self, symbol: Symbol) -> Scalar:
        """Return the values modulo p of an input of the graph, such as q1 or a length.

        A state variable has one residue per state; a constant has one, or one per geometry.
        """
        if symbol.kind == "gravity":
            return self.constant(-self.written.gravity[int(symbol.name)])
        if symbol.kind in ("constant", "pi"):
            return self._fp(self._of_geometry(symbol.name))
        if symbol.kind == "number":
            c = Fraction(symbol.name)
            given = self._geometry.get(Number(c))
            return self.number(c) if given is None else self._fp(given)
        return self._fp(self._state(symbol))

    def number(self, c: Fraction) -> Fp:
        """Return the value modulo p of a rational number."""
        return self._fp(np.array([c.numerator * pow(c.denominator, -1, self.p) % self.p]))

    def function(self, node: Node, x: list[Fp]) -> Fp:
        """Apply the function of a graph node, such as cos, 1/x or sign, to values x modulo p."""
        if isinstance(node.value, Angle):
            return self._fp(self._angle(node.value)[node.op == SIN])
        match node.op:
            case op if op == SQRT and node.value is not None:
                return self._fp(self._sqrt(node.value))
            case op if op == INV:
                return self._fp(power(x[0].x, self.p - 2, self.p))
            case op if op == SIGN:
                b = self.forward(node, x[0])
                return b + b - 1
            case op if op == POS:
                (operand,) = node.operands
                if operand.node.op == SIGN:
                    return (x[0] + 1) * ((self.p + 1) // 2)
                b = self.forward(node, x[0] * operand.sign)
                return (b if operand.sign > 0 else 1 - b) * x[0]
        return self._opaque(node.op, x)

    # --- constants ---

    def constant(self, e: Expression) -> Scalar:
        """Return the values modulo p of a constant expression, such as a length."""
        (value,) = interpret([self._algebra.constant(e)], self)
        return value

    def residues(self, value: Scalar) -> Array:
        """Convert a value modulo p to an array: one entry, or one entry per geometry or state."""
        return value.x if isinstance(value, Fp) else np.array([value % self.p])

    def spread(self, value: Scalar) -> Array:
        """Repeat a value modulo p for all geometries and states: an array of shape `self.shape`."""
        x = self.residues(value)
        return x if x.shape == self.shape else np.broadcast_to(x, self.shape)

    def _fp(self, x: Array) -> Fp:
        return Fp(x, self.p)

    def _random(self, key: object, size: int) -> Array:
        digest = shake_128(f"{self.seed} {key!r}".encode()).digest(8 * size)
        return (np.frombuffer(digest, dtype="<u8") % (self.p - 1) + 1).astype(np.int64)

    def _of_geometry(self, key: str | Call) -> Array:
        """Return the values modulo the prime p that replace a constant, pi or a square root.

        The values are random if no value was given.
        """
        if key not in self._geometry:
            self._geometry[key] = self._random(str(key), 1)
        return self._geometry[key]

    def _state(self, key: object) -> Array:
        """Return random values modulo p of a variable, such as a joint velocity, one per state."""
        if key not in self._residues:
            self._residues[key] = self._random(key, self.samples)
        return self._residues[key]

    # --- angles and roots ---

    def _point_at(self, t: Array) -> Point:
        inverse = power((1 + t * t) % self.p, self.p - 2, self.p)
        return (1 - t * t) % self.p * inverse % self.p, 2 * t % self.p * inverse % self.p

    def _turned(self, a: Point, b: Point) -> Point:
        p = self.p
        return (a[0] * b[0] - a[1] * b[1] % p) % p, (a[0] * b[1] + a[1] * b[0] % p) % p

    def _multiple(self, a: Point, n: int) -> Point:
        """Return cosine and sine, modulo p, of the angle n a, from cosine and sine of a."""
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

    def _joint(self, j: int) -> Point:
        """Return random cosines and sines, modulo the prime p, of the angle q_j/D of joint j.

        D is a common denominator of the ratios between passive and independent joint angles: with
        q5 = q2/2, D = 2. So every angle of the robot is a whole multiple of some q_j/D.
        """
        if j not in self._points:
            self._points[j] = self._point_at(self._random(("angle", j), self.samples))
        return self._points[j]

    def _unit(self, unit: Unit) -> Point:
        """Return cosine and sine, modulo the prime p, of a unit angle, such as pi/D.

        D is the common denominator of the robot's fractions of pi. For pi/D the point is a root of
        unity of order 2D; for any other unit angle it is random, unless the geometry gives it.
        """
        if unit not in self._points:
            if unit in self._geometry:
                self._points[unit] = self._point_at(self._geometry[unit])
            elif unit == (PI, Fraction(1, self.units.D)):
                self._points[unit] = self.half_turn
            else:
                self._points[unit] = self._point_at(self._random(unit, 1))
        return self._points[unit]

    @cached_property
    def half_turn(self) -> Point:
        """Cosine and sine, modulo the prime p, of the angle pi/D; 2 D such angles make a full turn.

        D is the common denominator of the robot's fractions of pi. The multiple pi/2 has the cosine 0 and the sine 1.
        """
        order = 2 * self.units.D
        rng = np.random.default_rng([self.seed, 1])
        while True:
            circle = self._point_at(rng.integers(1, self.p, 1))
            root = self._multiple(circle, (self.p + 1) // order)
            primitive = all(
                self._multiple(root, order // k)[0][0] != 1
                for k in range(2, order + 1)
                if order % k == 0
            )
            if primitive and self._multiple(root, order // 4)[1][0] == 1:
                return root

    def _angle(self, angle: Angle) -> Point:
        """Return cosine and sine, modulo p, of an angle sum_j n_j q_j + constant."""
        turns, rest = quarter_turns(angle.offset)
        quarter = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns % 4]
        point: Point = (np.array([quarter[0] % self.p]), np.array([quarter[1] % self.p]))
        for unit, k in self.units.of(rest):
            point = self._turned(point, self._multiple(self._unit(unit), k))
        for j, n in angle.turn:
            if (whole := n * self.parts[j]).denominator > 1:
                raise ArithmeticError(
                    f"an angle contains {n} times q{j}; only whole multiples of a joint that the loop equations determine are allowed"
                )
            point = self._turned(point, self._multiple(self._joint(j), int(whole)))
        return point

    def _sqrt(self, root: Expression) -> Array:
        """Return the square root of a number modulo p; for the root of a symbol, a random value.

        The head of this module has the formulas.
        """
        (call,) = root.atoms
        assert isinstance(call, Call)
        c = call.argument.constant
        if call in self._geometry or c is None:
            return self._of_geometry(call)
        if c == 2 or 2 < c < LARGEST_RADICAND:
            return self._sqrt_of_prime(int(c))
        return power(self.number(c).x, (self.p + 1) // 4, self.p)

    def _sqrt_of_prime(self, l: int) -> Array:
        """Return the square root, modulo p, of a small prime l, as a sum of cosines or sines."""
        D = self.units.D
        if l == 2:
            return 2 * self._multiple(self.half_turn, D // 4)[0] % self.p
        turn = self._multiple(self.half_turn, 2 * D // l)
        total = np.zeros(1, dtype=np.int64)
        for k in range(1, l):
            legendre = 1 if pow(k, (l - 1) // 2, l) == 1 else -1
            total = (total + legendre * self._multiple(turn, k)[l % 4 == 3]) % self.p
        return total

    # --- laws ---

    def forward(self, node: Node, rate: Fp) -> Fp:
        """Return random values b modulo p that replace the truth value, 1 or 0, of "velocity > 0".

        The sign of the velocity is then 2b - 1.

        In the robot b is 1 or 0; a formula that holds for random b holds for both. Proportional
        velocities have the same b.
        """
        if not isinstance(node.value, Velocity):
            return self._opaque(SIGN, [rate])
        row = node.value.row
        lead = row[0][1]
        inverse = power(self.residues(self.constant(lead)), self.p - 2, self.p)
        key = tuple(
            (i, tuple(sorted({*ratio.ravel().tolist()})))
            for i, g in row
            for ratio in (self.residues(self.constant(g)) * inverse % self.p,)
        )
        b = self._fp(self._state(("direction", key)))
        return b if lead.value(self.robot.constants) > 0 else 1 - b

    def _opaque(self, op: str, x: list[Fp]) -> Fp:
        """Return substitute values for a function, such as exp, that no arithmetic modulo a prime has.

        Equal operands x of the function `op` give equal values (x + k)^m modulo the prime p, with k
        from `op`.
        """
        total = sum((v.x * KEY**k % self.p for k, v in enumerate(x)), sum(op.encode()) * KEY)
        return self._fp(power(total % self.p, OPAQUE_POWER, self.p))


@lru_cache
def primes_for(robot: Robot, count: int, seed: int | None = None) -> tuple[int, ...]:
    """Return `count` primes p for exact arithmetic: modulo p, all sines and cosines of the fixed
    angles and all square roots of the robot exist.

    p < 2**31, and p = -1 modulo 4 and 2D. Without a seed, the result has the largest such primes;
    with a seed, the largest below a random number. Raises SymgenError if there are too few.
    """
    primes = tuple(islice(candidates(robot, seed), count))
    if len(primes) == count:
        return primes
    raise SymgenError(
        f"robot {robot.name}: no prime found for exact arithmetic with angles "
        f"pi/{units_of(numbered(robot)).D} and all square roots of the robot; write some of these "
        "angles or roots as decimals"
    )


def candidates(robot: Robot, seed: int | None = None) -> Iterator[int]:
    """Yield primes p for exact arithmetic: modulo p, all sines and cosines of the fixed angles and
    all square roots of the robot exist.

    p = -1 modulo 4 and 2D, and the large numbers under square roots are squares in F_p. The primes
    are in descending order, from 2**31, or from a random number if a seed is given.
    """
    step = lcm(4, 2 * units_of(numbered(robot)).D)
    top = 2**31 if seed is None else int(np.random.default_rng(seed).integers(2**30, 2**31))
    squares = [c for c in radicands(robot) if c >= LARGEST_RADICAND]
    for p in range(top // step * step - 1, 2**20, -step):
        if _is_prime(p) and all(pow(c, (p - 1) // 2, p) == 1 for c in squares):
            yield p


def _is_prime(p: int) -> bool:
    """Whether p is prime; the test is for numbers p = -1 modulo 4 from 8 to 3.2e9, such as those of
    `candidates`.

    For such p, this is the Miller-Rabin test with bases 2, 3, 5, 7, which is exact below 3.2e9.
    """
    return all(pow(base, (p - 1) // 2, p) in (1, p - 1) for base in (2, 3, 5, 7))
