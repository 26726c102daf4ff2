"""`symgen identify ROBOT RECORD`: parameters of a robot from a record, with an honest statement of how far to trust them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import reserved
from symgen.cli.session import (
    NEGATIVE,
    RECORDS,
    ROBOT,
    model_of,
    progress_lines,
    reported_errors,
    show,
    single_thread,
    study_of_arguments,
    variants_of,
)


def identify(
    robot: Annotated[str, typer.Argument(help=ROBOT)],
    record: Annotated[list[str], typer.Argument(help=RECORDS)],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Folder for report.html, estimate.json (.mat, .npz), parameters.csv (.tex), figures, study.yaml."
        ),
    ] = None,
    target: Annotated[str, typer.Option(help="numpy, or c: the regressor compiled.")] = "numpy",
    block: Annotated[
        int | None,
        typer.Option(min=10, help="Read the records by blocks of so many samples; default: for large files, or as the study says."),
    ] = None,
    physical: Annotated[bool, typer.Option("--physical", help="Tell whether a physical robot can have these parameters.")] = False,
    friction: Annotated[
        bool, typer.Option("--friction", help="Friction against velocity, joint by joint, and the law it follows.")
    ] = False,
    plausible: Annotated[
        bool, typer.Option("--plausible/--no-plausible", help="Tell whether record, study and robot file suit each other, and what would.")
    ] = True,
    workers: Annotated[
        int,
        typer.Option(
            min=1, help="Processes that read and filter long records by blocks, this one among them. The results do not depend on it."
        ),
    ] = 1,
    json: Annotated[bool, typer.Option("--json", help="Print estimate.json instead of tables.")] = False,
) -> None:
    """Identify the base parameters of ROBOT from RECORD, or from several fitted together. Exit code 1 where the estimator does not end well."""
    from runtime.parallel import Workers

    single_thread()
    with reported_errors(), progress_lines(), reserved(output) as results, Workers(workers) as processes:
        import runtime
        from runtime.model.compile_cache import processor
        from runtime.model.compiled import target_of
        from runtime.records.reading_by_blocks import is_stream, records_or_streams

        model = model_of(robot, target)
        study = study_of_arguments(record)
        study = study if block is None else replace(study, stream=block)
        if is_stream(study.record, study.stream):
            processes.start("runtime.identification.identification")
        records = records_or_streams(study.record, model, study.stream, missing=study.signals.admits_missing)
        computed = {"target": target_of(model), "processor": processor()}
        result = runtime.identify(
            model,
            records,
            study,
            physical=physical,
            friction=friction,
            variants=variants_of(robot) if plausible else None,
            plausible=plausible,
            workers=processes,
            provenance=computed,
        )
        if results is not None:
            runtime.report(result, results)
        show(result.to_json() if json else result.to_text(), output, json=json)
    if not result.usable:
        raise typer.Exit(NEGATIVE)
