"""Least squares in C on the rows of a resolution study: normal equations by joint with one
refinement, or the structured triangular factor.

    least_squares(KeptRows(entries, parts, room))

The function of `runtime.estimators.normal_equations`, with the same results to rounding and the
same rule which of the two serves.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dgeqrf

from runtime.estimators.normal_equations import JointEquations, LeastSquares
from runtime.estimators.solution import solve
from runtime.limits import LIMIT
from runtime.resolution.c.kernels import (
    LANES,
    SIDE,
    SPAN,
    EntriesStructure,
    Room,
    RowsStructure,
    SignalEntries,
    address,
    call,
)
from runtime.rows.factor import Factor, JointFactor

Array = np.ndarray

PADDED = SPAN + LANES  # numbers from row to row of a block: no power of two
QR_ROWS = 2048  # samples of one update of the triangular factors


def least_squares(rows: KeptRows, limit: float = LIMIT.NORMAL_EQUATIONS) -> LeastSquares:
    """X = argmin ||Y - W X|| by normal equations and one refinement; by the triangular factor where
    kappa reaches `limit`.

    The residual norms are those before the refinement: it changes them by less than kappa^2 eps
    squared.
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


class KeptRows:
    """Rows of [W_j Y_j] of decimated signals, that C passes over.

    Parameters
    ----------
    entries : SignalEntries
        Where the signals stand in W.
    parts : sequence of (y, Y, mask), one for each record
        Signals y, shape (S, K), as `kernels.decimated` gives them; torques Y, shape (n, K), N m
        (N); mask, bool, shape (n, K), of the rows used.
    room : Room
        Arrays that calls reuse.
    """

    def __init__(
        self, entries: SignalEntries, parts: Sequence[tuple[Array, Array, Array]], room: Room
    ) -> None:
        self.entries, self.room = entries, room
        self.counts = [len(C) + 1 for C in entries.columns]
        self.widths = [-(-count // SIDE) * SIDE for count in self.counts]
        self.parts = [
            (y, np.ascontiguousarray(Y, dtype=float), np.ascontiguousarray(mask, dtype=np.uint8))
            for y, Y, mask in parts
        ]

    def normal(self) -> JointEquations:
        """Gram matrices of [W_j Y_j] by joint."""
        A = self.room.array("A", sum(w * w for w in self.widths))
        A.fill(0)
        self._pass("normal", self._structure(A=A))
        grams, end = [], 0
        for width, count in zip(self.widths, self.counts, strict=True):
            grams.append(A[end : end + width * width].reshape(width, width)[:count, :count].copy())
            end += width * width
        return JointEquations(self.entries.columns, tuple(grams), len(self.entries.names))

    def gradient(self, X: Array) -> tuple[list[Array], Array]:
        """W_j'(Y_j - W_j X) and ||Y_j - W_j X||^2 by joint."""
        g = self.room.array("g", sum(self.widths))
        g.fill(0)
        by_entry = np.ascontiguousarray(X[self.entries.place])
        self._pass("residual", self._structure(g=g), ctypes.c_void_p(address(by_entry)))
        parts = [
            part[:count]
            for part, count in zip(
                np.split(g, np.cumsum(self.widths)[:-1]), self.counts, strict=True
            )
        ]
        return [part[:-1].copy() for part in parts], np.array([part[-1] for part in parts])

    def factor(self) -> Factor:
        """Structured triangular factor of [W Y]: R_j = R factor of [R_j; next rows], LAPACK in
        place.
        """
        R = self.room.array("R", sum(count * (count + QR_ROWS) for count in self.counts))
        ends = np.cumsum([0] + [count * (count + QR_ROWS) for count in self.counts])
        blocks = [
            R[end : end + c * (c + QR_ROWS)].reshape(c, c + QR_ROWS)
            for end, c in zip(ends, self.counts, strict=False)
        ]
        for block, count in zip(blocks, self.counts, strict=True):
            block[:, :count] = 0
        taken = np.zeros(self.entries.n, dtype=np.int64)
        total = np.zeros_like(taken)
        entries = self._structure(R=R, taken=taken, most=QR_ROWS)
        for y, Y, mask in self.parts:
            K = Y.shape[1]
            for k in range(0, K, QR_ROWS):
                starts = y.ctypes.data + 8 * k, Y.ctypes.data + 8 * k, mask.ctypes.data + k
                call(
                    "rows",
                    ctypes.byref(entries),
                    ctypes.byref(RowsStructure(min(QR_ROWS, K - k), y.shape[1], 0, K, K, *starts)),
                )
                for block, count, rows in zip(blocks, self.counts, taken, strict=True):
                    block[:, count + rows :] = 0
                    dgeqrf(block.T, overwrite_a=1)
                    block[:, :count] = np.tril(block[:, :count])
                total += taken
                taken.fill(0)
        joints = tuple(
            JointFactor(np.asarray(C), block[:, :count].T.copy(), int(rows))
            for C, block, count, rows in zip(
                self.entries.columns, blocks, self.counts, total, strict=True
            )
        )
        return Factor.of(self.entries.names, joints)

    def _pass(self, task: str, entries: EntriesStructure, *arguments: ctypes.c_void_p) -> None:
        """One pass of fused_normal or fused_residual over all rows."""
        for y, Y, mask in self.parts:
            K = Y.shape[1]
            call(
                task,
                ctypes.byref(entries),
                ctypes.byref(RowsStructure(K, K, 0, K, K, address(y), address(Y), address(mask))),
                *arguments,
            )

    def _structure(self, most: int = 0, **arrays: Array) -> EntriesStructure:
        """The entries for C, with what this pass fills."""
        e = self.entries
        O = self.room.array("O", max(self.widths), PADDED)
        filled = {name: address(x) for name, x in arrays.items()}
        return EntriesStructure(
            e.n, most, address(e.start), address(e.number), address(e.sign), O=address(O), **filled
        )
