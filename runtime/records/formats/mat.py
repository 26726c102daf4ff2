"""MATLAB files: versions 4 to 7 by scipy, 7.3 (an HDF5 file) by h5py (pip install symgen[tables]).

Numeric and logical arrays are read, also those in structures, as rec.pos. Cells, arrays of
structures, texts and sparse matrices are listed with
their class: a column of one is refused by name. Arrays of version 7.3 are stored by columns, so
that h5py shows them transposed; they are turned back.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
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
HDF5 = b"\x89HDF\r\n\x1a\n"
PLACES = (0, 512)  # where an HDF5 file may begin; MATLAB writes a text of 512 bytes first
DEEPEST = 4  # structures in one another
Read = Callable[[Any], np.ndarray | Mapping[str, Any] | str]


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
    members = {
        name: x
        for name, x in loaded.items()
        if isinstance(name, str) and not name.startswith("__") and name not in others
    }
    return _table(source, members, _of_scipy, others)


def _open_hdf5(source: Source) -> ArrayTable:
    import h5py

    with h5py.File(source.content(), "r") as archive:
        return _table(source, _members(archive), _of_hdf5, {})


def _table(
    source: Source, members: Mapping[str, Any], read: Read, others: dict[str, str]
) -> ArrayTable:
    arrays: dict[str, np.ndarray] = {}
    _flatten("", members, read, arrays, others)
    held = {name: Held(x) for name, x in arrays.items()}
    return ArrayTable(file=source.file, size=source.size, arrays=held, others=others)


def _flatten(
    path: str,
    members: Mapping[str, Any],
    read: Read,
    arrays: dict[str, np.ndarray],
    others: dict[str, str],
    depth: int = 0,
) -> None:
    """Put arrays of numbers, also those in structures, among the `arrays`; what cannot be read
    among the `others`.
    """
    for key, member in members.items():
        name, x = f"{path}{key}", read(member)
        if isinstance(x, np.ndarray):
            arrays[name] = x
        elif isinstance(x, str):
            others[name] = x
        else:
            others[name] = f"a MATLAB struct of {', '.join(f'{name}.{own}' for own in x)}"
            if depth < DEEPEST:
                _flatten(f"{name}.", x, read, arrays, others, depth + 1)


def _of_scipy(x: Any) -> np.ndarray | Mapping[str, Any] | str:
    """The array of numbers, the members of a structure, or what else it is."""
    if isinstance(x, np.ndarray) and is_numeric(x.dtype):
        return x
    if isinstance(x, np.ndarray) and x.dtype.names:
        if x.size != 1:
            return f"a MATLAB struct array of shape {x.shape}"
        return {key: x[key].flat[0] for key in x.dtype.names}
    return f"a MATLAB {WORDS.get(getattr(getattr(x, 'dtype', None), 'kind', ''), 'object')}"


def _members(group: Any) -> dict[str, tuple[Any, str]]:
    return {key: (group, key) for key in group if not key.startswith("#")}


def _of_hdf5(member: tuple[Any, str]) -> np.ndarray | Mapping[str, Any] | str:
    """The same of a member of a file of version 7.3, as MATLAB shows it. Links to other files are
    not followed; a mark says where an array is empty and its dimensions are stored in its place.
    """
    import h5py

    archive, name = member
    if not isinstance(archive.get(name, getlink=True), h5py.HardLink):
        return "a link"
    x = archive[name]
    given = x.attrs.get("MATLAB_class", b"double")
    kind = given.decode("ascii", "replace") if isinstance(given, bytes) else str(given)
    if isinstance(x, h5py.Group):
        return "a MATLAB sparse matrix" if "MATLAB_sparse" in x.attrs else _members(x)
    if kind not in NUMERIC or not is_numeric(x.dtype):
        return f"a MATLAB {kind if kind not in NUMERIC else x.dtype}"
    if x.external is not None or x.is_virtual:
        return "stored in another file"
    return np.empty(0) if "MATLAB_empty" in x.attrs else np.asarray(x[()]).T
