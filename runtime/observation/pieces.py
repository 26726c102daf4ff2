"""A long record in pieces that are observed independently of one another, one after the other or at once.

A piece is a range of kept instants with the samples that decide them: filters forget, so that samples more than `reach` away say nothing (beyond
streaming_filters.TRUNCATION). Counts of encoders are read in the stretches of the whole record. Pieces depend on the record and the settings
alone, and their results are joined in the order of time: they agree in every bit, however many processes work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, log

import numpy as np

from runtime.observation.counts import STRETCH, stretches
from runtime.observation.decimation import operator
from runtime.observation.filters import butterworth
from runtime.observation.streaming_filters import DIFFERENCE, TRUNCATION, memory
from runtime.records.stream import Stream
from runtime.settings.study import Signals

PIECE = 2**20
"""Samples of a piece; those that it shares with its neighbours are 2 % of them, and 6 % of the counts."""


@dataclass(frozen=True)
class Instants:
    """Which samples of a record, or of a piece of it, are kept.

    Attributes
    ----------
    start, stop : int
        Raw samples of the window, [start, stop).
    factor, first, kept : int
        Decimation keeps one sample in `factor` from `first` on, counted from `start`, `kept` in all.
    used : (int, int)
        Numbers of the instants whose rows may be used: without those of rows.trim and, in a piece, those of its neighbours.
    number : int
        Number of the first kept instant in the whole record.
    """

    start: int
    stop: int
    factor: int
    first: int
    kept: int
    used: tuple[int, int]
    number: int = 0


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
        As of `runtime.observation.counts.stretches`, counted from `begin`.
    """

    record: int
    begin: int
    end: int
    instants: Instants
    stretches: tuple[tuple[int, int, int, int], ...]


def pieces(record: int, stream: Stream, signals: Signals, whole: Instants) -> list[Piece]:
    """The record in pieces of about PIECE samples; one piece where it is short, or read from its start only."""
    N = len(stream)
    cuts = [*range(PIECE + STRETCH // 2, N - PIECE // 2, PIECE)] if stream.in_any_order else []
    if not cuts:
        return [Piece(record, 0, N, whole, tuple(stretches(N)))]
    origin, far = whole.start + whole.first, reach(stream.rate, signals, whole.factor)
    numbers = [max(whole.used[0], min(ceil((cut - origin) / whole.factor), whole.used[1])) for cut in cuts]
    found = []
    for k0, k1 in zip([whole.used[0], *numbers], [*numbers, whole.used[1]], strict=True):
        if k0 < k1:
            begin, end = max(origin + k0 * whole.factor - far, 0), min(origin + (k1 - 1) * whole.factor + far + 1, N)
            own = [x for x in stretches(N) if x[1] < end and x[2] > begin]
            if signals.reader == "counts":
                begin, end = own[0][0], own[-1][3]
            shifted = tuple((x[0] - begin, x[1] - begin, x[2] - begin, x[3] - begin) for x in own)
            found.append(Piece(record, begin, end, _inside(whole, begin, end, (k0, k1)), shifted))
    return found


def reach(rate: float, signals: Signals, factor: int) -> int:
    """Samples before and behind a kept one that it depends on."""
    low = signals.lowpass
    lowpass = 0 if low is None else len(set(low.on)) * memory(butterworth(rate, low)[0])
    decimation = 0 if factor == 1 else ceil(log(TRUNCATION) / log(np.abs(operator(factor).lam).max()))
    return signals.median + lowpass + 2 * DIFFERENCE + decimation


def _inside(whole: Instants, begin: int, end: int, used: tuple[int, int]) -> Instants:
    """The kept instants of the samples [begin, end), counted from `begin`."""
    start, stop = max(whole.start, begin), min(whole.stop, end)
    ahead = start - whole.start
    first = (whole.first - ahead) % whole.factor
    kept = len(range(first, stop - start, whole.factor))
    number = (ahead + first - whole.first) // whole.factor
    return replace(whole, start=start - begin, stop=stop - begin, first=first, kept=kept, used=used, number=number)
