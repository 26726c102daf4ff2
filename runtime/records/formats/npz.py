"""NumPy files: archives of arrays (.npz) and single arrays (.npy), from the file one block after
the other; pickled objects are refused.

An array in Fortran order is read through one open file per column.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from lzma import LZMAError
from math import prod
from tokenize import TokenError
from typing import IO

import numpy as np
from numpy.lib import format as npy

from runtime.errors import InputError, first_line
from runtime.files import require_size
from runtime.records.formats.arrays import ArrayTable, is_numeric, samples_of, transposed
from runtime.records.formats.columns import WIDEST, Array, Source, Table

DAMAGED = (
    *(ValueError, OSError, EOFError, AttributeError, zipfile.BadZipFile, zlib.error, struct.error),
    *(
        NotImplementedError,
        RuntimeError,
        MemoryError,
        OverflowError,
        LZMAError,
    ),  # other compressions, passwords, shapes without the numbers
    *(SyntaxError, TokenError, TypeError, LookupError),  # headers that are no literal of Python
)


@contextmanager
def refused(what: str, file: str) -> Iterator[None]:
    """What bytes that are not `what` raise, as one InputError."""
    try:
        yield
    except InputError:
        raise
    except DAMAGED as e:
        raise InputError(
            f"damaged, or not {what} ({first_line(e)}); copy it again", file=file
        ) from e


@dataclass(frozen=True)
class Stored:
    """An array in a file.

    Attributes
    ----------
    open : callable
        Its bytes, header included.
    shape : tuple of int
        As stored.
    fortran : bool
        Whether columns follow each other.
    dtype : dtype
        Of the numbers.
    what, file : str
        What the file should be, and its name, in messages.
    """

    open: Callable[[], IO[bytes]]
    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype
    what: str
    file: str

    def blocks(self, size: int, start: int = 0, stop: int | None = None) -> Iterator[Array]:
        """Consecutive samples of [start, stop), shape (B, k)."""
        N = samples_of(self.shape)
        columns = prod(self.shape) // N
        width = columns if self.fortran else 1  # files open at once
        stop = N if stop is None else min(stop, N)
        handles = [
            self._opened((c * N + start * columns // width) * self.dtype.itemsize)
            for c in range(width)
        ]
        try:
            for a in range(start, stop, size):
                count = min(size, stop - a)
                parts = [
                    self._read(handle, count * columns // width).reshape(count, -1)
                    for handle in handles
                ]
                yield parts[0] if width == 1 else np.hstack(parts)
        finally:
            for handle in handles:
                handle.close()

    def _opened(self, offset: int) -> IO[bytes]:
        with refused(self.what, self.file):
            handle = self.open()
            _header(handle)
            handle.seek(offset, 1)
            return handle

    def _read(self, handle: IO[bytes], count: int) -> Array:
        with refused(self.what, self.file):  # also where the file ends early
            return np.frombuffer(handle.read(count * self.dtype.itemsize), self.dtype, count)


@dataclass(eq=False, kw_only=True)
class MatrixTable(Table):
    """The array of a .npy file, shape (N,), (N, k) or (k, N): columns are called 1, 2 ..."""

    matrix: Stored

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        for x in self.matrix.blocks(size, start, stop):
            yield [x[:, int(name) - 1] for name in names]


ARCHIVE, SINGLE = "an archive of plain arrays", "a file of one plain array"


def open_npz(source: Source) -> ArrayTable:
    """Table of a .npz file."""
    with refused(ARCHIVE, source.file):
        with zipfile.ZipFile(source.content()) as archive:
            members = _distinct(archive, source.file)
        stored = {
            name: _stored(partial(_member, source, member), ARCHIVE, source.file)
            for name, member in members.items()
        }
        if objects := [name for name, x in stored.items() if x.dtype.hasobject]:
            raise TypeError(f"{objects[0]} holds pickled objects")
    arrays = {name: x for name, x in stored.items() if is_numeric(x.dtype)}
    return ArrayTable(file=source.file, size=source.size, arrays=arrays)


def open_npy(source: Source) -> MatrixTable:
    """Table of a .npy file."""
    with refused(SINGLE, source.file):
        matrix = _stored(source.open, SINGLE, source.file)
    shape = matrix.shape
    if (
        not is_numeric(matrix.dtype)
        or len(shape) not in (1, 2)
        or not all(k > 0 for k in shape)
        or prod(shape) // samples_of(shape) > WIDEST
    ):
        raise InputError(
            (
                f"{matrix.dtype} of shape {shape}; expected numbers of shape (N,), (N, k) or (k, "
                "N), "
                f"at most {WIDEST} columns"
            ),
            file=source.file,
        )
    names = tuple(str(i + 1) for i in range(prod(shape) // samples_of(shape)))
    return MatrixTable(
        file=source.file, size=source.size, names=names, rows=samples_of(shape), matrix=matrix
    )


def archive_of(data: bytes, file: str) -> dict[str, Array]:
    """Arrays by name of the bytes of a .npz file; InputError for pickled objects, damage, and more
    than such a file holds.
    """
    with refused(ARCHIVE, file):
        with zipfile.ZipFile(BytesIO(data)) as packed:
            require_size(sum(member.file_size for member in packed.infolist()), len(data), file)
            _distinct(packed, file)
        with np.load(BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}


def _distinct(archive: zipfile.ZipFile, file: str) -> dict[str, str]:
    """Members of an archive that are arrays, by name. x and x.npy are one array to numpy, and a
    name may stand twice: which one counts would be a guess.
    """
    members = archive.namelist()
    if len(members) > WIDEST:
        raise InputError(f"{len(members)} arrays; at most {WIDEST} are read", file=file)
    if len({name.removesuffix(".npy") for name in members}) < len(members):
        raise InputError("holds an array of one name twice; store it once", file=file)
    return {name.removesuffix(".npy"): name for name in members if name.endswith(".npy")}


def _member(source: Source, name: str) -> IO[bytes]:
    """A member of an archive; it keeps the archive open until it is closed."""
    return zipfile.ZipFile(source.content()).open(name)


def _header(handle: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and dtype of the array that begins here; the handle stands at its first number
    afterwards.
    """
    version = npy.read_magic(handle)
    return (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(handle)


def _stored(opened: Callable[[], IO[bytes]], what: str, file: str) -> Stored:
    with opened() as handle:
        shape, fortran, dtype = _header(handle)
    turned = transposed(shape)  # (k, N) by rows is (N, k) by columns
    by_columns = fortran != turned and len(shape) > 1
    return Stored(opened, shape[::-1] if turned else shape, by_columns, dtype, what, file)
