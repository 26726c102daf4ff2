"""Functions of a robot, such as its inverse dynamics, as source text in any language.

For each function: its arguments, its lines, and the entries of its result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from symgen.derive.graph import SYM, Node, Scalar
from symgen.derive.models import Entry
from symgen.description.naming import Namespace
from symgen.emit.printers import Language, Section, Text, under_titles
from symgen.emit.spec import STATES, Function, ModuleSpec


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


Call = Callable[[Sequence[str], Sequence[str]], list[str]]
"""Lines that give names to what a function of some arguments gives, _ to what is not read."""


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
        self.shared: set[int] = set()  # nodes of all functions, where there are several
        if len(functions) > 1:
            self.shared = set.intersection(*({n.index for n in f.nodes} for f in functions))

    @property
    def given(self) -> list[str]:
        """Names of the intermediate variables that are computed once for all functions."""
        read = {n.index for f in self.functions for n in self._read(f)}
        return [self.text.called[k] for k in sorted(read & self.shared & self.text.named)]

    @property
    def motion(self) -> Block:
        """Source text that computes the intermediate variables common to all functions: the link
        motion.
        """
        own = [n for n in self.functions[0].nodes if n.index in self.shared]
        operands = {x.node.index for n in own for x in n.operands}
        return self._block(self.functions[0], own, [n for n in own if n.index in operands], ())

    def block(self, f: Function, call: Call = lambda names, arguments: []) -> Block:
        """Write one function as source text; the link motion, which all functions share, is not
        written again.

        `call` writes the lines that get the shared variables from the block `motion`.
        """
        own = [n for n in f.nodes if n.index not in self.shared]
        names = {self.text.called.get(n.index, "") for n in self._read(f)}
        given = [name if name in names else "_" for name in self.given]
        lines = call(given, self.motion.arguments) if self.shared else []
        return self._block(f, own, self._read(f), lines)

    def _read(self, f: Function) -> list[Node]:
        """List the nodes of the expression graph that the lines of a function use or compute."""
        read = {o.node.index for o in f.values.outputs if isinstance(o, Scalar)}
        for node in f.nodes:
            if node.index not in self.shared:
                read |= {node.index, *(x.node.index for x in node.operands)}
        return [node for node in f.nodes if node.index in read]

    def _block(
        self, f: Function, own: Sequence[Node], read: Sequence[Node], call: Sequence[str]
    ) -> Block:
        """Write the lines that compute the nodes `own` of the expression graph, with their inputs.

        `read` are the nodes that these lines use. The lines `call` stand before the steps and
        provide the shared values.
        """
        spec = self.spec
        joints, independent = spec.robot.joints, spec.derivation.closure.independent
        sources = {s: [f"{letter}{j}" for j in independent] for s, letter in STATES.items()}
        sources[self.rates] = [
            spec.derivation.algebra.named("G", u, i) for u in spec.tied for i in joints
        ]
        sources["X"] = list(spec.regrouping.names)
        called = {str(n.value): self.text.called[n.index] for n in read if n.op == SYM}
        inputs: list[str] = []
        for source, items in sources.items():
            wanted = [(k, called[item]) for k, item in enumerate(items) if item in called]
            inputs += self.inputs(source, wanted, len(items))
        sections = [
            Section("Inputs", tuple(inputs)),
            Section("Motion of the links", tuple(call)),
            *self.text.sections_of({n.index for n in own}),
        ]
        states, reads_X = f.model.states, ["X"] if f.model.reads_X else []
        if spec.tied and not f.model.of_loops:
            states = ("q", "qd", "qdd", self.rates)
        used = {n.value.name for n in (f.nodes if call else read) if n.op == SYM}
        constants = [c for c in spec.regrouping.constants if c in used]
        constants.sort(key=spec.robot.channels.__contains__)
        return Block(
            f,
            self.text,
            tuple(section for section in sections if section.lines),
            self.results[f.model.name],
            (*states, *reads_X, *constants),
            tuple(constants),
        )


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
