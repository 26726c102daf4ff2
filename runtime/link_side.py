"""Fit torques measured behind the gears, without friction and inertia of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from runtime.core.model import elements_of
from runtime.core.problem import Problem
from runtime.core.settings import require

OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


def torques_of_links(problem: Problem) -> Problem:
    """Leave friction and inertia of drives out of the fit if torques are measured behind gears.

    This is a step of the preparation of a problem. It acts only if estimate.columns is all.
    """
    settings: Any = problem.settings
    if settings.estimate.columns != "all" or not _behind_gears(
        [*settings.record, *settings.validate.record]
    ):
        return problem
    kinds = {name: element[0] for name, element in elements_of(problem.model).items()}
    columns = tuple(
        name for name in problem.model.BASE_PARAMETERS if kinds.get(name) not in OF_DRIVES
    )
    estimate = replace(settings.estimate, columns=columns)
    return problem.changed(settings=replace(settings, estimate=estimate))


def _behind_gears(records: Sequence[Any]) -> bool:
    """Whether the settings of the records say that torques are measured behind the gears.

    SettingsError if this is true for one record and false for another.
    """
    sides = {record.sides[1] == "link" for record in records}
    message = "link in one record and not in another; fit them in studies of their own"
    require(len(sides) < 2, message, "record", 0, "torque_side")
    return True in sides
