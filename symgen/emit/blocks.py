"""Functions of a robot, such as its inverse dynamics, as source text in any language.

The text of a function consists of its arguments, its lines, and the entries of its result.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

from symgen.derive.graph import SYM, Node
from symgen.derive.models import Entry
from symgen.description.naming import Namespace
from symgen.emit.printers import Language, Section, Text, under_titles
from symgen.emit.spec import BASE, STATES, Function, ModuleSpec


class Block(NamedTuple):
    """One function, such as the inverse dynamics, as source text: arguments, lines, result array.

    Attributes
    ----------
    function : Function
        Function that the text computes.
    text : Text
        Names and expressions of its values.
    sections : tuple of Section
        Lines that load the inputs and compute the steps, under headings.
    result : str
        Name of the result array in the text.
    arguments : tuple of str
        Names of the arguments: states, X and constants.
    constants : tuple of str
        Names of the constants among the arguments; constants that are functions of time come last.
    """

    function: Function
    text: Text
    sections: tuple[Section, ...]
    result: str
    arguments: tuple[str, ...]
    constants: tuple[str, ...]

    def results(self, target: Callable[[Sequence[int]], str]) -> list[Section]:
        """Write the assignments of the computed entries of the result array, grouped by headings.

        `target` turns an array index into the left side of an assignment, such as `A[0, 1]`.
        """
        language = self.text.language
        lines = []
        for entry in self.function.computed:
            targets = [target(place) for place in self.function.places(entry)]
            value = self.text.expression(entry.value)
            for line in language.entries(targets, value, entry.comment):
                lines.append((entry.heading, line))
        return [Section(s.title, aligned(s.lines, language)) for s in under_titles(lines)]


Inputs = Callable[[str, Sequence[tuple[int, str]], int], list[str]]
"""Lines that name entries (index, name) of a source that has so many."""


class FunctionPrinter:
    """Printer of several functions of a robot that are computed from one common expression graph.

    Parameters
    ----------
    spec : ModuleSpec
        All functions of the robot.
    functions : sequence of Function
        Functions to print; their entries are nodes of one graph.
    names : Namespace
        Names in use, so that no two quantities get the same name.
    language : Language
        Rules for the lines.
    inputs : callable
        Writes the lines that give names to entries of a state or of X.
    """

    def __init__(
        self,
        spec: ModuleSpec,
        functions: Sequence[Function],
        names: Namespace,
        language: Language,
        inputs: Inputs,
    ) -> None:
        self.spec, self.functions, self.inputs = spec, functions, inputs
        self.results = {f.model.name: names.own(f.model.result) for f in functions}
        self.rates = names.own("G") if spec.tied else ""
        outputs = [value for f in functions for value in f.values.outputs]
        labels = [label(f, e) for f in functions for e in f.values.entries]
        headings = functions[0].values.algebra.sections
        self.text = Text(outputs, headings, names, labels, language)
        nodes = [{n.index for n in f.nodes} for f in functions]
        self.shared = set.intersection(*nodes) if len(nodes) > 1 else set()

    @property
    def motion(self) -> tuple[Section, ...]:
        """Lines that come first in all functions: the states, and the motion of the links."""
        nodes = {n.index: n for f in self.functions for n in f.nodes}
        return self._sections({*BASE, *STATES, self.rates}, [*nodes.values()], self.shared)

    def block(self, f: Function) -> Block:
        """Write one function as source text, without the lines that all functions share."""
        spec = self.spec
        states, reads_X = f.model.states, ["X"] if f.model.reads_X else []
        if spec.tied and not f.model.of_loops:
            states = (*BASE * ("base" in states), "q", "qd", "qdd", self.rates)
        used = {n.value.name for n in f.nodes if n.op == SYM}
        constants = [c for c in spec.regrouping.constants if c in used]
        constants.sort(key=spec.robot.channels.__contains__)
        sources = reads_X if self.shared else [*states, *reads_X]
        own = {n.index for n in f.nodes} - self.shared
        return Block(
            f,
            self.text,
            self._sections(sources, f.nodes, own),
            self.results[f.model.name],
            (*states, *reads_X, *constants),
            tuple(constants),
        )

    def _sections(
        self, sources: Collection[str], read: Sequence[Node], own: Collection[int]
    ) -> tuple[Section, ...]:
        """Write the lines that compute the nodes `own` of the expression graph.

        Before them, the entries of `sources` (states, X) that the nodes `read` are get names.
        """
        spec = self.spec
        joints, independent = spec.robot.joints, spec.derivation.closure.independent
        (base,), algebra = BASE, spec.derivation.algebra
        items: dict[str, Sequence[str]] = {base: algebra.base_motion}
        items |= {s: [f"{letter}{j}" for j in independent] for s, letter in STATES.items()}
        items[self.rates] = [algebra.named("G", u, i) for u in spec.tied for i in joints]
        items["X"] = list(spec.regrouping.names)
        called = {str(n.value): self.text.called[n.index] for n in read if n.op == SYM}
        inputs: list[str] = []
        for source, names in items.items():
            wanted = [(k, called[x]) for k, x in enumerate(names) if x in called]
            inputs += self.inputs(source, wanted, len(names)) if source in sources else []
        sections = [Section("Inputs", tuple(inputs)), *self.text.sections_of(own)]
        return tuple(section for section in sections if section.lines)


def label(f: Function, entry: Entry) -> str:
    """Return the name of a result entry for use in comments, such as DG1ZZ2, GAM3 or A12."""
    name = entry.comment.partition(",")[0]
    return name or f"{f.model.result}{''.join(str(k + 1) for k in entry.place)}"


def aligned(lines: Sequence[str], language: Language) -> tuple[str, ...]:
    """Align the comments at the end of code lines in one column, at most column 64.

    Each given line has its comment after a tab.
    """
    parts = [line.partition("\t") for line in lines]
    width = min(max((len(code) for code, _, _ in parts), default=0), 64)
    mark = language.comment
    return tuple(
        f"{code:<{width}}  {mark} {comment}" if comment else code for code, _, comment in parts
    )
