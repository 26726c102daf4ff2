"""Motion of a body whose orientation is measured as a quaternion, scalar first.

motion_of_pose(pdd - g, Q, Qd, Qdd)     w0, wd0 and a0 in the axes of the body
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def continued(Q: Array) -> Array:
    """Return the quaternions Q, shape (N, 4), with signs that make them continuous."""
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
