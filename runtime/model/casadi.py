"""The CasADi module of a model at the border: of the same robot file as the NumPy module beside
which it stands, and checked.

    symbolic = load_symbolic("tx40")        # generated/tx40_casadi.py

Like every module it runs where it was emitted here, or is trusted (`runtime.model.loading`). It
imports casadi itself; this file does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast

from runtime.errors import InputError, ModelError
from runtime.model.generated import GeneratedModel, file_of
from runtime.model.loading import is_trusted, module_of

CONSTANTS = ("NAME", "JOINTS", "BASE_PARAMETERS", "CONSTANTS", "LIMITS", "VALUES", "SOURCE_SHA256")
FUNCTIONS = {  # columns read, before the constants
    "regressor": ("q", "qd", "qdd"),
    "inverse_dynamics": ("q", "qd", "qdd", "X"),
    "inertia_matrix": ("q", "X"),
    "bias": ("q", "qd", "X"),
    "gravity": ("q", "X"),
    "forward_dynamics": ("q", "qd", "tau", "X"),
}


class SymbolicModel(Protocol):
    """What `runtime` uses of a CasADi module: ca.Function objects of columns, called by name; n
    joints, b base parameters.
    """

    NAME: str
    JOINTS: tuple[int, ...]
    BASE_PARAMETERS: tuple[str, ...]
    CONSTANTS: Mapping[str, float]
    LIMITS: Mapping[str, Any]
    VALUES: Mapping[str, float]
    SOURCE_SHA256: str
    regressor: Callable[..., Any]  # D (n, b) of q, qd, qdd
    inverse_dynamics: Callable[..., Any]  # GAM of q, qd, qdd, X
    inertia_matrix: Callable[..., Any]  # A of q, X
    bias: Callable[..., Any]  # GAM of q, qd, X
    gravity: Callable[..., Any]  # GAM of q, X
    forward_dynamics: Callable[..., Any]  # qdd of q, qd, tau, X


def load_symbolic(
    model: str | Path | ModuleType | SymbolicModel,
    *,
    of: GeneratedModel | None = None,
    folder: str | Path | None = None,
    trust: bool = False,
) -> SymbolicModel:
    """The CasADi model of a name (generated/NAME_casadi.py), of a path, or of an imported module.

    Parameters
    ----------
    model : str, Path or module
    of : GeneratedModel, optional
        The NumPy model that it must belong to.
    folder : str or Path, optional
        Where names are looked up; default: ./generated.
    trust : bool
        As for `load_model`; a trusted `of` has trusted files beside it.

    Raises
    ------
    ModelError
        No such file, one that was not emitted here, or no such model.
    """
    if not isinstance(model, str | Path):
        return _checked(cast(ModuleType, model), of)
    path = file_of(model, "_casadi", folder)
    if not path.is_file():
        robot = path.stem.removesuffix("_casadi")
        raise ModelError(
            f"no CasADi model {path}; emit it with `symgen generate {robot} --target numpy,casadi "
            f"-o {path.parent}`"
        )
    trust = trust or (of is not None and is_trusted(of))
    return _checked(module_of(path, trust=trust), of)


def casadi_path(model: GeneratedModel) -> Path:
    """The CasADi file that `symgen.model` emits on request, or else the one in the folder of the
    NumPy module; InputError for a model that has no file.
    """
    emitted = getattr(model, "casadi_file", None)
    if emitted is not None:
        return Path(emitted())
    file = getattr(model, "__file__", None)
    if file is None:
        raise InputError(
            f"{model.NAME} has no file to look beside for its CasADi module; pass it as `symbolic`"
        )
    return Path(file).with_name(f"{model.NAME}_casadi.py")


def _checked(module: ModuleType, of: GeneratedModel | None) -> SymbolicModel:
    missing = [name for name in (*CONSTANTS, *FUNCTIONS) if not hasattr(module, name)]
    if missing:
        raise ModelError(
            f"no {', '.join(missing)}; expected an emitted CasADi module, emit it again",
            file=module.__name__,
        )
    for name, columns in FUNCTIONS.items():
        function = getattr(module, name)
        names = list(function.name_in()) if hasattr(function, "name_in") else None
        if names != [*columns, *module.CONSTANTS]:
            raise ModelError(
                f"{name} takes {names}; expected {', '.join([*columns, *module.CONSTANTS])}",
                file=module.__name__,
            )
    if of is not None and module.SOURCE_SHA256 != of.SOURCE_SHA256:
        raise ModelError(
            "NumPy and CasADi module stem from different robot files; emit both again",
            file=module.__name__,
        )
    return cast(SymbolicModel, module)
