"""`symgen cestac ROBOT RECORD`: what would a coarser encoder (or torque sensor) have done to the estimate?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.result_files import reserved
from symgen.cli import session
from symgen.cli.session import NEGATIVE, RECORDS, ROBOT, reported_errors, single_thread


def cestac(
    robot: Annotated[str, typer.Argument(help=ROBOT)],
    record: Annotated[list[str], typer.Argument(help=RECORDS)],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for report.html, cestac.json, .csv, .tex, .mat and .npz, the figure and study.yaml."),
    ] = None,
    delta: Annotated[list[str] | None, typer.Option(help="Position step, rad or m, such as 2*pi/5000; repeat for several.")] = None,
    torque: Annotated[list[str] | None, typer.Option(help="Motor torque step, N m or N; repeat for several.")] = None,
    runs: Annotated[int | None, typer.Option(help="Runs per step, at least 2.")] = None,
    rounding: Annotated[
        str | None, typer.Option(help="two-point, uniform, gaussian, quantise; or phase: counts of a real encoder, of random phase.")
    ] = None,
    uneven: Annotated[float | None, typer.Option(help="Deviation of the lines of --rounding phase, in steps, such as 0.1.")] = None,
    method: Annotated[
        str | None, typer.Option(help="Estimator in place of the study's: ols, wls, irls, tls, iv, didim, cloe, feasible.")
    ] = None,
    reader: Annotated[
        str | None, typer.Option(help="lowpass: positions as they are; counts: as counts of an encoder (with --rounding phase).")
    ] = None,
    place: Annotated[
        str | None, typer.Option(help="record: recorded positions are rounded; loop: the encoder of the study's closed loop, in every run.")
    ] = None,
    side: Annotated[str | None, typer.Option(help="joint or motor: where positions are rounded.")] = None,
    columns: Annotated[str | None, typer.Option(help="essential, all, or names separated by commas.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random rounding.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes, this one among them. The results do not depend on it.")] = 0,
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
    """Study the encoder resolution. Exit code 1 where the estimate is biased at one of the steps.

    With --advise, exit code 1 where it would be at one of the steps of --delta, or where the runs contradict the prediction.

    A long study with -o keeps its runs in DIR/runs as it goes: interrupted or killed, the same command goes on.
    """
    single_thread()
    given = {
        "delta": delta,
        "torque": torque,
        "runs": runs,
        "rounding": rounding,
        "uneven": uneven,
        "place": place,
        "side": side,
        "seed": seed,
    }
    with reported_errors(), reserved(output) as results:
        import runtime
        from runtime.records.reading import read_records
        from runtime.resolution.checkpoint import Checkpoint

        model = session.model_of(robot, "numpy" if advise else target)
        study = session.study_of_arguments(record, recorded=False)
        study = session.changed(study, "cestac", **given, columns=session.names_of(columns))
        if study.cestac.place == "record":
            session.require_record(study, record[0])
        study = session.changed(session.changed(study, "estimate", method=method), "signals", reader=reader)
        records = read_records(study.record, model, missing=study.signals.admits_missing)
        checkpoint = None if output is None or advise else Checkpoint(output)
        result: runtime.Cestac | runtime.Advice
        try:
            with session.progress_bar("encoders" if advise else "runs") as progress:
                if advise:
                    result = advice = runtime.advise(
                        model,
                        records,
                        study,
                        asked=study.cestac.delta if delta else (),
                        progress=progress,
                        real=rounding in (None, "phase"),
                    )
                    text, negative = f"{advice.to_table()}\n\n{advice.verdict}", advice.negative
                else:
                    where: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "checkpoint": checkpoint}
                    result = resolution = runtime.cestac(model, records, study, progress=progress, **where)
                    text, negative = f"{resolution.to_table()}\n\n{resolution.message}", resolution.verdict == "biased"
        except KeyboardInterrupt:
            session.stopped(checkpoint)
        if results is not None:
            runtime.report(result, results, study=study)
        if checkpoint is not None and isinstance(result, runtime.Cestac) and result.lists_runs:
            checkpoint.remove()
        session.show(result.to_json() if json else text, output, json=json)
    if negative:
        raise typer.Exit(NEGATIVE)
