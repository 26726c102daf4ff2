"""Right values of every equation that is printed: the expression graph at random numbers.

Each name has random numbers of its own, the intermediate variables too. So each equation of a
recursion is compared by itself: nothing cancels further down.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from forms.reader import FUNCTIONS

from symgen.derive.graph import SYM, Node, Symbol, interpret, reachable
from symgen.derive.models import MODELS, Request
from symgen.description.expression import Expression
from symgen.regroup.regrouping import Regrouping
from symgen.symbols.symbolic_model import SymbolicModel

Values = Mapping[str, Any]
DRAWS, SMALL, LARGE = 6, (0.05, 0.25), (0.5, 2.0)  # small ones: a sign of q - 0.3


@cache
def number(name: str) -> Any:
    """Random numbers of a name, complex so that every root has a value; pi is pi."""
    if name == "pi":
        return np.full(DRAWS, np.pi + 0j)
    rng = random.Random(name)
    sizes = [rng.uniform(*(SMALL if k in (2, 3) else LARGE)) for k in range(DRAWS)]
    signs = (1, -1, 1, -1, *(rng.choice((1, -1)) for _ in range(DRAWS - 4)))
    return np.array(sizes) * signs + 0j


class Numbers:
    """The domain of these numbers, for nodes of the graph."""

    def symbol(self, symbol: Symbol) -> Any:
        if symbol.kind == "number":
            return self.number(Fraction(symbol.name))
        return number(symbol.name)

    def number(self, c: Fraction) -> Any:
        return complex(c)

    def function(self, node: Node, x: list[Any]) -> Any:
        if node.op == "inv":
            return 1 / x[0]
        if node.op == "pos":
            return FUNCTIONS["max"](x[0], 0)
        return x[0] ** x[1] if node.op == "pow" else FUNCTIONS[node.op](*x)


def expression(e: Expression, known: Values) -> Any:
    """Value of an expression of the robot file."""

    def function(name: str, *operands: Expression) -> Any:
        x = [expression(operand, known) + 0j for operand in operands]
        if name in ("inv", "pow"):
            return 1 / x[0] if name == "inv" else x[0] ** x[1]
        return FUNCTIONS[name](*x)

    return e.evaluate(lambda a: known[a], function, complex)


def of_recursion(model: SymbolicModel) -> tuple[dict[str, Any], dict[str, Any]]:
    """Names that may be read, with their numbers; and the right value of each equation."""
    listing = model.listing
    steps, outputs = listing.steps(Numbers(), number)
    labels = [model.label(place) for place in listing.places]
    known = {name: number(name) for name in (*listing.text.called.values(), *steps)}
    right = steps | {label: x for label, x in zip(labels, outputs, strict=True) if not _is_zero(x)}
    return known | {"pi": number("pi")}, right


def of_closed(model: SymbolicModel) -> tuple[dict[str, Any], dict[str, Any]]:
    """The same of the closed form: names of its angles are cosines and sines of the positions."""
    robot = model.source.robot
    closed = model.closed
    moving = [f"{state}{j}" for state in ("q", "QP", "QDP", "GAM") for j in robot.moving]
    entries, names = _entries(model)
    known = {
        name: number(name)
        for name in (*robot.constants, *moving, *robot.parameters, *model.source.parameters, *names)
    }
    known["pi"] = number("pi")
    angles = {
        name: FUNCTIONS["cos" if name[0] == "C" else "sin"](expression(e, known))
        for name, e in closed.angles.items()
    }
    return known | angles, angles | entries


def _entries(model: SymbolicModel) -> tuple[dict[str, Any], set[str]]:
    """Right values of the entries, and the names of the graph."""
    source, request = model.source, model.request
    match model.model.composed:
        case "formulas":
            known = {p: number(p) for p in (*source.robot.parameters, *source.robot.constants)}
            return {
                name: formula(f.combination, known) for name, f in source.formulas.items()
            }, set()
        case "determinant":
            J, names = _matrix(model, "jacobian", request)
            rows = (
                [k - 1 for k in model.rows]
                if model.rows
                else [k for k in range(6) if not all(map(_is_zero, J[k]))]
            )
            return {model.label(()): _det([J[k] for k in rows])}, names
        case "quotient":
            A, names = _matrix(model, "inertia_matrix", request)
            H, more = _matrix(model, "bias", request)
            n = range(len(H))
            A = [[A[min(i, k)][max(i, k)] for k in n] for i in n]
            rest = [number(f"GAM{j}") - h[0] for j, h in zip(source.robot.joints, H, strict=True)]
            found = {
                model.label((i,)): _det([[rest[k] if m == i else A[k][m] for m in n] for k in n])
                for i in n
            }
            return found | {model.model.denominator: _det(A)}, names | more
    values = model.model.values(source.derivation, request)
    names = {str(node.value) for node in reachable(values.outputs) if node.op == SYM}
    made = interpret(values.outputs, Numbers())
    kept = {*model.places}
    return {
        model.label(entry.place): x
        for entry, x in zip(values.entries, made, strict=True)
        if entry.place in kept and not _is_zero(x)
    }, names


def _matrix(model: SymbolicModel, name: str, request: Request) -> tuple[list[list[Any]], set[str]]:
    values = MODELS[name].values(model.source.derivation, request)
    rows, columns = (1 + max((*e.place, 0)[k] for e in values.entries) for k in (0, 1))
    matrix: list[list[Any]] = [[0] * columns for _ in range(rows)]
    for entry, x in zip(values.entries, interpret(values.outputs, Numbers()), strict=True):
        i, k = (*entry.place, 0)[:2]
        matrix[i][k] = x
    return matrix, {str(node.value) for node in reachable(values.outputs) if node.op == SYM}


def _det(rows: list[list[Any]]) -> Any:
    full = np.array([[np.broadcast_to(x, DRAWS) for x in row] for row in rows], dtype=complex)
    return np.linalg.det(np.moveaxis(full, -1, 0))


def _is_zero(x: Any) -> bool:
    return isinstance(x, int) and x == 0


def formula(combination: Mapping[str, Expression], known: Values) -> Any:
    """Value of a base parameter, sum_k c_k chi_k."""
    return sum(
        expression(c, {**known, "pi": number("pi")}) * known[p] for p, c in combination.items()
    )


def of_formulas(regrouping: Regrouping) -> tuple[dict[str, Any], dict[str, Any]]:
    """Names of the formulas of base parameters with their numbers, and the right values."""
    robot = regrouping.robot
    known = {name: number(name) for name in (*robot.constants, *robot.parameters, "pi")}
    return known, {b.name: formula(b.combination, known) for b in regrouping.base}


def differs(found: Any, right: Any) -> bool:
    """Whether a value is not that of the graph, up to rounding."""
    found, right = (np.asarray(x, dtype=complex) for x in (found, right))
    size = 1 + np.abs(right)
    return not bool(np.all(np.abs(found - right) < 1e-9 * size))
