"""Friction that switches with the direction of motion, under a noisy velocity.

Columns of sign(s), s = G qd, have no derivative. With s known up to a normal error of deviation
sigma (filters sum many raw errors, so it is normal whatever their law), u = s/sigma, phi and erf of
the normal law, He_n Hermite's polynomials,

    E sign(s + sigma z) = erf(u/sqrt 2)
        c_n = E[sign(s + sigma z) He_n(z)] = 2 phi(u) He_(n-1)(-u)
    E |s + sigma z| = s erf(u/sqrt 2) + 2 sigma phi(u)
        c_n = sigma E[sign(s + sigma z) He_(n-1)(z)]
    Cov(f(t), f(t')) = sum_n c_n(t) c_n(t') rho^n / n!
        rho the correlation of the two errors

c_1/sigma is what takes the place of a derivative: Cov(f, x) = c_1/sigma Cov(s, x) for every x
normal with s. Four orders are summed one by one. Where the speed passes zero quickly the others
cancel over the passage; where it stays near zero c_n^2/n! falls as n^(-3/2) and their spectrum
widens as n^(1/2), so that all of them together weigh half of what their variance does at order
five.

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
    """A switch under noise of deviation sigma.

    shift : ndarray, shape (K,), E f - f after decimation.
    slope : ndarray, shape (K,), c_1/sigma at the kept instants.
    variance : sum of Var f after decimation over the rows used of each joint, shape (n,).
        All for G_j = 1.
    """

    sigma: float
    shift: Array
    slope: Array
    variance: Array

    def between(self, other: Switched, sigma: float) -> Switched:
        """At a deviation between those of two: shift, slope*sigma and variance/sigma are interpolated linearly.

        Exact where the speed rests (slope as 1/sigma, variance as sigma) and where it passes zero
        quickly (slope constant, variance as sigma^2).
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
    """The switch with an error of s of deviation `sigma`.

    s : ndarray, shape (N,), G qd of the filtered velocities of the window.
    factor, settings : decimation.
    used : bool, shape (n, N): instants that count in the rows of joint j.
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
    """Scaled Hermite coefficients c_n/sqrt(n!), n = 1 ... ORDERS; shape (ORDERS + 1, len(u)).

    The last row is the square root of the variance that they leave, with the sign of the next
    coefficient.
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
    """Transforms of rho_k^n r_k, n = 1 ... ORDERS + 1, shape (ORDERS + 1, length//2 + 1), for
    `bins` sums of `bin` samples each, padded to `length`.

    Frequencies between 0 and the Nyquist frequency count twice.
    """

    bin: int
    bins: int
    length: int
    spectra: Array


def kernels(band: Bandwidth, N: int, factor: int) -> Kernels:
    """Kernels for series of N samples that are decimated by `factor`: they change little over an eighth of it, so that sums over that many do."""
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
    """sum_n sum_t,t' c_n(t) c_n(t') rho^n r, by Parseval.

    coefficients, shape (ORDERS + 1, len(near)), over sqrt(n!), at the samples `near`.
    """
    sums = np.array(
        [np.bincount(near // known.bin, weights=c, minlength=known.bins) for c in coefficients]
    )
    return float(np.sum(np.abs(rfft(sums, known.length)) ** 2 * known.spectra))
