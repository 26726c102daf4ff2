"""Signals that were recorded late, torques or the motion of a base, at the instants of the positions.

    tau'_j(t) = tau_j(t + delay_j)

by cubic interpolation between the samples. Samples without a torque at an end are left out.
"""

from __future__ import annotations

import numpy as np

from runtime.ground.errors import InputError

Array = np.ndarray


def delays_of(delay: float | tuple[float, ...] | None, n: int) -> Array | None:
    """Return the delay of each of n joints, s, shape (n,); None if no torque is late."""
    given = np.atleast_1d(np.asarray(0.0 if delay is None else delay, dtype=float))
    if given.shape not in {(1,), (n,)}:
        raise InputError(
            f"record.delay has {len(given)} values; expected one value, or {n} values (one per joint)"
        )
    return np.broadcast_to(given, (n,)) if given.any() else None


def inside(t: Array, delay: Array, key: str = "record.delay") -> slice:
    """Select the samples of which every torque was recorded; raise InputError if none is left.

    key : name of the delay in the study.
    """
    period = (t[-1] - t[0]) / (len(t) - 1)
    first = int(np.ceil(max(0.0, -float(delay.min())) / period - 1e-9))
    last = len(t) - int(np.ceil(max(0.0, float(delay.max())) / period - 1e-9))
    if last - first < 2:
        raise InputError(
            f"{key} is {delay.max():g} s, but the record lasts {t[-1] - t[0]:g} s; correct "
            "the delay, which is in s"
        )
    return slice(first, last)


def on_time(t: Array, tau: Array, delay: Array) -> Array:
    """Read signals tau, shape (N, n), at the instants t + delay, s, column by column."""
    from scipy.interpolate import CubicSpline  # 60 ms, where it is used

    return np.stack(
        [
            CubicSpline(t, own)(np.clip(t + late, t[0], t[-1]))
            for own, late in zip(tau.T, delay, strict=True)
        ],
        axis=1,
    )
