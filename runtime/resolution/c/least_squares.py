"""Least squares in C on the rows of a compiled model: normal equations by joint with one refinement, or the structured triangular factor.

    normal_equations(model, q, qd, qdd, tau)              any number of samples: the regressor is evaluated by blocks and not stored
    triangular_factor(model, q, qd, qdd, tau)
    least_squares(KeptRows(entries, parts, room))         rows of decimated signals (resolution studies)

The functions of `runtime.estimators.reductions`, with the same results to rounding and the same rule which of the two serves (`runtime.estimators.normal_equations`).
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgeqrf

from runtime.errors import InputError
from runtime.estimators.normal_equations import LIMIT, LeastSquares, Normal
from runtime.estimators.solution import solve
from runtime.model.compiled import CompiledModel
from runtime.model.generated import check_states
from runtime.observation.qr_factor import Factor, JointFactor, stacked
from runtime.resolution.c.kernels import (  # fmt: skip
    LANES,
    SIDE,
    SPAN,
    Entries,
    EntriesStructure,
    Room,
    RowsStructure,
    SourceStructure,
    address,
    call,
    constant_values,
)

Array = np.ndarray

NORMAL, RESIDUAL, ROWS = 0, 1, 2  # tasks of kernels.c
PADDED = SPAN + LANES  # numbers from row to row of a block: no power of two
QR_ROWS = 2048  # samples of one update of the triangular factors


def normal_equations(
    model: CompiledModel, q: Array, qd: Array, qdd: Array, tau: Array, *, constants: Mapping[str, float] | None = None, limit: float = LIMIT
) -> LeastSquares:
    """X = argmin ||Y - W X|| over all samples by normal equations and one refinement; by the triangular factor where kappa reaches `limit`.

    q, qd, qdd, tau : ndarray, shape (N, n), joint side, SI.   constants : in place of the robot file's.
    """
    return least_squares(StreamedRows(model, q, qd, qdd, tau, constants or {}), limit)


def triangular_factor(
    model: CompiledModel, q: Array, qd: Array, qdd: Array, tau: Array, *, constants: Mapping[str, float] | None = None
) -> Factor:
    """Structured triangular factor of [W Y] over all samples; q, qd, qdd, tau : ndarray, shape (N, n), joint side, SI."""
    return StreamedRows(model, q, qd, qdd, tau, constants or {}).factor()


def least_squares(rows: CRows, limit: float = LIMIT) -> LeastSquares:
    """X = argmin ||Y - W X|| by normal equations and one refinement; by the triangular factor where kappa reaches `limit`.

    The residual norms are those before the refinement: it changes them by less than kappa^2 eps squared.
    """
    equations = rows.normal()
    cholesky = equations.cholesky()
    if cholesky is None or not cholesky.kappa < limit:
        factor = rows.factor()
        fit = solve(factor)
        norms = np.array([joint.residual_norm(fit.X) for joint in factor.joints])
        return LeastSquares(fit.X, norms, fit.cond_unit, "triangular factor")
    X = cholesky.solve(equations.g)
    gradients, squares = rows.gradient(X)
    X += cholesky.solve(equations.scattered(gradients))
    return LeastSquares(X, np.sqrt(squares), cholesky.kappa, "normal equations")


class CRows(ABC):
    """Rows of [W_j Y_j] that C passes over."""

    def __init__(self, entries: Entries, room: Room) -> None:
        self.entries, self.room = entries, room
        self.counts = [len(C) + 1 for C in entries.columns]
        self.widths = [-(-count // SIDE) * SIDE for count in self.counts]

    @abstractmethod
    def passed(self, task: int, entries: EntriesStructure, X: Array | None) -> None:
        """One pass of NORMAL or RESIDUAL over all rows."""

    @abstractmethod
    def chunks(self, entries: EntriesStructure) -> Iterator[None]:
        """The rows for a QR, at most `entries.most` samples at a time."""

    def normal(self) -> Normal:
        """Gram matrices of [W_j Y_j] by joint."""
        A = self.room.array("A", sum(w * w for w in self.widths))
        A.fill(0)
        self.passed(NORMAL, self._structure(A=A), None)
        grams, end = [], 0
        for width, count in zip(self.widths, self.counts, strict=True):
            grams.append(A[end : end + width * width].reshape(width, width)[:count, :count].copy())
            end += width * width
        return Normal(self.entries.columns, tuple(grams), len(self.entries.names))

    def gradient(self, X: Array) -> tuple[list[Array], Array]:
        """W_j'(Y_j - W_j X) and ||Y_j - W_j X||^2 by joint."""
        g = self.room.array("g", sum(self.widths))
        g.fill(0)
        self.passed(RESIDUAL, self._structure(g=g), np.ascontiguousarray(X[self.entries.place]))
        parts = [part[:count] for part, count in zip(np.split(g, np.cumsum(self.widths)[:-1]), self.counts, strict=True)]
        return [part[:-1].copy() for part in parts], np.array([part[-1] for part in parts])

    def factor(self) -> Factor:
        """Structured triangular factor of [W Y]: R_j = R factor of [R_j; next rows], LAPACK in place."""
        most = QR_ROWS
        R = self.room.array("R", sum(count * (count + most) for count in self.counts))
        ends = np.cumsum([0] + [count * (count + most) for count in self.counts])
        blocks = [R[end : end + c * (c + most)].reshape(c, c + most) for end, c in zip(ends, self.counts, strict=False)]
        for block, count in zip(blocks, self.counts, strict=True):
            block[:, :count] = 0
        taken = np.zeros(self.entries.n, dtype=np.int64)
        total = np.zeros_like(taken)
        for _ in self.chunks(self._structure(R=R, taken=taken, most=most)):
            for block, count, rows in zip(blocks, self.counts, taken, strict=True):
                block[:, count + rows :] = 0
                dgeqrf(block.T, overwrite_a=1)
                block[:, :count] = np.tril(block[:, :count])
            total += taken
            taken.fill(0)
        joints = tuple(
            JointFactor(np.asarray(C), block[:, :count].T.copy(), int(rows))
            for C, block, count, rows in zip(self.entries.columns, blocks, self.counts, total, strict=True)
        )
        return Factor(self.entries.names, stacked(joints, len(self.entries.names)), joints)

    def _structure(self, most: int = 0, **arrays: Array) -> EntriesStructure:
        """The entries for C, with what this pass fills."""
        e = self.entries
        O = self.room.array("O", max(self.widths), PADDED)
        filled = {name: address(x) for name, x in arrays.items()}
        return EntriesStructure(e.n, most, address(e.start), address(self.signal), address(e.sign), O=address(O), **filled)

    @property
    @abstractmethod
    def signal(self) -> Array:
        """Row of U of each entry."""


class KeptRows(CRows):
    """Rows of decimated signals: `parts` are (y (S, K) as `fused.decimated` gives them, torques (n, K), mask (n, K)), one for each record."""

    def __init__(self, entries: Entries, parts: Sequence[tuple[Array, Array, Array]], room: Room) -> None:
        super().__init__(entries, room)
        self.parts = [(y, np.ascontiguousarray(Y, dtype=float), np.ascontiguousarray(mask, dtype=np.uint8)) for y, Y, mask in parts]

    @property
    def signal(self) -> Array:
        return self.entries.number

    def passed(self, task: int, entries: EntriesStructure, X: Array | None) -> None:
        for y, Y, mask in self.parts:
            rows = RowsStructure(Y.shape[1], y.shape[1], 0, Y.shape[1], Y.shape[1], address(y), address(Y), address(mask))
            if task == NORMAL:
                call("normal", ctypes.byref(entries), ctypes.byref(rows))
            else:
                call("residual", ctypes.byref(entries), ctypes.byref(rows), _pointer(X))

    def chunks(self, entries: EntriesStructure) -> Iterator[None]:
        for y, Y, mask in self.parts:
            K = Y.shape[1]
            for k in range(0, K, entries.most):
                starts = y.ctypes.data + 8 * k, Y.ctypes.data + 8 * k, mask.ctypes.data + k
                call("rows", ctypes.byref(entries), ctypes.byref(RowsStructure(min(entries.most, K - k), y.shape[1], 0, K, K, *starts)))
                yield


class StreamedRows(CRows):
    """Every sample of states and torques, shape (N, n) each, all base parameters."""

    def __init__(
        self, model: CompiledModel, q: Array, qd: Array, qdd: Array, tau: Array, constants: Mapping[str, float], room: Room | None = None
    ) -> None:
        check_states(model, q, qd, qdd)
        if np.shape(tau) != np.shape(q) or np.ndim(q) != 2:
            raise InputError(f"tau {np.shape(tau)}, q {np.shape(q)}; expected (N, {len(model.JOINTS)}) both")
        super().__init__(Entries(model, model.BASE_PARAMETERS), room or Room())
        self.given = [np.ascontiguousarray(x, dtype=float) for x in (q, qd, qdd, tau)]
        self.constants = constant_values(model, constants)

    @property
    def signal(self) -> Array:
        return self.entries.signal

    def passed(self, task: int, entries: EntriesStructure, X: Array | None) -> None:
        self._stream(task, entries, X, 0, len(self.given[0]))

    def chunks(self, entries: EntriesStructure) -> Iterator[None]:
        N = len(self.given[0])
        for t in range(0, N, entries.most):
            self._stream(ROWS, entries, None, t, min(entries.most, N - t))
            yield

    def _stream(self, task: int, entries: EntriesStructure, X: Array | None, t: int, m: int) -> None:
        table, n = self.entries.model.signals, self.entries.n
        U, rows = self.room.array("blockU", table.count * -(-SPAN // table.tile) * table.tile), self.room.array("block", 4, n, PADDED)
        source = SourceStructure(table.address, address(self.constants), table.count, 0, table.tile, 0, None, address(U), address(rows))
        given: Any = (ctypes.c_void_p * 4)(*(address(x) + 8 * n * t for x in self.given))
        sizes = map(ctypes.c_int64, (m, SPAN, PADDED))
        call("stream", ctypes.c_int32(task), *map(ctypes.byref, (source, entries)), *sizes, given, _pointer(X))


def _pointer(X: Array | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if X is None else address(X))
