"""Check whether mounting and units of the sensor on a base that moves are as the study states.

A gyroscope reads w and an accelerometer f in the axes of the sensor. Another reading of the record,

    w' = u G w ,    f' = s v G f ,

has a rotation G by multiples of 90 degrees (24 of them), the sign s of the accelerometer, and the
factors u and v of the units deg/s and g where the size of the signals suggests them. Each reading
gives another motion of the base, hence other rows. The parameters are fitted to a part of the rows
of each reading; a reading that halves the error is reported.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import Any

import numpy as np

from runtime.core.quaternions import roll_pitch_yaw, rotation_of
from runtime.core.record import BASE_IMU
from runtime.core.result import Identification
from runtime.core.rows.prepared import Prepared
from runtime.core.signals.base import INPUTS
from runtime.ground.limits import LIMIT
from runtime.ground.part import Doubt

Array = np.ndarray
INSTANTS = 300  # of all records
STANDARD_GRAVITY = 9.80665  # m/s**2
RIDGE = 1e-12  # of the largest eigenvalue of W'W


def sensor_axes(result: Identification) -> Doubt | None:
    """Report a rotation, sign or unit of the sensor on the base that explains the record much
    better.

    The result is None if there is no sensor, or if no other reading halves the error.
    """
    owned = [own for own in result.problem.prepared if BASE_IMU in own.record.channels]
    if not owned or result.estimate.relative_error < LIMIT.AXES_DOUBTED:
        return None
    samples = [_sampled(own, INSTANTS // len(owned)) for own in owned]
    readings = list(product(ROTATIONS, (1.0, -1.0), _factors(samples)))
    errors = [_error(result.model, samples, *reading) for reading in readings]
    best, stated = int(np.argmin(errors)), _error(result.model, samples, np.eye(3), 1.0, (1.0, 1.0))
    if not errors[best] < stated / 2:
        return None
    what = _written(result, *readings[best])
    return Doubt(
        "sensor_axes",
        "Sensor on the base",
        f"With {what}, the model leaves {100 * errors[best]:.1f} % of the torques unexplained "
        f"instead of {100 * stated:.1f} %: is the sensor on the base mounted so?",
    )


def _rotations() -> list[Array]:
    """Return the 24 rotations by multiples of 90 degrees; none comes first."""
    found = [
        np.eye(3)[list(p)] * s for p in permutations(range(3)) for s in product((1, -1), repeat=3)
    ]
    return [G for G in found if np.linalg.det(G) > 0]


ROTATIONS = _rotations()


class _Samples:
    """Some instants of a record: states, motion of the base, torques Y (n, K) and rows used."""

    def __init__(self, own: Prepared, at: Array) -> None:
        selection, states = own.selection, own.states[own.selection.samples][own.selection.kept][at]
        self.q, self.qd, self.qdd = states.q, states.qd, states.qdd
        self.further = {c: x for c, x in states.channels.items() if c not in INPUTS}
        w, wd, a = np.split(np.stack([states.channels[c] for c in INPUTS], axis=1), 3, axis=1)
        self.r = own.record.channels[BASE_IMU][0, 6:]
        self.w, self.wd, self.f = w, wd, a + _lever(w, wd, self.r)
        self.Y, self.used = own.torque[:, at], selection.mask[:, at]


def _lever(w: Array, wd: Array, r: Array) -> Array:
    """Return wd x r + w x (w x r): the difference between the readings of an accelerometer at r and
    one at the origin.
    """
    return np.asarray(np.cross(wd, r) + np.cross(w, np.cross(w, r)))


def _sampled(own: Prepared, count: int) -> _Samples:
    K = own.torque.shape[1]
    return _Samples(own, np.unique(np.linspace(0, K - 1, min(K, count)).astype(int)))


def _factors(samples: list[_Samples]) -> list[tuple[float, float]]:
    """List factors of the gyroscope and of the accelerometer that the size of the signals suggests."""
    f = float(np.median([np.median(np.linalg.norm(s.f, axis=1)) for s in samples]))
    w = max(float(np.abs(s.w).max()) for s in samples)
    least, most = LIMIT.FORCE_OF_SI
    of_f = STANDARD_GRAVITY if f < least else 1 / STANDARD_GRAVITY if f > most else 1.0
    return [*dict.fromkeys(product((1.0, *([np.pi / 180] * (w > LIMIT.FAST_BASE))), (1.0, of_f)))]


def _error(
    model: Any, samples: list[_Samples], G: Array, s: float, factors: tuple[float, float]
) -> float:
    """Fit the parameters to the rows of one reading; return the relative error of the torques.

    Each joint is weighted by the size of its torques.
    """
    rows, torques = [], []
    scale = np.sqrt(sum((x.Y**2 * x.used).sum(axis=1) for x in samples))
    scale = np.where(scale > 0, scale, 1.0)
    for x in samples:
        w, wd, f = factors[0] * x.w @ G.T, factors[0] * x.wd @ G.T, s * factors[1] * x.f @ G.T
        base = dict(zip(INPUTS, np.hstack([w, wd, f - _lever(w, wd, x.r)]).T, strict=True))
        D = model.regressor(x.q, x.qd, x.qdd, **base, **x.further)  # (K, n, b)
        rows.append((D.transpose(1, 0, 2) / scale[:, None, None])[x.used])
        torques.append((x.Y / scale[:, None])[x.used])
    W, Y = np.concatenate(rows), np.concatenate(torques)
    size = np.linalg.norm(W, axis=0)
    W = W / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(W.T @ W)
    kept = values > RIDGE * values[-1]
    X = vectors[:, kept] @ ((vectors[:, kept].T @ (W.T @ Y)) / values[kept])
    return float(np.linalg.norm(Y - W @ X) / np.linalg.norm(Y))


def _written(result: Identification, G: Array, s: float, factors: tuple[float, float]) -> str:
    """Write a reading as keys of record.base in the study."""
    settings: Any = result.problem.settings
    own = [r.base for r in getattr(settings, "record", ()) if r.base.gyroscope]
    R = G @ (rotation_of(own[0].mounting.rotation) if own else np.eye(3))
    keys = []
    if not np.allclose(G, np.eye(3)):
        angles = ", ".join(f"{round(x, 9) + 0.0:.4g}" for x in roll_pitch_yaw(R))
        keys.append(f"mounting.rotation: [{angles}]")
    if s < 0:
        keys.append(f"specific_force: {'false' if not own or own[0].specific_force else 'true'}")
    if factors[0] != 1:
        keys.append("gyroscope_unit: deg/s")
    if factors[1] != 1:
        keys.append(f"accelerometer_unit: {'g' if factors[1] > 1 else 'm/s**2'}")
    return f"record.base: {{{', '.join(keys)}}}"
