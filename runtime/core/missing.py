"""Missing positions of a record: at which samples, and for which joints and encoders.

The setting `signals.reader: counts` accepts records with such samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.core.drives import Drives
from runtime.ground.errors import InputError

Array = np.ndarray

COUNTS = (
    "where positions are counts of encoders, signals: {reader: counts} takes such samples as "
    "missing"
)


@dataclass(frozen=True, eq=False)
class Missing:
    """Which samples of a record have no position, for each recorded position column.

    Attributes
    ----------
    samples : ndarray of bool, shape (N, n)
        True: the column has no position at this sample. The record then contains a straight line
        between the neighbouring positions.
    follows : ndarray of bool, shape (n, n), or None
        True: the position of joint j depends on column i, because this entry of R^-1 of the drives
        is not zero. None: the columns are joints.
    """

    samples: Array
    follows: Array | None = None

    def at_joints(self) -> Array:
        """Return a mask of the samples and joints with unknown position, bool, shape (N, n)."""
        return self.samples if self.follows is None else self.samples @ self.follows.T

    def at_encoders(self, drives: Drives | None) -> Array:
        """Return a mask of the samples and encoders without a count, bool, shape (N, n).

        The encoders are at the joints if `drives` is None, else at the motors of `drives`. A motor
        that turns with two joints has no count if one of these joints has no position. If motor
        positions were recorded, each motor has its own marks.
        """
        if drives is None:
            return self.at_joints()
        return self.samples if self.follows is not None else self.samples @ (drives.motion != 0).T

    def near_gaps(self, longest: int, reach: int) -> Array:
        """Return a mask of the samples in or near long runs of missing positions, bool, shape (N,).

        A gap is long if it has more than `longest` samples; a sample is near if it is at most
        `reach` samples away.
        """
        ends = np.flatnonzero(
            np.diff(self.at_joints().any(axis=1), prepend=False, append=False)
        ).reshape(-1, 2)
        near = np.zeros(len(self.samples), dtype=bool)
        for a, b in ends[ends[:, 1] - ends[:, 0] > longest]:
            near[max(a - reach, 0) : b + reach] = True
        return near


def bridged(q: Array, missing: Array) -> Array:
    """Replace missing positions in q, shape (N, n), by linear interpolation between neighbours.

    At the ends of the record, the nearest position is repeated; a column without any position
    becomes 0.
    """
    q, at = np.array(q), np.arange(len(q))
    for j in np.flatnonzero(missing.any(axis=0)):
        known = np.flatnonzero(~missing[:, j])
        if len(known):
            q[missing[:, j], j] = np.interp(at[missing[:, j]], known, q[known, j])
        else:
            q[:, j] = 0.0
    return q


def require_positions(missing: Missing | None, who: str, file: str, hint: str = "") -> None:
    """Raise InputError if positions are missing in a record.

    who : name of the function that needs all positions. hint : another remedy, for the message.
    """
    if missing is not None and missing.samples.any():
        i, j = np.argwhere(missing.samples)[0]
        raise InputError(
            f"{missing.samples.sum()} positions are missing, the first of column {j + 1} at sample "
            f"{i + 1}; {who} needs all positions: "
            f"repair or cut the record{f'; {hint}' if hint else ''}",
            file=file,
        )
