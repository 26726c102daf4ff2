"""A long record in pieces that are observed independently of one another, one after the other or at
once, by the filters that a whole record goes through.

A piece is a range of kept instants with the samples that decide them: filters forget, so that
samples more than `reach` away say less than TRUNCATION of the signal. Counts of encoders are read
in the stretches of the whole record. Pieces depend on the record and the settings alone, and their
results are joined in the order of time: they agree in every bit, however many processes work.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, log

import numpy as np

from runtime.records.stream import Stream
from runtime.rows.selection import Instants
from runtime.settings.study import Lowpass, Signals
from runtime.signals.counts.reading import STRETCH, stretches
from runtime.signals.decimation import operator
from runtime.signals.filters import butterworth

Array = np.ndarray

PIECE = 2**19
"""Samples of a piece; those that it shares with its neighbours are 5 % of them, and 12 % of the
counts.
"""
CHUNK = 16384
"""Instants of a piece whose rows are evaluated at a time."""
TRUNCATION = 1e-20
"""What a filter still knows of a sample that is out of its reach, of the signal."""
DIFFERENCE = 2  # samples of reach, so that one-sided differences of second order find three samples


@dataclass(frozen=True)
class Piece:
    """Samples [begin, end) of a record.

    Attributes
    ----------
    record : int
        Number of the record.
    begin, end : int
        Samples that are read.
    instants : Instants
        Counted from `begin`.
    stretches : tuple of (int, int, int, int)
        As of `runtime.signals.counts.reading.stretches`, counted from `begin`.
    """

    record: int
    begin: int
    end: int
    instants: Instants
    stretches: tuple[tuple[int, int, int, int], ...]


def chunks(whole: Instants) -> Iterator[tuple[slice, Instants]]:
    """The samples that decide CHUNK used instants at a time, and these instants, counted from the
    first of the samples.
    """
    far = decimation_reach(whole.factor)
    for a in range(*whole.used, CHUNK):
        b = min(a + CHUNK, whole.used[1])
        begin = max(whole.sample(a) - far, whole.start)
        end = min(whole.sample(b - 1) + far + 1, whole.stop)
        yield slice(begin, end), whole.part(begin, end, (a, b))


def pieces(record: int, stream: Stream, signals: Signals, whole: Instants) -> list[Piece]:
    """The record in pieces of about PIECE samples; one piece where it is short."""
    N = len(stream)
    cuts = [*range(PIECE + STRETCH // 2, N - PIECE // 2, PIECE)]
    origin, far = whole.sample(0), reach(stream.rate, signals, whole.factor)
    low, high = whole.used
    numbers = [max(low, min(ceil((cut - origin) / whole.factor), high)) for cut in cuts]
    found = []
    for used in zip([low, *numbers], [*numbers, high], strict=True):
        if used[0] < used[1]:
            begin = max(whole.sample(used[0]) - far, 0) if cuts else 0
            end = min(whole.sample(used[1] - 1) + far + 1, N) if cuts else N
            own = [x for x in stretches(N) if x[1] < end and x[2] > begin]
            if signals.reader == "counts":
                begin, end = own[0][0], own[-1][3]
            shifted = tuple((x[0] - begin, x[1] - begin, x[2] - begin, x[3] - begin) for x in own)
            found.append(Piece(record, begin, end, whole.part(begin, end, used), shifted))
    return found


def reach(rate: float, signals: Signals, factor: int) -> int:
    """Samples before and behind a kept one that it depends on."""
    low = signals.lowpass
    lowpass = 0 if low is None else len(set(low.on)) * memory(butterworth(rate, low)[0])
    if not isinstance(signals.velocity, str):
        slowest = min(np.ravel(signals.velocity).tolist())
        if slowest < rate / 2:
            lowpass += memory(butterworth(rate, Lowpass(cutoff=slowest, order=1))[0])
    return (
        max(signals.median, signals.window_of_torques)
        + lowpass
        + 2 * DIFFERENCE
        + decimation_reach(factor)
    )


def decimation_reach(factor: int) -> int:
    """Samples before and behind a kept one that decimation asks for."""
    return 0 if factor == 1 else _decayed(np.abs(operator(factor).lam).max())


def memory(sos: Array) -> int:
    """Samples after which a filter has forgotten all but TRUNCATION of its state; sos, shape
    (sections, 6).
    """
    return _decayed(max(np.abs(np.roots(section[3:])).max() for section in sos))


def _decayed(pole: float) -> int:
    """Samples in which a pole of that size decays to TRUNCATION."""
    return ceil(log(TRUNCATION) / log(pole))
