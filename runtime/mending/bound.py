"""A model whose constants have other values: its table of frames and its gravity are changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Array = np.ndarray


class Bound:
    """The module of `symgen.variants`, with other values of its constants by default.

    All other attributes are those of the module.
    """

    def __init__(self, model: Any, constants: Mapping[str, float]) -> None:
        self._model, self._constants = model, dict(constants)
        self.CONSTANTS = {**model.CONSTANTS, **constants}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)

    def regressor(self, q: Array, qd: Array, qdd: Array, **options: Any) -> Array:
        """Compute the regressor of the standard parameters, shape (N, n, p)."""
        return np.asarray(self._model.regressor(q, qd, qdd, **{**self._constants, **options}))

    def frame_poses(self, q: Array, **options: Any) -> Array:
        """Compute the poses of all frames in frame 0, shape (N, frames, 4, 4)."""
        return np.asarray(self._model.frame_poses(q, **{**self._constants, **options}))
