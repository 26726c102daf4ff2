"""The recursion of a model as equations: every intermediate in the order in which it is computed,
under the names of SYMORO.

What has a name of its own, and what is used more than once, has a line; everything else stands
inside its only user: the rules of emitted code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from symgen.derive.graph import SYM, Node, Scalar
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.namespace import Namespace
from symgen.emit.printers import PLAIN, Text


@dataclass(frozen=True)
class Equation:
    """name = expression, both as text; `section` is the heading that it stands under."""

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
        self.outputs, self.places = dict(outputs), list(places)
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
        self, operate: Callable[[Node, list[Any]], Any], symbol: Callable[[str], Any]
    ) -> tuple[dict[str, Any], list[Any]]:
        """The same in other objects: {name: value} of every step, and the outputs.

        operate : makes a value from a node and the values of its operands. symbol : makes one from
        a name.
        """
        text = self.text
        value: dict[int, Any] = {}
        steps: dict[str, Any] = {}

        def signed(x: Scalar | int) -> Any:
            return x if isinstance(x, int) else x.sign * value[x.node.index]

        for node in text.nodes:
            if node.op == SYM:
                made = symbol(text.called[node.index])
            else:
                made = operate(node, [signed(x) for x in node.operands])
            if node.index in text.named:
                name = text.called[node.index]
                steps[name] = text.sign[node.index] * made
                made = text.sign[node.index] * symbol(name)
            value[node.index] = made
        return steps, [signed(x) for x in self.outputs.values()]
