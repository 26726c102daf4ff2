"""Some instants of the records, filtered once: what every check and every alternative reads.

Filters are linear: a sign, a scale or an exchange of columns acts on the filtered signals as on the measured ones, and a wrong rate
scales velocities and accelerations. So an alternative costs the regressor at these instants and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import InputError
from runtime.observation.filters import Lowpass, filtered_states, lowpass_filtered, median_filtered
from runtime.records.missing import Missing
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.settings.study import Study

Array = np.ndarray

MOST = 500
"""Instants kept of all records."""
DYNAMIC = 25.0
"""Cut-off over the frequency below which 95 % of the power of the velocities lies: a multiple of the rule of the chapter, since accelerations carry higher frequencies."""
EXCERPTS = (8, 40_000)
"""Number and length, samples, of what is read of a record that is read by blocks."""
STANDING = 0.02
"""Speed of a joint that stands, of its largest speed: sign(qd) is noise there, and dry friction is not the law of motion."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Filtered states and torques at K instants.

    Attributes
    ----------
    t : ndarray, shape (K,), s
    q, qd, qdd : ndarray, shape (K, n), rad or m, per s, per s^2
    tau : ndarray, shape (K, n), N m or N
        Measured at the joints, before known torques are subtracted.
    known : ndarray, shape (K, n), N m or N
        Known torques.
    record : ndarray of int, shape (K,)
        Number of the record of each instant.
    cutoff : float, Hz
        Of the low-pass.
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    known: Array
    record: Array
    cutoff: float

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def __len__(self) -> int:
        return len(self.t)

    def standing(self) -> Array:
        """Speed below which each joint is taken to stand, shape (n,), rad/s or m/s."""
        return np.asarray(STANDING * np.abs(self.qd).max(axis=0))

    def moving(self) -> Array:
        """Whether each joint moves at each instant, bool (K, n)."""
        return np.asarray((np.abs(self.qd) > self.standing()) & (np.abs(self.qd) > 0))

    def at(self, chosen: Array) -> Samples:
        """The instants of an index or a mask."""
        arrays = {name: getattr(self, name)[chosen] for name in ("t", "q", "qd", "qdd", "tau", "known", "record")}
        return replace(self, **arrays)

    def thinned(self, most: int) -> Samples:
        """At most `most` instants, evenly drawn."""
        step = -(-len(self) // most)
        return self if step <= 1 else self.at(np.arange(0, len(self), step))


def excerpts(stream: Stream, study: Study) -> list[Record]:
    """EXCERPTS of a stream, evenly spread over the window; the whole of a short one."""
    t0, t1 = study.rows.window
    start = stop = 0
    for t in stream.times():
        start += 0 if t0 is None else int(np.searchsorted(t, t0, side="left"))
        stop += len(t) if t1 is None else int(np.searchsorted(t, t1, side="right"))
    number, length = EXCERPTS
    if stop - start <= number * length:
        number, length = 1, stop - start
    wanted = [(a, a + length) for a in map(int, np.linspace(start, stop - length, number))]
    parts: list[list[tuple[Array, ...]]] = [[] for _ in wanted]
    for first, end in wanted if stream.in_any_order else [(wanted[0][0], wanted[-1][1])]:
        for block in stream.blocks(first, end):
            for part, (a, b) in zip(parts, wanted, strict=True):
                if a < first + len(block[0]) and first < b:
                    part.append(tuple(x[max(a - first, 0) : b - first] for x in block))
            first += len(block[0])
    return [_excerpt(stream, *(np.concatenate(x) for x in zip(*part, strict=True))) for part in parts if part]


def _excerpt(stream: Stream, t: Array, q: Array, tau: Array, missing: Array) -> Record:
    return Record(t, q, tau, name=stream.name, missing=Missing(missing, stream.follows) if missing.any() else None)


def samples_of(records: Sequence[Record], study: Study, most: int = MOST) -> Samples:
    """Filtered instants of all records, in their windows, at most `most`.

    The cut-off is that of the study, or DYNAMIC times the frequency of the motion where that is lower.

    Raises
    ------
    InputError
        Records too short for the filters.
    """
    parts = [_filtered(record, study, number) for number, record in enumerate(records)]
    names = ("t", "q", "qd", "qdd", "tau", "known", "record")
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    every = Samples(**joined, cutoff=min(part.cutoff for part in parts))
    return every.thinned(most)


def motion_cutoff(record: Record, study: Study) -> float:
    """Cut-off of the low-pass, Hz: that of the study, or DYNAMIC times the frequency of the motion where that is lower."""
    low = study.signals.lowpass
    most = min(low.cutoff if low is not None else np.inf, 0.4 * record.rate)
    power = np.abs(np.fft.rfft(np.diff(record.q - record.q.mean(axis=0), axis=0), axis=0)) ** 2
    total = power.sum(axis=0)
    f = np.fft.rfftfreq(len(record) - 1, 1 / record.rate)
    shares = np.cumsum(power, axis=0) / np.where(total > 0, total, 1.0)
    frequency = max((f[int(np.searchsorted(shares[:, j], 0.95))] for j in range(record.n) if total[j] > 0), default=0.0)
    return float(min(most, max(DYNAMIC * frequency, 20 * record.rate / len(record))))


def _filtered(record: Record, study: Study, number: int) -> Samples:
    """One record, one sample in about 0.8 rate/(2 cutoff)."""
    cutoff = motion_cutoff(record, study)
    low = Lowpass(cutoff=cutoff)
    states = filtered_states(record.q, record.rate, replace(study.signals, lowpass=low))
    known = getattr(record, "tau_known", None)
    known = np.zeros_like(record.tau) if known is None else known
    tau, known = (lowpass_filtered(median_filtered(x, study.signals.median), record.rate, low) for x in (record.tau + known, known))
    step = max(1, int(0.8 * record.rate / (2 * cutoff)))
    t0, t1 = study.rows.window
    inside = (record.t >= (-np.inf if t0 is None else t0)) & (record.t <= (np.inf if t1 is None else t1))
    if record.missing is not None:
        inside &= ~record.missing.near_gaps(step, 3 * step)
    kept = np.flatnonzero(inside)[3 * step : -3 * step : step]
    if len(kept) < 2:
        raise InputError("no sample in the window", file=record.name)
    return Samples(
        record.t[kept], states.q[kept], states.qd[kept], states.qdd[kept], tau[kept], known[kept], np.full(len(kept), number), cutoff
    )
