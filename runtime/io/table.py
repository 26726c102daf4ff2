"""What every reader of measured files returns: named columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from runtime.errors import InputError
from runtime.io.files import read_bytes, sha256
from runtime.io.mat import read_mat
from runtime.io.npz import npy_blocks, npz_blocks, read_npy, read_npz
from runtime.io.tables import parquet_blocks, read_parquet
from runtime.io.text import read_text, text_blocks

Array = np.ndarray


class Named(Protocol):
    """A file whose columns have names."""

    @property
    def file(self) -> str:
        """Name of the file."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""


class Table(Named, Protocol):
    """Columns of one file."""

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
    ".npy": read_npy,
    ".npz": read_npz,
    ".parquet": read_parquet,
    ".mat": read_mat,
}


class BlockTable(Named, Protocol):
    """Columns of one file that is read by blocks."""

    def samples(self, names: Sequence[str]) -> int:
        """Length of the named columns."""

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Table]:
        """Tables of `size` samples that hold the named columns, in order, as often as asked."""


BLOCK_READERS: Mapping[str, Callable[[Path, str], BlockTable]] = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tsv"), text_blocks),
    ".npy": npy_blocks,
    ".npz": npz_blocks,
    ".parquet": parquet_blocks,
}


def open_table(path: Path) -> BlockTable:
    """A file to be read by blocks; InputError for formats that are read whole only."""
    kind = _kind(path)
    if kind not in BLOCK_READERS:
        raise InputError(
            f"{kind} files are read whole; convert to {', '.join(BLOCK_READERS)} to read by blocks, or set stream: off", file=str(path)
        )
    if path.suffix.lower() == ".gz" and BLOCK_READERS[kind] is not text_blocks:
        raise InputError(f"a {kind} file within .gz cannot be read by blocks; uncompress it, or set stream: off", file=str(path))
    if not path.is_file():
        raise InputError("cannot be read: no such file", file=str(path))
    return BLOCK_READERS[kind](path, path.name)


def read_table(path: Path) -> tuple[Table, str]:
    """Table of a .csv, .txt, .dat, .tsv, .npy, .npz, .parquet or .mat file, perhaps ending in .gz, and the SHA-256 of its uncompressed bytes."""
    kind = _kind(path)
    data = read_bytes(path)
    return READERS[kind](data, path.name), sha256(data)


def _kind(path: Path) -> str:
    """The ending of a file that tells its format."""
    suffixes = [s.lower() for s in path.suffixes if s.lower() != ".gz"]
    kind = suffixes[-1] if suffixes else ""
    if kind not in READERS:
        raise InputError(f"unknown kind of file {kind!r}; expected {', '.join(READERS)}, plain or with .gz", file=str(path))
    return kind
