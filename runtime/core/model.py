"""Interface to emitted (generated) models: loading, checks, and data such as the joint units.

A model is a plain Python module written by the generator (NumPy only): `load_model("tx40")` loads
generated/tx40.py of the current folder. A module is code: a file runs only if this installation has
emitted and certified it, or with trust=True (`runtime.core.loading`).
"""

from __future__ import annotations

import ast
import copyreg
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast

import numpy as np

from runtime.core.drives import Drives
from runtime.core.loading import module_of, run
from runtime.ground.arrays import kind_of, require_kind
from runtime.ground.errors import InputError, ModelError, SettingsError

Array = np.ndarray

FOLDER = Path("generated")  # of the current folder
CONSTANTS = (
    "NAME",
    "JOINTS",
    "BASE_PARAMETERS",
    "STRUCTURE",
    "DRIVES",
    "LIMITS",
    "VALUES",
    "CONSTANTS",
    "SOURCE_SHA256",
)
TRANSMITTED = "tau_model"
"""Beginning of the channels that are torques of the model, before the number of the joint."""
OWN_KINDS = ("column", "dissipative")  # of the user's own columns
SLIDING = frozenset({"kg", "N", "N*s/m", "N/m"})  # units of elements along a joint that slides
SIGNED = ("inertia", "viscous", "coulomb", "dissipative")
"""Kinds of elements whose parameter is not negative."""
FUNCTIONS = (
    "store",
    "regressor",
    "observation_matrix",
)  # what identification needs; `require` checks others where they are used


class GeneratedModel(Protocol):
    """Interface of an emitted model with n joints and b base parameters, as `runtime` uses it.

    q, qd, qdd have shape (N, n). `require` checks that the functions of the dynamics exist.
    """

    NAME: str
    JOINTS: tuple[int, ...]
    BASE_PARAMETERS: tuple[str, ...]
    STRUCTURE: Array  # bool (b, n): False where the entry is identically zero
    DRIVES: Mapping[str, Any] | None
    LIMITS: Mapping[str, Any]
    VALUES: Mapping[str, float]
    CONSTANTS: Mapping[str, float]
    SOURCE_SHA256: str
    inverse_dynamics: Callable[..., Array]  # GAM (N, n) of q, qd, qdd, X
    inertia_matrix: Callable[..., Array]  # A (N, n, n) of q, X
    bias: Callable[..., Array]  # GAM (N, n) of q, qd, X
    gravity: Callable[..., Array]  # GAM (N, n) of q, X
    casadi: Callable[..., Any]  # casadi.Function of a function of the module, by name

    def store(self, N: int) -> Array:
        """Make a workspace array, shape (b, n, N), for argument `out` of the regressor functions.

        Entries that are always zero are already zero in this array.
        """

    def regressor(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float
    ) -> Array:
        """Compute the regressor D of the base parameters, shape (N, n, b): Gamma = D X, eq. (5)."""

    def observation_matrix(
        self, q: Array, qd: Array, qdd: Array, *, out: Array | None = None, **constants: float
    ) -> Array:
        """Compute the observation matrix W, shape (n*N, b), of Y = W X + rho, eq. (6).

        Rows are joint-major: first all samples of joint 1. The array is in Fortran order.
        """


def load_model(
    model: str | Path | ModuleType, *, folder: str | Path | None = None, trust: bool = False
) -> GeneratedModel:
    """Load an emitted (generated) robot model, and check it.

    Parameters
    ----------
    model : str, Path or module
        A name (for generated/NAME.py), the path of a .py file, or an imported module.
    folder : str or Path, optional
        Folder of the files for names; default: ./generated.
    trust : bool
        Whether to run a file that this installation has not emitted and certified: a module is code
        (`runtime.core.loading`).

    Raises
    ------
    ModelError
        There is no such file, it was not emitted here, or it is not a model.

    Examples
    --------
    >>> import runtime
    >>> tx40 = runtime.load_model("tx40")  # generated/tx40.py
    >>> len(tx40.BASE_PARAMETERS)
    60
    >>> tx40.FORMULAS["XZ2R"]
    'XZ2 - D3*MZ3'
    """
    require_kind(folder, (str, Path, type(None)), "folder", "the name of a folder")
    require_kind(trust, bool, "trust", "True or False")
    if isinstance(model, ModuleType):
        return checked_model(model)
    require_kind(
        model, (str, Path), "model", "the name or path of a generated module, or the module"
    )
    path = Path(model)
    if isinstance(model, str) and re.fullmatch(r"\w+", model):
        path = Path(folder or FOLDER) / f"{model}.py"
    if not os.path.isfile(path):  # noqa: PTH113 (a name of any length)
        present = (
            sorted(p.stem for p in path.parent.glob("*.py") if p.stem != "__init__")
            if path.parent.is_dir()
            else []
        )
        shown = " ".join(str(path).split("\n"))
        raise ModelError(
            f"there is no generated model {shown} ({path.parent} contains "
            f"{', '.join(present) or 'none'}); generate the model with "
            f"`symgen generate {Path(shown).stem}`"
        )
    return checked_model(module_of(path, trust=trust))


def require_emitted(model: Any, label: str = "model") -> None:
    """Raise InputError unless the argument `label` is an emitted model or has its interface."""
    if not all(hasattr(model, name) for name in ("NAME", "JOINTS", "DRIVES")):
        raise InputError(
            f"{label} is {kind_of(model)}; expected a generated model, such as symgen.model('arm.urdf') "
            "or runtime.load_model('arm.py')"
        )


def _reduced(module: ModuleType) -> tuple[Callable[..., ModuleType], tuple[Any, ...]]:
    """Return the function and the arguments from which pickle rebuilds a module in another process.

    An emitted module is sent as its text, as it was loaded.

    The receiving process trusts the sending process. Any other module is imported by its name.
    Raise InputError for an emitted module without a file, and for an emitted module whose file has
    changed since its import: the docstring has the hash of the text.
    """
    if not hasattr(module, "SOURCE_SHA256"):
        return import_module, (module.__name__,)
    file = getattr(module, "__file__", None)
    if not file:
        raise InputError(
            "other processes need a model that was loaded from a file, but this model was not; load the model from its file, or use one process"
        )
    loader = getattr(getattr(module, "__spec__", None), "loader", None)
    text = getattr(loader, "text", None)  # that runs here, whatever stands in the file by now
    if text is None:
        text = _text_as_loaded(Path(file), module)
    return run, (text, Path(file))


def _text_as_loaded(file: Path, module: ModuleType) -> str:
    """Read the text of a module that Python has imported from a file; raise InputError if the file
    has changed.
    """
    try:
        text = file.read_text(encoding="utf-8")
        same = ast.get_docstring(ast.parse(text), clean=False) == module.__doc__
    except (OSError, ValueError, SyntaxError):
        same = False
    if not same:
        raise InputError(
            "the file has changed since it was imported, so that other processes would run another "
            "model; start Python again, or use one process",
            file=str(file),
        )
    return text


copyreg.pickle(ModuleType, _reduced)


def checked_model(module: ModuleType) -> GeneratedModel:
    """Check a generated module, and return it as a model; raise ModelError if a check fails.

    The module needs all functions and names of a generated model. The shapes of its arrays must
    agree with its numbers of joints and base parameters.
    """
    label = module.__name__
    missing = [name for name in (*CONSTANTS, *FUNCTIONS) if not hasattr(module, name)]
    if missing:
        raise ModelError(
            f"the module has no {', '.join(missing)}; generate the module again "
            "with symgen generate",
            file=label,
        )
    model = cast(GeneratedModel, module)
    _check_names(model, label)
    require(model, *FUNCTIONS)
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    if n == 0 or b == 0 or len(set(model.BASE_PARAMETERS)) != b:
        raise ModelError(
            (
                f"{n} joints and {b} base parameters {model.BASE_PARAMETERS}; expected at least "
                "one joint and one parameter, each name once"
            ),
            file=label,
        )
    structure, rows = np.asarray(model.STRUCTURE), n + len(base_rows(model))
    if structure.shape != (b, rows) or structure.dtype != np.bool_:
        raise ModelError(
            (
                f"STRUCTURE is {structure.dtype} {structure.shape}; expected bool {(b, rows)}, base "
                "parameters by joints; generate the module again"
            ),
            file=label,
        )
    drives = drives_of(model)
    if drives is not None and drives.n != n:
        raise ModelError(
            f"DRIVES is for {drives.n} joints, but the model has {n}; generate the module again",
            file=label,
        )
    _check_store(model, b, n, label)
    return model


def base_rows(model: GeneratedModel) -> tuple[str, ...]:
    """Return the names of the rows of a free base, which an emitted model has before its joints.

    The rows are the force on frame 0, then the moment about its origin, in the axes of frame 0.
    """
    free = getattr(model, "BASE", "fixed") == "free"
    return ("FX0", "FY0", "FZ0", "NX0", "NY0", "NZ0") if free else ()


def require(model: GeneratedModel, *functions: str) -> None:
    """Raise ModelError unless the model has all the named functions."""
    missing = [name for name in functions if not callable(getattr(model, name, None))]
    if "forward_dynamics" in missing and any(c.startswith(TRANSMITTED) for c in channels_of(model)):
        raise ModelError(
            "the model has no function forward_dynamics, because friction laws depend on the "
            "torque tau_model and hence on the accelerations; remove these laws from "
            "the robot file",
            file=model.NAME,
        )
    if missing == ["casadi"]:
        raise ModelError(
            "the model has no function casadi(). If the loops of this robot are closed by "
            "iteration, CasADi cannot express the model; otherwise generate the module again with "
            "this version of symgen",
            file=model.NAME,
        )
    if missing:
        raise ModelError(
            f"the module has no function {', '.join(missing)}; generate the module again, with "
            "--target or --with for these functions",
            file=model.NAME,
        )


def drives_of(model: GeneratedModel) -> Drives | None:
    """Return the drives of a robot model; None for a model without drives."""
    return None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)


def channels_of(model: GeneratedModel) -> Mapping[str, tuple[str, ...]]:
    """Return, for each measured signal such as a temperature, the parameters that depend on it.

    A channel is a measured quantity in a law of the robot file, such as a temperature: a constant
    that is a function of time.
    """
    return cast(Mapping[str, tuple[str, ...]], getattr(model, "CHANNELS", {}))


def require_no_channels(model: GeneratedModel, what: str) -> None:
    """Raise InputError if the model needs signals besides the motion, such as a temperature.

    Such signals are called channels. what : name of the caller, which has no such signals.
    """
    if getattr(model, "BASE", "fixed") != "fixed":
        raise InputError(
            f"{what} is not possible for {model.NAME}, whose base moves; use a model with base: fixed"
        )
    if channels := channels_of(model):
        names = sorted({name for own in channels.values() for name in own})
        raise InputError(
            f"{what} does not have the measured signals {', '.join(channels)}, which the laws of "
            f"{', '.join(names)} of {model.NAME} need at every sample; remove these laws from the "
            "robot file"
        )


def require_no_axes(model: GeneratedModel, what: str) -> None:
    """Raise InputError if the model has axes that no motor moves: force sensors, or a free base.

    what : name of the caller.
    """
    if not any(is_axis(joint) for joint in model.JOINTS):
        return
    if base_rows(model):
        raise InputError(f"{what} does not support a free base; use the robot with --base moving")
    raise InputError(
        f"{what} does not support force sensors; remove record.columns.wrench from the study, or the "
        "channels wrench0 ... from the records"
    )


def joint_labels(model: GeneratedModel) -> tuple[str, ...]:
    """Return the labels of the joints in results: the number and perhaps the name, as in "2 elbow".

    The name is left out if it adds nothing, for instance "2" if the robot file names the joint
    "joint_2".
    """
    names = getattr(model, "LABELS", {})
    more = {
        j: f" {name}"
        for j, name in names.items()
        if isinstance(name, str) and not re.fullmatch(rf"(?i)(joint|axis|[ajq])[ _-]?0*{j}", name)
    }
    return tuple(f"{j}{more.get(j, '')}" for j in model.JOINTS)


def is_axis(joint: int | str) -> bool:
    """Whether an entry of JOINTS is an axis of a force sensor (`runtime.wrench`) or a free base."""
    return isinstance(joint, str)


def is_form(acts: Mapping[Any, float]) -> bool:
    """Whether an element on the joints, such as a spring, is given by a quadratic form q'Bq.

    Other elements act along a combination s = G q of joints.

    acts : coefficients of the element, one for each joint or, for a form, for each pair of joints.
    """
    return any(isinstance(key, tuple) for key in acts)


def elements_of(
    model: GeneratedModel, constants: Mapping[str, float] | None = None
) -> Mapping[str, Any]:
    """Return the elements on the joints (friction, motor inertia, springs), by parameter name.

    An element gives the kind of its parameter, and the direction of motion on which it acts, by
    joint.

    Parameters
    ----------
    model : GeneratedModel
    constants : mapping, optional
        Values in place of those of the robot file.

    Raises
    ------
    ModelError
        The model is of an older version, without this table.
    """
    table = "elements" if constants else "ELEMENTS"
    if not hasattr(model, table):
        raise ModelError(
            (
                f"the module has no table {table} of the directions along which friction acts; "
                "generate the module again with this version of symgen"
            ),
            file=model.NAME,
        )
    emitted = cast(Any, model)
    return cast(Mapping[str, Any], emitted.elements(**constants) if constants else emitted.ELEMENTS)


def base_columns(
    model: GeneratedModel, names: str | Sequence[str], essential: Sequence[str], *path: str
) -> tuple[str, ...]:
    """Return the base parameters that a setting selects: the essential, all, or the named ones.

    names : value of the setting: "essential", "all" or names. path : keys of the setting. Raise
    SettingsError for a name that is not a base parameter.
    """
    wanted = (
        {"essential": essential, "all": model.BASE_PARAMETERS}[names]
        if isinstance(names, str)
        else names
    )
    if unknown := [name for name in wanted if name not in model.BASE_PARAMETERS]:
        raise SettingsError(
            (
                f"no parameter {', '.join(unknown)}; {model.NAME} has "
                f"{', '.join(model.BASE_PARAMETERS)}"
            ),
            path=path,
        )
    return tuple(wanted)


def joint_units(model: GeneratedModel) -> tuple[str, ...]:
    """Return the unit of each joint position, "rad" or "m", in the order of JOINTS.

    A joint is prismatic if an element of this joint alone (friction, spring, motor inertia) has the
    unit of a prismatic joint. A joint without such elements is prismatic if no moment of inertia
    acts on it, since a force depends on masses and first moments only. Units of user-defined
    columns are not used.
    """
    if stated := getattr(model, "JOINT_UNITS", ()):  # of a model that is not emitted
        return cast(tuple[str, ...], stated)
    units, elements = getattr(model, "UNITS", {}), getattr(model, "ELEMENTS", {})
    result = []
    for row, joint in enumerate(model.JOINTS, start=len(base_rows(model))):
        acting = [name for k, name in enumerate(model.BASE_PARAMETERS) if model.STRUCTURE[k, row]]
        own = {
            units.get(name, "")
            for name in acting
            if set((element := elements.get(name.removesuffix("R"), (0, 0, ())))[2]) == {joint}
            and element[0] not in OWN_KINDS
        }
        slides = (
            bool(own & SLIDING) if own else not any(units.get(name) == "kg*m**2" for name in acting)
        )
        result.append("m" if slides else "rad")
    return tuple(result)


def joint_torque_units(model: GeneratedModel) -> tuple[str, ...]:
    """Return the unit of each joint torque: N m, N, or A or V of a CommandModel."""
    command = getattr(model, "TORQUE_UNIT", "")
    return tuple(command or {"rad": "N m", "m": "N"}[unit] for unit in joint_units(model))


def _check_names(model: GeneratedModel, label: str) -> None:
    """Raise ModelError unless all names of the model are identifiers and all joints whole numbers.

    These names are used in messages, tables, file names and symbols of compiled files.
    """
    names = (model.NAME, *model.BASE_PARAMETERS)
    if wrong := [
        name
        for name in names
        if not (isinstance(name, str) and re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII))
    ]:
        raise ModelError(
            f"NAME or BASE_PARAMETERS contain {wrong[0]!r:.60}; expected names of letters, digits "
            "and _, with a letter first",
            file=label,
        )
    if strange := [j for j in model.JOINTS if type(j) is not int or j < 1]:
        raise ModelError(
            f"JOINTS contain {strange[0]!r:.60}; expected joint numbers from 1", file=label
        )


def _check_store(model: GeneratedModel, b: int, n: int, label: str) -> None:
    """Evaluate the model for two samples at rest; raise ModelError if an array has a wrong shape.

    A robot with closed loops is evaluated at the start position of its loops.
    """
    N = 2
    rest = np.zeros((N, n))
    q = rest + getattr(model, "_START", rest[0])[:n]
    states = (np.zeros((N, 9)),) * hasattr(model, "BASE") + (q, rest, rest)
    try:
        shape = np.shape(model.store(N))
        with np.errstate(all="ignore"):
            shapes = (
                np.shape(model.regressor(*states)),
                np.shape(model.observation_matrix(*states)),
            )
    except Exception as e:  # whatever a broken file raises becomes one kind of error
        raise ModelError(
            f"the regressor fails at two samples at rest with {type(e).__name__}: {e}; generate "
            "the module again",
            file=label,
        ) from e
    n += len(base_rows(model))
    if shape != (b, n, N):
        raise ModelError(f"store({N}) has shape {shape}; expected {(b, n, N)}", file=label)
    if shapes != ((N, n, b), (n * N, b)):
        raise ModelError(
            (
                f"regressor {shapes[0]}, observation_matrix {shapes[1]}; expected {(N, n, b)} and "
                f"{(n * N, b)}"
            ),
            file=label,
        )


def check_states(model: GeneratedModel, **states: Array) -> None:
    """Raise InputError unless the states (q, qd, ...) are real arrays of one shape, (N, n) or (n,).

    n is the number of joints of the model.
    """
    n = len(model.JOINTS)
    first, shape = next((name, np.shape(x)) for name, x in states.items())
    for name, x in states.items():
        x = np.asarray(x)
        if x.ndim not in (1, 2) or x.shape[-1] != n or x.shape != shape:
            raise InputError(
                f"{model.NAME}: {name} has shape {x.shape}, {first} {shape}; expected (N, {n}) or "
                f"({n},), the same for {', '.join(states)}"
            )
        if not np.issubdtype(x.dtype, np.floating) and not np.issubdtype(x.dtype, np.integer):
            raise InputError(f"{model.NAME}: {name} has dtype {x.dtype}; expected real numbers")


class BoundModel:
    """A model in which new values replace some constants of the robot file.

    Every function of the model has the new values as default arguments.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    constants : mapping of str to float
        New values of some constants of the module, by name.
    """

    def __init__(self, model: GeneratedModel, constants: Mapping[str, float]) -> None:
        self._model, self._given = model, dict(constants)
        self.CONSTANTS = {**model.CONSTANTS, **constants}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        value = getattr(self._model, name)
        if name == "ELEMENTS":
            return self._model.elements(**self._given)  # type: ignore[attr-defined]
        if not callable(value) or isinstance(value, type):
            return value
        own = signature(value).parameters
        rest = any(p.kind is p.VAR_KEYWORD for p in own.values())
        return partial(value, **{key: x for key, x in self._given.items() if rest or key in own})
