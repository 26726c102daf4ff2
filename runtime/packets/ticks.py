"""Times of a slower bus, found in the changes of a signal that a faster log repeats.

A log of one row every T that repeats the last value of a bus changes only in the rows

    i_k = ceil(a + P k),     k = 0, 1, 2, ...          P = period of the bus, rows

in some of them if the joint rests or packets are lost. P and a are fitted to the changed rows. The
changes of a signal that is measured in every row lie in such rows by chance with the probability
(S/P)^M; M changes, S rows of each period allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.ground.limits import limits

LIMIT = limits(__package__)
BEGINNING = 8
"""Changes to which the period is fitted first; then to twice as many, up to all."""

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Ticks:
    """Rows of a log that have a new packet of a slower bus.

    Attributes
    ----------
    period : float, rows
        Period of the bus.
    rows : ndarray of int, shape (K,)
        The row of each packet, one for each period of the bus from the first to the last.
    start : float, rows
        Mean time of the first packet, in rows after the first row.
    """

    period: float
    rows: Array
    start: float

    def new_at(self, rows: Array) -> bool:
        """Whether the last packet is new in nearly all of the given rows, or one row old."""
        last = np.searchsorted(self.rows, rows, side="right") - 1
        age = rows - self.rows[last.clip(min=0)]
        return bool(np.quantile(age, 0.95) <= max(1.0, LIMIT.BUS_JITTER * self.period))


def changed(x: Array) -> Array:
    """Return the rows i at which any column of x, shape (N, c), differs from that of row i - 1."""
    return np.flatnonzero((x[1:] != x[:-1]).any(axis=1)) + 1


def ticks_of(c: Array, N: int) -> Ticks | None:
    """Find the bus whose packets changed the rows c of N rows; None if no bus is certain."""
    gaps = np.diff(c)
    if len(c) < 2 * BEGINNING:
        return None
    short = gaps[gaps <= gaps.min() + 1]
    P = float(short.mean())
    if P < LIMIT.LEAST_PERIOD or len(c) * np.log(P) < LIMIT.BY_CHANCE:
        return None
    a, m = float(c[0]), BEGINNING
    while True:
        own = c[:m]
        k = np.rint((own - a) / P)
        if np.diff(k).min() < 1:
            return None
        P, a = np.polyfit(k, own, 1)
        late = own - a - P * k
        spread = float(np.ptp(late))
        if P < LIMIT.LEAST_PERIOD or spread > max(1.0 + 1e-6, 2 * LIMIT.BUS_JITTER * P):
            return None
        if m >= len(c):
            break
        m *= 2
    if len(c) * np.log(P / (np.floor(spread + 1e-6) + 1)) < LIMIT.BY_CHANCE:
        return None
    first = a + late.min()  # no packet comes before first + P k
    numbers = np.arange(np.ceil(-first / P - 1e-9), np.floor((N - 1 - first) / P + 1e-9) + 1)
    rows = np.ceil(first + P * numbers - 1e-6).astype(int)
    rows[np.searchsorted(numbers, k)] = c
    return Ticks(float(P), rows, float(a + P * numbers[0]))
