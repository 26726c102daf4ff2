"""Angles of a graph: the sine of a sum that begins with a subtracted joint, in whatever order its
nodes were made.
"""

from __future__ import annotations

import itertools
import math

from symgen.derive.algebra import GraphAlgebra
from symgen.description import load_robot
from symgen.description.expression import ZERO


def test_angles_are_those_of_the_nodes() -> None:
    """five_bar: sin(q1 + q2 - q3 - q4) was recorded with the wrong sign where q3 stood before q1 +
    q2 in the graph.
    """
    q = {"q1": 0.3, "q2": 0.7, "q3": -0.4, "q4": 1.1}
    turn = ((1, 1), (2, 1), (3, -1), (4, -1))
    for order in itertools.permutations(q):
        algebra = GraphAlgebra(load_robot("five_bar"))
        for name in order:
            algebra.q(int(name[1:]))
        algebra.cos_sin(((1, 1), (2, 1)), ZERO)
        _, s = algebra.cos_sin(turn, ZERO)
        value: dict[int, float] = {}
        for node in algebra.graph.nodes:
            x = [(1 if o.sign > 0 else -1) * value[o.node.index] for o in node.operands]
            match node.op:
                case "sym":
                    value[node.index] = q[str(node.value)]
                case "const":
                    value[node.index] = float(node.value)
                case "add":
                    value[node.index] = sum(x)
                case _:
                    value[node.index] = getattr(math, node.op)(x[0])
        told, _ = s.node.value
        assert math.isclose(value[s.node.index], math.sin(sum(n * q[f"q{j}"] for j, n in told)))
        assert math.isclose(
            s.sign * value[s.node.index], math.sin(sum(n * q[f"q{j}"] for j, n in turn))
        )
