"""Columns of a file of named arrays (.npz, .mat): vectors of N samples, and matrices (N, k) or (k,
N) that stand for k columns.

Samples run along the longer side: a record has more samples than joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Protocol

import numpy as np

from runtime.errors import InputError
from runtime.records.formats.columns import WIDEST, Array, Groups, Table


class Series(Protocol):
    """An array that is read by blocks."""

    @property
    def shape(self) -> tuple[int, ...]:
        """As stored."""

    def blocks(self, size: int, start: int = 0, stop: int | None = None) -> Iterator[Array]:
        """Consecutive samples of [start, stop), shape (B, k); (1, N) is a vector."""


@dataclass(frozen=True, eq=False)
class Held:
    """An array in memory."""

    array: Array

    @property
    def shape(self) -> tuple[int, ...]:
        """As stored."""
        return self.array.shape

    def blocks(self, size: int, start: int = 0, stop: int | None = None) -> Iterator[Array]:
        """Consecutive samples of [start, stop), shape (B, k)."""
        N = samples_of(self.shape)
        array = self.array.T if transposed(self.shape) else self.array
        columns = array.reshape(N, prod(self.shape) // N)[:stop]
        return (columns[a : a + size] for a in range(start, len(columns), size))


def samples_of(shape: tuple[int, ...]) -> int:
    """Length along the axis of the samples, the longer one of two; () is one sample."""
    return shape[1] if transposed(shape) else shape[0] if shape else 1


def transposed(shape: tuple[int, ...]) -> bool:
    """Whether the samples of a matrix run along its second axis, (k, N) with k < N."""
    return len(shape) == 2 and shape[0] < shape[1]


@dataclass(eq=False, kw_only=True)
class ArrayTable(Table):
    """Numeric arrays by name.

    Attributes
    ----------
    arrays : mapping of str to Series
        What may be read.
    """

    arrays: Mapping[str, Series]

    def __post_init__(self) -> None:
        self.names = tuple(self.arrays)

    def samples(self, groups: Groups) -> int:
        lengths = {name: samples_of(self._series(name).shape) for group in groups for name in group}
        if len(set(lengths.values())) > 1:
            raise InputError(
                (
                    "columns of different lengths: "
                    f"{', '.join(f'{k} {v}' for k, v in lengths.items())}"
                ),
                file=self.file,
            )
        return next(iter(lengths.values()))

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        self.samples([names])
        return zip(*(self._series(name).blocks(size, start, stop) for name in names), strict=True)

    def require(self, names: Sequence[str]) -> None:
        for name in names:
            self._series(name)

    def scalar(self, name: str) -> float:
        super().require([name])
        x = self.arrays[name]
        if prod(x.shape) != 1:
            raise InputError(
                f"{x.shape} values; expected a single number", file=self.file, column=name
            )
        return float(next(x.blocks(1)).reshape(()))

    def _series(self, name: str) -> Series:
        """The array of that name, if it is one of samples."""
        super().require([name])
        x = self.arrays[name]
        if len(x.shape) > 2:
            raise InputError(
                f"shape {x.shape}; expected (N,), (N, k) or (k, N), k columns of N samples",
                file=self.file,
                column=name,
            )
        if not prod(x.shape):
            raise InputError("no samples", file=self.file, column=name)
        if prod(x.shape) // samples_of(x.shape) > WIDEST:
            raise InputError(
                f"shape {x.shape}; at most {WIDEST} columns are read", file=self.file, column=name
            )
        return x


def is_numeric(dtype: np.dtype) -> bool:
    """Whether numbers of that type are real; booleans are."""
    return dtype.kind in "biuf"
