"""NumPy archives of arrays; pickled objects are refused."""

from __future__ import annotations

import zipfile
from io import BytesIO

import numpy as np

from runtime.errors import InputError
from runtime.io.arrays import ArrayTable, numeric


def read_npz(data: bytes, file: str) -> ArrayTable:
    """Table of the bytes of a .npz file."""
    try:
        with np.load(BytesIO(data), allow_pickle=False) as archive:
            return ArrayTable(file, numeric({name: archive[name] for name in archive.files}))
    except (ValueError, OSError, EOFError, AttributeError, zipfile.BadZipFile) as e:
        raise InputError(f"not an archive of plain arrays ({e})", file=file) from e
