"""Effect of the filters of an identification on white position noise.

The second moments are exact, from the frequency responses of the filters. Raw errors of one encoder
are independent from sample to sample, variance 1. All filters are linear,
of zero phase and of magnitude known at every frequency w (rad per sample), fs the sampling rate:

    low-pass
        |H|^2, H the Butterworth filter run forward and backward, if `lowpass.on` names the signal
    difference    i fs sin w
    dq            K_1 = |H|^2           dqd  K_2 = |H|^2 K_1 i fs sin w          dqdd
                  K_3 = K_2 i fs sin w
    decimation    |G|^2, G the Chebyshev filter

    covariance of (dq, dqd, dqdd)                            C_0 = 1/(2 pi) int K K^* dw
    covariance after decimation                              C   = 1/(2 pi) int |G|^4 K K^* dw
    correlation of dqd at lag k, rho_k                       transform of |K_2|^2, rho_0 = 1
    sum of products of the decimation's impulse response, r_k      transform of |G|^4

The ends of a record, where filters reflect it, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log2

import numpy as np
from scipy.signal import cheby1, sosfreqz

from runtime.core.signals.decimation import CUTOFF, ORDER, RIPPLE
from runtime.core.signals.filters import butterworth, decimation_factor
from runtime.core.study import Signals
from runtime.ground.errors import SettingsError

Array = np.ndarray

FREQUENCIES = 2**13
"""Frequencies from 0 to the Nyquist frequency, at least: impulse responses up to this many samples
are exact.
"""
MEMORY = 10
"""Length of the response of a low-pass, over 1/cut-off: there it has decayed below 1e-9."""


@dataclass(frozen=True, eq=False)
class Bandwidth:
    """Covariance of the filtered states q, qd, qdd for white position noise of variance 1.

    before : C_0, ndarray, shape (3, 3), of (dq, dqd, dqdd).
    after : C, the covariance after decimation.
    gain : gain of the decimation at frequency 0.
    speed : rho_k, k = 0, 1 ...: correlation of dqd.
    decimation : r_k of the decimation filter; r_0, the variance of decimated white noise, is 1
        without decimation.
    """

    before: Array
    after: Array
    gain: float
    speed: Array
    decimation: Array


def bandwidth(signals: Signals, rate: float) -> Bandwidth:
    """Compute how the filters in the settings `signals` change white position noise.

    rate : sampling rate, Hz. Raise SettingsError for a median filter, which is not linear.
    """
    if signals.median != 1:
        raise SettingsError(
            (
                f"a median filter over {signals.median} samples is not linear, so the advisor "
                "cannot predict its effect; set median: 1, or use symgen cestac without --advise"
            ),
            path=("cestac", "median"),
        )
    low, factor = signals.lowpass, decimation_factor(signals, rate)
    longest = 0.0 if low is None else MEMORY * rate / low.hertz
    w = np.linspace(0, np.pi, max(FREQUENCIES, 2 ** ceil(log2(max(longest, 1)))) + 1)
    H = np.ones_like(w) if low is None else _power(butterworth(rate, low)[0], w)
    on = () if low is None else low.on
    slope = 1j * rate * np.sin(w)
    K1 = H if "q" in on else np.ones_like(w)
    K2 = K1 * slope * (H if "qd" in on else 1.0)
    K = np.array([K1, K2, K2 * slope])
    G = (
        np.ones_like(w)
        if factor == 1
        else _power(cheby1(ORDER, RIPPLE, CUTOFF / factor, output="sos"), w)
    )
    speed = _transform(np.abs(K2) ** 2)
    return Bandwidth(
        _covariance(K), _covariance(K * G), float(G[0]), speed / speed[0], _transform(G**2)
    )


def _power(sos: Array, w: Array) -> Array:
    """Compute the gain |H|^2 of a filter that runs forward and backward, at the frequencies w."""
    return np.asarray(np.abs(sosfreqz(sos, w)[1]) ** 2)


def _covariance(K: Array) -> Array:
    """Compute the covariance, shape (3, 3), of three signals from their frequency responses K.

    The covariance is the mean of K K^* over all frequencies from -pi to pi rad per sample.
    """
    ends = K[:, [0, -1]]
    return np.asarray(((K @ K.conj().T).real - (ends @ ends.conj().T).real / 2) / (K.shape[1] - 1))


def _transform(spectrum: Array) -> Array:
    """Compute the correlation at lags 0, 1, 2 ... of a signal from its real, even spectrum."""
    return np.asarray(np.fft.irfft(spectrum)[: len(spectrum) - 1])
