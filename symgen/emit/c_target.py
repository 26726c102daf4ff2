"""What a C file says, as data: the kernels over a tile of samples, the rows of the stores they
fill, the header.

Everything is computed here; the template only lays it out. Joints that only the closure equations
tie have no C kernels: their Newton
iteration stays in the NumPy module.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from symgen.derive.graph import Scalar
from symgen.derive.model import Entry, Model
from symgen.description.namespace import Namespace
from symgen.emit.c_printer import CText, is_word
from symgen.emit.header import header, line_of, packed, plain
from symgen.emit.printers import Section, Text
from symgen.emit.python_target import label
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import STATES, Function, ModuleSpec
from symgen.version import VERSION

ABI = 2
SCRATCH = 262144  # bytes of stack for the results of one tile
FLAGS = (
    "-std=c11 -O2 -ftree-vectorize -fno-math-errno -fno-trapping-math -ffp-contract=off "
    "-shared -fPIC"
)
RESULTS = (
    "joints",
    "parameters",
)  # axes of the models that have a kernel: torques and matrices over the joints


@dataclass(frozen=True)
class Kernel:
    """One function of the C file.

    Attributes
    ----------
    function : Function
        What it evaluates.
    text : Text
        Its printed values.
    result : str
        The array of a tile that it fills.
    used : tuple of str
        Among q, qd, qdd: those that it reads.
    needs_X, needs_constants : bool
        Whether it reads base parameters and constants.
    before : tuple of str
        Lines before its loops.
    trigonometry : tuple of Section
        Loops of their own: compilers merge sin(x) and cos(x) of one loop into a call that has no
        vector form.
    calls : int
        Number of sines and cosines.
    sections : tuple of Section
        The loop over a tile.
    rows : tuple of str
        {row of the store, signal, sign}, as source.
    entries, count, computed : int
        Entries of the store, those that the function writes, and distinct signals.
    """

    function: Function
    text: Text
    result: str
    used: tuple[str, ...]
    needs_X: bool
    needs_constants: bool
    before: tuple[str, ...]
    trigonometry: tuple[Section, ...]
    calls: int
    sections: tuple[Section, ...]
    rows: tuple[str, ...]
    entries: int
    count: int
    computed: int

    @property
    def model(self) -> Model:
        return self.function.model


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The C file of `spec`. Same robot file, same version: same bytes."""
    robot = spec.robot
    names = spec.names(is_word)
    kernels = [
        _kernel(spec, f, names.inner())
        for f in spec.functions.values()
        if {*f.model.axes} <= {*RESULTS}
    ]
    most = max(kernel.computed for kernel in kernels)
    lines = [
        line
        for kernel in kernels
        for section in (*kernel.sections, Section("", kernel.before))
        for line in section.lines
    ]
    return laid_out(
        "kernels.c",
        {
            "title": _comment(robot.title or robot.name),
            "file": _comment(robot.file or robot.name),
            "sha256": robot.sha256,
            "version": VERSION,
            "command": _comment(command or robot.file or robot.name),
            "header": [_comment(line) for line in _header(spec, kernels)],
            "name": robot.name,
            "abi": ABI,
            "n": len(robot.joints),
            "tile": 16
            if 8 * 16 * most <= SCRATCH
            else 8,  # the rows of a short tile stay in the first cache
            "kernels": [_layout(spec, kernel) for kernel in kernels],
            "signals": _signals_layout(spec, kernels[0]),
            "helpers": {
                name: any(f"{name}(" in line for line in lines)
                for name in ("sign", "above", "below")
            },
        },
    )


def _comment(text: str) -> str:
    """Text that cannot end a C comment, start another or continue a line."""
    shown = "".join(c if c.isprintable() else " " for c in plain(text))
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", r"\g<0> ", shown)


def _kernel(spec: ModuleSpec, f: Function, names: Namespace) -> Kernel:
    robot, model, result = spec.robot, f.model, names.own(f.model.result)
    entries = [
        e
        for e in f.values.entries
        if isinstance(e.value, Scalar) or e.value or not model.by_columns
    ]
    text = CText(
        [e.value for e in entries],
        f.values.algebra.sections,
        names,
        [label(f, e) for e in entries],
    )
    signals = Signals(f, entries)
    under: dict[str, list[str]] = {}  # heading: lines
    for k, (heading, value, comments) in enumerate(signals.computed):
        lines = _result(result, k, text.expression(value), comments)
        under.setdefault(heading, []).extend(lines)
    independent = spec.derivation.closure.independent
    place = {
        f"{letter}{j}": (state, k)
        for state, letter in STATES.items()
        for k, j in enumerate(independent)
    }
    needed = text.inputs
    constants, parameters = (
        [
            f"const double {names.of_file(c)} = {source}[{k}];"
            for k, c in enumerate(every)
            if c in needed
        ]
        for source, every in (("constants", robot.constants), ("X", spec.regrouping.names))
    )
    trigonometry = list(text.trigonometry_of.items())
    angles = [_input(name, *place[name]) for name in place if name in text.trigonometry_inputs]
    calls = [
        (call, f"T[{k}][t] = {call};".ljust(32) + f"/* {called} */")
        for k, (called, call) in enumerate(trigonometry)
    ]
    waves = [
        (title, [line for call, line in calls if function in call])
        for title, function in (("Cosines", "cos("), ("Sines", "sin("))
    ]
    inputs = [_input(name, *place[name]) for name in place if name in text.main_inputs]
    recalled = [f"const double {called} = T[{k}][t];" for k, (called, _) in enumerate(trigonometry)]
    results = (Section(title, tuple(lines)) for title, lines in under.items())
    trigonometry_loops = tuple(
        Section(title, (*angles, *text.angles, *lines)) for title, lines in waves if lines
    )
    sections = [Section("Inputs", (*inputs, *recalled)), *text.sections, *results]
    read = text.trigonometry_inputs | text.main_inputs
    return Kernel(
        function=f,
        text=text,
        result=result,
        used=tuple(s for s in model.states if any(place[x][0] == s for x in read if x in place)),
        needs_X=bool(parameters),
        needs_constants=bool(constants),
        before=(*constants, *parameters, *text.fixed),
        trigonometry=trigonometry_loops,
        calls=len(trigonometry),
        sections=tuple(s for s in sections if s.lines),
        rows=tuple(packed([f"{{{row}, {signal}, {sign}}}" for row, signal, sign in signals.rows])),
        entries=len(signals.rows),
        count=len(signals.rows)
        - signals.constant
        * (model.name == "regressor"),  # its store holds constants from the start
        computed=len(signals.computed),
    )


class Signals:
    """The distinct rows of a result, up to sign: `rows` of the store as (row, signal, sign), the
    `constant` last of them numbers.
    """

    def __init__(self, f: Function, entries: Sequence[Entry]) -> None:
        width = f.shape[-1]
        self.computed: list[tuple[str, Scalar | int, list[str]]] = []  # heading, value, comments
        self.rows: list[tuple[int, int, int]] = []
        first: dict[tuple[str, int], tuple[int, int]] = {}  # node or number: signal, sign
        numbers = [e for e in entries if not isinstance(e.value, Scalar)]
        self.constant = len(numbers)
        for entry in sorted(entries, key=lambda e: not isinstance(e.value, Scalar)):
            value = entry.value
            key = (
                ("node", value.node.index) if isinstance(value, Scalar) else ("number", abs(value))
            )
            own = value.sign if isinstance(value, Scalar) else -1 if value < 0 else 1
            signal, sign = first.setdefault(key, (len(self.computed), own))
            if signal == len(self.computed):
                self.computed.append((entry.heading, value, []))
            self.computed[signal][2].append(entry.comment)
            for *outer, last in f.places(entry):
                self.rows.append((sum(k * width for k in outer) + last, signal, own * sign))


def _input(name: str, state: str, k: int) -> str:
    return f"const double {name} = {state}[{k}][t];"


def _result(result: str, k: int, expression: str, comments: Sequence[str]) -> list[str]:
    """An entry of a tile, its comment behind it, or before it where both are too long for a
    line.
    """
    line, comment = f"{result}[{k}][t] = {expression};", ", ".join(c for c in comments if c)
    both = f"{line:<64}  /* {comment} */" if comment else line
    return [both] if len(both) <= WIDTH - 8 or not comment else [f"/* {comment} */", line]


def _header(spec: ModuleSpec, kernels: Sequence[Kernel]) -> list[str]:
    lines = header(spec, {k.model.name: k.text for k in kernels}, formulas=True)
    so = f"{spec.robot.name}.c -o {spec.robot.name}.so -lm"
    return [
        *lines[: lines.index("Cost per sample") - 1],
        "",
        *line_of(
            "Arguments",
            (
                "q, qd, qdd (N, n) in C order, rad or m and seconds; S receives (rows, N), samples "
                "last"
            ),
        ),
        *line_of("flags", "1 writes past the caches, for results larger than those"),
        *line_of("constants", ", ".join(spec.robot.constants) or "none"),
        *line_of("X, columns", " ".join(spec.regrouping.names)),
        *line_of(
            "Results",
            "0, or 1 if N is negative or a pointer is missing; rows that are zero or constant are "
            "never written",
        ),
        *line_of("Compile", f"cc {FLAGS} {so}"),
        *line_of(
            "",
            "never with -ffast-math: loading what it links sets subnormal numbers to zero in the "
            "whole process",
        ),
    ]


def _layout(spec: ModuleSpec, k: Kernel) -> dict[str, object]:
    """A kernel with its C signatures written out."""
    n, model = len(spec.robot.joints), k.model
    pointers = [*model.states, *(["X"] if model.reads_X else []), "constants"]
    given = ["const double *restrict X"] * k.needs_X + [
        "const double *restrict constants"
    ] * k.needs_constants
    tile = [
        *(f"double {s}[restrict {n}][TILE]" for s in k.used),
        *given,
        f"double {k.result}[restrict {k.computed}][TILE]",
    ]
    arguments = (
        [f"{s}_tile" for s in k.used]
        + ["X"] * k.needs_X
        + ["constants"] * k.needs_constants
        + [k.result]
    )
    own = ["int64_t N", *(f"const double *{p}" for p in pointers), "double *S", "int32_t flags"]
    partly = "; only rows that are not constant" if model.by_columns else ""
    shape = ", ".join(map(str, k.function.shape))
    summary = f"{model.summary} S has shape ({shape}, N){partly}."
    return {
        **vars(k),
        "name": model.name,
        "summary": f"/* {summary} */",
        "tile_prototype": signature(f"KERNEL static void {model.name}_lanes", tile),
        "tile_arguments": ", ".join(arguments),
        "prototype": signature(f"int32_t {spec.robot.name}_{model.name}", own),
        "scratch": ", ".join(
            [*(f"{s}_tile[{n}][TILE]" for s in k.used), f"{k.result}[{k.computed}][TILE]"]
        ),
        "missing": _missing([*pointers, "S"]),
    }


def _missing(pointers: Sequence[str]) -> str:
    return " || ".join(f"{p} == NULL" for p in pointers)


def _signals_layout(spec: ModuleSpec, regressor: Kernel) -> dict[str, object]:
    """The function that gives the distinct signals of the regressor, with its table of entries."""
    states = regressor.model.states
    pointers = [f"const double *{s}" for s in states]
    own = [
        "int64_t m",
        *pointers,
        "int64_t stride",
        "const double *constants",
        "double *U",
        "int64_t ustride",
    ]
    return {
        "prototype": signature(f"int32_t {spec.robot.name}_signals", own),
        "missing": _missing([*states, "constants", "U"]),
    }


def signature(name: str, parameters: Sequence[str]) -> str:
    """A C function with its parameters, on as few lines as they need."""
    flat = f"{name}({', '.join(parameters)})"
    return (
        flat
        if len(flat) < WIDTH
        else "\n".join(packed(parameters)).join((f"{name}(\n", ")")).replace(",)", ")")
    )
