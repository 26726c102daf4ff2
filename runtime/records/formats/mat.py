"""MATLAB files: versions 4 to 7 by scipy, 7.3 (an HDF5 file) by h5py (pip install symgen[tables]).

Numeric and logical arrays are read. Cells, structures, texts and sparse matrices are listed with their class and never loaded: a column of one is
refused by name. Arrays of version 7.3 are stored by columns, so that h5py shows them transposed; they are turned back.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.records.formats.arrays import ArrayTable, Held, is_numeric
from runtime.records.formats.columns import Source

NUMERIC = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))  # classes of MATLAB
HDF5 = b"\x89HDF\r\n\x1a\n"
PLACES = (0, 512)  # where an HDF5 file may begin; MATLAB writes a text of 512 bytes first


def open_mat(source: Source) -> ArrayTable:
    """Table of a .mat file."""
    with source.open() as file:
        head = file.read(PLACES[-1] + len(HDF5))
    if any(head[place : place + len(HDF5)] == HDF5 for place in PLACES):
        return _open_hdf5(source)
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # numbers as VAX computers stored them
        with source.open() as file:
            classes = {name: kind for name, _, kind in whosmat(file)}
        others = {name: f"a MATLAB {kind} array" for name, kind in classes.items() if kind not in NUMERIC}
        with source.open() as file:
            arrays = loadmat(file, variable_names=[name for name in classes if name not in others])
    others |= {name: "a MATLAB complex array" for name, x in arrays.items() if name in classes and not is_numeric(x.dtype)}
    return _table(source, {name: arrays[name] for name in classes if name not in others}, others)


def _open_hdf5(source: Source) -> ArrayTable:
    import h5py

    with h5py.File(source.content(), "r") as archive:
        others = {name: reason for name in archive if (reason := _unreadable(archive, name)) and not name.startswith("#")}
        wanted = {name: archive[name] for name in archive if name not in others and not name.startswith("#")}
        return _table(source, {name: _array(x) for name, x in wanted.items()}, others)


def _table(source: Source, arrays: Mapping[str, np.ndarray], others: Mapping[str, str]) -> ArrayTable:
    return ArrayTable(file=source.file, size=source.size, arrays={name: Held(x) for name, x in arrays.items()}, others=others)


def _unreadable(archive: Any, name: str) -> str:
    """Why a member of a file of version 7.3 is not an array of numbers; "" where it is one. Links to other files are not followed."""
    import h5py

    if not isinstance(archive.get(name, getlink=True), h5py.HardLink):
        return "a link"
    x = archive[name]
    attributes: Mapping[str, Any] = x.attrs
    given = attributes.get("MATLAB_class", b"double")
    kind = given.decode("ascii", "replace") if isinstance(given, bytes) else str(given)
    if isinstance(x, h5py.Group):
        return f"a MATLAB {'sparse matrix' if 'MATLAB_sparse' in attributes else 'struct'}"
    if kind not in NUMERIC or not is_numeric(x.dtype):
        return f"a MATLAB {kind if kind not in NUMERIC else x.dtype}"
    if x.external is not None or x.is_virtual:
        return "stored in another file"
    return ""


def _array(x: Any) -> np.ndarray:
    """The numbers as MATLAB shows them; a mark says where an array is empty and its dimensions are stored in its place."""
    return np.empty(0) if "MATLAB_empty" in x.attrs else np.asarray(x[()]).T
