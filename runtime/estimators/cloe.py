"""CLOE and CLIE: output error of the closed loop, in position or in torque.

    X = argmin sum_j ||y_j - y_s,j(X)||^2 / s_j^2,    y decimated position (CLOE) or torque (CLIE), y_s that of the simulation with X

Gauss-Newton with Levenberg's damping on D^-1 X, D = max(|X^0|, sigma of least squares); J = dy_s/dX from the tangent system of the loop, g = 1.
s_j is the deviation of the residual: found at the start, found again at the first minimum, from where the search goes on once more.
C = s^2 (J'VJ)^-1. A loop that holds its position well makes J small: slow, dependent on its start, and the first to fail where the simulation
does not know what the encoder did to the loop.

Reference: Landau, Anderson and De Bruyne (2001) for output error in closed loop; Jubien, Gautier and Janot (2014) against DIDIM.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from runtime.errors import InputError
from runtime.estimators import iv, ols
from runtime.estimators.block_covariance import block_covariance
from runtime.estimators.closed_loop import ClosedLoop, loop_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.fixed_point import Array, full, initial
from runtime.estimators.linear import assemble, columns_asked, outcome, standard_deviations
from runtime.model.generated import GeneratedModel
from runtime.observation.system import Observation, split_rows
from runtime.settings.schema import Count, Positive, Real, Settings, structure
from runtime.settings.study import EstimateSettings

DAMPING = 1e-3  # of the diagonal of the scaled J'J, at the start
RISE, FALL = 5.0, 0.3


class CloeOptions(Settings):
    """estimate.options of method cloe.

    Attributes
    ----------
    output : str
        position, or torque (CLIE).
    start : str
        First parameters: iv, ols, or values of the robot file.
    passes : int
        Largest number of passes of each of two searches.
    step : float
        Largest |dX/D| at which a search ends.
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


@dataclass(frozen=True, eq=False)
class Point:
    """X of the columns with the residual e (r,), and J (r, c) where it was asked for."""

    X: Array
    e: Array
    J: Array | None = None

    def criterion(self, weights: Array) -> float:
        """||V^1/2 e||^2."""
        return float(np.sum((weights * self.e) ** 2))


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
    point = _at(loop, observation, X, y, options.output)
    converged = True
    for _ in range(2):
        weights = 1 / np.repeat(_deviations(point.e, observation), observation.rows)
        point, converged = _searched(loop, observation, point, y, D, weights, options, trail)
    point = _at(loop, observation, point.X, y, options.output, slope=True)
    assert point.J is not None
    weights = 1 / np.repeat(_deviations(point.e, observation), observation.rows)
    T = np.linalg.inv(np.linalg.qr(point.J * weights[:, None] * D, mode="r")) * D[:, None]
    r, c = point.J.shape
    C = T @ T.T * point.criterion(weights) / max(r - c, 1)
    C_b = block_covariance(split_rows(np.column_stack([point.J, point.e]) * weights[:, None], observation.blocks()), np.zeros(c), T)
    estimate = assemble(
        replace(base, settings=settings, iterations=len(trail)), replace(first, X=point.X), model=model, provenance=provenance
    )
    status, message = outcome(base, first)
    parts = [message, loop.assumption]
    if not converged:
        status = "not-converged" if status == "ok" else status
        parts.append(
            f"The search has not converged after {len(trail)} steps. Output error depends on its start: start from iv, raise passes, or take didim."
        )
    return replace(
        estimate,
        covariance=C,
        sigma=np.sqrt(np.diag(C)),
        sigma_corrected=np.sqrt(np.diag(C_b)),
        status=status,
        message=" ".join(part for part in parts if part),
        details={"output": options.output, "output_error": _relative(point.e, y, observation), "trail": trail},
    )


def _start(loop: ClosedLoop, observation: Observation, options: CloeOptions) -> Array:
    if options.start != "iv":
        return initial(loop, observation, options.start)
    return iv.iv(observation, EstimateSettings(method="iv"), model=loop.model).X


def _measured(loop: ClosedLoop, observation: Observation, output: str) -> Array:
    """y, shape (r,)."""
    return loop.outputs([part.record.q for part in loop.parts], observation) if output == "position" else observation.Y


def _at(loop: ClosedLoop, observation: Observation, X: Array, y: Array, output: str, *, slope: bool = False) -> Point:
    """The residual at X, and its slope."""
    every = full(observation.names, X, loop.model.BASE_PARAMETERS)
    label = "q" if output == "position" else "tau"
    if not slope:
        return Point(X, y - loop.outputs([getattr(run, label) for run in loop.run(every)], observation))
    runs = loop.sensitivity(every)
    numbers = [loop.model.BASE_PARAMETERS.index(name) for name in observation.names]
    e = y - loop.outputs([getattr(run, label) for run, _ in runs], observation)
    return Point(X, e, loop.outputs([getattr(tangent, label)[:, :, numbers] for _, tangent in runs], observation))


def _searched(
    loop: ClosedLoop,
    observation: Observation,
    point: Point,
    y: Array,
    D: Array,
    weights: Array,
    options: CloeOptions,
    trail: list[dict[str, Any]],
) -> tuple[Point, bool]:
    """Levenberg's steps down to a minimum of the weighted criterion."""
    damping = DAMPING
    for _ in range(options.passes):
        if point.J is None:
            point = _at(loop, observation, point.X, y, options.output, slope=True)
        assert point.J is not None
        A = point.J * weights[:, None] * D
        before = point.criterion(weights)
        size = np.sqrt(np.mean(np.sum(A**2, axis=0)))
        damped = np.vstack([A, np.sqrt(damping) * size * np.eye(A.shape[1])])
        d = np.linalg.lstsq(damped, np.concatenate([point.e * weights, np.zeros(A.shape[1])]), rcond=None)[0]
        try:
            tried = _at(loop, observation, point.X + D * d, y, options.output)
            after = tried.criterion(weights)
        except InputError:  # no loop with these parameters: a smaller step
            after = np.inf
        trail.append({"X": (point.X + D * d).tolist(), "criterion": after, "damping": damping})
        if after < before:
            point, damping = tried, damping * FALL
            if before - after <= options.decrease * before:
                return point, True
        else:
            damping *= RISE
        if float(np.max(np.abs(d))) < options.step:
            return point, True
    return point, False


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
