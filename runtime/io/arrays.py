"""Columns of a file of named arrays (.npz, .mat): vectors of N samples, and matrices (N, k) that stand for k columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.io.naming import check_names

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class ArrayTable:
    """Numeric arrays by name; (N, 1) and (1, N) are vectors, a single element is a scalar."""

    file: str
    arrays: Mapping[str, Array]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.arrays)

    def stack(self, names: Sequence[str]) -> Array:
        """The named vectors and the columns of the named matrices side by side, shape (N, k)."""
        parts = [self._columns(name) for name in check_names(names, self.names, self.file)]
        lengths = {name: len(part) for name, part in zip(names, parts, strict=True)}
        if len(set(lengths.values())) > 1:
            raise InputError(f"columns of different lengths: {', '.join(f'{k} {v}' for k, v in lengths.items())}", file=self.file)
        return np.hstack(parts)

    def scalar(self, name: str) -> float:
        """The single number called `name`."""
        check_names([name], self.names, self.file)
        if self.arrays[name].size != 1:
            raise InputError(f"{self.arrays[name].shape} values; expected a single number", file=self.file, column=name)
        return float(self.arrays[name].reshape(()))

    def row(self, i: int) -> str:
        return f"sample {i + 1}"

    def _columns(self, name: str) -> Array:
        x = self.arrays[name]
        if x.ndim == 2 and x.shape[0] == 1:
            x = x.T
        if x.ndim > 2 or (x.ndim == 2 and x.shape[0] < x.shape[1]):
            raise InputError(f"shape {x.shape}; expected (N,) or (N, k), samples along the first axis", file=self.file, column=name)
        return x.reshape(len(x) if x.ndim else 1, -1).astype(float)


@dataclass(frozen=True, eq=False)
class ArrayBlock(ArrayTable):
    """Samples `first`, first + 1 ... of arrays whose shapes were checked as a whole; scalars as they are."""

    first: int = 0

    def row(self, i: int) -> str:
        return f"sample {self.first + i + 1}"

    def _columns(self, name: str) -> Array:
        return self.arrays[name].reshape(len(self.arrays[name]), -1).astype(float)


def numeric(arrays: Mapping[str, object]) -> dict[str, Array]:
    """Those of the arrays that hold real numbers (booleans included)."""
    return {k: v for k, v in arrays.items() if isinstance(v, np.ndarray) and v.dtype.kind in "biuf"}
