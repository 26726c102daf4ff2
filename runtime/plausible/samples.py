"""Selected instants of the records, filtered once, which all checks and trials of errors use.

Filters are linear: a change of sign, scale or column order has the same effect before and after
filtering, and a wrong sampling rate scales velocities and accelerations. So a cause needs only the
regressor at these instants; a cause that does not change the positions needs no new regressor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.record import Record
from runtime.core.rows.prepared import Prepared
from runtime.core.rows.selection import window_of
from runtime.core.signals.cutoff import stands
from runtime.core.signals.filters import (
    States,
    lowpass_filtered,
    median_filtered,
)
from runtime.core.study import Lowpass, Study
from runtime.ground.errors import InputError
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray

SIGNALS = ("t", "q", "qd", "qdd", "tau", "tau_known", "steady", "record")


@dataclass(frozen=True, eq=False)
class Samples:
    """Filtered positions, velocities, accelerations and torques of all joints at K instants.

    Attributes
    ----------
    t : ndarray, shape (K,), s
    q, qd, qdd : ndarray, shape (K, n), rad or m, per s, per s^2
    tau : ndarray, shape (K, n), N m or N
        Measured at the joints, before known torques are subtracted.
    tau_known : ndarray, shape (K, n), N m or N
        Known torques.
    steady : ndarray of bool, shape (K, n)
        Whether the joint keeps its direction within the reach of the low-pass. Near a reversal,
        filtered torques contain only a part of the dry friction, but its regressor sign(qd) is
        complete.
    record : ndarray of int, shape (K,)
        Number of the record to which each instant belongs.
    cutoff : float, Hz
        Cut-off frequency of the low-pass.
    still : ndarray of bool, shape (n,)
        Whether the joint rests in all records.
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    tau_known: Array
    steady: Array
    record: Array
    cutoff: float
    still: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def __len__(self) -> int:
        return len(self.t)

    def standing(self) -> Array:
        """Speed below which each joint counts as resting, shape (n,), rad/s or m/s."""
        return np.asarray(LIMIT.STANDING * np.abs(self.qd).max(axis=0))

    def moving(self) -> Array:
        """Whether each joint moves and keeps its direction at each instant, bool (K, n)."""
        return np.asarray(moving(self.qd) & self.steady & ~self.still)

    def without_motor(self) -> Array:
        """Whether the torque of each joint is zero throughout, bool (n,)."""
        return np.asarray(~self.tau.any(axis=0))

    def constant(self) -> Array:
        """Whether the torque of each joint never changes, bool (n,).

        The value is False for a joint without a motor, whose torque is zero throughout.
        """
        size = np.abs(self.tau).max(axis=0)
        return np.asarray((np.ptp(self.tau, axis=0) <= 1e-9 * size) & ~self.without_motor())

    def thinned(self, most: int) -> Samples:
        """Keep every k-th sample, with the smallest k that leaves at most `most` samples."""
        kept = np.arange(0, len(self), -(-len(self) // most))
        return replace(self, **{name: getattr(self, name)[kept] for name in SIGNALS})


def moving(qd: Array) -> Array:
    """Whether each joint moves at each sample, bool (K, n).

    A joint moves if its speed is above a small share (STANDING in limits.toml) of its largest
    speed.
    """
    return np.asarray(np.abs(qd) > np.maximum(LIMIT.STANDING * np.abs(qd).max(axis=0), 1e-12))


def excerpts(reading: Prepared) -> list[Prepared]:
    """Cut a few excerpts from a long record, spread evenly over the time window of the study.

    The number of excerpts and the samples of each are EXCERPTS in limits.toml. A shorter record
    stays whole.
    """
    record = reading.record
    start, stop = window_of(record.t, reading.study.rows.window, record.name)
    number, length = LIMIT.EXCERPTS
    if stop - start <= number * length:
        return [reading]
    parts = []
    for begin in map(int, np.linspace(start, stop - length, number)):
        samples = slice(begin, begin + length)
        known, missing = record.tau_known, record.missing
        part = replace(
            record,
            t=record.t[begin] + np.arange(length) / record.rate,
            q=record.q[samples],
            tau=record.tau[samples],
            tau_known=None if known is None else known[samples],
            missing=None if missing is None else replace(missing, samples=missing.samples[samples]),
            channels={name: x[samples] for name, x in record.channels.items()},
        )
        parts.append(replace(reading, record=part))
    return parts


@dataclass(frozen=True, eq=False)
class Filtered:
    """A record, with q, qd and qdd filtered by a low-pass whose cut-off suits the motion.

    Attributes
    ----------
    record : Record
    study : Study
    low : Lowpass
        Low-pass whose cut-off is that of the study, or a multiple (DYNAMIC in limits.toml) of the
        frequency of the motion if this is lower.
    states : States
        q, qd, qdd, shape (N, n) each.
    """

    record: Record
    study: Study
    low: Lowpass
    states: States

    def torque(self, tau: Array) -> Array:
        """Filter torques, shape (N, n), by a median filter and the low-pass of the positions."""
        smooth = median_filtered(tau, self.study.signals.torque_median)
        return lowpass_filtered(smooth, self.record.rate, self.low)


def filtered(reading: Prepared, study: Study) -> Filtered:
    """Filter a record with a low-pass whose cut-off suits its motion."""
    record = reading.record
    low = Lowpass(cutoff=motion_cutoff(record, reading.study))
    signals = replace(study.signals, lowpass=low)
    states = reading.reader.at_step(0.0, "joint").states(record, signals)
    return Filtered(record, study, low, replace(states, channels=reading.channels))


def samples_of(records: Sequence[Prepared | Filtered], study: Study) -> Samples:
    """Filter all records, and select at most INSTANTS_KEPT samples (limits.toml) of all records
    together.

    The samples are inside the time window of the study, `rows.window`.

    Raises
    ------
    InputError
        A record is too short for the filters.
    """
    through = [x if isinstance(x, Filtered) else filtered(x, study) for x in records]
    parts = [_instants(record, number) for number, record in enumerate(through)]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in SIGNALS}
    still = np.all([part.still for part in parts], axis=0)
    every = Samples(**joined, cutoff=min(part.cutoff for part in parts), still=still)
    return every.thinned(LIMIT.INSTANTS_KEPT)


def motion_cutoff(record: Record, study: Study) -> float:
    """Choose the cut-off of the low-pass for the motion of a record, Hz.

    The result is the cut-off of the study, or a multiple (DYNAMIC in limits.toml) of the frequency
    of the motion if this is lower. The frequency of the motion is that below which 95 % of the
    power of the velocities lie.
    """
    low = study.signals.lowpass
    most = min(low.hertz if low is not None else np.inf, 0.4 * record.rate)
    power = np.abs(np.fft.rfft(np.diff(record.q - record.q.mean(axis=0), axis=0), axis=0)) ** 2
    total = power.sum(axis=0)
    f = np.fft.rfftfreq(len(record) - 1, 1 / record.rate)
    shares = np.cumsum(power, axis=0) / np.where(total > 0, total, 1.0)
    frequency = max(
        (f[int(np.searchsorted(shares[:, j], 0.95))] for j in range(record.n) if total[j] > 0),
        default=0.0,
    )
    return float(min(most, max(LIMIT.DYNAMIC * frequency, 20 * record.rate / len(record))))


def usable(record: Record, study: Study, before: int, after: int) -> Array:
    """Whether each sample is in the time window and far from missing samples, bool (N,)."""
    t0, t1 = study.rows.window
    inside = (record.t >= (-np.inf if t0 is None else t0)) & (
        record.t <= (np.inf if t1 is None else t1)
    )
    if record.missing is not None:
        inside &= ~record.missing.near_gaps(before, after)
    return inside


def _instants(through: Filtered, number: int) -> Samples:
    """Select samples of one filtered record, about 0.4/f seconds apart (f: cut-off frequency).

    If a long record gives fewer than INSTANTS_LEAST samples (limits.toml), twice as many are
    selected. The first and last 2/f seconds of the time window are left out.
    """
    record, states, cutoff = through.record, through.states, through.low.hertz
    known = np.zeros_like(record.tau) if record.tau_known is None else record.tau_known
    step = max(1, int(0.8 * record.rate / (2 * cutoff)))
    inside = np.flatnonzero(usable(record, through.study, step, 3 * step))[5 * step : -5 * step]
    seconds = len(inside) / record.rate
    few = len(inside) < LIMIT.INSTANTS_LEAST * step and seconds > LIMIT.SLOW_RECORD
    finer = 2 if few else 1
    kept = inside[:: max(1, step // finer)]
    if len(kept) < 2:
        raise InputError(
            "too few samples in rows.window; use a longer window or record", file=record.name
        )
    steady = np.stack([_steady(qd, record.rate / cutoff) for qd in states.qd.T], axis=1)
    motion = (record.t, states.q, states.qd, states.qdd)
    signals = (*motion, through.torque(record.tau), through.torque(known), steady)
    used = {name: x[kept] for name, x in zip(SIGNALS, signals, strict=False)}
    number_of_each = np.full(len(kept), number)
    still = stands(record.q, record.rate, through.study.signals.median)
    return Samples(**used, record=number_of_each, cutoff=cutoff, still=still)


def _steady(qd: Array, reach: float) -> Array:
    """Whether a velocity keeps its sign within `reach` samples of each sample, bool (N,).

    If less than half of the samples do so, the reach is halved, then set to zero.
    """
    turned = np.cumsum(np.diff(np.sign(qd), prepend=np.sign(qd[:1])) != 0)
    k = np.arange(len(qd))
    for far in (round(reach), round(reach / 2)):
        steady = turned[(k + far).clip(max=len(qd) - 1)] == turned[(k - far).clip(min=0)]
        if 2 * steady.sum() >= len(qd):
            return np.asarray(steady)
    return np.ones(len(qd), dtype=bool)
