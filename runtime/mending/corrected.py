"""A study that corrects the robot needs the model of the corrected robot, and accepts no other."""

from __future__ import annotations

from typing import Any

from runtime.core.problem import Problem
from runtime.ground.errors import InputError
from runtime.mending.settings import digest


def corrected_model(problem: Problem) -> Problem:
    """Check that the model belongs to the robot as the study corrects it; change nothing.

    This is a step of the preparation of a problem.

    Raises
    ------
    InputError
        The model is that of the robot file, or of other corrections.
    """
    settings: Any = problem.settings
    wanted = digest(settings.robot)
    if not problem.model.SOURCE_SHA256.endswith(wanted):
        raise InputError(
            f"the study corrects the robot (section `robot`), but {problem.model.NAME} is not the "
            "model of the corrected robot; make it by symgen.model(symgen.corrected(robot, study))"
        )
    return problem
