"""The observed linear system Y = W X + rho, eqs. (6) and (14), with the bookkeeping of its rows.

Rows are held; or, of records that are read by blocks and too large, reduced to triangular factors
of segments of time
(`runtime.rows.segments`). What estimators read of either: `factor`, `norms`, `block_rows`,
`columns`, `between`, `of_record`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.rows.factor import Factor, factor, joint_factors, merged, selected
from runtime.rows.segments import Cuts, Segment, Window, within

Array = np.ndarray

HELD = 100 * 10**6
"""Bytes of W above which records that are read by blocks leave triangular factors instead of rows.
"""
BLOCKS = 50
"""Blocks of residuals that the record is cut into by default: their number alone makes sigma
uncertain by 1/sqrt(2*50) = 10 %.
"""
SHORTEST = 5
"""Shortest default block of residuals, rows of one joint: 2/cutoff, the memory of the low-pass
filter, at the rate of eq. (13).
"""


@dataclass(frozen=True, eq=False)
class LoopRows:
    """The closed loop that made the records (`runtime.loop.closed_loop`), and which of its
    rows an observation holds, shape (r,).
    """

    loop: Any
    rows: Array


@dataclass(frozen=True, eq=False)
class Reduced:
    """What is left of rows that are not held.

    Attributes
    ----------
    segments : tuple of Segment
        Triangular factors of the rows, in time, record by record.
    windows : tuple of (float or None, float or None), s
        Windows that `Observation.between` knows.
    span : (float, float), s
        Time of the first and of the last row.
    residual_block : float, s
        Length of a block of residuals.
    first_rows : Observation
        The first rows of every record, held.
    """

    segments: tuple[Segment, ...]
    windows: tuple[Window, ...]
    span: tuple[float, float]
    residual_block: float
    first_rows: Observation


@dataclass(frozen=True, eq=False)
class Observation:
    """The decimated system Y = W X + rho with its row bookkeeping.

    Attributes
    ----------
    W : ndarray, shape (r, b)
        Rows joint-major: all rows of joint 1 first. Without rows where `reduced` stands in their
        place; Y, t and record likewise.
    Y : ndarray, shape (r,), N m or N
    rows : tuple of int
        Number of rows of each joint.
    names : tuple of str
        The b columns.
    t : ndarray, shape (r,), s
        Time of each row.
    record : ndarray of int, shape (r,)
        Number of the record of each row, from 0.
    rate : float, Hz
        Rows per second of one joint after decimation.
    dropped : mapping of str to tuple of int
        Rows left out, per joint, by reason ("trim", "low_speed", "mask"), counted after decimation.
    settings : mapping
        Signals and rows used, complete (to_mapping), with the factor that "auto" became.
    files : mapping of str to str
        SHA-256 of the measured files, by name.
    closed_loop : LoopRows or None
        What can simulate the same rows with other parameters, where it is known.
    reduced : Reduced or None
        Triangular factors in place of the rows.
    findings : tuple of str
        What the reader of counts says of the encoders, a sentence each.
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
    closed_loop: LoopRows | None = None
    reduced: Reduced | None = None
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        r = 0 if self.reduced else sum(self.rows)
        if (
            self.W.shape != (r, len(self.names))
            or self.Y.shape != (r,)
            or self.t.shape != (r,)
            or self.record.shape != (r,)
        ):
            shapes = (
                f"W {self.W.shape}, Y {self.Y.shape}, t {self.t.shape}, record {self.record.shape}"
            )
            raise InputError(
                f"{shapes}; expected {r} rows, the sum of {self.rows}, and {len(self.names)} "
                "columns"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows)

    @property
    def joints(self) -> Array:
        """Joint of each row, from 0, shape (r,)."""
        return np.repeat(np.arange(self.n), self.rows)

    @property
    def span(self) -> tuple[float, float]:
        """Time of the first and of the last row, s."""
        return self.reduced.span if self.reduced else (float(self.t.min()), float(self.t.max()))

    @property
    def first_rows(self) -> Observation:
        """Rows that are held, for figures: all, or the first of every record where the others were
        reduced.
        """
        return self.reduced.first_rows if self.reduced else self

    def require_rows(self, purpose: str) -> None:
        """SettingsError where the rows are not held, which `purpose` needs."""
        if self.reduced:
            raise rows_reduced(purpose)

    def joint(self, j: int) -> slice:
        """Rows of the j-th joint, j from 0."""
        start = sum(self.rows[:j])
        return slice(start, start + self.rows[j])

    @cached_property
    def factor(self) -> Factor:
        """Triangular factor of [W Y], joint by joint; made once."""
        if self.segments is None:
            return factor(self.W, self.Y, self.rows, self.names)
        return Factor.of(self.names, merged(s.joints for s in self.segments))

    @cached_property
    def segments(self) -> tuple[Segment, ...] | None:
        """Triangular factors of the blocks of residuals, made once; None where such a block of one
        joint has hardly more rows than columns.
        """
        if self.reduced:
            return self.reduced.segments
        if max(self.rows) < 2 * BLOCKS * (len(self.names) + 1):
            return None
        parts = joint_factors(self.W, self.Y, self.rows, self.blocks())
        return tuple(Segment(0, k, (), joints) for k, joints in enumerate(parts))

    def cut(self, record: int, cuts: Cuts, columns: Sequence[Array]) -> list[Segment]:
        """Segments of the rows of one record; columns : C_j, columns that act on joint j."""
        keys, of_row = cuts.segments(self.t)
        parts = joint_factors(self.W, self.Y, self.rows, of_row, columns)
        return [
            Segment(record, int(block), tuple(map(bool, inside)), joints)
            for (block, *inside), joints in zip(keys, parts, strict=False)
        ]

    def columns(self, names: Sequence[str]) -> Observation:
        """The same rows with the named columns alone, in the order given."""
        if tuple(names) == self.names:
            return self
        kept = column_numbers(names, self.names)
        reduced = self.reduced
        if reduced is not None:
            segments = tuple(
                replace(s, joints=tuple(selected(joint, kept) for joint in s.joints))
                for s in reduced.segments
            )
            reduced = replace(
                reduced, segments=segments, first_rows=reduced.first_rows.columns(names)
            )
        return replace(
            self,
            W=np.asfortranarray(self.W[:, kept]),
            names=tuple(names),
            reduced=reduced,
        )

    def equal_parts(self, count: int) -> Array:
        """Of `count` parts of the span, of equal length, that of each row, from 0, shape (r,)."""
        start, end = self.span  # the same of rows of one instant
        return np.asarray(
            (count * (self.t - start) / ((end - start) or 1.0)).astype(int).clip(max=count - 1)
        )

    def where(self, mask: Array) -> Observation:
        """The rows where `mask`, bool of shape (r,), is true."""
        self.require_rows("a choice of rows")
        if mask.shape != self.Y.shape or mask.dtype != np.bool_:
            raise InputError(f"mask {mask.dtype} {mask.shape}; expected bool {self.Y.shape}")
        rows = tuple(int(np.count_nonzero(mask[self.joint(j)])) for j in range(self.n))
        loop = (
            None
            if self.closed_loop is None
            else replace(self.closed_loop, rows=self.closed_loop.rows[mask])
        )
        W = np.compress(mask, self.W.T, axis=1).T
        return replace(
            self,
            W=W,
            Y=self.Y[mask],
            t=self.t[mask],
            record=self.record[mask],
            rows=rows,
            closed_loop=loop,
        )

    def between(self, t0: float | None, t1: float | None) -> Observation:
        """The rows with t0 <= t <= t1, s; None leaves an end open. Reduced rows: one of the windows
        that they were cut by.
        """
        if self.reduced:
            if (t0, t1) not in self.reduced.windows:
                raise InputError(
                    f"[{t0}, {t1}] s; a record read by blocks was cut by the windows "
                    f"{list(self.reduced.windows)} alone"
                )
            w = self.reduced.windows.index((t0, t1))
            part = self._of_segments([s for s in self.reduced.segments if s.inside[w]])
        else:
            part = self.where(within(self.t, (t0, t1)))
        if not any(part.rows):
            raise InputError(
                f"no row in [{t0}, {t1}] s; the rows lie in [{self.span[0]:g}, {self.span[1]:g}] s"
            )
        return part

    def of_record(self, number: int) -> Observation:
        """The rows of one record, number from 0."""
        if self.reduced:
            return self._of_segments([s for s in self.reduced.segments if s.record == number])
        return self.where(self.record == number)

    def _of_segments(self, segments: Sequence[Segment]) -> Observation:
        assert self.reduced is not None
        rows = tuple(sum(s.joints[j].rows for s in segments) for j in range(self.n))
        return replace(self, rows=rows, reduced=replace(self.reduced, segments=tuple(segments)))

    def norms(self, names: Sequence[str], X: Array) -> tuple[Array, Array]:
        """||Y_j - W_j X|| with the columns `names`, and ||Y_j||, of every joint, N m or N, shape
        (n,) each.
        """
        kept = column_numbers(names, self.names)
        if self.reduced:
            joints = [selected(joint, kept) for joint in self.factor.joints]
            return np.array([joint.residual_norm(X) for joint in joints]), np.array(
                [joint.measured_norm for joint in joints]
            )
        residual = self.Y - self.W[:, kept] @ X
        return (
            np.array([np.linalg.norm(residual[self.joint(j)]) for j in range(self.n)]),
            np.array([np.linalg.norm(self.Y[self.joint(j)]) for j in range(self.n)]),
        )

    @property
    def residual_block(self) -> float:
        """Length of a block of residuals, s, where none is given: a 50th of the record, at least
        five rows.
        """
        return self.reduced.residual_block if self.reduced else default_block(self.rows, self.rate)

    def blocks(self, length: float | None = None) -> Array:
        """Number of the block of residuals (from 0) of every row, shape (r,): same record, same
        interval of `length` seconds.
        """
        _, record = np.unique(self.record, return_inverse=True)
        first = np.full(record.max() + 1, np.inf)
        np.minimum.at(first, record, self.t)
        interval = np.floor(
            (self.t - first[record]) / (length or self.residual_block) + 1e-9
        ).astype(np.intp)
        return np.asarray(
            np.unique(record * (interval.max() + 1) + interval, return_inverse=True)[1]
        )

    def block_rows(
        self, names: Sequence[str], weights: Array, length: float, whitener: Array | None = None
    ) -> Iterator[Array]:
        """Weighted rows [W Y] of every block of residuals, shape (rows, b + 1); of `segments`, rows
        with the same Gram matrix.

        Parameters
        ----------
        names : sequence of str
            The b columns of W.
        weights : ndarray, shape (n,)
            Factors of the rows of each joint.
        length : float, s
            Length of a block.
        whitener : ndarray, shape (n, n), optional
            Multiplies the n rows of one instant, in place of the weights.
        """
        kept = column_numbers(names, self.names)
        if self.reduced is None and (
            self.segments is None or whitener is not None or length != self.residual_block
        ):
            A = np.column_stack([self.W[:, kept], self.Y])
            A = (
                A * np.repeat(weights, self.rows)[:, None]
                if whitener is None
                else whitened(A, whitener)
            )
            yield from split_rows(A, self.blocks(length))
            return
        if length != self.residual_block:
            raise InputError(
                f"blocks of residuals of {length:g} s; a record read by blocks was cut into "
                f"{self.residual_block:g} s"
            )
        blocks: dict[tuple[int, int], list[Array]] = {}
        for segment in self.segments or ():
            for joint, weight in zip(
                (selected(joint, kept) for joint in segment.joints), weights, strict=True
            ):
                if joint.rows:
                    blocks.setdefault((segment.record, segment.block), []).append(
                        weight * joint.spread(len(kept))
                    )
        yield from map(np.vstack, blocks.values())


def rows_reduced(purpose: str) -> SettingsError:
    """The error of `purpose`, which needs rows that are not held."""
    message = (
        f"{purpose} needs the rows themselves; records read by blocks keep them up to "
        f"{HELD // 10**6} MB of W. Use ols, or wls with weights joint or "
        "iterated; or stream: off"
    )
    return SettingsError(message, path=("estimate",))


def split_rows(A: Array, blocks: Array) -> Iterator[Array]:
    """Rows of A, shape (r, c), of every block; blocks : number of the block of each row, shape
    (r,).
    """
    order = np.argsort(blocks, kind="stable")
    yield from (A[rows] for rows in np.split(order, np.flatnonzero(np.diff(blocks[order])) + 1))


def whitened(A: Array, whitener: Array) -> Array:
    """A, shape (n*N, c) joint-major, with the n rows of each instant multiplied by `whitener`,
    shape (n, n).
    """
    n = len(whitener)
    return np.asarray(
        np.einsum("ij,jNc->iNc", whitener, A.reshape(n, -1, A.shape[1])).reshape(A.shape)
    )


def halves(t0: float, t1: float) -> tuple[Window, Window]:
    """The two halves of [t0, t1], s; no instant belongs to both."""
    middle = (t0 + t1) / 2
    return (t0, middle), (float(np.nextafter(middle, t1)), t1)


def stack(observations: Sequence[Observation]) -> Observation:
    """Several records of one robot as one system, joint-major; `record` tells the rows apart."""
    if not observations:
        raise InputError("no observation to stack")
    first = observations[0]
    for o in observations:
        o.require_rows("a stack of observations")
        if o.names != first.names or o.n != first.n:
            raise InputError(
                f"columns {o.names} on {o.n} joints; expected those of the first record, "
                f"{first.names} on {first.n} joints"
            )
    offsets = np.cumsum([0] + [int(o.record.max(initial=0)) + 1 for o in observations])
    return in_time(
        [replace(o, record=o.record + k) for o, k in zip(observations, offsets, strict=False)]
    )


def in_time(observations: Sequence[Observation]) -> Observation:
    """Parts of one system that follow each other, with the same columns, as one, joint-major."""
    first = observations[0]
    order = [(o, o.joint(j)) for j in range(first.n) for o in observations]
    W = np.empty((sum(sum(o.rows) for o in observations), len(first.names)), order="F")
    np.concatenate([o.W[rows] for o, rows in order], out=W)
    return Observation(
        W=W,
        Y=np.concatenate([o.Y[rows] for o, rows in order]),
        rows=tuple(sum(o.rows[j] for o in observations) for j in range(first.n)),
        names=first.names,
        t=np.concatenate([o.t[rows] for o, rows in order]),
        record=np.concatenate([o.record[rows] for o, rows in order]),
        rate=max(o.rate for o in observations),
        dropped={
            reason: tuple(
                sum(o.dropped.get(reason, (0,) * first.n)[j] for o in observations)
                for j in range(first.n)
            )
            for reason in first.dropped
        },
        settings=same_settings([o.settings for o in observations]),
        files=all_files([o.files for o in observations]),
        findings=tuple(dict.fromkeys(text for o in observations for text in o.findings)),
    )


def same_settings(settings: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Settings of all records, one by one where they differ."""
    return settings[0] if all(s == settings[0] for s in settings) else {"records": list(settings)}


def default_block(rows: Sequence[int], rate: float) -> float:
    return float(max(max(rows) / BLOCKS, SHORTEST) / rate)


def all_files(hashes: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Hashes by file name; a name that stands for another file in a later record gets the number of
    that record.
    """
    files: dict[str, str] = {}
    for k, of_record in enumerate(hashes, start=1):
        for name, digest in of_record.items():
            files[name if files.get(name, digest) == digest else f"{name} ({k})"] = digest
    return files


def column_numbers(names: Sequence[str], among: Sequence[str]) -> list[int]:
    unknown = [name for name in names if name not in among]
    if unknown:
        raise InputError(f"no column {', '.join(unknown)}; there are {', '.join(among)}")
    return [list(among).index(name) for name in names]
