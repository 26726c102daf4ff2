"""Counts that come by blocks: the stretches of `runtime.observation.counts`, each read as soon as its samples are there."""

from __future__ import annotations

import numpy as np

from runtime.observation.counts import Gaps, read_stretch, stretches
from runtime.observation.encoder_lattice import Lattice, Unwrapping, lattice
from runtime.records.stream import Queue
from runtime.settings.study import Signals

Array = np.ndarray


class CountStage:
    """Positions at the encoders, shape (B, n), nan where they are missing, go in by pieces; positions read and deviations of velocities come out.

    Step and phase are those of the first stretch.

    Parameters
    ----------
    samples : int
        N of the record.
    rate : float, Hz
    signals : Signals
    name : str
        What errors call the record.
    """

    def __init__(self, samples: int, rate: float, signals: Signals, name: str) -> None:
        self.rate, self.step, self.lines, self.name = rate, signals.step, signals.lines, name
        self.left = stretches(samples)
        self.held, self.begin = Queue(), 0  # samples from `begin` of the record on
        self.lattice: Lattice | None = None
        self.said: dict[str, None] = {}

    @property
    def findings(self) -> tuple[str, ...]:
        """What the stretches that are complete say, as in `runtime.observation.counts`."""
        if self.lattice is None:
            return ()
        found = (*self.lattice.findings, *self.unwrapping.findings, *self.said, *self.gaps.findings(self.rate))
        return tuple(dict.fromkeys(found))

    def push(self, position: Array) -> tuple[Array, Array]:
        """q and s_qd, shape (k, n), of the stretches that are complete; s_qd is infinite where the state is unknown."""
        self.held.put(position)
        n = position.shape[1]
        q, s = [np.empty((0, n))], [np.empty((0, n))]
        while self.left and self.held.count >= self.left[0][3] - self.begin:
            begin, first, stop, end = self.left.pop(0)
            x = self.held.take(self.held.count)
            own = x[: end - begin]
            if self.lattice is None:
                self.lattice = lattice(own, self.step, name=self.name)
                self.unwrapping, self.gaps = Unwrapping(n, self.name), Gaps(n)
            counts = self.unwrapping(self.lattice.counts(own), self.left[0][0] if self.left else end)
            part, states, unknown = read_stretch(counts, self.rate, self.lines, self.gaps.rest(counts))
            self.said.update(dict.fromkeys(part.findings if part else ()))
            kept = slice(first - begin, stop - begin)
            self.gaps.take(counts[kept], unknown[kept])
            q.append(self.lattice.position(states[0][kept]))
            s.append(np.where(unknown[kept], np.inf, states[4][kept] * self.lattice.step))
            if self.left:
                self.held.put(x[self.left[0][0] - begin :])
                self.begin = self.left[0][0]
        return np.concatenate(q), np.concatenate(s)
