"""The command `symgen excite ROBOT [RECORD]`: search for an exciting motion within the limits."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from symgen.cli import options, session
from symgen.update.models import corrected, model_of


def excite(
    robot: options.RobotOrModule,
    record: Annotated[
        str | None,
        typer.Argument(
            help="Dataset, study file or measured file. symgen first identifies parameters and "
            "torque noise from this record, and then compares the new motion with "
            "the recorded one."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        options.folder(
            "trajectory.csv, joint_trajectory.yaml (ROS), motion.yaml (or poses.csv), "
            "excitation.json, report.html, the figure"
        ),
    ] = None,
    poses: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Choose this number of static poses, which identify the gravity parameters, instead of a motion.",
        ),
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option(
            help="Criterion of the motion: cond minimises the condition number of the observation "
            "matrix W, logdet maximises the determinant of W'W, sigma minimises the largest "
            "standard deviation of a parameter, in %. record minimises the largest ratio of the standard "
            "deviation of a parameter with the new motion to that with the motion of RECORD. "
            "Default: record if RECORD is given, else cond."
        ),
    ] = None,
    columns: options.Columns = None,
    starts: Annotated[
        int | None, typer.Option(min=1, help="Number of random starts of the search.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Controller rate, Hz.")] = None,
    seed: options.Seed = None,
    workers: options.Workers = 0,
    trust: options.Trust = False,
    exact: options.Exact = False,
    json: options.Json = False,
) -> None:
    """Search for an exciting motion, from which the parameters of ROBOT can be identified well. Kind
    and limits of the motion are settings of the section `excitation` of a study file.

    With --poses, search for poses at rest, which identify the parameters of gravity.

    Without RECORD, or with a study file that names none, the parameters are the values of the robot
    file.
    """
    with session.results_in(output) as results:
        import runtime
        from runtime.compose import records_of
        from runtime.ground.documents import json_text
        from runtime.parallel.processes import processes

        described = session.robot_of(robot, trust=trust, exact=exact)
        study = session.changed(
            session.study_of_arguments([record], recorded=False) if record else runtime.Study(),
            excitation={
                "poses": poses,
                "criterion": criterion,
                "columns": session.names_of(columns),
                "starts": starts,
                "rate": rate,
                "seed": seed,
            },
        )
        model = model_of(corrected(described, study))
        records = records_of(study.record, model, study)
        with session.progress_bar("starts") as progress, processes(workers) as own_map:
            seek: Any = partial(runtime.excite, map=own_map, progress=progress)
            still = study.excitation is not None and study.excitation.poses is not None
            result = (runtime.static_poses if still else seek)(model, records, study)
        if results is not None:
            runtime.report(result, results)
        text = json_text(result.summary()) if json else result.to_table()
        session.show(text, results, json=json)
