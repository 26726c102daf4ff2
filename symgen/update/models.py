"""The model of a robot for a study, with the corrections of the study and the columns of its force
sensors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.study import Study
    from symgen.description import Robot


def model_of(robot: Robot | GeneratedModel, *, study: Study | None = None) -> GeneratedModel:
    """Return the model of a robot; a generated module is its own model.

    study : if its records name wrenches, the model of a fixed robot has the columns of force sensors.
    """
    from runtime.core.model import load_model
    from symgen.certify.requests import model
    from symgen.description import Robot

    if not isinstance(robot, Robot):
        return robot
    records = () if study is None or robot.base_moves else study.record
    options = ("base_wrench_regressor",) * any(record.columns.wrench for record in records)
    return load_model(model(robot, options=options))


def corrected(robot: Robot | GeneratedModel, study: Study) -> Robot | GeneratedModel:
    """Replace entries of a robot by those of the section `robot` of a study, if it has one.

    A generated module stays as it is: a later step refuses the study unless the module has its
    corrections.
    """
    from symgen.description import Robot
    from symgen.description.corrected import corrected

    return corrected(robot, study) if isinstance(robot, Robot) else robot


def variants_of(robot: Robot | GeneratedModel) -> GeneratedModel | None:
    """Load the model of a robot as a module in which the frame table can be changed.

    Return None for a generated module, which has no robot file.
    """
    from runtime.core.model import load_model
    from symgen.certify.variants import variants
    from symgen.description import Robot

    return load_model(variants(robot)) if isinstance(robot, Robot) else None
