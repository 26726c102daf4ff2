"""`symgen excite ROBOT [RECORD]`: a motion that lets the parameters be identified as well as the limits of the robot allow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.result_files import reserved
from symgen.cli import session
from symgen.cli.session import ROBOT, reported_errors, single_thread


def excite(
    robot: Annotated[str, typer.Argument(help=ROBOT)],
    record: Annotated[
        str | None,
        typer.Argument(
            help="Dataset, study file or measured file: its estimate gives parameters and torque deviations, its motion is compared."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for trajectory.csv, motion.yaml, excitation.json, report.html, the figure."),
    ] = None,
    criterion: Annotated[str | None, typer.Option(help="record, cond, logdet or sigma; default: record where there is one.")] = None,
    columns: Annotated[str | None, typer.Option(help="essential, all, or names separated by commas.")] = None,
    starts: Annotated[int | None, typer.Option(min=1, help="Random starts.")] = None,
    rate: Annotated[float | None, typer.Option(help="Controller rate, Hz.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the starts.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes, this one among them. The results do not depend on it.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print excitation.json instead of tables.")] = False,
) -> None:
    """Search an exciting motion. Families, limits and distances: section `excitation` of a study file.

    Without RECORD, or with a study file that names none, parameters are the values of the robot file.
    """
    single_thread()
    given: dict[str, Any] = {"criterion": criterion, "columns": session.names_of(columns), "starts": starts, "rate": rate, "seed": seed}
    with reported_errors(), reserved(output) as results:
        import runtime
        from runtime.json_documents import json_text
        from runtime.records.reading import read_records
        from runtime.settings.study import Study

        model = session.model_of(robot)
        study = Study() if record is None else session.study_of_arguments([record], recorded=False)
        study = session.changed(study, "excitation", **given)
        records = read_records(study.record, model, missing=study.signals.admits_missing)
        with session.progress_bar("starts") as progress:
            result = runtime.excite(model, records, study, workers=workers, progress=progress)
        if results is not None:
            runtime.report(result, results)
        session.show(json_text(result.summary()) if json else result.to_table(), output, json=json)
