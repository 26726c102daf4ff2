"""Write results for other programs: named arrays of an Estimate or a resolution study.

    arrays = estimate_arrays(fit)         # names as texts, X, sigma ..., figures of the fit
    np.load(BytesIO(npz(arrays)))         # without pickles
    load estimate.mat                     % MATLAB, Octave: names as cell arrays, value.ZZ1R

Equal results give equal bytes: no file contains the time at which it was written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
import scipy.io

from runtime.core.least_squares.estimate import Estimate
from runtime.ground.documents import json_text
from runtime.ground.errors import encodable

Array = np.ndarray

LONGEST_NAME = 63  # characters of a name in MATLAB
KEYWORDS = frozenset(
    {
        *("break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for"),
        *("function", "global", "if", "otherwise", "parfor", "persistent", "return", "spmd"),
        *("switch", "try", "while"),
    }
)
HEADER = b"MATLAB 5.0 MAT-file, written by symgen"


def estimate_arrays(fit: Estimate) -> dict[str, Array]:
    """Convert an Estimate into named arrays, such as X, shape (b,), and covariance, (b, b)."""
    joints = fit.per_joint
    return {
        "names": _texts(fit.names),
        "units": _texts(fit.units.get(name, "") for name in fit.names),
        "X": fit.X,
        "sigma": fit.sigma,
        "relative_sigma": fit.relative_sigma,
        "sigma_corrected": fit.sigma_corrected,
        "covariance": fit.covariance,
        **{
            name: np.array(getattr(fit, name))
            for name in (
                "sigma_rho",
                "cond",
                "cond_unit",
                "rank",
                "residual_norm",
                "relative_error",
            )
        },
        "joints": _texts(joint.joint for joint in joints),
        "joint_rows": np.array([joint.rows for joint in joints], dtype=np.int64),
        **{
            f"joint_{name}": np.array([getattr(j, name) for j in joints])
            for name in ("residual_norm", "relative_error", "sigma_rho")
        },
        **{
            name: np.array(encodable(text))
            for name, text in (
                ("method", fit.method),
                ("status", fit.status),
                ("message", fit.message),
            )
        },
        **{
            name: np.array(json_text(part))
            for name, part in (("settings", fit.settings), ("provenance", fit.provenance))
        },
    }


def array_files(stem: str, arrays: Mapping[str, Array]) -> dict[str, str | bytes]:
    """Return named arrays as the contents of two files: stem.npz (NumPy) and stem.mat (MATLAB)."""
    return {f"{stem}.npz": npz(arrays), f"{stem}.mat": mat(arrays)}


def npz(arrays: Mapping[str, Array]) -> bytes:
    """Convert named arrays to the bytes of a NumPy archive (.npz) without Python objects."""
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise TypeError(f"{name} contains Python objects; expected numbers or texts")
    content: dict[str, Any] = dict(arrays)
    stream = BytesIO()
    np.savez_compressed(stream, **content)
    return stream.getvalue()


def mat(arrays: Mapping[str, Array]) -> bytes:
    """Convert named arrays to the bytes of a MATLAB file (version 5).

    Vectors are columns, texts are cell arrays, and `value` is a structure of X (or X_LS) by name.
    """
    values = arrays.get("X", arrays.get("X_LS", np.empty(0)))
    fields = dict(zip(matlab_names(map(str, arrays["names"])), values.tolist(), strict=True))
    stream = BytesIO()
    content = {name: _cells(array) for name, array in arrays.items()} | {"value": fields}
    scipy.io.savemat(stream, content, oned_as="column", long_field_names=True, do_compression=True)
    data = stream.getvalue()
    return HEADER.ljust(116) + data[116:]


def matlab_names(names: Iterable[str]) -> tuple[str, ...]:
    """Convert names to variable names that MATLAB accepts and that all differ.

    A name has a letter first, then letters, digits and _, at most 63 characters, and is no keyword.
    """
    allowed: list[str] = []
    for name in names:
        own = re.sub(r"[^A-Za-z0-9_]", "_", name)
        own = own if re.match("[A-Za-z]", own) and own not in KEYWORDS else f"x{own}"
        k, free = 1, own[:LONGEST_NAME]
        while free in allowed:
            k += 1
            free = f"{own[: LONGEST_NAME - len(str(k)) - 1]}_{k}"
        allowed.append(free)
    return tuple(allowed)


def _texts(texts: Iterable[str]) -> Array:
    return np.array(list(texts), dtype=np.str_)


def _cells(array: Array) -> Array | str | Sequence[str]:
    """Convert an array of texts to MATLAB strings or cells; return other arrays unchanged.

    A single text becomes a character string, several texts become a cell array.
    """
    if array.dtype.kind != "U":
        return array
    return str(array) if not array.ndim else np.array(array.tolist(), dtype=object)
