"""Samples of a position that repeat the one before, although the joint moves.

A controller or a logger without a new packet repeats the last packet, and the next change makes up
for the pause: after g rows the change is

    s = g v (1 +- CATCHES_UP)          v = mean speed before and after, per row; both are similar

A joint at rest, a joint that starts, and a joint between two steps of a coarse encoder show no such
change. By chance, a noisy value repeats less often the higher the speed is.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray


def held_positions(q: Array) -> Array:
    """Find the positions that repeat the sample before although the joint moves, bool (N, n).

    If all positions of a row repeat, the evidence of the joints is added, and all are marked.

    q : positions, shape (N, n).
    """
    evidence = np.stack([_evidence(x) for x in q.T], axis=1)
    by_chance = LIMIT.HELD_NOISE + np.log(len(q))  # the more rows, the more repeat by chance
    held = evidence > by_chance
    same = np.append(False, (q[1:] == q[:-1]).all(axis=1))
    held[same & (evidence.sum(axis=1) > by_chance)] = True
    return np.asarray(held)


def repeated_mostly(x: Array) -> bool:
    """Whether a signal x, shape (N,), repeats half of its samples, or more, between large changes."""
    c = np.flatnonzero(np.diff(x)) + 1
    steps = np.abs(np.diff(x[c]))
    if len(steps) < LIMIT.FEWEST_CHANGES:
        return False
    return bool(np.median(np.diff(c)) >= 2 and np.median(steps) > LIMIT.HELD_STEPS * steps.min())


def _evidence(x: Array) -> Array:
    """Compute the evidence that samples of one position are held, shape (N,); 0 for other samples.

    The evidence is the square of v (g - 1) over twice the largest noise nearby: the exponent of the
    probability that noise repeats a value.
    """
    evidence = np.zeros(len(x))
    c = np.append(0, np.flatnonzero(np.diff(x)) + 1)  # rows with a new value
    if len(c) < LIMIT.FEWEST_CHANGES:
        return evidence
    y, gap = x[c], np.diff(c)
    i = np.flatnonzero(gap >= 2)
    i = i[(i >= 2) & (i + 3 < len(c))]
    if not len(i):
        return evidence
    before = (y[i] - y[i - 2]) / (c[i] - c[i - 2])
    after = (y[i + 3] - y[i + 1]) / (c[i + 3] - c[i + 1])
    v, g, s = (before + after) / 2, gap[i], y[i + 1] - y[i]
    off = np.abs(y[1:-1] - y[:-2] - (y[2:] - y[:-2]) * gap[:-1] / (c[2:] - c[:-2]))
    noise = 2 * maximum_filter1d(off, 2 * LIMIT.BESIDE + 1)[i - 1]
    often = uniform_filter1d(np.where(gap >= 2, 1.0, 0.0), 2 * LIMIT.BESIDE + 1)[i]
    count = float(np.abs(np.diff(y)).min())
    certain = (np.abs(v) > LIMIT.HELD_STEPS * count) & (often < LIMIT.HELD_OFTEN)
    with np.errstate(divide="ignore", invalid="ignore"):
        for speed in (before, after, s / g):
            certain &= np.abs(speed / v - 1) < LIMIT.CATCHES_UP
        strength = np.minimum((v * (g - 1) / noise) ** 2, LIMIT.CERTAINLY_HELD)
    for k, of in zip(i[certain], strength[certain], strict=True):
        evidence[c[k] + 1 : c[k + 1]] = of
    return evidence
