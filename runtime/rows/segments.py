"""Rows of W that come block by block: kept, or reduced to triangular factors of segments of time.

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

from runtime.rows.factor import Array, JointFactor, triangularise

Window = tuple[float | None, float | None]

PENDING = 4096  # rows of a joint gathered before they are triangularised


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


def merged(parts: Iterable[Sequence[JointFactor]]) -> tuple[JointFactor, ...]:
    """Factors by joint of all rows, from those of several sets of rows with the same columns."""
    return tuple(
        JointFactor(
            same[0].columns,
            triangularise(np.vstack([joint.R for joint in same])),
            sum(joint.rows for joint in same),
        )
        for same in zip(*parts, strict=True)
    )


def cut(W: Array, Y: Array, joints: Sequence[slice], blocks: Array) -> tuple[Segment, ...]:
    """Segments of rows that are held: one for each block of residuals.

    Parameters
    ----------
    W, Y : ndarray, shape (r, b) and (r,)
    joints : sequence of slice
        Rows of each joint.
    blocks : ndarray of int, shape (r,)
        Number of the block of each row, from 0.
    """
    if not (np.isfinite(W).all() and np.isfinite(Y).all()):
        raise ValueError(
            "W or Y holds values that are not finite; leave those samples out of the record"
        )
    factors = []
    for own in joints:
        columns = np.flatnonzero(W[own].any(axis=0))
        order, counts = (
            np.argsort(blocks[own], kind="stable"),
            np.bincount(blocks[own], minlength=int(blocks.max()) + 1),
        )
        rows = np.vstack([W[own].T[columns], Y[own]])[:, order]
        parts = np.split(rows, np.cumsum(counts)[:-1], axis=1)
        factors.append(
            [JointFactor(columns, triangularise(part.T), part.shape[1]) for part in parts]
        )
    return tuple(Segment(0, k, (), same) for k, same in enumerate(zip(*factors, strict=True)))


class HeldRows:
    """The first rows of several records in the order of an Observation: joint by joint, records one
    after the other.

    Parameters
    ----------
    columns : sequence of ndarray of int
        C_j, columns that act on joint j.
    counts : ndarray of int, shape (records, n)
        Rows kept of each record and joint.
    b : int
        Number of columns of W.
    """

    def __init__(self, columns: Sequence[Array], counts: Array, b: int) -> None:
        self.columns, self.rows = columns, tuple(counts.sum(axis=0).tolist())
        self.end = np.cumsum(counts.T.ravel()).reshape(
            counts.T.shape
        )  # place after the last row of a joint of a record
        self.next = self.end - counts.T
        r = int(counts.sum())
        self.transposed = np.zeros((b, r))
        self.Y, self.t, self.record = np.empty(r), np.empty(r), np.empty(r, dtype=int)

    def take(self, record: int, t: Array, mask: Array, rows: Sequence[Array]) -> None:
        """The next rows of a record, as many as are kept: [W_j[:, C_j] Y_j]' of each joint, at the
        instants t where mask, shape (n, k), is true.
        """
        for j, (C, joint) in enumerate(zip(self.columns, rows, strict=True)):
            start = self.next[j, record]
            count = min(joint.shape[1], self.end[j, record] - start)
            place = slice(start, start + count)
            self.transposed[C, place], self.Y[place] = joint[:-1, :count], joint[-1, :count]
            self.t[place], self.record[place] = t[mask[j]][:count], record
            self.next[j, record] += count


class SegmentFactors:
    """The segments of one record, whose rows come in the order of time.

    Parameters
    ----------
    record : int
        Number of the record.
    t0 : float, s
        Time of its first row.
    length : float, s
        Length of a block of residuals.
    windows : sequence of (float or None, float or None), s
        Windows at whose ends a segment ends.
    columns : sequence of ndarray of int
        C_j, columns that act on joint j.
    """

    def __init__(
        self,
        record: int,
        t0: float,
        length: float,
        windows: Sequence[Window],
        columns: Sequence[Array],
    ) -> None:
        self.record, self.t0, self.length, self.columns = record, t0, length, columns
        self.ends = [
            (-np.inf if low is None else low, np.inf if high is None else high)
            for low, high in windows
        ]
        self.R: dict[tuple[int, tuple[bool, ...]], list[RowsFactor]] = {}

    def take(self, t: Array, mask: Array, rows: Sequence[Array]) -> None:
        """Rows [W_j[:, C_j] Y_j]' of every joint, shape (|C_j| + 1, rows of the joint), at the
        instants t where mask, shape (n, k), is true.
        """
        if not all(np.isfinite(x).all() for x in rows):
            raise ValueError(
                "W or Y holds values that are not finite; leave those samples out of the record"
            )
        block = np.floor((t - self.t0) / self.length + 1e-9).astype(int)
        inside = np.array(
            [(t >= low) & (t <= high) for low, high in self.ends], dtype=bool
        ).reshape(len(self.ends), len(t))
        changes = np.flatnonzero(np.diff(block) | (inside[:, 1:] != inside[:, :-1]).any(axis=0)) + 1
        for a, b in zip([0, *changes], [*changes, len(t)], strict=True):
            if a < b:
                key = int(block[a]), tuple(inside[:, a].tolist())
                segment = self.R.setdefault(key, [RowsFactor(len(C) + 1) for C in self.columns])
                for j, joint in enumerate(segment):
                    first = np.count_nonzero(mask[j, :a])
                    joint.take(rows[j][:, first : first + np.count_nonzero(mask[j, a:b])])

    def reduce(self) -> None:
        """Keep nothing but triangular factors."""
        for joints in self.R.values():
            for rows in joints:
                rows.factor()

    def join(self, later: SegmentFactors) -> None:
        """Rows that another one took, behind those taken so far."""
        for key, joints in later.R.items():
            if key in self.R:
                for rows, other in zip(self.R[key], joints, strict=True):
                    rows.join(other)
            else:
                self.R[key] = joints

    def finish(self) -> list[Segment]:
        """The segments, in time."""

        def factors(joints: Sequence[RowsFactor]) -> tuple[JointFactor, ...]:
            return tuple(
                JointFactor(C, rows.factor(), rows.count)
                for C, rows in zip(self.columns, joints, strict=True)
            )

        return [
            Segment(self.record, block, inside, factors(joints))
            for (block, inside), joints in self.R.items()
        ]


class RowsFactor:
    """R factor of rows that come in parts: R = R factor of [R; new rows]."""

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

    def join(self, later: RowsFactor) -> None:
        """Rows that another one took."""
        R = later.factor()
        self.parts.append(R)
        self.count, self.pending = self.count + later.count, self.pending + len(R)

    def factor(self) -> Array:
        """R of all rows so far."""
        if self.pending:
            self.parts, self.pending = [triangularise(np.vstack(self.parts))], 0
        return self.parts[0]
