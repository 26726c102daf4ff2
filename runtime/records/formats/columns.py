"""What every reader of a measured file offers: named columns of numbers, by blocks, as often as
asked.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, ClassVar

import numpy as np

from runtime.errors import InputError
from runtime.files import is_packed, read_bytes, require_size

Array = np.ndarray
Groups = Sequence[Sequence[str]]  # names of columns, those of one quantity together

WIDEST = 10_000  # columns of a file; a wider one is no table of samples
BLOCK = 65536  # samples read at a time


@dataclass(frozen=True)
class Source:
    """A measured file and what its settings say about it.

    Attributes
    ----------
    path : Path
        The file; the folder of a ROS 2 bag.
    topic : str or None
        Of a bag; None: the only one that holds sensor_msgs/JointState.
    decimal : str
        "." or ",", within the numbers of a text file.
    """

    path: Path
    topic: str | None = None
    decimal: str = "."

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.path.name

    @property
    def size(self) -> int:
        """Bytes on disk, of a folder those of its files."""
        return sum(
            p.stat().st_size
            for p in (self.path.iterdir() if self.path.is_dir() else [self.path])
            if p.is_file()
        )

    @cached_property
    def packed(self) -> bool:
        """Whether the file is compressed by gzip."""
        return not self.path.is_dir() and is_packed(self.path)

    @cached_property
    def _unpacked(self) -> bytes:
        return read_bytes(self.path)

    def content(self) -> Path | BytesIO:
        """What libraries that take a path or a file are given: the path, or the bytes where they
        were compressed.
        """
        return BytesIO(self._unpacked) if self.packed else self.path

    def open(self) -> BinaryIO:
        """The uncompressed bytes, to be read at any place."""
        return BytesIO(self._unpacked) if self.packed else self.path.open("rb")


@dataclass(eq=False, kw_only=True)
class Table(ABC):
    """Named columns of one measured file.

    Attributes
    ----------
    file : str
        Name of the file in messages.
    size : int
        Bytes of the file.
    names : tuple of str
        Names of the columns, or of arrays that hold several.
    joints : tuple of str or None
        Joints that the messages of a bag name; None for other files.
    topic : str
        Of a bag.
    digest : str
        SHA-256 of the uncompressed bytes.
    positions : frozenset of str
        Columns of positions.
    missing : bool
        Whether these may be missing: nan, in a text file an empty field.
    rows : int
        Samples of a file whose columns are of one length.
    others : mapping of str to str
        What else the file holds under a name, in words.
    """

    what: ClassVar[str] = "such a file"

    file: str
    size: int
    names: tuple[str, ...] = ()
    joints: tuple[str, ...] | None = None
    topic: str = ""
    digest: str = field(default="", init=False)
    positions: frozenset[str] = field(default=frozenset(), init=False)
    missing: bool = field(default=False, init=False)
    rows: int = 0
    others: Mapping[str, str] = field(default_factory=dict)

    def samples(self, groups: Groups) -> int:
        """Length of the named columns."""
        self.require([name for group in groups for name in group])
        return self.rows

    def note(self, groups: Groups) -> str:
        """What a reader of the named columns should know, a sentence; "" for nothing."""
        return ""

    def require(self, names: Sequence[str]) -> None:
        """Raise InputError unless these columns are there and hold numbers."""
        for name in names:
            if name in self.others:
                raise InputError(
                    f"{self.others[name]}; expected numbers, a time in seconds (or record.rate "
                    "without columns.t)",
                    file=self.file,
                    column=name,
                )
        check_names(names, self.names, self.file)

    @abstractmethod
    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        """One array of `size` samples by name, shape (B,) or (B, k), as often as there are blocks
        in [start, stop); names are in `names`.
        """

    def blocks(
        self, groups: Groups, size: int = BLOCK, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[Array, ...]]:
        """One array of `size` samples by group, shape (B, k): its columns side by side. Samples
        [start, stop); default: all.
        """
        names = list(dict.fromkeys(name for group in groups for name in group))
        self.require(names)
        for parts in self.parts(names, size, start, stop):
            of = {
                name: np.asarray(part, dtype=float) for name, part in zip(names, parts, strict=True)
            }
            yield tuple(
                np.column_stack([of[name] for name in group])
                if group
                else np.empty((len(parts[0]), 0))
                for group in groups
            )

    def widths(self, groups: Groups) -> list[int]:
        """Columns by group."""
        return [x.shape[1] for x in next(self.blocks(groups, 1))]

    def read(self, groups: Groups, N: int | None = None) -> tuple[Array, ...]:
        """One array by group, shape (N, k); N, where it is known, spares counting the samples."""
        N = self.samples(groups) if N is None else N
        whole: tuple[Array, ...] = ()
        first = 0
        for block in self.blocks(groups):
            if not whole:  # a constant column of any length may take no space in the file
                require_size(8 * N * sum(x.shape[1] for x in block), self.size, self.file)
                whole = tuple(np.empty((N, x.shape[1])) for x in block)
            for x, part in zip(whole, block, strict=True):
                x[first : first + len(part)] = part
            first += len(block[0])
        return whole

    def scalar(self, name: str) -> float:
        """The single number called `name`."""
        raise InputError(
            f"no single number {name!r} in {self.what}; write the number itself in the settings",
            file=self.file,
        )

    def row(self, i: int) -> str:
        """How the file counts sample i, from 0: "line 12", "sample 12"."""
        return f"sample {i + 1}"

    def close(self) -> None:
        """End what was opened: nothing, where no other process was."""
        return


def check_names(wanted: Sequence[str], present: Sequence[str], file: str) -> Sequence[str]:
    """`wanted` itself if every name is present; InputError naming the missing and the present ones
    otherwise.
    """
    missing = [name for name in wanted if name not in present]
    if missing:
        raise InputError(
            f"no column {', '.join(missing)}; the file has {', '.join(present) or 'none'}",
            file=file,
        )
    return wanted
