"""A motion between the bounds that counts are: expectation propagation under a white-jerk prior, one law for all speeds.

    lo_k <= x(t_k) <= hi_k,   lo_k = count_k - 1/2, hi_k = count_k + 1/2          in steps of the encoder; at every sample
    tilted law of a sample    N(x; m, v) [Phi((hi - x)/e) - Phi((lo - x)/e)]      m, v without this sample; e the error of a line
    site                      the normal law that gives the tilted law its mean and variance: precision tau, tau times mean nu

A change of the count is what two neighbouring intervals say together. Sites start from the changes (position (k + 1/2), error qd Ts/sqrt(12)) and
are then updated all at once, damped. The jerk density is the fixed point of MacKay's rule, the sum of squared jerks over the number of jerks that
the record determines, in windows of time with the whole record as prior.

References: Minka (2001); Cunningham, Hennig and Lacoste-Julien (2011), boxes; MacKay (1992), evidence; docs/theory/counts.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import erfcx

from runtime.observation.spline_posterior import Basis, Factor

Array = np.ndarray

KNOTS = 1e-3
"""Distance of knots, s."""
PASSES, FIRST = 12, 6
"""Most passes over the sites, and passes over the changes alone ahead of them."""
DAMPING = 0.5
CHANGE = 0.02
"""Relative change of the precisions at which passes end."""
LINES = 0.01
"""Error of a line that is always allowed for, steps."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Posterior of n channels, in steps.

    basis : Basis.   c : coefficients, shape (n, P).   Z : covariances, shape (4, n, P).   factor : of A.   density : r, shape (n, M), steps^2/s^5.
    origin : shape (n, 1), what was taken off the counts.
    """

    basis: Basis
    c: Array
    Z: Array
    factor: Factor
    density: Array
    origin: Array

    def state(self, order: int) -> tuple[Array, Array]:
        """Mean and deviation of the position, or of its derivative of that order, shape (n, N) each."""
        N = self.basis.N
        mean = self.basis.at_samples(self.c, order)[:, :N]
        return mean + self.origin * (order == 0), np.sqrt(np.maximum(self.basis.variances(self.Z, order)[:, :N], 0))

    def draw(self, rng: np.random.Generator) -> Array:
        """Positions drawn from the posterior, shape (n, N)."""
        return np.asarray(self.basis.at_samples(self.c + self.factor.draw(rng))[:, : self.basis.N] + self.origin)


def smoothed(counts: Array, Ts: float, *, lines: Array | float = LINES, offsets: Array | None = None) -> Smoothed:
    """Posterior of counts, shape (n, N); nan: a sample that is missing.

    lines : error of lines, steps.   offsets : shape (n, N), middle of the interval of each sample less its count, of uneven lines.
    """
    n, N = counts.shape
    basis = Basis(N, n, max(1, round(KNOTS / Ts)), Ts)
    missing = ~np.isfinite(counts)
    origin = np.asarray(np.round(np.nanmean(counts, axis=1)))[:, None]
    y = np.zeros((n, basis.padded))
    y[:, :N] = np.where(missing, 0.0, counts - origin)
    idle = np.ones(y.shape, dtype=bool)
    idle[:, :N] = missing
    tau, nu = _from_changes(y, idle, N)
    density = np.full((n, basis.M), _first_density(y[:, :N], Ts))
    c = np.zeros((n, basis.P))
    e2 = np.square(lines)
    for number in range(-FIRST, PASSES):
        for _ in range(2 if number == -FIRST else 1):
            factor = Factor.of(basis.precision(tau, density))
            c = c + factor.solve(basis.gradient(nu - tau * basis.at_samples(c), density, c))
        Z = factor.inverse()
        density = _density(basis, c, Z, density)
        if number < 0:
            continue
        x, v = basis.at_samples(c), basis.variances(Z)
        cavity = 1 / np.maximum(1 / v - tau, 0.02 / v)
        middle = cavity * (x / v - nu)
        s = np.sqrt(cavity + e2)
        g, H = box_moments((y - 0.5 - middle) / s, (y + 0.5 - middle) / s)
        g, H = g / s, H / s**2
        left = 1 - cavity * H
        tau_new, nu_new = H / left, (g + H * middle) / left
        tau_new[idle] = nu_new[idle] = 0
        change = np.abs(tau_new - tau).sum() / tau.sum()
        tau, nu = tau + DAMPING * (tau_new - tau), nu + DAMPING * (nu_new - nu)
        if change < CHANGE:
            break
    return Smoothed(basis, c, Z, factor, density, origin)


def box_moments(a: Array, b: Array) -> tuple[Array, Array]:
    """g and H of a unit normal between a < b: g = d log Z/dm, H = -d^2 log Z/dm^2, Z = Phi(b) - Phi(a), at mean m = 0 of unit variance."""
    flip = a + b < 0
    low, high = np.where(flip, -b, a), np.where(flip, -a, b)
    low = np.maximum(low, -8.0)
    ratio = np.exp(np.minimum((low - high) * (low + high) / 2, 0))
    at_low = np.sqrt(2 / np.pi) / (erfcx(low / np.sqrt(2)) - ratio * erfcx(high / np.sqrt(2)))
    at_high = at_low * ratio
    g = at_low - at_high
    return np.where(flip, -g, g), np.clip(g * g + high * at_high - low * at_low, 0, 1 - 1e-9)


def _first_density(y: Array, Ts: float) -> Array:
    """A density above any that the record asks for, shape (n, 1): the range of the motion passed in a hundredth of a second."""
    return np.asarray((np.ptp(y, axis=1, keepdims=True) + 1) ** 2 * 1e10)


def _from_changes(y: Array, idle: Array, N: int) -> tuple[Array, Array]:
    """First sites: at the two samples around a change of the count; a hundredth of an interval at every other sample."""
    tau = np.where(idle, 0.0, 0.06)
    nu = tau * y
    for j in range(len(y)):
        known = np.flatnonzero(~idle[j, :N])
        e = np.flatnonzero(np.diff(y[j, known]))
        if len(e) < 2:
            continue
        before, after = known[e], known[e + 1]
        at, line = (before + after) / 2, (y[j, before] + y[j, after]) / 2
        speed = (np.interp(at + 25, at, line) - np.interp(at - 25, at, line)) / 50  # steps a sample
        weight = 6 / np.clip(np.abs(speed) * (after - before), 0.02, 1) ** 2
        for samples in (before, after):
            np.add.at(tau[j], samples, weight)
            np.add.at(nu[j], samples, weight * (line + (samples - at) * speed))
    return tau, nu


def _density(basis: Basis, c: Array, Z: Array, density: Array) -> Array:
    """MacKay's rule, shape (n, M)."""
    squares, determined = basis.jerk(c) ** 2 * basis.h, np.maximum(1 - basis.jerk_variances(Z) * basis.h / density, 1e-9)
    return np.broadcast_to(squares.mean(axis=1, keepdims=True) / determined.mean(axis=1, keepdims=True), density.shape)
