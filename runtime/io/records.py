"""From the files of a measurement to a Record: columns, scale, units, then the drives.

    record = read_record(study.record[0], drives, folder=study_file.parent)

Units and side are explicit in the settings, never guessed. A file whose columns are called t, q1 ... qn, tau1 ... taun needs no column names.
Bad input raises InputError, which names file, column and line or sample.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from runtime.drives import Drives
from runtime.errors import InputError
from runtime.io.table import Table, read_table
from runtime.model import GeneratedModel
from runtime.record import Record
from runtime.study import Columns, RecordSettings

Array = np.ndarray

POSITION = {
    "rad": 1.0,
    "deg": np.pi / 180,
    "rev": 2 * np.pi,
    "counts": 2 * np.pi,
    "m": 1.0,
    "mm": 1e-3,
}  # to rad or m; counts per revolution apart
TIME = {"s": 1.0, "ms": 1e-3}  # to s
COMMANDS = ("A", "V")  # units that a torque constant turns into torque
RATE_TOLERANCE = 1e-3  # between the rate of the settings and that of the time column


def read_record(settings: RecordSettings, drives: Drives | None = None, *, folder: Path | None = None) -> Record:
    """The record that the settings describe, joint side, SI.

    drives : of the robot; needed where side is "motor".   folder : where relative file names start (default: the current folder).
    """
    paths = record_files(settings, folder)
    tables = [read_table(path) for path in paths]
    first, last = tables[0][0], tables[-1][0]
    names = _column_names(settings, first, last)
    q, tau = _finite(first, names.q), _finite(last, names.tau)
    if q.shape != tau.shape:
        raise InputError(
            f"positions {q.shape} in {first.file}, torques {tau.shape} in {last.file}; expected as many samples and joints in both"
        )
    n = q.shape[1]
    if drives is not None and drives.n != n:
        raise InputError(f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file)
    t, rate = _time(settings, first, names.t, len(q))
    unit = _scale(settings.scale.q, first, n, "scale.q") * _position_units(settings, n)
    q, q_r = q * unit, _reference(first, names.qr, n, unit)
    tau = tau * _scale(settings.scale.tau, last, n, "scale.tau")
    distinct = len({Path(file).name for file in settings.files}) == len(settings.files)
    files = {Path(file).name if distinct else file: digest for file, (_, digest) in zip(settings.files, tables, strict=True)}
    name = settings.name or settings.dataset or paths[0].name.split(".")[0]
    constant = _torque_constant(settings, drives, n)
    if settings.side == "joint":
        return Record(t, q, tau * constant, rate, name, files, q_r)
    if drives is None:
        raise InputError(
            "side is motor but the robot has no drives; give them in the robot file, or a record of the joint side", file=first.file
        )
    used = replace(drives, torque_constant=constant, coupling=settings.coupling)
    q_r = None if q_r is None else used.joint_position(q_r)
    return Record(t, used.joint_position(q), used.joint_torque(tau), rate, name, files, q_r)


def read_records(settings: Sequence[RecordSettings], model: GeneratedModel, *, folder: Path | None = None) -> list[Record]:
    """Several records of the robot of an emitted model, with its drives."""
    drives = None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)
    records = [read_record(s, drives, folder=folder) for s in settings]
    for record in records:
        if record.n != len(model.JOINTS):
            raise InputError(f"{record.n} joints; {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}", file=record.name)
    return records


def record_files(settings: RecordSettings, folder: Path | None = None) -> list[Path]:
    """Paths of the files of a record; those of a dataset are looked up, and downloaded where need be."""
    if not settings.files:
        raise InputError("the record names no file; set record.files")
    if settings.dataset is None:
        return [(folder or Path()) / file for file in settings.files]
    from runtime.io.datasets import fetch  # pooch, only where a dataset is asked for

    return [fetch(settings.dataset, file) for file in settings.files]


def _column_names(settings: RecordSettings, first: Table, last: Table) -> Columns:
    """The names in the settings, or t, q1 ... qn, tau1 ... taun where they are left out."""
    given = settings.columns
    t = given.t if given.t is not None or settings.rate is not None or "t" not in first.names else "t"
    qr = given.qr or (_numbered("qr", first) if "qr1" in first.names else ())
    return Columns(t, given.q or _numbered("q", first), given.tau or _numbered("tau", last), qr)


def _reference(table: Table, names: Sequence[str], n: int, unit: Array) -> Array | None:
    """Reference positions in the unit of q, where the file holds them."""
    if not names:
        return None
    q_r = _finite(table, names)
    if q_r.shape[1] != n:
        raise InputError(f"{q_r.shape[1]} reference positions {', '.join(names)}; expected {n}", file=table.file)
    return q_r * unit


def _numbered(quantity: str, table: Table) -> tuple[str, ...]:
    found = sorted((int(m[1]), name) for name in table.names if (m := re.fullmatch(rf"{quantity}(\d+)", name)))
    if not found:
        raise InputError(
            f"no columns {quantity}1, {quantity}2 ... among {', '.join(table.names)}; name them in record.columns.{quantity}",
            file=table.file,
        )
    return tuple(name for _, name in found)


def _finite(table: Table, names: Sequence[str]) -> Array:
    """The columns, shape (N, k), without nan or infinity."""
    x = table.stack(names)
    bad = np.argwhere(~np.isfinite(x))
    if len(bad):
        i, j = bad[0]
        column = names[j] if len(names) == x.shape[1] else f"{', '.join(names)} ({j + 1})"
        raise InputError(
            f"{x[i, j]} ({len(bad)} such values in all); expected finite numbers, repair or cut the record",
            file=table.file,
            column=column,
            row=table.row(i),
        )
    return x


def _time(settings: RecordSettings, table: Table, name: str | None, N: int) -> tuple[Array, float]:
    """Time of the samples, s, from the first sample on, and the sampling rate, Hz."""
    if name is None:
        if settings.rate is None:
            raise InputError("no time column and no rate; set record.rate (Hz) or record.columns.t", file=table.file)
        return np.arange(N) / settings.rate, settings.rate
    t = _finite(table, [name])[:, 0] * TIME[settings.units.t]
    if len(t) < 2:
        raise InputError(f"{len(t)} samples; a record needs more", file=table.file)
    step = np.diff(t)
    if (step <= 0).any():
        i = int(np.argmax(step <= 0))
        raise InputError(
            f"time goes from {t[i]:g} s to {t[i + 1]:g} s; expected increasing time", file=table.file, column=name, row=table.row(i + 1)
        )
    rate = (len(t) - 1) / (t[-1] - t[0])
    if settings.rate is not None and abs(rate / settings.rate - 1) > RATE_TOLERANCE:
        raise InputError(
            f"time runs at {rate:g} Hz, record.rate is {settings.rate:g} Hz; correct one, or the unit of time", file=table.file, column=name
        )
    deviation = np.abs(t - t[0] - np.arange(len(t)) / rate) * rate
    if deviation.max() > settings.jitter:
        i = int(np.argmax(np.abs(step * rate - 1)))
        raise InputError(
            f"time is not uniform: off the grid by up to {deviation.max():.3g} sampling periods, step {step[i]:g} s here, {1 / rate:g} s on average; "
            "resample the record, or raise record.jitter if the clock is at fault",
            file=table.file,
            column=name,
            row=table.row(i + 1),
        )
    return t, settings.rate or float(rate)


def _per_joint(value: float | Sequence[float], n: int, key: str, table: Table | None = None) -> Array:
    x = np.atleast_1d(np.asarray(value, dtype=float))
    if len(x) not in (1, n):
        raise InputError(
            f"record.{key} has {len(x)} values; expected one or {n}, one per joint", file=None if table is None else table.file
        )
    return np.broadcast_to(x, (n,))


def _scale(scale: float | tuple[float, ...] | str, table: Table, n: int, key: str) -> Array:
    return _per_joint(table.scalar(scale) if isinstance(scale, str) else scale, n, key, table)


def _each(units: str | tuple[str, ...], n: int, key: str) -> tuple[str, ...]:
    each = units if isinstance(units, tuple) else (units,) * n
    if len(each) != n:
        raise InputError(f"record.{key} has {len(each)} units; expected one or {n}, one per joint")
    return each


def _position_units(settings: RecordSettings, n: int) -> Array:
    """Factors to rad or m, shape (n,)."""
    units = _each(settings.units.q, n, "units.q")
    counts = _per_joint(1.0 if settings.counts_per_revolution is None else settings.counts_per_revolution, n, "counts_per_revolution")
    return np.array([POSITION[unit] / (counts[j] if unit == "counts" else 1.0) for j, unit in enumerate(units)])


def _torque_constant(settings: RecordSettings, drives: Drives | None, n: int) -> Array:
    """Factors from the unit of tau to N m or N, shape (n,): a torque constant for A and V, 1 for a torque."""
    units = _each(settings.units.tau, n, "units.tau")
    if not any(unit in COMMANDS for unit in units):
        return np.ones(n)
    if settings.torque_constant is not None:
        constant = _per_joint(settings.torque_constant, n, "torque_constant")
    elif drives is not None and settings.side == "motor":
        constant = drives.torque_constant
    else:
        raise InputError(f"tau is in {', '.join(units)} but there is no torque constant; set record.torque_constant")
    return np.array([constant[j] if unit in COMMANDS else 1.0 for j, unit in enumerate(units)])
