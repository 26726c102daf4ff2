"""Levels (pairs of rounding steps) of a study of the encoder resolution, and the runs of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Run:
    """One run of a study: the parameters estimated from one random rounding of the measurements.

    Attributes
    ----------
    level : int
        Number of the level, from 0.
    run : int
        Number of the run, from 0.
    X : tuple of float, SI
        Parameters in column order.
    residual_norm : float, N m or N
        ||Y - W_CESTAC X||.
    """

    level: int
    run: int
    X: tuple[float, ...]
    residual_norm: float


@dataclass(frozen=True, eq=False)
class Runs(Sequence[Run]):
    """Runs of a study, R in number, as arrays for files and for transfer between processes.

    Attributes
    ----------
    level, run : ndarray of int, shape (R,)
    X : ndarray, shape (R, b)
    residual_norm : ndarray, shape (R,), N m
    """

    level: Array
    run: Array
    X: Array
    residual_norm: Array

    @classmethod
    def of(cls, runs: Sequence[Run], b: int) -> Runs:
        """Collect single runs, with b parameters each, in the arrays of one Runs object."""
        return cls(
            np.array([run.level for run in runs], dtype=np.int64),
            np.array([run.run for run in runs], dtype=np.int64),
            np.array([run.X for run in runs], dtype=float).reshape(len(runs), b),
            np.array([run.residual_norm for run in runs], dtype=float),
        )

    @classmethod
    def joined(cls, parts: Sequence[Runs], b: int) -> Runs:
        """Join groups of runs, sorted by rounding step and run number, without repeated runs."""
        parts = [cls.of((), b), *parts]
        fields = [
            np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__dataclass_fields__
        ]
        _, first = np.unique(np.stack(fields[:2]), axis=1, return_index=True)
        return cls(*(field[first] for field in fields))

    def where(self, selected: Array) -> Runs:
        """Select runs by a mask of shape (R,) or by their indices."""
        return Runs(*(getattr(self, name)[selected] for name in self.__dataclass_fields__))

    @property
    def keys(self) -> set[tuple[int, int]]:
        """Pairs (number of the rounding step, number of the run) of all runs."""
        return set(zip(self.level.tolist(), self.run.tolist(), strict=True))

    def __len__(self) -> int:
        return len(self.run)

    def __getitem__(self, i: int) -> Run:  # type: ignore[override]
        return Run(
            int(self.level[i]),
            int(self.run[i]),
            tuple(self.X[i].tolist()),
            float(self.residual_norm[i]),
        )


@dataclass(frozen=True)
class Level:
    """One pair of rounding steps of a study: for positions and for torques; 0 means no rounding.

    Attributes
    ----------
    delta : float, rad or m
        Step of the position.
    torque : float, N m or N
        Step of the motor torque.
    """

    delta: float
    torque: float = 0.0

    @property
    def label(self) -> str:
        """Text for a pair of rounding steps: `2*pi/10000` (positions) or `Phi 0.01` (torques)."""
        return self.text()

    def text(self, unit: str = "") -> str:
        """Write the pair of rounding steps; a position step that is no share of a turn has its unit."""
        parts = []
        if self.delta:
            counts = 2 * np.pi / self.delta
            parts.append(
                f"2*pi/{counts:.0f}"
                if counts >= 2 and abs(counts - round(counts)) < 1e-9 * counts
                else f"{self.delta:.4g} {unit}".rstrip()
            )
        if self.torque:
            parts.append(f"Phi {self.torque:.4g}")
        return " + ".join(parts) or "none"
