"""The command `symgen identify ROBOT RECORD`: identify parameters and judge their quality."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

from symgen.cli import mended, options, session
from symgen.cli.each import identify_each
from symgen.update.models import corrected, model_of, variants_of


def identify(
    robot: options.RobotOrModule,
    record: options.Records,
    output: Annotated[
        Path | None,
        options.folder(
            "report.html, estimate.json (.mat, .npz), parameters.csv (.tex), figures, study.yaml"
        ),
    ] = None,
    physical: Annotated[
        bool,
        typer.Option(
            "--physical", help="Check whether a physical robot can have these parameters."
        ),
    ] = False,
    friction: Annotated[
        bool,
        typer.Option(
            "--friction",
            help="Show the friction of each joint against its velocity, and the law that it follows.",
        ),
    ] = False,
    plausible: Annotated[
        bool,
        typer.Option(
            "--plausible/--no-plausible",
            help="Check whether record, study and robot file are consistent; if not, suggest what to change.",
        ),
    ] = True,
    trust: options.Trust = False,
    exact: options.Exact = False,
    base: options.Base = None,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            help="Also print which parameters were removed and why, the validation, standard "
            "deviations and residuals.",
        ),
    ] = False,
    suggest: Annotated[
        Path | None,
        typer.Option(
            help="Write a study file with the settings that the records need (columns guessed from their names, resampling, units), then identify with it."
        ),
    ] = None,
    repair: Annotated[
        Path | None,
        typer.Option(
            help="Search for several errors of the study at once, judge the corrections on rows that the search did not use, and write the mended study; then identify with it. The given files stay as they are."
        ),
    ] = None,
    each: Annotated[
        bool,
        typer.Option(
            "--each",
            help="Identify from each record alone, not from all together. Each record gets its own folder of results in FOLDER; existing results are kept if the command is repeated.",
        ),
    ] = False,
    workers: options.Workers = 0,
    at: options.At = None,
    json: options.Json = False,
) -> None:
    """Identify the base parameters of ROBOT from RECORD, or from several records fitted together.
    The exit code is 0 for the verdicts Yes and With care, and 1 for No. If --suggest leaves settings
    to be filled in, the command says which, and ends with exit code 0.
    """
    if each and (output is None or repair is not None or json or verbose):
        session.fail("--each needs -o FOLDER, and goes without --repair, --json and --verbose")
    if workers > 1 and not each:
        session.fail("--workers is for --each; one identification runs in one process")
    stages = nullcontext() if each else session.progress_lines()
    with stages, session.results_in(None if each else output) as results:
        import runtime
        from runtime.compose import records_of
        from runtime.core.provenance import processor

        described = session.robot_of(robot, trust=trust, exact=exact, base=base)
        study = session.study_of_arguments(record)
        study = study if at is None else session.changed(study, payload={"at": at})
        robot_file, described = described, corrected(described, study)
        model = model_of(described, study=study)
        if suggest is not None:
            study = session.suggested_study(study, model, suggest, robot, json=json)
        asked: dict[str, Any] = {"physical": physical, "friction": friction, "plausible": plausible}
        if each and output is not None:
            variants = variants_of(described) if plausible else None
            good = identify_each(model, study, output, workers, variants=variants, **asked)
            session.end(good=good)
            return
        records = records_of(study.record, model, study)
        found = None
        if repair is not None:
            found, study = mended.mended_study(robot_file, study, records, repair)
            described = corrected(robot_file, study)
            model = model_of(described, study=study)
            records = records_of(study.record, model, study)
        result = runtime.identify(
            model,
            records,
            study,
            variants=variants_of(described) if plausible else None,
            provenance={"processor": processor()},
            **asked,
        )
        if results is not None:
            runtime.report(result, results)
        if json:
            text = mended.json_of(result, found)
        else:
            said = session.assumptions_of(described, records, study)
            printed = result.to_text() if verbose else result.brief(len(said))
            printed = mended.with_repair(printed, result, found, [robot, *record], repair)
            text = "\n".join([printed, *(f"assume: {line}" for line in said)])
        session.show(text, results, json=json, verdict=result.checklist)
    session.end(good=result.checklist.state != "no")
