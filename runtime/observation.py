"""The observed linear system Y = W X + rho, eqs. (6) and (14)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Observation:
    """The decimated system Y = W X + rho with its row bookkeeping.

    Parameters
    ----------
    W : ndarray, shape (r, b), rows joint-major: every row of joint 1 first.   Y : ndarray, shape (r,), N m or N.
    rows : number of rows of each joint, sum r.   names : the b columns.
    t : ndarray, shape (r,), time of each row, s.   record : ndarray, shape (r,), which of the stacked records it came from (from 0).
    rate : rows per second of one joint after decimation, Hz.
    dropped : rows left out, per joint, by reason ("trim", "low_speed", "mask"), counted after decimation.
    settings : the signals and rows used, complete (to_mapping), with the factor that "auto" became.
    files : SHA-256 of the measured files, by name.
    """

    W: Array
    Y: Array
    rows: tuple[int, ...]
    names: tuple[str, ...]
    t: Array
    record: Array
    rate: float
    dropped: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows)

    def joint(self, j: int) -> slice:
        """Rows of the j-th joint, j from 0."""
        start = sum(self.rows[:j])
        return slice(start, start + self.rows[j])
