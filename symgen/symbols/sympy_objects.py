"""Models as SymPy objects.

Every symbol is real and has the name of the robot file or of the recursion: q1, QP1 and QDP1 for
position, velocity and acceleration of joint 1, GAM1 for its torque. Numbers are exact. Cosines and
sines are those of the angles: C23 is cos(q2 + q3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from symgen.derive.graph import Node
from symgen.symbols.symbolic_model import SymbolicModel
from symgen.symbols.trees import angle, evaluated, rational, symbol

FACTORED = 300  # terms of a determinant, up to which it is factored over the rationals


def of_model(model: SymbolicModel) -> Any:
    """The closed form of a model: a Matrix, a column of one for vectors, an expression for
    scalars.
    """
    closed = model.closed
    angles = {name: evaluated(angle(name[0], e), {}) for name, e in closed.angles.items()}
    values = {place: evaluated(x, angles) for place, x in closed.entries.items()}
    if closed.denominator is not None:
        below = evaluated(closed.denominator, angles)
        values = {place: x / below for place, x in values.items()}
    if not model.axes and model.model.cases is None and closed.size <= FACTORED:
        values = {place: sympy.factor(x) for place, x in values.items()}
    return _shaped(model, values)


def of_listing(model: SymbolicModel) -> tuple[list[tuple[Any, Any]], Any]:
    """The recursion of a model as `sympy.cse` gives it: [(symbol, expression)] and the model in
    these symbols.
    """
    steps, outputs = model.listing.steps(operated, symbol)
    values = dict(zip(model.listing.places, map(sympy.sympify, outputs), strict=True))
    return [(symbol(name), x) for name, x in steps.items()], _shaped(model, values)


def _shaped(model: SymbolicModel, values: Mapping[tuple[int, ...], Any]) -> Any:
    shape = [len(labels) for labels in model.axes]
    if not shape:
        return values.get((), sympy.Integer(0))
    if model.model.symmetric:
        values = {**values, **{place[::-1]: x for place, x in values.items()}}
    rows, columns = (*shape, 1)[:2]
    return sympy.Matrix(
        rows, columns, lambda k, m: values.get((k, m)[: len(shape)], sympy.Integer(0))
    )


def operated(node: Node, x: list[Any]) -> Any:
    """The value of a node by the values of its operands."""
    match node.op:
        case "const":
            return rational(node.value)
        case "add":
            return x[0] + x[1]
        case "mul":
            return x[0] * x[1]
        case "inv":
            return 1 / x[0]
        case "pos":
            return sympy.Max(x[0], 0)
    return getattr(sympy, node.op)(x[0])


def source_text(name: str, steps: list[tuple[Any, Any]], value: Any) -> str:
    """Python lines that make `value` under `name`: the symbols, the steps, the value; rationals
    stay exact.
    """
    made = {x for x, _ in steps}
    atoms = set().union(value.free_symbols, *(e.free_symbols for _, e in steps))
    free = sorted(str(x) for x in atoms - made)
    lines = ["from sympy import *", ""]
    if free:
        comma, seq = ("," * (len(free) == 1), ", seq=True" * (len(free) == 1))
        lines.append(f"{', '.join(free)}{comma} = symbols({' '.join(free)!r}, real=True{seq})")
    for x, e in [*steps, (name, value)]:
        lines.append(f"{x} = {sympy.printing.sstr(e, sympy_integers=True)}")
    return "\n".join(lines)
