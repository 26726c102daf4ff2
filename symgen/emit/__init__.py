"""Emission: from base parameters to the text of a module."""

from collections.abc import Sequence

from symgen.description.robot import Robot
from symgen.emit.c_target import has_c_target
from symgen.emit.casadi_target import CasadiText
from symgen.emit.render import render, render_c, render_casadi, render_xp
from symgen.emit.spec import module_spec
from symgen.regroup.regrouping import Regrouping, regroup

__all__ = ["TARGETS", "generate_files", "generate_module"]

TARGETS = ("numpy", "casadi", "c", "xp")


def generate_module(robot: Robot, *, command: str | None = None) -> str:
    """Text of the NumPy module of `robot`: derive, regroup, lay out."""
    return render(module_spec(regroup(robot)), command=command)


def generate_files(
    robot: Robot, *, targets: Sequence[str] = ("numpy",), command: str | None = None, regrouping: Regrouping | None = None
) -> dict[str, str]:
    """{file name: text} of every target; CasADi, C and xp are left out where the joints are tied by closure equations alone.

    regrouping : that of `robot`, where it is known already.
    """
    regrouping, files = regrouping or regroup(robot), {}
    spec = module_spec(regrouping)
    for target in targets:
        if target == "numpy":
            files[f"{robot.name}.py"] = render(spec, command=command)
        elif target == "casadi" and not spec.tied:
            files[f"{robot.name}_casadi.py"] = render_casadi(module_spec(regrouping, CasadiText), command=command)
        elif target == "c" and has_c_target(robot):
            files[f"{robot.name}.c"] = render_c(spec, command=command)
        elif target == "xp" and not spec.tied:
            files[f"{robot.name}_xp.py"] = render_xp(spec, command=command)
    return files
