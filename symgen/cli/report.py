"""`symgen report ROBOT RECORD`: everything one record says about a robot, in one folder with one page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from runtime.result_files import reserved
from symgen.cli.session import NEGATIVE, RECORDS, opened_model, origin, reported_errors, single_thread, study_text, study_with_records

if TYPE_CHECKING:
    from runtime.identification.identification import Identification
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.records.stream import Stream
    from runtime.settings.study import Study
    from symgen.cli.beside import Beside

T = TypeVar("T")


def report(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py).")],
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
    with reported_errors(), reserved(output) as results, opened_model(robot) as model:
        from runtime.estimators.estimate import json_text
        from runtime.identification.identification import identification
        from runtime.records.reading_by_blocks import records_or_streams
        from symgen.cli.cestac import changed
        from symgen.cli.identify import identification_files, simulator_of
        from symgen.cli.pages import judged

        study, folder = study_with_records(record)
        if side is not None:
            study = changed(study, {"side": side})
        records = records_or_streams(study.record, model, study.stream, folder=folder)
        further = records_or_streams(study.validate.record, model, study.stream, folder=folder)
        provenance = origin(records)
        asked = asked_steps(study, encoder)
        typer.echo("  identification", err=True)
        found = identification(model, study, records, further=further, simulator=simulator_of(robot, model, study), provenance=provenance)
        more = everything(model, study, folder, records, found, asked, provenance)
        results.write_all(identification_files(found, study_text(study, folder, results.folder), more))
        judgement = judged(found, more)
        typer.echo(json_text(judgement.summary()) if json else judgement.text(), nl=not json)
        for reason in more.missing:
            typer.echo(f"not done: {reason}", err=True)
        typer.echo(f"report: {output / 'report.html'}", err=True)
    if judgement.state == "no":
        raise typer.Exit(NEGATIVE)


def asked_steps(study: Study, encoder: str | None) -> tuple[float, ...]:
    """The step of --encoder, read like `delta` of a study file."""
    from symgen.cli.cestac import changed

    return () if encoder is None else changed(study, {"delta": encoder}).cestac.delta


def everything(
    model: GeneratedModel,
    study: Study,
    folder: Path,
    records: Sequence[Record | Stream],
    found: Identification,
    asked: tuple[float, ...],
    provenance: dict[str, Any],
) -> Beside:
    """What stands beside the parameters, as far as record, study and installed extras allow; why where they do not."""
    from runtime.identification.friction import friction_curves
    from runtime.records.record import Record
    from runtime.resolution.advisor import advise
    from runtime.resolution.cestac import cestac
    from symgen.cli.beside import beside, judgement

    more = beside(model, study, folder, records, found, provenance)
    if found.every.status == "rank-deficient":
        return replace(more, missing=("friction, physical consistency, encoder resolution: the record does not determine the parameters",))
    attempt = Attempt()
    if not more.feasible:
        more = replace(more, judged=attempt("physical consistency", lambda: judgement(model, found.every)))
    whole = [record for record in records if isinstance(record, Record)]
    if len(whole) < len(records):
        attempt.missing.append("friction and encoder resolution: they need whole records; set stream: off")
        return replace(more, missing=tuple(attempt.missing))
    names = found.found.names
    curves = attempt("friction", lambda: friction_curves(model, whole, study, found.every))
    advice = attempt("resolution advice", lambda: advise(model, whole, study, columns=names, asked=asked, provenance=provenance))
    chosen = names if study.cestac.columns == "essential" else None
    resolution = attempt("resolution study", lambda: cestac(model, whole, study, columns=chosen, provenance=provenance))
    return replace(more, friction=curves or (), advice=advice, resolution=resolution, missing=tuple(attempt.missing))


class Attempt:
    """Runs parts of the work; `missing` names those that could not be done, each with its reason."""

    def __init__(self) -> None:
        self.missing: list[str] = []

    def __call__(self, what: str, work: Callable[[], T]) -> T | None:
        """What `work` returns; None where an extra is missing or the study does not suit it."""
        from runtime.errors import InputError

        typer.echo(f"  {what}", err=True)
        try:
            return work()
        except InputError as e:
            self.missing.append(f"{what}: {e}")
            return None
