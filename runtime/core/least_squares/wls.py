"""Least squares with rows of joint j divided by s_j, the standard deviation of its residuals.

    X = argmin sum_j ||Y_j - W_j X||^2 / s_j^2,    C = (sum_j W_j'W_j / s_j^2)^-1

s_j is a standard deviation in N m. The setting `weights` chooses how it is computed:

    joint       (default) s_j^2 = ||Y_j - W_j X_j||^2 / (N_j - b_j), X_j the least squares of joint
                j alone, b_j = rank W_j. Exactly invariant under scaling of Y and W of one joint.
    iterated    s_j^2 = ||Y_j - W_j X||^2 / (N_j (1 - b/r)) from the common solution, repeated until
                every s_j changes by less than 1e-3.
    covariance  residuals e of ordinary least squares; Omega_ij = sum e_i e_j/(N_ij - b/n) over the
                N_ij instants with rows of both joints; the rows of one instant are multiplied by
                L^-1, L L' = Omega of the joints that have a row at that instant.

The chapter leaves weights open; Gautier (1997) and BIRDy use the first and the last.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from runtime.core.least_squares.estimate import Status
from runtime.core.least_squares.linear import LinearOptions, System, ordinary
from runtime.core.least_squares.solution import joint_scatter, solve
from runtime.core.rows.factor import Factor, factor
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings, Weights
from runtime.ground.limits import LIMIT


def weighted(
    observation: Observation, settings: EstimateSettings, options: LinearOptions
) -> System:
    """Weight the rows for the method wls, in which `weights: none` means one weight for each joint.

    The name of the method, wls, promises weights. s_j is computed from joint j alone, or from the
    common least squares if joint j has too few rows. The weight s_j is never zero.
    """
    system = ordinary(observation, settings, options)
    raw, fit = system.raw, system.solve()
    own = joint_scatter(raw, options.rank_tolerance)  # nan where a joint has too few rows
    scales = floored(raw, np.where(np.isnan(own), common_scales(raw, fit.X, fit.rank), own))
    start = replace(
        system, weighted=raw.weighted(1 / scales), scales=tuple(scales), known_variance=True
    )
    if settings.weights == "covariance":
        return _covariance(start)
    return _iterated(start) if settings.weights == "iterated" else start


def by_weights(
    observation: Observation, settings: EstimateSettings, options: LinearOptions
) -> System:
    """Weight the rows as `settings.weights` specifies; "none" leaves them unchanged."""
    rows = ordinary if settings.weights == "none" else weighted
    return rows(observation, settings, options)


def weighted_system(
    observation: Observation,
    weights: Weights = "none",
    columns: tuple[str, ...] | Literal["all"] = "all",
) -> System:
    """Weight the rows of the given columns for least squares, with weights that no setting of the
    user selects.
    """
    settings = EstimateSettings(weights=weights, columns=columns)
    return by_weights(observation, settings, LinearOptions())


def common_scales(raw: Factor, X: np.ndarray, rank: int) -> np.ndarray:
    """Compute the residual standard deviation s_j of each joint for a common X, shape (n,).

    Each joint loses its share b N_j/r of the degrees of freedom.
    """
    share = max(1 - rank / raw.rows, 1 / raw.rows)
    return np.array(
        [joint.residual_norm(X) / np.sqrt(max(joint.rows, 1) * share) for joint in raw.joints]
    )


def floored(raw: Factor, scales: np.ndarray) -> np.ndarray:
    """Raise the residual scale s_j of each joint to at least a small share (EXACT_FIT in
    limits.toml) of the rms of Y_j.

    An exact fit of a joint would otherwise get infinite weight.
    """
    rounding = [
        LIMIT.EXACT_FIT * joint.measured_norm / np.sqrt(max(joint.rows, 1)) for joint in raw.joints
    ]
    least = np.maximum(scales, rounding)
    smallest = least[least > 0].min(initial=np.inf)
    return np.where(least > 0, least, smallest if np.isfinite(smallest) else 1.0)


def _iterated(start: System) -> System:
    raw, tolerance = start.raw, start.options.rank_tolerance
    limit = start.options.passes
    scales, change, done, rank = np.array(start.scales), np.inf, 0, solve(raw, tolerance).rank
    while change >= LIMIT.WLS_CONVERGED and done < limit:
        new = floored(raw, common_scales(raw, solve(raw.weighted(1 / scales), tolerance).X, rank))
        change = float(np.max(np.abs(new / scales - 1)))
        scales, done = new, done + 1
    status: Status = "ok"
    message = ""
    if change >= LIMIT.WLS_CONVERGED:
        status = "not-converged"
        message = (
            f"The weights of the joints still change by {change:.1e} after {limit} passes (limit "
            f"{LIMIT.WLS_CONVERGED}). "
            "Raise estimate.options.passes, or use weights: joint, which needs none."
        )
    return replace(
        start,
        weighted=raw.weighted(1 / scales),
        scales=tuple(scales.tolist()),
        iterations=done,
        status=status,
        message=message,
    )


def _covariance(start: System) -> System:
    """Multiply the rows of each instant by L^-1; L L' is the covariance of the joint residuals.

    The weights of `start` are used if the residuals are linearly dependent.
    """
    observation, raw = start.observation, start.raw
    W = observation.columns(raw.names).W
    fit = solve(raw, start.options.rank_tolerance)
    residual = np.append(observation.Y - W @ fit.X, 0.0)  # -1: no row
    E, present = residual[observation.instants], (observation.instants >= 0).astype(float)
    freedom = present.T @ present - fit.rank / observation.n
    Omega = E.T @ E / np.maximum(freedom, 1)
    A = np.column_stack([W, observation.Y])
    try:
        whole = observation.whitened(A, Omega)
    except np.linalg.LinAlgError:
        message = (
            "The residuals of the joints are linearly dependent (an exact fit, or fewer "
            "instants than joints); weights by joint were used instead."
        )
        return replace(start, status="singular-weights", message=message)
    whole_factor = factor(whole[:, :-1], whole[:, -1], observation.rows, raw.names)
    scales = tuple(np.sqrt(np.where(np.diag(Omega) > 0, np.diag(Omega), 1.0)).tolist())
    return replace(start, weighted=whole_factor, scales=scales, row_covariance=Omega)
