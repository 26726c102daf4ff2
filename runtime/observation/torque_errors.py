"""Deviations of a reading of counts that allow for what the torque says and counts do not show.

    rho = tau - W(q, qd, qdd) X          at every sample, states as read
    e = R M(q)^-1 rho                    what the encoders are accelerated by beyond qdd
    s_qdd^2 + mean e^2                   above HIGH, over WINDOW; s_qd and s_q alike with the first and second integral of e

A prior of smooth jerk knows neither the torque of a controller that answers single counts nor its limit cycles; the torque does. e is the error of the
acceleration where the model, X and tau are exact. Errors of these count as accelerations too, so that deviations are then too large.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.ndimage import uniform_filter1d

from runtime.errors import InputError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.observation.counts import Reading
from runtime.observation.filters import lowpass_filtered
from runtime.observation.states import encoder_root
from runtime.settings.study import Lowpass

Array = np.ndarray

HIGH, WINDOW = 20.0, 0.05
"""Frequency, Hz, below which a residual is one of the model or its friction, and the time of a mean square, s."""
HELD = 0.004
"""Time for which M(q) is held, s."""


def widened(
    reading: Reading,
    model: GeneratedModel,
    torque: Array,
    X: Array,
    rate: float,
    *,
    drives: Drives | None = None,
    constants: Mapping[str, float] | None = None,
) -> Reading:
    """The reading with s_q, s_qd and s_qdd that allow for the torque.

    Parameters
    ----------
    reading : Reading
        Of the encoders.
    model : GeneratedModel
    torque : ndarray, shape (N, n), N m or N
        Joint side, at the instants of the counts, as commanded or measured; its noise counts as acceleration.
    X : ndarray, shape (b,)
        Base parameters, such as those identified from the same counts; 0 for what is not determined.
    rate : float, Hz
        Sampling rate.
    drives : Drives, optional
        Between the joints and the encoders; default: encoders at the joints.
    constants : mapping of str to float, optional
        Values in place of the robot file's.

    Raises
    ------
    InputError
        Shapes that differ; X whose inertia matrix is not positive definite.
    """
    N, n = reading.q.shape
    if torque.shape != (N, n) or X.shape != (len(model.BASE_PARAMETERS),):
        raise InputError(f"torque {torque.shape}, X {X.shape}; expected {(N, n)} and ({len(model.BASE_PARAMETERS)},)")
    root = encoder_root(drives, n)
    q = reading.q if drives is None else drives.joint_position(reading.q)
    qd, qdd = reading.qd @ root.T, reading.qdd @ root.T
    rho = torque - cast(Any, model).inverse_dynamics(q, qd, qdd, X, **(constants or {}))
    held = max(1, round(HELD * rate))
    M = _inertia(model, q[::held], X, constants or {})
    if np.linalg.eigvalsh(M).min() <= 0:
        raise InputError(
            "the inertia matrix of X is not positive definite on this motion; give parameters that a robot can have (method feasible)"
        )
    joints = np.linalg.solve(M[np.arange(N) // held], rho[:, :, None])[:, :, 0]
    low = Lowpass(cutoff=min(HIGH, rate / 8))
    e = _above(joints @ np.linalg.inv(root).T, rate, low)
    v = _above(np.cumsum(e, axis=0) / rate, rate, low)
    x = _above(np.cumsum(v, axis=0) / rate, rate, low)
    samples = max(1, round(WINDOW * rate))
    stated = ((reading.s_q, x), (reading.s_qd, v), (reading.s_qdd, e))
    s_q, s_qd, s_qdd = (np.sqrt(s**2 + uniform_filter1d(error**2, samples, axis=0)) for s, error in stated)
    return replace(reading, s_q=s_q, s_qd=s_qd, s_qdd=s_qdd)


def _inertia(model: GeneratedModel, q: Array, X: Array, constants: Mapping[str, float]) -> Array:
    """M(q) of every sample, shape (K, n, n): torques of unit accelerations at rest less those of none."""
    dynamics, rest = cast(Any, model).inverse_dynamics, np.zeros_like(q)
    none = dynamics(q, rest, rest, X, **constants)
    return np.stack([dynamics(q, rest, np.broadcast_to(unit, q.shape), X, **constants) - none for unit in np.eye(q.shape[1])], axis=2)


def _above(x: Array, rate: float, low: Lowpass) -> Array:
    return np.asarray(x - lowpass_filtered(x, rate, low))
