"""Reading of HDF5 files (.h5, .hdf5), by h5py (pip install symgen[tables]).

A data set in groups has the name observations.qpos. Vectors and matrices of numbers are read;
images and other arrays of more dimensions are not. A file that MATLAB wrote is read as such.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import require_size, unpacked
from runtime.reading.mat import read_mat
from runtime.reading.table import WIDEST, Array, Options, Table, damage_named, is_numeric

TITLE = "an HDF5 file"
DEEPEST = 8  # groups in one another


def read_hdf5(path: Path, options: Options) -> Table:
    """Read the vectors and matrices of an HDF5 file as a Table of named columns."""
    import h5py

    columns: dict[str, Array] = {}
    others: dict[str, str] = {}
    with damage_named(TITLE, path.name), h5py.File(unpacked(path), "r") as archive:
        by_matlab = any("MATLAB_class" in x.attrs for x in archive.values())
        if not by_matlab:
            sizes: list[int] = []
            _collect("", archive, columns, others, sizes, path)
    if by_matlab:
        return read_mat(path, options)
    refused = {
        name: InputError(
            f"{what}; expected numbers of shape (N,) or (N, k)", file=path.name, column=name
        )
        for name, what in others.items()
    }
    return Table(file=path.name, columns=columns, refused=refused)


def _collect(
    prefix: str,
    group: Any,
    columns: dict[str, Array],
    others: dict[str, str],
    sizes: list[int],
    path: Path,
    depth: int = 0,
) -> None:
    """Read the data sets of a group and of the groups in it; links to other files are refused."""
    import h5py

    for key in group:
        name = f"{prefix}{key}"
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            others[name] = "a link"
            continue
        x = group[key]
        if isinstance(x, h5py.Group):
            if depth < DEEPEST:
                _collect(f"{name}.", x, columns, others, sizes, path, depth + 1)
        elif not isinstance(x, h5py.Dataset) or not is_numeric(x):
            others[name] = f"values of {getattr(x, 'dtype', 'another kind')}"
        elif x.external is not None or x.is_virtual:
            others[name] = "stored in another file"
        elif x.shape is None or x.ndim > 2 or (x.ndim == 2 and min(x.shape) > WIDEST):
            others[name] = f"an array of shape {x.shape}"
        else:
            sizes.append(x.size * x.dtype.itemsize)
            require_size(sum(sizes), path.stat().st_size, path.name)
            columns[name] = np.asarray(x[()])
