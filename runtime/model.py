"""The border to emitted modules: what they offer, how one is found and checked, and checks of the states given to it.

A model is a plain Python module written by the generator (NumPy only). A module given by path is parsed before it runs: it may hold constants,
functions and classes over numpy and nothing else, so that a file received from elsewhere cannot act behind its formulas.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from runtime.errors import InputError

Array = np.ndarray


class GeneratedModel(Protocol):
    """What `runtime` uses of an emitted module: n joints, b base parameters, q, qd, qdd of shape (N, n)."""

    NAME: str
    JOINTS: tuple[int, ...]
    BASE_PARAMETERS: tuple[str, ...]
    STRUCTURE: Array  # bool (b, n): False where the entry is identically zero
    DRIVES: Mapping[str, Any] | None
    LIMITS: Mapping[str, Any]
    VALUES: Mapping[str, float]
    CONSTANTS: Mapping[str, float]
    SOURCE_SHA256: str

    def store(self, N: int) -> Array:
        """Workspace of shape (b, n, N) for `out`, structural zeros written."""

    def regressor(self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float) -> Array:
        """D, shape (N, n, b), eq. (5)."""

    def observation_matrix(self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float) -> Array:
        """W, shape (n*N, b), rows joint-major, Fortran order, eq. (6)."""


def check_states(model: GeneratedModel, q: Array, qd: Array, qdd: Array) -> None:
    """Raise ValueError unless q, qd, qdd are real arrays of one shape (N, n), n the joints of the model."""
    n = len(model.JOINTS)
    for name, x in (("q", q), ("qd", qd), ("qdd", qdd)):
        x = np.asarray(x)
        if x.ndim not in (1, 2) or x.shape[-1] != n or x.shape != np.shape(q):
            raise InputError(
                f"{model.NAME}: {name} has shape {x.shape}, q {np.shape(q)}; expected (N, {n}) or ({n},), the same for q, qd and qdd"
            )
        if not np.issubdtype(x.dtype, np.floating) and not np.issubdtype(x.dtype, np.integer):
            raise InputError(f"{model.NAME}: {name} has dtype {x.dtype}; expected real numbers")
