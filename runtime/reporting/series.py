"""Prepare the data of a torque figure for the script of a page.

Extreme values are kept and other samples are left out; numbers are float32 in base64.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from runtime.ground.limits import LIMIT

if TYPE_CHECKING:  # a page of the studio needs no estimator
    from runtime.core.validation import JointComparison

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Series:
    """Measured and predicted torque of one joint over time.

    Attributes
    ----------
    t : ndarray, shape (N,), s
    measured, predicted : ndarray, shape (N,), unit
        Values of the lines; nan breaks a line.
    unit : str
    source : str
        "measured" or "simulated": the name of the first line.
    total : int
        Number of instants before thinning.
    """

    t: Array
    measured: Array
    predicted: Array
    unit: str
    source: str
    total: int

    @property
    def data(self) -> Mapping[str, Any]:
        """The two curves as JSON values for the script; times start at zero, nan breaks a curve."""
        start = float(np.nanmin(self.t)) if len(self.t) else 0.0
        arrays = {"t": self.t - start, "measured": self.measured, "predicted": self.predicted}
        return {
            "start": start,
            "unit": self.unit,
            "source": self.source,
            **{name: base64(x) for name, x in arrays.items()},
        }


def series(
    joint: JointComparison, unit: str, source: str, most: int = LIMIT.INSTANTS_SHOWN
) -> Series:
    """Make the curves of measured and predicted torque of a joint, with breaks at left-out rows."""
    kept = extremes(np.array([joint.measured, joint.predicted, joint.error]), most)
    piece = np.searchsorted(gaps(joint.t), kept, side="right")
    holes = np.flatnonzero(np.diff(piece)) + 1
    t, measured, predicted = (
        np.insert(np.asarray(x, dtype=float)[kept], holes, np.nan)
        for x in (joint.t, joint.measured, joint.predicted)
    )
    return Series(t, measured, predicted, unit, source, len(joint.t))


def extremes(values: Array, most: int) -> Array:
    """Select at most `most` samples of m curves for a plot, so that their extreme values remain.

    values : shape (m, N), one curve per row. Return the indices of the first and the last sample,
    and of the smallest and the largest value of every curve in each of several intervals of equal
    length.
    """
    m, N = values.shape
    if most >= N:
        return np.arange(N)
    length = -(-N // max((most - 2) // (2 * m), 1))
    count = -(-N // length)
    filled = np.concatenate(
        [values, np.repeat(values[:, -1:], count * length - N, axis=1)], axis=1
    ).reshape(m, count, length)
    extreme = np.stack([filled.argmin(axis=2), filled.argmax(axis=2)]) + length * np.arange(count)
    return np.unique(np.concatenate([[0, N - 1], extreme.ravel().clip(max=N - 1)]))


def gaps(t: Array) -> Array:
    """Find the samples before which a plotted line is interrupted, and return their indices.

    A line breaks if rows are left out, or if time goes back because another record starts.
    """
    steps = np.diff(t)
    usual = float(np.median(np.abs(steps))) if len(steps) else 0.0
    return np.flatnonzero((steps <= 0) | (steps > 5 * usual)) + 1


def base64(values: Array, kind: str = "<f4") -> str:
    """Write numbers as little-endian floats in base64, which `floats` of chart.js reads.

    kind : "<f4" for 32 bits, "<f8" for 64.
    """
    return b64encode(np.asarray(values, dtype=kind).tobytes()).decode("ascii")
