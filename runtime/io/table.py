"""What every reader of measured files returns: named columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from runtime.errors import InputError
from runtime.io.files import read_bytes, sha256
from runtime.io.mat import read_mat
from runtime.io.npz import read_npz
from runtime.io.text import read_text

Array = np.ndarray


class Table(Protocol):
    """Columns of one file."""

    @property
    def file(self) -> str:
        """Name of the file."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""

    def stack(self, names: Sequence[str]) -> Array:
        """The named columns side by side, shape (N, k)."""

    def scalar(self, name: str) -> float:
        """A single number stored in the file."""

    def row(self, i: int) -> str:
        """How the file counts sample i (from 0): "line 12" or "sample 12"."""


READERS: Mapping[str, Callable[[bytes, str], Table]] = {
    ".csv": read_text,
    ".txt": read_text,
    ".dat": read_text,
    ".tsv": read_text,
    ".npz": read_npz,
    ".mat": read_mat,
}


def read_table(path: Path) -> tuple[Table, str]:
    """Table of a .csv, .txt, .dat, .tsv, .npz or .mat file, perhaps ending in .gz, and the SHA-256 of its uncompressed bytes."""
    suffixes = [s.lower() for s in path.suffixes if s.lower() != ".gz"]
    kind = suffixes[-1] if suffixes else ""
    if kind not in READERS:
        raise InputError(f"unknown kind of file {kind!r}; expected {', '.join(READERS)}, plain or with .gz", file=str(path))
    data = read_bytes(path)
    return READERS[kind](data, path.name), sha256(data)
