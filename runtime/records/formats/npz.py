"""NumPy files: archives of arrays (.npz) and single arrays (.npy); pickled objects are refused.

By blocks, the arrays are read from the file one part after the other, compressed ones as well: nothing but the block is in memory. An array in
Fortran order is read through one open file per column.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from lzma import LZMAError
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import IO

import numpy as np
from numpy.lib import format as npy

from runtime.errors import InputError, first_line
from runtime.limits import require_size
from runtime.records.formats.arrays import ArrayBlock, ArrayTable, numeric
from runtime.records.formats.naming import WIDEST, check_names

Array = np.ndarray

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


def read_npz(data: bytes, file: str) -> ArrayTable:
    """Table of the bytes of a .npz file."""
    return ArrayTable(file, numeric(archive_of(data, file)))


def archive_of(data: bytes, file: str) -> dict[str, Array]:
    """Arrays by name of the bytes of a .npz file; InputError for pickled objects, damage, and more than such a file holds."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as packed:
            members = packed.infolist()
            require_size(sum(member.file_size for member in members), len(data), file)
            _require_distinct([member.filename for member in members], file)
        with np.load(BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except InputError:
        raise
    except DAMAGED as e:
        raise InputError(f"not an archive of plain arrays ({first_line(e)})", file=file) from e


def read_npy(data: bytes, file: str) -> ArrayTable:
    """Table of the bytes of a .npy file, shape (N,) or (N, k): columns are called 1, 2 ..."""
    try:
        x = np.load(BytesIO(data), allow_pickle=False)
    except DAMAGED as e:
        raise InputError(f"not a file of one plain array ({first_line(e)})", file=file) from e
    if not isinstance(x, np.ndarray):
        raise InputError("not a file of one plain array", file=file)
    _require_columns(x.shape, x.dtype, file)
    columns = x.reshape(len(x), -1)
    return ArrayTable(file, {str(i + 1): columns[:, i] for i in range(columns.shape[1])})


def _require_distinct(members: list[str], file: str) -> None:
    """x and x.npy are the same array to numpy, and a name may stand twice: which one counts would be a guess."""
    if len(members) > WIDEST:
        raise InputError(f"{len(members)} arrays; at most {WIDEST} are read", file=file)
    if len({name.removesuffix(".npy") for name in members}) < len(members):
        raise InputError("holds an array of one name twice; store it once", file=file)


def _require_columns(shape: tuple[int, ...], dtype: np.dtype, file: str) -> None:
    if dtype.kind not in "biuf" or len(shape) not in (1, 2) or not all(k > 0 for k in shape) or prod(shape[1:]) > WIDEST:
        raise InputError(f"{dtype} of shape {shape}; expected numbers of shape (N,) or (N, k), at most {WIDEST} columns", file=file)


@dataclass(frozen=True)
class Stored:
    """An array in a file: how to open its bytes, header included; shape, dtype, order."""

    open: Callable[[], IO[bytes]]
    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype

    @property
    def samples(self) -> int:
        """Length along the axis of the samples; (1, N) is a vector."""
        return max(self.shape, default=1) if self.shape[:1] in ((), (1,)) else self.shape[0]

    def blocks(self, size: int) -> Iterator[Array]:
        """Consecutive samples, shape (B, k)."""
        columns = int(np.prod(self.shape)) // self.samples
        width = columns if self.fortran else 1
        handles = [self._opened(c * self.samples * self.dtype.itemsize) for c in range(width)]
        try:
            for start in range(0, self.samples, size):
                count = min(size, self.samples - start)
                parts = [self._read(handle, count * columns // width).reshape(count, -1) for handle in handles]
                yield parts[0] if width == 1 else np.hstack(parts)
        finally:
            for handle in handles:
                handle.close()

    def _opened(self, offset: int) -> IO[bytes]:
        handle = self.open()
        header(handle)
        handle.seek(offset, 1)
        return handle

    def _read(self, handle: IO[bytes], count: int) -> Array:
        data = handle.read(count * self.dtype.itemsize)
        return np.frombuffer(data, self.dtype, count)  # ValueError where the file ends early


def header(handle: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and dtype of the array that begins here; the handle stands at its first number afterwards."""
    version = npy.read_magic(handle)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    return read(handle)


@dataclass(frozen=True, eq=False)
class ArrayBlocks:
    """Arrays in a file, read by blocks; names as in the ArrayTable of the same file."""

    file: str
    arrays: dict[str, Stored]
    whole: Stored | None = None  # a .npy file: its columns are the names

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns or arrays."""
        if self.whole is None:
            return tuple(self.arrays)
        return tuple(str(i + 1) for i in range(int(np.prod(self.whole.shape)) // self.whole.samples))

    def samples(self, names: Sequence[str]) -> int:
        """Length of the named columns."""
        check_names(names, self.names, self.file)
        return self.whole.samples if self.whole is not None else self._wanted(names)[0]

    def blocks(self, names: Sequence[str], size: int) -> Iterator[ArrayBlock]:
        """Tables of `size` samples of the named arrays, and of every scalar, in order."""
        check_names(names, self.names, self.file)
        try:
            if self.whole is not None:
                for k, x in enumerate(self.whole.blocks(size)):
                    yield ArrayBlock(self.file, {str(i + 1): x[:, i] for i in range(x.shape[1])}, first=k * size)
                return
            _, wanted = self._wanted(names)
            scalars = {name: next(x.blocks(1))[0] for name, x in self.arrays.items() if x.shape == () or x.samples == 1}
            for k, parts in enumerate(zip(*(x.blocks(size) for x in wanted.values()), strict=True)):
                yield ArrayBlock(self.file, {**scalars, **dict(zip(wanted, parts, strict=True))}, first=k * size)
        except DAMAGED as e:
            if isinstance(e, InputError):
                raise
            raise InputError(f"damaged file of arrays ({first_line(e)}); copy it again", file=self.file) from e

    def _wanted(self, names: Sequence[str]) -> tuple[int, dict[str, Stored]]:
        """The common length of the named arrays, and these."""
        wanted = {name: self._series(name) for name in dict.fromkeys(names)}
        lengths = {name: x.samples for name, x in wanted.items()}
        if len(set(lengths.values())) > 1:
            raise InputError(f"columns of different lengths: {', '.join(f'{k} {v}' for k, v in lengths.items())}", file=self.file)
        return next(iter(lengths.values())), wanted

    def _series(self, name: str) -> Stored:
        x = self.arrays[name]
        if len(x.shape) not in (1, 2) or (len(x.shape) == 2 and 1 < x.shape[0] < x.shape[1]):
            raise InputError(f"shape {x.shape}; expected (N,) or (N, k), samples along the first axis", file=self.file, column=name)
        return x


def npz_blocks(path: Path, file: str) -> ArrayBlocks:
    """An archive of arrays to be read by blocks."""
    try:
        with zipfile.ZipFile(path) as archive:
            _require_distinct(archive.namelist(), file)
            members = [name for name in archive.namelist() if name.endswith(".npy")]
        found = {name[:-4]: _stored(partial(_member, path, name)) for name in members}
    except InputError:
        raise
    except DAMAGED as e:
        raise InputError(f"not an archive of plain arrays ({first_line(e)})", file=file) from e
    return ArrayBlocks(file, {name: x for name, x in found.items() if x.dtype.kind in "biuf"})


def _member(path: Path, name: str) -> IO[bytes]:
    """A member of an archive; it keeps the archive open until it is closed."""
    return zipfile.ZipFile(path).open(name)


def npy_blocks(path: Path, file: str) -> ArrayBlocks:
    """A single array to be read by blocks."""
    try:
        whole = _stored(lambda: path.open("rb"))
    except DAMAGED as e:
        raise InputError(f"not a file of one plain array ({first_line(e)})", file=file) from e
    _require_columns(whole.shape, whole.dtype, file)
    return ArrayBlocks(file, {}, whole)


def _stored(open_bytes: Callable[[], IO[bytes]]) -> Stored:
    with open_bytes() as handle:
        shape, fortran, dtype = header(handle)
    return Stored(open_bytes, shape, fortran and len(shape) > 1, dtype)
