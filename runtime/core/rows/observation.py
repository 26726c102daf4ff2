"""The linear system Y = W X + rho of measured records, eqs. (6) and (14), and its rows.

Estimators use `factor`, `norms`, `block_rows`, `columns`, `between` and `of_record`. If a record is
long, the rows of every block of residuals (an interval of time) are factored separately, and the
factors R_j of the block replace its rows:

    ||Y_j - W_j X||            ||R_j [X[C_j]; -1]||
    Gram matrix of a block     sum of R_j'R_j over the joints
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from runtime.core.rows.factor import Factor, JointFactor, joint_factors, merged, selected
from runtime.core.rows.streamed import StreamedMatrix, stacked_matrices
from runtime.ground.errors import InputError

Array = np.ndarray
Window = tuple[float | None, float | None]
"""[t0, t1], s; None leaves an end open."""

BLOCKS = 50
"""Blocks of residuals that the record is cut into by default: their number alone makes sigma
uncertain by 1/sqrt(2*50) = 10 %.
"""
BANDS = 6
"""Bands of one quantity, with equally many rows of each joint, that show errors of the friction model."""
SHORTEST = 5
"""Shortest default block of residuals, rows of one joint: 2/cutoff, the memory of the low-pass
filter, at the rate of eq. (13).
"""


@dataclass(frozen=True, eq=False)
class LoopRows:
    """Simulated control loop that gives rows of Y = W X + rho, with the numbers of these rows.

    loop : `runtime.loop.closed_loop`. rows : shape (r,).
    """

    loop: Any
    rows: Array


@dataclass(frozen=True, eq=False)
class Observation:
    """The decimated system Y = W X + rho, with joint, record and time of each row.

    Attributes
    ----------
    W : ndarray, shape (r, b)
        Rows joint-major: all rows of joint 1 first. Of long records, a `StreamedMatrix`, which is
        read like an array and makes rows when they are asked for.
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
        Rows per second of one joint after decimation, of the fastest record.
    dropped : mapping of str to tuple of int
        Number of rows left out, per joint, by reason ("trim", "low_speed", "mask"), counted after
        decimation.
    settings : mapping
        All settings of signals and rows (to_mapping), with the decimation factor that was chosen
        for "auto".
    files : mapping of str to str
        SHA-256 of the measured files, by name.
    closed_loop : LoopRows or None
        Closed loop that can simulate the same rows with other parameters, if it is known.
    findings : tuple of str
        Sentences of the reader of counts about the encoders.
    rates : tuple of float, Hz
        Rows per second of each record; empty for an observation of one record.
    motion : ndarray, shape (r, 2), or None
        Position q_j and velocity qd_j of the joint of each row, SI; None if they are unknown.
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
    findings: tuple[str, ...] = ()
    rates: tuple[float, ...] = ()
    motion: Array | None = None

    def __post_init__(self) -> None:
        r = sum(self.rows)
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
    def streamed(self) -> bool:
        """Whether rows of W are made when they are asked for, as of long records."""
        return isinstance(self.W, StreamedMatrix)

    @property
    def joints(self) -> Array:
        """Number of the joint of each row of W and Y, counted from 0, shape (r,)."""
        return np.repeat(np.arange(self.n), self.rows)

    @property
    def span(self) -> tuple[float, float]:
        """Times of the first and of the last row, s."""
        return float(self.t.min()), float(self.t.max())

    def joint(self, j: int) -> slice:
        """Return the slice of the rows of W and Y that belong to joint j, counted from 0."""
        start = sum(self.rows[:j])
        return slice(start, start + self.rows[j])

    @cached_property
    def factor(self) -> Factor:
        """Triangular (QR) factor of [W Y], made from the factors of the joints; computed once."""
        if self.block_factors is None:
            (joints,) = self.joint_factors(np.zeros(len(self.Y), dtype=np.int8))
            return Factor.of(self.names, joints)
        return Factor.of(self.names, merged(self.block_factors))

    @cached_property
    def block_factors(self) -> list[tuple[JointFactor, ...]] | None:
        """Triangular factors of [W Y] in every block of time, joint by joint; computed once.

        None for a short record, in which such a block of one joint has hardly more rows than
        columns.
        """
        if max(self.rows) < 2 * BLOCKS * (len(self.names) + 1):
            return None
        return self.joint_factors(self.blocks())

    def joint_factors(self, groups: Array) -> list[tuple[JointFactor, ...]]:
        """Compute the triangular factors of [W Y], joint by joint, of each group of rows.

        groups : number of the group of each row, shape (r,), from 0.
        """
        if isinstance(self.W, StreamedMatrix):
            return self.W.joint_factors(self.Y, groups)
        return joint_factors(self.W, self.Y, self.rows, groups)

    def columns(self, names: Sequence[str]) -> Observation:
        """Return the same rows of Y = W X + rho with the named columns of W only, in this order."""
        if tuple(names) == self.names:
            return self
        kept = column_numbers(names, self.names)
        W = self.W[:, kept]
        return replace(self, W=W if self.streamed else np.asfortranarray(W), names=tuple(names))

    def equal_parts(self, count: int) -> Array:
        """Return the number of the time interval of each row, for `count` equal ones, shape (r,).

        The numbers start from 0.
        """
        start, end = self.span  # the same of rows of one instant
        return np.asarray(
            (count * (self.t - start) / ((end - start) or 1.0)).astype(int).clip(max=count - 1)
        )

    def where(self, mask: Array) -> Observation:
        """Return the rows of Y = W X + rho for which `mask`, bool of shape (r,), is true."""
        if mask.shape != self.Y.shape or mask.dtype != np.bool_:
            raise InputError(
                f"the mask has dtype {mask.dtype} and shape {mask.shape}; "
                f"expected bool {self.Y.shape}"
            )
        rows = tuple(int(np.count_nonzero(mask[self.joint(j)])) for j in range(self.n))
        loop = (
            None
            if self.closed_loop is None
            else replace(self.closed_loop, rows=self.closed_loop.rows[mask])
        )
        return replace(
            self,
            W=self.W[mask] if self.streamed else np.compress(mask, self.W.T, axis=1).T,
            Y=self.Y[mask],
            t=self.t[mask],
            record=self.record[mask],
            rows=rows,
            closed_loop=loop,
            motion=None if self.motion is None else self.motion[mask],
        )

    def between(self, t0: float | None, t1: float | None) -> Observation:
        """Return the rows of Y = W X + rho with t0 <= t <= t1, s; None leaves an end open.

        An interval of a long record that is asked for again has the factors of before.
        """
        first = -np.inf if t0 is None else t0
        last = np.inf if t1 is None else t1
        part = self.where((self.t >= first) & (self.t <= last))
        if not any(part.rows):
            raise InputError(
                f"no row of the observation lies in [{t0}, {t1}] s; the rows span "
                f"[{self.span[0]:g}, {self.span[1]:g}] s"
            )
        if self.streamed:
            if (t0, t1) not in self._parts:
                self._parts[t0, t1] = {"block_factors": part.block_factors, "factor": part.factor}
            vars(part).update(self._parts[t0, t1])
        return part

    def folds(self, count: int) -> Iterator[tuple[Observation, Observation]]:
        """Yield the rows outside and inside each of `count` equal intervals of time that has rows.

        The factors of a long record are those of `fold_factors`.
        """
        number = numbered(self.equal_parts(count))
        for p in range(number.max(initial=-1) + 1):
            rest, part = self.where(number != p), self.where(number == p)
            if self.streamed:
                factors = self.fold_factors(count)
                others = merged([own.joints for k, own in enumerate(factors) if k != p])
                vars(part)["factor"] = factors[p]
                vars(rest)["factor"] = Factor.of(self.names, others)
            yield rest, part

    def fold_factors(self, count: int) -> list[Factor]:
        """Compute the factor of [W Y] in each of `count` equal intervals of time that has rows.

        Those of a long record come from one pass, and are kept.
        """
        number = numbered(self.equal_parts(count))
        if not self.streamed:
            return [self.where(number == p).factor for p in range(number.max(initial=-1) + 1)]
        if count not in self._parts:
            self._parts[count] = [Factor.of(self.names, own) for own in self.joint_factors(number)]
        return cast("list[Factor]", self._parts[count])

    @cached_property
    def _parts(self) -> dict[Any, Any]:
        """Factors of intervals of a long record that were asked for, by interval or their number."""
        return {}

    def of_record(self, number: int) -> Observation:
        """Return the rows of Y = W X + rho from one record; its number is counted from 0."""
        rate = self.rates[number] if self.rates else self.rate
        return replace(self.where(self.record == number), rate=rate, rates=())

    def norms(self, names: Sequence[str], X: Array) -> tuple[Array, Array]:
        """Compute the norms ||Y_j - W_j X|| and ||Y_j|| of every joint, N m or N, shape (n,) each.

        X : values of the columns `names`; other columns count as zero.
        """
        whole = np.zeros(len(self.names))
        whole[column_numbers(names, self.names)] = X
        if self.streamed:
            joints = self.factor.joints
            return (
                np.array([joint.residual_norm(whole) for joint in joints]),
                np.array([joint.measured_norm for joint in joints]),
            )
        residual = self.Y - self.W @ whole
        return (
            np.array([np.linalg.norm(residual[self.joint(j)]) for j in range(self.n)]),
            np.array([np.linalg.norm(self.Y[self.joint(j)]) for j in range(self.n)]),
        )

    @property
    def residual_block(self) -> float:
        """Default length of a block of time, s: a 50th of the record, at least five rows.

        Blocks of time serve to compute corrected standard deviations.
        """
        return float(max(max(self.rows) / BLOCKS, SHORTEST) / self.rate)

    def blocks(self, length: float | None = None) -> Array:
        """Return the number of the time block of each row, for blocks of `length` s, shape (r,).

        The numbers start from 0. No block extends over two records.
        """
        record = numbered(self.record)
        first = np.full(record.max() + 1, np.inf)
        np.minimum.at(first, record, self.t)
        interval = np.floor(
            (self.t - first[record]) / (length or self.residual_block) + 1e-9
        ).astype(np.intp)
        return numbered(record * (interval.max() + 1) + interval)

    def bands(self, load: Array) -> list[Array]:
        """Return bands of rows by speed, load, position, and way since the last reversal.

        Each has the number of the band of each row, shape (r,), from 0; each joint has BANDS bands
        with equally many rows. The list is empty if the motion of the joints is unknown.

        load : torque of the joint of each row, shape (r,).
        """
        return [*self.motion_bands, self._bands(np.abs(load))] if self.motion is not None else []

    @cached_property
    def motion_bands(self) -> list[Array]:
        """Bands of rows by speed, position, and way since the last reversal, as of `bands`."""
        if self.motion is None:
            return []
        q, qd = self.motion.T
        return [self._bands(values) for values in (np.abs(qd), q, self._ways())]

    def _ways(self) -> Array:
        """Compute the way of the joint of each row since its last reversal, rad or m, shape (r,)."""
        assert self.motion is not None
        ways = np.empty(len(self.Y))
        for own in map(self.joint, range(self.n)):
            q, qd = self.motion[own].T
            new = np.diff(np.sign(qd), prepend=0.0) != 0
            new[np.diff(self.record[own], prepend=-1) != 0] = True
            last = np.maximum.accumulate(np.where(new, np.arange(len(q)), 0))
            ways[own] = np.abs(q - q[last])
        return ways

    def _bands(self, values: Array) -> Array:
        """Number the bands of one quantity; a joint in which it is constant has one band."""
        band = np.zeros(len(self.Y), dtype=np.int8)
        for j in range(self.n):
            own = self.joint(j)
            if np.ptp(values[own]) if self.rows[j] else 0.0:
                order = np.argsort(values[own], kind="stable")
                band[own][order] = np.arange(len(order)) * BANDS // len(order)
        return band

    @cached_property
    def instants(self) -> Array:
        """Number of the row of each joint at each instant, shape (instants, n); -1 if it has none."""
        _, instant = np.unique(np.stack([self.record, self.t]), axis=1, return_inverse=True)
        place = np.full((instant.max(initial=-1) + 1, self.n), -1)
        place[instant.reshape(-1), self.joints] = np.arange(len(self.Y))
        return place

    def whitened(self, A: Array, covariance: Array) -> Array:
        """Multiply the rows of each instant in A, shape (r, c), by L^-1, so that they are independent.

        L L' is the covariance of the torques of the joints that have rows at this instant, a part
        of `covariance`, shape (n, n). LinAlgError if it is singular.
        """
        white = np.empty_like(A)
        patterns, pattern = np.unique(self.instants >= 0, axis=0, return_inverse=True)
        for k, joints in enumerate(patterns):
            rows = self.instants[pattern.reshape(-1) == k][:, joints]
            L = np.linalg.cholesky(covariance[np.ix_(joints, joints)])
            white[rows] = np.linalg.solve(L, A[rows])
        return white

    def band_rows(
        self, names: Sequence[str], weights: Array, X: Array, covariance: Array | None = None
    ) -> Iterator[Iterator[Array]]:
        """Yield the weighted rows of [W Y], shape (rows, b + 1), one band after another.

        One iterator for each kind of band (`bands`); the load is W X. The other parameters are
        those of `block_rows`.
        """
        whole = np.zeros(len(self.names))
        whole[column_numbers(names, self.names)] = X
        load = self.W @ whole
        if not self.streamed or covariance is not None:
            for groups in self.bands(load):
                yield self._weighted_rows(names, weights, groups, covariance)
        elif self.motion is not None:
            for factors in (*self.motion_factors, *self.gram_factors([self._bands(np.abs(load))])):
                yield self._weighted_factors(names, weights, factors)

    @cached_property
    def motion_factors(self) -> list[list[tuple[JointFactor, ...]]]:
        """Factors of `motion_bands` of a long record, each band joint by joint."""
        return self.gram_factors(self.motion_bands)

    def gram_factors(self, groupings: Sequence[Array]) -> list[list[tuple[JointFactor, ...]]]:
        """Compute factors of the groups of each grouping, by their Gram matrices, of a long record."""
        assert isinstance(self.W, StreamedMatrix)
        return self.W.gram_factors(self.Y, groupings, self.factor)

    def _weighted_factors(
        self, names: Sequence[str], weights: Array, groups: Sequence[Sequence[JointFactor]]
    ) -> Iterator[Array]:
        """Yield the weighted factors of [W Y] of each group, in place of its rows."""
        kept = column_numbers(names, self.names)
        for joints in groups:
            yield np.vstack(
                [
                    weight * selected(joint, kept).spread(len(kept))
                    for joint, weight in zip(joints, weights, strict=True)
                    if joint.rows
                ]
            )

    def _weighted_rows(
        self, names: Sequence[str], weights: Array, groups: Array, covariance: Array | None
    ) -> Iterator[Array]:
        """Yield the weighted rows of [W Y] of each group; `groups` has the group of each row."""
        kept = column_numbers(names, self.names)
        if covariance is not None:
            A = np.column_stack([self.W[:, kept], self.Y])
            yield from split_rows(self.whitened(A, covariance), groups)
            return
        row_weights = np.repeat(weights, self.rows)
        for rows in rows_by_block(groups):
            A = np.empty((len(kept) + 1, len(rows)))  # column by column
            for k, column in enumerate(kept):
                np.take(self.W[:, column], rows, out=A[k], mode="clip")
            A[-1] = self.Y[rows]
            A *= row_weights[rows]
            yield A.T

    def block_rows(
        self, names: Sequence[str], weights: Array, length: float, covariance: Array | None = None
    ) -> Iterator[Array]:
        """Yield the weighted rows of [W Y], shape (rows, b + 1), block of time by block of time.

        For a long record, factors from `block_factors` replace the rows: their Gram matrix is the
        same.

        Parameters
        ----------
        names : sequence of str
            The b columns of W.
        weights : ndarray, shape (n,)
            Factors by which the rows of each joint are multiplied.
        length : float, s
            Length of a block.
        covariance : ndarray, shape (n, n), optional
            Covariance of the torques of one instant, by which rows are whitened in place of the
            weights.
        """
        factors = None
        if covariance is None and length == self.residual_block:
            factors = self.block_factors
        if factors is None and covariance is None and self.streamed:
            (factors,) = self.gram_factors([self.blocks(length)])
        if factors is None:
            yield from self._weighted_rows(names, weights, self.blocks(length), covariance)
        else:
            yield from self._weighted_factors(names, weights, factors)


def split_rows(A: Array, blocks: Array) -> Iterator[Array]:
    """Yield, for one block of time after another, the rows of A, shape (r, c), in that block.

    blocks : number of the block of each row, shape (r,).
    """
    return (A[rows] for rows in rows_by_block(blocks))


def rows_by_block(blocks: Array) -> list[Array]:
    """List the row numbers that belong to each block of time, one array per block.

    blocks : number of the block of each row, shape (r,).
    """
    order = np.argsort(blocks, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(blocks[order])) + 1)


def numbered(groups: Array) -> Array:
    """Number the groups that occur from 0, in their order; integers from 0, shape (r,)."""
    number = np.cumsum(np.bincount(groups) > 0) - 1
    return np.asarray(number[groups])


def halves(t0: float, t1: float) -> tuple[Window, Window]:
    """Split the time interval [t0, t1], s, into two halves that have no sample in common."""
    middle = (t0 + t1) / 2
    return (t0, middle), (float(np.nextafter(middle, t1)), t1)


def stack(observations: Sequence[Observation]) -> Observation:
    """Stack the rows Y = W X + rho of several records of one robot, with all rows of joint 1 first.

    `record` of the result has the number of the record of each row.
    """
    if not observations:
        raise InputError("no observation to stack; give at least one")
    if len(observations) == 1:
        return observations[0]
    _require_same_columns(observations)
    n = observations[0].n
    rows = [(o, o.joint(j)) for j in range(n) for o in _numbered(observations)]
    known = all(o.motion is not None for o in observations)
    matrices: list[Any] = [o.W for o in observations]
    return Observation(
        W=cast("Array", stacked_matrices(matrices))
        if all(o.streamed for o in observations)
        else np.asfortranarray(_joined("W", rows)),
        Y=_joined("Y", rows),
        rows=tuple(sum(o.rows[j] for o in observations) for j in range(n)),
        names=observations[0].names,
        t=_joined("t", rows),
        record=_joined("record", rows),
        rate=max(o.rate for o in observations),
        dropped=_dropped(observations),
        settings=same_settings([o.settings for o in observations]),
        files=all_files([o.files for o in observations]),
        findings=tuple(dict.fromkeys(text for o in observations for text in o.findings)),
        rates=tuple(rate for o in observations for rate in (o.rates or (o.rate,))),
        motion=_joined("motion", rows) if known else None,
    )


def _require_same_columns(observations: Sequence[Observation]) -> None:
    """Raise InputError unless all observations have the columns and the joints of the first one."""
    first = observations[0]
    for o in observations:
        if o.names != first.names or o.n != first.n:
            raise InputError(
                f"columns {o.names} on {o.n} joints; expected the columns of the first record, "
                f"{first.names} on {first.n} joints"
            )


def _numbered(observations: Sequence[Observation]) -> list[Observation]:
    """Number the records of all observations in one sequence, from 0."""
    first = np.cumsum([0] + [int(o.record.max(initial=0)) + 1 for o in observations])
    return [replace(o, record=o.record + k) for o, k in zip(observations, first, strict=False)]


def _joined(name: str, rows: Sequence[tuple[Observation, slice]]) -> Array:
    """Join the rows `own` of the array `name` of each observation."""
    return np.concatenate([getattr(o, name)[own] for o, own in rows])


def _dropped(observations: Sequence[Observation]) -> dict[str, tuple[int, ...]]:
    """Sum the numbers of the rows that were left out, per joint, by reason of the first record."""
    first = observations[0]
    nothing = (0,) * first.n
    counts = {
        reason: [o.dropped.get(reason, nothing) for o in observations] for reason in first.dropped
    }
    return {reason: tuple(map(sum, zip(*own, strict=True))) for reason, own in counts.items()}


def same_settings(settings: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return the settings that all records share, or the list of their settings if they differ."""
    return settings[0] if all(s == settings[0] for s in settings) else {"records": list(settings)}


def all_files(hashes: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Merge the mappings from file name to SHA-256 hash of all records into one mapping.

    If a later record has another file with the same name, the number of that record is added to the
    name.
    """
    files: dict[str, str] = {}
    for k, of_record in enumerate(hashes, start=1):
        for name, digest in of_record.items():
            files[name if files.get(name, digest) == digest else f"{name} ({k})"] = digest
    return files


def column_numbers(names: Sequence[str], among: Sequence[str]) -> list[int]:
    unknown = [name for name in names if name not in among]
    if unknown:
        raise InputError(f"no column {', '.join(unknown)}; expected some of {', '.join(among)}")
    return [list(among).index(name) for name in names]
