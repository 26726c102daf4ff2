"""The prime field F_p, a domain of graph nodes in which random states and geometries are exact.

p < 2**31, so products fit in int64. p = 3 (mod 4): 1 + t**2 is never 0 and every angle is a point ((1 - t**2)/(1 + t**2), 2t/(1 + t**2)) of the unit circle. The points form a group of order p + 1; p is chosen so that this order is a multiple of 2D, D the common denominator of the robot's fractions of pi: pi/3 or pi/4 are then exact roots of unity of F_p, not approximations. Every other fixed angle is a sum of multiples of units, random points (`derive.angles`).

Square roots of rationals lie in the cyclotomic field of the fractions of pi and are taken from the same root of unity, so that sqrt(3)/2 is cos(pi/6) and never -cos(pi/6). For an odd prime l, by Gauss, with the Legendre symbol (k/l) (Ireland and Rosen, A Classical Introduction to Modern Number Theory, 6.4):

    sqrt(l) = sum_k (k/l) cos(2 pi k/l)  if l = 1 (mod 4) ,   sum_k (k/l) sin(2 pi k/l)  if l = 3 (mod 4) ,   sqrt(2) = 2 cos(pi/4)

Every other square root is a random residue, independent of what is under it: what holds for any number holds for the root. pi as a number is a random residue: it is transcendental. A `Number` has its value, or a residue where `geometry` gives one.

Functions of laws that F_p does not have (exp, tanh, sin of half an angle, sign of a position) are x -> (x + k)**m with a k of the function and one large m: equal where what they are of is equal, and related in no other way. What else relates them shows in numbers (`regroup.regrouping`).

Directions of motion: sign(sd) = 2b - 1 with b = 1 forward, 0 backward, one b for each class of proportional rows G; max(sd, 0) = b sd. A torque is a polynomial of degree one in each b, hence zero for b = 0, 1 if and only if it is the zero polynomial; b is drawn from F_p as every other variable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from hashlib import shake_128
from itertools import islice
from math import lcm

import numpy as np

from symgen.derive.angles import (
    LARGEST_RADICAND,
    PI,
    Unit,
    Variable,
    is_prime,
    radicands,
    units_of,
)
from symgen.derive.closure import parts
from symgen.derive.graph import INV, POS, SIGN, SIN, SQRT, Angle, Node, Symbol, Velocity, interpret
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.numbers import numbered
from symgen.derive.scalar import Scalar
from symgen.description.expression import Call, Expression, Number, quarter_turns
from symgen.description.robot import Robot
from symgen.errors import SymgenError

Array = np.ndarray
KEY, OPAQUE_POWER = 40_503, 479_001_599  # of functions that F_p does not have; the latter a prime


class Fp:
    """Elements of F_p, an int64 array of any shape."""

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
    """x**n mod p, elementwise."""
    result = np.ones_like(x)
    while n:
        if n & 1:
            result = result * x % p
        x = x * x % p
        n >>= 1
    return result


Point = tuple[Array, Array]  # (cos, sin) over F_p


class Draw:
    """One random robot and `samples` random states over F_p: a domain of graph nodes.

    `geometry` gives residues, shape (count, 1), for constants by name, for numbers and square roots
    and for half-angle tangents of fixed angles by their unit: `count` robots in the same states.
    What it leaves out is random, by seed and name, in whatever order it is asked for.
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
        """Residues of a symbol: of a state variable one per state; otherwise one, or one per geometry drawn."""
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
        """The residue of a rational."""
        return self._fp(np.array([c.numerator * pow(c.denominator, -1, self.p) % self.p]))

    def function(self, node: Node, x: list[Fp]) -> Fp:
        """A cosine or sine, a square root, an inverse, a direction, a function of a law."""
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
        """A constant expression."""
        (value,) = interpret([self._algebra.constant(e)], self)
        return value

    def residues(self, value: Scalar) -> Array:
        """A scalar as it is drawn: one residue, or one for each geometry or state."""
        return value.x if isinstance(value, Fp) else np.array([value % self.p])

    def spread(self, value: Scalar) -> Array:
        """A scalar at all geometries and states, of shape `shape`."""
        return np.broadcast_to(self.residues(value), self.shape)

    def _fp(self, x: Array) -> Fp:
        return Fp(x, self.p)

    def _random(self, key: object, size: int) -> Array:
        digest = shake_128(f"{self.seed} {key!r}".encode()).digest(8 * size)
        return (np.frombuffer(digest, dtype="<u8") % (self.p - 1) + 1).astype(np.int64)

    def _of_geometry(self, key: str | Call) -> Array:
        """Residues of a constant, of pi or of a square root."""
        if key not in self._geometry:
            self._geometry[key] = self._random(str(key), 1)
        return self._geometry[key]

    def _state(self, key: object) -> Array:
        """A residue for each state."""
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

    def _joint(self, j: int) -> Point:
        """The point of q_j/parts at each state."""
        if j not in self._points:
            self._points[j] = self._point_at(self._random(("angle", j), self.samples))
        return self._points[j]

    def _unit(self, unit: Unit) -> Point:
        """The point of a unit angle; of pi/D a root of unity of order 2D."""
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
        """The point of the angle pi/D: of order 2D, and its multiple pi/2 is (0, 1)."""
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
        """(cos, sin) of a constant angle, or of one that joints turn."""
        turns, rest = quarter_turns(angle.offset)
        quarter = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns % 4]
        point: Point = (np.array([quarter[0] % self.p]), np.array([quarter[1] % self.p]))
        for unit, k in self.units.of(rest):
            point = self._turned(point, self._multiple(self._unit(unit), k))
        for j, n in angle.turn:
            if (whole := n * self.parts[j]).denominator > 1:
                raise ArithmeticError(f"a hinge turns {n} times with q{j}, which loops alone tie")
            point = self._turned(point, self._multiple(self._joint(j), int(whole)))
        return point

    def _sqrt(self, root: Expression) -> Array:
        """The square root of a rational, see the head of this module; of anything else a residue."""
        (call,) = root.atoms
        assert isinstance(call, Call)
        c = call.argument.constant
        if call in self._geometry or c is None:
            return self._of_geometry(call)
        if c == 2 or 2 < c < LARGEST_RADICAND:
            return self._sqrt_of_prime(int(c))
        return power(self.number(c).x, (self.p + 1) // 4, self.p)

    def _sqrt_of_prime(self, l: int) -> Array:
        """sqrt(l) as a sum of cosines or sines, see the head of this module."""
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
        """b of the motion along the `rate` that a sign or positive part is of: 1 forward, 0 back."""
        if not isinstance(node.value, Velocity):
            return self._opaque(SIGN, [rate])
        row = node.value.row
        lead = row[0][1]
        inverse = power(self.residues(self.constant(lead)), self.p - 2, self.p)
        key = tuple(
            (i, tuple(np.unique(self.residues(self.constant(g)) * inverse % self.p)))
            for i, g in row
        )
        b = self._fp(self._state(("direction", key)))
        return b if lead.value(self.robot.constants) > 0 else 1 - b

    def _opaque(self, op: str, x: list[Fp]) -> Fp:
        """A function of a law, see the head of this module."""
        total = sum((v.x * KEY**k % self.p for k, v in enumerate(x)), sum(op.encode()) * KEY)
        return self._fp(power(total % self.p, OPAQUE_POWER, self.p))


@lru_cache
def primes_for(robot: Robot, count: int, seed: int | None = None) -> tuple[int, ...]:
    """`count` primes p < 2**31 with p = -1 modulo 4 and 2D, over which the square roots of the robot's rationals exist: the largest, or below a random place.

    Raises SymgenError if there are too few.
    """
    primes = tuple(islice(candidates(robot, seed), count))
    if len(primes) == count:
        return primes
    raise SymgenError(
        f"robot {robot.name}: no prime found over which angles pi/{units_of(numbered(robot)).D} and "
        "all its square roots exist; write some of them as decimals"
    )


def candidates(robot: Robot, seed: int | None = None) -> Iterator[int]:
    """Primes with p = -1 modulo 4 and 2D over which the large radicands are squares: downwards from the largest, or from a random place."""
    step = lcm(4, 2 * units_of(numbered(robot)).D)
    top = 2**31 if seed is None else int(np.random.default_rng(seed).integers(2**30, 2**31))
    squares = [c for c in radicands(robot) if c >= LARGEST_RADICAND]
    for p in range(top // step * step - 1, 2**20, -step):
        if is_prime(p) and all(pow(c, (p - 1) // 2, p) == 1 for c in squares):
            yield p
