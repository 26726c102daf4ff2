"""Motion of a base that moves: w0, wd0 and a0 from the signals of a record.

    w0, wd0     angular velocity (rad/s) and acceleration (rad/s**2) of frame 0
    a0          acceleration of its origin minus gravity (m/s**2), as an ideal accelerometer reads

all in the axes of frame 0. A record has either these nine signals, or the pose of frame 0 in the
world, position p and unit quaternion Q = (w, x, y, z), with R the rotation matrix of Q:

    w0 = 2 vec(Q* Qd),   wd0 = 2 vec(Q* Qdd),   a0 = R' (pdd - g)

or an inertial measurement unit at r in frame 0, whose gyroscope reads w0 and whose accelerometer
reads f, the acceleration there minus gravity:

    wd0 = dw0/dt,   a0 = f - wd0 x r - w0 x (w0 x r)

Constant biases of gyroscope and accelerometer, which no filter changes, are subtracted
(`runtime.biases`). The filters are those of the joints: p and Q are filtered like positions, the
other signals like velocities. The filtered Q = r u has a length r near 1; the division by r**2 in
vec(Q* Qd)/r**2 = vec(u* ud) removes it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from runtime.core.quaternions import continued, motion_of_pose
from runtime.core.record import (
    BASE_BIASES,
    BASE_GRAVITY,
    BASE_IMU,
    BASE_MOTION,
    BASE_POSITION,
    BASE_QUATERNION,
)
from runtime.core.signals.filters import (
    derivative,
    filtered_states,
    lowpass_filtered,
    median_filtered,
)
from runtime.core.study import Signals

Array = np.ndarray

INPUTS = tuple(f"{family}{k}0" for family in ("W", "WP", "VP") for k in (1, 2, 3))
"""Names of the components of w0, wd0 and a0."""


def base_motion(channels: Mapping[str, Array], rate: float, signals: Signals) -> dict[str, Array]:
    """Compute w0, wd0 and a0, nine signals of shape (N,) by name; {} if the base does not move.

    channels : signals of the record.   rate : Hz.   signals : filters.
    """
    if BASE_MOTION in channels:
        x = _filtered(channels[BASE_MOTION], rate, signals)
    elif BASE_IMU in channels:
        read = _filtered(channels[BASE_IMU][:, :6], rate, signals)
        w, f = np.hsplit(read - channels.get(BASE_BIASES, np.zeros(6)), 2)
        wd, r = derivative(w, rate, signals.ends), channels[BASE_IMU][:, 6:]
        x = np.hstack([w, wd, f - np.cross(wd, r) - np.cross(w, np.cross(w, r))])
    elif BASE_POSITION in channels:
        p = filtered_states(channels[BASE_POSITION], rate, signals)
        unit = channels[BASE_QUATERNION] / np.linalg.norm(
            channels[BASE_QUATERNION], axis=1, keepdims=True
        )
        Q = filtered_states(continued(unit), rate, signals)
        x = motion_of_pose(p.qdd - channels[BASE_GRAVITY], Q.q, Q.qd, Q.qdd)
    else:
        return {}
    return dict(zip(INPUTS, x.T, strict=True))


def _filtered(x: Array, rate: float, signals: Signals) -> Array:
    """Return x, shape (N, k), after the filters of a velocity."""
    x, low = median_filtered(x, signals.median), signals.lowpass
    for state in ("q", "qd"):
        if low is not None and state in low.on:
            x = lowpass_filtered(x, rate, low)
    return x
