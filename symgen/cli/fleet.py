"""`symgen fleet FLEET.yaml`: the identification of many robots and records, on several cores or a cluster, with one table at the end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import reserved, write_all
from symgen.cli.session import NEGATIVE, reported_errors, single_thread

if TYPE_CHECKING:
    from symgen.cli.fleet_jobs import Done, Job, Row

WAVE = 32  # jobs whose records are in memory at a time


def fleet(
    file: Annotated[Path, typer.Argument(help="Fleet file: symgen: 1, jobs: [{robot: tx40, record: tx40}, ...].")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for summary.csv, .json, .txt and one folder per job.")
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: this one.")] = 0,
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
        from symgen.cli.fleet_jobs import jobs_of

        jobs = jobs_of(file)
        rows: dict[str, Row] = {}
        for done in finished(jobs, output, workers, scheduler):
            if output is not None and done.files:
                write_all(output / done.row.name, done.files)
            rows[done.row.name] = done.row
            typer.echo(f"{len(rows)} of {len(jobs)}  {done.row.name}: {done.row.status}", err=True)
        ordered = [rows[job.name] for job in jobs]
        if results is not None:
            results.write_all(summary_files(ordered))
        typer.echo(summary_json(ordered) if json else summary_text(ordered), nl=not json)
    if any(row.status in ("failed", "rank-deficient") for row in ordered):
        raise typer.Exit(NEGATIVE)


def finished(jobs: Sequence[Job], output: Path | None, workers: int, scheduler: str | None) -> Iterator[Done]:
    """Results as they come; the records of some jobs are read, sent and worked on, then those of the next."""
    from runtime import distributed
    from runtime.errors import InputError
    from runtime.parallel import results
    from symgen.cli.fleet_jobs import Done, Packer, Parcel, identified

    if scheduler and workers:
        raise InputError("a scheduler has workers of its own; leave out --workers")
    packed = Packer(output)
    for start in range(0, len(jobs), WAVE):
        parcels: list[Parcel] = []
        for parcel in map(packed, jobs[start : start + WAVE]):
            if isinstance(parcel, Done):
                yield parcel
            else:
                parcels.append(parcel)
        work = distributed.results(identified, None, parcels, scheduler) if scheduler else results(identified, None, parcels, workers)
        yield from work


def summary_text(rows: Sequence[Row]) -> str:
    """The table, then what failed and why."""
    from runtime.table import aligned
    from symgen.cli.fleet_jobs import shortened

    def number(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    lines: list[Sequence[str]] = [("job", "robot", "record", "rows", "parameters", "essential", "cond", "error %", "worst joint", "status")]
    for row in rows:
        worst = "-" if row.worst_joint is None else f"{row.worst_joint} ({number(row.worst_error, '.1f')} %)"
        counts = (number(row.rows, "d"), number(row.parameters, "d"), number(row.essential, "d"))
        shown = (Path(row.robot).name, Path(row.record).name) if row.rows is None else (row.robot, row.record)
        lines.append((row.name, *shown, *counts, number(row.cond, ".1f"), number(row.relative_error, ".2f"), worst, row.status))
    notes = [f"{row.name}: {shortened(row).message}" for row in rows if row.status != "ok"]
    return "\n".join([aligned(lines), *([""] if notes else []), *notes])


def summary_json(rows: Sequence[Row]) -> str:
    """The table as JSON text."""
    from runtime.estimators.estimate import json_text

    return json_text({"schema": 1, "jobs": rows})


def summary_files(rows: Sequence[Row]) -> dict[str, str | bytes]:
    """The table as text, CSV and JSON."""
    import csv
    from io import StringIO

    from symgen.cli.fleet_jobs import Row, mapping_of

    stream = StringIO()
    writer = csv.DictWriter(stream, list(Row.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(mapping_of(row) for row in rows)
    return {"summary.txt": summary_text(rows) + "\n", "summary.csv": stream.getvalue(), "summary.json": summary_json(rows)}
