"""The identification of many robots from their records, on several cores or a cluster, with one
table at the end.

symgen: 1
jobs:
  - {robot: tx40, record: tx40}
          # as on the command line of `symgen identify`
  - {name: left arm, robot: my_arm.yaml, record: left.yaml}    # files: relative to this one
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, partial
from pathlib import Path
from typing import TypeAlias

from runtime import parallel
from runtime.errors import InputError
from runtime.identification.identification import identify
from runtime.identification.result import Identification
from runtime.json_documents import Result
from runtime.limits import LIMIT
from runtime.model.generated import GeneratedModel, load_model
from runtime.records.datasets import DATASETS
from runtime.records.named import study_of
from runtime.records.reading import read_records
from runtime.records.record import Record
from runtime.settings.files import settings_from_text, text_of
from runtime.settings.location import located
from runtime.settings.schema import Settings, Text, Whole, require
from runtime.settings.study import SCHEMA, Study
from runtime.table import aligned, csv_text

Files: TypeAlias = Mapping[str, str | bytes]

FAILED = "failed"


class JobSettings(Settings):
    """One identification.

    Attributes
    ----------
    robot : str
        Packaged robot or file, as for `symgen identify`.
    record : str
        Dataset, study file or measured file.
    name : str or None
        Of the job's folder; default: robot and record.
    """

    robot: Text = ""
    record: Text = ""
    name: Text | None = None

    def __post_init__(self) -> None:
        for key in ("robot", "record"):
            require(
                bool(getattr(self, key)),
                "missing; expected a name or a file, as for `symgen identify`",
                key,
            )


class FleetSettings(Settings):
    """Many identifications.

    Attributes
    ----------
    symgen : int
        Version of the layout.
    jobs : tuple of JobSettings
    """

    symgen: Whole = SCHEMA
    jobs: tuple[JobSettings, ...] = ()

    def __post_init__(self) -> None:
        require(
            self.symgen == SCHEMA, f"schema {self.symgen}; this version reads {SCHEMA}", "symgen"
        )
        require(bool(self.jobs), "no job; expected a list of {robot: ..., record: ...}", "jobs")


@dataclass(frozen=True)
class Job:
    """One identification.

    Attributes
    ----------
    name : str
        Distinct among the jobs; that of its folder.
    robot, record : str
        As on the command line of `symgen identify`; files relative to the current folder.
    """

    name: str
    robot: str
    record: str


@dataclass(frozen=True, eq=False)
class Parcel:
    """What a worker is sent for one job, since it reads no files.

    Attributes
    ----------
    job : Job
    model : GeneratedModel
    study : Study
    records, further : tuple of Record
        Records to fit, and those of study.validate.record.
    files : function of Identification and Path to mapping, or None
        What makes the contents of the folder of the job.
    folder : Path
        That folder.
    """

    job: Job
    model: GeneratedModel
    study: Study
    records: tuple[Record, ...]
    further: tuple[Record, ...]
    files: Callable[[Identification, Path], Files] | None
    folder: Path


@dataclass(frozen=True)
class Row:
    """A line of the summary.

    Attributes
    ----------
    name : str
        Of the job.
    robot, record : str
        As in the fleet file for a job that failed, else the names of the model and of the records.
    rows, parameters, essential : int or None
        Rows of W, base parameters, essential ones.
    cond : float or None
        Condition number of W.
    relative_error : float or None, %
        Of all parameters.
    worst_joint : str or None
        Joint with the largest error.
    worst_error : float or None, %
        Error of that joint.
    status : str
        Of the Estimate, or "failed".
    message : str
        The reason where the status is not "ok".
    """

    name: str
    robot: str
    record: str
    rows: int | None = None
    parameters: int | None = None
    essential: int | None = None
    cond: float | None = None
    relative_error: float | None = None
    worst_joint: str | None = None
    worst_error: float | None = None
    status: str = FAILED
    message: str = ""


@dataclass(frozen=True, eq=False)
class Finished:
    """What a job gives.

    Attributes
    ----------
    row : Row
        Its line of the summary.
    files : mapping of str to str or bytes
        Contents of its folder by file name.
    """

    row: Row
    files: Files = field(default_factory=dict)


@dataclass(frozen=True)
class Fleet(Result, keys="jobs:rows", schema=1):
    """The lines of all jobs, in the order of the fleet file."""

    rows: tuple[Row, ...]

    @property
    def complete(self) -> bool:
        """Whether the estimator of every job ended well."""
        return all(row.status == "ok" for row in self.rows)

    def to_text(self) -> str:
        """The table, then the jobs that failed with their reasons."""

        def number(value: float | None, form: str) -> str:
            return "-" if value is None else format(value, form)

        lines: list[Sequence[str]] = [
            (
                "job",
                "robot",
                "record",
                "rows",
                "parameters",
                "essential",
                "cond",
                "error %",
                "worst joint",
                "status",
            )
        ]
        for row in self.rows:
            worst = (
                "-"
                if row.worst_joint is None
                else f"{row.worst_joint} ({number(row.worst_error, '.1f')} %)"
            )
            counts = (
                number(row.rows, "d"),
                number(row.parameters, "d"),
                number(row.essential, "d"),
            )
            names = (
                (Path(row.robot).name, Path(row.record).name)
                if row.rows is None
                else (row.robot, row.record)
            )
            lines.append(
                (
                    row.name,
                    *names,
                    *counts,
                    number(row.cond, ".1f"),
                    number(row.relative_error, ".2f"),
                    worst,
                    row.status,
                )
            )
        first_sentence = re.compile(r"(?<=[.;]) |\n")
        notes = [
            f"{row.name}: {first_sentence.split(row.message, maxsplit=1)[0]}"
            for row in self.rows
            if row.status != "ok"
        ]
        return "\n".join([aligned(lines), *([""] if notes else []), *notes])

    def to_csv(self) -> str:
        """summary.csv: one line per job."""
        header = [f.name for f in fields(Row)]
        return csv_text(header, [[getattr(row, name) for name in header] for row in self.rows])


def identify_fleet(
    file: str | Path,
    *,
    load: Callable[[str], GeneratedModel] = load_model,
    folder: str | Path = "",
    files: Callable[[Identification, Path], Files] | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    finished: Callable[[Finished, int, int], None] = lambda job, done, total: None,
) -> Fleet:
    """Identify many robots from their records. A job that fails has its reason in the table and the
    others go on.

    Parameters
    ----------
    file : str or Path
        The fleet file.
    load : function of str to GeneratedModel
        The model of a name or file; InputError where there is none. Each robot is loaded once.
    folder : str or Path
        Where the folders of the jobs are to lie.
    files : function of Identification and Path to mapping, optional
        What makes the contents of a job's folder, such as
        `runtime.reporting.files.identification_files`; a function of a module.
    workers : int
        Processes, this one among them. The results do not depend on it.
    scheduler : str, optional
        Address of a Dask cluster that works instead (`runtime.cluster`).
    finished : function of Finished, int, int
        Called after each job with what it gave, the number of jobs done and their total.

    Returns
    -------
    Fleet

    Raises
    ------
    InputError
        A fleet file that cannot be read, workers besides a scheduler, or a scheduler without an
        answer.
    """
    if scheduler and workers:
        raise InputError("a scheduler has workers of its own; leave out --workers")
    jobs = jobs_of(Path(file))
    rows: dict[str, Row] = {}
    pack = partial(packed, load=cache(load), folder=Path(folder), files=files)
    for job in _all_finished(jobs, pack, workers, scheduler):
        rows[job.row.name] = job.row
        finished(job, len(rows), len(jobs))
    return Fleet(tuple(rows[job.name] for job in jobs))


def jobs_of(path: Path) -> list[Job]:
    """The jobs of a fleet file, names made distinct; SettingsError with file, line and key."""
    fleet = settings_from_text(FleetSettings, text_of(path), file=path.name)
    jobs: list[Job] = []
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    for settings in fleet.jobs:
        robot, record = (_relative(name, path.parent) for name in (settings.robot, settings.record))
        wanted = (
            settings.name
            or f"{Path(settings.robot).stem}-{Path(settings.record).name.split('.')[0]}"
        )
        name = folder = re.sub(r"[^\w.-]+", "_", wanted).strip(".") or "job"
        while name.lower() in taken:
            numbers[folder.lower()] = number = numbers.get(folder.lower(), 1) + 1
            name = f"{folder}-{number}"
        taken.add(name.lower())
        jobs.append(Job(name, robot, record))
    return jobs


def _relative(name: str, folder: Path) -> str:
    """A file as named in `folder`; packaged robots and datasets as they are."""
    return name if name in DATASETS or not Path(name).suffix else str(folder / name)


def packed(
    job: Job,
    load: Callable[[str], GeneratedModel],
    folder: Path,
    files: Callable[[Identification, Path], Files] | None,
) -> Parcel | Finished:
    """The parcel of a job; where it cannot be made, the line that says why. load : the model of a
    robot; folder, files : as for `identify_fleet`.
    """
    try:
        model = load(job.robot)
        study = located(*study_of(job.record))
        if not study.record:
            raise InputError(
                "the study names no record; set record.files, or record.dataset with record.files",
                file=job.record,
            )
        missing = study.signals.admits_missing
        records, further = (
            tuple(read_records(own, model, missing=missing))
            for own in (study.record, study.validate.record)
        )
    except (InputError, OSError) as e:
        return Finished(Row(job.name, job.robot, job.record, message=str(e)))
    return Parcel(job, model, study, records, further, files, folder / job.name)


def _all_finished(
    jobs: Sequence[Job],
    pack: Callable[[Job], Parcel | Finished],
    workers: int,
    scheduler: str | None,
) -> Iterator[Finished]:
    """Results as they come; the records of some jobs are read, sent and worked on, then those of
    the next.
    """
    for start in range(0, len(jobs), LIMIT.WAVE):
        parcels: list[Parcel] = []
        for parcel in map(pack, jobs[start : start + LIMIT.WAVE]):
            if isinstance(parcel, Finished):
                yield parcel
            else:
                parcels.append(parcel)
        yield from parallel.results(identified, None, parcels, workers, scheduler=scheduler)


def identified(context: None, parcel: Parcel) -> Finished:
    """The work of one job, in any process; whatever goes wrong stays in its line."""
    job = parcel.job
    try:
        result = identify(parcel.model, parcel.records, parcel.study, further=parcel.further)
        files = {} if parcel.files is None else parcel.files(result, parcel.folder)
    except Exception as e:  # one job must not end the others
        message = str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"
        return Finished(Row(job.name, job.robot, job.record, message=message))
    return Finished(row_of(job, result), files)


def row_of(job: Job, result: Identification) -> Row:
    """The line of an identification."""
    fit = result.estimate
    worst = fit.worst_joint
    return Row(
        name=job.name,
        robot=result.model.NAME,
        record=result.name,
        rows=fit.rows,
        parameters=len(fit.names),
        essential=len(result.essential.names),
        cond=fit.cond,
        relative_error=fit.relative_error,
        worst_joint=worst.joint,
        worst_error=worst.relative_error,
        status=fit.status,
        message=fit.message,
    )
