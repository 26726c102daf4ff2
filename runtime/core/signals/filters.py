"""Filters of an off-line identification, none of which shifts the phase (chapter 2.2.2).

    median -> Butterworth forward and backward -> central differences        q  -> q, qd, qdd
    Chebyshev I forward and backward -> one sample in n_d, eq. (13)          Y and every column of W

All filters are in second-order sections: the (b, a) form of the decimation is wrong by 2e-3 at a
factor of 40 and diverges at 100. Both ends are extended by odd reflection: MATLAB's filtfilt uses
3*(filter length - 1) samples, scipy's default is 3*(filter length).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import floor

import numpy as np
from scipy import ndimage
from scipy.signal import butter, sosfiltfilt

from runtime.core.signals.decimation import CUTOFF, ORDER, Plan, decimate, plan
from runtime.core.study import Decimate, Lowpass, Signals
from runtime.ground.errors import InputError

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SpeedErrors:
    """Standard deviations of encoder velocities, and their conversion to joint velocities.

    deviation : ndarray, shape (N, encoders), standard deviation of each encoder velocity, per s;
        infinite if counts are missing and the state is unknown. Errors of different encoders are
        independent.
    root : ndarray, shape (n, encoders), joint velocity per encoder velocity.
    """

    deviation: Array
    root: Array

    def __getitem__(self, samples: slice | Array) -> SpeedErrors:
        return SpeedErrors(self.deviation[samples], self.root)

    def along(self, G: Array) -> Array:
        """Compute the standard deviation of a combination G qd of joint velocities, shape (N,)."""
        finite = np.where(self.known[:, None], self.deviation, 0.0)
        return np.where(self.known, np.sqrt(finite**2 @ (G @ self.root) ** 2), np.inf)

    @property
    def known(self) -> Array:
        """Whether the states of all joints are known at each sample, bool, shape (N,)."""
        return np.asarray(np.isfinite(self.deviation).all(axis=1))


@dataclass(frozen=True, eq=False)
class States:
    """Joint positions, velocities and accelerations, shape (N, n) each, rad or m, per s, per s^2.

    errors : errors of the velocities, if they are known; None: the velocities count as exact.
    findings : sentences of the reader about the encoders.
    channels : functions of time on which laws of the model depend, (N,) by name.
    """

    q: Array
    qd: Array
    qdd: Array
    errors: SpeedErrors | None = None
    findings: tuple[str, ...] = ()
    channels: Mapping[str, Array] = field(default_factory=dict)

    def __getitem__(self, samples: slice | Array) -> States:
        errors = None if self.errors is None else self.errors[samples]
        states, channels = (self.q, self.qd, self.qdd), self.channels.items()
        q, qd, qdd = (x[samples] for x in states)
        return States(q, qd, qdd, errors, self.findings, {c: x[samples] for c, x in channels})

    def __len__(self) -> int:
        return len(self.q)


def filtered_states(q: Array, rate: float, signals: Signals, v: Array | None = None) -> States:
    """Compute q, qd, qdd from measured positions by median, low-pass and central differences.

    Order: median, low-pass on q, difference, low-pass on qd, difference.

    q : ndarray, shape (N, n), rad or m.   rate : Hz.   v : recorded velocities, shape (N, n), which
    replace the differences above the frequency signals.velocity.
    """
    q = median_filtered(q, signals.median)
    low = signals.lowpass
    if low is not None and "q" in low.on:
        q = lowpass_filtered(q, rate, low)
    qd = derivative(q, rate, signals.ends)
    if v is not None and not isinstance(signals.velocity, str):
        v = median_filtered(v, signals.median)
        if low is not None and "q" in low.on:
            v = lowpass_filtered(v, rate, low)
        qd = blended(qd, v, rate, signals.velocity)
    if low is not None and "qd" in low.on:
        qd = lowpass_filtered(qd, rate, low)
    return States(q, qd, derivative(qd, rate, signals.ends))


def blended(qd: Array, v: Array, rate: float, crossing: float | tuple[float, ...]) -> Array:
    """Combine velocities: differentiated positions qd at low, recorded v at high frequencies.

    The result v + L (qd - v), shape (N, n), uses the zero-phase first-order low-pass L at
    `crossing`, Hz (`runtime.speeds`).
    """
    mixed = qd.copy()
    for j, f in enumerate(np.broadcast_to(crossing, qd.shape[1:]).tolist()):
        if f < rate / 2:
            low = Lowpass(cutoff=f, order=1)
            mixed[:, j] = v[:, j] + lowpass_filtered(qd[:, j] - v[:, j], rate, low)
    return mixed


IN_CACHE = 4096
"""Samples of a running median computed at a time."""


def median_filtered(x: Array, window: int) -> Array:
    """Compute the running median over `window` samples of each column of x, shape (N, n).

    The ends repeat the end value.
    """
    if window == 1:
        return x
    if window not in (3, 5):
        return np.asarray(ndimage.median_filter(x, size=(window, 1), mode="nearest"))
    extended = np.concatenate(
        [np.repeat(x[:1], window // 2, axis=0), x, np.repeat(x[-1:], window // 2, axis=0)]
    )
    found = np.empty_like(x)
    for start in range(0, len(x), IN_CACHE):
        count = min(IN_CACHE, len(x) - start)
        shifted = [extended[start + k : start + k + count] for k in range(window)]
        a, b = (shifted[0], shifted[1]) if window == 3 else _inner(*shifted[:4])
        middle = np.minimum(np.maximum(a, b), shifted[-1])
        np.maximum(np.minimum(a, b), middle, out=found[start : start + count])
    return found


def _inner(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Find the two middle values of four, from which the median with a fifth value follows."""
    return np.maximum(np.minimum(a, b), np.minimum(c, d)), np.minimum(
        np.maximum(a, b), np.maximum(c, d)
    )


LONG = 100_000
"""Samples from which signals are filtered one after another, without copies of all of them."""


def lowpass_filtered(x: Array, rate: float, low: Lowpass) -> Array:
    """Filter x, shape (N, n), along its first axis by a zero-phase Butterworth low-pass.

    Each of the two passes has a gain of -3 dB at the cut-off.
    """
    if x.ndim == 1 or len(x) < LONG:
        return zero_phase(*butterworth(rate, low), x, axis=0)
    found = np.empty(x.shape[::-1]).T
    for j, column in enumerate(x.T):  # so that the copies of the filter are those of one column
        found[:, j] = zero_phase(*butterworth(rate, low), column, axis=0)
    return found


@lru_cache(maxsize=32)
def butterworth(rate: float, low: Lowpass) -> tuple[Array, int]:
    """Design the Butterworth low-pass as second-order sections, shape (sections, 6).

    Returns also the number of samples that extend each end of a record.
    """
    if low.hertz >= rate / 2:
        raise InputError(
            f"the low-pass has the cut-off frequency {low.hertz:g} Hz, but must be below the "
            f"Nyquist frequency {rate / 2:g} Hz, half the rate of the record; lower "
            f"signals.lowpass.cutoff, or correct record.units.t if the rate {rate:g} Hz is wrong"
        )
    sos = butter(low.order, low.hertz, fs=rate, output="sos")
    length = low.order + 1
    return sos, 3 * (length - 1) if low.padding == "matlab" else 3 * length


def derivative(x: Array, rate: float, ends: str = "one-sided") -> Array:
    """Differentiate x along its first axis by central differences (x_(k+1) - x_(k-1)) rate/2.

    At both ends differences are one-sided, of first order if `ends` is "one-sided", else of second
    order.
    """
    return np.asarray(np.gradient(x, 1 / rate, axis=0, edge_order=1 if ends == "one-sided" else 2))


CLOCK = 1e-6
"""Relative error of a rate that comes from a time column: 20 stays 20."""


def decimation_factor(signals: Signals, rate: float) -> int:
    """Return the decimation factor: as set, or n_d = 0.8 ws/(2 wf), eq. (13) of the chapter.

    n_d is rounded down to keep the band up to the cut-off wf; ws is the sampling frequency. The
    factor is 1 without decimation.
    """
    if signals.decimate is None:
        return 1
    if signals.decimate.factor != "auto":
        return signals.decimate.factor
    if signals.lowpass is None:
        raise InputError(
            "signals.decimate.factor: auto needs the cut-off frequency of a low-pass, eq. (13), but "
            "signals.lowpass is not set; give the factor as a number"
        )
    return max(1, floor(CUTOFF * rate / (2 * signals.lowpass.hertz) * (1 + CLOCK)))


def kept_samples(N: int, factor: int, phase: str) -> Array:
    """Return the indices of the samples that decimation keeps: every `factor`-th sample.

    The first sample is kept, or the last one (MATLAB).
    """
    first = 0 if phase == "first" else factor - 1 - (factor * -(-N // factor) - N)
    return np.arange(first, N, factor)


def decimated(x: Array, factor: int, settings: Decimate | None) -> Array:
    """Decimate x, shape (..., N), along its last axis after a zero-phase Chebyshev I filter.

    One sample in `factor` is kept. A factor of 1 returns x.

    The filter has even order and the gain 10**(-2*0.05/20) = 0.98855 at zero frequency. Y and every
    column of W, including offsets, must therefore pass the same filter.
    """
    how = decimation_plan(x.shape[-1], factor, settings)
    return (
        x if how is None else decimate(x.reshape(-1, x.shape[-1]), how).reshape(*x.shape[:-1], -1)
    )


def decimation_plan(
    N: int, factor: int, settings: Decimate | None, first: int | None = None
) -> Plan | None:
    """Compute the matrices for the decimation of N samples; None for a factor of 1.

    first : first kept sample; default: by the settings.
    """
    if factor == 1 or settings is None:
        return None
    pad = 3 * ORDER if settings.padding == "matlab" else 3 * (ORDER + 1)
    require_longer(N, pad)
    return plan(
        N, factor, int(kept_samples(N, factor, settings.phase)[0]) if first is None else first, pad
    )


def zero_phase(sos: Array, pad: int, x: Array, axis: int) -> Array:
    """Filter x forward and backward along `axis`, so that the phase does not change.

    `pad` reflected samples extend each end; each pass starts in the steady state of its first
    value.
    """
    require_longer(x.shape[axis], pad)
    return np.asarray(sosfiltfilt(sos, x, axis=axis, padtype="odd", padlen=pad))


def require_longer(samples: int, pad: int) -> None:
    """Raise InputError unless there are more samples than the `pad` samples added at each end."""
    if samples <= pad:
        raise InputError(
            f"the record has {samples} samples; this zero-phase filter needs more than {pad}, use "
            "a longer record or window, or a lower order"
        )
