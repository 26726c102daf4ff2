"""Comparison of recorded velocities v with differences of the recorded positions q.

v = gain (dq/dt - lag d2q/dt2) + rest
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.core.signals.cutoff import white_noise
from runtime.core.signals.filters import filtered_states, lowpass_filtered, median_filtered
from runtime.core.study import Signals
from runtime.ground.limits import LIMIT

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SpeedAgreement:
    """Comparison of recorded velocities with differentiated positions, for each joint, shape (n,).

    Attributes
    ----------
    gain : ndarray
        Factor between the differences and the recorded velocity.
    lag : ndarray, s
        Delay of the recorded velocity, whatever its gain; nan if the gain is zero.
    share : ndarray
        Part of the rms of the velocity that the errors of gain and lag make.
    crossing : ndarray, Hz
        Frequency f_c above which the recorded velocity has less noise than the differences.
    """

    gain: Array
    lag: Array
    share: Array
    crossing: Array

    @property
    def agrees(self) -> Array:
        """Whether the recorded velocity of each joint fits the positions, bool, shape (n,)."""
        return np.asarray(self.share <= LIMIT.SPEED_DISAGREES)


def agreement(q: Array, v: Array, rate: float, signals: Signals) -> SpeedAgreement:
    """Compare recorded velocities v with differences of positions q, by gain, delay and noise.

    Both have shape (N, n) and pass the low-pass of the study first.
    """
    states = filtered_states(q, rate, signals)
    v_f, low = median_filtered(v, signals.median), signals.lowpass
    if low is not None:
        for _ in {*low.on}:
            v_f = lowpass_filtered(v_f, rate, low)
    inner = slice(len(q) // 20, len(q) - len(q) // 20)
    found = np.array(
        [
            np.linalg.lstsq(np.column_stack([s, -a]), y, rcond=None)[0]
            for s, a, y in zip(states.qd[inner].T, states.qdd[inner].T, v_f[inner].T, strict=True)
        ]
    )
    gain, product = found.T
    speed, rise = (np.sqrt(np.mean(x[inner] ** 2, axis=0)) for x in (states.qd, states.qdd))
    share = np.hypot(gain - 1, product * rise / np.where(speed > 0, speed, 1.0))
    lag = product / np.where(gain == 0, np.nan, gain)
    noise_q, noise_v = (np.sqrt(white_noise(x, rate, signals.median)) for x in (q, v))
    crossing = noise_v / (2 * np.pi * np.where(noise_q > 0, noise_q, np.inf))
    return SpeedAgreement(gain, lag, np.where(speed > 0, share, np.inf), crossing)
