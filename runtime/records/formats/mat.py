"""MATLAB files: version 4 by scipy, 5 to 7 by `runtime.records.formats.mat5`, 7.3 (an HDF5 file) by h5py, the only place where it is used (extra `tables`).

Numeric and logical arrays are read. Cells, structures, texts and sparse matrices are listed with their class and never loaded: a column of one is
refused by name. Arrays of version 7.3 are stored by columns, so that h5py shows them transposed; they are turned back.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatReadError

from runtime.errors import InputError, first_line
from runtime.limits import require_size
from runtime.records.formats.arrays import ArrayTable, numeric
from runtime.records.formats.mat5 import read_mat5

NUMERIC = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))  # classes of MATLAB
HDF5 = b"\x89HDF\r\n\x1a\n"
DAMAGED = (
    *(MatReadError, OSError, EOFError, zlib.error, struct.error, MemoryError, RuntimeError),
    *(ValueError, TypeError, KeyError, IndexError, AttributeError, AssertionError, ArithmeticError, NameError),
)  # what scipy, h5py and what they read with raise on bytes that are no such file
PLACES = (0, 512)  # where an HDF5 file may begin; MATLAB writes a text of 512 bytes first


def read_mat(data: bytes, file: str) -> ArrayTable:
    """Table of the bytes of a .mat file."""
    if any(data[place : place + len(HDF5)] == HDF5 for place in PLACES):
        return _read_hdf5(data, file)
    if data[124:128] in (b"\x00\x01IM", b"\x01\x00MI") and 0 not in data[:4]:
        return ArrayTable(file, *read_mat5(data, file))
    try:
        if 0 not in data[:4]:
            raise ValueError("its first 128 bytes are of no version")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of texts and sparse matrices, which are not read
            warnings.simplefilter("error", UserWarning)  # numbers as VAX computers stored them
            return ArrayTable(file, numeric(scipy.io.loadmat(BytesIO(data))))  # version 4
    except (*DAMAGED, UserWarning) as e:
        raise InputError(f"not a MATLAB file ({first_line(e)})", file=file) from e


def _read_hdf5(data: bytes, file: str) -> ArrayTable:
    try:
        import h5py
    except ImportError as e:
        raise InputError("a MATLAB 7.3 file needs an optional library: pip install symgen[tables] (or save it with -v7)", file=file) from e
    try:
        with h5py.File(BytesIO(data), "r") as archive:
            others = {name: reason for name in archive if (reason := _unreadable(archive, name, h5py)) and not name.startswith("#")}
            wanted = {name: archive[name] for name in archive if name not in others and not name.startswith("#")}
            require_size(sum(x.size * x.dtype.itemsize for x in wanted.values()), len(data), file)
            return ArrayTable(file, {name: _array(x) for name, x in wanted.items()}, others)
    except InputError:
        raise
    except DAMAGED as e:
        raise InputError(f"not a MATLAB 7.3 file ({first_line(e)})", file=file) from e


def _unreadable(archive: Any, name: str, h5py: Any) -> str:
    """Why a member of a file of version 7.3 is not an array of numbers; "" where it is one. Links to other files are not followed."""
    if not isinstance(archive.get(name, getlink=True), h5py.HardLink):
        return "a link"
    x = archive[name]
    attributes: Mapping[str, Any] = x.attrs
    given = attributes.get("MATLAB_class", b"double")
    kind = given.decode("ascii", "replace") if isinstance(given, bytes) else str(given)
    if isinstance(x, h5py.Group):
        return f"a MATLAB {'sparse matrix' if 'MATLAB_sparse' in attributes else 'struct'}"
    if kind not in NUMERIC or x.dtype.kind not in "biuf":
        return f"a MATLAB {kind if kind not in NUMERIC else x.dtype}"
    if x.external is not None or x.is_virtual:
        return "stored in another file"
    return ""


def _array(x: Any) -> np.ndarray:
    """The numbers as MATLAB shows them; a mark says where an array is empty and its dimensions are stored in its place."""
    return np.empty(0) if "MATLAB_empty" in x.attrs else np.asarray(x[()]).T
