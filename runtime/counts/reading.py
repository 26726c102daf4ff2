"""Positions, velocities and accelerations from encoder counts, with standard deviations.

    reading = read_counts(position, rate, step)        encoder side, shape (N, n)
    reading.q, reading.s_q, reading.findings

The theory is in docs/theory/counts.md. Long records are processed in stretches (of `STRETCH`
samples) that overlap on either side (by `MARGIN` samples), so that memory and time are proportional
to the length of the record. A missing sample follows from its neighbours by the posterior. In a gap
in which the posterior does not determine the position to half a step, the state is unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_opening, binary_propagation, maximum_filter1d

from runtime.counts.lattice import SHAKEN, Lattice, shaken_share, to_and_fro, unwrapped_counts
from runtime.counts.sites import SearchStart, Smoothed, smoothed

Array = np.ndarray
# By the first sample of a stretch, and the encoder, from 0.
Starts = Mapping[tuple[int, int], SearchStart]

STRETCH, MARGIN = 65536, 4096
# Error of a line where the motion shakes, steps: a change of the count then says as much as the
# count itself, a position within one step.
ANYWHERE = 12**-0.5
# Time ahead of a count that goes to and fro and behind it in which both directions occur, s: a
# quarter of a period of usual cut-offs.
TURNED = 4e-3
# Deviation of a missing position, steps, above which the state is unknown in the whole gap: the
# bound that a count would be.
UNKNOWN = 0.5
# Time ahead of an unknown state and behind it that filters bring it to, s: a period of usual
# cut-offs.
REACH = 0.02
# Longest gap, s, in which an encoder whose count never changes is taken as at rest.
RESTS = 0.05
# Time without a change of the count in which a joint may stand, s, and how many times the longest
# turn between two lines at its usual acceleration a it must be, sqrt(8/a): no direction is known
# there.
STANDS, LONG = 0.1, 2.0


@dataclass(frozen=True, eq=False)
class Reading:
    """The motion of the encoders of one record, estimated from their counts.

    All arrays have shape (N, n), in rad or m, per s, per s^2.

    Attributes
    ----------
    q, qd, qdd : ndarray, shape (N, n)
        Means of the posterior.
    s_q, s_qd, s_qdd : ndarray, shape (N, n)
        Standard deviations of the posterior.
    unknown : ndarray of bool, shape (N, n)
        Gaps in which the neighbouring counts do not determine the state, and the samples near these
        gaps that the filters spoil.
    step, phase : ndarray, shape (n,), rad or m
        Lattice of the encoders.
    findings : tuple of str
        Properties of the encoders that the record shows, one sentence each.
    """

    q: Array
    qd: Array
    qdd: Array
    s_q: Array
    s_qd: Array
    s_qdd: Array
    unknown: Array
    step: Array
    phase: Array
    findings: tuple[str, ...]
    parts: tuple[Part, ...]

    @property
    def motion(self) -> tuple[Array, Array]:
        """Encoder positions, rad or m, and standard deviations of the velocities, (N, n) each.

        The standard deviations are infinite if the state is unknown.
        """
        return self.q, np.where(self.unknown, np.inf, self.s_qd)

    @property
    def starts(self) -> Starts:
        """Starting values to estimate the same motion again with other encoder offsets (phases).

        The key of a value is the first sample of its stretch and the number of its encoder, from 0.
        """
        return {
            (part.begin, j): SearchStart(each.read.errors, each.basis.m, each.read.density)
            for part in self.parts
            for j, each in zip(part.moving.tolist(), part.smoothed, strict=True)
        }

    def draw(self, rng: np.random.Generator) -> Array:
        """Draw random positions from their posterior distribution, shape (N, n), rad or m."""
        x = np.array(self.q)
        for part in self.parts:
            drawn = np.stack([each.draw(rng) for each in part.smoothed], axis=1)
            drawn = drawn * self.step[part.moving] + self.phase[part.moving]
            head = max(
                part.first - part.begin, 0
            )  # samples shared with the stretch before: from one draw to the next
            w = np.ones(len(drawn))
            if head:
                w[:head], w[head : 2 * head] = 0.0, np.linspace(0, 1, len(w[head : 2 * head]))
            at = np.ix_(np.arange(part.begin, part.begin + len(drawn)), part.moving)
            x[at] += w[:, None] * (drawn - x[at])
        return x


@dataclass(frozen=True, eq=False)
class Part:
    """One stretch of a long record, with the estimated motion of the encoders that move in it.

    The stretch starts at sample `begin`; only its samples from `first` on are used in the result.
    `moving` lists the encoders whose counts change.
    """

    smoothed: tuple[Smoothed, ...]
    begin: int
    first: int
    moving: Array

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences about the errors of the counts in this stretch, with the encoder number."""
        return tuple(
            f"encoder {j + 1}: {said}"
            for j, said in zip(self.moving, (each.said for each in self.smoothed), strict=True)
            if said
        )


def read_counts(
    position: Array,
    rate: float,
    step: Array | Sequence[float] | float | None = None,
    *,
    name: str = "record",
    starts: Starts | None = None,
) -> Reading:
    """Estimate positions, velocities and accelerations from encoder counts.

    Parameters
    ----------
    position : ndarray, shape (N, n), rad or m
        Positions at the encoder side: counts times step plus phase; nan if a sample is missing.
    rate : float, Hz
        Sampling rate.
    step : float or ndarray, shape (n,), rad or m, optional
        Step of the encoders; default: from the record.
    name : str
        Name of the record in error messages.
    starts : mapping, optional
        Reading.starts of the same motion at other phases of encoders of the same steps. The errors
        of the counts, the knots and the first density of the jerk are copied from this result,
        which saves three quarters of the time or more. If the counts contradict them, the search
        starts anew.

    Returns
    -------
    Reading
        The motion, with standard deviations.

    Raises
    ------
    InputError
        If no count changes, a step is not positive or larger than the motion, positions are off the
        lattice, or counts jump.
    """
    known, counts, wraps = unwrapped_counts(position, step, name=name)
    return _reading(counts, rate, known, wraps, starts or {})


def _reading(
    counts: Array,
    rate: float,
    known: Lattice,
    said: Sequence[str],
    starts: Starts,
) -> Reading:
    N, n = counts.shape
    states, unknown = [np.empty((N, n)) for _ in range(6)], np.empty((N, n), dtype=bool)
    parts, found, gaps = [], dict.fromkeys((*known.findings, *said)), Gaps(n)
    for begin, first, stop, end in stretches(N):
        kept = slice(first - begin, stop - begin)
        ahead = {j: starts[begin, j] for j in range(n) if (begin, j) in starts}
        part, read, left = read_stretch(counts[begin:end], rate, gaps.rest(counts), ahead)
        unknown[first:stop] = left[kept]
        gaps.update(counts[first:stop], left[kept])
        for x, own in zip(states, read, strict=True):
            x[first:stop] = own[kept]
        if part is not None:
            part = replace(part, begin=begin, first=first)
            parts.append(part)
            found.update(dict.fromkeys(part.findings))
    for i, x in enumerate(states):
        x *= known.step
        if i == 0:
            x += known.phase
    q, qd, qdd, s_q, s_qd, s_qdd = states
    findings = (*found, *gaps.findings(rate))
    return Reading(
        q, qd, qdd, s_q, s_qd, s_qdd, unknown, known.step, known.phase, findings, tuple(parts)
    )


def read_stretch(
    counts: Array,
    rate: float,
    rest: Array,
    starts: Mapping[int, SearchStart] | None = None,
) -> tuple[Part | None, list[Array], Array]:
    """Estimate the motion from the counts of one stretch of a record, shape (N, n).

    Returns the stretch (None if no joint moves), the list [q, qd, qdd, s_q, s_qd, s_qdd] in steps,
    and a mask of the samples with unknown state, shape (N, n) each.

    If the count of an encoder never changes, the joint rests in the middle of its interval; an
    encoder without a count is at `rest`, shape (n,). `starts` holds the starts of the search by
    encoder. If one count goes to and fro, the bounds of all encoders are widened, because the
    joints share a controller, and the directions of motion near such moments are uncertain.
    """
    N, n = counts.shape
    k = np.ascontiguousarray(counts.T)
    least, most = (f.reduce(k, axis=1) for f in (np.fmin, np.fmax))  # nan: no count at all
    moving = np.flatnonzero(most > least)
    states = [np.full((N, n), value) for value in (0.0, 0.0, 0.0, 12**-0.5, 0.0, 0.0)]
    states[0][:] = np.where(np.isfinite(least), least, rest)
    part = _positions_of_counts(k, moving, states, rate, starts or {}) if len(moving) else None
    missing = np.isnan(counts)
    unknown = missing & (states[3] > UNKNOWN)
    for j in np.flatnonzero(missing.any(axis=0)):
        if most[j] > least[j]:
            unknown[:, j] = binary_propagation(unknown[:, j], mask=missing[:, j])
        else:
            unknown[:, j] = binary_opening(missing[:, j], np.ones(round(RESTS * rate) + 2))
    if unknown.any():
        unknown = maximum_filter1d(unknown, 2 * round(REACH * rate) + 1, axis=0)
    return part, states, unknown


def _positions_of_counts(
    k: Array,
    moving: Array,
    states: Sequence[Array],
    rate: float,
    starts: Mapping[int, SearchStart],
) -> Part:
    """Estimate the motion of the encoders that move, from counts k, shape (n, N).

    The columns of the moving encoders are written into `states`.
    """
    N = k.shape[1]
    known = [np.flatnonzero(np.isfinite(k[j])) for j in moving]
    shaken = max(shaken_share(k[j, at]) for j, at in zip(moving, known, strict=True)) > SHAKEN
    uneven = ANYWHERE if shaken else None
    channels = tuple(smoothed(k[j], 1 / rate, uneven=uneven, start=starts.get(j)) for j in moving)
    part = Part(channels, 0, 0, moving)
    for order in range(3):
        for j, each in zip(moving, channels, strict=True):
            states[order][:, j], states[order + 3][:, j] = each.state(order)
    for j, at in zip(moving, known, strict=True):
        between = np.diff(at[1:][np.diff(k[j, at]) != 0], prepend=0, append=N)
        turn = np.sqrt(8 / np.sqrt(np.mean(states[2][:, j] ** 2)))
        turned = np.repeat(between > max(STANDS, LONG * turn) * rate, between)
        for a, b in at[to_and_fro(k[j, at])] if shaken else ():
            turned[max(a - round(TURNED * rate), 0) : b + round(TURNED * rate)] = True
        deviation = 3 * np.abs(
            states[1][turned, j]
        )  # speeds of both signs: their deviation is above their mean
        states[4][turned, j] = np.maximum(states[4][turned, j], deviation)
    return part


class Gaps:
    """Statistics of the missing samples of each encoder: their number and the longest gap."""

    def __init__(self, n: int) -> None:
        self.samples, self.unknown, self.run, self.longest = np.zeros((4, n), dtype=int)
        self.last = np.full(n, np.nan)  # last count known

    def rest(self, counts: Array) -> Array:
        """Return the last known counts of the encoders, shape (n,).

        If an encoder had no count before, its first known count in `counts`, shape (N, n), is used.
        """
        first = counts[np.isfinite(counts).argmax(axis=0), np.arange(counts.shape[1])]
        return np.where(np.isnan(self.last), first, self.last)

    def update(self, counts: Array, unknown: Array) -> None:
        """Update the statistics of missing samples with the next counts of the record.

        Both arrays have shape (B, n); `unknown` marks the samples with unknown state.
        """
        missing = np.isnan(counts)
        self.samples += missing.sum(axis=0)
        self.unknown += unknown.sum(axis=0)
        for j in range(counts.shape[1]):
            known = np.flatnonzero(~missing[:, j])
            between = np.diff(known, prepend=-1 - self.run[j], append=len(counts)) - 1
            self.longest[j] = max(self.longest[j], between.max())
            self.run[j] = between[-1] if len(known) else self.run[j] + len(counts)
            self.last[j] = counts[known[-1], j] if len(known) else self.last[j]

    def findings(self, rate: float) -> tuple[str, ...]:
        """Write a sentence for each encoder with missing samples.

        The sentence gives the number of missing samples, and how they were replaced.
        """
        return tuple(
            (
                f"encoder {j + 1}: {self.samples[j]} samples are missing, at most "
                f"{self.longest[j]} in a row ({self.longest[j] / rate:.3g} s); "
            )
            + (
                (
                    "where the counts around a gap do not fix the position to half a step, rows "
                    f"are left out ({self.unknown[j]} samples)"
                )
                if self.unknown[j]
                else "the counts around them determine the motion there"
            )
            for j in np.flatnonzero(self.samples)
        )


def stretches(N: int) -> list[tuple[int, int, int, int]]:
    """Split N samples into stretches [first, stop), each with a wider range [begin, end) around it.

    The samples [begin, end) are processed in order to find the motion in [first, stop).
    """
    count = max(1, round(N / STRETCH))
    cuts = [*(STRETCH * i for i in range(count)), N]
    return [(max(a - MARGIN, 0), a, b, min(b + MARGIN, N)) for a, b in pairwise(cuts)]
