"""Reading of measured files as Records, converted to the joint side and to SI units.

    records = read_records(settings, model, folder="measurements")

The steps are: columns, scale, units, drives, and then the clock. Units and side are explicit in the
settings, never guessed. A file whose columns are called t, q1 ... qn, tau1 ... taun needs no column
names. Bad input raises InputError, which names file, column and line or sample.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from runtime.controller.law import torque_law
from runtime.core.missing import COUNTS, Missing, bridged
from runtime.core.model import GeneratedModel, drives_of, joint_labels
from runtime.core.quaternions import continued
from runtime.core.record import (
    BASE_BIASES,
    BASE_IMU,
    BASE_QUATERNION,
    JOINT_CHANNELS,
    WRENCH,
    Origin,
    Record,
    require_finite,
)
from runtime.ground.clock import Stamps, rate_of, time_stamps
from runtime.ground.errors import InputError, ModelError
from runtime.ground.limits import LIMIT
from runtime.reading.columns import Conversion, column_names, conversion, require_alike
from runtime.reading.datasets import fetch
from runtime.reading.formats import file_extensions, read_table
from runtime.reading.late_torques import delays_of, inside, on_time
from runtime.reading.resampling import Stretch, resampled
from runtime.reading.settings import NONE, Columns, RecordSettings, each_record
from runtime.reading.table import Array, Table
from runtime.reading.units import time_unit
from runtime.reading.wrench_places import in_frames, wrench_places

IRREGULAR = 0.05
"""Between the rate of the settings and the median step of stamps that are resampled."""


def read_records(
    settings: Sequence[RecordSettings],
    model: GeneratedModel | None = None,
    *,
    folder: str | Path | None = None,
    missing: bool = False,
) -> list[Record]:
    """Read the records of one robot from their files; no two records have the same name.

    A record that `resample` splits at gaps becomes one record for each piece.

    Parameters
    ----------
    model : module, optional
        Emitted model of the robot, for its drives and its number of joints.
    folder : str or Path, optional
        Folder of relative file names; default: the current folder.
    missing : bool
        Whether positions may be missing, as for `signals.reader: counts`.
    """
    settings = each_record(tuple(settings))
    return [
        piece
        for record, label in zip(settings, labels(settings), strict=True)
        for piece in _pieces(record, label, model, Path(folder or ""), missing)
    ]


def _pieces(
    settings: RecordSettings,
    label: Label,
    model: GeneratedModel | None,
    folder: Path,
    missing: bool,
) -> list[Record]:
    """Read one record; return a list of this record, or of its parts between gaps of the time.

    `resample` splits a record at gaps and where time goes back.
    """
    tables = [
        read_table(path, settings.topic, settings.decimal)
        for path in record_files(settings, folder)
    ]
    hashes = {name: table.digest for name, table in zip(label.files, tables, strict=True)}
    first, last, other = _places(settings, tables)
    motors = [bool(x) for x in getattr(model, "LIMITS", {}).get("tau", ())]
    columns = column_names(settings, first, last, _names_of(model), motors)
    if columns.flies and getattr(model, "BASE", "fixed") == "fixed":
        raise InputError(
            "record.columns.wrench: none says that the robot flies, but its base is fixed; remove "
            "it, or use --base free",
            file=", ".join(hashes),
        )
    places = wrench_places(columns, model)
    signals = _signals(columns, settings.base.columns, first, last, other, missing)
    n = signals["q"].values.shape[1]
    _require_shapes(columns, signals, first, last)
    if model is not None and n != len(model.JOINTS):
        raise InputError(
            f"the record has {n} joints, but {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}; if the record has further joints, give the columns of the joints {model.JOINTS} in a study (record.columns.q, tau)",
            file=", ".join(hashes),
        )
    drives = None if model is None else drives_of(model)
    side = conversion(settings, drives, first, last, n)
    table = replace(signals["q"].table, columns={})
    command = side.command if "tau" in signals else ""
    notes = [signal.table.note for signal in signals.values() if signal.table.note]
    signals = {key: replace(x, table=replace(x.table, columns={})) for key, x in signals.items()}
    del tables, first, last, other  # the columns of the files
    samples = in_frames(_joint_side(settings, columns, signals, side, missing), places)
    del signals
    law = None
    if settings.by_law:
        limits = dict(getattr(model, "LIMITS", {}))
        law = torque_law(settings.controller, n, limits)
    stretches, rate, time = _uniform(settings, columns, table, samples)
    origin = Origin(
        files=hashes,
        time="; ".join(text for text in (time, *dict.fromkeys(notes)) if text),
        jitter=settings.jitter,
        drives=side.drives,
        torque_constant=side.constant,
        command=command,
        joints=() if model is None else joint_labels(model),
        whole="" if len(stretches) == 1 else label.name,
        simulated=settings.simulated,
        by_law=settings.by_law,
        sides=settings.sides,
    )
    keys = [key for key in samples if key != "t"]
    pieces = len(stretches)
    delay = delays_of(settings.delay, n)
    late_base = {
        key: np.full(samples[key].shape[1], settings.base.delay)
        for key in settings.base.columns
        if settings.base.delay
    }
    records = []
    for k, stretch in enumerate(stretches, start=1):
        piece = dict(zip(keys, stretch.signals, strict=True))
        if delay is not None:
            late = dict.fromkeys(("tau", "tau_ff"), delay)
            stretch, piece = _without_delay(stretch, piece, late)
        if late_base:
            stretch, piece = _without_delay(stretch, piece, late_base, "record.base.delay")
        if law is not None:
            piece = law.signals(stretch.t, piece, rate)
        wrenches = (f"{WRENCH}{j}" for j, _ in places.values())
        further = (*columns.further, *wrenches)
        channels = (*JOINT_CHANNELS, *further, *settings.base.columns, "law_v")
        if columns.flies:
            piece[f"{WRENCH}0"], channels = np.zeros((len(stretch.t), 6)), (*channels, f"{WRENCH}0")
        if settings.base.biases:
            piece[BASE_BIASES], channels = np.zeros((len(stretch.t), 6)), (*channels, BASE_BIASES)
        record = Record(
            stretch.t,
            piece["q"],
            piece.get("tau", np.zeros_like(piece["q"])),
            tau_known=piece.get("tau_known"),
            channels={key: piece[key] for key in channels if key in piece},
            rate=rate,
            name=label.name if pieces == 1 else f"{label.name} ({k} of {pieces})",
            missing=Missing(piece["missing"], side.follows) if "missing" in piece else None,
            origin=origin,
        )
        records.append(record)
    return records


def _without_delay(
    stretch: Stretch,
    piece: Mapping[str, Array],
    delays: Mapping[str, Array],
    key: str = "record.delay",
) -> tuple[Stretch, dict[str, Array]]:
    """Shift late signals of one record to the instants of the positions.

    delays : delays of the columns of each late signal, s. key : name of the delays in the study.
    """
    kept = inside(stretch.t, np.concatenate([*delays.values()]), key)
    late = {
        name: on_time(stretch.t, piece[name], delay)
        for name, delay in delays.items()
        if name in piece
    }
    shifted = {key: x[kept] for key, x in {**piece, **late}.items()}
    return Stretch(stretch.t[kept], tuple(shifted.values())), shifted


def columns_read(
    settings: RecordSettings, model: GeneratedModel, folder: str | Path | None = None
) -> Columns:
    """Find the names of the columns that are read of the files of a record."""
    tables = [
        read_table(path, settings.topic, settings.decimal)
        for path in record_files(settings, Path(folder or ""))
    ]
    first, last, _ = _places(settings, tables)
    motors = [bool(x) for x in getattr(model, "LIMITS", {}).get("tau", ())]
    return column_names(settings, first, last, _names_of(model), motors)


@dataclass(frozen=True, eq=False)
class Signal:
    """Columns of one measured quantity, such as all positions, shape (N, k), as in the file."""

    table: Table
    names: tuple[str, ...]
    values: Array

    def finite(self, values: Array, hint: str = "", largest: float | None = None) -> Array:
        """Return the values; raise InputError unless all are finite and at most `largest`."""
        limits = {} if largest is None else {"largest": largest}
        return require_finite(
            values, self.names, self.table.file, self.table.row, hint=hint, **limits
        )


def _signals(
    columns: Columns,
    base: Mapping[str, tuple[str, ...]],
    first: Table,
    last: Table,
    other: Table,
    missing: bool,
) -> dict[str, Signal]:
    """Read the columns of a record, and return them by quantity, for instance "q" or "tau"."""
    places = {
        "t": (first, () if columns.t is None else (columns.t,)),
        "q": (first, columns.q),
        "q_r": (first, columns.q_ref),
        "qd": (first, columns.qd),
        "qd_ref": (first, columns.qd_ref),
        "tau": (last, _columns_of_joints(columns.tau)),
        "tau_ff": (last, columns.tau_ff),
        "tau_known": (other, _columns_of_joints(columns.tau_known)),
        **{key: (first, names) for key, names in (*columns.further.items(), *base.items())},
    }
    asked = {key: place for key, place in places.items() if place[1]}
    chosen = {
        table: table.chosen([x for place, names in asked.values() if place is table for x in names])
        for table in dict.fromkeys((first, last, other))
    }
    signals = {}
    for key, (place, names) in asked.items():
        positions = key == "q"
        hint = f"; repair or cut the record{f'; {COUNTS}' if positions else ''}"
        values = chosen[place].read(names, empty=missing and positions, hint=hint)
        signals[key] = Signal(chosen[place], names, values)
    return signals


def _require_shapes(
    columns: Columns, signals: Mapping[str, Signal], first: Table, last: Table
) -> None:
    """Raise InputError unless all signals have N samples, and one column for each of n joints."""
    N, n = signals["q"].values.shape
    rows, width = signals.get("tau", signals["q"]).values.shape
    width += columns.tau.count(NONE) if "tau" in signals else 0
    require_alike(columns, first, last, (N, n), (rows, width))
    for key, title in (
        ("q_r", "reference positions"),
        ("qd", "velocities"),
        ("qd_ref", "reference velocities"),
        ("tau_ff", "feed-forward torques"),
        ("tau_known", "known torques"),
    ):
        if key not in signals:
            continue
        signal = signals[key]
        width = signal.values.shape[1]
        width += columns.tau_known.count(NONE) if key == "tau_known" else 0
        if width != n:
            raise InputError(
                f"found {width} {title} ({', '.join(signal.names)}); expected {n}, one per joint",
                file=first.file,
            )
    for signal in signals.values():
        if len(signal.values) != N:
            raise InputError(
                f"{first.file} has {N} samples, but {', '.join(signal.names)} has {len(signal.values)}; expected both at the same instants",
                file=signal.table.file,
            )


def _joint_side(
    settings: RecordSettings,
    columns: Columns,
    signals: dict[str, Signal],
    side: Conversion,
    missing: bool,
) -> dict[str, Array]:
    """Convert the signals to the joint side of the gears and to SI units.

    The result also has the entry `missing`, True for each missing position, if there are any. Each
    signal is removed from `signals` once it is converted, so that its memory is free.
    """
    samples: dict[str, Array] = {}
    for key in tuple(signals):
        signal = signals.pop(key)
        values = signal.values
        if key == "q" and missing and np.isnan(values).any():
            samples["missing"] = np.isnan(values)
            values = bridged(values, samples["missing"])
        values = signal.finite(values, COUNTS if key == "q" else "")
        if key == "t":
            samples[key] = values[:, 0] * time_unit(settings.units.t)
            continue
        if key in ("q", "q_r"):
            values = side.position(values)
        elif key in ("qd", "qd_ref"):
            values = side.velocity(values)
        elif key == "tau":
            values = side.torque(_spread(values, columns.tau))
        elif key == "tau_ff":
            values = side.torque(values)
        elif key == "tau_known":
            values = _spread(values, columns.tau_known)
        elif key == BASE_IMU:
            values = settings.base.of_sensor(values)
        elif key == BASE_QUATERNION:
            values = continued(values)  # before it is resampled
        elif key.startswith(WRENCH) and key not in columns.channels:
            values = values * settings.scale.wrench
        signal.finite(values, largest=LIMIT.LARGEST_NUMBER)
        samples[key] = values
    return samples


def _columns_of_joints(names: Sequence[str]) -> tuple[str, ...]:
    """Return the column names, without the marks of the joints that have no column."""
    return tuple(name for name in names if name != NONE)


def _spread(values: Array, names: Sequence[str]) -> Array:
    """Insert columns of zeros for joints without a column; return shape (N, n)."""
    present = [name != NONE for name in names]
    if all(present):
        return values
    spread = np.zeros((len(values), len(names)))
    spread[:, present] = values
    return spread


def _uniform(
    settings: RecordSettings, columns: Columns, table: Table, samples: Mapping[str, Array]
) -> tuple[list[Stretch], float, str]:
    """Return samples at a uniform rate, this rate in Hz, and a sentence on the time stamps.

    The samples are unchanged, or resampled if the settings request it. table : file of the
    positions and of the time.
    """
    t = samples.get("t")
    signals = tuple(values for key, values in samples.items() if key != "t")
    if t is None:
        if settings.rate is None:
            raise InputError(
                "no time column and no rate; set record.rate (Hz) or record.columns.t",
                file=table.file,
            )
        t = np.arange(len(signals[0])) / settings.rate
        if table.starts:
            return _by_episodes(settings, columns, table, t, signals)
        return [Stretch(t, signals)], settings.rate, ""
    if settings.resample is None and table.starts:
        return _by_episodes(settings, columns, table, t, signals)
    if settings.resample is None:
        stamps = Stamps(table.file, columns.t, table.row, settings.rate, settings.jitter)
        rate = rate_of(stamps, t)
        return [Stretch(t, signals)], rate, time_stamps(t, file=table.file).to_text(table.row)
    regularity = time_stamps(t, gap=settings.resample.longest, file=table.file)
    if settings.rate is not None and abs(1 / regularity.period / settings.rate - 1) > IRREGULAR:
        raise InputError(
            f"the time stamps have the rate {1 / regularity.period:g} Hz, but record.rate is "
            f"{settings.rate:g} Hz; correct record.rate, the time or the unit of time",
            file=table.file,
        )
    try:
        stretches, rate, done = resampled(
            t, signals, regularity, settings.resample, settings.rate, file=table.file
        )
    except InputError as e:
        raise InputError(
            f"{e.message}. The stamps: {regularity.to_text(table.row)}",
            file=table.file,
            column=columns.t,
        ) from None
    return stretches, rate, f"{regularity.to_text(table.row)}; {done}"


def _by_episodes(
    settings: RecordSettings, columns: Columns, table: Table, t: Array, signals: Sequence[Array]
) -> tuple[list[Stretch], float, str]:
    """Cut samples at the starts of the episodes of a file; return the episodes, and the rate, Hz.

    The time stamps of each episode must be uniform. Episodes that are too short are left out.
    """
    cuts = [0, *table.starts, len(t)]
    long = [(a, b) for a, b in pairwise(cuts) if b - a >= LIMIT.FEWEST_SAMPLES]
    if not long:
        raise InputError(
            f"every episode is shorter than {LIMIT.FEWEST_SAMPLES} samples", file=table.file
        )
    stretches = [Stretch(t[a:b], tuple(x[a:b] for x in signals)) for a, b in long]
    stamps = Stamps(table.file, columns.t, table.row, settings.rate, settings.jitter)
    rates = [rate_of(stamps, stretch.t) for stretch in stretches]
    if max(rates) > (1 + IRREGULAR) * min(rates):
        raise InputError(
            f"the episodes have rates of {min(rates):.6g} to {max(rates):.6g} Hz; expected one rate",
            file=table.file,
        )
    short = len(cuts) - 1 - len(long)
    left = f"{short} episodes shorter than {LIMIT.FEWEST_SAMPLES} samples left out" if short else ""
    return stretches, settings.rate or float(np.median(rates)), left


def _places(settings: RecordSettings, tables: Sequence[Table]) -> tuple[Table, Table, Table]:
    """Find the tables that contain the positions, the torques, and the known torques of a record.

    The second of two files holds the torques, unless the second file has only the known torques and
    the first file has the torques.
    """
    first = tables[0]
    last = tables[-1]
    columns = settings.columns
    if len(tables) == 3 or not columns.tau_known:
        return first, tables[min(1, len(tables) - 1)], last
    known = {*_columns_of_joints(columns.tau_known)}
    torques = {*_columns_of_joints(columns.tau)} or {"tau1"}
    in_first = known <= {*first.names}
    apart = not in_first and torques <= {*first.names}
    return first, first if apart else last, first if in_first else last


def record_files(settings: RecordSettings, folder: Path) -> list[Path]:
    """Return the paths of the files of a record; files of a dataset are downloaded if needed."""
    if not settings.files:
        raise InputError("the record names no file; set record.files")
    if settings.dataset is None:
        return [folder / file for file in settings.files]
    return [fetch(settings.dataset, file) for file in settings.files]


def _names_of(model: Any) -> tuple[str, ...]:
    """Return the names of the joints of a generated model, in the order of JOINTS.

    The result is empty if the robot file does not name every joint.
    """
    names = getattr(model, "LABELS", {})
    if not isinstance(names, Mapping) or not all(
        isinstance(name, str) and name.isprintable() for name in names.values()
    ):
        raise ModelError(
            "LABELS must map joints to names; generate the module again", file=model.NAME
        )
    if model is None or not names.keys() >= {*model.JOINTS}:
        return ()
    return tuple(names[j] for j in model.JOINTS)


@dataclass(frozen=True)
class Label:
    """Name of a record, and the names of its files, as they appear in results."""

    name: str
    files: tuple[str, ...]


def labels(settings: Sequence[RecordSettings]) -> list[Label]:
    """Give each record, and each file of the records, a unique name for results.

    A record has the name in its settings, else the name of its dataset, else the name of its first
    file without ending. Equal names are preceded by the folder (day1/run, day2/run), by more
    folders if needed, and finally followed by a number. A file has its own name, or its path if
    another file has the same name.
    """
    paths = [Path(s.dataset or "") / (s.files[0] if s.files else "") for s in settings]
    parts = [[*path.parts[:-1], stem(path.name)] for path in paths]
    names = [s.name or s.dataset or part[-1] for s, part in zip(settings, parts, strict=True)]
    for depth in range(2, max(map(len, parts), default=0) + 1):
        count = Counter(names)
        names = [
            "/".join(part[-depth:]) if count[name] > 1 and s.name is None else name
            for s, part, name in zip(settings, parts, names, strict=True)
        ]
    names = [
        f"{name} ({names[:k].count(name) + 1})" if name in names[:k] else name
        for k, name in enumerate(names)
    ]
    same = Counter(Path(file).name for file in {file for s in settings for file in s.files})
    files = [
        tuple(Path(file).name if same[Path(file).name] == 1 else file for file in s.files)
        for s in settings
    ]
    return [Label(name, of) for name, of in zip(names, files, strict=True)]


def stem(file: str) -> str:
    """Return the name of a measured file without its ending: log.1 of log.1.csv.gz."""
    name = file[:-3] if file.lower().endswith(".gz") else file
    ending = next((ending for ending in file_extensions() if name.lower().endswith(ending)), "")
    return name[: len(name) - len(ending)] or file
