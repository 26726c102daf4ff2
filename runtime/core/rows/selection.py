"""Choice of the rows of Y = W X + rho that are used, by time, decimation, speed and known state.

The choice is made once, on the measured record, and every run of a study uses it, so that noise
never decides whether a row is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter1d

from runtime.core.model import GeneratedModel
from runtime.core.record import Record
from runtime.core.rows.switches import switches
from runtime.core.signals.decimation import Plan
from runtime.core.signals.filters import States, decimation_factor, decimation_plan, kept_samples
from runtime.core.study import Rows, Signals
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT
from runtime.ground.settings import to_mapping

Array = np.ndarray

LEAVES_OUT = {
    "trim": "rows.trim",
    "low_speed": "rows.low_speed",
    "mask": "the choice of samples",
    "missing": "positions that are missing",
    "direction": "an uncertain direction of dry friction",
    "torque": "a torque that was not measured",
}
UNMEASURED = 1e9
"""rows.low_speed of a joint whose torque was not measured, beside what else was."""


UNCERTAIN = 0.5
"""Deviations of a speed below which its sign is not used: wrong in 31 % of the cases or more.
Chosen on simulated records (docs/theory/counts.md).
"""


@dataclass(frozen=True, eq=False)
class Selection:
    """Time window of a record, and the decimated rows in it that are used.

    The selection is the same in every run of a study.

    samples : the window, in raw samples.
    kept : shape (K,), kept instants, from the start of the window.
    mask : bool (n, K), rows used.
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

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Settings of filters and row selection, with the decimation factor chosen for "auto"."""
        signals, rows = to_mapping(self.signals), to_mapping(self.rows)
        return {"signals": signals, "rows": rows, "factor": self.factor}

    @property
    def plan(self) -> Plan | None:
        """Matrices (a Plan) that decimate signals in the time window; None without decimation."""
        window, settings = self.samples, self.signals.decimate
        return decimation_plan(window.stop - window.start, self.factor, settings, int(self.kept[0]))


def window_of(
    t: Array, window: tuple[float | None, float | None], file: str, margin: int = 0
) -> tuple[int, int]:
    """Find the samples [start, stop) with t0 <= t <= t1, s; None leaves an end open.

    margin : samples left out at each end of the record, at most a tenth of the record.
    """
    t0, t1 = window
    start = 0 if t0 is None else int(np.searchsorted(t, t0, side="left"))
    stop = len(t) if t1 is None else int(np.searchsorted(t, t1, side="right"))
    if stop <= start:
        raise InputError(
            f"no sample lies in rows.window [{t0}, {t1}] s; the record spans "
            f"[{t[0]:g}, {t[-1]:g}] s",
            file=file,
        )
    margin = min(margin, len(t) // 10)
    return max(start, margin), min(stop, len(t) - margin)


EXCERPT = 2**16
"""Samples of a record by which settings that are automatic are found."""


def excerpt(record: Record, rows: Rows) -> slice:
    """Return the slice of the first samples in the time window, from which "auto" settings follow.

    The length of the slice is limited (`EXCERPT`).
    """
    start, stop = window_of(record.t, rows.window, record.name)
    return slice(start, min(stop, start + EXCERPT))


def instants_of(record: Record, signals: Signals, rows: Rows) -> tuple[slice, int, Array, int]:
    """Choose the time window of a record, and the samples in it that decimation keeps.

    Returns the raw samples of the window, the factor of the decimation, the samples of the window
    that it keeps, shape (K,), and the number of kept samples whose rows are left out at each end.

    The regressor near an end of the record is that of a low-pass which starts there. Decimation
    spreads this error over 27 instants (benchmarks/truth.md, Ends of records). Hence rows.trim:
    auto leaves out some periods of the cutoff before the decimation, and some instants after it
    (END_PERIODS and TRIM in limits.toml).
    """
    auto, low = rows.trim == "auto", signals.lowpass
    trim = LIMIT.TRIM if rows.trim == "auto" else rows.trim
    margin = ceil(LIMIT.END_PERIODS * record.rate / low.hertz) if auto and low is not None else 0
    start, stop = window_of(record.t, rows.window, record.file, margin)
    factor = decimation_factor(signals, record.rate)
    kept = kept_samples(
        stop - start, factor, signals.decimate.phase if signals.decimate else "first"
    )
    K = len(kept)
    if 2 * trim >= K:
        raise InputError(
            f"after decimation by {factor}, the record has {K} rows per joint, of which rows.trim "
            f"leaves out {2 * trim}; use a longer record or window, or a smaller rows.trim",
            file=record.file,
        )
    return slice(start, stop), factor, kept, trim


def select_rows(
    record: Record, qd: Array, signals: Signals, rows: Rows, *, keep: Array | None = None
) -> Selection:
    """Select the rows of a record by time window, decimation, distance from its ends, and speed.

    The mask `keep` of samples (and joints), if given, excludes further rows.

    qd : ndarray, shape (N, n), filtered velocities.
    """
    samples, factor, kept, trim = instants_of(record, signals, rows)
    usable = None if keep is None else _keep(keep, record)
    instants, number = kept + samples.start, np.arange(len(kept))
    mask = np.ones((record.n, len(kept)), dtype=bool)
    dropped, slow = {}, per_joint(rows.slow, record.n, "rows.low_speed")[:, None]
    speed = np.abs(qd)
    if rows.around:
        reach = 2 * round(rows.around * record.rate) + 1
        speed = minimum_filter1d(speed, reach, axis=0, mode="nearest")
    for reason, allowed in (
        ("trim", (number >= trim) & (number < len(kept) - trim)),
        *([("torque", slow < UNMEASURED)] if slow.max() >= UNMEASURED else ()),
        ("low_speed", slow <= speed[instants].T),
        ("mask", True if usable is None else usable[instants].T),
    ):
        before = mask.sum(axis=1)
        mask &= allowed
        dropped[reason] = tuple(int(k) for k in before - mask.sum(axis=1))
    if not mask.any():
        raise InputError(nothing_left(dropped, len(kept)), file=record.file)
    return Selection(
        samples=samples,
        kept=kept,
        mask=mask,
        factor=factor,
        t=record.t[instants],
        rate=record.rate / factor,
        signals=signals,
        rows=rows,
        dropped=dropped,
    )


def nothing_left(dropped: Mapping[str, Sequence[int]], K: int) -> str:
    """Explain in words why none of the K rows of every joint is used.

    dropped : rows left out by reason and joint.
    """
    left_out = ", ".join(
        f"{LEAVES_OUT.get(reason, reason)} leaves out {max(counts)}"
        for reason, counts in dropped.items()
        if any(counts)
    )
    return (
        f"none of the {K} rows per joint is used: {left_out}; change these settings, or remove "
        "this record"
    )


def unused_joints(
    rows: Sequence[int], dropped: Mapping[str, Sequence[int]], joints: Sequence[str]
) -> str:
    """Name in one sentence the joints without used rows and the main reason; "" if there are none.

    Parameters
    ----------
    rows : sequence of int
        Rows used, by joint.
    dropped : mapping of str to sequence of int
        Rows left out, by reason and joint.
    joints : sequence of str
        Names of the joints in results.
    """
    bare = [j for j, count in enumerate(rows) if not count]
    if not bare or not dropped:
        return ""
    reason = max(dropped, key=lambda name: sum(dropped[name][j] for j in bare))
    return (
        f"No row of joint {', '.join(joints[j] for j in bare)} is used: "
        f"{LEAVES_OUT.get(reason, reason)} leaves all these rows out."
    )


def _keep(keep: Array, record: Record) -> Array:
    keep = keep[:, None] if keep.ndim == 1 else keep
    if keep.dtype != np.bool_ or keep.shape not in {(len(record), 1), (len(record), record.n)}:
        raise InputError(
            (
                f"`keep` has dtype {keep.dtype} and shape {keep.shape}; expected bool "
                f"{(len(record),)} or {(len(record), record.n)}"
            ),
            file=record.file,
        )
    return keep


def per_joint(value: float | tuple[float, ...], n: int, name: str) -> Array:
    """Expand a setting that is one number, or one for each joint, to shape (n,)."""
    values = np.atleast_1d(np.asarray(value, dtype=float))
    if values.shape not in {(1,), (n,)}:
        raise InputError(
            f"{name} has {len(values)} values; expected one value, or {n} values (one per joint)"
        )
    return np.broadcast_to(values, (n,))


def certain_rows(
    model: GeneratedModel,
    states: States,
) -> Array:
    """Find the rows with known state and known direction of dry friction, bool, shape (n, K).

    A row of joint j is uncertain if |s| is below half a standard deviation of s (`UNCERTAIN`); s =
    G qd is the speed of a column that switches and acts on j.

    states : shape (K, n), with known errors.
    """
    certain = np.ones(states.q.T.shape, dtype=bool)
    if states.errors is not None:
        certain &= states.errors.known
        for switch in switches(model, model.BASE_PARAMETERS, passive="left out"):
            certain[list(switch.joints)] &= np.abs(
                states.qd @ switch.G
            ) >= UNCERTAIN * states.errors.along(switch.G)
    return certain
