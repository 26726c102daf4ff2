"""Models as SymPy objects. sympy is loaded here, when the first object is made, and nowhere else but in `Formula.to_sympy`.

Every symbol is real and has the name of the robot file or of the recursion: q1, QP1 and QDP1 for position, velocity and acceleration of joint 1,
GAM1 for its torque. Numbers are exact. Cosines and sines are those of the angles: C23 is cos(q2 + q3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from symgen.derive.graph import Node
from symgen.regroup.formula import sympy_expression
from symgen.symbols.closed import ClosedForm
from symgen.symbols.listing import Listing
from symgen.symbols.symbolic_model import SymbolicModel

FACTORED = 300  # terms of a determinant, up to which it is factored over the rationals


def symbol(name: str) -> Any:
    """The real symbol of a name; pi is pi."""
    return sympy.pi if name == "pi" else sympy.Symbol(name, real=True)


def of_closed(form: ClosedForm, angles: Mapping[str, Any]) -> Any:
    """A closed form, its factors kept."""
    products = []
    for g in form:
        inner = of_closed(g.inner, angles) if g.inner else 1
        products.append(sympy.Mul(*(sympy_expression(e, angles) for e in (g.common, g.inside, g.parameters)), inner))
    return sympy.Add(*products)


def of_model(model: SymbolicModel) -> Any:
    """The closed form of a model: a Matrix, a column of one for vectors, an expression for scalars."""
    closed = model.closed
    angles = {name: (sympy.cos if name[0] == "C" else sympy.sin)(sympy_expression(e, {})) for name, e in closed.angles.items()}
    values = {place: of_closed(form, angles) for place, form in closed.entries.items()}
    if closed.denominator is not None:
        below = of_closed(closed.denominator, angles)
        values = {place: x / below for place, x in values.items()}
    if model.model.name == "determinant" and closed.size <= FACTORED:
        values = {place: sympy.factor(x) for place, x in values.items()}
    return _shaped(model, values)


def of_listing(model: SymbolicModel) -> tuple[list[tuple[Any, Any]], Any]:
    """The recursion of a model as `sympy.cse` gives it: [(symbol, expression)] and the model in these symbols."""
    listing: Listing = model.listing
    steps, outputs = listing.steps(_operated, symbol)
    values = dict(zip(listing.places, map(sympy.sympify, outputs), strict=True))
    return [(symbol(name), x) for name, x in steps], _shaped(model, values)


def _shaped(model: SymbolicModel, values: Mapping[tuple[int, ...], Any]) -> Any:
    shape = [len(labels) for labels in model.axes]
    if not shape:
        return values.get((), sympy.Integer(0))
    if model.model.symmetric:
        values = {**values, **{place[::-1]: x for place, x in values.items()}}
    rows, columns = (*shape, 1)[:2]
    return sympy.Matrix(rows, columns, lambda k, m: values.get((k, m)[: len(shape)], sympy.Integer(0)))


def _operated(node: Node, x: list[Any]) -> Any:
    match node.op:
        case "const":
            return sympy.Rational(node.value.numerator, node.value.denominator)
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
    """Python lines that make `value` under `name`: the symbols, the steps, the value; rationals stay exact."""
    known = {x for x, _ in steps}
    atoms = set().union(value.free_symbols, *(e.free_symbols for _, e in steps))
    free = sorted(str(x) for x in atoms - known)

    def written(e: Any) -> str:
        return str(sympy.printing.sstr(e, sympy_integers=True))

    lines = ["from sympy import *", ""]
    if free:
        lines += [f"{', '.join(free)}{',' * (len(free) == 1)} = symbols({' '.join(free)!r}, real=True{', seq=True' * (len(free) == 1)})"]
    lines += [f"{x} = {written(e)}" for x, e in steps]
    return "\n".join([*lines, f"{name} = {written(value)}"])
