"""Derive base parameters and their formulas from a robot file, and generate its dynamic models.

    model = symgen.model("arm.urdf")                      # the module, certified and imported
    base = symgen.regrouping(symgen.load_robot("tx40"))   # base parameters with their formulas
    symgen.certificate(base).valid                        # formulas proved, torques = Lagrange's
    symgen.apply("results", "arm.urdf").write("new.urdf") # identified values into your own file
    symgen.symbolic("tx40").inertia_matrix()              # any model as SymPy objects
    symgen.corrected("arm.urdf", study)                   # the robot with the corrections of a study
    symgen.variants("arm.urdf")                           # module with the frame table as constants

Names are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from symgen.errors import SymgenError

if TYPE_CHECKING:
    from symgen.certify.certificate import Certificate
    from symgen.certify.modules import certify as certificate
    from symgen.certify.requests import model
    from symgen.certify.variants import variants
    from symgen.description import Robot, load_robot, packaged_robots, parse_robot
    from symgen.description.corrected import corrected
    from symgen.emit.generate import generate_module
    from symgen.regroup.reasons import Absorption, BaseDifference, absorptions, base_difference
    from symgen.regroup.regrouping import BaseParameter, Regrouping
    from symgen.regroup.regrouping import regroup as regrouping
    from symgen.symbols.symbolic import SymbolicRobot, symbolic
    from symgen.update.applied import Applied
    from symgen.update.apply import apply

__all__ = [
    "Absorption",
    "Applied",
    "BaseDifference",
    "BaseParameter",
    "Certificate",
    "Regrouping",
    "Robot",
    "SymbolicRobot",
    "SymgenError",
    "absorptions",
    "apply",
    "base_difference",
    "certificate",
    "corrected",
    "generate_module",
    "load_robot",
    "model",
    "packaged_robots",
    "parse_robot",
    "regrouping",
    "symbolic",
    "variants",
]

_HOME = {
    **dict.fromkeys(
        ("Robot", "load_robot", "packaged_robots", "parse_robot"), "symgen.description"
    ),
    **dict.fromkeys(("BaseParameter", "Regrouping", "regrouping"), "symgen.regroup.regrouping"),
    **dict.fromkeys(
        ("Absorption", "BaseDifference", "absorptions", "base_difference"), "symgen.regroup.reasons"
    ),
    "certificate": "symgen.certify.modules",
    "corrected": "symgen.description.corrected",
    "model": "symgen.certify.requests",
    **dict.fromkeys(("SymbolicRobot", "symbolic"), "symgen.symbols.symbolic"),
    "Certificate": "symgen.certify.certificate",
    "generate_module": "symgen.emit.generate",
    "Applied": "symgen.update.applied",
    "apply": "symgen.update.apply",
    "variants": "symgen.certify.variants",
}
_OWN = {"regrouping": "regroup", "certificate": "certify"}  # names of rooms, at home


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'symgen' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), _OWN.get(name, name))


def __dir__() -> list[str]:
    return sorted(__all__)
