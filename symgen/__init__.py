"""From a robot file to base parameters with their formulas, and to a module that evaluates its models.

    robot = load_robot("tx40")                  # packaged, or a path to a robot file
    regrouping = regroup(robot)                 # base parameters, each with its formula
    certify(regrouping).valid                   # exact rank and identities
    text = generate_module(robot)               # source of the module

Names are loaded when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from symgen.errors import SymgenError

if TYPE_CHECKING:
    from symgen.description import Robot, load_robot, packaged_robots, parse_robot
    from symgen.emit import generate_module
    from symgen.regroup.certificate import Certificate, certify
    from symgen.regroup.regrouping import BaseParameter, Regrouping, regroup

__all__ = [
    "BaseParameter",
    "Certificate",
    "Regrouping",
    "Robot",
    "SymgenError",
    "certify",
    "generate_module",
    "load_robot",
    "packaged_robots",
    "parse_robot",
    "regroup",
]

_HOME = {
    **dict.fromkeys(("Robot", "load_robot", "packaged_robots", "parse_robot"), "symgen.description"),
    **dict.fromkeys(("BaseParameter", "Regrouping", "regroup"), "symgen.regroup.regrouping"),
    **dict.fromkeys(("Certificate", "certify"), "symgen.regroup.certificate"),
    "generate_module": "symgen.emit",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'symgen' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
