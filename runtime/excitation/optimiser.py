"""Optimise a motion within its limits, from a random start, by IPOPT on CasADi functions.

From each start, the optimiser first minimises -log det(W_w'W_w), which is smooth and does not
depend on the scale of a column, then the criterion itself. Condition numbers and largest standard
deviations are replaced by the smooth bounds

    cond^2 <= (tr A^8 tr C^8)^(1/8),     max_i C_ii <= (sum_i C_ii^8)^(1/8),
            A = W_w'W_w, C = A^-1.

Limits hold at the points of the grid, with a margin. tanh(qd/v0) replaces sign(qd), except for the
rate of the torque, which leaves dry friction out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from runtime.core.model import GeneratedModel
from runtime.core.rows.predicted import Weights
from runtime.excitation.criteria import MotionLimits
from runtime.excitation.result import Start
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.loop.trajectories import Fourier, Motion, Part

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Search:
    """Data of a search for an exciting motion, sent to the processes that optimise each start.

    Attributes
    ----------
    model : GeneratedModel
    settings : ExcitationSettings
    weights : Weights
    limits : MotionLimits
    X : ndarray, shape (b,)
        All base parameters, used to compute torques.
    smooth : ndarray, shape (b,), 0 or 1
        0 for the parameters of dry friction, 1 for all others.
    """

    model: GeneratedModel
    settings: ExcitationSettings
    weights: Weights
    limits: MotionLimits
    X: Array
    smooth: Array


def one_start(search: Search, number: int) -> Start:
    """Optimise a motion by IPOPT, beginning with a random motion drawn for start `number`."""
    rng = np.random.default_rng([search.settings.seed, number])
    guess = Motion(
        tuple(Part(family, _guess(search, family, rng)) for family in search.settings.parts)
    )
    return improve(search, number, guess)


def improve(search: Search, number: int, guess: Motion) -> Start:
    """Optimise a motion by IPOPT, beginning with the motion `guess`."""
    settings, n = search.settings, len(search.weights.s)
    model = search.model
    p = [ca.MX.sym(f"p{k}", len(family.names), n) for k, family in enumerate(settings.parts)]
    q, qd, qdd = _states(settings, p)
    A = _information(model, settings, search.weights, q, qd, qdd)
    g, lower, upper = _constraints(model, search, p, q, qd, qdd)
    least, most = (
        np.concatenate([np.tile(family.bounds()[k], n) for family in settings.parts])
        for k in (0, 1)
    )
    nlp = {"x": ca.vertcat(*(ca.vec(part) for part in p)), "g": g}
    x = np.concatenate([part.p.ravel(order="F") for part in guess.parts])
    further = () if settings.criterion == "logdet" else (_spread(A, settings.criterion),)
    for f in (_logdet(A), *further):
        x, criterion, violation, message = _minimised(
            {**nlp, "f": f}, x, (least, most), (lower, upper), settings.iterations
        )
    sizes = np.cumsum([part.p.size for part in guess.parts])[:-1]
    parts = [
        Part(part.family, values.reshape(part.p.shape, order="F"))
        for part, values in zip(guess.parts, np.split(x, sizes), strict=True)
    ]
    return Start(number, Motion(tuple(parts)).to_mapping(), criterion, message, violation)


def _states(settings: ExcitationSettings, p: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Write q, qd, qdd at the instants of the time grid as expressions of the coefficients p.

    Each result has shape (M, n); the parts of the motion follow each other.
    """
    parts = []
    for family, coefficients in zip(settings.parts, p, strict=True):
        t = np.linspace(0.0, family.duration, max(3, round(family.duration * settings.grid) + 1))
        parts.append(_at(family, coefficients, t))
    q, qd, qdd = (ca.vertcat(*(part[k] for part in parts)) for k in range(3))
    return q, qd, qdd


def _information(
    model: GeneratedModel,
    settings: ExcitationSettings,
    weights: Weights,
    q: Any,
    qd: Any,
    qdd: Any,
) -> Any:
    """Write the information matrix A = W_w'W_w / M, W_w the weighted W at M grid instants.

    A = sum_j W_wj'W_wj / M, with W_wj the weighted rows of joint j; A has shape (c, c).
    """
    n, M = len(weights.s), q.shape[0]
    inputs = [ca.SX.sym(name, n) for name in ("q", "qd", "qdd")]
    D = smoothed(model.casadi("regressor"), settings.smooth)(*inputs, *model.CONSTANTS.values())
    numbers = [list(model.BASE_PARAMETERS).index(name) for name in weights.names]
    weighted = ca.mtimes(ca.mtimes(ca.diag(1 / weights.s), D[:, numbers]), ca.diag(weights.size))
    rows = [
        ca.Function("row", inputs, [weighted[j, :].T]).map(M)(q.T, qd.T, qdd.T) for j in range(n)
    ]
    return sum(ca.mtimes(row, row.T) for row in rows) / M


def _logdet(A: Any) -> Any:
    """Write -log det A of the information matrix A as an expression of its Cholesky factor."""
    S = ca.SX.sym("A", A.shape[0], A.shape[0])
    R = ca.chol(S)
    return ca.Function("logdet", [S], [-2 * ca.sum1(ca.log(ca.diag(R)))])(A)


def _spread(A: Any, criterion: str) -> Any:
    """Write the log of a smooth upper bound of cond(W)^2, or of the largest variance of parameters.

    W is the weighted observation matrix. For criterion sigma or record the bound is that of the
    variance, else that of cond(W)^2.
    """
    C = ca.solve(A, ca.DM.eye(A.shape[0]), "qr")
    if criterion in ("sigma", "record"):
        return ca.log(ca.sum1(ca.diag(C) ** 8)) / 8
    A4, C4 = (ca.mtimes(x, x) for x in (ca.mtimes(A, A), ca.mtimes(C, C)))
    return (ca.log(ca.sumsqr(A4)) + ca.log(ca.sumsqr(C4))) / 8


def _constraints(
    model: GeneratedModel, search: Search, p: Sequence[Any], q: Any, qd: Any, qdd: Any
) -> tuple[Any, Array, Array]:
    """Write limits and end conditions of the motion as constraints lower <= g(p) <= upper.

    p holds the coefficients of the motion. Each constraint is divided by its scale. Returns g,
    lower and upper.
    """
    settings, limits = search.settings, search.limits.of(search.settings.margin)
    M = q.shape[0]
    half = (limits.upper - limits.lower) / 2
    rows: list[tuple[Any, Any, Any]] = [  # expression, lower, upper: (M, n) or (n,)
        ((q - _rows(limits.lower + half, M)) / _rows(half, M), -1.0, 1.0),
        (qd / _rows(limits.qd, M), -1.0, 1.0),
        (qdd / _rows(limits.qdd, M), -1.0, 1.0),
        *_torques(model, search, limits, q, qd, qdd),
        *_distances(model, settings, q),
    ]
    ends = []
    for k, (family, coefficients) in enumerate(zip(settings.parts, p, strict=True)):
        begin, end = (
            [x.T for x in _at(family, coefficients, np.array([t]))] for t in (0.0, family.duration)
        )
        if isinstance(family, Fourier):
            rows += [(begin[1] / limits.qd, 0.0, 0.0), (begin[2] / limits.qdd, 0.0, 0.0)]
        speed = getattr(family, "speed", None)
        if speed is not None:
            shaped: Any = family  # of points: it has a speed
            middles = shaped.blend / 2 + shaped.travel * (np.arange(shaped.points - 1) + 0.5)
            rows.append((_at(family, coefficients, middles)[1].T / speed, -1.0, 1.0))
        ends.append((begin[0], end[0]))
        if k:
            rows.append(((begin[0] - ends[k - 1][1]) / half, 0.0, 0.0))
        elif settings.begin is not None:
            rows.append(((begin[0] - np.array(settings.begin)) / half, 0.0, 0.0))
    g = [ca.vec(expression) for expression, *_ in rows]
    lower, upper = (
        np.concatenate(
            [np.full(part.numel(), bound[k]) for part, (_, *bound) in zip(g, rows, strict=True)]
        )
        for k in (0, 1)
    )
    return ca.vertcat(*g), lower, upper


def _torques(
    model: GeneratedModel, search: Search, limits: MotionLimits, q: Any, qd: Any, qdd: Any
) -> list[tuple[Any, float, float]]:
    """Write the constraints on torques, on their root mean squares and on their rates of change.

    Returns an expression, its lower and its upper bound for each quantity that is limited.
    """
    settings = search.settings
    limited = np.isfinite(limits.tau)
    if not (limited.any() or settings.torque_rms or settings.torque_rate):
        return []
    n, M = q.shape[1], q.shape[0]
    inputs = [ca.SX.sym(name, n) for name in ("q", "qd", "qdd")]
    dynamics = smoothed(model.casadi("inverse_dynamics"), settings.smooth)

    def torque(X: Array) -> Any:
        function = ca.Function("torque", inputs, [dynamics(*inputs, X, *model.CONSTANTS.values())])
        return function.map(M)(q.T, qd.T, qdd.T).T

    tau, share = torque(search.X), 1 - settings.margin
    rows: list[tuple[Any, float, float]] = [
        (tau[:, j] / limits.tau[j], -1.0, 1.0) for j in np.flatnonzero(limited).tolist()
    ]
    if settings.torque_rms:
        rows.append(
            (ca.sum1(tau**2).T / M / (share * np.array(settings.torque_rms)) ** 2, 0.0, 1.0)
        )
    if settings.torque_rate:
        smooth = torque(search.X * search.smooth)
        rows.append(
            (
                (smooth[1:, :] - smooth[:-1, :])
                * settings.grid
                / _rows(share * np.array(settings.torque_rate), M - 1),
                -1.0,
                1.0,
            )
        )
    return rows


def _distances(
    model: GeneratedModel, settings: ExcitationSettings, q: Any
) -> list[tuple[Any, float, float]]:
    """Write the constraints on the distances between spheres that must stay apart.

    Each squared distance is divided by the square of the smallest allowed distance. Returns the
    expression with its lower and upper bounds.
    """
    if not settings.pairs:
        return []
    n, M = q.shape[1], q.shape[0]
    at = ca.SX.sym("q", n)
    frame_poses = model.casadi("frame_poses")
    poses = dict(
        zip(frame_poses.name_out(), frame_poses(at, *model.CONSTANTS.values()), strict=True)
    )
    unknown = [
        sphere.frame
        for sphere in settings.spheres
        if f"T{sphere.frame}" not in poses and sphere.frame != 0
    ]
    if unknown:
        raise InputError(
            f"the frame {unknown[0]} of a sphere does not exist; expected one of the frames 0, "
            f"{', '.join(name[1:] for name in poses)}"
        )
    poses["T0"] = ca.SX.eye(4)
    centres = [
        ca.mtimes(poses[f"T{s.frame}"], ca.vertcat(*s.centre, 1.0))[:3] for s in settings.spheres
    ]
    smallest = [
        settings.spheres[a].radius + settings.spheres[b].radius + settings.gap
        for a, b in settings.pairs
    ]
    squares = [
        ca.sumsqr(centres[a] - centres[b]) / d**2
        for (a, b), d in zip(settings.pairs, smallest, strict=True)
    ]
    return [
        (
            ca.Function("apart", [at], [ca.vertcat(*squares)]).map(M)(q.T),
            1.0 + 2 * settings.margin,
            np.inf,
        )
    ]


def _minimised(
    nlp: dict[str, Any],
    guess: Array,
    range_of_x: tuple[Array, Array],
    range_of_g: tuple[Array, Array],
    iterations: int,
) -> tuple[Array, float, float, str]:
    """Minimise the criterion of a nonlinear program by IPOPT, beginning with `guess`.

    Returns x, the value of the criterion, the largest violation of a constraint, and the message of
    IPOPT.
    """
    options: dict[str, Any] = {
        "ipopt": {
            "hessian_approximation": "limited-memory",
            "limited_memory_max_history": 8,
            "max_iter": iterations,
            "print_level": 0,
            "sb": "yes",
            "tol": 1e-4,
            "constr_viol_tol": LIMIT.IPOPT_VIOLATION,
            "acceptable_tol": 1e-3,
            "mu_strategy": "adaptive",
        },
        "print_time": False,
        "error_on_fail": False,
    }
    solver = ca.nlpsol("excite", "ipopt", nlp, options)
    end = solver(
        x0=guess, lbx=range_of_x[0], ubx=range_of_x[1], lbg=range_of_g[0], ubg=range_of_g[1]
    )
    g = np.asarray(end["g"]).ravel()
    violation = float(np.max(np.maximum(range_of_g[0] - g, g - range_of_g[1]), initial=0.0))
    criterion = float(end["f"])
    x = np.asarray(end["x"]).ravel()
    if not (np.isfinite(criterion) and np.isfinite(violation)):
        return guess, float("inf"), float("inf"), solver.stats()["return_status"]
    return x, criterion, violation, solver.stats()["return_status"]


def smoothed(function: Any, v0: float) -> Any:
    """Copy a CasADi function, with the smooth tanh(u/v0) in place of every sign(u)."""
    inputs = function.sx_in()
    columns = [ca.vertsplit(x) if x.numel() else [] for x in inputs]
    results = [[0.0] * function.nnz_out(k) for k in range(function.n_out())]
    w: list[Any] = [None] * function.sz_w()
    for k in range(function.n_instructions()):
        op, i, o = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if op == ca.OP_CONST:
            w[o[0]] = ca.SX(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            w[o[0]] = columns[i[0]][i[1]]
        elif op == ca.OP_OUTPUT:
            results[o[0]][o[1]] = w[i[0]]
        elif op == ca.OP_SIGN:
            w[o[0]] = ca.tanh(w[i[0]] / v0)
        else:
            w[o[0]] = (
                ca.SX.unary(op, w[i[0]]) if len(i) == 1 else ca.SX.binary(op, w[i[0]], w[i[1]])
            )
    outputs = [ca.SX(function.sparsity_out(k), ca.vertcat(*x)) for k, x in enumerate(results)]
    return ca.Function(f"{function.name()}_smooth", inputs, outputs)


def _at(family: Any, p: Any, t: Array) -> list[Any]:
    """Compute q, qd, qdd of all joints at the times t, shape (M,), from the coefficients p.

    Each result has shape (M, n).
    """
    joints = [family.joint(t, column, ca) for column in ca.horzsplit(p)]
    return [ca.horzcat(*(joint[k] for joint in joints)) for k in range(3)]


def _guess(search: Search, family: Any, rng: np.random.Generator) -> Array:
    limits = search.limits
    speed = np.minimum(limits.qd, 1e3)
    return np.array(
        [
            family.guess(rng, lo, up, v)
            for lo, up, v in zip(limits.lower, limits.upper, speed, strict=True)
        ]
    ).T


def _rows(x: Array, M: int) -> Any:
    """Return a matrix of M rows that are all equal to x, shape (n,)."""
    return ca.DM(np.tile(x, (M, 1)))
