"""The file formats of measurements, and the function that reads a file of any format."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from runtime.ground.errors import InputError
from runtime.reading.bags import digest_of, read_bag
from runtime.reading.files import sha256_of
from runtime.reading.hdf5 import read_hdf5
from runtime.reading.json_lines import read_json_lines
from runtime.reading.mat import read_mat
from runtime.reading.numpy_files import read_npy, read_npz
from runtime.reading.parquet import read_parquet
from runtime.reading.table import Options, Table
from runtime.reading.text import read_text


@dataclass(frozen=True)
class Format:
    """One file format: its name, its file endings, and the function that reads it.

    Attributes
    ----------
    title : str
        Name of a file of this format, in messages.
    endings : tuple of str
        Endings of file names, in lower case.
    read : callable
        Function that reads a file as a Table.
    install : str
        Command that installs the library for this format; "" if NumPy and SciPy are enough.
    packed : bool
        Whether a file may be compressed by gzip.
    digest : callable
        Function that computes the SHA-256 of a file.
    """

    title: str
    endings: tuple[str, ...]
    read: Callable[[Path, Options], Table]
    install: str = ""
    packed: bool = True
    digest: Callable[[Path], str] = sha256_of


TABLES = "pip install symgen[tables]"
BAGS = "pip install symgen[bags]"
FORMATS = [
    Format("a text file", (".csv", ".txt", ".dat", ".tsv"), read_text),
    Format("a file of one plain array", (".npy",), read_npy),
    Format("an archive of plain arrays", (".npz",), read_npz),
    Format("a Parquet file", (".parquet",), read_parquet, TABLES),
    Format("an HDF5 file", (".h5", ".hdf5"), read_hdf5, TABLES),
    Format("a file of JSON lines", (".jsonl", ".ndjson"), read_json_lines),
    Format("a MATLAB file", (".mat",), read_mat, TABLES),
    Format("a whole bag", (".bag", ".mcap", ".db3"), read_bag, BAGS, False, digest_of),
]
BAG = ".db3"  # a folder is read as one


def read_table(path: Path, topic: str | None = None, decimal: str = ".") -> Table:
    """Read a measured file of any known format as a Table of named columns.

    The hash is computed first, so that a file that unpacks to too many bytes is refused.

    Parameters
    ----------
    path : Path
        A file whose name ends with one of `endings`, perhaps followed by .gz, or the folder of a
        ROS 2 bag.
    topic : str, optional
        Topic of a bag; default: the only topic with sensor_msgs/JointState.
    decimal : str
        Decimal sign of a text file, "." or ",".
    """
    format_ = format_of(path)
    if path.suffix.lower() == ".gz" and not format_.packed:
        raise InputError(
            "a bag compressed as .gz is not supported; uncompress the file", file=str(path)
        )
    if not os.path.exists(path):  # noqa: PTH110 (a name of any length)
        raise InputError(
            "the file cannot be read, because there is no such file; check its name and folder",
            file=str(path),
        )
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(
            "this folder has no metadata.yaml, so it is no ROS 2 bag; give a measured file or "
            "study file in this folder",
            file=str(path),
        )
    digest = format_.digest(path)
    try:
        return replace(format_.read(path, Options(topic, decimal)), digest=digest)
    except ImportError as e:
        raise InputError(
            f"{format_.title} needs an optional library: {format_.install}", file=path.name
        ) from e


def file_extensions(*, packed: bool | None = None) -> tuple[str, ...]:
    """Return the file endings of all formats.

    packed : True for formats that may be compressed by gzip only, False for the others only.
    """
    return tuple(
        ending
        for format_ in FORMATS
        for ending in format_.endings
        if packed in (None, format_.packed)
    )


def is_measured(path: Path) -> bool:
    """Whether a path is a folder (perhaps a ROS 2 bag) or has the ending of a measured file."""
    folder = os.path.isdir(path)  # noqa: PTH112 (a name of any length)
    return folder or any(suffix.lower() in file_extensions() for suffix in path.suffixes)


def format_of(path: Path) -> Format:
    """Return the format of a file, found by its ending; a folder is a bag."""
    suffixes = [BAG] if path.is_dir() else [s.lower() for s in path.suffixes if s.lower() != ".gz"]
    kind = suffixes[-1] if suffixes else ""
    for format_ in FORMATS:
        if kind in format_.endings:
            return format_
    raise InputError(
        f"unknown kind of file {kind!r}; expected {', '.join(file_extensions(packed=True))}, plain or with .gz, {', '.join(file_extensions(packed=False))} or the folder of a ROS 2 bag",
        file=str(path),
    )
