"""What a C file says, as data: the kernels over a tile of samples, the rows of the stores they
fill, the header.

Everything is computed here; the template only lays it out. Joints that only the closure equations
tie have no C kernels: their Newton
iteration stays in the NumPy module.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from symgen.derive.graph import Scalar
from symgen.derive.model import Model
from symgen.description.naming import Namespace
from symgen.emit.blocks import label
from symgen.emit.c_printer import CText, is_word
from symgen.emit.header import header, line_of, packed, plain
from symgen.emit.printers import Section, under_titles
from symgen.emit.python_target import signature
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import STATES, Function, ModuleSpec, signals
from symgen.version import VERSION

ABI = 2
SCRATCH = 262144  # bytes of stack for the results of one tile
FLAGS = (
    "-std=c11 -O2 -ftree-vectorize -fno-math-errno -fno-trapping-math -ffp-contract=off "
    "-shared -fPIC"
)
RESULTS = ("joints", "parameters", "energies", "wrench", "standard parameters")
"""Axes of the models that have a kernel."""


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The C file of `spec`. Same robot file, same version: same bytes."""
    robot = spec.robot
    names = spec.names(is_word)
    kernels = [
        _kernel(spec, f, names.inner())
        for f in spec.functions.values()
        if {*f.model.axes} <= {*RESULTS}
    ]
    most = max(kernel["computed"] for kernel in kernels)
    lines = [
        line
        for kernel in kernels
        for section in (*kernel["sections"], Section("", kernel["before"]))
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
            "kernels": kernels,
            "signals": _signals_layout(spec, spec.functions["regressor"].model),
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


def _kernel(spec: ModuleSpec, f: Function, names: Namespace) -> dict[str, Any]:
    """A function over a tile: its lines before the loops, those of sines and cosines, each a loop
    of its own (compilers merge sin(x) and cos(x) of one loop into a call that has no vector form),
    those of the loop over a tile; its rows {row of the store, signal, sign}, the first `count` of
    them written by the function; its C signatures.
    """
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
    distinct = signals(f, entries)
    results = under_titles(
        (e.heading, line)
        for k, e in enumerate(distinct.entries)
        for line in _result(result, k, text.expression(e.value), e.comment)
    )
    width = f.shape[-1]
    rows = [
        f"{{{sum(k * width for k in outer) + last}, {signal}, {sign}}}"
        for (*outer, last), signal, sign in distinct.places
    ]
    independent = spec.derivation.closure.independent
    place = {
        f"{letter}{j}": (state, k)
        for state, letter in STATES.items()
        for k, j in enumerate(independent)
    }
    needed = text.inputs
    free = spec.regrouping.constants
    constants, parameters = (
        [
            f"const double {names.of_file(c)} = {source.format(k)};"
            for k, c in enumerate(every)
            if c in needed
        ]
        for source, every in (("constants[{}]", free), ("X[{}]", spec.regrouping.names))
    )
    fixed = [
        f"const double {names.of_file(c)} = {x!r};"
        for c, x in robot.constants.items()
        if c in needed and c not in free
    ]
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
    trigonometry_loops = tuple(
        Section(title, (*angles, *text.angles, *lines)) for title, lines in waves if lines
    )
    sections = [Section("Inputs", (*inputs, *recalled)), *text.sections, *results]
    read = text.trigonometry_inputs | text.main_inputs
    used = [s for s in model.states if any(place[x][0] == s for x in read if x in place)]
    laid: dict[str, Any] = {
        "name": model.name,
        "text": text,
        "result": result,
        "used": used,
        "before": (*fixed, *constants, *parameters, *text.fixed),
        "trigonometry": trigonometry_loops,
        "calls": len(trigonometry),
        "sections": [s for s in sections if s.lines],
        "rows": packed(rows),
        "entries": len(rows),
        "count": len(rows) - distinct.constant * model.by_columns,  # its store holds constants
        "computed": len(distinct.entries),
    }
    given = {"X": parameters, "constants": constants}
    return laid | _signatures(spec, f, laid, [name for name, lines in given.items() if lines])


def _input(name: str, state: str, k: int) -> str:
    return f"const double {name} = {state}[{k}][t];"


def _result(result: str, k: int, expression: str, comment: str) -> list[str]:
    """An entry of a tile, its comment behind it, or before it where both are too long for a
    line.
    """
    line = f"{result}[{k}][t] = {expression};"
    both = f"{line:<64}  /* {comment} */" if comment else line
    return [both] if len(both) <= WIDTH - 8 or not comment else [f"/* {comment} */", line]


def _header(spec: ModuleSpec, kernels: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = header(spec, {k["name"]: k["text"] for k in kernels}, formulas=True)
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
        *line_of("constants", ", ".join(spec.regrouping.constants) or "none"),
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


def _signatures(
    spec: ModuleSpec, f: Function, laid: Mapping[str, Any], needs: Sequence[str]
) -> dict[str, object]:
    """A kernel's C signatures; `needs` of X and constants."""
    n, model = len(spec.robot.joints), f.model
    used, filled = laid["used"], f"[{laid['computed']}][TILE]"
    pointers = [*model.states, *(["X"] if model.reads_X else []), "constants"]
    tile = [
        *(f"double {s}[restrict {n}][TILE]" for s in used),
        *(f"const double *restrict {name}" for name in needs),
        f"double {laid['result']}[restrict {laid['computed']}][TILE]",
    ]
    own = ["int64_t N", *(f"const double *{p}" for p in pointers), "double *S", "int32_t flags"]
    partly = "; only rows that are not constant" if model.by_columns else ""
    shape = ", ".join(map(str, f.shape))
    return {
        "summary": f"/* {model.summary} S has shape ({shape}, N){partly}. */",
        "tile_prototype": signature(f"KERNEL static void {model.name}_lanes", tile),
        "tile_arguments": ", ".join([*(f"{s}_tile" for s in used), *needs, laid["result"]]),
        "prototype": signature(f"int32_t {spec.robot.name}_{model.name}", own),
        "scratch": ", ".join(
            [*(f"{s}_tile[{n}][TILE]" for s in used), f"{laid['result']}{filled}"]
        ),
        "missing": _missing([*pointers, "S"]),
    }


def _missing(pointers: Sequence[str]) -> str:
    return " || ".join(f"{p} == NULL" for p in pointers)


def _signals_layout(spec: ModuleSpec, regressor: Model) -> dict[str, object]:
    """The function that gives the distinct signals of the regressor, with its table of entries."""
    states = regressor.states
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
