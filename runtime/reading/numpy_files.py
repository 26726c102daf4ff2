"""Reading of NumPy files without pickled objects: arrays (.npy), archives of arrays (.npz)."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import require_size, unpacked
from runtime.reading.table import WIDEST, Array, Options, Table, damage_named, is_numeric

ARCHIVE = "an archive of plain arrays"
SINGLE = "a file of one plain array"


def read_npz(path: Path, options: Options) -> Table:
    """Read a .npz file as a Table of its numeric arrays."""
    arrays = archive_of(path)
    return Table(file=path.name, columns={key: x for key, x in arrays.items() if is_numeric(x)})


def read_npy(path: Path, options: Options) -> Table:
    """Read a .npy file as a Table whose columns are called 1, 2 ..."""
    with damage_named(SINGLE, path.name):
        x = np.load(unpacked(path), allow_pickle=False)
        if not isinstance(x, np.ndarray):
            raise ValueError("an archive")
    if not is_numeric(x) or x.ndim not in (1, 2) or not x.size or min(x.shape) > WIDEST:
        raise InputError(
            f"the array has dtype {x.dtype} and shape {x.shape}; expected numbers of shape (N,), "
            f"(N, k) or (k, N), at most {WIDEST} columns",
            file=path.name,
        )
    columns = np.atleast_2d(x) if x.ndim == 1 or x.shape[0] < x.shape[1] else x.T
    return Table(
        file=path.name, columns={str(k): column for k, column in enumerate(columns, start=1)}
    )


def archive_of(path: Path) -> dict[str, Array]:
    """Read all arrays of a .npz file and return them by name.

    Raise InputError for pickled objects, damage, and an archive that is too large.
    """
    file = path.name
    stream = unpacked(path)
    with damage_named(ARCHIVE, file):
        with zipfile.ZipFile(stream) as archive:
            members = archive.namelist()
            held = sum(member.file_size for member in archive.infolist())
        require_size(held, path.stat().st_size, file)
        if len(members) > WIDEST:
            raise InputError(
                f"the file has {len(members)} arrays; expected at most {WIDEST}", file=file
            )
        if len({name.removesuffix(".npy") for name in members}) < len(members):
            raise InputError(
                "the file contains two arrays of the same name; store each name once", file=file
            )
        with np.load(stream, allow_pickle=False) as arrays:
            return {
                name.removesuffix(".npy"): _plain(arrays, name)
                for name in members
                if name.endswith(".npy")
            }


def _plain(arrays: Any, name: str) -> Array:
    """Return one array of a .npz archive; raise ValueError for pickled objects and damaged data."""
    try:
        return np.asarray(arrays[name])
    except ValueError as e:
        key = name.removesuffix(".npy")
        raise ValueError(
            f"{key} contains pickled objects or values that are not numbers: {e}"
        ) from e
