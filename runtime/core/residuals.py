"""Whiteness of the residuals: are the residuals of each joint independent of each other?

Eqs. (9), (10) assume that the residuals of a joint are independent. With rho_k, their correlation
at a distance of k rows,

    Q = N (N + 2) sum_k rho_k^2 / (N - k),  k = 1 ... m
            chi^2 with m degrees of freedom if they are independent         Ljung and Box (1978)
    N_eff = N / (1 + 2 sum_k rho_k)
            number of independent rows that give a mean of the same accuracy; the sum ends
            before the first rho_k <= 0

Rows left out and the ends of records are gaps: a pair of rows counts only if both rows exist, in
one record. The spectrum shows the cause: a peak at the frequency of the motion is model error, a
peak near the cut-off is filtered noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import welch
from scipy.special import chdtrc
from scipy.stats import f as fisher

from runtime.core.least_squares.estimate import Estimate
from runtime.core.rows.observation import Observation
from runtime.core.validation import JointComparison, direct_comparison
from runtime.ground.limits import LIMIT

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Whiteness (independence) of the residuals of one joint: correlation, test and spectrum.

    Attributes
    ----------
    joint : str
        Label of the joint.
    rows : int
        Number of residuals, N.
    correlation : ndarray, shape (lags,)
        rho_k, k = 1 ... lags.
    Q, p : float
        Ljung-Box statistic and its probability.
    effective_rows : float
        N_eff.
    frequency : ndarray, shape (f,), Hz
        Frequencies of the spectrum.
    density : ndarray, shape (f,), (N m)^2/Hz or N^2/Hz
        Power density.
    peak : float, Hz
        Frequency of the largest density.
    half : float, Hz
        Frequency below which half of the power lies.
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
        """Whether the Ljung-Box test at 5 % finds no dependence between the residuals."""
        return bool(self.p >= LIMIT.SIGNIFICANT)


def whiteness(comparison: Sequence[JointComparison], rate: float) -> tuple[Whiteness, ...]:
    """Test whether the residuals of every joint are independent.

    rate : rows per second of one joint, Hz.
    """
    return tuple(joint_whiteness(joint, rate) for joint in comparison if len(joint.t))


def joint_whiteness(joint: JointComparison, rate: float) -> Whiteness:
    """Compute the correlation, the Ljung-Box test and the spectrum of the residuals of one joint.

    rate : rows per second, Hz.
    """
    N = len(joint.t)
    m = max(1, min(LIMIT.LAGS, N // 5))
    error = joint.error - joint.error.mean()
    steps = np.rint(np.diff(joint.t) * rate).astype(np.intp)
    apart = (steps <= 0) | (steps > LIMIT.SEPARATE)  # other records: time goes back, or much later
    place = np.concatenate(
        [[0], np.cumsum(np.where(apart, m + 1, steps))]
    )  # on a grid of period 1/rate
    products, pairs = _lagged_sums(error, place, np.flatnonzero(apart) + 1)
    rho, pairs = correlation(products, pairs), pairs[1 : m + 1]
    first, used = rho[:m], pairs > 0
    Q = float(
        N
        * (N + 2)
        * np.sum(first[: len(pairs)][used] ** 2 / np.maximum(N - np.flatnonzero(used) - 1, 1))
    )
    grid = np.zeros(place[-1] + 1)
    grid[place] = error
    frequency, density = welch(
        grid, fs=rate, nperseg=min(LIMIT.SPECTRUM_SEGMENT, len(grid)), detrend=False
    )
    power = np.cumsum(density)
    return Whiteness(
        joint=joint.joint,
        rows=N,
        correlation=first,
        Q=Q,
        p=float(chdtrc(int(used.sum()), Q)),
        effective_rows=N / correlation_time(rho),
        frequency=frequency,
        density=density,
        peak=float(frequency[int(np.argmax(density))]),
        half=float(frequency[int(np.searchsorted(power, power[-1] / 2))]) if power[-1] > 0 else 0.0,
    )


def residual_correlation(residual: Array) -> Array:
    """Compute the autocorrelation rho_k, k = 1 ... N - 1, of equally spaced residuals.

    residual : shape (N,).
    """
    return correlation(
        *_lagged_sums(
            residual - residual.mean(), np.arange(len(residual)), np.empty(0, dtype=np.intp)
        )
    )


def correlation(products: Array, pairs: Array) -> Array:
    """Compute the autocorrelation rho_k, k = 1, 2 ..., of residuals from sums of their products.

    products : sums at the distances k = 0, 1 ...; pairs : number of products in each sum. rho_k is
    0 for a distance without pairs.
    """
    if not products[0] > 0:
        return np.zeros(len(products) - 1)
    return np.asarray(products[1:] / np.maximum(pairs[1:], 1) / (products[0] / pairs[0]))


def correlation_time(rho: Array) -> float:
    """Compute the correlation time, as a number of rows, from the autocorrelation rho_k.

    The time is 1 + 2 sum_k rho_k; the sum ends before the first rho_k that is not positive.
    """
    end = np.flatnonzero(rho <= 0)
    return float(1 + 2 * rho[: end[0] if len(end) else len(rho)].sum())


def effective_share(joints: Sequence[Whiteness]) -> float:
    """Compute the share of effective (independent) rows among all rows of all joints, 0 to 1.

    The result is at most 1.
    """
    return min(1.0, sum(w.effective_rows for w in joints) / max(sum(w.rows for w in joints), 1))


def unseen_by_blocks(observation: Observation, fit: Estimate) -> float:
    """Compute the factor that corrects variances from time blocks for correlation beyond a block.

    Variances from blocks of L seconds assume that the blocks are independent. With residuals that
    are correlated as exp(-t/tau), the factor is

        c = 1/(1 - (tau/L) (1 - exp(-L/tau)))

    m = 2 tau is the correlation time of the joint with the median correlation time.
    """
    joints = whiteness(direct_comparison(observation, fit), observation.rate)
    memory = [one.rows / one.effective_rows for one in joints]
    ratio = float(np.median(memory)) / observation.rate / (2 * observation.residual_block)
    return block_correlation(ratio)


def block_correlation(ratio: float) -> float:
    """Compute c of `unseen_by_blocks` from tau/L; 1 if there are no residuals."""
    if not (np.isfinite(ratio) and ratio > 0):
        return 1.0
    return float(1 / (1 + ratio * np.expm1(-1 / ratio)))


def _lagged_sums(x: Array, place: Array, starts: Array) -> tuple[Array, Array]:
    """Compute the sums of products x_t x_(t+k) of residuals x, k = 0, 1 ..., and their number.

    x has shape (N,), `place` its places on a uniform grid. No pair combines different records,
    which begin at `starts`.
    """
    records = np.split(np.arange(len(x)), starts)
    longest = max(int(place[rows[-1]] - place[rows[0]]) + 1 for rows in records)
    sums = np.zeros((2, longest))
    for rows in records:
        own = place[rows] - place[rows[0]]
        length = next_fast_len(2 * (own[-1] + 1), real=True)
        for total, values in zip(sums, (x[rows], 1.0), strict=True):
            grid = np.zeros(own[-1] + 1)
            grid[own] = values
            spectrum = rfft(grid, length)
            total[: len(grid)] += irfft(np.square(np.abs(spectrum)), length)[: len(grid)]
    return sums[0], np.rint(sums[1])


def p_value(
    squares_first: float, squares: float, terms_first: int, terms: int, count: float
) -> float:
    """Compute the p-value of an F-test: does a model with more terms fit better than another?

    squares_first, squares : sums of squared residuals of both models. terms_first, terms : numbers
    of terms. count : number of independent samples.
    """
    if terms == terms_first or squares <= 0 or count <= terms:
        return 1.0
    F = max(squares_first / squares - 1, 0.0) * (count - terms) / (terms - terms_first)
    return float(fisher.sf(F, terms - terms_first, count - terms))
