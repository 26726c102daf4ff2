"""Emission: from base parameters to the text of a module."""

from symgen.description.robot import Robot
from symgen.emit.render import render
from symgen.emit.spec import module_spec
from symgen.regroup.regrouping import regroup

__all__ = ["generate_module"]


def generate_module(robot: Robot, *, command: str | None = None) -> str:
    """Text of the NumPy module of `robot`: derive, regroup, lay out."""
    return render(module_spec(regroup(robot)), command=command)
