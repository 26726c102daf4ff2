"""What `symgen show` prints, read back and compared with the witness before it leaves.

Text, JSON and lines of SymPy are read as they are printed. LaTeX and MathML print the expressions
of the JSON, which is read in their place.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from symgen.certify.printed import equations, evaluated
from symgen.certify.texts import TOLERANCE, difference
from symgen.certify.witness import Witness
from symgen.derive.exact import Array
from symgen.derive.models import SYMBOLIC
from symgen.derive.names import Names
from symgen.errors import CertificateError, SymgenError
from symgen.regroup.regrouping import Regrouping
from symgen.symbols.printing import FORMS
from symgen.symbols.symbolic import SymbolicRobot, symbolic
from symgen.symbols.symbolic_model import SymbolicModel


def certified_model(
    models: SymbolicRobot,
    regrouping: Regrouping,
    name: str,
    form: str = "closed",
    format: str = "text",
    **request: Any,
) -> tuple[str, str]:
    """A model as `SymbolicRobot.show` prints it, and a note where it could not be certified: for
    values of passive joints, or at which the loops do not close.

    Raises CertificateError where what is printed is not what the witness gives, at random states,
    parameters and constants but for given values.
    """
    text = models.show(name, form=form, format=format, **request)
    model = models.model(name, **request)
    fixed: dict[str, float] = {}
    for symbol, e in model.source.given.items():
        fixed[symbol] = e.value({**regrouping.robot.constants, **fixed})
    passive = {f"{x}{j}" for x in ("q", "QP", "QDP") for j in regrouping.robot.passive}
    witness = Witness(regrouping, fixed)
    if passive & {*fixed} or not np.isfinite(witness.D).all():
        return text, f"note: {name} is not certified: its passive joints have given values"
    read = text if "latex" not in format else models.show(name, form=form, format="json", **request)
    try:
        error = _error(equations(read), witness, model, divided=format != "sympy")
    except (ArithmeticError, LookupError, SyntaxError, TypeError, ValueError):
        error = float("inf")  # what is printed is no expression
    if not error < TOLERANCE:
        raise CertificateError(
            f"{models.source.robot.name}: {name} as printed is off by {error:.1e} of the largest "
            "entry from other dynamics; nothing is printed",
            error,
        )
    return text, ""


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


def require_models(regrouping: Regrouping) -> None:
    """Raise CertificateError unless the models of a robot's page hold in all forms that there
    are.
    """
    models = symbolic(regrouping.robot)
    for model, form in product(SYMBOLIC.values(), FORMS):
        try:
            if model.page:
                certified_model(models, regrouping, model.name, form, "json")
        except CertificateError:
            raise
        except SymgenError:
            continue  # there is no such form


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
