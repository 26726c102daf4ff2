"""What every reader of measured files returns: named columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from runtime.errors import InputError
from runtime.files import read_bytes, sha256
from runtime.records.formats.bags import read_bag
from runtime.records.formats.mat import read_mat
from runtime.records.formats.npz import npy_blocks, npz_blocks, read_npy, read_npz
from runtime.records.formats.parquet import parquet_blocks, read_parquet
from runtime.records.formats.text import read_text, text_blocks

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
BAGS = (".bag", ".mcap", ".db3")
KINDS = (*READERS, *BAGS)


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


def open_table(path: Path, decimal: str = ".") -> BlockTable:
    """A file to be read by blocks; InputError for formats that are read whole only.   decimal : of the numbers of a text file."""
    kind = _kind(path)
    if kind not in BLOCK_READERS:
        what = "bags" if kind in BAGS else f"{kind} files"
        raise InputError(
            f"{what} are read whole; convert to {', '.join(BLOCK_READERS)} to read by blocks, or set stream: off", file=str(path)
        )
    if path.suffix.lower() == ".gz" and BLOCK_READERS[kind] is not text_blocks:
        raise InputError(f"a {kind} file within .gz cannot be read by blocks; uncompress it, or set stream: off", file=str(path))
    if not path.is_file():
        raise InputError("cannot be read: no such file", file=str(path))
    return text_blocks(path, path.name, decimal) if BLOCK_READERS[kind] is text_blocks else BLOCK_READERS[kind](path, path.name)


def read_table(path: Path, topic: str | None = None, decimal: str = ".") -> tuple[Table, str]:
    """Table of a measured file, and the SHA-256 of its uncompressed bytes.

    path : .csv, .txt, .dat, .tsv, .npy, .npz, .parquet or .mat, perhaps ending in .gz; .bag, .mcap, .db3 or the folder of a ROS 2 bag.
    topic : of a bag; default: the only one that holds sensor_msgs/JointState.   decimal : "." or ",", of the numbers of a text file.
    """
    kind = _kind(path)
    if kind not in BAGS:
        data = read_bytes(path)
        return read_text(data, path.name, decimal) if READERS[kind] is read_text else READERS[kind](data, path.name), sha256(data)
    if path.suffix.lower() == ".gz":
        raise InputError("a bag within .gz; uncompress it", file=str(path))
    if not path.exists():
        raise InputError("cannot be read: no such file", file=str(path))
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError("a folder without metadata.yaml, hence no ROS 2 bag; name the measured or study file in it", file=str(path))
    return read_bag(path, topic)


def is_measured(path: Path) -> bool:
    """Whether the name is that of a measured file, or of a folder, which may be a ROS 2 bag."""
    return path.is_dir() or any(suffix.lower() in KINDS for suffix in path.suffixes)


def _kind(path: Path) -> str:
    """The ending of a file that tells its format; a folder is a bag."""
    suffixes = [".db3"] if path.is_dir() else [s.lower() for s in path.suffixes if s.lower() != ".gz"]
    kind = suffixes[-1] if suffixes else ""
    if kind not in KINDS:
        raise InputError(
            f"unknown kind of file {kind!r}; expected {', '.join(READERS)}, plain or with .gz, {', '.join(BAGS)} or the folder of a ROS 2 bag",
            file=str(path),
        )
    return kind
