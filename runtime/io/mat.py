"""MATLAB files up to version 7."""

from __future__ import annotations

from io import BytesIO

import scipy.io
from scipy.io.matlab import MatReadError

from runtime.errors import InputError
from runtime.io.arrays import ArrayTable, numeric


def read_mat(data: bytes, file: str) -> ArrayTable:
    """Table of the bytes of a .mat file; structures and cells are left out."""
    try:
        return ArrayTable(file, numeric(scipy.io.loadmat(BytesIO(data))))
    except NotImplementedError:
        raise InputError("a MATLAB 7.3 file; save it with `save -v7`", file=file) from None
    except (MatReadError, ValueError, TypeError, OSError, EOFError, KeyError, IndexError) as e:
        raise InputError(f"not a MATLAB file ({e})", file=file) from e
