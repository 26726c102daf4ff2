"""Limits of acceleration for robots whose files give none, as a URDF never does.

    qdd_j = max(qd_j / T, a_j),    T = 1 s

qd_j is the largest velocity of joint j, which the joint then reaches from rest in the time T. a_j
is the largest acceleration in the records, which the robot has made already:

    a_j = root(1 - s_j) |qdd_j|, a high quantile of all samples (LARGEST in limits.toml)

qdd_j comes from positions through a low-pass filter whose cut-off suits the motion; s_j is the share of
the position noise in its power, so that coarse encoders do not enlarge a_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.core.record import Record
from runtime.core.signals.cutoff import cutoff, noise_share, stands
from runtime.core.signals.filters import filtered_states
from runtime.core.study import Lowpass, Signals
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray


def accelerations(qd: Array, records: Sequence[Record] = ()) -> tuple[Array, Array]:
    """Choose largest accelerations from the largest velocities qd and from records.

    Returns the accelerations, shape (n,), rad/s^2 or m/s^2, and which of them come from the records,
    bool, shape (n,).

    qd : shape (n,), rad/s or m/s, finite.
    """
    own = np.max([np.zeros_like(qd), *(recorded(record) for record in records)], axis=0)
    of_speed = qd / LIMIT.RISE_TIME
    return _rounded(np.maximum(of_speed, own)), own > of_speed


def recorded(record: Record) -> Array:
    """Estimate the largest acceleration of each joint in a record, without position noise.

    Shape (n,), rad/s^2 or m/s^2; 0 for a joint that rests.
    """
    hertz, _ = cutoff([(record.q, record.rate)], Signals())
    low = Lowpass(cutoff=hertz)
    states = filtered_states(record.q, record.rate, replace(Signals(), lowpass=low))
    edge = round(LIMIT.END * record.rate / hertz)  # the filter reflects the ends of the record
    inner = states.qdd[edge : len(record.q) - edge]
    if not len(inner):
        return np.zeros(record.q.shape[1])
    motion = 1 - noise_share(record.q, record.rate, low)
    largest = np.sqrt(motion) * np.quantile(np.abs(inner), LIMIT.LARGEST, axis=0)
    return np.where(stands(record.q, record.rate), 0.0, largest)


def _rounded(x: Array) -> Array:
    """Round to three digits, as these limits are printed."""
    return np.array([float(f"{value:.3g}") for value in x])
