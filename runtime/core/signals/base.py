"""Motion of a base that moves: w0, wd0 and a0 from the signals that a record has of it.

    w0, wd0     angular velocity (rad/s) and acceleration (rad/s**2) of frame 0
    a0          acceleration of its origin minus gravity (m/s**2): an ideal accelerometer there

all in the axes of frame 0. A record has either these nine signals, or the pose of frame 0 in the
world, position p and unit quaternion Q = (w, x, y, z), with R the rotation matrix of Q:

    w0 = 2 vec(Q* Qd),   wd0 = 2 vec(Q* Qdd),   a0 = R' (pdd - g)

or an inertial measurement unit at r in frame 0, whose gyroscope reads w0 and whose accelerometer
reads f, the acceleration there minus gravity:

    wd0 = dw0/dt,   a0 = f - wd0 x r - w0 x (w0 x r)

The filters are those of the joints: p and Q pass them like positions, the others like velocities.
The filtered Q = r u has a length r near 1, which vec(Q* Qd)/r**2 = vec(u* ud) takes out.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from runtime.core.signals.filters import (
    derivative,
    filtered_states,
    lowpass_filtered,
    median_filtered,
)
from runtime.core.study import Signals

Array = np.ndarray

MOTION, POSITION, QUATERNION = "base_motion", "base_position", "base_quaternion"
"""Channels of a record: w0, wd0, a0 (N, 9); p (N, 3), m; Q (N, 4), scalar first."""
IMU = "base_imu"
"""Channel with w0 (rad/s), f (m/s**2) and r (m) in the axes of frame 0, (N, 9)."""
GRAVITY = "base_gravity"
"""Channel with the acceleration of gravity in the axes of the world, (N, 3), m/s**2."""
INPUTS = tuple(f"{family}{k}0" for family in ("W", "WP", "VP") for k in (1, 2, 3))
"""Names of the components of w0, wd0 and a0."""


def base_motion(channels: Mapping[str, Array], rate: float, signals: Signals) -> dict[str, Array]:
    """Compute w0, wd0 and a0, nine signals of shape (N,) by name; {} if the base does not move.

    channels : signals of the record.   rate : Hz.   signals : filters.
    """
    if MOTION in channels:
        x = _filtered(channels[MOTION], rate, signals)
    elif IMU in channels:
        w, f = np.hsplit(_filtered(channels[IMU][:, :6], rate, signals), 2)
        wd, r = derivative(w, rate, signals.ends), channels[IMU][:, 6:]
        x = np.hstack([w, wd, f - np.cross(wd, r) - np.cross(w, np.cross(w, r))])
    elif POSITION in channels:
        p = filtered_states(channels[POSITION], rate, signals)
        unit = channels[QUATERNION] / np.linalg.norm(channels[QUATERNION], axis=1, keepdims=True)
        Q = filtered_states(continued(unit), rate, signals)
        x = of_pose(p.qdd - channels[GRAVITY], Q.q, Q.qd, Q.qdd)
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


def continued(Q: Array) -> Array:
    """Return the quaternions Q, shape (N, 4), with signs that make them continuous."""
    turned = np.where(np.einsum("tk,tk->t", Q[1:], Q[:-1]) < 0, -1.0, 1.0)
    return np.asarray(Q * np.concatenate([[1.0], np.cumprod(turned)])[:, None])


def of_pose(a: Array, Q: Array, Qd: Array, Qdd: Array) -> Array:
    """Compute w0, wd0 and a0, shape (N, 9).

    a : pdd - g in the axes of the world, shape (N, 3), m/s**2.   Q : quaternions of about unit
    length, scalar first, with their derivatives, shape (N, 4).
    """
    r2 = np.einsum("tk,tk->t", Q, Q)[:, None]
    w = 2 * _vector_of_product(Q, Qd) / r2
    shrinking = 2 * np.einsum("tk,tk->t", Q, Qd)[:, None] / r2
    wd = 2 * _vector_of_product(Q, Qdd) / r2 - shrinking * w
    s, v = Q[:, :1], Q[:, 1:]
    turned = a - 2 * (s * np.cross(v, a) - np.cross(v, np.cross(v, a))) / r2  # R' a
    return np.hstack([w, wd, turned])


def _vector_of_product(Q: Array, P: Array) -> Array:
    """Return the vector part of the product Q* P of quaternions, shape (N, 3)."""
    s, v = Q[:, :1], Q[:, 1:]
    return np.asarray(s * P[:, 1:] - P[:, :1] * v - np.cross(v, P[:, 1:]))
