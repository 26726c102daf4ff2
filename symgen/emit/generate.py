"""From a robot to the files of its targets: derive, regroup, lay out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

from symgen.description.robot import Robot
from symgen.emit import c_target, casadi_target, numpy_target, xp_target
from symgen.emit.spec import ModuleSpec, module_spec
from symgen.emit.targets import TARGETS
from symgen.regroup.regrouping import Regrouping, regroup

PRINTERS: dict[str, Callable[[ModuleSpec, str | None], str]] = {
    "numpy": lambda spec, command: numpy_target.render(spec, command=command),
    "casadi": lambda spec, command: casadi_target.render(spec.regrouping, command=command),
    "c": lambda spec, command: c_target.render(spec, command=command),
    "xp": lambda spec, command: xp_target.render(spec, command=command),
}


def generate_module(robot: Robot, *, command: str | None = None) -> str:
    """Text of the NumPy module of `robot`."""
    return generate_files(robot, command=command)[TARGETS["numpy"].file.format(robot.name)]


def generate_files(
    robot: Robot, *, targets: Sequence[str] = ("numpy",), command: str | None = None, regrouping: Regrouping | None = None
) -> dict[str, str]:
    """Texts of the files of a robot.

    Parameters
    ----------
    robot : Robot
        The robot.
    targets : sequence of str
        Among TARGETS; one that does not serve a robot is left out.
    command : str, optional
        What the header gives as argument of `symgen generate`; the file of the robot where left out.
    regrouping : Regrouping, optional
        Base parameters of `robot`; derived where left out.

    Returns
    -------
    dict
        {file name: text}. Same robot file, same version: same bytes.
    """
    spec = derived(robot) if regrouping is None else module_spec(regrouping)
    served = [name for name in targets if TARGETS[name].iterates or not spec.tied]
    return {TARGETS[name].file.format(robot.name): PRINTERS[name](spec, command) for name in served}


@lru_cache(maxsize=2)
def derived(robot: Robot) -> ModuleSpec:
    """The models of a robot over its base parameters; kept, since its module and its C file are asked for one after the other."""
    return module_spec(regroup(robot))
