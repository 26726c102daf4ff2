"""Torques measured behind the gears: the columns of the drives have no part in them."""

from __future__ import annotations

from dataclasses import replace

from runtime.core.model import elements_of
from runtime.core.problem import Problem
from runtime.reading.settings import behind_gears

OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


def torques_of_links(problem: Problem) -> Problem:
    """The step: all columns but those of the drives, where records name sensors behind the gears."""
    settings = problem.settings
    if settings.estimate.columns != "all" or not behind_gears(
        [*settings.record, *settings.validate.record]
    ):
        return problem
    kinds = {name: element[0] for name, element in elements_of(problem.model).items()}
    columns = tuple(
        name for name in problem.model.BASE_PARAMETERS if kinds.get(name) not in OF_DRIVES
    )
    estimate = replace(settings.estimate, columns=columns)
    return problem.changed(settings=replace(settings, estimate=estimate))
