"""Estimation of a motion from encoder counts, each of which bounds the position at one sample.

    lo_k <= x(t_k) <= hi_k,   lo_k = count_k - 1/2, hi_k = count_k + 1/2
                              in steps of the encoder; at every sample

The prior of the motion is a white jerk; expectation propagation computes the posterior, in the same
way at all speeds. A site is a sample whose bounds are used; a normal law replaces the bounds. The
first sites come from the changes of the count: two neighbouring intervals give the position (k +
1/2) with the error qd Ts/sqrt(12). `runtime.counts.boxes` then updates the sites, and finds the
errors of counts and time stamps. The density of the jerk follows from MacKay's rule: the sum of
squared jerks over the number of jerks that the record determines, in windows of time with the whole
record as prior. Lost counts are found and corrected here.

Reference: MacKay (1992), evidence; docs/theory/counts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from runtime.counts.boxes import (
    CLEAR,
    CLOCK_ERRORS,
    COUNT_ERRORS,
    Boxes,
    Errors,
    Posterior,
    jerk_density,
    of_most_evidence,
)
from runtime.counts.spline import Basis, Factor, next_density
from runtime.ground.errors import InputError

Array = np.ndarray

KNOTS, RESOLVED, FARTHEST = 2e-3, 0.1, 0.064
"""Least distance of knots, s, or of samples where that is larger; the distance in units of the time
r^(-1/5) in which white jerk of density r crosses an interval; the largest one, s.
"""
LIVELIEST, WIDE = 4096, 0.12
"""Samples of a long record that tell the errors of its counts, and the error of a count from which
the comparison starts, steps.
"""
JUMPS, LIKELIER, LEAST_LOST, MOST_LOST, SPIKE = 8, 30.0, 0.3, 30, 20.0
"""Most jumps of the counts of an encoder; the rise of the evidence, nats, that tells one; the least
number of counts, to second order, that one is looked for by, and the largest; the density of the
jerk over its mean that is none of a motion: up to 11 on the measured TX40, 220 at a jump unseen.
"""
LEAP, NEIGHBOURS = 5.0, 10
"""A change of the count so many times as far off the parabola through those of so many samples on
either side as these are, or as half a count, is none of a motion.
"""
# Bounds from which an error of the counts is told: fewer do not tell it from an unusual motion.
FEWEST = 150
# Nats by which errors are more likely than the least ones before they are taken: a slow motion
# departs from white jerk by up to 36, counts that are off do not settle without them.
UNEVEN = 40.0
FIRST, SETTLED, FIRST_DENSITY = 30, 0.1, 1e8
"""Most passes over the changes alone, ahead of those over the sites; the relative change of the
jerk density at which they end; the density that they start from, above any that a record asks for,
ranges of the counts^2/s^5.
"""
# Deviation of a missing sample, ranges of the counts: as good as none, but the precision of a long
# gap remains one that Cholesky factors.
GAP = 10.0
# Distance of bounds inside an interval, in units of the time r^(-1/5) in which white jerk of
# density r crosses it.
SPACING = 0.3


class SearchStart(NamedTuple):
    """Starting values to estimate the same motion again with other encoder offsets (phases).

    errors : errors of the counts.
    m : samples from knot to knot of the spline.
    density : density of the jerk, steps^2/s^5, shape (M,).
    """

    errors: Errors
    m: int
    density: Array


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The motion of one encoder, estimated from its counts, in steps from the count `origin`.

    said : sentence about the errors of the counts, which may be empty.
    """

    basis: Basis
    read: Posterior
    origin: float
    said: str

    def state(self, order: int) -> tuple[Array, Array]:
        """Return the mean and standard deviation of the position, or of a derivative.

        `order` is the order of the derivative, 0 for the position; both results have the shape
        (N,).
        """
        N = self.basis.N
        mean = self.basis.at_samples(self.read.c, order)[:N]
        variance = self.basis.variances(self.read.Z, order)[:N]
        return mean + self.origin * (order == 0), np.sqrt(np.maximum(variance, 0))

    def draw(self, rng: np.random.Generator) -> Array:
        """Draw random positions from their posterior distribution, shape (N,)."""
        drawn = self.basis.at_samples(self.read.c + self.read.factor.draw(rng))
        return np.asarray(drawn[: self.basis.N] + self.origin)


def smoothed(
    counts: Array, Ts: float, *, uneven: float | None = None, start: SearchStart | None = None
) -> Smoothed:
    """Estimate the motion of one encoder from its counts, shape (N,); nan if a sample is missing.

    uneven : standard deviation of the encoder lines from even spacing, in steps, used as a lower
      limit; None: the deviation is estimated.
    start : result for the same motion at another phase, from which the search starts; default: a
        global search.

    Raises InputError if no motion agrees with the counts.
    """
    known = np.flatnonzero(np.isfinite(counts))
    origin = float(np.round(counts[known].mean()))
    y, rest = np.zeros((2, len(counts)))
    y[known] = counts[known] - origin
    rest[:] = (GAP * (np.ptp(y) + 1)) ** -2  # precision of missing samples
    rest[known] = 0
    given = Counts(y, known, rest, Ts)
    sizes: tuple[float, ...] = COUNT_ERRORS
    if uneven is not None:
        sizes = (max(uneven, COUNT_ERRORS[0]), *(x for x in COUNT_ERRORS if x > uneven))
    jumps = given.leaps()
    for leap in jumps:
        given = given.without(*leap)
    boxes, read = given.read(sizes, start)
    while len(jumps) < JUMPS and (jump := given.jump(boxes, read)):
        jumps.append(jump)
        given = given.without(*jump)
        boxes, read = given.read(sizes, start)
    said = [
        f"counts jump by {by} at {at * Ts:.4g} s, as if counts were lost; symgen removed the jump"
        for at, by in jumps
    ]
    said += _error_notes(read.errors, sizes[0], len(boxes.sites))
    return Smoothed(boxes.basis, read, origin, "; ".join(said))


@dataclass(frozen=True, eq=False)
class Counts:
    """Counts y of one encoder, shape (N,); some samples may have no count.

    `measured` lists the samples with a count; `rest` is the small precision given to the other
    samples.
    """

    y: Array
    measured: Array
    rest: Array
    Ts: float

    def read(
        self, sizes: Sequence[float], start: SearchStart | None = None
    ) -> tuple[Boxes, Posterior]:
        """Estimate the motion from the counts, and check that it agrees with every count.

        The most likely errors of the counts are estimated too: from the part of a long record in
        which the count changes most often, or from the errors in `start`. If the motion does not
        agree with every count, larger errors are tried. Raises InputError if no motion agrees with
        the counts.
        """
        start = start if start and start.errors.count in sizes else None
        if start or len(self.y) > 4 * LIVELIEST:
            boxes, read = self.first(
                start.errors if start else self.liveliest().searched(sizes)[1].errors, start
            )
            if read.settled:
                read = of_most_evidence(boxes, sizes, read, moves=[(1, 0)])
            if boxes.agrees(read):
                return boxes, read
        boxes, read = self.searched(sizes)
        for count in (x for x in sizes if x > read.errors.count):
            if boxes.agrees(read):
                break
            boxes, read = self.first(replace(read.errors, count=count))
        if not boxes.agrees(read):
            raise InputError(
                f"no motion fits the counts, even with errors of {sizes[-1]:g} steps; "
                "use the low-pass instead (signals: {reader: lowpass})"
            )
        return boxes, read

    def liveliest(self) -> Counts:
        """Extract the consecutive samples (at most `LIVELIEST`) in which the count changes most
        often.
        """
        changed = np.zeros(len(self.y))
        changed[self.measured[1:]] = np.diff(self.y[self.measured]) != 0
        total = np.cumsum(changed)
        begin = int(np.argmax(total[LIVELIEST:] - total[:-LIVELIEST])) + 1
        part, inside = slice(begin, begin + LIVELIEST), self.measured - begin
        inside = inside[(inside >= 0) & (inside < LIVELIEST)]
        return Counts(self.y[part], inside, self.rest[part], self.Ts)

    def searched(self, sizes: Sequence[float]) -> tuple[Boxes, Posterior]:
        """Estimate the motion, and the sizes of the count errors that make the counts most likely.

        The smallest errors are used unless the evidence of larger errors is at least 40 nats higher
        (`UNEVEN`). If the errors of the counts are large, errors of the clock are tried too.
        """
        wide = max((x for x in sizes if x <= WIDE), default=sizes[0])
        boxes, read = self.first(Errors(wide))
        if read.settled:
            read = of_most_evidence(boxes, sizes, read)
        if not read.settled or read.errors.count > wide:
            others = [self.first(Errors(wide, CLOCK_ERRORS[-2])), self.first(Errors(sizes[-1]))]
            found = [(b, of_most_evidence(b, sizes, r)) for b, r in others if r.settled]
            boxes, read = max([(boxes, read), *found], key=lambda each: each[1].evidence)
        least = Errors(sizes[0])
        if read.settled and read.errors != least and boxes.promised(least, read) > -2 * UNEVEN:
            even = boxes.again(least, read)
            read = even if even.evidence > read.evidence - UNEVEN else read
        return boxes, read

    def first(self, errors: Errors, start: SearchStart | None = None) -> tuple[Boxes, Posterior]:
        """Set up the bounds of the positions, and estimate a first motion for given count errors.

        The knots of the spline are as far apart as a motion near the changes of the count allows.
        start : a known motion, whose knots and density of the jerk are used.
        """
        N, least = len(self.y), max(1, round(KNOTS / self.Ts))
        basis = Basis(N, start.m if start else least, self.Ts)
        tau, nu = self.from_changes(errors)
        if start:
            density = start.density
            c, _ = _through(basis, basis.filled(tau), basis.filled(nu), density, np.zeros(basis.P))
        else:
            c, density = _spline_through_sites(
                basis, tau, nu, (np.ptp(self.y) + 1) ** 2 * FIRST_DENSITY
            )
            h = np.clip(RESOLVED * density.max() ** -0.2, KNOTS, FARTHEST)
            if (m := max(1, round(h / self.Ts))) > least:
                basis = Basis(N, m, self.Ts)
                c, density = _spline_through_sites(basis, tau, nu, float(density.max()))
        sites = self.sites(density.mean())
        bounds = self.y[sites] - 0.5, self.y[sites] + 0.5
        y, rest = basis.filled(self.y), basis.filled(self.rest)
        boxes = Boxes(basis, y, self.measured, sites, *bounds, rest)
        return boxes, boxes.posterior(errors, c, density, tau[sites], nu[sites])

    def sites(self, density: float) -> Array:
        """Choose the samples whose bounds are used (the sites), in ascending order.

        The sites are the samples on both sides of every change of the count and of every gap, and
        some samples between them. Bounds of samples close together are not independent, so that
        only one of several close samples is used.
        """
        known = self.measured
        change = np.flatnonzero((np.diff(self.y[known]) != 0) | (np.diff(known) > 1))
        ends = np.concatenate([[0], np.repeat(change, 2), [len(known) - 1]]).reshape(-1, 2)
        ends[1:, 0] += 1
        length = ends[:, 1] - ends[:, 0]
        parts = (length * self.Ts / (SPACING * density**-0.2)).astype(int)  # between two changes
        which = np.repeat(np.arange(len(ends)), parts)
        number = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
        between = ends[which, 0] + number * (length / np.maximum(parts, 1))[which]
        return np.asarray(known[np.unique(np.concatenate([ends.ravel(), between.astype(int)]))])

    def from_changes(self, errors: Errors) -> tuple[Array, Array]:
        """Estimate positions from the changes of the count alone, as a first estimate.

        Returns, for every sample, the precision and its product with the mean. The two samples
        around a change have the most precision; other samples have little, missing samples `rest`.
        A change across a long gap (more than `KNOTS`) is not used.
        """
        y, known, near = self.y, self.measured, max(1, round(KNOTS / self.Ts))
        tau = self.rest.copy()
        tau[known] = 0.06
        nu = tau * y
        e = np.flatnonzero((np.diff(y[known]) != 0) & (np.diff(known) <= near + 1))
        if len(e) < 2:
            return tau, nu
        before, after = known[e], known[e + 1]
        t, line = (before + after) / 2, (y[before] + y[after]) / 2
        slope = np.diff(line) / np.diff(t)  # steps a sample, from change to change
        slopes = np.array([np.append(slope[:1], slope), np.append(slope, slope[-1:])])
        speed = slopes.mean(axis=0)
        time = np.clip(np.abs(slopes).max(axis=0) * (after - before), 0.02, 1)
        weight = 6 / (time**2 + 12 * errors.variance(speed))
        for samples in (before, after):
            np.add.at(tau, samples, weight)
            np.add.at(nu, samples, weight * (line + (samples - t) * speed))
        return tau, nu

    def without(self, at: int, jump: int) -> Counts:
        """Return the counts with a jump of `jump` counts at sample `at` removed."""
        y = self.y.copy()
        y[self.measured[self.measured >= at]] -= jump
        return replace(self, y=y)

    def leaps(self) -> list[tuple[int, int]]:
        """Find single changes of the count that are too large for a smooth motion of the encoder.

        Returns the sample and the number of counts of each change. Such a change differs much more
        (`LEAP` times) from the parabola through its neighbours than the neighbours do.
        """
        y, known = self.y, self.measured
        change = np.diff(y[known])
        bent = np.abs(change[1:-1] - (change[2:] + change[:-2]) / 2) > LEAP / 2
        bent &= np.diff(known)[1:-1] == 1  # across a gap any change is one of a motion
        at = 1 + np.flatnonzero(bent)
        place = np.delete(np.arange(-NEIGHBOURS, NEIGHBOURS + 1), NEIGHBOURS)
        parabola = np.linalg.pinv(np.vander(place, 3)).T @ np.vander([*place, 0], 3).T
        beside = np.pad(change, NEIGHBOURS, mode="reflect")[at[:, None] + NEIGHBOURS + place]
        smooth = beside @ parabola
        off, others = change[at] - smooth[:, -1], np.abs(beside - smooth[:, :-1]).max(axis=1)
        leap = np.flatnonzero(np.abs(off) > LEAP * np.maximum(others, 0.5))[:JUMPS]
        return [(int(known[at[i] + 1]), round(off[i])) for i in leap]

    def jump(self, boxes: Boxes, read: Posterior) -> tuple[int, int] | None:
        """Find a jump of the counts that a smooth motion does not explain, such as lost counts.

        Returns the sample and the number of counts, or None. Without the jump, the record around it
        must be clearly more likely (by `LIKELIER` nats). No search is made if the errors of the
        counts have their smallest value and the jerk has no high peak (above `SPIKE` times its mean
        density).
        """
        spikes = read.density.max() > SPIKE * read.density.mean()
        if len(boxes.sites) < FEWEST or not (spikes or read.errors.count > COUNT_ERRORS[0]):
            return None
        for middle in boxes.suspects(read):
            begin, there, alone = boxes.around(int(middle), read)
            at, number, gain = there.jump(int(middle) - begin, alone)
            if not (gain > LIKELIER / 6 and abs(number) > LEAST_LOST):
                continue
            jump, likely, least = 0, alone.evidence + LIKELIER, max(1, round(abs(number)))
            for lost in range(least, MOST_LOST + 1):
                trial = lost if number > 0 else -lost
                bounds, without = there.later(at, jump - trial, alone)
                if without.evidence > likely + CLEAR:
                    there, alone, likely, jump = bounds, without, without.evidence, trial
                elif jump or lost > least + 1:
                    break
            if jump:
                return begin + at, jump
        return None


def _error_notes(errors: Errors, least: float, sites: int) -> list[str]:
    """Write a sentence for errors of counts and one for errors of time stamps, if not negligible.

    No sentence if there are too few sites.
    """
    said = []
    if errors.count > least and sites > FEWEST:
        said.append(
            f"counts are off by {errors.count:g} steps (rms) in addition to rounding, from uneven "
            "lines or noise; bounds and standard deviations are widened"
        )
    if errors.time > CLOCK_ERRORS[0] and sites > FEWEST:
        said.append(
            f"time stamps are off by {errors.time:g} periods (rms); bounds and standard deviations "
            "are widened where the joint is fast"
        )
    return said


def _spline_through_sites(
    basis: Basis, tau: Array, nu: Array, density: float
) -> tuple[Array, Array]:
    """Fit a spline to positions with Gaussian errors, and estimate the density of its white jerk.

    Returns the coefficients and the density, shape (M,), which starts from `density` and is updated
    a few times (at most `FIRST`).
    """
    tau, nu, ones = basis.filled(tau), basis.filled(nu), np.ones(basis.M)
    samples, unit, c = basis.of_samples(tau), basis.of_prior(ones), np.zeros(basis.P)
    g = basis.gradient(nu, ones, c)
    for _ in range(FIRST):
        before, density = density, next_density(basis, samples, unit, g, density)
        if abs(density / before - 1) < SETTLED:
            break
    of_windows = np.repeat(density, basis.M)
    for _ in range(2):
        c, factor = _through(basis, tau, nu, of_windows, c)
        of_windows = jerk_density(basis, c, factor.inverse(), of_windows)
    return c, of_windows


def _through(basis: Basis, tau: Array, nu: Array, density: Array, c: Array) -> tuple[Array, Factor]:
    """Fit a spline to positions with Gaussian errors, starting from given spline coefficients c.

    tau and nu, shape (m M,), are the precisions and the precisions times means. Returns the
    coefficients and the Cholesky factor of their precision.
    """
    factor = Factor.of(basis.precision(tau, density))
    for _ in range(2):
        c = c + factor.solve(basis.gradient(nu - tau * basis.at_samples(c), density, c))
    return c, factor
