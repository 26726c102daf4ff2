"""The recursion of a model as a list of equations, in the order in which they are computed.

Intermediate variables have the names of SYMORO. As in emitted code, an expression has an equation
of its own if it has a name or is used more than once; any other expression is written inside the
only equation that uses it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from symgen.derive.graph import SYM, Domain, Scalar, interpret
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.expression import Expression
from symgen.description.grammar import parse
from symgen.description.naming import Namespace
from symgen.emit.printers import PLAIN, Text
from symgen.symbols.expressions import rounded


@dataclass(frozen=True)
class Equation:
    """An equation `name = expression` as two texts, printed under the heading `section`."""

    section: str
    name: str
    expression: str


class Listing:
    """The equations that compute the entries of a model, intermediate variables first.

    Parameters
    ----------
    algebra : GraphAlgebra
        The algebra that made the graph of the outputs.
    outputs : mapping
        Value of each entry of the model, by its label.
    places : sequence of tuple
        Indices of each entry in the model.
    parameters : iterable of str
        Names of the parameters, which no intermediate variable may have.
    decimals : bool
        Whether constants are written as decimals, such as SA2 = 0.999 in place of sin(1.571).
    """

    def __init__(
        self,
        algebra: GraphAlgebra,
        outputs: Mapping[str, Scalar | int],
        places: Sequence[tuple[int, ...]],
        parameters: Iterable[str],
        *,
        decimals: bool = False,
    ) -> None:
        self.decimals = decimals
        self.graph, self.outputs, self.places = algebra.graph, dict(outputs), list(places)
        values = list(self.outputs.values())
        names = Namespace((*algebra.robot.constants, *parameters))
        labels = [x.replace("(", "").replace(")", "").replace(",", "") for x in self.outputs]
        self.text = Text(values, algebra.sections, names, labels, PLAIN)

    @property
    def lines(self) -> list[Equation]:
        """Equations of all intermediate variables, then of all nonzero entries of the model."""
        steps = [
            Equation(section.title, *line.split(" = ", 1))
            for section in self.text.sections
            for line in section.lines
        ]
        if self.decimals:
            steps = _in_decimals(steps)
        results = [
            Equation("Result", label, str(x) if isinstance(x, int) else self.text.expression(x))
            for label, x in self.outputs.items()
            if isinstance(x, Scalar) or x
        ]
        return steps + results

    def steps(
        self, domain: Domain, symbol: Callable[[str], Any]
    ) -> tuple[dict[str, Any], list[Any]]:
        """Convert the equations to objects other than texts, such as SymPy expressions.

        Returns the value of each intermediate variable by name, and the list of the outputs. Each
        value is in terms of the symbols of the inputs and of earlier variables.

        domain : operations on the values of nodes.
        symbol : function that makes a symbol from its name.
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


def _in_decimals(equations: Sequence[Equation]) -> list[Equation]:
    """Replace the right-hand sides of constants that depend on numbers alone by decimals."""
    values: dict[str, Expression] = {}
    result = []
    for equation in equations:
        if equation.section == "Constants":
            value = parse(equation.expression, None).substitute(values)
            if not value.symbols:
                values[equation.name] = value = rounded(value)
                equation = replace(equation, expression=str(value))
        result.append(equation)
    return result
