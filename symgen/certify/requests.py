"""Python modules of robots: from the cache if the same module was requested before, or else
derived.

A folder of the cache is named after a request: the content of a robot, the options, and the source
files of symgen. The folder contains an empty folder, whose name is that of the text that answers
the request. So a module is found without a derivation, and never belongs to another robot, option
or version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from symgen.certify.importing import (
    entry,
    imported,
    is_certified,
    key_of,
    without_certificate,
)
from symgen.derive.models import OPTIONS
from symgen.description.bodies import impossible_links
from symgen.description.expression import Expression
from symgen.description.files import on_base, robot_of
from symgen.description.mounts import mounts
from symgen.description.robot import Robot
from symgen.errors import require_names
from symgen.version import VERSION


def model(
    robot: str | Path | Robot, *, options: Sequence[str] = (), base: str | None = None
) -> ModuleType:
    """Derive, certify and import the Python module of a robot.

    A module that is already in the cache is neither derived nor certified again.

    Parameters
    ----------
    robot : str, Path or Robot
        Name of a packaged robot, path of a robot file (.yaml, .par, .urdf, MJCF), or a Robot.
    options : sequence of str
        Names of functions on request, as for `symgen generate --with`.
    base : str, optional
        `moving` or `fixed`, as for `load_robot`.

    Returns
    -------
    module
        The imported module. Other processes can load its file `__file__` as long as this process
        lives.

    Raises
    ------
    DescriptionError
        The file cannot be read or describes no robot.
    CertificateError
        The certificate does not hold.

    Examples
    --------
    >>> import symgen
    >>> arm = symgen.model("planar_2r")
    >>> arm.FORMULAS["ZZ1R"]
    'ZZ1 + Ia1 + D2**2*M2'
    >>> X = arm.base_parameters(arm.VALUES)  # of the values in the robot file
    >>> q, qd, qdd = [0.5, 0.2], [0, 0], [0, 0]
    >>> arm.inverse_dynamics(q, qd, qdd, X).round(3)
    array([16.765,  3.702])
    >>> (arm.regressor(q, qd, qdd) @ X).round(3)
    array([16.765,  3.702])
    """

    def derived(robot: Robot) -> Path:
        from symgen.certify.modules import certified_path  # slow to load

        return certified_path(robot, options)

    require_names(options, OPTIONS, "options")
    return module_of(on_base(robot_of(robot), base), options, derived)


def module_of(robot: Robot, request: object, derived: Callable[[Robot], Path]) -> ModuleType:
    """Import a module of a robot from the cache, or else from the path that `derived` returns.

    The module gets the named places of the robot, MOUNTS (`symgen.description.mounts`).

    `request` : the rest of the request besides the robot, such as the options. The derivation warns
      of
    inertias that no body can have, so that a robot with such inertias is always derived.
    """
    module = _module_of(robot, request, derived)
    module.MOUNTS = mounts(robot)  # type: ignore[attr-defined]
    return module


def _module_of(robot: Robot, request: object, derived: Callable[[Robot], Path]) -> ModuleType:
    asked = entry(f"{VERSION} {_sources()} {_written(request)} {_written(robot)}")
    if asked is None:
        return imported(derived(robot))
    asked = asked.with_name(f"asked-{asked.name}")  # no text has such a name
    path = None if impossible_links(robot) else _answer(asked, f"{robot.name}.py")
    if path is None:
        path = derived(robot)
        if path.is_relative_to(asked.parent):
            with suppress(OSError):  # no right to write, full
                (asked / path.parent.name).mkdir(parents=True, exist_ok=True, mode=0o700)
    return imported(path)


def _written(value: Any) -> str:
    """Write a value, such as a Robot, as a text that differs for different values.

    The text is the same in every process, because sets are sorted.
    """
    if isinstance(value, Expression):
        return f"Expression({_written(value.terms)})"
    if is_dataclass(value):
        entries = (f"{f.name}={_written(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(entries)})"
    if isinstance(value, Mapping):
        entries = (f"{_written(key)}: {_written(x)}" for key, x in value.items())
        return f"{{{', '.join(entries)}}}"
    if isinstance(value, frozenset | set):
        return f"set({', '.join(sorted(map(_written, value)))})"
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_written, value))})"
    return repr(value)


@lru_cache(maxsize=1)
def _sources() -> str:
    """List the source files of symgen with their sizes and times of change.

    A version in development changes its files, but not its number.
    """
    folder = Path(__file__).parents[1]
    files = sorted(path for kind in ("py", "jinja") for path in folder.rglob(f"*.{kind}"))
    states = ((path.relative_to(folder), path.stat()) for path in files)
    return " ".join(f"{path} {state.st_size} {state.st_mtime_ns}" for path, state in states)


def _answer(asked: Path, file: str) -> Path | None:
    """Return the path of the cached file that answers the request of the folder `asked`.

    Return None if the request is new, or if the file is not the one that was certified.
    """
    try:
        (answer,) = asked.iterdir()
        path = asked.parent / answer.name / file
        text = path.read_bytes().decode("utf-8")
    except (OSError, UnicodeError, ValueError):
        return None
    right = answer.name == key_of(without_certificate(text)) and is_certified(text)
    return path if right else None
