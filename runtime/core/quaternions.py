"""Motion of a body whose orientation is measured as a quaternion, scalar first.

motion_of_pose(pdd - g, Q, Qd, Qdd)     w0, wd0 and a0 in the axes of the body
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
UPRIGHT = 1e-9  # cosine of a pitch at which roll and yaw are about one axis


def continued(Q: Array) -> Array:
    """Return the quaternions Q, shape (N, 4), with the signs that make their components continuous."""
    turned = np.where(np.einsum("tk,tk->t", Q[1:], Q[:-1]) < 0, -1.0, 1.0)
    return np.asarray(Q * np.concatenate([[1.0], np.cumprod(turned)])[:, None])


def motion_of_pose(a: Array, Q: Array, Qd: Array, Qdd: Array) -> Array:
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


def rotation_of(rpy: tuple[float, float, float]) -> Array:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), of roll, pitch and yaw, rad."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw, rad, of a rotation; roll 0 where the pitch is pi/2 or -pi/2."""
    level = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], level))
    if level < UPRIGHT:
        return 0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))
    return float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))
