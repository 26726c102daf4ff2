"""The matrix W of a long record: its rows are made piece by piece when asked for, and forgotten.

    for piece in W.pieces():            rows of one joint in one interval of time
        W[piece.rows, piece.columns]    is piece.A'; the other columns are zero in these rows

    W @ X, W[rows, columns]             as of an array; numpy.asarray(W) makes all of W
    joint_factors                       triangular factors of groups of rows, from one pass
    gram_factors                        factors of groups of several kinds, from one pass

Rows are made of the distinct signals that the entries of W equal up to their sign: of states, or
of decimated signals, which are kept (a third of W). With R_j the factor of [W_j Y_j], from one pass,
and T_j its inverse, the rows of a group k of joint j in orthonormal coordinates give

    P_k = [W_k Y_k] T_j,      P_k'P_k = V L V',      R_k = L^1/2 V' T_j^-1

R_k'R_k is the Gram matrix of the group, with the rounding of R_j and not of W_j'W_j. It serves what
depends on Gram matrices alone (shares of groups); ranks need `joint_factors`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from runtime.core.rows.factor import Factor, JointFactor, triangularise
from runtime.ground.memory import require_memory

Array = np.ndarray

WHOLE = 64e6
"""Bytes of W up to which it is made once and kept."""
PIECE = 4096
"""Instants whose rows are made at a time: their signals stay in the cache."""


@dataclass(frozen=True, eq=False)
class Entries:
    """Table of the nonzero entries of the regressor, which marks entries that are equal up to sign.

    Nonzero entry m is store[row[m], j[m]] = sign[m] * signal[which[m]].

    place : row of each signal in the store, shape (b n, N).
    """

    row: Array
    j: Array
    which: Array
    sign: Array
    place: Array


@dataclass(frozen=True, eq=False)
class Source:
    """The rows of one record: entries of W, and the signals that they equal, at K instants.

    read(a, b) gives the signals at the instants [a, b), shape (S, b - a), valid until the next call.
    used : bool (n, K), which instants of each joint are rows.
    """

    entries: Entries
    read: Callable[[int, int], Array]
    used: Array


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of joint j in one interval of time: W[rows, columns] = A', A of shape (c, rows)."""

    j: int
    rows: slice
    columns: Array
    A: Array


@dataclass(frozen=True, eq=False)
class StreamedMatrix(NDArrayOperatorsMixin):
    """W of long records, shape (r, b), read like an array of NumPy.

    Attributes
    ----------
    sources : tuple of Source
        The records.
    columns : ndarray of int, shape (b,)
        Columns of the entries that W has, in their order.
    """

    sources: tuple[Source, ...]
    columns: Array

    @cached_property
    def rows(self) -> Array:
        """Number of rows of each joint of each record, shape (n, records)."""
        return np.array([source.used.sum(axis=1) for source in self.sources]).T

    @property
    def shape(self) -> tuple[int, int]:
        """Rows r and columns b."""
        return int(self.rows.sum()), len(self.columns)

    def __len__(self) -> int:
        return self.shape[0]

    def pieces(self) -> Iterator[Piece]:
        """Yield all rows that are not empty, interval by interval and joint by joint."""
        counts = self.rows.ravel()
        at = (np.cumsum(counts) - counts).reshape(self.rows.shape)
        for k, source in enumerate(self.sources):
            acting = [_acting(source.entries, j, self.columns) for j in range(len(source.used))]
            for a in range(0, source.used.shape[1], PIECE):
                used = source.used[:, a : a + PIECE]
                if not used.any():
                    continue
                signals = source.read(a, a + used.shape[1])
                for j, (columns, which, sign) in enumerate(acting):
                    if not (count := np.count_nonzero(used[j])):
                        continue
                    A = signals[which]
                    A = A if count == used.shape[1] else np.compress(used[j], A, axis=1)
                    A *= sign[:, None]
                    yield Piece(j, slice(at[j, k], at[j, k] + count), columns, A)
                    at[j, k] += count

    def __matmul__(self, X: Any) -> Array:
        X = np.asarray(X)
        product = np.zeros((len(self), *X.shape[1:]))
        for piece in self.pieces():
            product[piece.rows] = piece.A.T @ X[piece.columns]
        return product

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        r, b = self.shape
        require_memory(
            8.0 * r * b,
            f"all {r:,} rows of {b} columns at once",
            "this analysis needs them; decimate (signals.decimate), or use a piece of the record "
            "(rows.window)",
        )
        W = np.zeros((b, r))
        for piece in self.pieces():
            W[piece.columns, piece.rows] = piece.A
        return W.T if dtype is None else W.T.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        whole = [np.asarray(x) if isinstance(x, StreamedMatrix) else x for x in inputs]
        return getattr(ufunc, method)(*whole, **options)

    def __getitem__(self, key: Any) -> Any:
        """Return W[rows] or W[rows, columns]: as such a matrix where rows keep their order."""
        rows, columns = key if isinstance(key, tuple) else (key, slice(None))
        if np.ndim(columns) == 0 and not isinstance(columns, slice):
            return np.asarray(self[rows, [columns]])[:, 0]
        columns = np.arange(self.shape[1])[columns].ravel()
        mask = np.zeros(len(self), dtype=bool)
        if isinstance(rows, slice) and (rows.step or 1) > 0:
            mask[rows] = True
        elif np.asarray(rows).dtype == np.bool_:
            mask = np.asarray(rows).ravel()
        elif np.ndim(rows) and (np.diff(np.ravel(rows)) > 0).all():
            mask[np.ravel(rows)] = True
        else:
            return np.asarray(self)[key]
        return replace(self, columns=self.columns[columns]).where(mask)

    def where(self, mask: Array) -> StreamedMatrix:
        """Return the rows for which `mask`, bool of shape (r,), is true."""
        if mask.all():
            return self
        ends, sources = np.cumsum(self.rows).reshape(self.rows.shape), []
        for k, source in enumerate(self.sources):
            used = np.zeros_like(source.used)
            for j, own in enumerate(source.used):
                used[j, own] = mask[ends[j, k] - self.rows[j, k] : ends[j, k]]
            sources.append(replace(source, used=used))
        return replace(self, sources=tuple(sources))

    def joint_factors(self, Y: Array, groups: Array) -> list[tuple[JointFactor, ...]]:
        """Compute the triangular factor of [W_j Y_j] of every joint in each group of rows.

        groups : number of the group of each row, shape (r,), from 0.
        """
        count, n = int(groups.max(initial=0)) + 1, len(self.rows)
        factors = [[self._no_rows(j) for j in range(n)] for _ in range(count)]
        for piece in self.pieces():
            A = np.vstack([piece.A, Y[piece.rows]])
            if not np.isfinite(A).all():
                raise ValueError(
                    "W or Y holds values that are not finite; leave those samples out of the record"
                )
            for group, own in _grouped(groups[piece.rows]):
                before, more = factors[group][piece.j], A[:, own].T
                R = triangularise(np.vstack([before.R, more]) if before.rows else more)
                factors[group][piece.j] = replace(before, R=R, rows=before.rows + len(more))
        return [tuple(own) for own in factors]

    def gram_factors(
        self, Y: Array, groupings: Sequence[Array], whole: Factor
    ) -> list[list[tuple[JointFactor, ...]]]:
        """Compute factors R_k of the groups of each grouping, by their Gram matrices.

        groupings : number of the group of each row, shape (r,), from 0, for each grouping.
        whole : the factor of all rows.
        """
        n, bases = len(self.rows), [_orthonormal(joint.R) for joint in whole.joints]
        sizes = [int(groups.max(initial=0)) + 1 for groups in groupings]
        grams = [[[np.zeros((len(B),) * 2) for _, B in bases] for _ in range(k)] for k in sizes]
        rows = [np.zeros((k, n), dtype=int) for k in sizes]
        for piece in self.pieces():
            P = bases[piece.j][0].T @ np.vstack([piece.A, Y[piece.rows]])
            for groups, gram, count in zip(groupings, grams, rows, strict=True):
                for group, own in _grouped(groups[piece.rows]):
                    some = P[:, own]
                    gram[group][piece.j] += some @ some.T
                    count[group, piece.j] += some.shape[1]
        return [
            [
                tuple(
                    replace(joint, R=_root(G) @ B, rows=int(r))
                    for joint, G, (_, B), r in zip(whole.joints, of_joints, bases, own, strict=True)
                )
                for of_joints, own in zip(gram, count, strict=True)
            ]
            for gram, count in zip(grams, rows, strict=True)
        ]

    def _no_rows(self, j: int) -> JointFactor:
        """The factor of no rows of joint j."""
        columns = _acting(self.sources[0].entries, j, self.columns)[0]
        return JointFactor(columns, np.zeros((len(columns) + 1,) * 2), 0)


def stacked_matrices(parts: Sequence[StreamedMatrix]) -> StreamedMatrix:
    """Stack the rows of several records with the same columns, all rows of joint 1 first."""
    return replace(parts[0], sources=tuple(source for part in parts for source in part.sources))


def _acting(entries: Entries, j: int, columns: Array) -> tuple[Array, Array, Array]:
    """Find the entries of joint j: columns of W, shape (c,), the signal and the sign of each."""
    place = np.full(max(entries.row.max(initial=0), columns.max(initial=0)) + 1, -1)
    place[columns] = np.arange(len(columns))
    own = np.flatnonzero((entries.j == j) & (place[entries.row] >= 0))
    own = own[np.argsort(place[entries.row[own]], kind="stable")]
    return place[entries.row[own]], entries.which[own], entries.sign[own]


def _grouped(groups: Array) -> Iterator[tuple[int, Any]]:
    """Yield each group and its rows, from the group of each row."""
    if (groups == groups[0]).all():
        yield int(groups[0]), slice(None)
        return
    order = np.argsort(groups, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(groups[order])) + 1):
        yield int(groups[rows[0]]), rows


def _orthonormal(R: Array) -> tuple[Array, Array]:
    """Return T and its inverse B for a factor R: R T has orthonormal columns, and R = R T B.

    Directions without rows are left out. T : shape (c, k). B : shape (k, c).
    """
    size = np.linalg.norm(R, axis=0)
    size = np.where(size > 0, size, 1.0)
    _, s, Vt = np.linalg.svd(R / size, full_matrices=False)
    kept = s > len(s) * np.finfo(float).eps * s.max(initial=0.0)
    return Vt[kept].T / s[kept] / size[:, None], s[kept, None] * Vt[kept] * size


def _root(G: Array) -> Array:
    """Compute a matrix whose Gram matrix is the positive semidefinite G."""
    values, V = np.linalg.eigh(G)
    return np.asarray(np.sqrt(values.clip(0.0))[:, None] * V.T)
