"""The command `symgen report ROBOT RECORD`: identify with all analyses, and write one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session
from symgen.update.models import corrected, model_of, variants_of


def report(
    robot: options.RobotOrModule,
    record: options.Records,
    output: Annotated[
        Path, options.folder("report.html and the files of identify and cestac")
    ] = Path("report"),
    encoder: Annotated[
        str | None,
        typer.Option(
            help="Step of the encoders in use, rad or m, such as 2*pi/65536. The report then also checks whether this step is fine enough."
        ),
    ] = None,
    side: options.Side = None,
    columns: options.Columns = None,
    trust: options.Trust = False,
    exact: options.Exact = False,
    base: options.Base = None,
    json: options.Json = False,
) -> None:
    """Identify ROBOT from RECORD, with friction, physical consistency and encoder resolution, and judge the result.

    A part that cannot be done is named on the page with its reason. The exit code is 1 if the values
    cannot be used.

    With --columns, only the named parameters decide whether the encoder is fine enough.
    """
    with session.results_in(output) as results:
        import runtime
        from runtime.compose import assess, records_of
        from runtime.ground.documents import json_text

        described = session.robot_of(robot, trust=trust, exact=exact, base=base)
        judged = {"side": side, "columns": session.names_of(columns)}
        study = session.changed(session.study_of_arguments(record), cestac=judged)
        described = corrected(described, study)
        model = model_of(described, study=study)
        asked = session.changed(study, cestac={"delta": encoder}).cestac.delta
        records = records_of(study.record, model, study)
        result = assess(
            model,
            records,
            study,
            encoder=asked if encoder else (),
            variants=variants_of(described),
            progress=session.say,
        )
        runtime.report(result, results)
        checklist = result.checklist
        text = json_text(checklist.summary()) if json else checklist.to_text()
        for reason in result.missing:
            typer.echo(f"not done: {reason}", err=True)
        session.show(text, results, json=json)
    session.end(good=checklist.state != "no")
