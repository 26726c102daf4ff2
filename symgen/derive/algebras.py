"""Two algebras for the recursions: graph nodes, which become text, and float arrays, which check it."""

from __future__ import annotations

from fractions import Fraction

from symgen.derive.graph import Graph
from symgen.derive.names import Names
from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import ZERO, Expression
from symgen.description.robot import Robot


class GraphAlgebra:
    """Scalars are nodes of one graph: inputs q, QP, QDP per joint, constants by their names in the robot file."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.graph = robot, Graph()
        self.named = Names(len(robot.frames))
        self.constants: dict[Expression, Scalar] = {}  # calls of constants (cos(alpha), ...), in order of appearance

    def constant(self, e: Expression) -> Scalar:
        return e.evaluate(lambda name: self.graph.symbol(name, fixed=True), self._call, self._number)

    def _number(self, c: Fraction) -> Scalar:
        return self.graph.number(c)

    def _call(self, function: str, argument: Expression) -> Scalar:
        raise NotImplementedError

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        from symgen.description.expression import call

        if not turn:
            return self.constant(call("cos", offset)), self.constant(call("sin", offset))
        suffix = self.named.separator.join(str(j) for j, _ in turn)
        return self.graph.symbol("C" + suffix), self.graph.symbol("S" + suffix)

    def q(self, j: int) -> Scalar:
        return self.graph.symbol(f"q{j}")

    def qd(self, j: int) -> Scalar:
        return self.graph.symbol(f"QP{j}")

    def qdd(self, j: int) -> Scalar:
        return self.graph.symbol(f"QDP{j}")

    def name(self, value: Scalar, name: str) -> Scalar:
        return self.graph.name(value, name)


_ = ZERO
