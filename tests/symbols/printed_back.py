"""What `symgen show` prints, read back and compared with the witness: text, JSON, lines of SymPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from certify.printed import equations, evaluated

from symgen.certify.texts import difference
from symgen.certify.witness import Witness
from symgen.derive.exact import Array
from symgen.derive.names import Names
from symgen.regroup.regrouping import Regrouping
from symgen.symbols.symbolic import SymbolicRobot
from symgen.symbols.symbolic_model import SymbolicModel


def error_of(
    text: str, models: SymbolicRobot, regrouping: Regrouping, name: str, **request: Any
) -> float:
    """Largest difference of a model as printed from what the witness gives, of the largest entry,
    at random states, parameters and constants but for given values; infinity where it is no text of
    equations.
    """
    model = models.model(name, **request)
    fixed: dict[str, float] = {}
    for symbol, e in model.source.given.items():
        fixed[symbol] = e.value({**regrouping.robot.constants, **fixed})
    witness = Witness(regrouping, fixed)
    assert np.isfinite(witness.D).all()
    try:
        return _error(equations(text), witness, model, divided=not text.startswith("import sympy"))
    except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError):
        return float("inf")


def _error(
    printed: list[tuple[str, str]], witness: Witness, model: SymbolicModel, *, divided: bool
) -> float:
    """Largest difference of what is printed from what the model has to give, of the largest entry;
    `divided`: whether the entries of a direct model are still to be.
    """
    found, request = evaluated(printed, _symbols(witness, model)), model.request
    right = witness.value(model.model.name, request.of, request.frame, model.rows)
    right = np.broadcast_to(right, (len(right), *map(len, model.axes)))
    value = _entries(found, model, right.shape)
    if model.model.up_to_a_constant:
        value, right = value - value[:1], right - right[:1]
    if divided and model.model.denominator in found:
        value = value / np.reshape(found[model.model.denominator], (-1, 1))
    return difference(value, right, max(np.abs(right).max(initial=0.0), 1.0))


def _symbols(witness: Witness, model: SymbolicModel) -> dict[str, Any]:
    """Value of every symbol of a model, by sample."""
    robot, source = witness.robot, model.source
    named = Names(len(robot.frames))
    qdd = witness.qdd * ("qdd" in model.model.arguments)  # else tied joints by the rates alone
    accelerations = witness.model.motion(witness.q, witness.qd, qdd)[2]
    motion = {"q": witness.x, "QP": witness.xd, "QDP": accelerations}
    values: dict[str, Any] = {
        f"{letter}{j}": x[:, k] for letter, x in motion.items() for k, j in enumerate(robot.moving)
    }
    for k, j in enumerate(robot.joints):
        values[f"GAM{j}"] = witness.tau[:, k]
        values |= {named("G", u, j): witness.G[:, m, k] for m, u in enumerate(robot.moving)}
    values |= dict(zip(robot.parameters, witness.chi, strict=True))
    values |= dict(zip(source.parameters, witness.X, strict=True))
    return values | witness.constants


def _entries(found: Mapping[str, Any], model: SymbolicModel, shape: tuple[int, ...]) -> Array:
    """The entries of a model, (N, ...), zero where none is printed."""
    value = np.zeros(shape)
    matrix = found.get(model.model.letter.replace(" ", "_"))
    for place in np.ndindex(shape[1:]):
        above = tuple(sorted(place)) if model.model.symmetric else place
        if isinstance(matrix, list):
            value[(slice(None), *place)] = matrix[place[0]][(*place, 0)[1]]
        else:
            value[(slice(None), *place)] = found.get(
                model.label(above), 0.0 if matrix is None or place else matrix
            )
    return value
