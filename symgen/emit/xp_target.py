"""What an array-API module says, as data: blocks that return arrays in place of filling them, and the table of the distinct signals.

One source for every array package that the array API standard covers: no block writes into an array, and each quantity is one expression of
whole arrays. An entry of the regressor is a signal times a coefficient (TX40: 135 signals for 165 entries that are not zero), and a study that
filters or decimates the columns needs the signals only. What depends on no sample takes the shape of the samples by `+ zero`. Joints that only
the closure equations tie have no array module: their Newton iteration ends when the data say so, which no compiled array program can.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from symgen.derive.geometry import Geometry
from symgen.derive.graph import COS, SIGN, SIN, SQRT, Scalar
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.kinematics import frame_poses
from symgen.derive.loops import close
from symgen.description.robot import Robot
from symgen.emit.header import literal
from symgen.emit.printers import Section, Text
from symgen.emit.spec import LOCALS, STATES, Headings, inertia_graph, regressor_program, torque_graph
from symgen.errors import SymgenError
from symgen.regroup.regrouping import Regrouping, formula

TAKEN = ("xp", "zero", "standard", "frame")
Outputs = list[tuple[Scalar | int, str]]  # value, comment


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
    """One function of the module: reads states of shape (..., n), returns a tuple of arrays of shape (...)."""

    name: str
    arguments: str
    summary: str
    sections: tuple[Section, ...]
    results: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """Every line of it."""
        return (*(line for section in self.sections for line in section.lines), *self.results)


@dataclass(frozen=True)
class ArraySpec:
    """All that the template lays out beside what every Python module has."""

    blocks: tuple[Block, ...]
    entries: tuple[str, ...]  # ENTRIES as source
    signals: int
    formulas: tuple[str, ...]
    needs_zero: bool  # whether base_parameters calls functions of constants
    needs_sign: bool


def array_spec(regrouping: Regrouping) -> ArraySpec:
    """The blocks of the models of `regrouping`; SymgenError where a constant has a name that the module needs."""
    robot = regrouping.robot
    if clash := sorted(set(TAKEN) & robot.constants.keys()):
        raise SymgenError(f"constant {', '.join(clash)}: the array module calls something else so; rename it in the robot file")
    signals, entries = _signals(regrouping)
    still = torque_graph(regrouping, acceleration=False)
    rest = torque_graph(regrouping, acceleration=False, velocity=False)
    blocks = (
        signals,
        _torques(regrouping, "inverse_dynamics", "q, qd, qdd, X", "Gamma of each joint.", *torque_graph(regrouping)),
        _inertia_matrix(regrouping),
        _torques(regrouping, "bias", "q, qd, X", "Gamma of each joint at qdd = 0.", *still),
        _torques(regrouping, "gravity", "q, X", "Gamma of each joint at rest without friction.", *rest),
        _frame_poses(robot),
    )
    formulas = tuple(f"{b.name} = {_code(formula(b.combination))}" for b in regrouping.base if b.name != b.own)
    return ArraySpec(
        blocks=blocks,
        entries=tuple(literal("ENTRIES", entries)),
        signals=len(signals.results),
        formulas=formulas,
        needs_zero=any("zero" in line for line in formulas),
        needs_sign=any("_sign(" in line for block in blocks for line in block.lines),
    )


def _signals(regrouping: Regrouping) -> tuple[Block, tuple[tuple[int, int, int, float], ...]]:
    """The entries of the regressor that differ by more than a sign, once each; constant entries are multiples of a signal of ones."""
    robot = regrouping.robot
    places, program = regressor_program(regrouping, regrouping.own)
    where = [(k, row, value) for (k, row), value in zip(places, program.outputs, strict=True) if not isinstance(value, int) or value]
    text = _text(robot, [value for *_, value in where], program.sections)
    number: dict[int, int] = {}  # node: signal; -1 stands for the signal of ones
    signals: Outputs = []
    entries = []
    for k, row, value in sorted(where, key=lambda entry: (entry[1], entry[0])):
        node, coefficient = (value.node.index, float(value.sign)) if isinstance(value, Scalar) else (-1, float(value))
        if node not in number:
            number[node] = len(signals)
            first = Scalar(value.graph, value.node, 1) if isinstance(value, Scalar) else 1
            signals.append(
                (first, f"{number[node]}: DG{robot.joints[row]}{regrouping.own[k]}" + (", sign apart" if coefficient < 0 else ""))
            )
        entries.append((k, row, number[node], coefficient))
    summary = "The distinct signals of the regressor, (...) each."
    return _block(robot, "signals", "q, qd, qdd", summary, text, signals), tuple(entries)


def _torques(regrouping: Regrouping, name: str, arguments: str, summary: str, outputs: Sequence[Scalar | int], headings: Headings) -> Block:
    text = _text(regrouping.robot, outputs, headings)
    return _block(regrouping.robot, name, arguments, summary, text, [(value, "") for value in outputs], regrouping.names)


def _inertia_matrix(regrouping: Regrouping) -> Block:
    robot = regrouping.robot
    triangle, headings = inertia_graph(regrouping)
    rows = range(len(robot.joints))
    outputs: Outputs = [(triangle[max(i, j), min(i, j)], f"{i}, {j}") for i in rows for j in rows]
    summary = "A, row by row: column i is Gamma for a unit acceleration of joint i from rest."
    text = _text(robot, list(triangle.values()), headings)
    return _block(robot, "inertia_matrix", "q, X", summary, text, outputs, regrouping.names)


def _frame_poses(robot: Robot) -> Block:
    algebra = GraphAlgebra(robot)
    pose = frame_poses(Geometry(robot, algebra, close(robot)))
    outputs: Outputs = []
    for f in robot.frames:
        A, P = pose[f.j]
        for k in range(3):
            outputs += [(value, f"frame {f.j}, row {k + 1}" if not m else "") for m, value in enumerate((*A[k], P[k]))]
        outputs += [(0, ""), (0, ""), (0, ""), (1, "")]
    text = _text(robot, [value for value, _ in outputs], algebra.sections)
    return _block(robot, "frame_poses", "q", "The transforms of all frames, row by row.", text, outputs)


def _text(robot: Robot, outputs: Sequence[Scalar | int], headings: Headings) -> ArrayText:
    return ArrayText(outputs, headings, (*LOCALS, *TAKEN, *robot.constants))


def _block(
    robot: Robot, name: str, arguments: str, summary: str, text: ArrayText, outputs: Outputs, parameters: Sequence[str] = ()
) -> Block:
    results = [(f"{text.array(value)},", comment) for value, comment in outputs]
    width = min(max(len(code) for code, _ in results), 64)
    lines = tuple(f"{code:<{width}}  # {comment}" if comment else code for code, comment in results)
    inputs = []
    written = [line for section in text.sections for line in section.lines] + [code for code, _ in results]
    if any(re.search(r"\bzero\b", line) for line in written):
        inputs.append("zero = xp.zeros_like(q[..., 0])")
    needed = text.inputs
    for state, letter in STATES.items():
        inputs += [f"{letter}{j} = {state}[..., {k}]" for k, j in enumerate(close(robot).independent) if f"{letter}{j}" in needed]
    inputs += [f"{parameter} = X[{k}]" for k, parameter in enumerate(parameters) if parameter in needed]
    sections = (*([Section("Inputs", tuple(inputs))] if inputs else []), *text.sections)
    return Block(f"_{name}_block", ", ".join([arguments, *robot.constants]), summary, sections, lines)


def _code(text: str) -> str:
    """A formula of the common grammar in arrays: `zero` makes an array of the constants in a call."""
    return re.sub(r"\bpi\b", "xp.pi", re.sub(r"\b(cos|sin|sqrt)\(", r"xp.\1(zero + ", text))


def passive_rows(robot: Robot) -> list[str]:
    """Positions and rates of the passive joints over the actuated ones: (offset, ((column, rate), ...)) each, as source."""
    closure = close(robot)
    rows = []
    for j in robot.passive:
        rates = [(closure.independent.index(i), _code(str(g))) for i, g in closure.row[j].items()]
        rows.append(f"({_code(str(closure.offset[j]))}, ({' '.join(f'({k}, {rate}),' for k, rate in rates)})),")
    return rows
