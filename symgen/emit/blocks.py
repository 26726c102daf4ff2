"""Functions of a robot as text, in any language whose steps are assignments: what each takes, its
lines, and the entries of its result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from symgen.derive.graph import SYM, Node, Scalar
from symgen.derive.model import Entry
from symgen.description.naming import Namespace
from symgen.emit.printers import Language, Section, Text, under_titles
from symgen.emit.spec import STATES, Function, ModuleSpec


@dataclass(frozen=True)
class Block:
    """A function as text: what it takes, its lines, and the array that it fills.

    Attributes
    ----------
    function : Function
        The model.
    text : Text
        Its printed values.
    sections : tuple of Section
        Inputs and steps.
    result : str
        The array, under its local name.
    arguments : tuple of str
        States, X and constants.
    constants : tuple of str
        The last of them, those that are functions of time at the end.
    """

    function: Function
    text: Text
    sections: tuple[Section, ...]
    result: str
    arguments: tuple[str, ...]
    constants: tuple[str, ...]

    def results(self, target: Callable[[Sequence[int]], str]) -> list[Section]:
        """Assignments of the computed entries under their headings; `target` of a place."""
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


def blocks_of(
    spec: ModuleSpec, language: Language, component: Callable[[str, int], str] = "{}[{}]".format
) -> dict[str, Block]:
    """Every function of a module in a language, each by itself.

    component : how an entry of a state or of X is read.
    """

    def inputs(source: str, wanted: Sequence[tuple[int, str]], count: int) -> list[str]:
        return [language.step.format(name, component(source, k)) for k, name in wanted]

    names = spec.names(language.is_word)
    return {
        name: FunctionPrinter(spec, [f], names.inner(), language, inputs).block(f)
        for name, f in spec.functions.items()
    }


class FunctionPrinter:
    """Functions over one graph as text, in one scope of names.

    Parameters
    ----------
    spec : ModuleSpec
        The module.
    functions : sequence of Function
        Over one graph.
    names : Namespace
        The names of the scope.
    language : Language
        How lines are written.
    inputs : callable
        How states and X are read.
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
        """Names of what the functions read of what they share."""
        read = {n.index for f in self.functions for n in self._read(f)}
        return [self.text.called[k] for k in sorted(read & self.shared & self.text.named)]

    @property
    def motion(self) -> Block:
        """The block of the steps that all functions share."""
        own = [n for n in self.functions[0].nodes if n.index in self.shared]
        operands = {x.node.index for n in own for x in n.operands}
        return self._block(self.functions[0], own, [n for n in own if n.index in operands], ())

    def block(self, f: Function, call: Call = lambda names, arguments: []) -> Block:
        """A function; what it shares it gets from a `call`."""
        own = [n for n in f.nodes if n.index not in self.shared]
        names = {self.text.called.get(n.index, "") for n in self._read(f)}
        given = [name if name in names else "_" for name in self.given]
        lines = call(given, self.motion.arguments) if self.shared else []
        return self._block(f, own, self._read(f), lines)

    def _read(self, f: Function) -> list[Node]:
        """The nodes that the lines of a function read or make."""
        read = {o.node.index for o in f.values.outputs if isinstance(o, Scalar)}
        for node in f.nodes:
            if node.index not in self.shared:
                read |= {node.index, *(x.node.index for x in node.operands)}
        return [node for node in f.nodes if node.index in read]

    def _block(
        self, f: Function, own: Sequence[Node], read: Sequence[Node], call: Sequence[str]
    ) -> Block:
        """The lines of the nodes `own`, which read others, behind a call."""
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
    """Name an entry in comments, such as DG1ZZ2, GAM3 or A12."""
    name = entry.comment.partition(",")[0]
    return name or f"{f.model.result}{''.join(str(k + 1) for k in entry.place)}"


def aligned(lines: Sequence[str], language: Language) -> tuple[str, ...]:
    """Comments behind a tab in one column, up to a limit; none where the line gets too long."""
    parts = [line.partition("\t") for line in lines]
    width = min(max((len(code) for code, _, _ in parts), default=0), 64)
    mark = language.comment
    return tuple(
        f"{code:<{width}}  {mark} {comment}" if comment else code for code, _, comment in parts
    )
