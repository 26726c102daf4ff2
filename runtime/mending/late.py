"""Delays of the torques relative to the positions, found from the rows of the search alone.

    tau_j(t + delay_j) = [W chi]_j + rho

W stays the same, and the torques are read at other instants. First, one delay of all joints is
searched; from this value, a delay of each joint. The score is that of least squares with weights by
joint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.ground.limits import limits
from runtime.mending.reading import Reading
from runtime.plausible.bodies import Grams, least_squares

LIMIT, TOLD = limits(__package__), limits("runtime.plausible")

Array = np.ndarray


def late_torques(reading: Reading) -> tuple[Array, str] | None:
    """Search for the delays of the torques, s, shape (n,); None if no joint is late beyond doubt.

    Return the delays with a sentence.
    """
    baseline, n = reading.baseline, len(reading.p)
    if baseline is None:
        return None
    D, _, mask = baseline.as_given
    known = baseline.samples.tau_known @ baseline.F.T

    def score(delay: Array) -> float:
        tau = replace(reading, delay=delay).samples(reading.data.seen).tau @ baseline.F.T
        return least_squares(Grams.of(D, tau - known, mask, tau), baseline.N).score

    start = reading.delay
    before = score(start)
    tried = {sign * d: 0.0 for d in LIMIT.DELAYS_TRIED for sign in (1, -1)}
    tried = {d: score(start + d) for d in tried}
    grid = sorted(tried)
    k = grid.index(min(tried, key=tried.__getitem__))
    around = (grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)])
    common = start + _least(lambda d: score(start + d), around)
    delay, best = common, score(common)
    if n > 1:
        alone = delay.copy()
        for j in range(n):

            def own(d: float, j: int = j) -> float:
                return score(np.where(np.arange(n) == j, d, alone))

            far = min((alone[j] + d for d in grid), key=own)
            near = (far - TOLD.LATE_JOINT, far + TOLD.LATE_JOINT)
            d = _least(own, near)
            if abs(d - common[j]) > TOLD.LATE_JOINT and best - own(d) > TOLD.LATE_GAIN:
                alone[j] = d
                best = score(alone)
        delay = alone
    if np.abs(delay - start).max() < TOLD.LATE or before - best < TOLD.LATE_GAIN:
        return None
    if len({*np.round(delay, 4)}) > 1:  # what is common is judged anew beside single joints
        apart = np.abs(delay - common) > TOLD.LATE_JOINT
        still = np.where(apart, delay, start)
        if score(still) - best < TOLD.LATE_GAIN:
            delay = still
    told = [f"{1e3 * d:.1f}" for d in delay]
    text = told[0] if len({*told}) == 1 else ", ".join(told)
    return delay, f"torques are late by {text} ms (early if below zero)"


def _least(f: Callable[[float], float], bounds: tuple[float, float]) -> float:
    options = {"maxiter": 10, "xatol": 1e-4}
    found = minimize_scalar(f, bounds=bounds, method="bounded", options=options)
    return float(found.x)
