"""The jobs of a fleet: what its file says, what a worker is sent, what it sends back.

symgen: 1
jobs:
  - {robot: tx40, record: tx40}                                # as on the command line of `symgen identify`
  - {name: left arm, robot: my_arm.yaml, record: left.yaml}    # files: relative to this one
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from runtime.errors import InputError, SettingsError
from runtime.identification.identification import Identification, identification
from runtime.model.generated import GeneratedModel, ModelText
from runtime.records.datasets import DATASETS
from runtime.records.reading import read_records
from runtime.records.record import Record
from runtime.settings.files import settings_from_text, text_of
from runtime.settings.study import SCHEMA, Study
from symgen.cli.identify import identification_files
from symgen.cli.session import opened_model, origin, study_and_records, study_text
from symgen.errors import SymgenError

FAILED = "failed"


@dataclass(frozen=True)
class JobSettings:
    """One identification. name : of its folder; default: robot and record."""

    robot: str = ""
    record: str = ""
    name: str | None = None

    def __post_init__(self) -> None:
        for key in ("robot", "record"):
            if not getattr(self, key):
                raise SettingsError("missing; expected a name or a file, as for `symgen identify`", path=(key,))


@dataclass(frozen=True)
class FleetSettings:
    """Many identifications."""

    symgen: int = SCHEMA
    jobs: tuple[JobSettings, ...] = ()

    def __post_init__(self) -> None:
        if self.symgen != SCHEMA:
            raise SettingsError(f"schema {self.symgen}; this version reads {SCHEMA}", path=("symgen",))
        if not self.jobs:
            raise SettingsError("no job; expected a list of {robot: ..., record: ...}", path=("jobs",))


@dataclass(frozen=True)
class Job:
    """One identification with a name of its own, files relative to the current folder."""

    name: str
    robot: str
    record: str


@dataclass(frozen=True, eq=False)
class Parcel:
    """What a worker needs for one job: nothing on its disk. study_text : of the study.yaml to write; "" where no files are wanted."""

    job: Job
    model: ModelText
    study: Study
    records: tuple[Record, ...]
    further: tuple[Record, ...]
    study_text: str


@dataclass(frozen=True)
class Row:
    """A line of the summary. relative_error : %, of all parameters; worst : the joint with the largest one, and that error.

    status : "ok", "rank-deficient", ... of the estimate, or "failed" with the reason in `message`.
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
class Done:
    """What comes back: the line, and the files of the job's folder."""

    row: Row
    files: Mapping[str, str | bytes] = field(default_factory=dict)


def jobs_of(path: Path) -> list[Job]:
    """The jobs of a fleet file, names made distinct; raises SettingsError with file, line and key."""
    fleet = settings_from_text(FleetSettings, text_of(path), file=path.name)
    jobs: list[Job] = []
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    for settings in fleet.jobs:
        robot, record = (beside(name, path.parent) for name in (settings.robot, settings.record))
        wanted = settings.name or f"{Path(settings.robot).stem}-{Path(settings.record).name.split('.')[0]}"
        name = folder = re.sub(r"[^\w.-]+", "_", wanted).strip(".") or "job"
        while name.lower() in taken:
            numbers[folder.lower()] = number = numbers.get(folder.lower(), 1) + 1
            name = f"{folder}-{number}"
        taken.add(name.lower())
        jobs.append(Job(name, robot, record))
    return jobs


def beside(name: str, folder: Path) -> str:
    """A file as named in `folder`; packaged robots and datasets as they are."""
    return name if name in DATASETS or not Path(name).suffix else str(folder / name)


class Packer:
    """Reads what jobs need; every robot is emitted once."""

    def __init__(self, output: Path | None) -> None:
        self.output = output
        self.models: dict[str, tuple[GeneratedModel, ModelText]] = {}

    def __call__(self, job: Job) -> Parcel | Done:
        """The parcel of a job; where that cannot be had, the line that says why."""
        try:
            if job.robot not in self.models:
                with opened_model(job.robot) as model:
                    self.models[job.robot] = model, ModelText.of(model)
            model, text = self.models[job.robot]
            study, folder, records = study_and_records(job.record, model)
            further = read_records(study.validate.record, model, folder=folder)
            written = "" if self.output is None else study_text(study, folder, self.output / job.name)
        except (InputError, SymgenError, OSError) as e:
            return Done(Row(job.name, job.robot, job.record, message=str(e)))
        return Parcel(job, text, study, tuple(records), tuple(further), written)


def identified(context: None, parcel: Parcel) -> Done:
    """The work of one job, in any process; whatever goes wrong stays in its line."""
    job = parcel.job
    try:
        found = identification(parcel.model.load(), parcel.study, parcel.records, further=parcel.further, provenance=origin(parcel.records))
        files = identification_files(found, parcel.study_text) if parcel.study_text else {}
    except Exception as e:  # one job must not end the others
        message = str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"
        return Done(Row(job.name, job.robot, job.record, message=message))
    return Done(row_of(job, found), files)


def row_of(job: Job, found: Identification) -> Row:
    """The line of an identification."""
    every = found.every
    worst = max(every.per_joint, key=lambda joint: joint.relative_error)
    return Row(
        name=job.name,
        robot=found.model.NAME,
        record=found.name,
        rows=sum(joint.rows for joint in every.per_joint),
        parameters=len(every.names),
        essential=len(found.found.names),
        cond=every.cond,
        relative_error=every.relative_error,
        worst_joint=worst.joint,
        worst_error=worst.relative_error,
        status=every.status,
        message=every.message,
    )


def shortened(row: Row) -> Row:
    """The line with the first sentence of its message."""
    return replace(row, message=re.split(r"(?<=[.;]) |\n", row.message, maxsplit=1)[0])


def mapping_of(row: Row) -> dict[str, Any]:
    """The line as a mapping, for CSV and JSON."""
    return {name: getattr(row, name) for name in Row.__dataclass_fields__}
