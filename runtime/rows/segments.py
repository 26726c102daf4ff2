"""Rows of W reduced to triangular factors of segments of time.

Time is cut into segments at the ends of the blocks of residuals
(`runtime.estimators.block_covariance`) and of the windows of a validation.
Each segment keeps R_j of [W_j Y_j] for every joint, which is all that estimates, weights by joint,
essential parameters, validation and
deviations need:

    rows in a window       stack the R_j of its segments and triangularise once more
    ||Y_j - W_j X||        ||R_j [X[C_j]; -1]||
    Gram matrix of a block     sum of R_j'R_j over its segments and joints
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.rows.factor import Array, JointFactor, merged

Window = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive rows of one record.

    Attributes
    ----------
    record : int
        Number of the record.
    block : int
        Number of the block of residuals in that record.
    inside : tuple of bool
        Windows that the rows lie in.
    joints : tuple of JointFactor
        Triangular factor of the rows of each joint.
    """

    record: int
    block: int
    inside: tuple[bool, ...]
    joints: tuple[JointFactor, ...]


@dataclass(frozen=True)
class Cuts:
    """Where the time of a record is cut.

    Attributes
    ----------
    t0 : float, s
        Time of its first row.
    length : float, s
        Length of a block of residuals.
    windows : tuple of (float or None, float or None), s
        Windows at whose ends a segment ends.
    """

    t0: float
    length: float
    windows: tuple[Window, ...]

    def segments(self, t: Array) -> tuple[Array, Array]:
        """Block of residuals and whether it lies in each window, by segment, shape (segments, 1 +
        windows), and the number of the segment of every row, shape (r,), of rows at the times t.
        """
        block = np.floor((t - self.t0) / self.length + 1e-9).astype(int)
        keys = np.stack([block, *(within(t, window) for window in self.windows)], axis=1)
        keys, of_row = np.unique(keys, axis=0, return_inverse=True)
        return keys, of_row.reshape(-1)


def within(t: Array, window: Window) -> Array:
    """Whether t0 <= t <= t1, s; None leaves an end open."""
    t0, t1 = window
    return np.asarray(
        (t >= (-np.inf if t0 is None else t0)) & (t <= (np.inf if t1 is None else t1))
    )


def joined(segments: Iterable[Segment]) -> tuple[Segment, ...]:
    """Segments that come in parts, in the order of their first parts."""
    parts: dict[tuple[int, int, tuple[bool, ...]], list[Sequence[JointFactor]]] = {}
    for one in segments:
        parts.setdefault((one.record, one.block, one.inside), []).append(one.joints)
    return tuple(Segment(*key, merged(joints)) for key, joints in parts.items())
