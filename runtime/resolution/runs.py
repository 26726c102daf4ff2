"""Runs of a resolution study: one, or many as arrays, which is what travels between processes and lies on disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray

NORMAL, TRIANGULAR = "normal equations", "triangular factor"


@dataclass(frozen=True)
class Run:
    """One run: parameters in column order, ||Y - W_CESTAC X|| in N m, and how the least squares was solved (NORMAL or TRIANGULAR)."""

    level: int
    run: int
    X: tuple[float, ...]
    residual_norm: float
    method: str = TRIANGULAR


@dataclass(frozen=True, eq=False)
class Runs(Sequence[Run]):
    """R runs. level, run : int, shape (R,).   X : shape (R, b).   residual_norm : shape (R,), N m.   normal : bool, shape (R,), by normal equations."""

    level: Array
    run: Array
    X: Array
    residual_norm: Array
    normal: Array

    @classmethod
    def of(cls, runs: Sequence[Run], b: int) -> Runs:
        """Runs with b parameters each."""
        return cls(
            np.array([run.level for run in runs], dtype=np.int64),
            np.array([run.run for run in runs], dtype=np.int64),
            np.array([run.X for run in runs], dtype=float).reshape(len(runs), b),
            np.array([run.residual_norm for run in runs], dtype=float),
            np.array([run.method == NORMAL for run in runs], dtype=bool),
        )

    @classmethod
    def joined(cls, parts: Sequence[Runs], b: int) -> Runs:
        """All runs of the parts, by level and number; of a run that comes twice, the first."""
        every = [cls.of((), b), *parts]
        fields = [np.concatenate([getattr(part, name) for part in every]) for name in cls.__dataclass_fields__]
        _, first = np.unique(np.stack(fields[:2]), axis=1, return_index=True)
        return cls(*(field[first] for field in fields))

    def where(self, chosen: Array) -> Runs:
        """The runs that `chosen`, bool of shape (R,) or numbers, picks."""
        return Runs(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    @property
    def keys(self) -> set[tuple[int, int]]:
        """(level, run) of every run."""
        return set(zip(self.level.tolist(), self.run.tolist(), strict=True))

    def __len__(self) -> int:
        return len(self.run)

    def __getitem__(self, i: int) -> Run:  # type: ignore[override]
        method = NORMAL if self.normal[i] else TRIANGULAR
        return Run(int(self.level[i]), int(self.run[i]), tuple(self.X[i].tolist()), float(self.residual_norm[i]), method)

    def __iter__(self) -> Iterator[Run]:
        return (self[i] for i in range(len(self)))
