"""The recursion of a model as equations: every intermediate in the order in which it is computed, under the names of SYMORO.

What has a name of its own, and what is used more than once, has a line; everything else stands inside its only user: the rules of emitted code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

from symgen.derive.graph import COS, SIGN, SIN, SQRT, SYM, Node, Scalar
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.expression import decimal
from symgen.emit.printers import Text

T = TypeVar("T", bound=Text)


class PlainText(Text):
    """Equations in the grammar of robot files, numbers exact."""

    calls = {COS: "cos", SIN: "sin", SIGN: "sign", SQRT: "sqrt"}  # noqa: RUF012
    pi = "pi"

    def _number(self, c: Fraction) -> str:
        return decimal(c)

    def _clipped(self, x: str, bound: str) -> str:
        return f"{'max' if bound == 'maximum' else 'min'}({x}, 0)"


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
    """

    def __init__(self, algebra: GraphAlgebra, outputs: Mapping[str, Scalar | int], places: Sequence[tuple[int, ...]]) -> None:
        self.outputs, self.places, self.algebra = dict(outputs), list(places), algebra
        self.text = self.written(PlainText)

    def written(self, language: type[T]) -> T:
        """The steps in a language."""
        return language(list(self.outputs.values()), self.algebra.sections, self.algebra.robot.constants)

    @property
    def lines(self) -> list[Equation]:
        """Every step, then every output that is not zero."""
        equations = []
        for section in self.text.sections:
            for line in section.lines:
                name, _, expression = line.partition(" = ")
                equations.append(Equation(section.title, name, expression))
        results = [
            Equation("Result", label, str(x) if isinstance(x, int) else self.text.expression(x))
            for label, x in self.outputs.items()
            if not (isinstance(x, int) and x == 0)
        ]
        return equations + results

    def steps(self, operate: Callable[[Node, list[Any]], Any], symbol: Callable[[str], Any]) -> tuple[list[tuple[str, Any]], list[Any]]:
        """The same in other objects: (name, value) of every step, and the outputs.

        operate : makes a value from a node and the values of its operands. symbol : makes one from a name.
        """
        text = self.text
        value: dict[int, Any] = {}
        steps: list[tuple[str, Any]] = []
        for node in text.nodes:
            made = symbol(str(node.value)) if node.op == SYM else operate(node, [self._signed(x, value) for x in node.operands])
            if node.index in text.named:
                name = text.called[node.index]
                steps.append((name, made if node.name_sign > 0 else -made))
                made = symbol(name) if node.name_sign > 0 else -symbol(name)
            value[node.index] = made
        return steps, [x if isinstance(x, int) else self._signed(x, value) for x in self.outputs.values()]

    def _signed(self, x: Scalar, value: Mapping[int, Any]) -> Any:
        return value[x.node.index] if x.sign > 0 else -value[x.node.index]
