"""Models for records whose torques are drive commands in A or V (`record.torque_constant: none`).

Torques are linear in the parameters, so such a fit is possible; each parameter then has the unit of
the robot file with A (or V) in place of N m, such as A*s**2/rad for an inertia. Parameters that act
on several joints are meaningful only if these joints have the same torque constant.
"""

from __future__ import annotations

import re
from typing import Any

from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel, joint_units
from runtime.core.problem import Problem
from runtime.ground.errors import InputError

INERTIAS = {"kg*m**2": "*s**2/rad", "kg*m": "*s**2/m", "kg": "*s**2/m"}
"""Units of inertias, as the rest behind the unit of the torque."""


class CommandModel:
    """A model whose torques are commands of the drives, in A or V.

    `UNITS` are in this unit. Values and torque limits of the robot file, in N m, are left out.

    Parameters
    ----------
    model : GeneratedModel
    unit : str
        A or V.
    """

    def __init__(self, model: GeneratedModel, unit: str) -> None:
        self._model, self.TORQUE_UNIT, self.VALUES = model, unit, dict[str, float]()
        self.JOINT_UNITS = joint_units(model)
        self.LIMITS = {name: x for name, x in model.LIMITS.items() if name != "tau"}
        units = getattr(model, "UNITS", {})
        self.UNITS = {name: in_commands(text, unit) for name, text in units.items()}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_model":  # pickle asks before there is a model
            raise AttributeError(name)
        return getattr(self._model, name)


def in_commands(text: str, unit: str) -> str:
    """Rewrite the unit `text` of a parameter in A or V: "N*m*s/rad" becomes "A*s/rad"."""
    if text in INERTIAS:
        return unit + INERTIAS[text]
    for torque in ("N*m", "N"):
        if text == torque or text.startswith((f"{torque}*", f"{torque}/")):
            return unit + text.removeprefix(torque)
    return text


def require_torques(fit: Estimate) -> None:
    """Raise InputError if an estimate is in A or V, as a robot file has kg, m and N only."""
    name, unit = next(((n, u) for n, u in fit.units.items() if re.match(r"[AV]\b", u)), ("", ""))
    if name:
        raise InputError(
            f"the estimate is in {unit[0]} ({name} in {unit}), but a robot file has SI units; set drives.torque_constant or record.torque_constant (N*m/A) and identify again"
        )


def commands_for_torques(problem: Problem) -> Problem:
    """Replace the model of a problem by its CommandModel if the records are in A or V.

    This is a step of the preparation of a problem. Raises InputError if some records are in N m and
    some are not.
    """
    records = (*problem.records, *problem.unseen)
    units = dict.fromkeys(record.origin.command or "N m" for record in records)
    if len(units) > 1:
        raise InputError(
            f"some records are in {', others in '.join(units)}; set the same record.torque_constant for all records"
        )
    unit = next(iter(units), "N m")
    if unit == "N m":
        return problem
    model: Any = CommandModel(problem.model, unit)
    return problem.changed(model=model)
