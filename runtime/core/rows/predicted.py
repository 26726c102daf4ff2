"""Prediction of the standard deviations of the parameters from the observation matrix W alone.

    W_w = diag(1/s_j) W diag(|X_i|)               s_j: standard deviation of the torque of joint j
    C = A W_w'Omega W_w A,  A = (W_w'W_w)^-1      predicted covariance of X_i/|X_i|

Omega is the covariance of decimated white torque noise: neighbouring rows are correlated, which
costs a tenth of the precision or more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.rows.observation import Observation
from runtime.core.rows.streamed import StreamedMatrix
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

    def root(self, observation: Observation) -> Array:
        """Compute a factor R, shape (c, c), with R'R = W_w'W_w."""
        if observation.streamed:
            R = observation.factor.weighted(1 / self.s).select(self.names).R11
            return np.asarray(R * self.size)
        return np.asarray(np.linalg.qr(self.matrix(observation), mode="r"))

    def condition(self, observation: Observation) -> float:
        """Compute the condition number of W_w; inf if W_w is singular."""
        values = np.linalg.svd(self.root(observation), compute_uv=False)
        return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")

    def relative_sigma(
        self, observation: Observation, correlation: Sequence[float] | Array = (1.0,)
    ) -> Array:
        """Predict the relative standard deviation %sigma of each parameter, in %, shape (c,).

        correlation : correlation of the torque noise of a joint between rows that are 0, 1, 2 ...
            sampling periods apart (`kept_correlation`).
        """
        inverse = np.linalg.inv(self.root(observation))
        spread = self._spread(observation, np.asarray(correlation))
        C = inverse @ inverse.T @ spread @ inverse @ inverse.T
        return np.asarray(100 * np.sqrt(np.diag(C)))

    def _spread(self, observation: Observation, correlation: Array) -> Array:
        """Compute W_w'Omega W_w, shape (c, c), from the rows of each joint and those before them."""
        spread = np.zeros((len(self.names), len(self.names)))
        instant = np.rint((observation.t - observation.t.min()) * observation.rate).astype(int)
        instant += observation.record * (
            int(instant.max(initial=0)) + len(correlation)
        )  # no two records are neighbours
        known = np.append(correlation, 0.0)
        before: dict[int, tuple[Array, Array]] = {}
        for j, own, acting, A in self._pieces(observation):
            at, rows = instant[own], A
            begun = 0  # rows before these
            if j in before:
                begun = len(before[j][0])
                at, rows = np.concatenate([before[j][0], at]), np.concatenate([before[j][1], A])
            upper = correlation[0] / 2 * rows  # Omega W_j, of Omega the upper half alone
            upper[:begun] = 0.0
            for k in range(
                1, min(len(correlation), len(rows))
            ):  # rows: as many periods apart, or more where some between are left out
                first = slice(max(begun - k, 0), len(rows) - k)
                later = slice(first.start + k, None)
                r = known[np.minimum(at[later] - at[first], len(correlation))]
                upper[first] += r[:, None] * rows[later]
            product = rows.T @ upper
            spread[np.ix_(acting, acting)] += product + product.T
            start = max(len(rows) - len(correlation) + 1, 0)
            before[j] = at[start:], rows[start:]
        return spread

    def _pieces(self, observation: Observation) -> Iterator[tuple[int, slice, Array, Array]]:
        """Yield rows of W_w piece by piece: joint, rows, columns that are not zero, and these."""
        W = observation.columns(self.names).W
        if isinstance(W, StreamedMatrix):
            for piece in W.pieces():
                A = piece.A.T / self.s[piece.j] * self.size[piece.columns]
                yield piece.j, piece.rows, piece.columns, A
            return
        W = self.matrix(observation)
        for j, own in enumerate(map(observation.joint, range(observation.n))):
            acting = np.flatnonzero(W[own].any(axis=0))
            yield j, own, acting, W[own][:, acting]


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
