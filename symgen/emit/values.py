"""Equal values are one node: a graph rebuilt with every node that has the same value over F_p merged, up to sign.

Hash-consing finds what is written alike; a few nodes are equal but written differently, and some differences of equal products
vanish identically. Both show at random states of a random geometry over F_p, which never rounds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.derive.exact import Array, Draw, Fp, power
from symgen.derive.graph import CONST, COS, INV, POS, SIGN, SIN, SQRT, Graph, Node, Scalar, reachable
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.names import families_of
from symgen.description.expression import Expression

SAMPLES = 3
RECURSIVE = {"W", "WP", "DV", "DW", "U", "VSP", "VP"}  # families whose line is their definition in the recursion, or absent


class Program:
    """A graph without repeated values: `outputs` correspond to those given, `sections` to those of the algebra."""

    def __init__(self, algebra: GraphAlgebra, outputs: Sequence[Scalar | int]) -> None:
        self.algebra, self.graph = algebra, Graph()
        self.draw = Draw(algebra.robot, 7, SAMPLES)
        self.p = self.draw.p
        rng = np.random.default_rng(5)
        self._rate: dict[str, Array] = {}  # of tied joints, by name
        self._direction: dict[int, Array] = {}
        self._rng = rng
        self.value: dict[int, Array] = {}  # of the nodes of self.graph
        self._known: dict[tuple[int, ...], Scalar] = {}
        self._image: dict[int, Scalar | int] = {}
        self.sections: list[tuple[int, str]] = []
        starts = list(algebra.sections)
        for node in reachable(outputs):
            while starts and starts[0][0] <= node.index:
                self.sections.append((len(self.graph.nodes), starts.pop(0)[1]))
            self._image[node.index] = self._rebuild(node)
        self.outputs = [self.map(o) for o in outputs]

    def map(self, s: Scalar | int) -> Scalar | int:
        if not isinstance(s, Scalar):
            return s
        image = self._image[s.node.index]
        return image if s.sign > 0 else -image

    def _rebuild(self, node: Node) -> Scalar | int:
        image = made = self._operate(node, [self.map(x) for x in node.operands])
        if isinstance(image, Scalar) and image.node.index not in self.value:
            image = self._numbered(image, self._evaluate(node, image.node) if image.node.op == node.op else self._of(image.node))
        if isinstance(image, Scalar) and isinstance(made, Scalar):
            merged = image.node is not made.node  # U = DV - WP is a product of WP = DV - product: its name would turn the recursion around
            if node.name is not None and not (merged and RECURSIVE & {*families_of([node.name])}):
                self.graph.name(image if node.name_sign > 0 else -image, node.name)
            elif node.hint is not None:
                self.graph.hint(image if node.name_sign > 0 else -image, node.hint)
        return image

    def _operate(self, node: Node, x: list[Scalar | int]) -> Scalar | int:
        graph = self.graph
        match node.op:
            case "sym":
                return graph.symbol(node.value, fixed=node.fixed)
            case "const":
                return graph.lift(node.value)
            case "add":
                return x[0] + x[1]
            case "mul":
                return x[0] * x[1]
        call = {COS: graph.cos, SIN: graph.sin, SIGN: graph.sign, POS: graph.positive_part, SQRT: graph.sqrt, INV: graph.inverse}[node.op]
        return call(graph.lift(x[0]))

    def _numbered(self, image: Scalar, value: Array) -> Scalar | int:
        """`image`, or the equal node that was there before; `value` is that of the node, without the sign of the edge."""
        if image.sign < 0:
            return -self._numbered(-image, value)
        value = (value if len(value) == SAMPLES else np.repeat(value, SAMPLES)) % self.p
        residues = value.tolist()
        if residues[0] in (0, 1, self.p - 1) and len({*residues}) == 1 and image.node.op != CONST:
            return residues[0] if residues[0] < 2 else -1
        flip = residues[0] > self.p // 2
        key = tuple(-x % self.p if flip else x for x in residues)
        if key in self._known:
            twin = self._known[key]
            return -twin if flip else twin
        self._known[key] = -image if flip else image
        self.value[image.node.index] = value
        return image

    def _of(self, node: Node) -> Array:
        """Value of a node that the rebuilt graph simplified into another operation (2 x, say)."""
        if node.index not in self.value:
            self.value[node.index] = self._evaluate(node, node)
        return self.value[node.index]

    def _operand(self, s: Scalar) -> Array:
        value = self._of(s.node)
        return value if s.sign > 0 else -value % self.p

    def _evaluate(self, source: Node, node: Node) -> Array:
        p = self.p
        match node.op:
            case "sym":
                return self._symbol(str(node.value))
            case "const":
                return np.array([node.value.numerator * pow(node.value.denominator, -1, p) % p])
            case "add":
                return np.asarray((self._operand(node.operands[0]) + self._operand(node.operands[1])) % p)
            case "mul":
                return np.asarray(self._operand(node.operands[0]) * self._operand(node.operands[1]) % p)
            case "cos" | "sin":
                turn, offset = self.algebra.angles[source.index]
                point = self.draw.cos_sin(turn, offset)[node.op == "sin"]
                return point.x if isinstance(point, Fp) else np.array([point % p])
            case "sqrt":
                return np.asarray(self.draw.constant(self.algebra.roots[source.index]).x)
            case "inv":
                return power(self._operand(node.operands[0]), p - 2, p)
        return self._directed(node)

    def _directed(self, node: Node) -> Array:
        """sign(x) = 2b - 1, max(x, 0) = b x, max(sign(x), 0) = b, with b of the node x."""
        (x,) = node.operands
        of_sign = x.node.op == SIGN
        along = x.node.operands[0].node.index if of_sign else x.node.index
        if along not in self._direction:
            self._direction[along] = self._rng.integers(1, self.p, SAMPLES)
        b = self._direction[along]
        if node.op == SIGN:
            return (2 * b - 1) % self.p
        step = b if x.sign > 0 else (1 - b) % self.p
        return step if of_sign else step * self._operand(x) % self.p

    def _symbol(self, name: str) -> Array:
        if name in self.algebra.robot.constants:
            return np.asarray(self.draw.constant(Expression.symbol(name)).x)
        if name == "pi":
            return self._rng.integers(1, self.p, 1)
        if name.startswith("G"):  # rate of a tied joint
            return self._rate.setdefault(name, self._rng.integers(1, self.p, SAMPLES))
        kind, j = name.rstrip("0123456789"), int(name[len(name.rstrip("0123456789")) :])
        return {"q": self.draw.q, "QP": self.draw.qd, "QDP": self.draw.qdd}[kind](j).x
