"""Resampling of signals with irregular time stamps at a uniform rate.

    t_k = t_first + k / rate,   k = 0 ... floor((t_last - t_first) rate)
                                for every stretch without gap or step back

There is no interpolation across a gap or a step back of time. Between two samples, the signal is a
straight line, or a cubic spline through all samples of the stretch. For a signal of highest
pulsation w and steps up to h, the error is at most (w h)^2/8 or 5 (w h)^4/384 of its amplitude (de
Boor, A Practical Guide to Splines, 2001, II.(12) and V.(18)), except near the ends of the spline.
Nothing is filtered: a rate below that of the record would cause aliasing, and is refused.

If the samples are uniform but their stamps are not (a controller samples, another computer adds the
stamps), interpolation at the stamps would add an error to the positions, equal to the jitter times
the velocity. The method "count" uses the samples of a stretch as they are, t_k = t_first + k /
rate, and checks their number against the duration of the stamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from runtime.ground.arrays import real
from runtime.ground.clock import GAP, TimeStamps, remedy_text, require_rate, resolution, time_stamps
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT
from runtime.ground.settings import structure
from runtime.reading.settings import Resample

Array = np.ndarray

LOWEST = 0.95  # of the rate of the record
DRIFT = 1e-3  # between the rate and that of the stamps of counted samples, beyond one sample
LAST = 1e-6  # periods; a last instant so little beyond the last sample is that sample


@dataclass(frozen=True, eq=False)
class Stretch:
    """Part of a record without gaps, sampled uniformly: times t, shape (K,), s, and signals."""

    t: Array
    signals: tuple[Array, ...]


def resample(
    t: ArrayLike,
    x: ArrayLike,
    rate: float | None = None,
    *,
    method: Literal["cubic", "linear"] = "cubic",
    longest: float = GAP,
) -> tuple[Array, Array]:
    """Interpolate signals with irregular time stamps at a uniform rate, by a spline or straight
    lines.

        t_k = t[0] + k / rate,   k = 0 ... floor((t[-1] - t[0]) rate)

    Parameters
    ----------
    t : array_like, shape (N,), s
        Time stamps, increasing; of a repeated stamp the first sample is kept.
    x : array_like, shape (N,) or (N, n)
        Samples.
    rate : float, Hz, optional
        Default: the mean rate of the regular steps.
    method : str
        cubic (a cubic spline) or linear (straight lines).
    longest : float, periods
        Steps up to this length are bridged; the period is the median step.

    Returns
    -------
    t : ndarray, shape (K,), s
        Uniform times.
    x : ndarray, shape (K,) or (K, n)
        Signals at these times.

    Raises
    ------
    InputError
        Time that goes back, a longer gap, a rate below that of the record, or numbers that are not
        finite.

    Examples
    --------
    >>> import numpy as np, runtime
    >>> k = np.arange(20)
    >>> stamps = k + 0.1 * np.sin(k)
    >>> t, x = runtime.resample(stamps, 3 * stamps, rate=2)
    >>> t[:4], x[:4].round(6)
    (array([0. , 0.5, 1. , 1.5]), array([0. , 1.5, 3. , 4.5]))
    """
    t, x = real(t, "t"), real(x, "x")
    if t.ndim != 1 or x.ndim not in (1, 2) or len(x) != len(t) or len(t) < LIMIT.FEWEST_SAMPLES:
        raise InputError(
            f"t has shape {t.shape}, x has shape {x.shape}; expected (N,) for t and (N,) or (N, n) "
            f"for x, with N at least {LIMIT.FEWEST_SAMPLES}"
        )
    if not (np.isfinite(t).all() and np.isfinite(x).all()):
        raise InputError("t or x contains nan or infinity; repair or cut the record")
    settings = structure(
        Resample, {"rate": rate, "method": method, "longest": longest, "shortest": 0.0}, ()
    )
    if t[-1] != t[0]:  # else they are told below
        require_rate(t)
    stamps = time_stamps(t, gap=settings.longest)
    if method not in ("cubic", "linear"):
        raise InputError(f"unknown method {method!r}; expected cubic or linear")
    if stamps.gaps or stamps.resets:
        raise InputError(
            f"time has gaps of more than {settings.longest:g} periods, or goes back. "
            f"{remedy_text(t, time_stamps(t), arrays=True)}"
        )
    ((stretch,), _, _) = resampled(
        t, [x[:, None] if x.ndim == 1 else x], stamps, settings, None, file="t"
    )
    return stretch.t, stretch.signals[0][:, 0] if x.ndim == 1 else stretch.signals[0]


def resampled(
    t: Array,
    signals: Sequence[Array],
    stamps: TimeStamps,
    settings: Resample,
    rate: float | None,
    *,
    file: str,
) -> tuple[list[Stretch], float, str]:
    """Resample signals at a uniform rate; return the parts without gaps, the rate, Hz, and a
    remark.

    Parameters
    ----------
    t : ndarray, shape (N,), s
        Time stamps.
    signals : sequence of ndarray, shape (N, n)
        Signals, and masks of bool.
    stamps : TimeStamps
        Regularity of the time stamps.
    settings : Resample
        Method, rate, and treatment of gaps.
    rate : float or None, Hz
        Stated sampling rate of the record, if any.
    """
    if settings.gaps == "refuse" and (stamps.gaps or stamps.resets):
        raise InputError(
            "time has gaps or goes back; set record.resample.gaps: split to cut the record there, or record.resample.longest to bridge longer gaps",
            file=file,
        )
    step = np.diff(t)
    counted = settings.method == "count"
    regular = step[(step >= 0 if counted else step > 0) & (step <= stamps.longest)]
    mean_rate = len(regular) / float(regular.sum())
    wanted = settings.rate or rate or mean_rate
    if wanted < LOWEST * mean_rate:
        raise InputError(
            f"record.resample.rate {wanted:g} Hz is below the rate of the record, {mean_rate:g} "
            f"Hz: frequencies above {wanted / 2:g} Hz would be aliased; resample at the rate of "
            "the record or above, and lower the rate afterwards by signals.decimate",
            file=file,
        )
    cuts = [0, *sorted(s.sample for s in (*stamps.gaps, *stamps.resets)), len(t)]
    stretches = []
    short = 0
    for a, b in pairwise(cuts):
        keep = np.concatenate([[True], (step[a : b - 1] != 0) | counted])
        piece = [x[a:b][keep] for x in signals]
        if np.count_nonzero(keep) < LIMIT.FEWEST_SAMPLES or t[b - 1] - t[a] < settings.shortest:
            short += 1
        elif counted:
            stretches.append(_counted(t[a:b], piece, wanted, file))
        else:
            stretches.append(_uniform(t[a:b][keep], piece, wanted, settings.method))
    if not stretches:
        raise InputError(
            f"no part of the record lasts {settings.shortest:g} s without a gap; lower record.resample.shortest",
            file=file,
        )
    samples = sum(len(stretch.t) for stretch in stretches)
    done = "taken as uniform" if counted else "resampled"
    plural = "es" if len(stretches) > 1 else ""
    parts = [
        f"{done} at {wanted:.6g} Hz ({settings.method}): {samples} samples in {len(stretches)} stretch{plural}"
    ]
    if short:
        parts.append(f"{short} shorter than {settings.shortest:g} s left out")
    if stamps.repeats and not counted:
        parts.append(f"{len(stamps.repeats)} samples of repeated stamps left out")
    return stretches, wanted, ", ".join(parts)


def _counted(t: Array, signals: Sequence[Array], rate: float, file: str) -> Stretch:
    """Replace the time stamps by uniform times t[0] + k/rate, without a change of the signals.

    Raise InputError if the time stamps last longer or shorter than this number of samples.
    """
    N = len(t)
    last = float(t[-1] - t[0])
    if abs(last * rate - (N - 1)) > 1 + DRIFT * N + resolution(t) * rate:
        raise InputError(
            f"the {N} samples after t = {t[0]:g} s last {(N - 1) / rate:.6g} s at the rate "
            f"{rate:.6g} Hz, but {last:.6g} s by their time stamps: the rate is different, or "
            "samples are missing; set record.rate, or cut the record at shorter "
            "gaps by record.resample.longest",
            file=file,
        )
    return Stretch(t[0] + np.arange(N) / rate, tuple(signals))


def _uniform(t: Array, signals: Sequence[Array], rate: float, method: str) -> Stretch:
    """Interpolate the signals at the uniform times t[0] + k/rate."""
    K = int(np.floor((t[-1] - t[0]) * rate + LAST)) + 1
    grid = t[0] + np.arange(K) / rate
    at = np.minimum(grid, t[-1])
    return Stretch(grid, tuple(_interpolated(t, x, at, method) for x in signals))


def _interpolated(t: Array, x: Array, at: Array, method: str) -> Array:
    """Interpolate x, shape (N, n), from the instants t to the instants `at`.

    For a mask, the result is True if a neighbouring sample is marked.
    """
    if method == "cubic" and x.dtype != np.bool_:
        from scipy.interpolate import CubicSpline  # 60 ms, where it is used

        return np.asarray(CubicSpline(t, x, axis=0)(at))
    straight = np.stack([np.interp(at, t, column) for column in x.T], axis=1)
    return straight > LAST if x.dtype == np.bool_ else straight
