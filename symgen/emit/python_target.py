"""What the Python modules of every array package share: signatures with hints, formulas of the base
parameters, tables that depend on constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from symgen.derive.closure import Closure
from symgen.derive.columns import acting, element_names
from symgen.derive.model import Entry
from symgen.derive.models import EMITTED, ON_REQUEST
from symgen.description.expression import Expression
from symgen.description.namespace import Namespace
from symgen.description.robot import FIXED, Robot
from symgen.emit.header import header, packed, plain, wrapped
from symgen.emit.printers import Language, Section, Text, under_titles
from symgen.emit.render import WIDTH
from symgen.emit.spec import STATES, Function, ModuleSpec
from symgen.regroup.regrouping import Regrouping, sign_conditions
from symgen.version import VERSION


@dataclass(frozen=True)
class Block:
    """A function in Python: what it reads, its lines, and the array that it fills.

    Attributes
    ----------
    function : Function
        The model.
    text : Text
        Its printed values.
    names : Namespace
        Its local names.
    result : str
        The array, under its local name.
    arguments : tuple of str
        States, X and constants that its lines read.
    constants : tuple of str
        The last of them.
    inputs : tuple of str
        Lines that unpack states and X.
    """

    function: Function
    text: Text
    names: Namespace
    result: str
    arguments: tuple[str, ...]
    constants: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def states(self) -> tuple[str, ...]:
        return self.function.states

    def sections(self, results: Sequence[Section]) -> tuple[Section, ...]:
        """Inputs, steps and `results`, those without lines left out."""
        every = (Section("Inputs", self.inputs), *self.text.sections, *results)
        return tuple(section for section in every if section.lines)

    def results(self, target: Callable[[Sequence[int]], str]) -> list[Section]:
        """Assignments of the computed entries under their headings; `target` of a place."""
        lines = []
        for entry in self.function.computed:
            targets = " = ".join(map(target, self.function.places(entry)))
            line = f"{targets} = {self.text.expression(entry.value)}\t{entry.comment}"
            lines.append((entry.heading, line))
        return [Section(s.title, aligned(s.lines)) for s in under_titles(lines)]


def blocks_of(
    spec: ModuleSpec,
    language: Language,
    component: Callable[[str, int], str] = "{}[{}]".format,
    unpack: bool = True,
) -> dict[str, Block]:
    """The functions of a module in a language of Python.

    component : how an entry of a state or of X is read. unpack : whether several may be read in
    one line.
    """
    names = spec.names()
    return {
        name: _block(spec, f, names.inner(), language, component, unpack)
        for name, f in spec.functions.items()
    }


def _block(
    spec: ModuleSpec,
    f: Function,
    names: Namespace,
    language: Language,
    component: Callable[[str, int], str],
    unpack: bool,
) -> Block:
    result, rates = names.own(f.model.result), names.own("G")
    columns = dict.fromkeys(STATES.values(), spec.derivation.closure.independent)
    labels = [label(f, e) for e in f.values.entries]
    text = Text(f.values.outputs, f.values.algebra.sections, names, labels, language)
    sources = {state: [f"{letter}{j}" for j in columns[letter]] for state, letter in STATES.items()}
    named = spec.derivation.algebra.named
    sources[rates] = [named("G", u, i) for u in spec.tied for i in spec.robot.joints]
    sources["X"] = list(spec.regrouping.names)
    written = {str(node.value): text.called[node.index] for node in text.nodes if node.op == "sym"}
    inputs: list[str] = []
    for source, items in sources.items():
        wanted = [(k, written[item]) for k, item in enumerate(items) if item in written]
        if unpack:
            inputs += _unpack(source, wanted, len(items))
        else:
            inputs += [f"{name} = {component(source, k)}" for k, name in wanted]
    constants = f.constants(spec.regrouping.constants)
    constants = tuple(sorted(constants, key=spec.robot.channels.__contains__))
    states = [rates if state == "G" else state for state in f.states]
    X = ["X"] if f.reads("parameter") else []
    return Block(f, text, names, result, (*states, *X, *constants), constants, tuple(inputs))


def label(f: Function, entry: Entry) -> str:
    """What an entry is called: DG1ZZ2, GAM3, A12."""
    name = entry.comment.partition(",")[0]
    return name or f"{f.model.result}{''.join(str(k + 1) for k in entry.place)}"


def aligned(lines: Sequence[str]) -> tuple[str, ...]:
    """Comments behind a tab in one column, up to a limit; none where the line gets too long."""
    parts = [line.partition("\t") for line in lines]
    width = min(max((len(code) for code, _, _ in parts), default=0), 64)
    return tuple(f"{code:<{width}}  # {comment}" if comment else code for code, _, comment in parts)


def _unpack(source: str, used: Sequence[tuple[int, str]], count: int) -> list[str]:
    """`q1, q2 = q`, or a slice of it where those needed stand side by side; else one by one."""
    if len(used) < 2 or used[-1][0] - used[0][0] >= len(used):
        return [f"{name} = {source}[{k}]" for k, name in used]
    start, stop = used[0][0] or "", used[-1][0] + 1
    span = "" if len(used) == count else f"[{start}:{stop if stop < count else ''}]"
    return unpacked([name for _, name in used], f"{source}{span}")


def unpacked(names: Sequence[str], source: str) -> list[str]:
    """`names = source` on as many lines as it needs."""
    text = ", ".join(names) + ("," if len(names) == 1 else "")
    if len(text) + len(source) + 3 < WIDTH - 4:
        return [f"{text} = {source}"]
    return ["(", *(f"    {line}" for line in wrap(text, WIDTH - 12)), f") = {source}"]


def broken(lines: Iterable[str]) -> list[str]:
    """Assignments, the values of those that are too long for a line in brackets."""
    return [_bracketed(line) if len(line) > WIDTH - 4 else line for line in lines]


def _bracketed(line: str) -> str:
    code, mark, remark = line.partition("  # ")
    target, _, value = code.rstrip().rpartition(" = ")
    return f"{target} = ({value})" + mark + remark


def context(
    spec: ModuleSpec,
    command: str | None,
    language: Language,
    array: str,
    blocks: Mapping[str, Block],
    quote: str = "",
    what: str = "base parameters, regressor, dynamics",
) -> dict[str, Any]:
    """Values for the template of a Python module; `array` is the hint of its arrays, between
    `quote` where it is no class; `what` it holds.
    """
    robot, regrouping, closure = spec.robot, spec.regrouping, spec.derivation.closure
    read = {name for b in regrouping.base for name in b.combination}
    loops = [b.constants for b in blocks.values() if b.function.model.of_loops]
    closing = constants_of(regrouping, *loops)
    rows = [(closure.offset[j], *closure.row[j].values()) for j in robot.passive]
    return {
        **spec.sizes,
        "opening": wrapped(f'"""{plain(robot.title or robot.name)}: {what}.', ""),
        "file": plain(robot.file or robot.name),
        "sha256": robot.sha256,
        "version": VERSION,
        "command": plain(command or robot.file or robot.name),
        "header": [
            plain(line)
            for line in header(spec, {name: b.text for name, b in blocks.items()}, formulas=False)
        ],
        "tied": spec.tied,
        "passive": robot.passive,
        "models": {
            n: m
            for n, m in (EMITTED | ON_REQUEST).items()
            if (n in spec.functions or not m.option)
            and not (n == "forward_dynamics" and robot.loaded)
        },
        "references": any(f.reads("qdr") or f.reads("qddr") for f in spec.functions.values()),
        "functions": spec.functions,
        "takes": {name: list(b.arguments) for name, b in blocks.items()},
        "listed": listed,
        "shapes": {name: f.shape for name, f in spec.functions.items()},
        "head": Heads(regrouping, array, quote),
        "closing": closing,
        "closed_by": f"({', '.join(map(_tuple, loops))})",
        "storing": constants_of(regrouping, blocks["regressor"].constants, closing),
        "constants": listed(regrouping.constants),
        "keywords": {
            name: "".join(f", {c}={c}" for c in constants_of(regrouping, b.constants, closing))
            for name, b in blocks.items()
        },
        "passed": {name: b.constants for name, b in blocks.items()},
        "unpack": unpacked(
            [name if name in read else "_" for name in robot.parameters], "standard"
        ),
        "formulas": broken(
            f"{b.name} = {b.formula.text(language.expression)}"
            for b in regrouping.base
            if b.name != b.own
        ),
        "conditions": [
            (
                f"{source(language, ratio)} {'>' if sign > 0 else '<'} 0",
                f"{name} holds where {ratio} is {'positive' if sign > 0 else 'negative'}",
                name,
            )
            for name, ratio, sign in sign_conditions(regrouping)
        ],
        "packed": packed(list(regrouping.names)),
        "paths": _paths(robot, closure, language),
        "path_constants": constants_of(
            regrouping, _symbols(row for rows in closure.row.values() for row in rows.values())
        ),
        "passive_constants": constants_of(regrouping, _symbols(e for row in rows for e in row)),
        "passive_rows": _passive_rows(robot, closure, language),
    }


class Heads:
    """First lines of public functions: signature with hints, then the summary."""

    def __init__(self, regrouping: Regrouping, array: str, quote: str) -> None:
        free = regrouping.constants
        self.array, self.quote = array, quote
        self.constants = [
            f"{name}: {self._of(name, regrouping.robot)} = {value!r}"
            for name, value in free.items()
        ]

    def _of(self, name: str, robot: Robot) -> str:
        """The hint of a constant."""
        return self.hint(f"{self.array} | float") if name in robot.channels else "float"

    def hint(self, kind: str) -> str:
        """A hint, quoted where its names are no classes of the module."""
        return f"{self.quote}{kind}{self.quote}"

    def __call__(
        self,
        name: str,
        arguments: Sequence[str],
        keywords: Sequence[str] = (),
        returns: str = "",
        optional: bool = False,
    ) -> str:
        """`arguments` without hints are arrays; those behind the first are `optional` or not."""
        first, later = (
            self.hint(self.array),
            f"{self.hint(f'{self.array} | None')} = None" if optional else self.hint(self.array),
        )
        named = [*keywords, *self.constants]
        parameters = [f"{a}: {later if k else first}" for k, a in enumerate(arguments)] + [
            "*",
            *named,
        ] * bool(named)
        return signature(f"def {name}", parameters, f" -> {self.hint(returns or self.array)}:")


def signature(start: str, parameters: Sequence[str], end: str = "") -> str:
    """`start(parameters)end`, on as few lines as it needs."""
    flat = f"{start}({', '.join(parameters)}){end}"
    if len(flat) <= WIDTH:
        return flat
    return "\n".join((f"{start}(", *packed(parameters), f"){end}")).replace(",\n)", "\n)")


def _tuple(names: Sequence[str]) -> str:
    return f"({', '.join(names)}{',' * (len(names) == 1)})"


def listed(names: Iterable[str]) -> str:
    """Names behind other arguments."""
    return "".join(f", {name}" for name in names)


def constants_of(regrouping: Regrouping, *used: Iterable[str]) -> tuple[str, ...]:
    """The constants that may have other values and are among those used, in their order."""
    return tuple(name for name in regrouping.constants if any(name in names for names in used))


def _symbols(expressions: Iterable[Expression]) -> set[str]:
    return {name for e in expressions for name in e.symbols}


def source(language: Language, e: Expression) -> str:
    """A constant expression as source, numbers as floats."""
    return repr(float(e.constant)) if e.constant is not None else language.expression(e)


def _paths(robot: Robot, closure: Closure, language: Language) -> list[str]:
    """Entries {frame: ((joint, sigma, ((column, rate), ...)), ...)}: the moving joints below each
    frame and how the actuated ones move them.
    """
    column = {j: k for k, j in enumerate(closure.independent)}
    entries = []
    for f in robot.frames:
        steps = []
        for j in (i for i in robot.path(f.j) if robot.frame(i).sigma != FIXED):
            rates = " ".join(
                f"({column[i]}, {source(language, g)})," for i, g in closure.row[j].items()
            )
            steps.append(f"({j}, {robot.frame(j).sigma}, ({rates})),")
        entries.append(f"{f.j}: ({' '.join(steps)})")
    return packed(entries)


def _passive_rows(
    robot: Robot, closure: Closure, language: Language
) -> list[tuple[str, list[tuple[int, str]]]]:
    """Each passive joint over the independent ones: constant, then (column, rate), as source."""
    rows = []
    for j in robot.passive:
        rates = [
            (closure.independent.index(i), source(language, g)) for i, g in closure.row[j].items()
        ]
        rows.append((source(language, closure.offset[j]), rates))
    return rows


def element_lines(robot: Robot, language: Language) -> list[str]:
    """Entries {parameter: (kind, direction of motion, row or form)} of the elements, as source."""
    entries = []
    for name, (e, j) in element_names(robot).items():
        text = ", ".join(f"{at}: {source(language, g)}" for at, g in acting(e, j).items())
        entries.append(
            (
                robot.parameters.index(name),
                f"{name!r}: ({e.acts_as!r}, {e.when or 'both'!r}, {{{text}}})",
            )
        )
    return packed([entry for _, entry in sorted(entries)])
