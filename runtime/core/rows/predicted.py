"""Prediction of the standard deviations of the parameters from the observation matrix W alone.

    W_w = diag(1/s_j) W diag(|X_i|)               s_j: standard deviation of the torque of joint j
    C = A W_w'Omega W_w A,  A = (W_w'W_w)^-1      predicted covariance of X_i/|X_i|

Omega is the covariance of decimated white torque noise: neighbouring rows are correlated, which
costs a tenth of the precision or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.rows.observation import Observation
from runtime.core.signals.filters import decimation_factor
from runtime.core.signals.noise_gain import bandwidth
from runtime.core.study import Signals

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of the observation matrix W: rows by 1/s_j of joint j, columns by |X_i|.

    Attributes
    ----------
    names : tuple of str
        Columns, c of them.
    s : ndarray, shape (n,), N m or N
        Standard deviation of each torque.
    size : ndarray, shape (c,), SI
        Size of each parameter.
    """

    names: tuple[str, ...]
    s: Array
    size: Array

    def matrix(self, observation: Observation) -> Array:
        """Compute the weighted observation matrix W_w = diag(1/s_j) W diag(|X_i|), shape (r, c)."""
        return np.asarray(
            observation.columns(self.names).W / self.s[observation.joints][:, None] * self.size
        )

    def condition(self, observation: Observation) -> float:
        """Compute the condition number of W_w; inf if W_w is singular."""
        values = np.linalg.svd(np.linalg.qr(self.matrix(observation), mode="r"), compute_uv=False)
        return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")

    def relative_sigma(
        self, observation: Observation, correlation: Sequence[float] | Array = (1.0,)
    ) -> Array:
        """Predict the relative standard deviation %sigma of each parameter, in %, shape (c,).

        correlation : correlation of the torque noise of a joint between rows that are 0, 1, 2 ...
            sampling periods apart (`kept_correlation`).
        """
        W = self.matrix(observation)
        inverse = np.linalg.inv(np.linalg.qr(W, mode="r"))
        spread = np.zeros((W.shape[1], W.shape[1]))  # W' Omega W
        instant = np.rint((observation.t - observation.t.min()) * observation.rate).astype(int)
        instant += observation.record * (
            int(instant.max(initial=0)) + len(correlation)
        )  # no two records are neighbours
        known = np.append(correlation, 0.0)
        for j in range(observation.n):
            own = observation.joint(j)
            acting = np.flatnonzero(W[own].any(axis=0))
            at, rows = instant[own], W[own][:, acting]
            upper = correlation[0] / 2 * rows  # Omega W_j, of Omega the upper half alone
            for k in range(
                1, len(correlation)
            ):  # rows: as many periods apart, or more where some between are left out
                r = known[np.minimum(at[k:] - at[:-k], len(correlation))]
                upper[:-k] += r[:, None] * rows[k:]
            product = rows.T @ upper
            spread[np.ix_(acting, acting)] += product + product.T
        C = inverse @ inverse.T @ spread @ inverse @ inverse.T
        return np.asarray(100 * np.sqrt(np.diag(C)))


def kept_correlation(signals: Signals, rate: float) -> Array:
    """Compute the correlation of torque noise between decimated samples 0, 1, 2 ... rows apart.

    The noise is white before the decimation, at the sampling rate `rate`, Hz.
    """
    factor = decimation_factor(signals, rate)
    kept = (
        bandwidth(replace(signals, median=1), rate).decimation[::factor]
        if factor > 1
        else np.ones(1)
    )
    return np.asarray(kept[: 1 + np.max(np.flatnonzero(np.abs(kept) > 1e-3 * kept[0]))] / kept[0])
