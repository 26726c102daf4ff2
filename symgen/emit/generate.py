"""From a robot to its source files: derive the models, regroup the parameters, write the code."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from symgen.derive.loops import close
from symgen.derive.models import OPTIONS
from symgen.description.files import robot_of
from symgen.description.robot import Robot
from symgen.emit import c_target, matlab_target, python_target
from symgen.emit.c_target import C
from symgen.emit.matlab_target import MATLAB
from symgen.emit.printers import PYTHON, Language
from symgen.emit.spec import ModuleSpec, module_spec, spec_of
from symgen.emit.targets import TARGETS
from symgen.errors import SymgenError, require, require_names
from symgen.regroup.regrouping import Regrouping


class Emitter(NamedTuple):
    """Code generator for one kind of file, such as C: its language and its writing function.

    A function `render` that returns {function: text} writes a file for each function.
    """

    language: Language
    render: Callable[..., str | Mapping[str, str]]


_PYTHON = Emitter(PYTHON, python_target.render)
EMITTERS = {
    "numpy": _PYTHON,
    "casadi": _PYTHON,
    "xp": _PYTHON,
    "c": Emitter(C, c_target.render),
    "h": Emitter(C, c_target.render_header),
    "matlab": Emitter(MATLAB, matlab_target.render),
}


def generate_module(robot: str | Path | Robot, *, command: str | None = None) -> str:
    """Return the source text of the NumPy module of a robot.

    Parameters
    ----------
    robot : str, Path or Robot
        As for `symgen.model`.
    command : str, optional
        As for `generate_files`.

    Examples
    --------
    >>> import symgen
    >>> text = symgen.generate_module("planar_2r")
    >>> "def regressor(" in text
    True
    """
    robot = robot_of(robot)
    require(command, (str, type(None)), "command", "the argument of `symgen generate`, a text")
    return generate_files(robot, command=command)[TARGETS["numpy"].file.format(robot.name)]


def generate_files(
    robot: Robot,
    *,
    targets: Sequence[str] = ("numpy",),
    command: str | None = None,
    regrouping: Regrouping | None = None,
    options: Sequence[str] = (),
) -> dict[str, str]:
    """Return the source texts of a robot's files for the given targets, such as numpy or c.

    Parameters
    ----------
    robot : Robot
        The robot.
    targets : sequence of str
        Names of targets, such as python and c. A target that cannot serve the robot is left out.
    command : str, optional
        Argument of `symgen generate` that the header of the files shows. Default: the file of the
        robot.
    regrouping : Regrouping, optional
        Base parameters of `robot`. Default: derived.
    options : sequence of str
        Names of models that are written only on request, among `symgen.derive.models.OPTIONS`.

    Returns
    -------
    dict
        {file name: text}. The same robot file and the same version give the same bytes.
    """
    require_names(targets, TARGETS, "targets")
    require_names(options, OPTIONS, "options")
    _require_base(robot, targets)
    spec: ModuleSpec = (
        spec_of(robot, tuple(options)) if regrouping is None else module_spec(regrouping, options)
    )
    targets = [*targets, *["h"] * ("c" in targets)]
    served = [name for name in targets if TARGETS[name].iterates or not spec.tied]
    files: dict[str, str] = {}
    for pattern, name in {TARGETS[name].file: name for name in served}.items():
        made = EMITTERS[name].render(spec, command=command)
        texts = {"": made} if isinstance(made, str) else made
        files |= {pattern.format(robot.name, function): text for function, text in texts.items()}
    return files


def _require_base(robot: Robot, targets: Sequence[str]) -> None:
    """Raise SymgenError if the models of the robot on its base cannot be written for a target."""
    if robot.base_moves and close(robot).tied:
        raise SymgenError(
            f"{robot.name}: loops that are closed by iteration are not possible on a base that "
            "moves; use passive joints that have formulas, or base: fixed"
        )
    able = [name for name, target in TARGETS.items() if robot.base in target.bases]
    if refused := [name for name in targets if name not in able]:
        raise SymgenError(
            f"{robot.name}: the target {refused[0]} has no models of a robot with base: "
            f"{robot.base}; use {', '.join(able) or 'base: fixed'}"
        )
