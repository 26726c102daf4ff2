"""Counts that come by blocks: the stretches of `runtime.signals.counts.reading`, each read as soon
as
its samples are there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from runtime.errors import InputError
from runtime.settings.study import Signals
from runtime.signals.counts.lattice import Lattice, Unwrapping, lattice
from runtime.signals.counts.reading import Gaps, read_stretch

Array = np.ndarray
Stretch = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class CountStart:
    """What the samples ahead of a stretch say: step and phase, turns of the counts, the last ones
    known.
    """

    lattice: Lattice
    unwrapping: Unwrapping
    gaps: Gaps


class CountStage:
    """Positions at the encoders, shape (B, n), nan where they are missing, go in by pieces;
    positions read and deviations of velocities come out.

    Attributes
    ----------
    starts : dict of int to CountStart
        By where the stretch begins.
    said : dict
        Sentences of the stretches read, as keys.
    unknown : dict of int to ndarray
        Samples of unknown state, shape (n,), by the first sample of each stretch.

    Parameters
    ----------
    stretches : sequence of (int, int, int, int)
        Of the record, or of a piece of it, counted from its first sample
        (`runtime.signals.counts.reading.stretches`). What the first and the last one
        read beyond their own samples is given as well.
    rate : float, Hz
    signals : Signals
    name : str
        What errors call the record.
    start : CountStart, optional
        What is ahead of the first stretch; default: nothing, step and phase are those of the first
        stretch.
    """

    def __init__(
        self,
        stretches: Sequence[Stretch],
        rate: float,
        signals: Signals,
        name: str,
        start: CountStart | None = None,
    ) -> None:
        self.rate, self.step, self.name = rate, signals.step, name
        self.stretches = stretches
        self.start, self.offset = deepcopy(start), 0 if start is None else start.unwrapping.begin
        self.starts: dict[int, CountStart] = {}
        self.said: dict[str, None] = {}
        self.unknown: dict[int, Array] = {}

    @property
    def findings(self) -> tuple[str, ...]:
        """What the stretches that are complete say, as in `runtime.signals.counts.reading`."""
        if self.start is None:
            return ()
        self.start.gaps.unknown = np.sum([*self.unknown.values()], axis=0, dtype=int)
        found = (
            *self.start.lattice.findings,
            *self.start.unwrapping.findings,
            *self.said,
            *self.start.gaps.findings(self.rate),
        )
        return tuple(dict.fromkeys(found))

    def read(self, position: Array) -> tuple[Array, Array]:
        """q and s_qd, shape (N, n), of the positions of all stretches; s_qd is infinite where the
        state is unknown.
        """
        q, s = [], []
        for (begin, first, stop, end), counts, ahead in self._passed(lambda a, b: position[a:b]):
            part, states, unknown = read_stretch(counts, self.rate, None, ahead.gaps.rest(counts))
            self.said.update(dict.fromkeys(part.findings if part else ()))
            own = slice(first - begin, stop - begin)
            ahead.gaps.take(counts[own], unknown[own])
            last = stop == self.stretches[-1][2]
            given = slice(own.start if self.unknown else 0, end - begin if last else own.stop)
            self.unknown[self.offset + first] = unknown[own].sum(axis=0)
            q.append(ahead.lattice.position(states[0][given]))
            s.append(np.where(unknown[given], np.inf, states[4][given] * ahead.lattice.step))
        return np.concatenate(q), np.concatenate(s)

    def skim(self, positions: Callable[[int, int], Array], begins: Collection[int]) -> None:
        """Turns and gaps of the positions [a, b), without reading them; `starts` of the stretches
        that begin at `begins`.
        """
        for (begin, first, stop, _), counts, ahead in self._passed(positions, begins):
            own = counts[first - begin : stop - begin]
            ahead.gaps.take(own, np.zeros(own.shape, dtype=bool))

    def join(self, piece: CountStage | None) -> None:
        """What a piece read."""
        if piece is not None:
            self.said |= piece.said
            self.unknown |= piece.unknown

    def _passed(
        self, positions: Callable[[int, int], Array], begins: Collection[int] = ()
    ) -> Iterator[tuple[Stretch, Array, CountStart]]:
        """The stretches, their counts without wraps, and what is ahead of them."""
        for stretch, following in zip_longest(self.stretches, self.stretches[1:]):
            begin, _, _, end = stretch
            own = positions(begin, end)
            if self.start is None:
                unknown = np.isnan(own).all(axis=0)
                if following and unknown.any():
                    text = (
                        f"no sample is known among the first {end}, which tell the step; set "
                        "stream: off"
                    )
                    raise InputError(f"encoder {np.argmax(unknown) + 1}: {text}", file=self.name)
                known = lattice(own, self.step, name=self.name)
                self.start = CountStart(known, Unwrapping(known, self.name), Gaps(own.shape[1]))
            if begin in begins:
                self.starts[begin] = deepcopy(self.start)
            later = self.offset + (following[0] if following else end)
            counts = self.start.unwrapping(self.start.lattice.counts(own), later)
            yield stretch, counts, self.start
