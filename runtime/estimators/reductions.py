"""Least squares on states of any number of samples, without W: blocks of the regressor go straight into small matrices.

    normal_equations(model, q, qd, qdd, tau)       X by per-joint normal equations and one refinement
    triangular_factor(model, q, qd, qdd, tau)      the structured factor of [W Y], from which every estimate is read
    joint_columns(model)                           C_j: the columns that act on joint j, from STRUCTURE

Which entries of the regressor are signals of their own is told by `runtime.observation.regressor_signals.distinct_entries`, their values by `runtime.observation.regressor_signals.signals_of`.
A block of rows of joint j is [W_j[:, C_j] Y_j]', shape (|C_j| + 1, B): structural zeros are never multiplied. These take every sample as it is;
records with filters, decimation and rows left out are reduced by `runtime.observation.by_blocks`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from runtime.errors import InputError
from runtime.estimators.normal_equations import Block, LeastSquares, least_squares, triangular
from runtime.model.generated import GeneratedModel, check_states
from runtime.observation.qr_factor import Factor

Array = np.ndarray

BLOCK = 4096  # samples: rows of 32 kB
KEPT = 32 * 2**20  # bytes of rows kept from the first pass for the second; more is evaluated again: fresh pages can cost more than that


def joint_columns(model: GeneratedModel) -> tuple[Array, ...]:
    """C_j, by joint: positions of the base parameters that act on joint j."""
    return tuple(np.flatnonzero(column) for column in np.asarray(model.STRUCTURE).T)


class JointRows:
    """The rows [W_j[:, C_j] Y_j]' of given states, block by block, as often as asked.

    Iterating gives the blocks; the first `kept` bytes of them are evaluated once and reused by later passes.
    """

    def __init__(
        self,
        model: GeneratedModel,
        q: Array,
        qd: Array,
        qdd: Array,
        tau: Array,
        *,
        block: int = BLOCK,
        kept: int = 0,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        check_states(model, q, qd, qdd)
        if np.shape(tau) != np.shape(q) or np.ndim(q) != 2:
            raise InputError(f"tau {np.shape(tau)}, q {np.shape(q)}; expected (N, {len(model.JOINTS)}) both")
        if block < 1:
            raise InputError(f"block {block}; expected at least one sample")
        self.model, self.constants, self.block = model, dict(constants or {}), block
        self.states, self.tau = (q, qd, qdd), tau
        self.columns = joint_columns(model)
        sizes = [len(C) + 1 for C in self.columns]
        self.parts = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes), strict=True)]
        self.room = np.empty(min(kept // 8, sum(sizes) * len(q)))
        self.tiles: dict[int, Array] = {}

    def __iter__(self) -> Iterator[Block]:
        size = min(self.block, max(len(self.tau), 1))
        store, spare = self.model.store(size), np.empty(self.parts[-1].stop * size)
        for t0 in range(0, len(self.tau), size):
            tile = self.tiles.get(t0)
            if tile is None:
                samples = slice(t0, min(t0 + size, len(self.tau)))
                tile = self._room(samples, spare)
                if tile.shape[1] != np.shape(store)[2]:
                    store = self.model.store(tile.shape[1])
                self._fill(tile, samples, store)
            yield [tile[part] for part in self.parts]

    def _room(self, samples: slice, spare: Array) -> Array:
        """Where the rows of these samples go: kept for later passes while there is room, else overwritten by the next block."""
        rows, count = self.parts[-1].stop, samples.stop - samples.start
        if rows * samples.stop > len(self.room):
            return spare[: rows * count].reshape(rows, count)
        tile = self.room[rows * samples.start : rows * samples.stop].reshape(rows, count)
        self.tiles[samples.start] = tile
        return tile

    def _fill(self, tile: Array, samples: slice, store: Array) -> None:
        q, qd, qdd = (x[samples] for x in self.states)
        self.model.regressor(q, qd, qdd, out=store, **self.constants)
        n = len(self.columns)
        entries = np.asarray(store).reshape(-1, tile.shape[1])  # [k n + j, t], a view
        for j, (C, part) in enumerate(zip(self.columns, self.parts, strict=True)):
            entries.take(C * n + j, axis=0, out=tile[part][:-1], mode="clip")  # in range; "clip" writes without a buffer
            tile[part.stop - 1] = self.tau[samples, j]


def normal_equations(
    model: GeneratedModel,
    q: Array,
    qd: Array,
    qdd: Array,
    tau: Array,
    *,
    block: int = BLOCK,
    refinements: int = 1,
    kept: int = KEPT,
    constants: Mapping[str, float] | None = None,
) -> LeastSquares:
    """X = argmin ||Y - W X|| over all samples, by normal equations and refinement; by the triangular factor where they are not safe.

    q, qd, qdd, tau : ndarray, shape (N, n), joint side, SI.   block : samples evaluated at a time.
    kept : bytes of rows kept between the passes; 0 evaluates every block again.   constants : in place of the robot file's.
    """
    rows = JointRows(model, q, qd, qdd, tau, block=block, kept=kept if refinements else 0, constants=constants)
    return least_squares(lambda: rows, rows.columns, len(model.BASE_PARAMETERS), refinements=refinements)


def triangular_factor(
    model: GeneratedModel, q: Array, qd: Array, qdd: Array, tau: Array, *, block: int = BLOCK, constants: Mapping[str, float] | None = None
) -> Factor:
    """Structured triangular factor of [W Y] over all samples; q, qd, qdd, tau : ndarray, shape (N, n), joint side, SI."""
    rows = JointRows(model, q, qd, qdd, tau, block=block, constants=constants)
    return triangular(rows, rows.columns, model.BASE_PARAMETERS)


__all__ = ["JointRows", "LeastSquares", "joint_columns", "normal_equations", "triangular_factor"]
