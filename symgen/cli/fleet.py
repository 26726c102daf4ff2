"""`symgen fleet FLEET.yaml`: the identification of many robots and records, on several cores or a cluster, with one table at the end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import reserved, write_all
from symgen.cli.session import NEGATIVE, model_of_job, reported_errors, single_thread

if TYPE_CHECKING:
    from runtime.identification.fleet import Finished


def fleet(
    file: Annotated[Path, typer.Argument(help="Fleet file: symgen: 1, jobs: [{robot: tx40, record: tx40}, ...].")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for summary.csv, .json, .txt and one folder per job.")
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes, this one among them.")] = 0,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers do the jobs, such as tcp://10.0.0.1:8786.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print summary.json instead of the table.")] = False,
) -> None:
    """Identify many robots from their records. A job that fails has its reason in the table and the others go on.

    Exit code 1 where a job failed or a record does not determine its robot.
    """
    single_thread()
    with reported_errors(), reserved(output) as results:
        import runtime
        from runtime.identification.fleet import identify_fleet
        from runtime.reporting.files import identification_files

        def finished(job: Finished, done: int, total: int) -> None:
            if output is not None and job.files:
                write_all(output / job.row.name, job.files)
            typer.echo(f"{done} of {total}  {job.row.name}: {job.row.status}", err=True)

        files = None if output is None else identification_files
        result = identify_fleet(
            file, load=model_of_job, folder=output or "", files=files, workers=workers, scheduler=scheduler, finished=finished
        )
        if results is not None:
            runtime.report(result, results)
        typer.echo(result.to_json() if json else result.to_text(), nl=not json)
    if not result.complete:
        raise typer.Exit(NEGATIVE)
