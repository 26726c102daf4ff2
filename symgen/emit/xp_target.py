"""The array-API module: blocks that return arrays in place of filling them, and the table of the
distinct signals.

One source for every array package that the array API standard covers: no block writes into an
array, and each quantity is one expression of whole arrays. An entry of the regressor is a signal
times a coefficient, and a study that filters or decimates the columns needs the signals only. What
depends on no sample takes the shape of the samples by `+ zero`. Joints that only the closure
equations tie have no array module: their Newton iteration ends when the data say so, which no
compiled array program can.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from symgen.derive.graph import Scalar
from symgen.derive.model import Entry, Values
from symgen.emit.header import data, literal, tables
from symgen.emit.printers import ARRAYS, Section
from symgen.emit.python_target import Block, aligned, blocks_of, broken, context
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import Function, ModuleSpec, signals

Coefficients = tuple[tuple[int, int, int, float], ...]  # (k, joint, signal, coefficient)


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The array-API module of `spec`. Same robot file, same version: same bytes."""
    signals, coefficients = _signals(spec.functions["regressor"])
    functions = {**spec.functions, "regressor": signals}
    blocks = blocks_of(replace(spec, functions=functions), ARRAYS, _component, unpack=False)
    what = "base parameters, regressor, dynamics on the arrays of any package of the array API"
    base = context(spec, command, ARRAYS, "Array", blocks, '"', what)
    laid = {name: _laid_out(block) for name, block in blocks.items()}
    return laid_out(
        "xp.py",
        {
            **base,
            "tables": tables(spec, numpy=False),
            "data": data(spec),
            "entries": literal("ENTRIES", coefficients),
            "signals": len(signals.values.entries),
            "blocks": list(laid.values()),
            "calls": {name: f"{b['name']}({b['arguments']})" for name, b in laid.items()},
            "needs_zero": any("zero" in line for line in base["formulas"]),
            "needs_sign": any("_sign(" in str(b["text"]) for b in laid.values()),
        },
    )


def _component(source: str, k: int) -> str:
    return f"{source}[{k}]" if source == "X" else f"{source}[..., {k}]"


def _signals(regressor: Function) -> tuple[Function, Coefficients]:
    """The entries of the regressor that differ by more than a sign, once each; constant entries are
    multiples of a signal of ones.
    """
    distinct = signals(regressor, [e for e in regressor.values.entries if e.value != 0])
    model = replace(
        regressor.model,
        name="signals",
        result="S",
        meaning="the distinct signals of the regressor",
        by_columns=False,
    )
    entries = tuple(replace(e, place=(k,)) for k, e in enumerate(distinct.entries))
    values = Values(entries, regressor.values.algebra)
    coefficients = tuple((k, row, s, float(sign)) for (k, row), s, sign in distinct.places)
    return Function(model, values, (len(entries),)), coefficients


def _laid_out(block: Block) -> dict[str, object]:
    """A function of the module: reads states of shape (..., n), returns a tuple of arrays (...)."""
    f = block.function

    def array(value: Scalar | int) -> str:
        """Text of an output that has the shape of the samples."""
        if not isinstance(value, Scalar):
            return "zero" if value == 0 else f"{float(value)} + zero"
        text = block.text.expression(value)
        return f"{text} + zero" if value.node.fixed else text

    rows = [f"{array(e.value)},\t{_remark(place, e)}" for place, e in f.by_place]
    results = aligned(rows)
    lines = [*(line for s in block.text.sections for line in s.lines), *results]
    inputs = list(block.inputs)
    timed = [s.name for s in f.inputs if s.kind == "channel"]
    inputs += [f"{c} = {c} + zero" for c in block.constants if c in timed]
    if any(re.search(r"\bzero\b", line) for line in (*inputs, *lines)):
        inputs.insert(0, "zero = xp.zeros_like(q[..., 0])")
    needs_package = any("xp." in line for line in (*inputs, *lines))  # found by q
    read = dict.fromkeys([*(["q"] if needs_package else []), *block.arguments])
    sections = [
        Section(s.title, tuple(broken(s.lines)))
        for s in replace(block, inputs=tuple(inputs)).sections([])
    ]
    return {
        "name": f"_{f.model.name}_block",
        "arguments": ", ".join(read),
        "summary": f"{f.model.meaning[0].upper()}{f.model.meaning[1:]}; a tuple of its entries.",
        "sections": sections,
        "results": [part for line in results for part in _remark_first(line)],
        "text": "\n".join((*inputs, *lines)),
    }


def _remark_first(line: str) -> list[str]:
    """An entry of a tuple; its remark stands before it where both are too long for a line."""
    code, mark, remark = line.partition("  # ")
    return [f"# {remark}", code.rstrip()] if mark and len(line) > WIDTH - 8 else [line]


def _remark(place: Sequence[int], entry: Entry) -> str:
    at = ", ".join(map(str, place))
    return f"{at}: {entry.comment}" if entry.comment else at if len(place) > 1 else ""
