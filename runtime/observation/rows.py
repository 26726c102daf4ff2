"""Which rows of Y = W X + rho are used: a window before evaluation, then decimated rows by their place and speed.

The choice is made once, on the measured record, and shared by every run of a study, so that a row is never kept or dropped because of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.observation.filters import decimation_factor, kept_samples
from runtime.records.record import Record
from runtime.settings.study import Rows, Signals

Array = np.ndarray

LEAVES_OUT = {
    "trim": "rows.trim",
    "low_speed": "rows.low_speed",
    "mask": "the choice of samples",
    "missing": "positions that are missing",
    "direction": "an uncertain direction of dry friction",
}


@dataclass(frozen=True, eq=False)
class Selection:
    """Which samples are evaluated and which decimated rows are kept; shared by every run of a study.

    samples : the window, in raw samples.   kept : shape (K,), kept instants, from the start of the window.   mask : bool (n, K), rows used.
    """

    samples: slice
    kept: Array
    mask: Array
    factor: int
    t: Array
    rate: float
    signals: Signals
    rows: Rows
    dropped: Mapping[str, tuple[int, ...]]


def select_rows(record: Record, qd: Array, signals: Signals, rows: Rows, *, keep: Array | None = None) -> Selection:
    """Window, decimated instants, and the rows left out by trim, low speed and `keep`; qd, shape (N, n), are the filtered velocities."""
    samples = _window(record, rows)
    factor = decimation_factor(signals, record.rate)
    N = samples.stop - samples.start
    kept = kept_samples(N, factor, signals.decimate.phase if signals.decimate else "first")
    instants = kept + samples.start
    if len(kept) <= 2 * rows.trim:
        raise InputError(
            f"{len(kept)} rows per joint after decimation by {factor}, of which rows.trim leaves out {2 * rows.trim}; "
            "use a longer record or window, or a smaller rows.trim",
            file=record.file,
        )
    mask = np.ones((record.n, len(kept)), dtype=bool)
    dropped = {}
    for reason, usable in (
        ("trim", _untrimmed(len(kept), rows.trim)),
        ("low_speed", np.abs(qd[instants].T) >= per_joint(rows.low_speed, record.n, "rows.low_speed")[:, None]),
        ("mask", True if keep is None else _keep(keep, record)[instants].T),
    ):
        before = mask.sum(axis=1)
        mask &= usable
        dropped[reason] = tuple(int(k) for k in before - mask.sum(axis=1))
    if not mask.any():
        raise InputError(nothing_left(dropped, len(kept)), file=record.file)
    return Selection(samples, kept, mask, factor, record.t[instants], record.rate / factor, signals, rows, dropped)


def nothing_left(dropped: Mapping[str, Sequence[int]], K: int) -> str:
    """Why none of the K rows of every joint is used, in words. dropped : rows left out by reason and joint."""
    left_out = ", ".join(f"{LEAVES_OUT.get(reason, reason)} leaves out {max(counts)}" for reason, counts in dropped.items() if any(counts))
    return f"none of its {K} rows per joint is used: {left_out}; choose these settings anew, or leave this record out"


def unused_joints(rows: Sequence[int], dropped: Mapping[str, Sequence[int]], joints: Sequence[int]) -> str:
    """The joints of which no row is used, and what leaves most of them out, a sentence; "" where every joint has rows.

    Parameters
    ----------
    rows : sequence of int
        Rows used, by joint.
    dropped : mapping of str to sequence of int
        Rows left out, by reason and joint.
    joints : sequence of int
        Their numbers.
    """
    bare = [j for j, count in enumerate(rows) if not count]
    if not bare or not dropped:
        return ""
    reason = max(dropped, key=lambda name: sum(dropped[name][j] for j in bare))
    return f"No row of joint {', '.join(str(joints[j]) for j in bare)} is used: {LEAVES_OUT.get(reason, reason)} leaves them out."


def _window(record: Record, rows: Rows) -> slice:
    """Raw samples with t0 <= t <= t1."""
    t0, t1 = rows.window
    start = 0 if t0 is None else int(np.searchsorted(record.t, t0, side="left"))
    stop = len(record) if t1 is None else int(np.searchsorted(record.t, t1, side="right"))
    if stop <= start:
        raise InputError(
            f"no sample in rows.window [{t0}, {t1}] s; the record spans [{record.t[0]:g}, {record.t[-1]:g}] s", file=record.file
        )
    return slice(start, stop)


def _untrimmed(K: int, trim: int) -> Array:
    inside = np.arange(K)
    return (inside >= trim) & (inside < K - trim)


def _keep(keep: Array, record: Record) -> Array:
    keep = keep[:, None] if keep.ndim == 1 else keep
    if keep.dtype != np.bool_ or keep.shape not in {(len(record), 1), (len(record), record.n)}:
        raise InputError(f"keep {keep.dtype} {keep.shape}; expected bool {(len(record),)} or {(len(record), record.n)}", file=record.file)
    return keep


def per_joint(value: float | tuple[float, ...], n: int, name: str) -> Array:
    """A setting that is one number or one per joint, shape (n,)."""
    values = np.atleast_1d(np.asarray(value, dtype=float))
    if values.shape not in {(1,), (n,)}:
        raise InputError(f"{name} has {len(values)} values; expected one or {n}, one per joint")
    return np.broadcast_to(values, (n,))
