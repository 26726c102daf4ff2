"""Models of a robot as SymPy objects.

Every symbol is real and has the name used in the robot file or in the recursion: q1, QP1 and QDP1
for position, velocity and acceleration of joint 1, GAM1 for its torque. Numbers are exact. Cosines
and sines are written with their angles: C23 is cos(q2 + q3).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import sympy

from symgen.derive.graph import INV, POS, Node, Symbol
from symgen.description.expression import FUNCTIONS
from symgen.symbols.expressions import angle, evaluated, rational, symbol
from symgen.symbols.symbolic_model import SymbolicModel

OF_SYMPY = re.compile(r"\b(?=[A-Za-z]\w*\(|pi\b)")  # before a name that is none of the robot
RATIONAL = re.compile(r"(?<![\w*).])(\d+)/(\d+)\b")
FACTORED = 300  # terms of a determinant, up to which it is factored over the rationals


def of_model(model: SymbolicModel) -> Any:
    """Convert the closed form of a model to a SymPy object.

    A matrix is a Matrix, a vector a Matrix of one column, a scalar an expression.
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
    """Return a model in SymPy: its recursive equations, and the model in terms of the variables
    that the equations define.

    As from `sympy.cse`, an equation is a pair (symbol, expression).
    """
    steps, outputs = model.listing.steps(Objects(), symbol)
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


class Objects:
    """Operations that convert the nodes of an expression graph to SymPy objects.

    `rational` is the function that converts a rational number.
    """

    def __init__(self, rational: Callable[[Fraction], Any] = rational) -> None:
        self.number = rational

    def symbol(self, symbol_: Symbol) -> Any:
        """Make a SymPy symbol with the name of an input (joint variable, parameter, constant)."""
        return symbol(symbol_.name)

    def function(self, node: Node, x: list[Any]) -> Any:
        """Apply the function of a graph node, such as cos, to its operands x in SymPy."""
        if node.op == INV:
            return 1 / x[0]
        if node.op == POS:
            return sympy.Max(x[0], 0)
        return getattr(sympy, FUNCTIONS[node.op].sympy)(*x, evaluate=node.value is not None)


def source_text(name: str, steps: list[tuple[Any, Any]], value: Any) -> str:
    """Write Python code with SymPy that computes `value` and stores it under the name `name`.

    The code defines the symbols, then the intermediate variables in `steps`, then the value.
    Rational numbers stay exact.
    """
    made = {x for x, _ in steps}
    atoms = set().union(value.free_symbols, *(e.free_symbols for _, e in steps))
    free = sorted(str(x) for x in atoms - made)
    package = "sympy"
    while package in {*free, *map(str, made)}:
        package += "_"
    lines = ["import sympy" if package == "sympy" else f"import sympy as {package}", ""]
    if free:
        made_by = f"{package}.symbols({' '.join(free)!r}, real=True, seq=True)"
        lines.append(f"{', '.join(free)}{',' * (len(free) == 1)} = {made_by}")
    for x, e in [*steps, (name, value)]:
        exact = RATIONAL.sub(r"Rational(\1, \2)", _written(e))
        lines.append(f"{x} = {OF_SYMPY.sub(f'{package}.', exact)}")
    return "\n".join(lines)


def _written(e: Any) -> str:
    """Write a SymPy expression as text; a matrix is written row by row, without aligned columns."""
    if not isinstance(e, sympy.MatrixBase):
        return str(sympy.printing.sstr(e))
    rows = (f"[{', '.join(map(sympy.printing.sstr, row))}]" for row in e.tolist())
    return "Matrix([\n" + ",\n".join(rows) + "])"
