"""The scalar protocol: what the recursions need of a number, and vectors of three of them.

A scalar is anything with + - * and unary minus: a float array, an array over F_p, a graph node, a
CasADi SX. The Python integers 0,
1 and -1 are structural in every algebra: they are known while the recursion runs, cost nothing and
never reach the scalar.
An `Algebra` turns the symbols of a robot (constants, angles, joint rates, signs) into scalars and
receives the name of each step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Protocol, TypeVar

from symgen.description.expression import Expression
from symgen.description.robot import Robot

K = TypeVar("K")
Scalar = Any
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]  # rows
Turn = tuple[tuple[int, int | Fraction], ...]  # ((j, n), ...): the angle sum_j n q_j

AT_ZERO = {"sign": 0, "tanh": 0, "sine": 0, "root": 0, "power": 0, "exp": 1, "cosine": 1}
"""Values of `Algebra.function` at the structural zero."""
ZERO3: Vector = (0, 0, 0)
E3: Vector = (0, 0, 1)


class Algebra(Protocol):
    """Where the scalars of one derivation come from."""

    def constant(self, e: Expression) -> Scalar:
        """A constant expression: number, length, component of gravity, cos or sin of a fixed
        angle.
        """

    def gravity(self, axis: int) -> Scalar:
        """Component of minus the acceleration of gravity in frame 0, m/s**2."""

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        """cos and sin of sum n_j q_j + offset."""

    def q(self, j: int) -> Scalar:
        """Position of joint j."""

    def qd(self, j: int) -> Scalar:
        """Velocity of joint j."""

    def qdd(self, j: int) -> Scalar:
        """Acceleration of joint j."""

    def channel(self, name: str) -> Scalar:
        """A constant that is a function of time."""

    def rate(self, u: int, i: int) -> Scalar:
        """dq_u/dq_i of a passive joint u that only the loop equations tie to the actuated joint
        i.
        """

    def sign(self, rate: Scalar, row: tuple[tuple[int, Expression], ...]) -> Scalar:
        """sign(sd), sd = G qd = `rate`, G = `row`."""

    def one_sided(
        self, rate: Scalar, row: tuple[tuple[int, Expression], ...], when: str
    ) -> tuple[Scalar, Scalar]:
        """(sign(sd), sd) where the motion has the direction `when`, (0, 0) elsewhere."""

    def function(self, op: str, *operands: Scalar) -> Scalar:
        """inv (1/x), sign, exp, tanh, cosine, sine, root or power (x**y) of scalars."""

    def name(self, value: Scalar, name: str) -> Scalar:
        """The same value, which later steps call `name`."""

    def hint(self, value: Scalar, name: str) -> Scalar:
        """The same value, to be called `name` if it is used more than once."""

    def section(self, title: str) -> None:
        """What follows belongs under this heading."""


class Unnamed:
    """Part of an algebra of numbers, which prints nothing: names and headings are left aside."""

    robot: Robot

    def gravity(self, axis: int) -> Scalar:
        return self.constant(-self.robot.gravity[axis])  # type: ignore[attr-defined]

    def name(self, value: Scalar, name: str) -> Scalar:
        return value

    hint = name

    def section(self, title: str) -> None:
        return None


def is_zero(v: Vector) -> bool:
    """Whether all components are the structural zero."""
    return all(type(x) is int and x == 0 for x in v)


def add(a: Scalar, b: Scalar) -> Scalar:
    if type(a) is int and a == 0:
        return b
    if type(b) is int and b == 0:
        return a
    return a + b


def sub(a: Scalar, b: Scalar) -> Scalar:
    if type(b) is int and b == 0:
        return a
    if type(a) is int and a == 0:
        return -b
    return a - b


def mul(a: Scalar, b: Scalar) -> Scalar:
    if type(a) is int and -1 <= a <= 1:
        return 0 if a == 0 else b if a == 1 else -b
    if type(b) is int and -1 <= b <= 1:
        return 0 if b == 0 else a if b == 1 else -a
    return a * b


def dot(u: Sequence[Scalar], v: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0
    for a, b in zip(u, v, strict=True):
        total = add(total, mul(a, b))
    return total


def linear(algebra: Algebra, row: Mapping[K, Expression], x: Mapping[K, Scalar]) -> Scalar:
    """sum_i row_i x_i."""
    return dot([algebra.constant(g) for g in row.values()], [x[i] for i in row])


def turned(algebra: Algebra, turn: Turn, x: Mapping[int, Scalar]) -> Scalar:
    """sum n_j x_j of a turn; 0 for a joint that x leaves out."""
    row = {j: Expression.number(n) for j, n in turn}
    return linear(algebra, row, {j: x.get(j, 0) for j in row})


def cross(u: Vector, v: Vector) -> Vector:
    return (
        sub(mul(u[1], v[2]), mul(u[2], v[1])),
        sub(mul(u[2], v[0]), mul(u[0], v[2])),
        sub(mul(u[0], v[1]), mul(u[1], v[0])),
    )


def vadd(u: Vector, v: Vector) -> Vector:
    return (add(u[0], v[0]), add(u[1], v[1]), add(u[2], v[2]))


def scale(s: Scalar, u: Vector) -> Vector:
    return (mul(s, u[0]), mul(s, u[1]), mul(s, u[2]))


def apply(m: Matrix, u: Vector) -> Vector:
    """M u."""
    return (dot(m[0], u), dot(m[1], u), dot(m[2], u))


def apply_transposed(m: Matrix, u: Vector) -> Vector:
    """M' u."""
    return (
        dot((m[0][0], m[1][0], m[2][0]), u),
        dot((m[0][1], m[1][1], m[2][1]), u),
        dot((m[0][2], m[1][2], m[2][2]), u),
    )
