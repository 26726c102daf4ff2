"""From the counts of encoders to positions, velocities and accelerations with their deviations (docs/theory/counts.md).

    reading = read_counts(position, rate, step)        encoder side, shape (N, n)
    reading.q, reading.s_q, reading.sign, reading.findings

Records longer than STRETCH samples are read in stretches that overlap by MARGIN samples on either side: memory and time are linear in their length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import erf

from runtime.observation.count_smoother import Lines, Smoothed, smoothed
from runtime.observation.encoder_lattice import SHAKEN, Lattice, lattice, shaken_share, to_and_fro, unwrapped

Array = np.ndarray

STRETCH, MARGIN = 65536, 4096
ANYWHERE = 12**-0.5
"""Error of a line where the motion shakes, steps: a change of the count then says as much as the count itself, a position within one step."""
TURNED = 4e-3
"""Time ahead of a count that goes to and fro and behind it in which both directions occur, s: a quarter of a period of usual cut-offs."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What counts say of a motion; arrays of shape (N, n) at the encoder side, rad or m, per s, per s^2.

    Attributes
    ----------
    q, qd, qdd : ndarray, shape (N, n)
        Means of the posterior.
    s_q, s_qd, s_qdd : ndarray, shape (N, n)
        Its deviations.
    jerk_density : ndarray, shape (n,), rad/s^3/sqrt(Hz) or m/s^3/sqrt(Hz)
        Root of the mean density r of the white jerk.
    step, phase : ndarray, shape (n,), rad or m
        Lattice of the encoders.
    findings : tuple of str
        What the record shows of its encoders, a sentence each.
    """

    q: Array
    qd: Array
    qdd: Array
    s_q: Array
    s_qd: Array
    s_qdd: Array
    jerk_density: Array
    step: Array
    phase: Array
    findings: tuple[str, ...]
    parts: tuple[Part, ...]

    @property
    def sign(self) -> Array:
        """E[sign qd] = erf(qd/(sqrt(2) s_qd)), shape (N, n); 0 at rest."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(self.s_qd > 0, erf(self.qd / (np.sqrt(2) * self.s_qd)), np.sign(self.qd)))

    def draw(self, rng: np.random.Generator) -> Array:
        """Positions drawn from the posterior, shape (N, n)."""
        x = np.array(self.q)
        for part in self.parts:
            drawn = (part.smoothed.draw(rng) * self.step[part.moving, None]).T + self.phase[part.moving]
            head = max(part.first - part.begin, 0)  # samples shared with the stretch before: from one draw to the next
            w = np.ones(len(drawn))
            if head:
                w[:head], w[head : 2 * head] = 0.0, np.linspace(0, 1, len(w[head : 2 * head]))
            at = np.ix_(np.arange(part.begin, part.begin + len(drawn)), part.moving)
            x[at] += w[:, None] * (drawn - x[at])
        return x


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch: its samples start at `begin`, those that count are [first, stop).   moving : encoders whose counts change in it."""

    smoothed: Smoothed
    begin: int
    first: int
    stop: int
    moving: Array

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences about the lines of its encoders."""
        return tuple(f"encoder {j + 1}: {each.finding}" for j, each in zip(self.moving, self.smoothed.errors, strict=True) if each.finding)


def read_counts(
    position: Array,
    rate: float,
    step: Array | Sequence[float] | float | None = None,
    phase: Array | None = None,
    *,
    lines: Lines = "detected",
    name: str = "record",
) -> Reading:
    """Positions, velocities and accelerations from counts, with deviations.

    Parameters
    ----------
    position : ndarray, shape (N, n), rad or m
        At the encoder side: counts times step plus phase. nan: a sample that is missing.
    rate : float, Hz
        Sampling rate.
    step : float or ndarray, shape (n,), rad or m, optional
        Step of the encoders; default: from the record.
    phase : ndarray, shape (n,), rad or m, optional
        A position of the lattice of each encoder, the middle of an interval; default: from the record.
    lines : "detected", "estimated" or float
        Lines at unequal distances: their deviation is detected, and bounds are widened by it; lines are estimated with the motion; or their
        deviation is known, steps.
    name : str
        What errors call the record.

    Returns
    -------
    Reading

    Raises
    ------
    InputError
        No count changes; a step that is not positive or larger than the motion; positions off the lattice; counts that jump.
    """
    known = lattice(position, step, phase, name=name)
    counts, said = unwrapped(known.counts(position), name=name)
    return _reading(counts, rate, known, lines, said)


def _reading(counts: Array, rate: float, known: Lattice, lines: Lines, said: Sequence[str]) -> Reading:
    N, n = counts.shape
    states = [np.empty((N, n)) for _ in range(6)]
    density, parts, found = np.zeros(n), [], dict.fromkeys((*known.findings, *said))
    for begin, first, stop, end in stretches(N):
        part, read = read_stretch(counts[begin:end], rate, lines)
        for x, own in zip(states, read, strict=True):
            x[first:stop] = own[first - begin : stop - begin]
        if part is not None:
            part = replace(part, begin=begin, first=first, stop=stop)
            density[part.moving] += part.smoothed.density.mean(axis=1) * (stop - first) / N
            parts.append(part)
            found.update(dict.fromkeys(part.findings))
    for i, x in enumerate(states):
        x *= known.step
        if i == 0:
            x += known.phase
    q, qd, qdd, s_q, s_qd, s_qdd = states
    jerk = np.sqrt(density) * known.step
    return Reading(q, qd, qdd, s_q, s_qd, s_qdd, jerk, known.step, known.phase, tuple(found), tuple(parts))


def read_stretch(counts: Array, rate: float, lines: Lines) -> tuple[Part | None, list[Array]]:
    """Posterior of counts, shape (N, n), and q, qd, qdd, s_q, s_qd, s_qdd, shape (N, n) each, in steps; None where nothing moves.

    An encoder whose count never changes rests in the middle of its interval. Where one count goes to and fro the lines of all encoders are widened,
    since joints share a controller, and directions near such passages are uncertain.
    """
    N, n = counts.shape
    k = np.ascontiguousarray(counts.T)
    moving = np.flatnonzero(np.nanmax(k, axis=1) > np.nanmin(k, axis=1))
    states = [np.full((N, n), value) for value in (0.0, 0.0, 0.0, 12**-0.5, 0.0, 0.0)]
    states[0][:] = np.nanmean(k, axis=1)
    if not len(moving):
        return None, states
    known = [np.flatnonzero(np.isfinite(k[j])) for j in moving]
    shaken = isinstance(lines, str) and max(shaken_share(k[j, at]) for j, at in zip(moving, known, strict=True)) > SHAKEN
    part = Part(smoothed(k[moving], 1 / rate, lines=ANYWHERE if shaken else lines), 0, 0, N, moving)
    for order in range(3):
        for i, x in zip((order, order + 3), part.smoothed.state(order), strict=True):
            states[i][:, moving] = x.T
    for j, at in zip(moving, known, strict=True) if shaken else ():
        turned = np.zeros(N, dtype=bool)
        for a, b in at[to_and_fro(k[j, at])]:
            turned[max(a - round(TURNED * rate), 0) : b + round(TURNED * rate)] = True
        deviation = 3 * np.abs(states[1][turned, j])  # speeds of both signs: their deviation is above their mean
        states[4][turned, j] = np.maximum(states[4][turned, j], deviation)
    return part, states


def stretches(N: int) -> list[tuple[int, int, int, int]]:
    """(begin, first, stop, end): samples [begin, end) are read to know [first, stop)."""
    count = max(1, round(N / STRETCH))
    cuts = [*(STRETCH * i for i in range(count)), N]
    return [(max(a - MARGIN, 0), a, b, min(b + MARGIN, N)) for a, b in pairwise(cuts)]
