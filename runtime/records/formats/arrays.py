"""Columns of a file of named arrays (.npz, .mat): vectors of N samples, and matrices (N, k) that stand for k columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from runtime.errors import InputError
from runtime.records.formats.naming import check_names

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class ArrayTable:
    """Numeric arrays by name; (N, 1) and (1, N) are vectors, a single element is a scalar. others : what else the file holds, by name."""

    file: str
    arrays: Mapping[str, Array]
    others: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.arrays)

    def stack(self, names: Sequence[str]) -> Array:
        """The named vectors and the columns of the named matrices side by side, shape (N, k)."""
        parts = [self._columns(name) for name in self._present(names)]
        lengths = {name: len(part) for name, part in zip(names, parts, strict=True)}
        if len(set(lengths.values())) > 1:
            raise InputError(f"columns of different lengths: {', '.join(f'{k} {v}' for k, v in lengths.items())}", file=self.file)
        return np.hstack(parts)

    def scalar(self, name: str) -> float:
        """The single number called `name`."""
        self._present([name])
        if self.arrays[name].size != 1:
            raise InputError(f"{self.arrays[name].shape} values; expected a single number", file=self.file, column=name)
        return float(self.arrays[name].reshape(()))

    def row(self, i: int) -> str:
        return f"sample {i + 1}"

    def _present(self, names: Sequence[str]) -> Sequence[str]:
        for name in names:
            if name in self.others:
                raise InputError(f"{self.others[name]}; expected an array of numbers", file=self.file, column=name)
        return check_names(names, self.names, self.file)

    def _columns(self, name: str) -> Array:
        x = self.arrays[name]
        if x.ndim == 2 and x.shape[0] == 1:
            x = x.T
        if x.ndim > 2 or (x.ndim == 2 and x.shape[0] < x.shape[1]):
            raise InputError(f"shape {x.shape}; expected (N,) or (N, k), samples along the first axis", file=self.file, column=name)
        if not x.size:
            raise InputError("no samples", file=self.file, column=name)
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
