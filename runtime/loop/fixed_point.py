"""Fixed-point iteration of IV and DIDIM: estimate and simulate in turn until X no longer changes.

    X^(k+1) = estimate from the record and the simulation with X^k and gains g(X^k), until X no
    longer changes; then again with g = 1

The gains g refer to X_ref, which is not the truth, so that the last passes need g = 1. A parameter
vector whose loop cannot be simulated (inertia not positive definite, unstable) is refused: the step
towards it is halved, at most five times. The iteration stops if max |dX_i|/sigma_i < 0.1 and the
norm of the residual changes by less than a thousandth, or if only rounding errors change it. If the
control of the loop is soft, passes of DIDIM overshoot: from the third pass on, the steps are those
of Anderson (1965), f_k = X_next - X^k, gamma = argmin |f_k - dF gamma| over the last differences,
X^(k+1) = X^k + f_k - (dX + dF) gamma.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from runtime.core.least_squares.estimate import Status
from runtime.core.least_squares.method import Beginning
from runtime.core.model import joint_labels
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.ground.settings import Count, Positive, Real
from runtime.loop.closed_loop import ClosedLoop, LoopOptions
from runtime.loop.control_law import parameters_of
from runtime.loop.result import Simulation

LIMIT = limits(__package__)

Array = np.ndarray

# the stop of passes with rescaled gains, which only lead to the last ones, over that of the last
PASS = ("norm", "g", "change")  # of a pass, in `details`


class FixedPointOptions(LoopOptions):
    """Options (estimate.options) of methods iv and didim.

    Attributes
    ----------
    start : str or mapping of float
        X^0: ols, values of the robot file, unit (motor inertia, else inertia or mass of the own
        link, 1 for every joint; all others 0), or parameters by name, with all others 0.
    gains : str
        Parameters X_ref from which the gain rescaling g is computed: ols, values, start, or one (no
        rescaling).
    passes : int
        Largest number of passes with rescaled gains, and with g = 1.
    change : float
        Largest change of a parameter over its standard deviation at which the passes end.
    residual : float
        Relative change of the residual norm at which the passes end.
    """

    start: Literal["ols", "values", "unit"] | Mapping[str, Real] = "ols"
    gains: Literal["ols", "values", "start", "one"] = "ols"
    passes: Count = 15
    change: Positive = 0.1
    residual: Positive = 1e-3


@dataclass(frozen=True, eq=False)
class Step:
    """Result of one iteration of IV or DIDIM: parameters X, their covariance, residual norm.

    X has shape (c,). `result` holds other data that the method needs later.
    """

    X: Array
    covariance: Array
    norm: float
    result: Any = None


@dataclass(frozen=True, eq=False)
class Fixed:
    """Result of an IV or DIDIM iteration: the last pass, all passes, and the convergence."""

    step: Step
    trail: tuple[dict[str, Any], ...]
    converged: bool
    contraction: float
    message: str = ""


def initial(loop: ClosedLoop, start: Beginning, which: str | Mapping[str, float]) -> Array:
    """Choose the parameters X from which the iteration of IV or DIDIM starts.

    `which` : ols (ordinary least squares), values (of the robot file), unit (unit inertias), or
    values by name.
    """
    names = start.observation.names
    if not isinstance(which, str):
        if unknown := [name for name in which if name not in names]:
            raise SettingsError(
                f"the fit has no parameter {', '.join(unknown)}; expected some of {', '.join(names)}",
                path=("estimate", "options", "start"),
            )
        return np.array([which.get(name, 0.0) for name in names])
    if which == "ols":
        return start.solution.X
    model: Any = loop.model
    if which == "values":
        try:
            base = parameters_of(model)
        except InputError as e:
            raise SettingsError(
                f"the setting start: values needs a value of every parameter, but "
                f"{e.message.partition(';')[0]}; give the missing values in the robot file (0 for a "
                "parameter that is zero), or use start: ols and gains: one",
                path=("estimate", "options"),
            ) from e
    else:
        standard = dict.fromkeys(model.STANDARD_PARAMETERS, 0.0)
        for j in model.JOINTS:
            own = next((name for name in (f"Ia{j}", f"ZZ{j}", f"M{j}") if name in standard), None)
            if own is None:
                raise SettingsError(
                    f"start: unit sets an inertia of 1 for each joint, but joint {j} of {model.NAME} "
                    "has no inertia parameter of its own; use start: ols",
                    path=("estimate", "options", "start"),
                )
            standard[own] = 1.0
        base = model.base_parameters(standard)
    X = dict(zip(model.BASE_PARAMETERS, base, strict=True))
    return np.array([X[name] for name in names])


def iterate(
    loop: ClosedLoop, start: Beginning, update: Callable[[Sequence[Simulation], Array], Step]
) -> Fixed:
    """Repeat the simulation and the estimation of the parameters X until X no longer changes.

    X holds the parameters of the columns of the rows.
    """
    options: FixedPointOptions = start.options
    names = start.observation.names
    X = initial(loop, start, options.start)
    reference = X if options.gains in ("start", "one") else initial(loop, start, options.gains)
    J = None if options.gains == "one" else loop.inertia(loop.all_of(names, reference))
    if J is not None and not np.all(J > 0):
        raise InputError(
            f"gains: {options.gains}: the parameters that this option selects do not give a positive inertia about joint "
            f"{joint_labels(loop.model)[int(np.argmin(J))]}; {_physical_start(loop, start)}"
        )
    remedy = _physical_start(loop, start)
    if options.start not in ("ols", "unit") and np.all(loop.inertia(loop.all_of(names, X)) > 0):
        remedy = "check the controller of the study: law, gains, rate, delay, reference"
    trail: list[dict[str, Any]] = []
    step: Step | None = None
    converged = False
    for rescaled in (True, False) if J is not None else (False,):
        first, converged = len(trail), False
        for _ in range(options.passes):
            at(
                f"pass {len(trail) + 1}"
                + (f", largest change {trail[-1]['change']:.2g} deviations" if trail else "")
            )
            X, g, runs, message = _simulated(
                loop,
                names,
                X,
                trail[-1]["X"] if trail else None,
                J if rescaled else None,
                remedy,
            )
            if step is not None and message:
                return Fixed(step, tuple(trail), False, _contraction(trail), message)
            step = update(runs, X)
            sigma = np.sqrt(np.maximum(np.diag(step.covariance), 0.0))
            size = np.where(sigma > 0, sigma, np.inf)
            moved = np.abs(step.X - X)
            change = float(np.max(moved / size, initial=0.0))
            trail.append({"X": X, "next": step.X, "norm": step.norm, "g": g, "change": change})
            last = trail[first:][-LIMIT.ANDERSON_MEMORY - 1 :]
            before = last[-2]["norm"] if len(last) > 1 else np.nan
            still = abs(step.norm - before) <= options.residual * before
            rounding = bool(np.all(moved <= 1e-9 * np.max(np.abs(step.X))))
            X = _accelerated(last, size)
            near = change < options.change * (LIMIT.ROUGH_STOP if rescaled else 1)
            if (near and still) or rounding:
                converged = True
                break
    assert step is not None  # options.passes >= 1
    return Fixed(step, tuple(trail), converged, _contraction(trail))


def _physical_start(loop: ClosedLoop, start: Beginning) -> str:
    """Advise which start values to set if the iteration starts from unphysical parameters.

    The advice is the values of the robot file if they give a positive inertia about every joint,
    else the parameters of method feasible.
    """
    try:
        X = loop.all_of(start.observation.names, initial(loop, start, "values"))
        if np.all(loop.inertia(X) > 0):
            return (
                "set estimate.options: {start: values, gains: values}, the values of the robot file"
            )
    except InputError:
        pass
    return (
        "identify with estimate: {method: feasible} first, and give the estimated parameters by name as "
        "estimate.options.start, with gains: start"
    )


def _simulated(
    loop: ClosedLoop,
    names: Sequence[str],
    X: Array,
    before: Array | None,
    J: Array | None,
    remedy: str,
) -> tuple[Array, Array, Sequence[Simulation], str]:
    """Simulate the closed loop with X; if this fails, try X nearer to the last X that succeeded.

    Each further attempt halves the distance.

    Returns X, the gains g, the runs, and the reason if no simulation was possible. remedy : advice
    in the error if the first simulation fails.
    """
    reason = ""
    for _ in range(LIMIT.HALVINGS + 1):
        g = np.ones(len(loop.model.JOINTS))
        try:
            if J is not None:
                g = loop.inertia(loop.all_of(names, X)) / J
                if not np.all(g > 0):
                    least = joint_labels(loop.model)[int(np.argmin(g))]
                    raise InputError(f"the inertia about joint {least} is negative")
            return X, g, loop.run(loop.all_of(names, X), g), ""
        except InputError as e:
            reason = str(e)
            if before is None:
                raise InputError(
                    f"the loop cannot be simulated with the start parameters: {reason}; {remedy}"
                ) from None
            X = (X + before) / 2
    return (
        X,
        g,
        (),
        f"The simulation fails, also after {LIMIT.HALVINGS} halved steps: {reason}",
    )


def _accelerated(last: Sequence[Mapping[str, Any]], size: Array) -> Array:
    """Extrapolate the next X from the last passes (Anderson acceleration).

    Each pass moved from X to `next`. Distances are in units of `size`, shape (c,).
    """
    points = np.array([own["X"] for own in last])
    steps = np.array([own["next"] - own["X"] for own in last])
    if len(points) < 3:
        return np.asarray(points[-1] + steps[-1])
    dX, dF = np.diff(points, axis=0).T, np.diff(steps, axis=0).T
    gamma = np.linalg.lstsq(dF / size[:, None], steps[-1] / size, rcond=1e-6)[0]
    return np.asarray(points[-1] + steps[-1] - (dX + dF) @ gamma)


def _contraction(trail: Sequence[Mapping[str, Any]]) -> float:
    """Compute the ratio of the last change of X to the change before; nan for fewer than two."""
    changes = [
        float(np.linalg.norm((own["next"] - own["X"]) / np.maximum(np.abs(own["next"]), 1e-12)))
        for own in trail[-2:]
    ]
    return changes[1] / changes[0] if len(changes) > 1 and changes[0] > 0 else float("nan")


def outcome_of(loop: ClosedLoop, fixed: Fixed, method: str) -> tuple[Status, str, dict[str, Any]]:
    """Return the status, the message and the details of an IV or DIDIM iteration.

    The details give the parameters after each pass, the norm of the residual, the gains, and the
    largest change in standard deviations.
    """
    parts = [part for part in (fixed.message, loop.assumption) if part]
    if not fixed.converged:
        parts.insert(
            0,
            f"{method.upper()} has not converged after {len(fixed.trail)} "
            f"pass{'es' * (len(fixed.trail) > 1)}.",
        )
        if not fixed.message:
            parts.append(
                "Likely causes: a wrong controller, delay or reference; parameters the record "
                "hardly determines. Raise passes"
                + (", or start from values." if getattr(loop.model, "VALUES", None) else ".")
            )
    elif fixed.contraction > LIMIT.SLOW_CONTRACTION:
        parts.append(
            "The changes of the parameters hardly decrease from pass to pass (ratio "
            f"{fixed.contraction:.2f}): the result depends on the number of passes."
        )
    passes = [{"X": own["next"], **{k: own[k] for k in PASS}} for own in fixed.trail]
    details = {"trail": passes, "contraction": fixed.contraction}
    return ("ok" if fixed.converged else "not-converged"), " ".join(parts), details
