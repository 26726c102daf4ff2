"""`symgen identify ROBOT RECORD`: parameters of a robot from a record, with an honest statement of how far to trust them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import reserved
from symgen.cli.beside import Beside, beside
from symgen.cli.session import (
    NEGATIVE,
    RECORDS,
    in_target,
    opened_model,
    origin,
    reported_errors,
    single_thread,
    study_text,
    study_with_records,
    symbolic_file,
)

if TYPE_CHECKING:
    from runtime.estimators.closed_loop import Simulator
    from runtime.identification.identification import Identification
    from runtime.model.generated import GeneratedModel
    from runtime.settings.study import Study

ONE_BLOCK = 40  # lines of parameters.tex that one page holds; more stand in two blocks


def identify(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py).")],
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
    physical: Annotated[
        bool, typer.Option("--physical", help="Tell whether a physical robot can have these parameters (extra consistency).")
    ] = False,
    friction: Annotated[
        bool, typer.Option("--friction", help="Friction against velocity, joint by joint, and the law it follows.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print estimate.json instead of tables.")] = False,
) -> None:
    """Identify the base parameters of ROBOT from RECORD, or from several fitted together. Exit code 1 where the record does not determine them."""
    single_thread()
    with reported_errors(), reserved(output) as results, opened_model(robot) as model:
        from runtime.identification.identification import identification
        from runtime.model.compile_cache import processor
        from runtime.model.compiled import target_of
        from runtime.records.reading_by_blocks import records_or_streams

        study, folder = study_with_records(record)
        study = study if block is None else replace(study, stream=block)
        records = records_or_streams(study.record, model, study.stream, folder=folder)
        further = records_or_streams(study.validate.record, model, study.stream, folder=folder)
        model = in_target(robot, model, target)
        computed = {"target": target_of(model), "processor": processor()}
        found = identification(
            model, study, records, further=further, simulator=simulator_of(robot, model, study), provenance={**origin(records), **computed}
        )
        more = beside(model, study, folder, records, found, origin(records), physical=physical, friction=friction)
        if results is not None:
            results.write_all(identification_files(found, study_text(study, folder, results.folder), more))
        typer.echo(estimate_json(found, more) if json else console_text(found, more), nl=not json)
        if output is not None:
            typer.echo(f"report: {output / 'report.html'}", err=True)
    if found.every.status == "rank-deficient":
        raise typer.Exit(NEGATIVE)


def simulator_of(robot: str, model: GeneratedModel, study: Study) -> Simulator | None:
    """The closed loop of the study where its method simulates one; else None."""
    from runtime.estimators import CLOSED_LOOP

    if study.estimate.method not in CLOSED_LOOP or study.controller is None:
        return None
    from runtime.model.casadi import load_symbolic
    from runtime.motion.simulation import Simulator

    return Simulator(model, study.controller, symbolic=load_symbolic(symbolic_file(robot, model), of=model))


def console_text(found: Identification, more: Beside | None = None) -> str:
    """Table of the essential parameters, trail, validation, trading parameters, coupling, then the verdict."""
    coupling = "\n".join(
        f"coupling of the drives in {key}: {fit.relative_error:.2f} % in total, per joint "
        + " ".join(f"{joint.relative_error:.2f}" for joint in fit.per_joint)
        for key, fit in found.coupling.items()
    )
    fit = found.carried if found.every.status != "rank-deficient" else found.every
    trading = [f"warning: {sentence}" for sentence in found.warnings] or [
        f"no two parameters trade: no |correlation| above {found.weak.threshold:g}"
    ]
    parts = [fit.to_table(), found.found.to_table(), *(part.to_table() for part in found.validation)]
    parts += [
        by_record_text(found),
        "\n".join(trading),
        weakest_text(found),
        found.trust.to_text(),
        coupling,
    ]
    parts += ["" if more is None else more.text(), found.verdict]
    return "\n\n".join(part for part in parts if part)


def by_record_text(found: Identification) -> str:
    """Errors of several records, and what the time stamps of any were like."""
    from runtime.reporting.sections import time_texts

    errors = [
        f"error in {one.name}: {one.relative_error:.2f} % in total, per joint " + " ".join(f"{e:.2f}" for e in one.per_joint)
        for one in found.by_record
    ]
    return "\n".join([*errors, *time_texts(found)])


def weakest_text(found: Identification) -> str:
    """Directions that W sees least, by name."""
    lines = [f"{d.ratio:.1e}  " + " ".join(f"{w:+.2f} {name}" for name, w in d.weights.items()) for d in found.weak.directions]
    return "\n".join(["directions that W sees least (singular value over the largest, unit columns)", *lines])


def estimate_json(found: Identification, more: Beside | None = None) -> str:
    """estimate.json: the Estimate of all parameters, and beside it the essential ones, validation, coupling and verdict."""
    import json

    from runtime.estimators.estimate import json_text

    return json_text({**json.loads(found.every.to_json()), **found.summary(), **({} if more is None else more.summary())})


def identification_files(found: Identification, study: str, more: Beside | None = None) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    from runtime.reporting import figures as plots
    from runtime.reporting.arrays import array_files, estimate_arrays
    from runtime.reporting.page import render
    from runtime.reporting.sections import parameters_csv, torque_unit
    from symgen.cli.pages import identification_page

    unit = torque_unit(found)
    overlay, residuals = plots.torque_overlay(found.comparison, unit, found.source), plots.residual_histogram(found.comparison, unit)
    return {
        "report.html": render(identification_page(found, study, more)),
        "estimate.json": estimate_json(found, more),
        "parameters.csv": parameters_csv(found),
        "parameters.tex": found.carried.to_latex(blocks=1 if len(found.carried.names) <= ONE_BLOCK else 2),
        **array_files("estimate", estimate_arrays(found.every)),
        "study.yaml": study,
        "torques.png": plots.png(overlay),
        "torques.svg": plots.svg(overlay),
        "residuals.png": plots.png(residuals),
        **({} if more is None else more.files()),
    }
