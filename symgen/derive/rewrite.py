"""Graph of one model, copied from the graph of the derivation with some inputs replaced.

Every model is the recursion with some inputs set. The bias is Gamma at qdd = 0. A column of the
inertia matrix is Gamma of a unit acceleration at qd = 0 without gravity. Base parameters replace
the standard parameters of the same name, and all other standard parameters are 0. Terms that become
zero disappear.

Hash-consing finds equal values that are written in the same way. Some nodes are equal but written
differently, and some differences of equal products vanish identically. Both are found at random
states of a random geometry over F_p, which never rounds: nodes with the same value up to sign are
merged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

from symgen.derive.algebra import GraphAlgebra
from symgen.derive.exact import Draw, Fp
from symgen.derive.graph import (
    ADD,
    CONST,
    COS,
    SIGN,
    SIN,
    SQRT,
    Node,
    Scalar,
    Symbol,
    reachable,
    value_of,
)
from symgen.derive.names import families_of
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.robot import Robot

SAMPLES = 3
NUMBERS = ((0,) * SAMPLES, (1,) * SAMPLES)  # the values of 0 and 1
RECURSIVE = {"W", "WP", "DV", "DW", "U", "VSP", "VP"}
"""Families whose line is their definition in the recursion, or absent."""

Input = Expression | Symbol | Callable[[GraphAlgebra], Scalar | int]
Inputs = Mapping[Symbol, Input]


class ByNode(Draw):
    """Random values modulo a prime p, with the sign of each velocity independent of all other
    signs.

    sign(K qd) is not treated as sign(qd), since K may be negative.
    """

    def forward(self, node: Node, rate: Fp) -> Fp:
        return self._opaque(SIGN, [rate])


@lru_cache(maxsize=8)
def _draw(robot: Robot) -> ByNode:
    return ByNode(robot, 7, SAMPLES)


class Rewrite:
    """A new graph, `algebra`, to which nodes of a derivation are copied with some inputs replaced.

    Parameters
    ----------
    source : GraphAlgebra
        The graph of the derivation.
    inputs : mapping
        {input: its replacement}, which is a symbol, a constant expression, or a function that
        returns a value in the new graph. Other inputs stay as they are.
    """

    def __init__(self, source: GraphAlgebra, inputs: Inputs) -> None:
        self.source = source
        self.inputs = inputs
        self.algebra = GraphAlgebra(source.robot, written=False)
        self.algebra.labels |= source.labels  # one name, one angle, here as there
        self.graph = self.algebra.graph
        self.draw = _draw(source.robot)
        self._values: list[Any] = []  # of the nodes of self.graph, over F_p
        self._first: dict[tuple[int, ...], Scalar] = {}  # by value
        self._same: dict[int, Scalar | int] = {}  # of a node: the first one of the same value
        self._image: dict[int, Scalar | int] = {}
        self._replaced: set[int] = set()  # nodes of the source that depend on inputs of one case

    def copied(
        self, outputs: Sequence[Scalar | int], inputs: Inputs | None = None, tag: str = ""
    ) -> list[Scalar | int]:
        """Copy the nodes `outputs` of the derivation to the new graph; replace `inputs` in this
        call only.

        These replacements have priority over those of the Rewrite. Names of intermediate variables
        that depend on a replacement end in `tag`.
        """
        self._case = inputs or {}
        self._tag = tag
        for index in self._replaced:
            del self._image[index]
        self._replaced = set()
        headings = list(self.source.sections)
        for node in reachable(outputs):
            while headings and headings[0][0] <= node.index:
                self.algebra.section(headings.pop(0)[1])
            if inputs and (
                node.value in inputs or any(x.node.index in self._replaced for x in node.operands)
            ):
                self._replaced.add(node.index)
            if node.index not in self._image:
                self._image[node.index] = self._rebuilt(node)
        return [self._of_source(o) for o in outputs]

    def _of_source(self, s: Scalar | int) -> Scalar | int:
        if not isinstance(s, Scalar):
            return s
        image = self._image[s.node.index]
        return image if s.sign > 0 else -image

    def _rebuilt(self, node: Node) -> Scalar | int:
        before = len(self.graph.nodes)
        image = self._made(node, [self._of_source(x) for x in node.operands])
        if isinstance(image, Scalar):
            image = self._merged(image)
        if isinstance(image, Scalar):
            self._name(node, image, merged=image.node.index < before)
        return image

    def _name(self, node: Node, image: Scalar, *, merged: bool) -> None:
        """Give a copied node the name of its original.

        A node that was merged with an earlier node gets no name of a quantity of the recursion,
        such as U or WP. Otherwise U = DV - WP, if it equals a product in WP = DV - product, would
        turn the recursion around.
        """
        signed = image if node.name_sign > 0 else -image
        tag = self._tag if node.index in self._replaced else ""
        if node.name is not None:
            if not (merged and RECURSIVE & {*families_of([node.name])}):
                self.graph.name(signed, node.name + tag)
        elif node.hint is not None:
            self.graph.hint(signed, node.hint + tag)

    def _made(self, node: Node, x: list[Scalar | int]) -> Scalar | int:
        graph = self.graph
        match node.op:
            case "sym":
                return self._symbol(node.value)
            case "const":
                return graph.lift(node.value)
            case "add":
                return self._sum(*x)
            case "mul":
                return x[0] * x[1]
            case "cos" | "sin" if self._is_given(node):
                turn, offset = node.value
                given = {j: self.inputs.get(Symbol("q", f"q{j}")) for j, _ in turn}
                for j, n in turn:
                    if isinstance(value := given[j], Expression):
                        offset = offset + value * n
                turn = tuple((j, n) for j, n in turn if given[j] is None)
                image: Scalar | int = self.algebra.cos_sin(turn, offset)[node.op == SIN]
                return image
            case "pos" if x[0] == 0:
                return 0
            case op if op in FUNCTIONS and x[0] == 0:
                at_zero = FUNCTIONS[op].at_zero
                if at_zero is not None:
                    return at_zero
        operand, *more = map(graph.lift, x)
        of = node.value if node.op in (COS, SIN, SQRT) else None
        return graph.call(node.op, operand, *more, of=of)

    def _sum(self, a: Scalar | int, b: Scalar | int) -> Scalar | int:
        """Return a + b without terms that cancel: (x + y) + (z - x) = y + z."""
        for (x, y), (o, z) in product(_parts(a), _parts(b)):
            if o.node is x.node and o.sign != x.sign:
                return self._sum(y, z)
        return a + b

    def _is_given(self, node: Node) -> bool:
        """Whether the angle of a cosine or sine contains a joint position that is replaced."""
        return node.value is not None and any(
            Symbol("q", f"q{j}") in self.inputs for j, _ in node.value.turn
        )

    def _symbol(self, symbol: Symbol) -> Scalar | int:
        value = self._case.get(symbol, self.inputs.get(symbol, symbol))
        if isinstance(value, Expression):
            given: Scalar | int = self.algebra.constant(value)
            return given
        if not isinstance(value, Symbol):
            return value(self.algebra)
        if value.kind == "number":
            return self.graph.number(Fraction(value.name))
        fixed = value.kind in ("constant", "pi", "parameter", "gravity")
        return self.graph.symbol(value, fixed=fixed)

    # --- values over F_p ---

    def _merged(self, image: Scalar) -> Scalar | int:
        """Return an earlier node, or a number, that equals the new node `image`, else `image`."""
        node = image.node
        if node.index not in self._same:
            self._same[node.index] = self._first_of(node)
        same = self._same[node.index]
        return same if image.sign > 0 else -same

    def _first_of(self, node: Node) -> Scalar | int:
        """Return 0, 1 or -1 if the node has this value, else the first node of equal value."""
        for new in self.graph.nodes[len(self._values) :]:
            self._values.append(value_of(new, self.draw, self._values))
        p = self.draw.p
        residues = tuple(self.draw.residues(self._values[node.index]).tolist())
        if len(residues) < SAMPLES:
            residues *= SAMPLES
        sign = -1 if residues[0] > p // 2 else 1
        if sign < 0:
            residues = tuple(-x % p for x in residues)
        if residues in NUMBERS and node.op != CONST:
            return sign if residues[0] else 0
        first = self._first.setdefault(residues, Scalar(self.graph, node, sign))
        return first if sign > 0 else -first


def _parts(s: Scalar | int) -> Iterator[tuple[Scalar, Scalar | int]]:
    """Yield pairs (term, rest) whose sum is the value s; the first pair is s with rest 0."""
    if isinstance(s, Scalar):
        yield s, 0
        if s.node.op == ADD:
            x, y = (o if s.sign > 0 else -o for o in s.node.operands)
            yield from ((x, y), (y, x))
