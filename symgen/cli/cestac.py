"""`symgen cestac ROBOT RECORD`: what would a coarser encoder (or torque sensor) have done to the estimate?"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runtime.result_files import reserved
from symgen.cli.session import (
    NEGATIVE,
    RECORDS,
    in_target,
    opened_model,
    origin,
    progress_bar,
    reported_errors,
    single_thread,
    study_and_records,
    study_text,
)

if TYPE_CHECKING:
    from runtime.resolution.checkpoint import Checkpoint
    from runtime.resolution.result import Cestac
    from runtime.settings.study import Study

INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


def cestac(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py).")],
    record: Annotated[list[str], typer.Argument(help=RECORDS)],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for report.html, cestac.json, .csv, .tex, .mat and .npz, the figure and study.yaml."),
    ] = None,
    delta: Annotated[list[str] | None, typer.Option(help="Position step, rad or m, such as 2*pi/5000; repeat for several.")] = None,
    torque: Annotated[list[str] | None, typer.Option(help="Motor torque step, N m or N; repeat for several.")] = None,
    runs: Annotated[int | None, typer.Option(help="Runs per step, at least 2.")] = None,
    rounding: Annotated[str | None, typer.Option(help="two-point, uniform, gaussian or quantise.")] = None,
    side: Annotated[str | None, typer.Option(help="joint or motor: where positions are rounded.")] = None,
    columns: Annotated[str | None, typer.Option(help="essential, all, or names separated by commas.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random rounding.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: this one. The results do not depend on it.")] = 0,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers do the runs, such as tcp://10.0.0.1:8786.")
    ] = None,
    advise: Annotated[
        bool,
        typer.Option(
            "--advise", help="Predict the coarsest steps that keep the change below 1 % and 5 %, and confirm them by --runs runs each."
        ),
    ] = False,
    target: Annotated[str, typer.Option(help="numpy, or c: compiled runs, about six times as many a second.")] = "numpy",
    json: Annotated[bool, typer.Option("--json", help="Print cestac.json (advice.json) instead of tables.")] = False,
) -> None:
    """Study the encoder resolution. Exit code 1 where least squares is biased at one of the steps.

    With --advise, exit code 1 where it would be at one of the steps of --delta, or where the runs contradict the prediction.

    A long study with -o keeps its runs in DIR/runs as it goes: interrupted or killed, the same command goes on.
    """
    single_thread()
    given = {"delta": delta, "torque": torque, "runs": runs, "rounding": rounding, "side": side, "seed": seed}
    given["columns"] = columns.split(",") if columns and "," in columns else _one_name(columns)
    with reported_errors(), reserved(output) as results, opened_model(robot) as model:
        import runtime.resolution.cestac as study_of_resolution
        from runtime.resolution.checkpoint import Checkpoint

        study, folder, records = study_and_records(record, model)
        study = changed(study, {key: value for key, value in given.items() if value is not None})
        if advise:
            from symgen.cli.advice import advised

            asked = study.cestac.delta if delta else ()
            raise typer.Exit(NEGATIVE if advised(model, study, folder, records, asked, results, json) else 0)
        checkpoint = None if output is None else Checkpoint(output)
        model = in_target(robot, model, target)
        with progress_bar("runs") as progress, kept_runs(checkpoint):
            result = study_of_resolution.cestac(
                model,
                records,
                study,
                workers=workers,
                scheduler=scheduler,
                progress=progress,
                checkpoint=checkpoint,
                provenance=origin(records),
            )
        if results is not None:
            title = f"{model.NAME}: encoder resolution on {', '.join(r.name for r in records)}"
            results.write_all(study_files(result, study_text(study, folder, results.folder), title))
        if checkpoint is not None and result.lists_runs:
            checkpoint.remove()
        typer.echo(result.to_json() if json else console_text(result), nl=not json)
        if output is not None:
            typer.echo(f"report: {output / 'report.html'}", err=True)
    if result.verdict == "biased":
        raise typer.Exit(NEGATIVE)


def changed(study: Study, given: dict[str, Any]) -> Study:
    """The study with some of its cestac settings replaced, checked like those of a file."""
    from runtime.settings.study import study_from_mapping, to_mapping

    mapping = to_mapping(study)
    return study_from_mapping({**mapping, "cestac": {**mapping["cestac"], **given}})


@contextmanager
def kept_runs(checkpoint: Checkpoint | None) -> Iterator[None]:
    """Ctrl-C says what is left of the study and ends with code 130."""
    try:
        yield
    except KeyboardInterrupt:
        kept = (
            f"{checkpoint.written} runs are in {checkpoint.folder}: the same command goes on"
            if checkpoint and checkpoint.written
            else "nothing is kept"
        )
        typer.echo(f"stopped; {kept}", err=True)
        raise typer.Exit(INTERRUPTED) from None


def console_text(result: Cestac) -> str:
    """Means and residuals as Table 3, then %e (%sigma), then the verdict in one sentence."""
    return f"{result.to_table()}\n\n%e (21) and, in brackets, %sigma (20); * does not decide\n{result.errors_table()}\n\n{verdict_sentence(result)}"


def verdict_sentence(result: Cestac) -> str:
    """What the study says, level by level, in one sentence."""
    by_verdict: dict[str, list[str]] = {}
    for level in result.levels:
        by_verdict.setdefault(level.verdict, []).append(level.level.label)
    meaning = {"unbiased": "practically unbiased", "doubtful": "doubtful", "biased": "biased"}
    parts = [f"{meaning[verdict]} at {', '.join(labels)}" for verdict, labels in by_verdict.items()]
    worst = max(result.levels, key=lambda level: max(level.decided_by.values(), default=0.0), default=None)
    if worst is None:
        return "Nothing was perturbed."
    name, error = next(iter(worst.decided_by.items()))
    return f"Least squares is {'; '.join(parts)}; largest change: {'the residual' if name == 'rho' else name}, {error:.1f} % at {worst.level.label}."


def study_files(result: Cestac, study: str, title: str) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    from runtime.reporting.page import Page, render
    from runtime.reporting.sections import level_numbers, resolution_section
    from symgen.cli.pages import settings_section
    from symgen.cli.resolution_files import cestac_files

    sections = [resolution_section(result), settings_section(study)]
    page = Page(title=title, verdict=verdict_sentence(result), sections=sections, numbers=level_numbers(result))
    return {"report.html": render(page), "study.yaml": study, **cestac_files(result)}


def _one_name(columns: str | None) -> str | list[str] | None:
    return columns if columns in (None, "essential", "all") else [columns]
