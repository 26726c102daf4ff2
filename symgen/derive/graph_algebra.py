"""The algebra of graph nodes: the recursions over it become text."""

from __future__ import annotations

from symgen.derive.graph import COS, INV, POS, SIGN, SIN, SQRT, Graph, Symbol
from symgen.derive.names import Names
from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import Expression, call, quarter_turns
from symgen.description.robot import Robot

ActiveRow = tuple[tuple[int, Expression], ...]


class GraphAlgebra:
    """Scalars are nodes of one graph: inputs q1, QP1, QDP1 ... and the constants of the robot file
    under their names.

    `sections` are (index of the first node, title); `angles` holds the angle of every cos and sin
    node, `roots` every square root.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self.graph = robot, Graph()
        self.named = Names(len(robot.frames))
        self.sections: list[tuple[int, str]] = []
        self.angles: dict[int, tuple[Turn, Expression]] = {}
        self.roots: dict[int, Expression] = {}
        self.labels: dict[str, tuple[Turn, Expression]] = {}

    def section(self, title: str) -> None:
        self.sections.append((len(self.graph.nodes), title))

    def constant(self, e: Expression) -> Scalar:
        return e.evaluate(self._constant, self._call, self.graph.number)

    def _constant(self, name: str) -> Scalar:
        return self.graph.symbol(Symbol("pi" if name == "pi" else "constant", name), fixed=True)

    def parameter(self, name: str) -> Scalar:
        """A standard or base parameter."""
        return self.graph.symbol(Symbol("parameter", name), fixed=True)

    def gravity(self, axis: int) -> Scalar:
        symbol = Symbol("gravity", str(axis))
        return self.graph.symbol(symbol, fixed=True) if self.robot.gravity[axis] else 0

    def _call(self, function: str, argument: Expression) -> Scalar:
        x = self.graph.lift(self.constant(argument))
        if function in ("cos", "sin"):
            value = self.graph.call(function, x)
            self.angles[value.node.index] = (
                (),
                argument if value.sign > 0 or function == "cos" else -argument,
            )
            return value
        if function == "inv":
            return self.graph.call(INV, x)
        root = self.graph.call(SQRT, x)
        self.roots[root.node.index] = call("sqrt", argument)
        return root

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        if not turn:
            return self.constant(call("cos", offset)), self.constant(call("sin", offset))
        quarters, rest = quarter_turns(offset)
        forward = turn[0][1] > 0
        if not forward:
            turn, rest = tuple((j, -n) for j, n in turn), -rest
        angle: Scalar = 0
        for j, n in turn:
            term = self.graph.symbol(Symbol("q", f"q{j}"))
            angle = angle + (term if n == 1 else -term if n == -1 else term * self.graph.lift(n))
        angle = angle + self.constant(rest)
        label = self._label(turn)
        while self.labels.setdefault(label, (turn, rest)) != (turn, rest):
            label += "b"  # the same joints with another constant
        self.graph.name(angle, "th" + label)
        c, s = self.graph.call(COS, angle), self.graph.call(SIN, angle)
        for value, letter in ((c, "C"), (s, "S")):
            backward = value.sign < 0
            self.angles[value.node.index] = (
                (tuple((j, -n) for j, n in turn), -rest) if backward else (turn, rest)
            )
            self.graph.name(value, letter + label)
        if not forward:
            s = -s
        return ((c, s), (-s, c), (-c, -s), (s, -c))[quarters % 4]

    def _label(self, turn: Turn) -> str:
        """23 for q2 + q3, 5m2 for q5 - q2, 2x3 for 2 q3, 2o5x3 for 2/5 q3."""
        text = ""
        for j, n in turn:
            times = f"{abs(n)}x".replace("/", "o") if abs(n) != 1 else ""
            text += ("m" if n < 0 else self.named.separator if text else "") + times + str(j)
        return text

    def q(self, j: int) -> Scalar:
        return self.graph.symbol(Symbol("q", f"q{j}"))

    def qd(self, j: int) -> Scalar:
        return self.graph.symbol(Symbol("qd", f"QP{j}"))

    def qdd(self, j: int) -> Scalar:
        return self.graph.symbol(Symbol("qdd", f"QDP{j}"))

    def channel(self, name: str) -> Scalar:
        return self.graph.symbol(Symbol("channel", name))

    def rate(self, u: int, i: int) -> Scalar:
        return self.graph.symbol(Symbol("rate", self.named("G", u, i)))

    def sign(self, rate: Scalar, row: ActiveRow) -> Scalar:
        return self.graph.call(SIGN, rate)

    def function(self, op: str, *operands: Scalar) -> Scalar:
        return self.graph.call(op, *map(self.graph.lift, operands))

    def one_sided(self, rate: Scalar, row: ActiveRow, when: str) -> tuple[Scalar, Scalar]:
        forward = when == "positive"
        sides = [x if forward else -x for x in (self.graph.call(SIGN, rate), rate)]
        parts = [self.graph.call(POS, x) for x in sides]
        direction, speed = (x if forward else -x for x in parts)
        return direction, speed

    def name(self, value: Scalar, name: str) -> Scalar:
        return self.graph.name(value, name)

    def hint(self, value: Scalar, name: str) -> Scalar:
        return self.graph.hint(value, name)
