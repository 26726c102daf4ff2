"""What a record leaves behind when it is read by blocks: triangular factors instead of rows.

Time is cut into segments, at the ends of the blocks of residuals (`runtime.estimators.block_covariance`) and of the windows of a validation. Each segment
keeps R_j of [W_j Y_j] for every joint, which is all that estimates, weights by joint, essential parameters, validation and uncertainties need:

    rows in a window       stack the R_j of its segments and triangularise once more
    ||Y_j - W_j X||        ||R_j [X[C_j]; -1]||
    W_k'(Y_k - W_k X)      R_k[:, :-1]'(R_k[:, -1] - R_k[:, :-1] X), summed over the joints: the share of block k in the covariance
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.observation.observation import Observation
from runtime.observation.qr_factor import Array, Factor, JointFactor, selected, stacked, triangularise

Window = tuple[float | None, float | None]

PENDING = 4096  # rows of a joint gathered before they are triangularised


@dataclass(frozen=True, eq=False)
class Segment:
    """Consecutive rows of one record: block of residuals, which windows they lie in, and their factor by joint."""

    record: int
    block: int
    inside: tuple[bool, ...]
    joints: tuple[JointFactor, ...]


@dataclass(frozen=True, eq=False)
class Reduction:
    """An observation whose rows are gone.

    names : the b columns.   segments : factors of the rows, in time.   windows : those that `between` knows, s.
    span : time of the first and the last row, s.   rate : rows per second of one joint, Hz.   residual_block : length of a block of residuals, s.
    shown : the first rows of every record themselves, for figures.   dropped, settings, files : as in an Observation.
    """

    names: tuple[str, ...]
    segments: tuple[Segment, ...]
    windows: tuple[Window, ...]
    span: tuple[float, float]
    rate: float
    residual_block: float
    shown: Observation
    dropped: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.segments[0].joints)

    @property
    def rows(self) -> tuple[int, ...]:
        """Number of rows of each joint."""
        return tuple(sum(s.joints[j].rows for s in self.segments) for j in range(self.n))

    @cached_property
    def factor(self) -> Factor:
        """Triangular factor of all rows."""
        joints = merged(s.joints for s in self.segments)
        return Factor(self.names, stacked(joints, len(self.names)), joints)

    def columns(self, names: Sequence[str]) -> Reduction:
        """The same rows with the named columns alone, in the order given."""
        unknown = [name for name in names if name not in self.names]
        if unknown:
            raise InputError(f"no column {', '.join(unknown)}; there are {', '.join(self.names)}")
        kept = [self.names.index(name) for name in names]
        segments = tuple(replace(s, joints=tuple(selected(joint, kept) for joint in s.joints)) for s in self.segments)
        return replace(self, names=tuple(names), segments=segments, shown=self.shown.columns(names))

    def between(self, t0: float | None, t1: float | None) -> Reduction:
        """The rows with t0 <= t <= t1, s: one of the windows that the record was cut by."""
        if (t0, t1) not in self.windows:
            raise InputError(f"[{t0}, {t1}] s; a record read by blocks was cut by the windows {list(self.windows)} alone")
        w = self.windows.index((t0, t1))
        inside = tuple(s for s in self.segments if s.inside[w])
        if not any(joint.rows for s in inside for joint in s.joints):
            raise InputError(f"no row in [{t0}, {t1}] s; the rows lie in [{self.span[0]:g}, {self.span[1]:g}] s")
        return replace(self, segments=inside)

    def scores(self, X: Array, weights: Array) -> Array:
        """W_k'(Y_k - W_k X) of every block of residuals, shape (K, b), rows of joint j times weights[j]; X, shape (b,), of all columns."""
        numbers: dict[tuple[int, int], int] = {}
        for s in self.segments:
            if any(joint.rows for joint in s.joints):
                numbers.setdefault((s.record, s.block), len(numbers))
        g = np.zeros((len(numbers), len(self.names)))
        for s in self.segments:
            for joint, weight in zip(s.joints, weights, strict=True):
                if joint.rows:
                    W, Y = joint.R[:, :-1], joint.R[:, -1]
                    g[numbers[s.record, s.block], joint.columns] += weight * (W.T @ (Y - W @ X[joint.columns]))
        return g


def merged(parts: Iterable[Sequence[JointFactor]]) -> tuple[JointFactor, ...]:
    """The factors by joint of several sets of rows with the same columns, as those of all their rows."""
    return tuple(
        JointFactor(same[0].columns, triangularise(np.vstack([joint.R for joint in same])), sum(joint.rows for joint in same))
        for same in zip(*parts, strict=True)
    )


class SegmentFactors:
    """The segments of one record, whose rows come in the order of time.

    t0 : time of its first row, s.   length : of a block of residuals, s.   windows : where segments end, s.   columns : C_j by joint.
    """

    def __init__(self, record: int, t0: float, length: float, windows: Sequence[Window], columns: Sequence[Array]) -> None:
        self.record, self.t0, self.length, self.windows, self.columns = record, t0, length, windows, columns
        self.R: dict[tuple[int, tuple[bool, ...]], list[RowsFactor]] = {}

    def take(self, t: Array, mask: Array, rows: Sequence[Array]) -> None:
        """Rows [W_j[:, C_j] Y_j]' of every joint, shape (|C_j| + 1, rows of the joint), at the instants t where mask (n, k) is true."""
        if not all(np.isfinite(x).all() for x in rows):
            raise ValueError("W or Y holds values that are not finite; leave those samples out of the record")
        block = np.floor((t - self.t0) / self.length + 1e-9).astype(int)
        inside = np.array([(t >= _low(w)) & (t <= _high(w)) for w in self.windows], dtype=bool).reshape(len(self.windows), len(t))
        changes = np.flatnonzero(np.diff(block) | (inside[:, 1:] != inside[:, :-1]).any(axis=0)) + 1
        for a, b in zip([0, *changes], [*changes, len(t)], strict=True):
            if a < b:
                key = int(block[a]), tuple(inside[:, a].tolist())
                segment = self.R.setdefault(key, [RowsFactor(len(C) + 1) for C in self.columns])
                for j, joint in enumerate(segment):
                    first = np.count_nonzero(mask[j, :a])
                    joint.take(rows[j][:, first : first + np.count_nonzero(mask[j, a:b])])

    def finish(self) -> list[Segment]:
        """The segments, in time."""
        return [
            Segment(
                self.record, block, inside, tuple(JointFactor(C, x.factor(), x.count) for C, x in zip(self.columns, joints, strict=True))
            )
            for (block, inside), joints in self.R.items()
        ]


class RowsFactor:
    """R factor of rows that come by and by: R = R factor of [R; new rows]."""

    def __init__(self, width: int) -> None:
        self.parts: list[Array] = [np.zeros((0, width))]
        self.pending = self.count = 0

    def take(self, rows: Array) -> None:
        """Rows, transposed: shape (width, B)."""
        self.parts.append(rows.T)
        self.count += rows.shape[1]
        self.pending += rows.shape[1]
        if self.pending >= PENDING:
            self.factor()

    def factor(self) -> Array:
        """R of all rows so far."""
        if self.pending:
            self.parts, self.pending = [triangularise(np.vstack(self.parts))], 0
        return self.parts[0]


def _low(window: Window) -> float:
    return -np.inf if window[0] is None else window[0]


def _high(window: Window) -> float:
    return np.inf if window[1] is None else window[1]
