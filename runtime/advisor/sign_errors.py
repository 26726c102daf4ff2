"""Mean and variance of friction that switches with the direction of motion, if velocity is noisy.

Columns of sign(s), s = G qd, have no derivative. Let s be known up to a normal error of standard
deviation sigma (filters add many raw errors, so it is normal whatever their law), u = s/sigma, phi
the normal density, erf the error function, and He_n Hermite's polynomials:

    E sign(s + sigma z) = erf(u/sqrt 2)
        c_n = E[sign(s + sigma z) He_n(z)] = 2 phi(u) He_(n-1)(-u)
    E |s + sigma z| = s erf(u/sqrt 2) + 2 sigma phi(u)
        c_n = sigma E[sign(s + sigma z) He_(n-1)(z)]
    Cov(f(t), f(t')) = sum_n c_n(t) c_n(t') rho^n / n!
        rho the correlation of the two errors

c_1/sigma replaces a derivative: Cov(f, x) = c_1/sigma Cov(s, x) for every x normal with s. Four
orders are added one by one. If the speed passes zero quickly, the higher orders cancel over the
passage. If it stays near zero, c_n^2/n! falls as n^(-3/2) and the spectrum of order n widens as
n^(1/2), so that all higher orders together have half of the weight that their variance would have
at order five.

References: Price (1958) and Bussgang (1952) for the covariances; Mehler's expansion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.special import erf

from runtime.core.rows.switches import Switch
from runtime.core.signals.filters import decimated
from runtime.core.signals.noise_gain import Bandwidth
from runtime.core.study import Decimate

Array = np.ndarray

ORDERS = 4
"""Orders of the expansion summed one by one."""
REST = 0.5
"""Weight of all others together, at order ORDERS + 1."""
MEMORY = 40
"""Length of the kernels in kept samples: there the decimation's response has decayed below 1e-4."""
FAR = 4.0
"""|s|/sigma from which the sign never flips: once in 16000 samples."""


@dataclass(frozen=True, eq=False)
class Switched:
    """Effect of velocity errors on a column of W that switches sign, such as sign(qd). The velocity
    errors have the standard deviation sigma.

    shift : change of the mean, E f - f, after decimation, shape (K,).
    slope : c_1/sigma at the kept instants, shape (K,); it replaces the derivative.
    variance : sum of Var f after decimation over the rows used of each joint, shape (n,).

    Here f is the column, c_1 its first Hermite coefficient (see above), and all values are for s =
    qd_j.
    """

    sigma: float
    shift: Array
    slope: Array
    variance: Array

    def between(self, other: Switched, sigma: float) -> Switched:
        """Interpolate the effect of velocity errors, given for two standard deviations of errors.

        The interpolated quantities are shift, slope*sigma and variance/sigma. The interpolation is
        exact if the speed rests (slope proportional to 1/sigma, variance to sigma) or passes zero
        quickly (slope constant, variance proportional to sigma^2).
        """
        share = (sigma - self.sigma) / (other.sigma - self.sigma)
        here = (self.shift, self.slope * self.sigma, self.variance / self.sigma)
        there = (other.shift, other.slope * other.sigma, other.variance / other.sigma)
        shift, slope, variance = (
            (1 - share) * a + share * b for a, b in zip(here, there, strict=True)
        )
        return Switched(sigma, shift, slope / sigma, variance * sigma)


def switch_with_error(
    switch: Switch,
    s: Array,
    sigma: float,
    gain: float,
    known: Kernels,
    factor: int,
    settings: Decimate | None,
    used: Array,
) -> Switched:
    """Compute how an error of the speed s changes a column of W that switches sign with s.

    sigma : standard deviation of the error.

    s : G qd of the filtered velocities of the window, shape (N,).
    factor, settings : factor and settings of the decimation.
    used : instants that count in the rows of each joint, bool (n, N).
    """
    near = np.arange(len(s)) if switch.kink else np.flatnonzero(np.abs(s) < FAR * sigma)
    u = s[near] / sigma
    m, phi = erf(u / np.sqrt(2)), np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
    shift, slope = (
        np.zeros(len(s)),
        np.full(len(s), switch.linear),
    )  # away from `near`, and a kink has no away
    shift[near] = switch.jump * (m - np.sign(u)) + switch.kink * sigma * (
        u * m + 2 * phi - np.abs(u)
    )
    slope[near] = switch.linear + switch.jump * 2 * phi / sigma + switch.kink * m
    decimated_shift, decimated_slope = decimated(np.array([shift, slope]), factor, settings)
    coefficients = _coefficients(switch, u, m, phi, sigma)
    variance = np.zeros(len(switch.G))
    for j in switch.joints:
        variance[j] = _summed_variance(coefficients * used[j][near], near, known) / factor
    return Switched(sigma, decimated_shift, decimated_slope / gain, variance)


def _coefficients(switch: Switch, u: Array, m: Array, phi: Array, sigma: float) -> Array:
    """Compute the Hermite coefficients of a column of W that switches sign, such as sign(qd).

    Return c_n/sqrt(n!) of the orders n = 1 ... N and one more row, shape (N + 1, len(u)), with N =
    `ORDERS`. The last row is for all higher orders: the square root of the variance they
    contribute, with the sign of the next coefficient.
    """
    He = [np.ones_like(u), -u]
    for n in range(1, ORDERS):
        He.append(-u * He[-1] - n * He[-2])
    sign = [m, *(2 * phi * h for h in He)]  # E[sign He_n], n = 0, 1 ...
    c = [switch.jump * sign[n] + switch.kink * sigma * sign[n - 1] for n in range(1, ORDERS + 2)]
    c[0] += switch.linear * sigma
    normed = np.array([value / np.sqrt(factorial(n)) for n, value in enumerate(c, start=1)])
    size = u * m + 2 * phi  # E|v|, v = s + sigma z in units of sigma; Cov(v, |v|) = m
    both = switch.linear**2 + 2 * switch.linear * switch.kink * m
    total = switch.jump**2 * (1 - m**2) + sigma**2 * (both + switch.kink**2 * (1 + u**2 - size**2))
    rest = np.clip(total - (normed[:ORDERS] ** 2).sum(axis=0), 0, None)
    normed[ORDERS] = np.sqrt(REST * rest) * np.sign(normed[ORDERS])
    return normed


@dataclass(frozen=True, eq=False)
class Kernels:
    """Fourier transforms of the correlation of velocity errors, used to sum variances over time.

    They are those of rho_k^n r_k, with rho_k the correlation of velocity errors k samples apart,
    and r_k the same for the decimation filter.

    spectra : transforms for n = 1 ... N + 1 with N = `ORDERS`, shape (N + 1, length//2 + 1).
        Frequencies between 0 and the Nyquist frequency count twice.
    bin, bins, length : there are `bins` sums of `bin` samples each, padded with zeros to `length`.
    """

    bin: int
    bins: int
    length: int
    spectra: Array


def kernels(band: Bandwidth, N: int, factor: int) -> Kernels:
    """Compute the Fourier transforms of the correlation of velocity errors over N samples.

    factor : the samples are decimated by this factor. Kernels change little over an eighth of it,
        so sums over this number of samples suffice.
    """
    size = max(1, factor // 8)
    bins = -(-N // size)
    rho, r = band.speed[::size], band.decimation[::size]
    lags = min(bins, len(rho), MEMORY * factor // size)
    length = next_fast_len(bins + lags, real=True)
    kernel = np.zeros((ORDERS + 1, length))
    kernel[:, :lags] = r[:lags] * rho[:lags] ** np.arange(1, ORDERS + 2)[:, None]
    kernel[:, length - lags + 1 :] = kernel[:, lags - 1 : 0 : -1]
    spectra = 2 * rfft(kernel).real / length
    spectra[:, 0] /= 2
    if length % 2 == 0:
        spectra[:, -1] /= 2
    return Kernels(size, bins, length, spectra)


def _summed_variance(coefficients: Array, near: Array, known: Kernels) -> float:
    """Compute the variance, summed over the samples, that wrong signs cause in a friction column.

    It is the sum of c_n(t) c_n(t') rho^n r over all orders n and instants t, t', by Parseval's
    theorem.

    coefficients : c_n/sqrt(n!) at the samples `near`, of N = `ORDERS` orders and one more,
        shape (N + 1, len(near)).
    """
    sums = np.array(
        [np.bincount(near // known.bin, weights=c, minlength=known.bins) for c in coefficients]
    )
    return float(np.sum(np.abs(rfft(sums, known.length)) ** 2 * known.spectra))
