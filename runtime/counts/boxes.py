"""Estimation of a motion from encoder counts, which bound the position, by expectation propagation.

The assumed errors of counts and time stamps are those with the largest evidence.

    tilted law of a sample    N(x; m, v) [Phi((hi - x)/e) - Phi((lo - x)/e)]
                              m, v without this sample; e^2 = count^2 + (time qd Ts)^2
    site
        the normal law that gives the tilted law its mean and variance: precision tau, tau times
        mean nu
    evidence    log Z = sum_k log C_k + sum_k nu_k x_k/2 - log|A|/2 - sum_i log(r_i h^5)/2
        C_k the factor that gives the site the mass of the tilted law; a constant is left out

Sites are updated all at once, with damping, which is stronger if precisions change more than
before. Errors are tried from large to small ones: wide bounds settle in a few passes, and bounds
that are too narrow for their counts lose evidence before the iteration fails to settle.

References: Minka (2001); Cunningham, Hennig and Lacoste-Julien (2011), boxes; MacKay (1992),
evidence; docs/theory/counts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.sparse import diags_array
from scipy.special import erfcx

from runtime.counts.spline import Basis, Factor

Array = np.ndarray

PASSES, CHANGE = 40, 0.02
"""Most passes over the sites, and the relative change of the precisions at which they end."""
DAMPING, LEAST_DAMPING, SLOWER = 0.7, 0.1, 0.95
"""Damping of the sites and the least one; the ratio of two changes above which the next one is
damped more.
"""
CAVITY = 0.02
"""Least share of a precision that is left without the sample. Sites at it have not settled, unless
the others tell less than the interval itself.
"""
FAR = 6.0
"""Deviations from both of its bounds at which a sample says nothing; beyond its bound by which it
contradicts the motion.
"""
SUSPECTS, BESIDE = 2, 2048
"""Windows of time in which a jump of the counts is looked for, beside that of the densest jerk, and
the samples on either side that tell it.
"""
# Errors of a count beside its rounding that are compared, steps (rms).
COUNT_ERRORS = (0.01, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
# Errors of a time stamp that are compared, sampling periods (rms).
CLOCK_ERRORS = (0.0, 0.05, 0.1, 0.2, 0.4)
MOVES = ((-1, 0), (1, 0), (0, 1), (0, -1), (-1, 1), (-1, 0), (1, 0))
"""Steps of the search in COUNT_ERRORS and in CLOCK_ERRORS, each as long as the evidence rises."""
CLEAR, TELLING = 3.0, 1000
"""Rise of the evidence, nats, that counts as one, and the sites that tell what is promised."""
WINDOW, OF_RECORD, RANGE = 0.05, 3.0, 1e-3
"""Length of time that has a jerk density of its own, s; the weight of the whole record in it, in
determined jerks; the least share of a window's density in that of the record.
"""


@dataclass(frozen=True)
class Errors:
    """Root mean square errors of counts and time stamps of an encoder, in addition to rounding.

    `count` is the error of a count in steps, `time` the error of a time stamp in sampling periods.
    """

    count: float
    time: float = 0.0

    def variance(self, speed: Array) -> Array:
        """Compute the variance of position errors, in steps^2, at speeds in steps per sample."""
        return np.asarray(self.count**2 + (self.time * speed) ** 2)


@dataclass(frozen=True, eq=False)
class Posterior:
    """The motion estimated from encoder counts, with covariances and log likelihood of the counts.

    At each of the S samples used, a normal law (the site) replaces the bounds.

    c : coefficients of the spline, shape (P,).
    density : density r of the jerk, shape (M,).
    tau, nu : precision of each site, and precision times mean, shape (S,).
    Z, factor : covariances, shape (4, P), and the Cholesky factor of A.
    errors : errors of the counts that were assumed.
    evidence : log Z; minus infinity if the sites have not settled.
    without : for each site, mean and variance of the position estimated without it, and the speed
        in steps per sample; shape (3, S).
    """

    c: Array
    density: Array
    tau: Array
    nu: Array
    Z: Array
    factor: Factor
    errors: Errors
    evidence: float
    without: Array

    @property
    def settled(self) -> bool:
        """Whether expectation propagation has converged."""
        return bool(np.isfinite(self.evidence))


@dataclass(frozen=True, eq=False)
class Boxes:
    """Lower and upper bounds of the position of one encoder, given by its counts.

    y : counts, shape (m M,).
    measured : samples that have a count, ascending.
    sites : samples whose bounds are used, ascending.
    low, high : bounds at the sites, steps.
    rest : precision of missing samples, shape (m M,).
    """

    basis: Basis
    y: Array
    measured: Array
    sites: Array
    low: Array
    high: Array
    rest: Array

    @np.errstate(divide="ignore", invalid="ignore")  # sites that do not settle
    def posterior(self, errors: Errors, c: Array, density: Array, t: Array, u: Array) -> Posterior:
        """Estimate the motion by expectation propagation, for given errors of the counts.

        The iteration starts from the coefficients c and the sites (t, u), which are precision and
        precision times mean, and stops when the sites no longer change.
        """
        basis, gaps = self.basis, np.flatnonzero(self.rest)
        tau, pull = self.rest.copy(), np.zeros(len(self.rest))
        x, change, damping = basis.at_samples(c), np.inf, DAMPING
        for _ in range(PASSES):
            tau[self.sites], pull[self.sites] = t, u - t * x[self.sites]
            pull[gaps] = -self.rest[gaps] * x[gaps]
            factor = Factor.of(basis.precision(tau, density))
            c = c + factor.solve(basis.gradient(pull, density, c))
            Z, x = factor.inverse(), basis.at_samples(c)
            mean, v = x[self.sites], basis.variances(Z)[self.sites]
            cavity = 1 / np.maximum(1 / v - t, CAVITY / v)
            m, speed = cavity * (mean / v - u), basis.at_samples(c, 1)[self.sites] * basis.Ts
            mass, t_new, u_new = self._tilted(m, cavity, errors.variance(speed))
            used, density = density, jerk_density(basis, c, Z, density)
            before, change = change, np.abs(t_new - t).sum() / t.sum()
            if change < CHANGE or not np.isfinite(change):
                break
            if change > SLOWER * before:
                damping = max(DAMPING * damping, LEAST_DAMPING)
            t, u = t + damping * (t_new - t), u + damping * (u_new - u)
        factors = mass + 0.5 * np.log1p(t * cavity)
        factors -= 0.5 * (cavity * u**2 + 2 * u * m - t * m**2) / (1 + t * cavity)
        evidence = factors.sum() + 0.5 * u @ mean
        evidence -= 0.5 * (factor.log_determinant + np.log(used).sum())
        evidence -= 2.5 * basis.M * np.log(basis.h)
        free = ((1 / v - t > CAVITY / v) | (v > CAVITY)).all()
        settled = change < CHANGE and free and np.isfinite(evidence)
        likely = float(evidence) if settled else -np.inf
        without = np.array([m, cavity, speed])
        return Posterior(c, used, t, u, Z, factor, errors, likely, without)

    def again(self, errors: Errors, start: Posterior) -> Posterior:
        """Estimate the motion with other assumed count errors; begin with the motion `start`."""
        return self.posterior(errors, start.c, start.density, start.tau, start.nu)

    def promised(self, errors: Errors, read: Posterior) -> float:
        """Predict how much other assumed errors raise the log likelihood of the counts. The
        prediction is of first order.

        To this order, settled sites need no change. Only some of the sites are used in the sum.
        """
        some = slice(None, None, 1 + 2 * (len(self.sites) // (2 * TELLING)))  # odd: they are pairs
        boxes = replace(self, low=self.low[some], high=self.high[some])
        m, v, speed = read.without[:, some]
        mass, own = (boxes._tilted(m, v, e.variance(speed))[0] for e in (errors, read.errors))
        return float(np.mean(mass - own) * len(self.sites))

    def agrees(self, read: Posterior) -> bool:
        """Whether the estimation has converged and the motion agrees with every count.

        A distance of six standard deviations from an interval is allowed (`FAR`).
        """
        x, v = self.basis.at_samples(read.c), self.basis.variances(read.Z)
        e2 = read.errors.variance(self.basis.at_samples(read.c, 1) * self.basis.Ts)
        outside = np.abs(x - self.y)[self.measured] - 0.5
        near = outside < FAR * np.sqrt((np.maximum(v, 0) + e2)[self.measured])
        return read.settled and bool(near.all())

    def suspects(self, read: Posterior) -> Array:
        """Find the samples at which the counts may jump, for instance because counts were lost.

        The result is the sample with the largest density of the jerk, and the middles of the
        windows of time whose counts the other windows predict worst (`SUSPECTS` windows).
        """
        m, v, speed = read.without
        off = (m - (self.low + self.high) / 2) ** 2 / (v + read.errors.variance(speed) + 1 / 12)
        length = max(1, round(WINDOW / self.basis.Ts))
        surprise = np.bincount(self.sites // length, off - 1)
        worst = np.argsort(surprise)[-SUSPECTS:] * length + length // 2
        return np.append(worst, np.argmax(read.density) * self.basis.m)[::-1]

    def around(self, middle: int, read: Posterior) -> tuple[int, Boxes, Posterior]:
        """Estimate the motion again, only from the samples near the sample `middle`.

        The samples near it are those up to `BESIDE` samples away. Returns the first sample of this
        part, its bounds and its motion.
        """
        m, end = self.basis.m, min(middle + BESIDE, self.basis.N)
        first = max(0, middle - BESIDE) // m
        begin = first * m
        basis = Basis(end - begin, m, self.basis.Ts)
        own = slice(*np.searchsorted(self.sites, (begin, end)))
        y, rest = (x[begin : begin + basis.M * m] for x in (self.y, self.rest))
        measured = self.measured[(self.measured >= begin) & (self.measured < end)] - begin
        bounds = self.sites[own] - begin, self.low[own], self.high[own]
        c, density = read.c[first:][: basis.P], read.density[first:][: basis.M]
        boxes = Boxes(basis, y, measured, *bounds, rest)
        sites = read.tau[own], read.nu[own]
        return begin, boxes, boxes.posterior(read.errors, c, density, *sites)

    def jump(self, near: int, read: Posterior) -> tuple[int, float, float]:
        """Find the sample at which a jump of the counts is most likely, near sample number `near`.

        From this sample on, all counts are wrong by a constant.

        Returns the sample, the error in counts, and the rise of the log posterior if the error is
        corrected. The slope of the log posterior by the error is g = sum (nu - tau x) over the
        later sites, its curvature sum tau - (B tau)' A^-1 (B tau).
        """
        away = np.abs(self.sites - near)
        at = np.flatnonzero((away - away.min()) * self.basis.Ts < WINDOW)
        pull = read.nu - read.tau * self.basis.at_samples(read.c)[self.sites]
        weighted = diags_array(read.tau[at[0] :]) @ self.basis.rows(self.sites[at[0] :])
        own, rest = weighted[: len(at)].toarray(), weighted[len(at) :].sum(axis=0)
        B = np.cumsum(own[::-1], axis=0)[::-1] + rest
        g, tau = (np.cumsum(x[::-1])[::-1][at] for x in (pull, read.tau))
        curvature = tau - np.einsum("ij,ji->i", B, read.factor.solve(B.T))
        number = g / np.maximum(curvature, 1e-9)
        best = int(np.argmax(g * number))
        return int(self.sites[at[best]]), float(number[best]), float(0.5 * g[best] * number[best])

    def later(self, at: int, counts: int, read: Posterior) -> tuple[Boxes, Posterior]:
        """Add the number `counts` to all counts from sample `at` on, and estimate the motion again.

        Returns the new bounds and the motion.
        """
        moved = np.where(self.sites >= at, counts, 0)
        boxes = replace(self, low=self.low + moved, high=self.high + moved)
        nu = read.nu + read.tau * moved
        return boxes, boxes.posterior(read.errors, read.c, read.density, read.tau, nu)

    def _tilted(self, m: Array, v: Array, e2: Array) -> tuple[Array, Array, Array]:
        """Compute, for each sample, a normal distribution (site) in place of its position bounds.

        The other samples give the position m and its variance v. Returns the logarithm of the mass
        of the tilted law, and the precision and precision times mean of the new site.
        """
        s = np.sqrt(v + e2)
        a, b = (self.low - m) / s, (self.high - m) / s
        near = np.flatnonzero(np.minimum(-a, b) < FAR)
        mass, g, H = np.zeros((3, len(s)))
        mass[near], g[near], H[near] = box_moments(a[near], b[near])
        g, H = g / s, H / s**2
        left = 1 - v * H
        return mass, H / left, (g + H * m) / left


def of_most_evidence(
    boxes: Boxes, sizes: Sequence[float], start: Posterior, moves: Sequence[tuple[int, int]] = MOVES
) -> Posterior:
    """Find the most likely size of count and time-stamp errors, and estimate the motion with it.

    The search starts from `start` and changes the errors by one element of `sizes` or of the clock
    errors (`CLOCK_ERRORS`) at a time, in the directions `moves`, as long as the evidence clearly
    rises.
    """
    best, place = start, (sizes.index(start.errors.count), CLOCK_ERRORS.index(start.errors.time))
    tried = {place}
    for move in moves:
        while (to := (place[0] + move[0], place[1] + move[1])) not in tried:
            tried.add(to)
            if not (0 <= to[0] < len(sizes) and 0 <= to[1] < len(CLOCK_ERRORS)):
                break
            errors = Errors(sizes[to[0]], CLOCK_ERRORS[to[1]])
            if boxes.promised(errors, best) < -CLEAR:
                break
            read = boxes.again(errors, best)
            if not read.evidence > best.evidence + CLEAR:
                break
            place, best = to, read
    return best


def box_moments(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Compute the log probability of a <= x <= b for a normal x, and its derivatives by the mean.

    The variance of x is 1. Returns log Z, g = d log Z/dm and H = -d^2 log Z/dm^2 at the mean m = 0,
    with Z = Phi(b) - Phi(a). One of the bounds must be within a few standard deviations of zero.
    """
    middle, half = np.abs(a + b) / 2, (b - a) / 2  # the side that is nearer to the mean first
    low, high = middle - half, middle + half
    ratio = np.exp(-2 * half * middle)
    inside = erfcx(low / np.sqrt(2)) - ratio * erfcx(high / np.sqrt(2))
    at_low = np.sqrt(2 / np.pi) / inside
    at_high = at_low * ratio
    g = at_low - at_high
    H = np.clip(g * g + high * at_high - low * at_low, 0, 1 - 1e-9)
    return np.log(inside / 2) - low**2 / 2, np.copysign(g, a + b), H


def jerk_density(basis: Basis, c: Array, Z: Array, density: Array) -> Array:
    """Estimate the spectral density of the jerk around each of the M intervals of the spline.

    The estimate follows MacKay's rule. In every window, the whole record counts as much as a fixed
    number of determined jerks (`OF_RECORD`).
    """
    squares, determined = (
        basis.jerk(c) ** 2 * basis.h,
        np.maximum(1 - basis.jerk_variances(Z) * basis.h / density, 1e-9),
    )
    whole = squares.mean() / determined.mean()
    size = max(1, round(WINDOW / basis.h))
    squares, determined = (
        size * uniform_filter1d(x, size, mode="nearest") for x in (squares, determined)
    )
    least = max(RANGE * whole, basis.least_density)
    return np.asarray(np.maximum((squares + OF_RECORD * whole) / (determined + OF_RECORD), least))
