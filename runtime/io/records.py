"""From the files of a measurement to a Record: columns, scale, units, then the drives.

    record = read_record(study.record[0], drives, folder=study_file.parent)

Units and side are explicit in the settings, never guessed. A file whose columns are called t, q1 ... qn, tau1 ... taun needs no column names.
Bad input raises InputError, which names file, column and line or sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.drives import Drives
from runtime.errors import InputError
from runtime.io.conversion import column_names, conversion, finite_columns, reference_columns
from runtime.io.table import Table, read_table
from runtime.io.timing import clock
from runtime.io.units import time_unit
from runtime.model import GeneratedModel
from runtime.record import Record
from runtime.study import RecordSettings

Array = np.ndarray


def read_record(settings: RecordSettings, drives: Drives | None = None, *, folder: Path | None = None) -> Record:
    """The record that the settings describe, joint side, SI.

    drives : of the robot; needed where side is "motor".   folder : where relative file names start (default: the current folder).
    """
    paths = record_files(settings, folder)
    tables = [read_table(path, settings.topic) for path in paths]
    first, last = tables[0][0], tables[-1][0]
    names = column_names(settings, first, last)
    q, tau = finite_columns(first, names.q), finite_columns(last, names.tau)
    if q.shape != tau.shape:
        raise InputError(
            f"positions {q.shape} in {first.file}, torques {tau.shape} in {last.file}; expected as many samples and joints in both"
        )
    n = q.shape[1]
    if drives is not None and drives.n != n:
        raise InputError(f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file)
    t, rate = _time(settings, first, names.t, len(q))
    side = conversion(settings, drives, first, last, n)
    q_r = reference_columns(first, names.qr, n)
    return Record(
        t,
        side.position(q),
        side.torque(tau),
        rate,
        settings.name or settings.dataset or paths[0].name.split(".")[0],
        file_hashes(settings, [digest for _, digest in tables]),
        None if q_r is None else side.position(q_r),
    )


def read_records(settings: Sequence[RecordSettings], model: GeneratedModel, *, folder: Path | None = None) -> list[Record]:
    """Several records of the robot of an emitted model, with its drives."""
    drives = None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)
    records = [read_record(s, drives, folder=folder) for s in settings]
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
    from runtime.io.datasets import fetch  # pooch, only where a dataset is asked for

    return [fetch(settings.dataset, file) for file in settings.files]


def _time(settings: RecordSettings, table: Table, name: str | None, N: int) -> tuple[Array, float]:
    """Time of the samples, s, from the first sample on, and the sampling rate, Hz."""
    if name is None:
        if settings.rate is None:
            raise InputError("no time column and no rate; set record.rate (Hz) or record.columns.t", file=table.file)
        return np.arange(N) / settings.rate, settings.rate
    t = finite_columns(table, [name])[:, 0] * time_unit(settings.units.t)
    return t, clock(settings, lambda: [table], name).rate
