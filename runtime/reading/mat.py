"""Reading of MATLAB files: versions 4 to 7 by scipy, 7.3 (an HDF5 file) by h5py.

h5py is optional (pip install symgen[tables]). Numeric and logical arrays are read, also inside
structures, as rec.pos. Cells, arrays of structures, texts and sparse matrices are listed with their
class; a study that names one of them as a column gets an error. Arrays of version 7.3 are stored by
columns, so that h5py returns them transposed; they are transposed back.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import opened, unpacked
from runtime.reading.table import Options, Table, damage_named, is_numeric

TITLE = "a MATLAB file"
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
Member = np.ndarray | Mapping[str, Any] | str
"""An array of numbers, the members of a structure, or what else it is, in words."""


def read_mat(path: Path, options: Options) -> Table:
    """Read the numeric arrays of a .mat file as a Table of named columns."""
    with opened(path) as file:
        head = file.read(PLACES[-1] + len(HDF5))
    arrays: dict[str, np.ndarray] = {}
    others: dict[str, str] = {}
    with damage_named(TITLE, path.name):
        if any(head[place : place + len(HDF5)] == HDF5 for place in PLACES):
            import h5py

            with h5py.File(unpacked(path), "r") as archive:
                _flatten("", _members(archive), _of_hdf5, arrays, others)
        else:
            _flatten("", _by_scipy(path, others), _of_scipy, arrays, others)
    expected = "expected numbers, and a time in seconds (or record.rate without columns.t)"
    refused = {
        name: InputError(f"{what}; {expected}", file=path.name, column=name)
        for name, what in others.items()
    }
    return Table(file=path.name, columns=arrays, refused=refused)


def _by_scipy(path: Path, others: dict[str, str]) -> dict[str, Any]:
    """Read the variables of a MATLAB file of versions 4 to 7 by scipy.

    A variable whose class is not numeric is not read; its class is added to `others`.
    """
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # numbers as VAX computers stored them
        try:
            classes = {name: kind for name, _, kind in whosmat(unpacked(path))}
        except TypeError:  # an object of MATLAB, which has no name and no shape there
            classes = {}
        for name, kind in classes.items():
            if kind not in (*NUMERIC, "struct"):
                others[name] = f"a MATLAB {kind} array"
        wanted = [name for name in classes if name not in others] if classes else None
        members = loadmat(unpacked(path), variable_names=wanted)
    return {
        name: x
        for name, x in members.items()
        if isinstance(name, str) and not name.startswith("__") and name not in others
    }


def _flatten(
    path: str,
    members: Mapping[str, Any],
    read: Callable[[Any], Member],
    arrays: dict[str, np.ndarray],
    others: dict[str, str],
    depth: int = 0,
) -> None:
    """Collect the numeric arrays of a MATLAB file, also those in structures, for instance rec.pos.

    The arrays are added to `arrays`. Members that cannot be read are described in `others`. read :
    function that returns the value of a member.
    """
    for key, member in members.items():
        name = f"{path}{key}"
        x = read(member)
        if isinstance(x, np.ndarray):
            arrays[name] = x
        elif isinstance(x, str):
            others[name] = x
        else:
            others[name] = f"a MATLAB struct of {', '.join(f'{name}.{own}' for own in x)}"
            if depth < DEEPEST:
                _flatten(f"{name}.", x, read, arrays, others, depth + 1)


def _of_scipy(x: Any) -> Member:
    """Convert a variable of a MATLAB file (versions 4 to 7) to an array, a mapping or a text.

    A mapping stands for a structure. The text describes a variable that cannot be read.
    """
    if isinstance(x, np.ndarray) and is_numeric(x):
        return x
    if isinstance(x, np.ndarray) and x.dtype.names:
        if x.size != 1:
            return f"a MATLAB struct array of shape {x.shape}"
        return {key: x[key].flat[0] for key in x.dtype.names}
    return f"a MATLAB {WORDS.get(getattr(getattr(x, 'dtype', None), 'kind', ''), 'object')}"


def _members(group: Any) -> dict[str, tuple[Any, str]]:
    return {key: (group, key) for key in group if not key.startswith("#")}


def _of_hdf5(member: tuple[Any, str]) -> Member:
    """Convert a variable of a MATLAB file (version 7.3) to an array, a mapping or a text.

    A mapping stands for a structure. The text describes a variable that cannot be read. Links to
    other files are not followed. An empty array has the attribute MATLAB_empty, because the file
    holds its dimensions in place of numbers.
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
    if kind not in NUMERIC or not is_numeric(x):
        return f"a MATLAB {kind if kind not in NUMERIC else x.dtype}"
    if x.external is not None or x.is_virtual:
        return "stored in another file"
    return np.empty(0) if "MATLAB_empty" in x.attrs else np.asarray(x[()]).T
