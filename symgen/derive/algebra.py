"""Scalars, vectors and matrices of a robot's formulas, as nodes of its expression graph.

Inputs of the graph are q1, QP1, QDP1 ... and the constants of the robot file under their names.
Numbers that formulas keep as written are inputs too, so that one graph serves all numbers. Each
node contains the description that exact arithmetic needs (see `graph.Node`).

A scalar is a node of the graph with a sign, a constant expression, or any other object with + - *
and unary minus. The Python integers 0, 1 and -1 cost nothing: a sum with 0 or a product with 0, 1
or -1 is simplified at once and makes no node of the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np

from symgen.derive.graph import (
    COS,
    INV,
    POS,
    SIGN,
    SIN,
    SQRT,
    ActiveRow,
    Angle,
    Graph,
    Symbol,
    Turn,
    Velocity,
)
from symgen.derive.names import Names
from symgen.description.expression import Expression, Number, call, quarter_turns
from symgen.description.robot import Robot

K = TypeVar("K")
Scalar = Any
Vector = np.ndarray  # of three scalars
Matrix = np.ndarray  # of three rows


def array(entries: Any) -> Vector:
    """Return a vector of scalars, or a matrix from its rows; + - * and @ act on the scalars.

    The array cannot be changed in place, because several links may share it.
    """
    made = np.array(entries, dtype=object)
    made.flags.writeable = False
    return made


BASE = ("W", "WP", "VP")
"""Families of the motion of a moving base, in the order of the argument `base`."""
ZERO3, E3 = array((0, 0, 0)), array((0, 0, 1))
IDENTITY = array(((1, 0, 0), (0, 1, 0), (0, 0, 1)))


def is_zero(v: Iterable[Scalar]) -> bool:
    """Whether every component of v is the Python integer 0, so that v vanishes identically."""
    return all(x == 0 for x in v)


def dot(u: Iterable[Scalar], v: Iterable[Scalar]) -> Scalar:
    total: Scalar = 0
    for a, b in zip(u, v, strict=True):
        total = total + a * b
    return total


def cross(u: Vector, v: Vector) -> Vector:
    return array(
        (
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        )
    )


class GraphAlgebra:
    """The expression graph of a robot, with methods that make nodes for its joints and constants.

    Parameters
    ----------
    robot : Robot
        The robot.
    written : bool
        Whether numbers that formulas keep as written are inputs; otherwise, their values are used.

    Attributes
    ----------
    sections : list of (int, str)
        Index of the first node under each heading, and the heading.
    labels : dict
        {label: angle}, for instance 23 for q2 + q3.
    """

    def __init__(self, robot: Robot, *, written: bool = True) -> None:
        self.robot = robot
        self.graph = Graph()
        self.written = written
        self.named = Names(len(robot.frames))
        self.sections: list[tuple[int, str]] = []
        self.labels: dict[str, Angle] = {}

    def section(self, title: str) -> None:
        """Start a section of the formulas: nodes made from now on are under the heading `title`."""
        self.sections.append((len(self.graph.nodes), title))

    def constant(self, e: Expression) -> Scalar:
        """Return the node of a constant expression, such as a length or cosine of a fixed angle."""
        return e.evaluate(self._constant, self._call, self.graph.number, self._number)

    def _constant(self, name: str) -> Scalar:
        return self.graph.symbol(Symbol("pi" if name == "pi" else "constant", name), fixed=True)

    def _number(self, number: Number) -> Scalar:
        if not self.written:
            return self.graph.number(number.value)
        return self.graph.symbol(Symbol("number", str(number.value)), fixed=True)

    def parameter(self, name: str) -> Scalar:
        """Return the node of a standard or base parameter."""
        return self.graph.symbol(Symbol("parameter", name), fixed=True)

    @property
    def base_motion(self) -> tuple[str, ...]:
        """Names of the motion of a moving base: W10, W20, W30, WP10 .. WP30, VP10 .. VP30.

        The vectors are w0 (rad/s), wd0 (rad/s**2) and a0 (m/s**2): angular velocity and
        acceleration of frame 0, and the acceleration of O_0 minus gravity, in the axes of frame 0.
        A fixed base has no such names.
        """
        families = BASE if self.robot.base_moves else ()
        return tuple(self.named(family, k, 0) for family in families for k in (1, 2, 3))

    @property
    def accelerations(self) -> tuple[str, ...]:
        """Names of the accelerations of a free base in the order of its rows: components of a0,
        then of wd0.
        """
        wd0, a0 = self.base_motion[3:6], self.base_motion[6:]
        return (*a0, *wd0) if self.robot.base_is_free else ()

    def base(self, family: str) -> Vector:
        """Return the nodes of w0 (family W), wd0 (WP) or a0 (VP) of a moving base."""
        names = (self.named(family, k, 0) for k in (1, 2, 3))
        return array([self.graph.symbol(Symbol("base", name)) for name in names])

    def gravity(self, axis: int) -> Scalar:
        """Return the node of one component of the negative gravity vector in frame 0, m/s**2, or
        the number 0.
        """
        symbol = Symbol("gravity", str(axis))
        return self.graph.symbol(symbol, fixed=True) if self.robot.gravity[axis] else 0

    def _call(self, function: str, argument: Expression) -> Scalar:
        x = self.graph.lift(self.constant(argument))
        if function == "inv":
            return self.graph.call(INV, x)
        of = call("sqrt", argument) if function == SQRT else Angle((), argument)
        return self.graph.call(function, x, of=of)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        """Return cosine and sine of sum_j n_j q_j + offset, for the pairs (j, n_j) of `turn`."""
        if not turn:
            return self.constant(call("cos", offset)), self.constant(call("sin", offset))
        quarters, rest = quarter_turns(offset)
        backward = turn[0][1] < 0
        about = -Angle(turn, rest) if backward else Angle(turn, rest)
        angle: Scalar = 0
        for j, n in about.turn:
            term = self.q(j)
            angle = angle + (term if n == 1 else -term if n == -1 else term * self.graph.lift(n))
        angle = self.graph.lift(angle + self.constant(about.offset))
        label = self._label(about.turn)
        while self.labels.setdefault(label, about) != about:
            label += "b"  # the same joints with another constant
        self.graph.name(angle, "th" + label)
        c, s = (self.graph.call(op, angle, of=about) for op in (COS, SIN))
        self.graph.name(c, "C" + label)
        self.graph.name(s, "S" + label)
        if backward:
            s = -s
        return ((c, s), (-s, c), (-c, -s), (s, -c))[quarters % 4]

    def _label(self, turn: Turn) -> str:
        """Return the index in names like C23: 23 for q2 + q3, 2m5 for q2 - q5, 2o5x3 for 2/5 q3."""
        text = ""
        for j, n in turn:
            times = f"{abs(n)}x".replace("/", "o") if abs(n) != 1 else ""
            text += ("m" if n < 0 else self.named.separator if text else "") + times + str(j)
        return text

    def q(self, j: int) -> Scalar:
        """Return the node of the position of joint j."""
        return self.graph.symbol(Symbol("q", f"q{j}"))

    def qd(self, j: int) -> Scalar:
        """Return the node of the velocity of joint j."""
        return self.graph.symbol(Symbol("qd", f"QP{j}"))

    def qdd(self, j: int) -> Scalar:
        """Return the node of the acceleration of joint j."""
        return self.graph.symbol(Symbol("qdd", f"QDP{j}"))

    def channel(self, name: str) -> Scalar:
        """Return the node of a channel (a quantity that the record gives at each sample, such as
        temperature).
        """
        return self.graph.symbol(Symbol("channel", name))

    def rate(self, u: int, i: int) -> Scalar:
        """Return the node of dq_u/dq_i, for a passive joint u and an actuated joint i.

        Only the closure equations relate such a joint u to the actuated joints.
        """
        return self.graph.symbol(Symbol("rate", self.named("G", u, i)))

    def sign(self, rate: Scalar, row: ActiveRow) -> Scalar:
        """Return the node of sign(sd) of a velocity sd = G qd; `rate` is sd, `row` is G."""
        return self.graph.call(SIGN, rate, of=Velocity(row))

    def one_sided(self, rate: Scalar, row: ActiveRow, when: str) -> tuple[Scalar, Scalar]:
        """Return nodes of sign(sd) and of the velocity sd, both zero if the motion is not in
        direction `when` (positive or negative).

        Both are nodes made of positive parts max(x, 0).
        """
        direction = self.sign(rate, row)
        if when == "positive":
            return self.graph.call(POS, direction), self.graph.call(POS, rate, of=Velocity(row))
        backward = self.graph.call(POS, -rate, of=-Velocity(row))
        return -self.graph.call(POS, -direction), -backward

    def function(self, op: str, *operands: Scalar | Fraction | int) -> Scalar:
        """Return a node that applies a function, such as exp or pow, to scalars."""
        return self.graph.call(op, *map(self.graph.lift, operands))

    def name(self, value: Scalar, name: str) -> Scalar:
        """Give a name, such as W12, to the node of a value, and return the value."""
        return self.graph.name(value, name)

    def hint(self, value: Scalar, name: str) -> Scalar:
        """Suggest a name for a value, used if it is needed more than once, and return the value."""
        return self.graph.hint(value, name)

    def vector(self, family: str, value: Iterable[Scalar], *indices: int) -> Vector:
        """Name the components of a vector, such as W12 (component 1, link 2); return the vector."""
        named = self.named
        return array([self.name(x, named(family, k, *indices)) for k, x in enumerate(value, 1)])

    def linear(self, row: Mapping[K, Expression], x: Mapping[K, Scalar]) -> Scalar:
        """Return sum_i row_i x_i, with constant expressions row_i and scalars x_i."""
        return dot([self.constant(g) for g in row.values()], [x[i] for i in row])

    def turned(self, turn: Turn, x: Mapping[int, Scalar]) -> Scalar:
        """Return sum_j n_j x_j for the pairs (j, n_j) of `turn`; a joint j missing in x counts as 0."""
        row = {j: Expression.number(n) for j, n in turn}
        return self.linear(row, {j: x.get(j, 0) for j in row})
