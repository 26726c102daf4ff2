"""Table of all kinds of elements on the joints, such as viscous friction, with laws and units.

A new kind is one entry in KINDS (docs/contributing.md).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from symgen.description.expression import Expression
from symgen.description.grammar import LAWS, parse

JOINT_FAMILIES = ("Ia", "FV", "FS", "OFFSET")  # after the inertial ones of eq. (4), link by link


class Kind(NamedTuple):
    """One kind of element on the joints, such as viscous friction: law, units and allowed options.

    Attributes
    ----------
    law : str
        Torque along the coordinate s for the parameter value 1; q, qd, qdd mean s, sd, sdd.
    units : tuple of str
        Units of the parameter for a revolute and for a prismatic joint.
    meaning : str
        Name of the kind in words.
    dissipative : bool
        Whether the parameter cannot be negative, because the element takes power from the motion.
    form, when : bool
        Whether an element of this kind may have `form` and `when`.
    fit : mapping
        Default scalars of the law, as a file gives them. A file may give other values.
    """

    law: str
    units: tuple[str, str]
    meaning: str
    dissipative: bool = False
    form: bool = False
    when: bool = False
    fit: Mapping[str, Any] = {}

    @property
    def torque(self) -> Expression:
        return parse(self.law, None, LAWS)


SLOW = {"vs": {"bounds": [0.002, 5], "start": 0.1}}  # rad/s or m/s
KINDS = {
    "inertia": Kind("qdd", ("kg*m**2", "kg"), "inertia of the actuator", form=True),
    "viscous": Kind(
        "qd", ("N*m*s/rad", "N*s/m"), "viscous friction", dissipative=True, form=True, when=True
    ),
    "coulomb": Kind("sign(qd)", ("N*m", "N"), "Coulomb friction", dissipative=True, when=True),
    "offset": Kind("1", ("N*m", "N"), "constant torque or force"),
    "stiffness": Kind("q", ("N*m/rad", "N/m"), "stiffness", form=True),
    "cubic": Kind("qd**3", ("N*m*s**3/rad**3", "N*s**3/m**3"), "cubic friction", dissipative=True),
    "stribeck": Kind(
        "sign(qd)*exp(-(abs(qd)/vs)**delta)",
        ("N*m", "N"),
        "friction of slow motion beyond Coulomb's",
        fit={**SLOW, "delta": 2},
    ),
    "tanh": Kind(
        "tanh(qd/vs)", ("N*m", "N"), "smooth Coulomb friction", dissipative=True, fit=SLOW
    ),
    "sigmoid": Kind(
        "1/(1 + exp(-(qd + vo)/vs)) - 1/(1 + exp(-vo/vs))",
        ("N*m", "N"),
        "Coulomb friction as a sigmoid of the velocity",
        dissipative=True,
        fit={**SLOW, "vo": 0},
    ),
    "load_dependent": Kind(
        "abs(tau_model)*sign(qd)",
        ("1", "1"),
        "Coulomb friction per transmitted torque",
        dissipative=True,
    ),
    "cogging": Kind(
        "sin(order*q + phase)", ("N*m", "N"), "cogging of the motor", fit={"order": 1, "phase": 0}
    ),
    "column": Kind("0", ("", ""), "column of the robot file"),
    "dissipative": Kind("0", ("", ""), "friction of the robot file", dissipative=True),
}
OWN_LAWS = ("column", "dissipative")  # kinds whose law the file gives
STATE = re.compile(r"(q|qd|qdd)([1-9][0-9]*)?\Z")
"""Names of a law: of s and its rates, and of those of a joint."""
CHANNEL = "channel."
"""Before the name of a function of time in a law: a constant whose value the record gives."""
TRANSMITTED = "tau_model"
"""In a law, the torque that the rest of the model transmits at its joint: channel.tau_model3."""
USUAL_KINDS = dict(zip((*JOINT_FAMILIES, "K"), KINDS, strict=False))
