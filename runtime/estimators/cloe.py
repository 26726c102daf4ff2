"""CLOE and CLIE: output error of the closed loop, in position or in torque.

    X = argmin sum_j ||y_j - y_s,j(X)||^2 / s_j^2,    y decimated position (CLOE) or torque (CLIE), y_s that of the simulation with X

Gauss-Newton in a trust region (`scipy.optimize.least_squares`) on D^-1 X, D = max(|X^0|, sigma of least squares); J = dy_s/dX from the tangent
system of the loop, g = 1.
s_j is the deviation of the residual: found at the start, found again at the first minimum, from where the search goes on once more.
C = s^2 (J'VJ)^-1. A loop that holds its position well makes J small: slow, dependent on its start, and the first to fail where the simulation
does not know what the encoder did to the loop.

Reference: Landau, Anderson and De Bruyne (2001) for output error in closed loop; Jubien, Gautier and Janot (2014) against DIDIM.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.optimize import least_squares

from runtime.errors import InputError
from runtime.estimators import iv, ols
from runtime.estimators.block_covariance import block_covariance
from runtime.estimators.closed_loop import ClosedLoop, loop_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.fixed_point import Array, full, initial
from runtime.estimators.linear import assemble, columns_asked, outcome, standard_deviations
from runtime.estimators.simulated_motion import judged
from runtime.model.generated import GeneratedModel
from runtime.observation.system import Observation, split_rows
from runtime.progress import at
from runtime.settings.schema import Count, Positive, Real, Settings, structure
from runtime.settings.study import EstimateSettings


class CloeOptions(Settings):
    """estimate.options of method cloe.

    Attributes
    ----------
    output : str
        position, or torque (CLIE).
    start : str
        First parameters: iv, ols, or values of the robot file.
    passes : int
        Largest number of simulations of each of two searches.
    step : float
        Length of a step, of that of X in units of D, at which a search ends.
    decrease : float
        Relative decrease of the criterion at which a search ends.
    reference : str
        known, or measured where the reference has to be inferred.
    around : float, s
        Time about slow rows that is left out with them.
    """

    output: Literal["position", "torque"] = "position"
    start: Literal["iv", "ols", "values"] = "iv"
    passes: Count = 30
    step: Positive = 1e-4
    decrease: Positive = 1e-6
    reference: Literal["known", "measured"] = "known"
    around: Real = 0.0


def cloe(
    observation: Observation,
    settings: EstimateSettings,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """The Estimate; its residual norms and relative errors are those of Y - W X, `details` holds those of the output.

    SettingsError where no loop is attached to the observation.
    """
    loop, options = loop_of(observation, "cloe"), structure(CloeOptions, settings.options, ("estimate", "options"))
    observation = observation.columns(columns_asked(observation, settings))
    base = ols.system(observation, EstimateSettings())
    first = base.solve()
    if first.rank < len(observation.names):
        return assemble(replace(base, settings=settings), first, model=model, provenance=provenance)
    X = _start(loop, observation, options)
    D = np.maximum(np.abs(X), np.sqrt(np.diag(standard_deviations(base, first)[1])))
    y = _measured(loop, observation, options.output)
    trail: list[dict[str, Any]] = []
    e = y - _simulated(loop, observation, X, options.output)
    converged = True
    for _ in range(2):
        weights = 1 / np.repeat(_deviations(e, observation), observation.rows)
        X, converged = _searched(loop, observation, X, y, D, weights, options, trail)
        e = y - _simulated(loop, observation, X, options.output)
    J = _slope(loop, observation, X, options.output)
    weights = 1 / np.repeat(_deviations(e, observation), observation.rows)
    T = np.linalg.inv(np.linalg.qr(J * weights[:, None] * D, mode="r")) * D[:, None]
    r, c = J.shape
    C = T @ T.T * float(np.sum((weights * e) ** 2)) / max(r - c, 1)
    C_b = block_covariance(split_rows(np.column_stack([J, e]) * weights[:, None], observation.blocks()), np.zeros(c), T)
    estimate = assemble(replace(base, settings=settings, iterations=len(trail)), replace(first, X=X), model=model, provenance=provenance)
    status, message = outcome(base, first)
    apart, note, motion = judged(loop, observation, full(observation.names, X, loop.model.BASE_PARAMETERS))
    parts = [message, loop.assumption, note]
    if not converged:
        parts.insert(
            0,
            f"CLOE has not converged after {len(trail)} simulations. Output error depends on its start: start from iv, raise passes, or take didim.",
        )
    if status == "ok":
        status = apart if converged else "not-converged"
    return replace(
        estimate,
        covariance=C,
        sigma=np.sqrt(np.diag(C)),
        sigma_corrected=np.sqrt(np.diag(C_b)),
        status=status,
        message=" ".join(part for part in parts if part),
        details={"output": options.output, "output_error": _relative(e, y, observation), "trail": trail, **motion},
    )


def _start(loop: ClosedLoop, observation: Observation, options: CloeOptions) -> Array:
    if options.start != "iv":
        return initial(loop, observation, options.start)
    return iv.iv(observation, EstimateSettings(method="iv"), model=loop.model).X


def _measured(loop: ClosedLoop, observation: Observation, output: str) -> Array:
    """y, shape (r,)."""
    return loop.outputs([part.record.q for part in loop.parts], observation) if output == "position" else observation.Y


def _simulated(loop: ClosedLoop, observation: Observation, X: Array, output: str) -> Array:
    """y_s of the parameters X of the columns, shape (r,)."""
    runs = loop.run(full(observation.names, X, loop.model.BASE_PARAMETERS))
    return loop.outputs([run.q for run in runs] if output == "position" else loop.torques(runs), observation)


def _slope(loop: ClosedLoop, observation: Observation, X: Array, output: str) -> Array:
    """J = dy_s/dX, shape (r, c)."""
    every = loop.model.BASE_PARAMETERS
    numbers = [every.index(name) for name in observation.names]
    tangents = [tangent for _, tangent in loop.sensitivity(full(observation.names, X, every))]
    signals = [np.asarray(getattr(tangent, "q" if output == "position" else "tau")) for tangent in tangents]
    return loop.outputs([x[:, :, numbers] for x in signals], observation)


def _searched(
    loop: ClosedLoop,
    observation: Observation,
    X: Array,
    y: Array,
    D: Array,
    weights: Array,
    options: CloeOptions,
    trail: list[dict[str, Any]],
) -> tuple[Array, bool]:
    """X at a minimum of the weighted criterion near X, and whether the search has converged; parameters without a loop are no point of it."""

    def residual(X: Array) -> Array:
        at(f"simulation {len(trail) + 1}" + (f", criterion {trail[-1]['criterion']:.4g}" if trail else ""))
        try:
            e: Array = weights * (_simulated(loop, observation, X, options.output) - y)
        except InputError:  # no loop with these parameters: least_squares shortens its step
            e = np.full(len(y), np.nan)
        trail.append({"X": X.tolist(), "criterion": float(e @ e)})
        return e

    found = least_squares(
        residual,
        X,
        jac=lambda X: weights[:, None] * _slope(loop, observation, X, options.output),
        x_scale=D,
        ftol=options.decrease,
        xtol=options.step,
        gtol=None,
        max_nfev=options.passes,
    )
    return np.asarray(found.x), bool(found.success)


def _deviations(e: Array, observation: Observation) -> Array:
    """Root mean square of the residual of each joint, shape (n,), never zero."""
    s = np.array([np.sqrt(np.mean(e[observation.joint(j)] ** 2)) if observation.rows[j] else 0.0 for j in range(observation.n)])
    return np.asarray(np.maximum(s, 1e-9 * max(float(s.max()), 1e-12)))


def _relative(e: Array, y: Array, observation: Observation) -> list[float]:
    """100 ||y - y_s||/||y|| by joint."""
    return [
        100 * float(np.linalg.norm(e[observation.joint(j)]) / np.linalg.norm(y[observation.joint(j)]))
        for j in range(observation.n)
        if observation.rows[j]
    ]
