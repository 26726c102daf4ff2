"""What `symgen show` prints, read back and compared with the witness before it leaves.

Text, JSON and lines of SymPy are read as they are printed. LaTeX and MathML print the expressions
of the JSON, which is read in their place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import product
from typing import Any

import numpy as np

from symgen.certify.printed import equations, evaluated
from symgen.certify.texts import TOLERANCE, difference
from symgen.certify.witness import Witness
from symgen.derive.exact import Array
from symgen.derive.names import Names
from symgen.description.robot import parameter
from symgen.errors import CertificateError, SymgenError
from symgen.regroup.regrouping import Regrouping
from symgen.symbols.printing import FORMS
from symgen.symbols.symbolic import SymbolicRobot, symbolic
from symgen.symbols.symbolic_model import SymbolicModel

UP_TO_A_CONSTANT = "potential_energy"
AT_CONSTANT_RATES = ("bias", "jacobian_rate", "forward_dynamics")
FRICTION = ("viscous", "coulomb")


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
    found, right = evaluated(printed, _symbols(witness, model)), expected(witness, model)
    value = _entries(found, model, right.shape)
    if model.model.name == UP_TO_A_CONSTANT:
        value, right = value - value[:1], right - right[:1]
    if divided and "det A" in found:
        value = value / np.reshape(found["det A"], (-1, 1))
    return difference(value, right, max(np.abs(right).max(initial=0.0), 1.0))


def require_models(regrouping: Regrouping, names: Iterable[str]) -> None:
    """Raise CertificateError unless all forms of these models that there are hold."""
    models = symbolic(regrouping.robot)
    for name, form in product(names, FORMS):
        try:
            certified_model(models, regrouping, name, form, "json")
        except CertificateError:
            raise
        except SymgenError:
            continue  # there is no such form


def _symbols(witness: Witness, model: SymbolicModel) -> dict[str, Any]:
    """Value of every symbol of a model, by sample."""
    robot, source = witness.robot, model.source
    named = Names(len(robot.frames))
    qdd = witness.qdd * (model.model.name not in AT_CONSTANT_RATES)  # of tied joints by the rates
    accelerations = witness.model.motion(witness.q, witness.qd, qdd)[2]
    motion = {"q": witness.x, "QP": witness.xd, "QDP": accelerations}
    values: dict[str, Any] = {
        f"{letter}{j}": x[:, k] for letter, x in motion.items() for k, j in enumerate(robot.moving)
    }
    for k, j in enumerate(robot.joints):
        values[f"GAM{j}"] = witness.tau[:, k]
        values |= {named("G", u, j): witness.G[:, m, k] for m, u in enumerate(robot.moving)}
    values |= dict(zip(robot.parameters, witness.chi, strict=True))
    if source.kind == "base":
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


def expected(witness: Witness, model: SymbolicModel) -> Array:
    """What a model has to give, (N, ...)."""
    w, request = witness, model.request
    T = np.concatenate(
        [np.broadcast_to(np.eye(4), (len(w.q), 1, 4, 4)), w.model.poses(w.x)], axis=1
    )
    R = T[:, request.frame, :3, :3].swapaxes(1, 2)

    def seen(twist: Array) -> Array:
        """The same twist in components of the frame asked for."""
        return np.concatenate([R @ twist[:, :3], R @ twist[:, 3:]], axis=1)

    def jacobian() -> Array:
        J = (
            w.model.jacobian(w.x, request.of)
            if request.of
            else np.zeros((len(w.q), 6, len(w.robot.moving)))
        )
        return seen(J @ w.G)

    def acceleration(qdd: Array) -> Array:
        linear_and_angular = w.model.acceleration(*w.model.motion(w.q, w.qd, qdd)[:3], request.of)
        return seen(linear_and_angular[..., None])[..., 0]

    def determinant() -> Array:
        J = jacobian()
        rows = [k for k in range(6) if np.abs(J[:, k]).max() > TOLERANCE]
        square = J[:, rows if model.rows is None else [k - 1 for k in model.rows]]
        return np.asarray(np.linalg.det(square))

    def coriolis() -> Array:
        """C e_j = (h(qd + e_j) - h(qd) - h(e_j))/2 of the quadratic h = C(qd) qd."""
        still = w.chi * (1 - _of_kinds(w, FRICTION))
        at_rest = w.torque(w.q, 0 * w.q, 0 * w.q, still)
        h = [
            w.torque(w.q, u, 0 * w.q, still) - at_rest
            for e in np.eye(w.q.shape[1])
            for u in (w.qd + e, w.qd, 0 * w.qd + e)
        ]
        return np.stack([h[k] - h[k + 1] - h[k + 2] for k in range(0, len(h), 3)], axis=-1) / 2

    values: dict[str, Callable[[], Array]] = {
        "pose": lambda: np.linalg.inv(T[:, request.frame]) @ T[:, request.of],
        "jacobian": jacobian,
        "determinant": determinant,
        "velocity": lambda: (jacobian() @ w.qd[..., None])[..., 0],
        "jacobian_rate": lambda: acceleration(0 * w.qdd),
        "acceleration": lambda: acceleration(w.qdd),
        "inverse_dynamics": lambda: w.tau,
        "inertia_matrix": lambda: w.A,
        "bias": lambda: w.H,
        "gravity": lambda: w.rest,
        "coriolis": coriolis,
        "friction": lambda: w.torque(w.q, w.qd, 0 * w.q, w.chi * _of_kinds(w, FRICTION)),
        "kinetic_energy": lambda: np.einsum("ti,tij,tj->t", w.qd, w.A, w.qd) / 2,
        "potential_energy": lambda: w.model.potential_energy(w.x, w.chi),
        "forward_dynamics": lambda: w.qdd,
        "regressor": lambda: w.own if model.source.kind == "base" else w.D,
        "base_parameters": lambda: np.tile(
            w.X if model.source.kind == "base" else w.chi, (len(w.q), 1)
        ),
        "closure": lambda: np.zeros((len(w.q), len(model.places))),
    }
    return np.asarray(values[model.model.name]())


def _of_kinds(witness: Witness, kinds: tuple[str, ...]) -> Array:
    """1 for the parameters of elements of these kinds, 0 for others."""
    names = {
        parameter(e.family, j) for e in witness.robot.elements for j in e.keys if e.kind in kinds
    }
    return np.array([float(name in names) for name in witness.robot.parameters])
