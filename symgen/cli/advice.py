"""`symgen cestac --advise`: the coarsest encoders that keep the change of the estimate below 1 % and below 5 %."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from symgen.cli.session import origin, study_text

if TYPE_CHECKING:
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.resolution.advice import Advice
    from runtime.result_files import Results
    from runtime.settings.study import Study


def advised(
    model: GeneratedModel,
    study: Study,
    folder: Path,
    records: Sequence[Record],
    asked: Sequence[float],
    results: Results | None,
    json: bool,
) -> bool:
    """Print and write the advice; True where least squares would be biased at one of the steps asked for, or the runs contradict the prediction."""
    from rich.console import Console
    from rich.progress import Progress

    from runtime.resolution.advisor import advise
    from runtime.resolution.result import BIASED

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("encoders", total=None)
        advice = advise(
            model,
            records,
            study,
            asked=asked,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
            provenance=origin(records),
        )
    if results is not None:
        title = f"{model.NAME}: encoder resolution advised on {', '.join(r.name for r in records)}"
        results.write_all(study_files(advice, study_text(study, folder, results.folder), title))
    typer.echo(advice.to_json() if json else f"{advice.to_table()}\n\n{advice.verdict}", nl=not json)
    if results is not None:
        typer.echo(f"report: {results.folder / 'report.html'}", err=True)
    doubted = any(not limit.agrees for encoder in advice.encoders for limit in encoder.limits)
    return doubted or any(advice.worst(k)[1] > BIASED for k in range(len(asked)))


def study_files(advice: Advice, study: str, title: str) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    from runtime.reporting.page import Page, render
    from runtime.reporting.resolution_advice import advice_section
    from symgen.cli.pages import settings_section
    from symgen.cli.resolution_files import advice_files

    page = Page(title=title, verdict=advice.verdict, sections=[advice_section(advice), settings_section(study)])
    return {"report.html": render(page), "study.yaml": study, **advice_files(advice)}
