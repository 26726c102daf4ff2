"""The array-API module: blocks that return arrays in place of filling them, and the table of the distinct signals.

One source for every array package that the array API standard covers: no block writes into an array, and each quantity is one expression of
whole arrays. An entry of the regressor is a signal times a coefficient, and a study that filters or decimates the columns needs the signals
only. What depends on no sample takes the shape of the samples by `+ zero`. Joints that only the closure equations tie have no array module:
their Newton iteration ends when the data say so, which no compiled array program can.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from symgen.derive.graph import COS, SIGN, SIN, SQRT, Scalar
from symgen.derive.loops import close
from symgen.emit.header import literal, tables
from symgen.emit.models import LOCALS, STATES, Entry, Model, Values
from symgen.emit.printers import Section, Text
from symgen.emit.python_target import context
from symgen.emit.render import python_module
from symgen.emit.spec import ModuleSpec, aligned
from symgen.errors import SymgenError
from symgen.regroup.formula import Python
from symgen.regroup.regrouping import Regrouping

TAKEN = ("xp", "zero", "standard", "frame", "Array")
LANGUAGE = Python("xp", "zero + ")
Coefficients = tuple[tuple[int, int, int, float], ...]  # (k, joint, signal, coefficient)


class ArrayText(Text):
    """The lines of one block. Calls of constants, which an array package refuses on plain numbers, get the shape of the samples."""

    calls: ClassVar[dict[str, str]] = {COS: "xp.cos", SIN: "xp.sin", SIGN: "_sign", SQRT: "xp.sqrt"}
    pi: ClassVar[str] = "xp.pi"

    def _clipped(self, x: str, bound: str) -> str:
        return f"xp.clip({x}, {'min' if bound == 'maximum' else 'max'}=0.0)"

    def _body(self, s: Scalar) -> str:
        if s.node.op in self.calls and s.node.fixed:
            (x,) = s.node.operands
            return ("-" if s.sign < 0 else "") + f"{self.calls[s.node.op]}(zero + {self._operand(x)})"
        return super()._body(s)

    def array(self, value: Scalar | int) -> str:
        """Text of an output that has the shape of the samples."""
        if not isinstance(value, Scalar):
            return "zero" if value == 0 else f"{float(value)} + zero"
        return f"{self.expression(value)} + zero" if value.node.fixed else self.expression(value)


@dataclass(frozen=True)
class Block:
    """One function of the module: reads states of shape (..., n), returns a tuple of arrays of shape (...).

    Attributes
    ----------
    name, arguments, summary : str
        Its signature and docstring.
    sections : tuple of Section
        Its lines.
    results : tuple of str
        The entries of the tuple.
    """

    name: str
    arguments: str
    summary: str
    sections: tuple[Section, ...]
    results: tuple[str, ...]

    @property
    def text(self) -> str:
        return "\n".join((*(line for section in self.sections for line in section.lines), *self.results))


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The array-API module of `spec`. Same robot file, same version: same bytes. Raises SymgenError where a constant has a name that it needs."""
    regrouping = spec.regrouping
    if clash := sorted(set(TAKEN) & spec.robot.constants.keys()):
        raise SymgenError(f"constant {', '.join(clash)}: the array module calls something else so; rename it in the robot file")
    values = {f.model.name: f.model.values(regrouping) for f in spec.functions.values() if f.model.values}
    values["regressor"], coefficients = _signals(regrouping, values["regressor"])
    blocks = {name: _block(regrouping, spec.functions[name].model, entries) for name, entries in values.items()}
    base = context(spec, command, LANGUAGE, "Array", '"')
    formulas: Sequence[str] = base["formulas"]
    return python_module(
        "xp.py",
        {
            **base,
            "tables": tables(spec, numpy=False),
            "entries": literal("ENTRIES", coefficients),
            "signals": len(values["regressor"].entries),
            "blocks": list(blocks.values()),
            "calls": {name: f"{block.name}({block.arguments})" for name, block in blocks.items()},
            "needs_zero": any("zero" in line for line in formulas),
            "needs_sign": any("_sign(" in block.text for block in blocks.values()),
        },
        spec.robot.constants,
    )


def _signals(regrouping: Regrouping, regressor: Values) -> tuple[Values, Coefficients]:
    """The entries of the regressor that differ by more than a sign, once each; constant entries are multiples of a signal of ones."""
    number: dict[int, int] = {}  # node: signal; -1 stands for the signal of ones
    signals: list[Entry] = []
    coefficients = []
    for entry in regressor.entries:
        value = entry.value
        if isinstance(value, int) and not value:
            continue
        node, c = (value.node.index, float(value.sign)) if isinstance(value, Scalar) else (-1, float(value))
        if node not in number:
            number[node] = len(signals)
            first = Scalar(value.graph, value.node, 1) if isinstance(value, Scalar) else 1
            comment = f"{number[node]}: {entry.comment}" + (", sign apart" if c < 0 else "")
            signals.append(replace(entry, places=((number[node],),), value=first, comment=comment))
        coefficients.append((*entry.places[0], number[node], c))
    return Values(tuple(signals), regressor.headings), tuple(coefficients)  # type: ignore[arg-type]


def _block(regrouping: Regrouping, model: Model, values: Values) -> Block:
    robot = regrouping.robot
    text = ArrayText(values.outputs, values.headings, (*LOCALS, *TAKEN, *robot.constants))
    rows = [f"{text.array(entry.value)},\t{_comment(model, place, entry)}" for place, entry in values.by_place]
    results = aligned(rows)
    needed = text.inputs
    inputs = []
    if any(re.search(r"\bzero\b", line) for line in (*results, *(line for section in text.sections for line in section.lines))):
        inputs.append("zero = xp.zeros_like(q[..., 0])")
    for state, letter in STATES.items():
        inputs += [f"{letter}{j} = {state}[..., {k}]" for k, j in enumerate(close(robot).independent) if f"{letter}{j}" in needed]
    inputs += [f"{parameter} = X[{k}]" for k, parameter in enumerate(regrouping.names) if parameter in needed]
    sections = tuple(s for s in (Section("Inputs", tuple(inputs)), *text.sections) if s.lines)
    lines = [line for section in sections for line in section.lines]
    needs_package = any("xp." in line for line in (*lines, *results))  # found by q
    read = [a for a in model.arguments if (a == "q" and needs_package) or any(f" = {a}[" in line for line in inputs)]
    name = "signals" if model.name == "regressor" else model.name
    summary = "The distinct signals of the regressor" if model.name == "regressor" else model.summary
    constants = [c for c in robot.constants if c in needed]
    return Block(f"_{name}_block", ", ".join([*read, *constants]), f"{summary}; a tuple of its entries, row by row.", sections, results)


def _comment(model: Model, place: tuple[int, ...], entry: Entry) -> str:
    if model.name == "frame_poses":
        frame, row, column = place
        return f"frame {frame + 1}, row {row + 1}" if row < 3 and not column else ""
    return entry.comment or (", ".join(map(str, place)) if len(place) > 1 else "")
