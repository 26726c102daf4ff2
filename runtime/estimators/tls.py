"""Total least squares that leaves exact columns exact: errors in Y and in the columns that the
position enters.

    (W_2 + dW_2) X_2 + W_1 X_1 = Y + dY,  the smallest [dW_2 dY] in units of their own deviations,
    W_1 exact (offsets, signs of speeds)

    1. rows of joint j times 1/t_j, t_j the torque noise; columns of W_2 times L^-T, L L' the mean
    covariance of the errors of a row
    2. [W_1 W_2 L^-T Y] = Q [[R_11, R_12], [0, R_22]]
            the rows project on what W_1 leaves: P = [W_2 L^-T Y] - Q_1 Q_1' [...]
    3. R_22 = U S V', v the last column of V:  X_2 = -L^-T v_2 / v_Y,  X_1 = R_11^-1 (rest of Y -
    W_2 X_2)

The covariance C_W of the errors of the columns comes from the filters and the sensitivities of the
regressor (`runtime.rows.position_errors`). Errors of
different rows are taken alike, which they are not where a column is a product such as cos(q) qdd:
the method stays approximate there. Without any
noisy column it is least squares, weighted as `weights` says.

With s_min the smallest singular value of R_22 and s_W that of its columns of W_2: no solution where
s_min > 0.9 s_W (the errors assumed hide the
parameters); doubtful where |v_Y| < 0.1 with v of norm 1.

options: position_error, deviation of one raw position on the side cestac.side, rad or m;
torque_error t_j, one or one per joint, N m, default from
the residuals, t_j^2 = mean e_j^2 - X' C_j X; bootstrap (resampled blocks of time behind sigma; 0:
that of least squares), seed, block, rank_tolerance.

References: Golub and Van Loan (1980); Van Huffel and Vandewalle (1991), chapters 3 (mixed LS-TLS)
and 10 (known error covariance).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from runtime.errors import SettingsError
from runtime.estimators.block_covariance import drawn_again, gram_root
from runtime.estimators.linear import LinearOptions
from runtime.estimators.method import OPTIONS, Beginning, Fitted
from runtime.limits import LIMIT
from runtime.rows.factor import Array, triangularise
from runtime.rows.observation import Observation, split_rows
from runtime.settings.schema import NotNegative, PerJoint, Positive, Resamples, Seed, require


class TlsOptions(LinearOptions):
    """estimate.options of method tls.

    Attributes
    ----------
    position_error : float, rad or m
        Deviation of one raw position on the side cestac.side.
    torque_error : float or tuple of float or None, N m or N
        Deviation t_j of the torque of each joint; default: from the residuals.
    bootstrap : int
        Resampled records behind `sigma`; 0: that of least squares.
    seed : int
        Seed of the bootstrap.
    """

    position_error: NotNegative | None = None
    torque_error: PerJoint[Positive] | None = None
    bootstrap: Resamples = 100
    seed: Seed = 1

    def __post_init__(self) -> None:
        message = (
            "missing; tls needs the deviation of one raw position, rad or m on the side "
            "cestac.side (a step Delta rounded to the nearest: Delta/sqrt(12))"
        )
        require(self.position_error is not None, message, "position_error")


@dataclass(frozen=True, eq=False)
class Split:
    """Columns by their errors: numbers of the exact and of the noisy ones; C, shape (n, b, b),
    covariance of the errors of one row of joint j.
    """

    exact: Array
    noisy: Array
    C: Array


@dataclass(frozen=True, eq=False)
class Solved:
    """X, shape (b,), s_min, s_W and |v_Y| of one problem."""

    X: Array
    smallest: float
    without: float
    v: float


def fit(start: Beginning) -> Fitted:
    """The fit by total least squares; `details` holds the exact and the noisy columns, t_j, s_min
    and |v_Y|.
    """
    observation, options, free = start.observation, start.options, start.solution
    split, scales = split_columns(observation, options), np.array(start.system.scales)
    if not len(split.noisy):
        details = _details(observation, split, scales, None)
        return Fitted(start.system, free, details=details)
    t = torque_errors(start, split, adjusted(observation, split, scales))
    solved = total(factored(observation, split, t), split, error_root(observation, split, t))
    if solved.smallest > LIMIT.TLS_HIDDEN * solved.without:
        message = (
            "The errors assumed for the positions explain the columns as well as the motion does: "
            f"s_min {solved.smallest:.3g} against {solved.without:.3g} without Y. Total least "
            "squares has no usable solution; the values are those of least squares. Check "
            "estimate.options.position_error, or use a richer motion or fewer columns."
        )
        return Fitted(replace(start.system, status="ill-posed", message=message), free)
    e = observation.Y - observation.W @ solved.X
    residual = float(np.linalg.norm(e / np.repeat(scales, observation.rows)))
    message = (
        f"|v_Y| = {solved.v:.2g}: the solution leans on the direction in which W is weakest; "
        "compare it with wls."
    )
    C = bootstrap_covariance(observation, split, t, options) if options.bootstrap else None
    return Fitted(
        start.system,
        replace(free, X=solved.X, residual_norm=residual),
        C,
        None if C is None else np.sqrt(np.diag(C)),
        message=message if solved.v < LIMIT.TLS_DOUBTFUL else "",
        details=_details(observation, split, t, solved),
    )


def split_columns(observation: Observation, options: TlsOptions) -> Split:
    """Exact and noisy columns, from observation.errors; all exact where the positions are."""
    b = len(observation.names)
    if options.position_error == 0:
        return Split(np.arange(b), np.arange(0), np.zeros((observation.n, b, b)))
    if observation.errors is None:
        raise SettingsError(
            (
                "this observation does not know the errors of its columns; make it with "
                "runtime.rows.position_errors.with_errors"
            ),
            path=("estimate", "method"),
        )
    error = np.sqrt(
        np.einsum("j,jaa->a", np.asarray(observation.rows, dtype=float), observation.errors)
    )
    noisy = error > LIMIT.TLS_NOISY * np.linalg.norm(observation.W, axis=0)
    return Split(np.flatnonzero(~noisy), np.flatnonzero(noisy), observation.errors)


def torque_errors(start: Beginning, split: Split, X: Array) -> Array:
    """t_j, shape (n,): as given, or t_j^2 = mean e_j^2 - X'C_j X at the solution; one for all
    joints without weights.
    """
    observation, given = start.observation, start.options.torque_error
    if given is not None:
        message = f"{np.size(given)} values; expected one or {observation.n}, one per joint"
        require(np.size(given) in (1, observation.n), message, *OPTIONS, "torque_error")
        return np.array(np.broadcast_to(np.asarray(given, dtype=float), (observation.n,)))
    share = max(1 - len(X) / sum(observation.rows), 1 / sum(observation.rows))
    t = np.ones(observation.n)
    for _ in range(LIMIT.TLS_PASSES):
        squares = np.array(
            [
                np.sum((observation.Y - observation.W @ X)[observation.joint(j)] ** 2)
                for j in range(observation.n)
            ]
        )
        own = np.array([X @ split.C[j] @ X for j in range(observation.n)])
        N = np.asarray(observation.rows, dtype=float)
        if start.settings.weights == "none":
            squares, own, N = (
                np.full(observation.n, value)
                for value in (squares.sum(), N @ own / N.sum(), N.sum())
            )
        variance = squares / np.maximum(N * share, 1)
        t = np.sqrt(np.maximum(variance - own, LIMIT.TLS_LEAST_NOISE**2 * variance))
        t = np.where(t > 0, t, 1.0)
        solved = total(factored(observation, split, t), split, error_root(observation, split, t))
        if solved.smallest > LIMIT.TLS_HIDDEN * solved.without:
            break
        X = solved.X
    return t


def adjusted(observation: Observation, split: Split, scales: Array) -> Array:
    """X = (sum_j (W_j'W_j - N_j C_j) / s_j^2)^-1 sum_j W_j'Y_j / s_j^2, shape (b,): the errors of
    the columns taken off, no torque noise needed.
    """
    row = np.repeat(scales, observation.rows)
    A = (
        np.einsum("j,jab->ab", -np.asarray(observation.rows, dtype=float) / scales**2, split.C)
        + (W := observation.W / row[:, None]).T @ W
    )
    return np.asarray(np.linalg.lstsq(A, W.T @ (observation.Y / row), rcond=None)[0])


def error_root(observation: Observation, split: Split, t: Array) -> Array:
    """L of the noisy columns, shape (b_2, b_2): L L' the mean covariance of the errors of a row
    after the rows of joint j were divided by t_j.
    """
    share = np.asarray(observation.rows, dtype=float) / sum(observation.rows) / t**2
    C = np.einsum("j,jab->ab", share, split.C)[np.ix_(split.noisy, split.noisy)]
    deviation = np.sqrt(np.diag(C))
    values, vectors = np.linalg.eigh(C / np.outer(deviation, deviation))
    values = np.maximum(values, LIMIT.TLS_NOISY * values[-1])
    return triangularise((deviation[:, None] * vectors * np.sqrt(values)).T).T


def factored(observation: Observation, split: Split, t: Array) -> Array:
    """Triangular factor of the rows [W_1 W_2 Y] over t_j, shape (b + 1, b + 1)."""
    return triangularise(_rows(observation, split, t))


def total(R: Array, split: Split, L: Array) -> Solved:
    """Mixed least squares and total least squares from the factor of [W_1 W_2 Y]."""
    b1, b2 = len(split.exact), len(split.noisy)
    into = np.eye(b2 + 1)
    into[:b2, :b2] = np.linalg.inv(L).T
    R22 = R[b1:, b1:] @ into
    s, Vt = np.linalg.svd(R22)[1:]
    v = Vt[-1]
    X = np.zeros(b1 + b2)
    if v[-1] != 0:
        X[split.noisy] = into[:b2, :b2] @ (-v[:b2] / v[-1])
        X[split.exact] = (
            solve_triangular(R[:b1, :b1], R[:b1, -1] - R[:b1, b1:-1] @ X[split.noisy])
            if b1
            else 0.0
        )
    return Solved(
        X, float(s[-1]), float(np.linalg.svd(R22[:, :b2], compute_uv=False)[-1]), float(abs(v[-1]))
    )


def bootstrap_covariance(
    observation: Observation, split: Split, t: Array, options: TlsOptions
) -> Array:
    """Covariance of X over records of resampled blocks of time, shape (b, b)."""
    blocks, L = (
        split_rows(_rows(observation, split, t), observation.blocks(options.block)),
        error_root(observation, split, t),
    )
    X = drawn_again(
        blocks, lambda gram: total(gram_root(gram), split, L).X, options.bootstrap, options.seed
    )
    return np.atleast_2d(np.cov(X, rowvar=False))


def _rows(observation: Observation, split: Split, t: Array) -> Array:
    order = [*split.exact, *split.noisy]
    return np.asarray(
        np.column_stack([observation.W[:, order], observation.Y])
        / np.repeat(t, observation.rows)[:, None]
    )


def _details(
    observation: Observation, split: Split, t: Array, solved: Solved | None
) -> dict[str, Any]:
    return {
        "exact": [observation.names[i] for i in split.exact],
        "noisy": [observation.names[i] for i in split.noisy],
        "torque_error": t,
        "s_min": None if solved is None else solved.smallest,
        "s_min_without_Y": None if solved is None else solved.without,
        "v_Y": None if solved is None else solved.v,
    }
