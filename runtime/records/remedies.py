"""Which setting of `record.resample` fits a clock that is not uniform, and what each would do to
this record.

With N samples in the time D, pauses aside, and the median step T, N/D below 1/T says that samples
are missing. Three remedies, told with their cost:

    longest   bridges gaps by interpolation: the share of samples that are made
    gaps
        splits the record there: the pieces, and the time that is left in those that are long enough
    rate      takes the samples as uniform, without the time column: the largest shift of a sample

Gaps are bridged up to BRIDGED s or BRIDGED_PERIODS: by the bound 5 (w h)^4/384 of
`runtime.records.resampling` a spline over 10 ms is right to 2e-3 at 10 Hz.
Stamps that scatter about a uniform clock have neighbouring steps that compensate (correlation
-1/2); where they do not, the clock itself wanders.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from runtime.records.time_stamps import Array, TimeStamps, times
from runtime.settings.record import Resample

BRIDGED, BRIDGED_PERIODS = 0.02, 10.0  # s, and periods: gaps up to the longer one are bridged
KEPT = 0.95  # of the time: pieces that keep less are no remedy by themselves
# periods: steps so near to several periods say that samples are missing, others that the clock
# wanders
NEAR = 0.2
SCATTER = -0.25  # correlation of neighbouring steps: below it stamps scatter about a uniform clock
SHORTEST = Resample().shortest


def remedies(t: Array, stamps: TimeStamps, *, arrays: bool = False) -> str:
    """Sentences: how many samples the time asks for, the remedy that fits, what the others would
    do.

    Parameters
    ----------
    t : ndarray, shape (N,), s
        Stamps.
    stamps : TimeStamps
        What they are like.
    arrays : bool
        The record is made of arrays: the remedy is a call, not a setting.
    """
    step = np.diff(t)
    limit = max(BRIDGED / stamps.period, BRIDGED_PERIODS)
    gaps = np.array([gap.step for gap in stamps.gaps]) / stamps.period
    short = gaps[gaps <= limit]
    taken = step[(step > 0) & (step <= limit * stamps.period)]
    mean, most = len(taken) / float(taken.sum()), 1 / stamps.period
    pauses = f", {times(len(gaps) - len(short), 'pause')} aside," if len(short) < len(gaps) else ""
    count = (
        f"{len(taken) + 1} samples in {taken.sum():.6g} s{pauses} are {mean:.6g} Hz, 1/median "
        f"step is {most:.6g} Hz"
    )
    whole = np.round(taken / stamps.period)
    counted = int(np.sum(whole[np.abs(taken / stamps.period - whole) < NEAR] - 1))
    missing = round(float(taken.sum()) / stamps.period) - len(taken)
    if missing > 0 and counted > missing / 2:
        count += (
            f": about {missing} samples are missing ({100 * missing / (len(t) + missing):.2g} %)"
        )
    bridge = (
        f"bridges {times(len(short), 'gap')} of up to {short.max():.0f} periods by interpolation"
        if len(short)
        else ""
    )
    longest = float(np.ceil(short.max() + 0.5)) if len(short) else 0.0
    split, kept = _pieces(t, stamps, 0.0, float(taken.sum()))
    rate = (
        f"record.rate: {mean:.6g} without columns.t would take the samples as uniform and "
        "shift "
        f"them by up to {1e3 * _shift(t, mean):.3g} ms"
    )
    if stamps.resets or (len(gaps) and len(short) < len(gaps)):
        cut, left = _pieces(t, stamps, longest, float(taken.sum()))
        both = f", longest: {longest:g}" if longest and kept < KEPT and left > kept else ""
        text = (
            f"{{gaps: split{both}}} {bridge + ' and ' if both else ''}leaves "
            f"{cut if both else split}"
        )
        others = [
            "with method: count the samples between are taken as uniform",
            *([] if stamps.resets else [rate]),
        ]
    elif len(gaps):
        text, others = (
            f"{{longest: {longest:g}}} {bridge}",
            [f"{{gaps: split}} would leave {split}", rate],
        )
    elif stamps.repeats or _correlation(step) > SCATTER:
        text, others = "{} interpolates at the stamps", [rate]
    else:
        text = "{} interpolates at the stamps, if the samples were taken at them"
        others = [f"the stamps scatter about a uniform clock: if they alone do, {rate}"]
    if arrays:
        bridging = f", longest={longest:g}" if longest and len(short) == len(gaps) else ""
        text = (
            f"runtime.resample(t, q{bridging}), and so for tau"
            if not stamps.resets and len(short) == len(gaps)
            else "one Record for each piece"
        )
        return f"{count}. Remedy: {text}"
    return f"{count}. Remedy: record.resample: {text}{''.join('; ' + other for other in others)}"


def _pieces(t: Array, stamps: TimeStamps, longest: float, whole: float) -> tuple[str, float]:
    """What a split leaves where gaps up to `longest` periods are bridged, in words, and the share
    of the time `whole`.
    """
    cuts = [
        0,
        *sorted(
            s.sample
            for s in (*stamps.gaps, *stamps.resets)
            if not 0 < s.step <= longest * stamps.period
        ),
        len(t),
    ]
    lengths = np.array([t[b - 1] - t[a] for a, b in pairwise(cuts)])
    long = lengths[lengths >= SHORTEST]
    kept = float(long.sum()) / whole
    return (
        f"{times(len(long), 'piece')} of {SHORTEST:g} s or more, {100 * kept:.3g} % of the time",
        kept,
    )


def _shift(t: Array, rate: float) -> float:
    """Largest distance, s, of a sample from the uniform grid of that rate."""
    return float(np.abs(t - t[0] - np.arange(len(t)) / rate).max())


def _correlation(step: Array) -> float:
    off = step - step.mean()
    return float(off[1:] @ off[:-1] / (off @ off)) if np.any(off) else 0.0
