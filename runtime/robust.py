"""Robust least squares by iterated weights: rows with a large residual get a small weight.

    u_i = e_i / (S_j sqrt(1 - h_i))          S_j = median |e - median e| / 0.6745 over the rows of
                                             joint j, h_i leverage
    X   = argmin sum_i w(u_i) e_i^2 / S_j^2, repeated with new S_j and w until max |dX_i| / sigma_i
        < 1e-3

    huber  w = min(1, k/|u|), k = 1.345             started from least squares weighted by joint
    tukey  w = (1 - (u/c)^2)^2, 0 from |u| = c on, c = 4.685
            started from Huber's result: this criterion has local minima

    C = (sum_j W_j'W_j / S_j^2)^-1  mean(psi^2) / mean(psi')^2  r / (r - b),    psi = w u

Both constants give 95 % efficiency under normal noise. If more than 5 % of the rows of a joint have
w < 0.5, these rows are not outliers: the model is wrong there. options: loss, tuning (k or c),
passes, block, rank_tolerance.

References: Huber and Ronchetti, Robust Statistics (2009), chapter 7; Maronna, Martin and Yohai,
Robust Statistics (2006), chapters 4 and 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from runtime.core.least_squares import wls
from runtime.core.least_squares.block_covariance import corrected_deviations
from runtime.core.least_squares.linear import LinearOptions, labels_of
from runtime.core.least_squares.method import Beginning, Fitted, Method
from runtime.core.least_squares.solution import solve
from runtime.core.rows.factor import Array, Factor, factor
from runtime.core.rows.observation import Observation, split_rows
from runtime.ground.settings import Positive

DOWN_WEIGHTED = 0.5
"""Weight below which a row is reported as down-weighted."""
IRLS_CONVERGED = 0.001
"""Largest change of a parameter over its sigma at which the weights have converged, deviations."""
NORMAL_MEDIAN = 0.6745
"""Median of |z|, z standard normal."""
SUSPECT_SHARE = 0.05
"""Share of down-weighted rows of a joint above which the model is suspected."""

TUNING = {"huber": 1.345, "tukey": 4.685}


class IrlsOptions(LinearOptions):
    """Options of the method irls, robust least squares (estimate.options of a study).

    Attributes
    ----------
    loss : str
        huber or tukey.
    tuning : float or None
        Constant k of huber or c of tukey; default: 1.345 or 4.685.
    """

    loss: Literal["huber", "tukey"] = "huber"
    tuning: Positive | None = None


@dataclass(frozen=True, eq=False)
class Robust:
    """State of robust least squares after one pass: X, residuals, weights and scales of the joints.

    X are the parameters, shape (b,), u the scaled residuals and w the weights, shape (r,), and S
    the scales of the joints, shape (n,). T fulfils T T' = (sum_j W_j'W_j / S_j^2)^-1.
    """

    X: Array
    u: Array
    w: Array
    S: Array
    T: Array
    passes: int
    converged: bool


def fit(start: Beginning) -> Fitted:
    """Fit the parameters X by robust least squares with Huber's or Tukey's loss function.

    `details` of the result has the scales S_j, and the share of down-weighted rows of each joint.
    """
    W, options = start.observation.W, start.options
    found = _iterated(start, W, start.solution.X, "huber")
    if options.loss == "tukey":
        again = _iterated(start, W, found.X, "tukey")
        found = replace(again, passes=found.passes + again.passes)
    return _fit_of_last_pass(start, W, found)


def weight(u: Array, loss: str, tuning: float) -> Array:
    """Compute the weights w(u), 0 to 1, of rows; u is the residual over its standard deviation."""
    if loss == "huber":
        return np.asarray(np.minimum(1.0, tuning / np.maximum(np.abs(u), np.finfo(float).tiny)))
    return np.where(np.abs(u) < tuning, (1 - (u / tuning) ** 2) ** 2, 0.0)


def slope(u: Array, loss: str, tuning: float) -> Array:
    """Compute the derivative psi'(u) of psi(u) = w(u) u at scaled residuals u."""
    inside = np.abs(u) < tuning
    v = (u / tuning) ** 2
    return np.where(inside, 1.0 if loss == "huber" else (1 - v) * (1 - 5 * v), 0.0)


def _iterated(start: Beginning, W: Array, X: Array, loss: str) -> Robust:
    """Compute weights and parameters in turn, starting from X, until the parameters converge."""
    observation, raw, options = start.observation, start.system.raw, start.options
    tuning = _tuning(options, loss)
    for done in range(1, options.passes + 1):
        e = observation.Y - W @ X
        S = _scales(observation, raw, e)
        rows = np.repeat(1 / S, observation.rows)
        T = solve(raw.weighted(1 / S), options.rank_tolerance).T
        h = np.einsum("ik,ik->i", W @ T, W @ T) * rows**2
        u = e * rows / np.sqrt(np.clip(1 - h, np.finfo(float).eps, None))
        w = weight(u, loss, tuning)
        root = np.sqrt(w) * rows
        new = solve(_weighted(observation, W, raw, root), options.rank_tolerance).X
        change = float(np.max(np.abs(new - X) / np.linalg.norm(T, axis=1)))
        still = np.allclose(new, X, rtol=1e-12, atol=0)  # exact data, whose sigma is rounding
        X = new
        if change < IRLS_CONVERGED or still:
            return Robust(X, u, w, S, T, done, True)
    return Robust(X, u, w, S, T, options.passes, False)


def _weighted(observation: Observation, W: Array, raw: Factor, root: Array) -> Factor:
    """Compute the triangular factor of [W Y] with each row i of W and Y multiplied by root[i]."""
    return factor(W * root[:, None], observation.Y * root, observation.rows, raw.names)


def _scales(observation: Observation, raw: Factor, e: Array) -> Array:
    """Compute a robust standard deviation of each joint's residuals from medians, shape (n,)."""
    by_joint = [e[observation.joint(j)] for j in range(observation.n)]
    S = np.array(
        [np.median(np.abs(x - np.median(x))) / NORMAL_MEDIAN if len(x) else 0.0 for x in by_joint]
    )
    return wls.floored(raw, S)


def _fit_of_last_pass(start: Beginning, W: Array, fit: Robust) -> Fitted:
    """Build the result of the last pass: weighted rows, X and its covariance for this method."""
    observation, options = start.observation, start.options
    r, b = W.shape
    loss, tuning = options.loss, _tuning(options, options.loss)
    rows = np.repeat(1 / fit.S, observation.rows)
    system = replace(
        start.system,
        weighted=_weighted(observation, W, start.system.raw, np.sqrt(fit.w) * rows),
        scales=tuple(fit.S.tolist()),
        iterations=fit.passes,
    )
    if not fit.converged:
        message = (
            f"The weights have not converged after {options.passes} passes. Raise "
            "estimate.options.passes, or use loss: huber."
        )
        system = replace(system, status="not-converged", message=message)
    psi, inside = fit.w * fit.u, slope(fit.u, loss, tuning)
    C = fit.T @ fit.T.T * np.mean(psi**2) / np.mean(inside) ** 2 * r / max(r - b, 1)
    # to first order about the fit, rows W/S sqrt(mean psi') and residuals psi/sqrt(mean psi')
    bend = np.sqrt(np.mean(inside))
    A = np.column_stack(
        [W * rows[:, None] * bend, (observation.Y - W @ fit.X) * rows * fit.w / bend]
    )

    def corrected() -> Array:
        blocks = split_rows(A, observation.blocks(options.block))
        bands = (split_rows(A, groups) for groups in observation.bands(W @ fit.X))
        return corrected_deviations(blocks, bands, np.zeros(b), fit.T / bend)

    shares = {
        label: float(np.mean(fit.w[observation.joint(j)] < DOWN_WEIGHTED))
        for j, label in enumerate(labels_of(start.model, observation.n))
        if observation.rows[j]
    }
    return Fitted(
        system,
        replace(system.solve(), X=fit.X),
        C,
        corrected,
        message=_note_of_shares(shares),
        details={"loss": loss, "tuning": tuning, "scales": fit.S, "down_weighted": shares},
    )


def _note_of_shares(shares: Mapping[str, float]) -> str:
    """Write a note on the share of rows of each joint that have a small weight."""
    text = (
        f"Share of rows with a weight below {DOWN_WEIGHTED:g}: "
        + ", ".join(f"joint {joint} {100 * share:.1f} %" for joint, share in shares.items())
        + "."
    )
    suspect = [joint for joint, share in shares.items() if share > SUSPECT_SHARE]
    if suspect:
        text += (
            f" Above {100 * SUSPECT_SHARE:g} % (joint {', '.join(suspect)}) it is the model "
            "that does not fit, not a few outliers."
        )
    return text


def _tuning(options: IrlsOptions, loss: str) -> float:
    """Return the tuning constant of the loss function `loss`: k of Huber, or c of Tukey.

    The option `tuning` is for the chosen loss only: a Huber fit that starts a Tukey fit uses k =
    1.345.
    """
    return options.tuning if options.tuning is not None and loss == options.loss else TUNING[loss]


METHOD = Method(IrlsOptions, wls.weighted, fit, weights=("none",))
"""The method `irls`."""
