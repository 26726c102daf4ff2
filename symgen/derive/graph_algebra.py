"""Constants, joint variables, cosines, sines and velocity signs of a robot as graph nodes.

Inputs of the graph are q1, QP1, QDP1 ... and the constants of the robot file under their names.
Numbers that formulas keep as written are inputs too, so that one graph serves all numbers. Each
node contains the description that exact arithmetic needs (see `graph.Node`).
"""

from __future__ import annotations

from fractions import Fraction

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
    Scalar,
    Symbol,
    Turn,
    Velocity,
)
from symgen.derive.names import Names
from symgen.description.expression import Expression, Number, call, quarter_turns
from symgen.description.robot import Robot


class GraphAlgebra:
    """The expression graph of a robot, with methods that make nodes for its joints and constants.

    Parameters
    ----------
    robot : Robot
        The robot.
    written : bool
        Whether numbers that formulas keep as written are inputs; if not, their values are used.

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

    def constant(self, e: Expression) -> Scalar | int:
        """Return the node of a constant expression, such as a length or cosine of a fixed angle."""
        value: Scalar | int = e.evaluate(
            self._constant, self._call, self.graph.number, self._number
        )
        return value

    def _constant(self, name: str) -> Scalar:
        return self.graph.symbol(Symbol("pi" if name == "pi" else "constant", name), fixed=True)

    def _number(self, number: Number) -> Scalar | int:
        if not self.written:
            return self.graph.number(number.value)
        return self.graph.symbol(Symbol("number", str(number.value)), fixed=True)

    def parameter(self, name: str) -> Scalar:
        """Return the node of a standard or base parameter."""
        return self.graph.symbol(Symbol("parameter", name), fixed=True)

    def gravity(self, axis: int) -> Scalar | int:
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

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar | int, Scalar | int]:
        """Return cosine and sine of sum_j n_j q_j + offset, for the pairs (j, n_j) of `turn`."""
        if not turn:
            return self.constant(call("cos", offset)), self.constant(call("sin", offset))
        quarters, rest = quarter_turns(offset)
        backward = turn[0][1] < 0
        about = -Angle(turn, rest) if backward else Angle(turn, rest)
        angle: Scalar | int = 0
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

    def name(self, value: Scalar | int, name: str) -> Scalar | int:
        """Give a name, such as W12, to the node of a value, and return the value."""
        return self.graph.name(value, name)

    def hint(self, value: Scalar | int, name: str) -> Scalar | int:
        """Suggest a name for a value, used if it is needed more than once, and return the value."""
        return self.graph.hint(value, name)
