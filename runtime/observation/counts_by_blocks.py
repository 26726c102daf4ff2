"""Counts that come by blocks: the stretches of `runtime.observation.counts`, each read as soon as its samples are there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.observation.counts import Gaps, read_stretch
from runtime.observation.encoder_lattice import Lattice, Unwrapping, lattice
from runtime.records.stream import Queue
from runtime.settings.study import Signals

Array = np.ndarray
Stretch = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class CountStart:
    """What the samples ahead of a stretch say: step and phase, turns of the counts, the last ones known."""

    lattice: Lattice
    unwrapping: Unwrapping
    gaps: Gaps


class CountStage:
    """Positions at the encoders, shape (B, n), nan where they are missing, go in by pieces; positions read and deviations of velocities come out.

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
        Of the record, or of a piece of it, counted from its first sample (`runtime.observation.counts.stretches`). What the first and the last one
        read beyond their own samples is given as well.
    rate : float, Hz
    signals : Signals
    name : str
        What errors call the record.
    start : CountStart, optional
        What is ahead of the first stretch; default: nothing, step and phase are those of the first stretch.
    remembered : collection of int
        Where stretches begin of which `starts` will say what is ahead.
    """

    def __init__(
        self,
        stretches: Sequence[Stretch],
        rate: float,
        signals: Signals,
        name: str,
        start: CountStart | None = None,
        remembered: Collection[int] = (),
    ) -> None:
        self.rate, self.step, self.lines, self.name = rate, signals.step, signals.lines, name
        self.left = list(stretches)
        self.held, self.begin = Queue(), 0  # samples from `begin` on
        self.start, self.offset = deepcopy(start), 0 if start is None else start.unwrapping.begin
        self.remembered = remembered
        self.starts: dict[int, CountStart] = {}
        self.said: dict[str, None] = {}
        self.unknown: dict[int, Array] = {}

    @property
    def findings(self) -> tuple[str, ...]:
        """What the stretches that are complete say, as in `runtime.observation.counts`."""
        if self.start is None:
            return ()
        self.start.gaps.unknown = np.sum([*self.unknown.values()], axis=0, dtype=int)
        found = (*self.start.lattice.findings, *self.start.unwrapping.findings, *self.said, *self.start.gaps.findings(self.rate))
        return tuple(dict.fromkeys(found))

    def push(self, position: Array) -> tuple[Array, Array]:
        """q and s_qd, shape (k, n), of the stretches that are complete; s_qd is infinite where the state is unknown."""
        n = position.shape[1]
        q, s = [np.empty((0, n))], [np.empty((0, n))]
        for (begin, first, stop, end), counts, ahead in self._complete(position):
            part, states, unknown = read_stretch(counts, self.rate, self.lines, ahead.gaps.rest(counts))
            self.said.update(dict.fromkeys(part.findings if part else ()))
            own = slice(first - begin, stop - begin)
            ahead.gaps.take(counts[own], unknown[own])
            given = slice(own.start if self.unknown else 0, own.stop if self.left else end - begin)
            self.unknown[self.offset + first] = unknown[own].sum(axis=0)
            q.append(ahead.lattice.position(states[0][given]))
            s.append(np.where(unknown[given], np.inf, states[4][given] * ahead.lattice.step))
        return np.concatenate(q), np.concatenate(s)

    def skim(self, position: Array) -> None:
        """The same without reading the stretches: turns, gaps and `starts` alone."""
        for (begin, first, stop, _), counts, ahead in self._complete(position):
            own = counts[first - begin : stop - begin]
            ahead.gaps.take(own, np.zeros(own.shape, dtype=bool))

    def join(self, piece: CountStage | None) -> None:
        """What a piece read."""
        if piece is not None:
            self.said |= piece.said
            self.unknown |= piece.unknown

    def _complete(self, position: Array) -> Iterator[tuple[Stretch, Array, CountStart]]:
        """Stretches whose samples are there, their counts without wraps, and what is ahead of them."""
        self.held.put(position)
        while self.left and self.held.count >= self.left[0][3] - self.begin:
            stretch = begin, _, _, end = self.left.pop(0)
            x = self.held.take(self.held.count)
            own = x[: end - begin]
            if self.start is None:
                n, unknown = position.shape[1], np.isnan(own).all(axis=0)
                if self.left and unknown.any():
                    text = f"no sample is known among the first {end}, which tell the step; set stream: off"
                    raise InputError(f"encoder {np.argmax(unknown) + 1}: {text}", file=self.name)
                self.start = CountStart(lattice(own, self.step, name=self.name), Unwrapping(n, self.name), Gaps(n))
            if begin in self.remembered:
                self.starts[begin] = deepcopy(self.start)
            counts = self.start.unwrapping(self.start.lattice.counts(own), self.offset + (self.left[0][0] if self.left else end))
            yield stretch, counts, self.start
            if self.left:
                self.held.put(x[self.left[0][0] - begin :])
                self.begin = self.left[0][0]
