"""A motion between the bounds that counts are: expectation propagation under a white-jerk prior,
one law for all speeds.

    lo_k <= x(t_k) <= hi_k,   lo_k = count_k - 1/2, hi_k = count_k + 1/2
                              in steps of the encoder; at every sample
    tilted law of a sample    N(x; m, v) [Phi((hi - x)/e) - Phi((lo - x)/e)]
                              m, v without this sample; e the error of a line
    site
        the normal law that gives the tilted law its mean and variance: precision tau, tau times
        mean nu

A change of the count is what two neighbouring intervals say together. Sites start from the changes
(position (k + 1/2), error qd Ts/sqrt(12)) and
are then updated all at once, damped. The jerk density is the fixed point of MacKay's rule, the sum
of squared jerks over the number of jerks that
the record determines, in windows of time with the whole record as prior.

References: Minka (2001); Cunningham, Hennig and Lacoste-Julien (2011), boxes; MacKay (1992),
evidence; docs/theory/counts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import erfcx

from runtime.signals.counts.lines import LineErrors, line_errors
from runtime.signals.counts.spline import Basis, Factor, next_density

Array = np.ndarray
Lines = Literal["detected", "estimated"] | float

KNOTS = 2e-3
"""Distance of knots, s, or of samples where that is larger."""
PASSES, FIRST = 12, 30
"""Most passes over the sites, and over the changes alone ahead of them."""
SETTLED = 0.1
"""Relative change of the jerk density at which the passes over the changes end."""
DAMPING = 0.7
FAR = 6.0
"""Deviations from both of its bounds at which a sample says nothing."""
CHANGE = 0.02
"""Relative change of the precisions at which passes end."""
LINES = 0.01
"""Error of a line that is always allowed for, steps."""
WINDOW, OF_RECORD = 0.05, 3.0
"""Length of time that has a jerk density of its own, s, and the weight of the whole record in it,
in determined jerks.
"""
RANGE = 1e-3
"""Least share of a window's density in that of the record."""
GAP = 10.0
"""Deviation of a missing sample, ranges of the counts: as good as none, but the precision of a long
gap remains one that Cholesky factors.
"""
SPACING = 0.3
"""Distance of bounds inside an interval, in units of the time r^(-1/5) in which white jerk of
density r crosses it.
"""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Posterior of n channels, in steps.

    basis : Basis.
    c : coefficients, shape (n, P).
    Z : covariances, shape (4, n, P).
    factor : of A.
    density : r, shape (n, M), steps^2/s^5.
    origin : shape (n, 1), what was taken off the counts.   errors : those of the lines, by channel.
    """

    basis: Basis
    c: Array
    Z: Array
    factor: Factor
    density: Array
    origin: Array
    errors: tuple[LineErrors, ...] = ()

    def state(self, order: int) -> tuple[Array, Array]:
        """Mean and deviation of the position, or of its derivative of that order, shape (n, N)
        each.
        """
        N = self.basis.N
        mean = self.basis.at_samples(self.c, order)[:, :N]
        return mean + self.origin * (order == 0), np.sqrt(
            np.maximum(self.basis.variances(self.Z, order)[:, :N], 0)
        )

    def draw(self, rng: np.random.Generator) -> Array:
        """Positions drawn from the posterior, shape (n, N)."""
        return np.asarray(
            self.basis.at_samples(self.c + self.factor.draw(rng))[:, : self.basis.N] + self.origin
        )


def smoothed(counts: Array, Ts: float, *, lines: Lines = "detected") -> Smoothed:
    """Posterior of counts, shape (n, N); nan: a sample that is missing.

    lines : whether errors of the lines are "detected", and bounds widened, or "estimated"; or their
    deviation in steps.
    """
    n, N = counts.shape
    basis = Basis(N, n, max(1, round(KNOTS / Ts)), Ts)
    known = np.zeros((n, basis.padded), dtype=bool)
    known[:, :N] = np.isfinite(counts)
    origin = np.asarray(np.round(np.nanmean(counts, axis=1)))[:, None]
    y, rest = np.zeros(known.shape), np.zeros(known.shape)  # rest : precision of missing samples
    y[:, :N] = np.where(known[:, :N], counts - origin, 0.0)
    rest[:, :N] = np.where(known[:, :N], 0.0, (GAP * (np.ptp(y, axis=1, keepdims=True) + 1)) ** -2)
    given = LINES if isinstance(lines, str) else lines
    errors = [LineErrors(given, 0, np.zeros(0), given)] * n
    tau, nu = _from_changes(y, known, rest, errors, basis.m)
    c, density = _passed(basis, tau, nu, _first_density(y[:, :N]))
    if isinstance(lines, str):
        errors, density = line_errors(
            basis, y, known, rest, c, density, Ts, estimate=lines == "estimated"
        )
        if any(each.deviation > LINES for each in errors):
            tau, nu = _from_changes(y, known, rest, errors, basis.m)
            c, density = _passed(basis, tau, nu, density.mean(axis=1))
    sites = np.flatnonzero(_sites(y, known, density, Ts))
    of, value = sites // basis.padded, y.ravel()[sites]
    low, high = value - 0.5, value + 0.5
    for j, each in enumerate(errors):
        if len(each.shift):
            number = np.round(value[of == j]).astype(int)
            low[of == j] += each.of(number - 1)
            high[of == j] += each.of(number)
    e2 = np.array([each.left for each in errors])[of] ** 2
    t, u = tau.ravel()[sites], nu.ravel()[sites]
    tau, pull, x, gaps = rest.copy(), np.zeros(y.shape), basis.at_samples(c), np.flatnonzero(rest)
    for _ in range(PASSES):
        tau.ravel()[sites], pull.ravel()[sites] = t, u - t * x.ravel()[sites]
        pull.ravel()[gaps] = -rest.ravel()[gaps] * x.ravel()[gaps]
        factor = Factor.of(basis.precision(tau, density))
        c = c + factor.solve(basis.gradient(pull, density, c))
        Z = factor.inverse()
        density = _density(basis, c, Z, density)
        x = basis.at_samples(c)
        at, v = x.ravel()[sites], basis.variances(Z).ravel()[sites]
        cavity = 1 / np.maximum(1 / v - t, 0.02 / v)
        m = cavity * (at / v - u)
        s = np.sqrt(cavity + e2)
        near = np.flatnonzero(np.minimum(m - low, high - m) < FAR * s)
        g, H = np.zeros((2, len(s)))
        g[near], H[near] = box_moments((low - m)[near] / s[near], (high - m)[near] / s[near])
        g, H = g / s, H / s**2
        left = 1 - cavity * H
        t_new, u_new = H / left, (g + H * m) / left
        change = np.abs(t_new - t).sum() / t.sum()
        t, u = t + DAMPING * (t_new - t), u + DAMPING * (u_new - u)
        if change < CHANGE:
            break
    return Smoothed(basis, c, Z, factor, density, origin, tuple(errors))


def _passed(basis: Basis, tau: Array, nu: Array, density: Array) -> tuple[Array, Array]:
    """The spline through Gaussian sites, and the jerk density that goes with it, shape (n, M),
    after at most FIRST passes from `density`, (n,).
    """
    samples, unit = basis.of_samples(tau), basis.of_prior(np.ones((basis.n, basis.M)))
    g = basis.gradient(nu, np.ones((basis.n, basis.M)), np.zeros((basis.n, basis.P)))
    for _ in range(FIRST):
        before, density = density, next_density(basis, samples, unit, g, density)
        if (np.abs(density / before - 1) < SETTLED).all():
            break
    of_windows, c = np.repeat(density[:, None], basis.M, axis=1), np.zeros((basis.n, basis.P))
    for _ in range(2):
        factor = Factor.of(samples + basis.of_prior(of_windows))
        for _ in range(2):
            c = c + factor.solve(basis.gradient(nu - tau * basis.at_samples(c), of_windows, c))
        of_windows = _density(basis, c, factor.inverse(), of_windows)
    return c, of_windows


def _sites(y: Array, known: Array, density: Array, Ts: float) -> Array:
    """Samples whose bounds count: both sides of every change and gap, and in between as often as
    the motion forgets, bool of the shape of y.

    Bounds of samples close together are one bound. Taken as many, each would see the others as
    independent knowledge.
    """
    sites = np.zeros(y.shape, dtype=bool)
    for j in range(len(y)):
        at = np.flatnonzero(known[j])
        change = np.flatnonzero((np.diff(y[j, at]) != 0) | (np.diff(at) > 1))
        sites[j, at[[0, -1]]] = sites[j, at[change]] = sites[j, at[change + 1]] = True
        ends = np.concatenate(
            [[0], np.repeat(change, 2) + np.tile([0, 1], len(change)), [len(at) - 1]]
        ).reshape(-1, 2)
        spacing = SPACING * density[j].mean() ** -0.2 / Ts
        a, length = ends[:, 0], ends[:, 1] - ends[:, 0]
        parts = (length / spacing).astype(int)  # of every stretch without a change
        which = np.repeat(np.arange(len(ends)), parts)
        number = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
        sites[j, at[(a[which] + number * (length / np.maximum(parts, 1))[which]).astype(int)]] = (
            True
        )
    return sites


def box_moments(a: Array, b: Array) -> tuple[Array, Array]:
    """g and H of a unit normal between a < b: g = d log Z/dm, H = -d^2 log Z/dm^2, Z = Phi(b) -
    Phi(a), at mean m = 0 of unit variance.
    """
    flip = a + b < 0
    low, high = np.where(flip, -b, a), np.where(flip, -a, b)
    low = np.maximum(low, -8.0)
    ratio = np.exp(np.minimum((low - high) * (low + high) / 2, 0))
    at_low = np.sqrt(2 / np.pi) / (erfcx(low / np.sqrt(2)) - ratio * erfcx(high / np.sqrt(2)))
    at_high = at_low * ratio
    g = at_low - at_high
    return np.where(flip, -g, g), np.clip(g * g + high * at_high - low * at_low, 0, 1 - 1e-9)


def _first_density(y: Array) -> Array:
    """A density above any that the record asks for, from which MacKay's rule takes few passes,
    shape (n,): root 1e4 s^(-5/2) times the range.
    """
    return np.asarray((np.ptp(y, axis=1) + 1) ** 2 * 1e8)


def _from_changes(
    y: Array, known: Array, rest: Array, errors: Sequence[LineErrors], near: int
) -> tuple[Array, Array]:
    """First sites: at the two samples around a change of the count, at most `near` missing samples
    apart; a hundredth of an interval at every other
    sample, `rest` where it is missing."""
    tau = np.where(known, 0.06, rest)
    nu = tau * y
    for j in range(len(y)):
        at = np.flatnonzero(known[j])
        e = np.flatnonzero((np.diff(y[j, at]) != 0) & (np.diff(at) <= near + 1))
        if len(e) < 2:
            continue
        before, after = at[e], at[e + 1]
        t, line = (before + after) / 2, (y[j, before] + y[j, after]) / 2
        slope = np.diff(line) / np.diff(t)  # steps a sample, from change to change
        slopes = np.abs([np.append(slope[:1], slope), np.append(slope, slope[-1:])])
        speed = 0.5 * (np.append(slope[:1], slope) + np.append(slope, slope[-1:]))
        line = line + errors[j].of(np.floor(line).astype(int))
        weight = 6 / (
            np.clip(slopes.max(axis=0) * (after - before), 0.02, 1) ** 2 + 12 * errors[j].left ** 2
        )
        for samples in (before, after):
            np.add.at(tau[j], samples, weight)
            np.add.at(nu[j], samples, weight * (line + (samples - t) * speed))
    return tau, nu


def _density(basis: Basis, c: Array, Z: Array, density: Array) -> Array:
    """MacKay's rule in windows of time, the whole record counting as OF_RECORD determined jerks;
    shape (n, M).
    """
    squares, determined = (
        basis.jerk(c) ** 2 * basis.h,
        np.maximum(1 - basis.jerk_variances(Z) * basis.h / density, 1e-9),
    )
    whole = squares.mean(axis=1, keepdims=True) / determined.mean(axis=1, keepdims=True)
    size = max(1, round(WINDOW / basis.h))
    squares, determined = (
        size * uniform_filter1d(x, size, axis=1, mode="nearest") for x in (squares, determined)
    )
    least = np.maximum(RANGE * whole, basis.least_density)
    return np.asarray(np.maximum((squares + OF_RECORD * whole) / (determined + OF_RECORD), least))
