"""Samples of a position that repeat the one before, although the joint moves.

A controller or a logger without a new packet repeats the last one, and the next change makes up
for it: after g rows it is

    s = g v (1 +- LIMIT.CATCHES_UP)          v = speed around it, per row

A joint at rest, or between two steps of a coarse encoder, shows no such change; chance repeats a
noisy value less often the larger the speed.
"""

from __future__ import annotations

import numpy as np

from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray


def held_positions(q: Array) -> Array:
    """Find the positions that repeat the sample before although the joint moves, bool (N, n).

    Where all positions repeat and one of them does so for certain, all are marked.

    q : positions, shape (N, n).
    """
    held = np.stack([_held(x) for x in q.T], axis=1)
    same = np.append(False, (q[1:] == q[:-1]).all(axis=1))
    held[same & held.any(axis=1)] = True
    return held


def repeated_mostly(x: Array) -> bool:
    """Whether a signal x, shape (N,), repeats half of its samples, or more, between large changes."""
    c = np.flatnonzero(np.diff(x)) + 1
    steps = np.abs(np.diff(x[c]))
    if len(steps) < LIMIT.FEWEST_CHANGES:
        return False
    return bool(np.median(np.diff(c)) >= 2 and np.median(steps) > LIMIT.HELD_STEPS * steps.min())


def _held(x: Array) -> Array:
    """Find the repeated samples of one moving position, bool (N,)."""
    held = np.zeros(len(x), dtype=bool)
    c = np.append(0, np.flatnonzero(np.diff(x)) + 1)  # rows with a new value
    if len(c) < LIMIT.FEWEST_CHANGES:
        return held
    y, gap = x[c], np.diff(c)
    i = np.flatnonzero(gap >= 2)
    i = i[(i >= 2) & (i + 3 < len(c))]
    if not len(i):
        return held
    before = (y[i] - y[i - 2]) / (c[i] - c[i - 2])
    after = (y[i + 3] - y[i + 1]) / (c[i + 3] - c[i + 1])
    v, g, s = (before + after) / 2, gap[i], y[i + 1] - y[i]
    middle = y[:-2] + (y[2:] - y[:-2]) * gap[:-1] / (c[2:] - c[:-2])
    noise = 2 * float(np.median(np.abs(y[1:-1] - middle)))
    count = float(np.abs(np.diff(y)).min())
    least = np.maximum(LIMIT.HELD_STEPS * count, LIMIT.HELD_NOISE * noise / (g - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        certain = (np.abs(v) > least) & (np.abs(s / (g * v) - 1) < LIMIT.CATCHES_UP)
    for k in i[certain]:
        held[c[k] + 1 : c[k + 1]] = True
    return held
