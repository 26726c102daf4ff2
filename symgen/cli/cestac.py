"""The command `symgen cestac ROBOT RECORD`: study how coarser encoders change the estimate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session
from symgen.update.models import corrected, model_of


def cestac(
    robot: options.RobotOrModule,
    record: options.Records,
    output: Annotated[
        Path | None,
        options.folder("report.html, cestac.json, .csv, .mat and .npz, the figure and study.yaml"),
    ] = None,
    delta: Annotated[
        list[str] | None,
        typer.Option(
            help="Encoder step to test, rad or m, such as 2*pi/5000. Repeat the option "
            "for several steps."
        ),
    ] = None,
    torque: Annotated[
        list[str] | None,
        typer.Option(
            help="Step to which the torques of the motors are rounded, N m or N, such as 0.02. "
            "Repeat the option for several steps."
        ),
    ] = None,
    runs: Annotated[
        int | None, typer.Option(help="Number of runs for each encoder or torque step, at least 2.")
    ] = None,
    rounding: options.Rounding = None,
    uneven: options.Uneven = None,
    method: options.Method = None,
    reader: options.Reader = None,
    place: options.Place = None,
    side: options.Side = None,
    columns: options.Columns = None,
    seed: options.Seed = None,
    workers: options.Workers = 0,
    advise: options.Advise = False,
    trust: options.Trust = False,
    exact: options.Exact = False,
    base: options.Base = None,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            help="Also print the means, residuals and verdicts for each encoder step, and the assumptions.",
        ),
    ] = False,
    json: options.Json = False,
) -> None:
    """Study how coarser encoders change the estimate. The exit code is 1 if the estimate is biased
    at one of the encoder or torque steps.

    With --advise, the exit code is 1 if the estimate would be biased at one of the steps of --delta, or if
    the runs contradict the prediction. --advise tries both readers of encoders,
    positions and counts; --reader lowpass alone is six times faster.

    With --columns, all essential parameters are fitted, and only the named ones decide the verdict.

    A long study with -o saves its runs in DIR/runs.npz as it goes. If it was interrupted or killed,
    the same command continues it.
    """
    with session.results_in(output) as results:
        import runtime
        from runtime.advisor.readers import encoder_readers
        from runtime.compose import READERS, records_of
        from runtime.parallel.checkpoint import Checkpoint
        from runtime.parallel.processes import processes

        described = session.robot_of(robot, trust=trust, exact=exact, base=base)
        study = session.changed(
            session.study_of_arguments(record, recorded=False),
            cestac={
                "delta": delta,
                "torque": torque,
                "runs": runs,
                "rounding": rounding,
                "uneven": uneven,
                "place": place,
                "side": side,
                "seed": seed,
                "columns": session.names_of(columns),
            },
            estimate={"method": method},
            signals={"reader": reader},
        )
        described = corrected(described, study)
        model = model_of(described, study=study)
        if study.cestac.place == "record":
            session.require_record(study, record[0])
        records = records_of(study.record, model, study)
        checkpoint = None if output is None or advise else Checkpoint(output)
        result: runtime.Cestac | runtime.Advice
        try:
            with session.progress_bar("steps" if advise else "runs") as progress:
                if advise:
                    asked, real = study.cestac.delta if delta else (), rounding in (None, "phase")
                    judged = encoder_readers(READERS, study.signals.reader) if real else {}
                    readers = [one for one in judged if reader in (None, one)]
                    result = advice = runtime.advise(
                        model, records, study, asked=asked, progress=progress, readers=readers
                    )
                    said, good = advice.verdict, not advice.negative
                else:
                    with processes(workers) as own_map:
                        result = resolution = runtime.cestac(
                            model,
                            records,
                            study,
                            map=own_map,
                            progress=progress,
                            checkpoint=checkpoint,
                        )
                    said, good = resolution.message, resolution.verdict != "biased"
        except KeyboardInterrupt:
            session.stopped("" if checkpoint is None else checkpoint.kept)
        if results is not None:
            runtime.report(result, results, study=study)
        if checkpoint is not None and isinstance(result, runtime.Cestac) and result.lists_runs:
            checkpoint.remove()
        text = f"{result.to_table()}\n\n{said}" if verbose else result.brief()
        session.show(result.to_json() if json else text, results, json=json)
    session.end(good=good)
