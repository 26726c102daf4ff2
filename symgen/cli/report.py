"""`symgen report ROBOT RECORD`: everything one record says about a robot, in one folder with one page."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import reserved
from symgen.cli import session
from symgen.cli.session import NEGATIVE, RECORDS, ROBOT, reported_errors, single_thread


def report(
    robot: Annotated[str, typer.Argument(help=ROBOT)],
    record: Annotated[list[str], typer.Argument(help=RECORDS)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for report.html and the files of identify and cestac.")] = Path(
        "report"
    ),
    encoder: Annotated[
        str | None, typer.Option(help="Step of the encoders in use, rad or m, such as 2*pi/65536: judged like every other check.")
    ] = None,
    side: Annotated[
        str | None, typer.Option(help="joint or motor: where the encoders stand; default: cestac.side of the study, joint.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print verdict and checks as JSON.")] = False,
) -> None:
    """Identify ROBOT from RECORD, with friction, physical consistency and encoder resolution, and judge the result.

    A part that cannot be done is named on the page with its reason. Exit code 1 where the values cannot be used.
    """
    single_thread()
    with reported_errors(), reserved(output) as results:
        import runtime
        from runtime.identification.assessment import assess
        from runtime.json_documents import json_text
        from runtime.records.reading_by_blocks import records_or_streams

        model = session.model_of(robot)
        study = session.changed(session.study_of_arguments(record), "cestac", side=side)
        steps = () if encoder is None else session.changed(study, "cestac", delta=encoder).cestac.delta
        records = records_or_streams(study.record, model, study.stream, missing=study.signals.admits_missing)
        runs = partial(session.model_of_runs, model, robot)
        result = assess(model, records, study, encoder=steps, variants=session.variants_of(robot), runs=runs, progress=session.say)
        runtime.report(result, results)
        checklist = result.checklist
        typer.echo(json_text(checklist.summary()) if json else checklist.to_text(), nl=not json)
        for reason in result.missing:
            typer.echo(f"not done: {reason}", err=True)
        typer.echo(f"report: {output / 'report.html'}", err=True)
    if checklist.state == "no":
        raise typer.Exit(NEGATIVE)
