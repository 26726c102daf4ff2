"""Are the residuals white? Joint by joint, in time and in frequency.

Eqs. (9), (10) take the residuals of a joint as independent. With rho_k their correlation at a distance of k rows,

    Q = N (N + 2) sum_k rho_k^2 / (N - k),  k = 1 ... m        chi^2 with m degrees of freedom if they are         Ljung and Box (1978)
    N_eff = N / (1 + 2 sum_k rho_k)                            rows that say as much about a mean; the sum ends before the first negative rho_k

Rows left out and other records are gaps: a pair counts only where both its rows exist. The spectrum tells what is left over: a peak at the frequency
of the motion is model error, one near the cut-off is filtered noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch
from scipy.special import chdtrc

from runtime.identification.validation import Comparison, JointComparison

Array = np.ndarray

LAGS = 20
SIGNIFICANT = 0.05
"""p-value below which residuals are not white."""
SEGMENT = 256
"""Samples of one segment of the spectrum."""


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Residuals of one joint.

    correlation : rho_k, k = 1 ... lags.   Q, p : Ljung-Box.   effective_rows : N_eff of `rows`.
    frequency : Hz, density : (N m)^2/Hz (or N^2/Hz), shape (f,) each.   peak : Hz, of the largest density.   half : Hz, below which half of the power lies.
    """

    joint: str
    rows: int
    correlation: Array
    Q: float
    p: float
    effective_rows: float
    frequency: Array
    density: Array
    peak: float
    half: float

    @property
    def white(self) -> bool:
        """Ljung-Box does not reject independence at 5 %."""
        return self.p >= SIGNIFICANT


def whiteness(comparison: Comparison, rate: float) -> tuple[Whiteness, ...]:
    """Whiteness of every joint; rate : rows per second of one joint, Hz."""
    return tuple(joint_whiteness(joint, rate) for joint in comparison if len(joint.t))


def joint_whiteness(joint: JointComparison, rate: float, lags: int = LAGS) -> Whiteness:
    """Correlation, Ljung-Box and spectrum of one joint's residuals."""
    N = len(joint.t)
    m = max(1, min(lags, N // 5))
    error = joint.error - joint.error.mean()
    place = _places(joint.t, rate, m)
    grid, there = np.zeros(place[-1] + 1 + m), np.zeros(place[-1] + 1 + m)
    grid[place], there[place] = error, 1.0
    variance = float(error @ error) / N
    length = len(grid) - m
    pairs = np.array([there[:length] @ there[k : k + length] for k in range(1, m + 1)])
    products = np.array([grid[:length] @ grid[k : k + length] for k in range(1, m + 1)])
    rho = products / np.maximum(pairs, 1) / variance if variance > 0 else np.zeros(m)
    used = pairs > 0
    Q = float(N * (N + 2) * np.sum(rho[used] ** 2 / np.maximum(N - np.arange(1, m + 1)[used], 1)))
    negative = np.flatnonzero(rho <= 0)
    positive = rho[: negative[0]] if len(negative) else rho
    frequency, density = welch(grid[: place[-1] + 1], fs=rate, nperseg=min(SEGMENT, place[-1] + 1), detrend=False)
    power = np.cumsum(density)
    return Whiteness(
        joint=joint.joint,
        rows=N,
        correlation=rho,
        Q=Q,
        p=float(chdtrc(int(used.sum()), Q)),
        effective_rows=float(N / (1 + 2 * positive.sum())),
        frequency=frequency,
        density=density,
        peak=float(frequency[int(np.argmax(density))]),
        half=float(frequency[int(np.searchsorted(power, power[-1] / 2))]) if power[-1] > 0 else 0.0,
    )


def effective_share(found: Sequence[Whiteness]) -> float:
    """Rows that count over rows, all joints together, at most 1."""
    return min(1.0, sum(w.effective_rows for w in found) / max(sum(w.rows for w in found), 1))


def _places(t: Array, rate: float, gap: int) -> Array:
    """Number of each row on a grid of period 1/rate; time that goes back starts another record, `gap` + 1 places on."""
    steps = np.rint(np.diff(t) * rate).astype(np.intp)
    return np.concatenate([[0], np.cumsum(np.where(steps <= 0, gap + 1, steps))])
