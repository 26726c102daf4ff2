"""The array-API module of a model at the border: found beside the NumPy module, checked, and of the same robot file.

    arrays = load_arrays("tx40")        # generated/tx40_xp.py: NumPy, CuPy, JAX, PyTorch

It is parsed before it runs (`runtime.model.loading`) and imports array_api_compat itself; nothing here does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast

import numpy as np

from runtime.errors import ModelError
from runtime.model.generated import GeneratedModel, sibling_file
from runtime.model.loading import module_of

CONSTANTS = ("NAME", "JOINTS", "BASE_PARAMETERS", "STRUCTURE", "CONSTANTS", "SIGNALS", "ENTRIES", "SOURCE_SHA256")
FUNCTIONS = ("signals", "regressor", "observation_matrix")


class ArrayModel(Protocol):
    """What `runtime` uses of an array-API module; q, qd, qdd float64 of shape (..., n), arrays of one package on one device.

    Entry (k, j) of the regressor is c times signal s for each (k, j, s, c) in ENTRIES; signals has shape (SIGNALS, ...).
    """

    NAME: str
    JOINTS: tuple[int, ...]
    BASE_PARAMETERS: tuple[str, ...]
    STRUCTURE: tuple[tuple[bool, ...], ...]
    CONSTANTS: Mapping[str, float]
    SIGNALS: int
    ENTRIES: tuple[tuple[int, int, int, float], ...]
    SOURCE_SHA256: str
    signals: Callable[..., Any]  # (SIGNALS, ...)
    regressor: Callable[..., Any]  # D (..., n, b)
    observation_matrix: Callable[..., Any]  # W (n*N, b), rows joint-major


def load_arrays(model: str | Path | ModuleType, *, of: GeneratedModel | None = None, folder: Path | None = None) -> ArrayModel:
    """The array model of a name (generated/NAME_xp.py), of a path, or of an imported module; ModelError where it is no such model.

    of : the NumPy model that it must belong to.   folder : where names are looked up; default: ./generated.
    """
    if isinstance(model, ModuleType):
        return _checked(model, of)
    return _checked(module_of(sibling_file(model, "xp", title="array", folder=folder)), of)


def _checked(module: ModuleType, of: GeneratedModel | None) -> ArrayModel:
    label = module.__name__
    missing = [name for name in (*CONSTANTS, *FUNCTIONS) if not hasattr(module, name)]
    missing += [name for name in FUNCTIONS if hasattr(module, name) and not callable(getattr(module, name))]
    if missing:
        raise ModelError(f"no {', '.join(missing)}; expected an emitted array module, emit it again", file=label)
    model = cast(ArrayModel, module)
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    for k, j, s, _ in model.ENTRIES:
        if not (0 <= k < b and 0 <= j < n and 0 <= s < model.SIGNALS):
            raise ModelError(f"ENTRIES holds {(k, j, s)}; expected less than {(b, n, model.SIGNALS)}", file=label)
    rest = np.zeros((2, n))
    if np.shape(model.signals(rest, rest, rest)) != (model.SIGNALS, 2):
        raise ModelError(f"signals has shape {np.shape(model.signals(rest, rest, rest))}; expected {(model.SIGNALS, 2)}", file=label)
    if of is not None and model.SOURCE_SHA256 != of.SOURCE_SHA256:
        raise ModelError("NumPy and array module stem from different robot files; emit both again", file=label)
    return model
