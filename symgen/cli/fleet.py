"""`symgen fleet FLEET.yaml`: the identification of many robots and records, on several cores or a
cluster, with one table at the end.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from symgen.cli import options, session

if TYPE_CHECKING:
    from runtime.identification.fleet import Finished


def fleet(
    file: Annotated[
        Path,
        typer.Argument(help="Fleet file: symgen: 1, jobs: [{robot: tx40, record: tx40}, ...]."),
    ],
    output: Annotated[
        Path | None, options.folder("summary.csv, .json, .txt and one folder per job")
    ] = None,
    workers: options.Workers = 0,
    scheduler: options.Scheduler = None,
    trust: options.Trust = False,
    exact: options.Exact = False,
    json: options.Json = False,
) -> None:
    """Identify many robots from their records. A job that fails has its reason in the table and the
    others go on.

    Exit code 1 where a job failed or a record does not determine its robot.
    """
    with session.results_in(output) as results:
        import runtime
        from runtime.identification.fleet import identify_fleet
        from runtime.reporting.files import identification_files
        from runtime.result_files import write_all

        def finished(job: Finished, done: int, total: int) -> None:
            if output is not None and job.files:
                write_all(output / job.row.name, job.files)
            typer.echo(f"{done} of {total}  {job.row.name}: {job.row.status}", err=True)

        result = identify_fleet(
            file,
            load=partial(session.model_of_job, trust=trust, exact=exact),
            folder=output or "",
            files=None if output is None else identification_files,
            workers=workers,
            scheduler=scheduler,
            finished=finished,
        )
        if results is not None:
            runtime.report(result, results)
        session.show(result.to_json() if json else result.to_text(), json=json)
    session.end(good=result.complete)
