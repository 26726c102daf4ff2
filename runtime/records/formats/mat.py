"""MATLAB files: versions 4 to 7 by scipy, 7.3 (an HDF5 file) by h5py (pip install symgen[tables]).

Numeric and logical arrays are read, also those in structures, as rec.pos. Cells, arrays of
structures, texts and sparse matrices are listed with
their class: a column of one is refused by name. Arrays of version 7.3 are stored by columns, so
that h5py shows them transposed; they are turned back.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.records.formats.arrays import ArrayTable, Held, is_numeric
from runtime.records.formats.columns import Source

NUMERIC = (
    "double",
    "single",
    "logical",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)  # classes of MATLAB
WORDS = {
    "c": "complex array",
    "U": "char array",
    "O": "cell array",
}  # by kind of the dtype that scipy gives
STRUCT = "a MATLAB struct"
HDF5 = b"\x89HDF\r\n\x1a\n"
PLACES = (0, 512)  # where an HDF5 file may begin; MATLAB writes a text of 512 bytes first
DEEPEST = 4  # structures in one another


def open_mat(source: Source) -> ArrayTable:
    """Table of a .mat file."""
    with source.open() as file:
        head = file.read(PLACES[-1] + len(HDF5))
    if any(head[place : place + len(HDF5)] == HDF5 for place in PLACES):
        return _open_hdf5(source)
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # numbers as VAX computers stored them
        try:
            with source.open() as file:
                classes = {name: kind for name, _, kind in whosmat(file)}
        except TypeError:  # an object of MATLAB, which has no name and no shape there
            classes = {}
        others = {
            name: f"a MATLAB {kind} array"
            for name, kind in classes.items()
            if kind not in (*NUMERIC, "struct")
        }
        with source.open() as file:
            loaded = loadmat(
                file,
                variable_names=[name for name in classes if name not in others]
                if classes
                else None,
            )
    arrays: dict[str, np.ndarray] = {}
    for name, x in loaded.items():
        if isinstance(name, str) and not name.startswith("__") and name not in others:
            _flatten(name, x, arrays, others)
    return _table(source, arrays, others)


def _flatten(
    name: str, x: Any, arrays: dict[str, np.ndarray], others: dict[str, str], depth: int = 0
) -> None:
    """Put an array of numbers, or those in a structure, among the `arrays`; what cannot be read
    among the `others`.
    """
    dtype = getattr(x, "dtype", None)
    if isinstance(x, np.ndarray) and is_numeric(x.dtype):
        arrays[name] = x
    elif isinstance(x, np.ndarray) and x.dtype.names and x.size == 1 and depth < DEEPEST:
        others[name] = f"a MATLAB struct of {', '.join(f'{name}.{key}' for key in x.dtype.names)}"
        for key in x.dtype.names:
            _flatten(f"{name}.{key}", x[key].flat[0], arrays, others, depth + 1)
    elif isinstance(x, np.ndarray) and x.dtype.names:
        others[name] = f"a MATLAB struct array of shape {x.shape}"
    else:
        others[name] = f"a MATLAB {WORDS.get(getattr(dtype, 'kind', ''), 'object')}"


def _open_hdf5(source: Source) -> ArrayTable:
    import h5py

    with h5py.File(source.content(), "r") as archive:
        arrays: dict[str, np.ndarray] = {}
        others: dict[str, str] = {}
        _flatten_hdf5(archive, "", arrays, others)
        return _table(source, arrays, others)


def _flatten_hdf5(
    group: Any, path: str, arrays: dict[str, np.ndarray], others: dict[str, str], depth: int = 0
) -> None:
    for key in group:
        if key.startswith("#"):
            continue
        name = f"{path}{key}"
        if reason := _unreadable(group, key):
            others[name] = reason
            if reason == STRUCT and depth < DEEPEST:
                others[name] += f" of {', '.join(f'{name}.{own}' for own in group[key])}"
                _flatten_hdf5(group[key], f"{name}.", arrays, others, depth + 1)
        else:
            arrays[name] = _array(group[key])


def _table(
    source: Source, arrays: Mapping[str, np.ndarray], others: Mapping[str, str]
) -> ArrayTable:
    return ArrayTable(
        file=source.file,
        size=source.size,
        arrays={name: Held(x) for name, x in arrays.items()},
        others=others,
    )


def _unreadable(archive: Any, name: str) -> str:
    """Why a member of a file of version 7.3 is not an array of numbers; "" where it is one. Links
    to other files are not followed.
    """
    import h5py

    if not isinstance(archive.get(name, getlink=True), h5py.HardLink):
        return "a link"
    x = archive[name]
    attributes: Mapping[str, Any] = x.attrs
    given = attributes.get("MATLAB_class", b"double")
    kind = given.decode("ascii", "replace") if isinstance(given, bytes) else str(given)
    if isinstance(x, h5py.Group):
        return "a MATLAB sparse matrix" if "MATLAB_sparse" in attributes else STRUCT
    if kind not in NUMERIC or not is_numeric(x.dtype):
        return f"a MATLAB {kind if kind not in NUMERIC else x.dtype}"
    if x.external is not None or x.is_virtual:
        return "stored in another file"
    return ""


def _array(x: Any) -> np.ndarray:
    """The numbers as MATLAB shows them; a mark says where an array is empty and its dimensions are
    stored in its place.
    """
    return np.empty(0) if "MATLAB_empty" in x.attrs else np.asarray(x[()]).T
