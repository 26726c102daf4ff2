"""Method IDIM-IV: instrumental variables from the simulated closed loop.

    X^(k+1) = (Z'VW)^-1 Z'VY,   Z^k = F_p[W(q_s, qd_s, qdd_s)] with the filters of the record on
                                q_s,   V = diag(1/s_j^2), s_j of Y - W X^k
    C = A Z'VZ A', A = (Z'VW)^-1

W is computed from the measured positions, whose noise makes least squares biased. Z is free of this
noise, so that Z'V rho has mean zero. A bias that W and Z share, such as the effect of the filters
on sign(qd), remains. The system is solved with the columns of W and Z scaled alike.

`details` : trail; smallest correlation between the spaces of Z and W (1: the instruments explain
  W); condition of Z'VW with unit columns; the Hausman test on d = X_IV - X_WLS. The covariance C_d
  of d comes from blocks of residuals, as for sigma_corrected. The test gives the largest
  |d_i|/sigma_di with its name and, if there are enough blocks, d'C_d^-1 d, whose distribution is
  about chi2(b) if least squares is unbiased.

References: Janot, Vandanjon and Gautier (2014); Hausman (1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.stats import chi2

from runtime.core.least_squares.block_covariance import deletions
from runtime.core.least_squares.method import Beginning, Fitted
from runtime.core.least_squares.wls import common_scales, floored
from runtime.core.rows.factor import Array
from runtime.core.rows.observation import Observation, split_rows
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.loop.closed_loop import loop_of
from runtime.loop.fixed_point import Step, iterate, outcome_of
from runtime.loop.result import Simulation
from runtime.loop.simulated_motion import simulating_method

LIMIT = limits(__package__)
ROUNDING = (
    "The instruments of {method} do not depend on the rounding of recorded positions; place: loop "
    "studies an encoder in the loop."
)


def fit(start: Beginning) -> Fitted:
    """Estimate the parameters by method IDIM-IV, with W computed from the measured positions.

    Raise SettingsError if no loop is attached to the observation.
    """
    loop, observation = loop_of(start.observation, start.settings.method), start.observation
    raw = start.system.raw

    def update(runs: Sequence[Simulation], X: Array) -> Step:
        s = floored(raw, common_scales(raw, X, len(X)))
        rows = np.repeat(1 / s, observation.rows)
        Z = loop.simulated(runs, observation, exact=False).W * rows[:, None]
        W = observation.W * rows[:, None]
        X, C, A = _solve(W, Z, observation.Y * rows)
        rest = observation.Y - observation.W @ X
        norm = float(np.linalg.norm(rest / np.repeat(s, observation.rows)))
        return Step(X, C, norm, (W, Z, s, A))

    fixed = iterate(loop, start, update)
    status, message, details = outcome_of(loop, fixed, start.settings.method)
    X, (W, Z, s, A) = fixed.step.X, fixed.step.result
    quality = _quality(W, Z)
    if quality["cond"] > LIMIT.WEAK_CONDITION or quality["correlation"] < LIMIT.WEAK_CORRELATION:
        status = "weak-instruments" if status == "ok" else status
        weak = (
            "The instruments Z (regressor of the simulated motion) do not explain the regressor W "
            f"of the record: condition {quality['cond']:.2g} of Z'VW, smallest correlation "
            f"{quality['correlation']:.2g}. Likely causes: another time base, reference or "
            "controller than those of the record; slow rows; parameters without excitation."
        )
        message = f"{weak} {message}".strip()
    system = replace(
        start.system,
        weighted=raw.weighted(1 / s),
        scales=tuple(s.tolist()),
        known_variance=True,
        iterations=len(fixed.trail),
    )
    least = system.solve()
    residual = (observation.Y - observation.W @ X) * np.repeat(1 / s, observation.rows)
    U = _by_block(observation, Z, residual, A)
    U_least = _by_block(observation, W, residual, least.T @ least.T.T)
    test = hausman(observation.names, X - least.X, U - U_least)
    return Fitted(
        system,
        replace(least, X=X),
        fixed.step.covariance,
        lambda: np.asarray(np.linalg.norm(U, axis=0)),
        status,
        message,
        {**details, **quality, "hausman": test},
    )


def hausman(names: Sequence[str], d: Array, U: Array) -> dict[str, Any]:
    """Test whether the difference d of two estimates is larger than its covariance U'U allows.

    d has shape (b,); U has shape (K, b), one row per block of samples. Returns the largest d_i
    relative to its standard deviation, with its parameter and, if there are enough blocks, the
    chi-square statistic with its probability.
    """
    sigma = np.linalg.norm(U, axis=0)
    z = np.abs(d) / np.where(sigma > 0, sigma, np.inf)
    worst = int(np.argmax(z))
    statistics: dict[str, Any] = {"largest": float(z[worst]), "parameter": names[worst]}
    if len(U) >= 2 * len(d) and np.all(sigma > 0):
        statistic = float(np.sum(np.linalg.lstsq((U / sigma).T, d / sigma, rcond=None)[0] ** 2))
        statistics |= {"statistic": statistic, "probability": float(chi2.sf(statistic, len(d)))}
    return statistics


def _solve(W: Array, Z: Array, Y: Array) -> tuple[Array, Array, Array]:
    """Solve Z'W X = Z'Y with instruments Z; return X, its covariance C, and A = (Z'W)^-1.

    W, Z and Y are already weighted.
    """
    size = np.linalg.norm(W, axis=0)
    W, Z = W / size, Z / size
    try:
        A = np.linalg.inv(Z.T @ W)
    except LinAlgError:
        raise InputError(
            "the simulated motion excites fewer parameters than the measured motion, so method iv "
            "has no solution; check the settings of the controller and its reference (Z'VW is "
            "singular, with the regressors Z of the simulation and W of the record, and weights V)"
        ) from None
    X = A @ (Z.T @ Y)
    X += A @ (Z.T @ (Y - W @ X))
    C = A @ (Z.T @ Z) @ A.T
    return X / size, C / np.outer(size, size), A / np.outer(size, size)


def _quality(W: Array, Z: Array) -> dict[str, float]:
    """Compute how well the instruments Z explain the observation matrix W, both weighted.

    Returns the condition number of Z'VW with unit columns, the smallest correlation between the two
    column spaces, and the smallest correlation between a column of W and its own instrument.
    """
    unit_W = W / np.linalg.norm(W, axis=0)
    unit_Z = Z / np.maximum(np.linalg.norm(Z, axis=0), 1e-300)
    spaces = np.linalg.svd(np.linalg.qr(Z)[0].T @ np.linalg.qr(W)[0], compute_uv=False)
    return {
        "cond": float(np.linalg.cond(unit_Z.T @ unit_W)),
        "correlation": float(spaces[-1]),
        "column_correlation": float(np.abs(np.einsum("ik,ik->k", unit_W, unit_Z)).min()),
    }


def _by_block(observation: Observation, Z: Array, residual: Array, A: Array) -> Array:
    """Compute how the estimate X changes if one of K blocks of rows is left out: shape (K, b).

    X = A Z'Y. The changes are multiplied by sqrt((K - 1)/K)
    (`runtime.core.least_squares.block_covariance`); they are nan if there is only one block.

    Z, residual : weighted rows of the instruments, shape (r, b), and Y - W X, shape (r,).
    """
    R = np.asarray(np.linalg.qr(Z, mode="r"))
    U = deletions(
        split_rows(np.column_stack([Z, residual]), observation.blocks()),
        np.zeros(Z.shape[1]),
        np.linalg.inv(R),
        A @ R.T,
    )
    return U if len(U) > 1 else np.full_like(U, np.nan)


METHOD = simulating_method(fit, ROUNDING)
"""The method `iv`."""
