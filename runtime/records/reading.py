"""From the files of a measurement to a Record: columns, scale, units, then the drives.

    record = read_record(study.record[0], drives, folder=study_file.parent)

Units and side are explicit in the settings, never guessed. A file whose columns are called t, q1 ... qn, tau1 ... taun needs no column names.
Bad input raises InputError, which names file, column and line or sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.errors import InputError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.records.clock import clock
from runtime.records.formats.table import Table, read_table
from runtime.records.joint_side import column_names, conversion, finite_columns, reference_columns, require_alike
from runtime.records.record import Record
from runtime.records.resampling import Stretch, resampled
from runtime.records.time_stamps import TimeStamps, time_stamps
from runtime.settings.record import RecordSettings, each_record
from runtime.settings.units import time_unit

Array = np.ndarray

IRREGULAR = 0.05  # between the rate of the settings and the median step of stamps that are resampled


def read_record(settings: RecordSettings, drives: Drives | None = None, *, folder: Path | None = None) -> Record:
    """The record that the settings describe, joint side, SI; InputError where `resample` splits it into several.

    drives : of the robot; needed where a side is "motor".   folder : where relative file names start (default: the current folder).
    """
    parts = read_parts(settings, drives, folder=folder)
    if len(parts) > 1:
        raise InputError(f"{len(parts)} pieces between gaps; read_records gives them all", file=parts[0].name)
    return parts[0]


def read_parts(settings: RecordSettings, drives: Drives | None = None, *, folder: Path | None = None) -> list[Record]:
    """The record, or the records into which `resample` splits it at gaps and where time goes back."""
    paths = record_files(settings, folder)
    tables = [read_table(path, settings.topic, settings.decimal) for path in paths]
    first, last = tables[0][0], tables[-1][0]
    names = column_names(settings, first, last)
    q, tau = finite_columns(first, names.q), finite_columns(last, names.tau)
    require_alike(names, first, last, q.shape, tau.shape)
    n = q.shape[1]
    if drives is not None and drives.n != n:
        raise InputError(f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file)
    side = conversion(settings, drives, first, last, n)
    q_r = reference_columns(first, names.qr, n)
    signals = [side.position(q), side.torque(tau), *([] if q_r is None else [side.position(q_r)])]
    stretches, rate, text = _uniform(settings, first, names.t, signals)
    name = settings.name or settings.dataset or paths[0].name.split(".")[0]
    files = file_hashes(settings, [digest for _, digest in tables])
    K = len(stretches)
    parts = []
    for k, stretch in enumerate(stretches, start=1):
        own, torque, *reference = stretch.signals
        called = name if K == 1 else f"{name} ({k} of {K})"
        parts.append(Record(stretch.t, own, torque, rate, called, files, reference[0] if reference else None, text))
    return parts


def read_records(settings: Sequence[RecordSettings], model: GeneratedModel, *, folder: Path | None = None) -> list[Record]:
    """Several records of the robot of an emitted model, with its drives."""
    drives = None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)
    records = [record for s in each_record(tuple(settings)) for record in read_parts(s, drives, folder=folder)]
    for record in records:
        if record.n != len(model.JOINTS):
            raise InputError(f"{record.n} joints; {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}", file=record.name)
    return records


def file_hashes(settings: RecordSettings, digests: Sequence[str]) -> dict[str, str]:
    """Hashes by the names of the files, by their paths where two have the same name."""
    distinct = len({Path(file).name for file in settings.files}) == len(settings.files)
    return {Path(file).name if distinct else file: digest for file, digest in zip(settings.files, digests, strict=True)}


def record_files(settings: RecordSettings, folder: Path | None = None) -> list[Path]:
    """Paths of the files of a record; those of a dataset are looked up, and downloaded where need be."""
    if not settings.files:
        raise InputError("the record names no file; set record.files")
    if settings.dataset is None:
        return [(folder or Path()) / file for file in settings.files]
    from runtime.records.datasets import fetch  # pooch, only where a dataset is asked for

    return [fetch(settings.dataset, file) for file in settings.files]


def _uniform(settings: RecordSettings, table: Table, name: str | None, signals: Sequence[Array]) -> tuple[list[Stretch], float, str]:
    """The samples at a uniform rate, Hz, and what their time stamps are like: as they are, or resampled where the settings ask for it."""
    N = len(signals[0])
    if name is None:
        if settings.rate is None:
            raise InputError("no time column and no rate; set record.rate (Hz) or record.columns.t", file=table.file)
        return [Stretch(np.arange(N) / settings.rate, tuple(signals))], settings.rate, ""
    t = finite_columns(table, [name])[:, 0] * time_unit(settings.units.t)
    if settings.resample is None:
        rate = _clock(settings, table, name, t)
        return [Stretch(t, tuple(signals))], rate, time_stamps(t, file=table.file).to_text(table.row)
    stamps = time_stamps(t, gap=settings.resample.longest, file=table.file)
    if settings.rate is not None and abs(1 / stamps.period / settings.rate - 1) > IRREGULAR:
        raise InputError(
            f"time runs at {1 / stamps.period:g} Hz, record.rate is {settings.rate:g} Hz; correct one, or the unit of time", file=table.file
        )
    try:
        stretches, rate, done = resampled(t, signals, stamps, settings.resample, settings.rate, file=table.file)
    except InputError as e:
        raise InputError(f"{e.message}. The stamps: {stamps.to_text(table.row)}", file=table.file, column=name) from None
    return stretches, rate, f"{stamps.to_text(table.row)}; {done}"


def _clock(settings: RecordSettings, table: Table, name: str, t: Array) -> float:
    """The rate of uniform stamps, Hz; where they are not, the error tells all there is, since the first place is rarely the only one."""
    try:
        return clock(settings, lambda: [table], name).rate
    except InputError as e:
        if not (np.diff(t) > 0).any():
            raise
        stamps = time_stamps(t, file=table.file)
        cure = "" if stamps.regular and stamps.jitter <= settings.jitter else f". record.resample: {_cure(stamps)}"
        raise InputError(f"{e.message}. In all: {stamps.to_text(table.row)}{cure}", file=e.file, column=e.column, row=e.row) from None


def _cure(stamps: TimeStamps) -> str:
    cut, cuts = ("{gaps: split}", "cuts there and ") if stamps.gaps or stamps.resets else ("{}", "")
    return f"{cut} {cuts}interpolates at the stamps, with method: count it takes the samples as uniform"
