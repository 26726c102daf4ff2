"""A motion between the bounds that counts are: expectation propagation under a white-jerk prior, one law for all speeds.

    lo_k <= x(t_k) <= hi_k,   lo_k = count_k - 1/2, hi_k = count_k + 1/2
                              in steps of the encoder; at every sample

A change of the count is what two neighbouring intervals say together. Sites start from the changes
(position (k + 1/2), error qd Ts/sqrt(12)); `runtime.counts.boxes` then updates them, and
judges the errors that counts and time stamps have. The jerk density is the fixed point of MacKay's
rule, the sum of squared jerks over the number of jerks that the record determines, in windows of
time with the whole record as prior. Counts that were lost are found and taken out here.

Reference: MacKay (1992), evidence; docs/theory/counts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from runtime.core.errors import InputError
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
    """Start of the search for a known motion with another phase of its encoder.

    errors : of the counts.
    m : samples from knot to knot.
    density : of the jerk, steps^2/s^5, shape (M,).
    """

    errors: Errors
    m: int
    density: Array


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Posterior of one encoder, in steps, about `origin`.

    said : a sentence about the errors of its counts, or none.
    """

    basis: Basis
    read: Posterior
    origin: float
    said: str

    @property
    def density(self) -> float:
        """Mean density of the jerk, steps^2/s^5."""
        return float(self.read.density.mean())

    def state(self, order: int) -> tuple[Array, Array]:
        """Mean and deviation of the position, or of its derivative of that order, shape (N,) each."""
        N = self.basis.N
        mean = self.basis.at_samples(self.read.c, order)[:N]
        variance = self.basis.variances(self.read.Z, order)[:N]
        return mean + self.origin * (order == 0), np.sqrt(np.maximum(variance, 0))

    def draw(self, rng: np.random.Generator) -> Array:
        """Positions drawn from the posterior, shape (N,)."""
        drawn = self.basis.at_samples(self.read.c + self.read.factor.draw(rng))
        return np.asarray(drawn[: self.basis.N] + self.origin)


def smoothed(
    counts: Array, Ts: float, *, uneven: float | None = None, start: SearchStart | None = None
) -> Smoothed:
    """Posterior of the counts of one encoder, shape (N,); nan: a sample that is missing.

    uneven : deviation of the lines in steps, less than which is not taken; None: it is detected.
    start : what the same motion told at another phase; default: all is sought.

    InputError if no motion goes with the counts.
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
        f"counts jump by {by} at {at * Ts:.4g} s, as if some were lost; taken out"
        for at, by in jumps
    ]
    said += _error_notes(read.errors, sizes[0], len(boxes.sites))
    return Smoothed(boxes.basis, read, origin, "; ".join(said))


@dataclass(frozen=True, eq=False)
class Counts:
    """Counts of one encoder: y, shape (N,), at the samples `measured`, and the precision `rest` of the other samples."""

    y: Array
    measured: Array
    rest: Array
    Ts: float

    def read(
        self, sizes: Sequence[float], start: SearchStart | None = None
    ) -> tuple[Boxes, Posterior]:
        """The motion between the bounds, with the errors of most evidence, or wider ones with which it agrees with every count.
        Errors of a long record are those of its liveliest part, those of a motion read before are
        known, or they are wider ones that make the whole more likely.
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
                f"no motion goes with the counts, even if each were off by {sizes[-1]:g} steps; "
                "read them by the low-pass (signals: reader: lowpass)"
            )
        return boxes, read

    def liveliest(self) -> Counts:
        """The LIVELIEST consecutive samples with the most changes of the count."""
        changed = np.zeros(len(self.y))
        changed[self.measured[1:]] = np.diff(self.y[self.measured]) != 0
        total = np.cumsum(changed)
        begin = int(np.argmax(total[LIVELIEST:] - total[:-LIVELIEST])) + 1
        part, inside = slice(begin, begin + LIVELIEST), self.measured - begin
        inside = inside[(inside >= 0) & (inside < LIVELIEST)]
        return Counts(self.y[part], inside, self.rest[part], self.Ts)

    def searched(self, sizes: Sequence[float]) -> tuple[Boxes, Posterior]:
        """The motion with the errors of most evidence.

        The smallest errors are taken unless those have UNEVEN nats more.

        A jittering clock is thought of where errors are wide.
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
        """Bounds of the counts with these errors, and the motion between them.

        Knots are as far apart as the motion allows that passes near the changes.
        start : of a motion read before, with whose knots and density of the jerk it begins.
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
        """Choose the samples whose bounds count.

        These are both sides of every change and gap, and samples between them, as often as the
        motion forgets.

        ascending.

        Bounds of samples close together are one bound. Taken as many, each would see the others as
        independent knowledge.
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
        """First sites, precision and its product with the mean: at the two samples around a change of the count, at most KNOTS of missing samples apart.

        A hundredth of an interval at every other sample, `rest` where it is missing.
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
        """The counts without a jump at a sample."""
        y = self.y.copy()
        y[self.measured[self.measured >= at]] -= jump
        return replace(self, y=y)

    def leaps(self) -> list[tuple[int, int]]:
        """Samples at which a change of the count is off the parabola through its neighbours by LEAP times what these are, and by how many counts."""
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
        """Sample at which counts jump, and by how many, if the record around it is more likely without by LIKELIER nats.

        Not asked where counts have the least errors and the jerk is nowhere SPIKE times as dense as
        in the mean.
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
    """Sentences about errors besides rounding; none if these are the smallest, or sites are too few."""
    said = []
    if errors.count > least and sites > FEWEST:
        said.append(
            f"counts are off by {errors.count:g} steps (rms) beside their rounding, by uneven "
            "lines or noise; bounds and stated deviations are widened"
        )
    if errors.time > CLOCK_ERRORS[0] and sites > FEWEST:
        said.append(
            f"time stamps are off by {errors.time:g} periods (rms); bounds and stated deviations "
            "are widened where the joint is fast"
        )
    return said


def _spline_through_sites(
    basis: Basis, tau: Array, nu: Array, density: float
) -> tuple[Array, Array]:
    """The spline through Gaussian sites, and the jerk density that goes with it, shape (M,), after at most FIRST passes from `density`."""
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
    """The spline through Gaussian sites, shape (m M,) each, corrected once, and the factor of its precision.

    c : one near it.
    """
    factor = Factor.of(basis.precision(tau, density))
    for _ in range(2):
        c = c + factor.solve(basis.gradient(nu - tau * basis.at_samples(c), density, c))
    return c, factor
