"""The formats of measured files, one row each, and how a file is opened.

A file that a library reads, and one that has to be unpacked whole, is read in a process of its own
with limits of time and memory
(`runtime.records.formats.isolated`). Text, which is unpacked line by line, and plain NumPy files
are read here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from runtime.errors import InputError
from runtime.files import sha256_of
from runtime.records.formats.bags import digest_of, open_bag
from runtime.records.formats.columns import Source, Table
from runtime.records.formats.isolated import IsolatedTable, Process
from runtime.records.formats.mat import open_mat
from runtime.records.formats.npz import open_npy, open_npz
from runtime.records.formats.parquet import open_parquet
from runtime.records.formats.text import open_text


@dataclass(frozen=True)
class Format:
    """How one format is read.

    Attributes
    ----------
    title : str
        What a file of it is, in messages.
    endings : tuple of str
        Of file names, in lower case.
    open : callable
        The table of a file.
    libraries : tuple of str
        Modules that read it; none: it is read in this process.
    install : str
        Command that brings the libraries.
    packed : str
        How a file compressed by gzip is read: by parts, whole, or not at all ("").
    digest : callable
        SHA-256 of a file.
    """

    title: str
    endings: tuple[str, ...]
    open: Callable[[Source], Table]
    libraries: tuple[str, ...] = ()
    install: str = ""
    packed: Literal["parts", "whole", ""] = "whole"
    digest: Callable[[Path], str] = sha256_of


FORMATS = (
    Format("a text file", (".csv", ".txt", ".dat", ".tsv"), open_text, packed="parts"),
    Format("a file of one plain array", (".npy",), open_npy),
    Format("an archive of plain arrays", (".npz",), open_npz),
    Format(
        "a Parquet file", (".parquet",), open_parquet, ("polars",), "pip install symgen[tables]"
    ),
    Format("a MATLAB file", (".mat",), open_mat, ("scipy.io",), "pip install symgen[tables]"),
    Format(
        "a whole bag",
        (".bag", ".mcap", ".db3"),
        open_bag,
        ("rosbags",),
        "pip install symgen[bags]",
        "",
        digest_of,
    ),
)
BY_ENDING = {ending: format_ for format_ in FORMATS for ending in format_.endings}
KINDS = tuple(BY_ENDING)
BAG = ".db3"  # a folder is read as one


def open_table(path: Path, topic: str | None = None, decimal: str = ".") -> Table:
    """Table of a measured file; its hash is computed first, so that nothing that unpacks to more
    than a record holds is opened.

    Parameters
    ----------
    path : Path
        A file whose name ends as one of KINDS, perhaps followed by .gz, or the folder of a ROS 2
        bag.
    topic : str, optional
        Of a bag; default: the only one that holds sensor_msgs/JointState.
    decimal : str
        "." or ",", of the numbers of a text file.
    """
    format_ = format_of(path)
    require_readable(path, format_)
    if missing := [
        library for library in format_.libraries if find_spec(library.partition(".")[0]) is None
    ]:
        raise InputError(needed(format_), file=path.name) from ImportError(missing[0])
    source = Source(path, topic, decimal)
    isolated = format_.libraries or (source.packed and format_.packed == "whole")
    reader = (
        Process(source) if isolated else None
    )  # it loads its libraries while the hash is computed
    digest = format_.digest(path)
    table = (
        format_.open(source) if reader is None else IsolatedTable.of(source, format_.title, reader)
    )
    table.digest = digest
    return table


def needed(format_: Format) -> str:
    """What to install where a library is missing."""
    return f"{format_.title} needs an optional library: {format_.install}"


def require_readable(path: Path, format_: Format) -> None:
    """Raise InputError where there is no such file, or it cannot be read."""
    packed = path.suffix.lower() == ".gz"
    if packed and not format_.packed:
        raise InputError("a bag within .gz; uncompress it", file=str(path))
    if not path.exists():
        raise InputError("cannot be read: no such file", file=str(path))
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise InputError(
            (
                "a folder without metadata.yaml, hence no ROS 2 bag; name the measured or study "
                "file "
                "in it"
            ),
            file=str(path),
        )


def is_measured(path: Path) -> bool:
    """Whether the name is that of a measured file, or of a folder, which may be a ROS 2 bag."""
    return path.is_dir() or any(suffix.lower() in KINDS for suffix in path.suffixes)


def format_of(path: Path) -> Format:
    """The format that the ending of a file tells; a folder is a bag."""
    suffixes = [BAG] if path.is_dir() else [s.lower() for s in path.suffixes if s.lower() != ".gz"]
    kind = suffixes[-1] if suffixes else ""
    if kind not in BY_ENDING:
        plain = ", ".join(ending for ending, other in BY_ENDING.items() if other.packed)
        bags = ", ".join(ending for ending, other in BY_ENDING.items() if not other.packed)
        raise InputError(
            (
                f"unknown kind of file {kind!r}; expected {plain}, plain or with .gz, {bags} or "
                "the "
                "folder of a ROS 2 bag"
            ),
            file=str(path),
        )
    return BY_ENDING[kind]
