"""The recursion of a model as equations: every intermediate in the order in which it is computed, under the names of SYMORO.

What has a name of its own, and what is used more than once, has a line; everything else stands
inside its only user: the rules of emitted code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from symgen.derive.graph import SYM, Domain, Scalar, interpret
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.naming import Namespace
from symgen.emit.printers import PLAIN, Text


@dataclass(frozen=True)
class Equation:
    """name = expression, both as text, under the heading `section`."""

    section: str
    name: str
    expression: str


class Listing:
    """The equations that lead to some outputs.

    Parameters
    ----------
    algebra : GraphAlgebra
        Whose graph the outputs are of.
    outputs : mapping
        Value of each entry, by its label.
    places : sequence of tuple
        Place of each entry in the model.
    parameters : iterable of str
        Their names, which no step may have.
    """

    def __init__(
        self,
        algebra: GraphAlgebra,
        outputs: Mapping[str, Scalar | int],
        places: Sequence[tuple[int, ...]],
        parameters: Iterable[str],
    ) -> None:
        self.graph, self.outputs, self.places = algebra.graph, dict(outputs), list(places)
        values = list(self.outputs.values())
        names = Namespace((*algebra.robot.constants, *parameters))
        labels = [x.replace("(", "").replace(")", "").replace(",", "") for x in self.outputs]
        self.text = Text(values, algebra.sections, names, labels, PLAIN)

    @property
    def lines(self) -> list[Equation]:
        """Every step, then every output that is not zero."""
        steps = [
            Equation(section.title, *line.split(" = ", 1))
            for section in self.text.sections
            for line in section.lines
        ]
        results = [
            Equation("Result", label, str(x) if isinstance(x, int) else self.text.expression(x))
            for label, x in self.outputs.items()
            if isinstance(x, Scalar) or x
        ]
        return steps + results

    def steps(
        self, domain: Domain, symbol: Callable[[str], Any]
    ) -> tuple[dict[str, Any], list[Any]]:
        """The same in other objects: {name: value} of every step, and the outputs.

        domain : where the values of nodes are. symbol : makes one from a name.
        """
        text = self.text
        value = {n.index: symbol(text.called[n.index]) for n in text.nodes if n.op == SYM}
        steps: dict[str, Any] = {}
        for node in text.nodes:
            if node.index in text.named:
                name, sign = text.called[node.index], text.sign[node.index]
                (made,) = interpret([self.graph.scalar(node.index, sign)], domain, value)
                steps[name] = made
                value[node.index] = sign * symbol(name)
        return steps, interpret([*self.outputs.values()], domain, value)
