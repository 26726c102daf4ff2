"""The files of one record, opened and checked: columns, lengths, joints, and how their numbers
become joint side, SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import InputError, ModelError
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of, joint_labels
from runtime.records.clock import Stamps
from runtime.records.datasets import fetch
from runtime.records.formats.columns import Array, Table
from runtime.records.formats.table import open_table
from runtime.records.joint_side import (
    Conversion,
    asked_columns,
    column_names,
    conversion,
    groups_of,
    require_alike,
)
from runtime.records.labels import Label, labels
from runtime.records.law import TorqueLaw, torque_law
from runtime.records.measured import Samples
from runtime.records.missing import COUNTS, bridged
from runtime.records.record import JOINT_CHANNELS, Origin, require_finite
from runtime.settings.record import NONE, Columns, RecordSettings, each_record
from runtime.settings.units import time_unit


@dataclass(frozen=True, eq=False)
class RecordFiles:
    """Measured files: positions, time and reference in one, torques in the same or another, known
    torques in one of these or in a third.

    Attributes
    ----------
    settings : RecordSettings
        What the columns mean.
    name : str
        Of the record.
    hashes : mapping of str to str
        SHA-256 by file.
    tables : tuple of 3 Table
        Files of the positions, of the torques, of the known torques; some may be the same.
    columns : Columns
        Names of the columns.
    samples : int
        N.
    n : int
        Number of joints.
    side : Conversion
        From the columns to joint side, SI.
    missing : bool
        Whether positions may be missing.
    law : TorqueLaw or None
        Whose torque stands for the measured one.
    joints : tuple of str
        What results call the joints; none where no model is given.
    """

    settings: RecordSettings
    name: str
    hashes: Mapping[str, str]
    tables: tuple[Table, Table, Table]
    columns: Columns
    samples: int
    n: int
    side: Conversion
    missing: bool
    law: TorqueLaw | None
    joints: tuple[str, ...] = ()

    def origin(self, time: str = "") -> Origin:
        """How the record was read; time : what its stamps were like."""
        return Origin(
            files=self.hashes,
            time=time,
            jitter=self.settings.jitter,
            drives=self.side.drives,
            torque_constant=self.side.constant,
            joints=self.joints,
            simulated=self.settings.simulated,
        )

    @property
    def first(self) -> Table:
        """The file of the positions."""
        return self.tables[0]

    @property
    def stamps(self) -> Stamps:
        """How messages name the time stamps, and what they must be."""
        return Stamps(
            self.first.file,
            self.columns.t,
            self.first.row,
            self.settings.rate,
            self.settings.jitter,
        )

    @property
    def note(self) -> str:
        """What the files tell of the columns that are read, a sentence; "" for nothing."""
        notes = (
            table.note(list(groups.values()))
            for table, groups in groups_of(self.columns, self.tables)
        )
        return "; ".join(note for note in notes if note)

    def read(self) -> Samples:
        """All samples, joint side, SI."""
        parts: dict[str, Array] = {}
        for table, groups in groups_of(self.columns, self.tables):
            parts |= zip(groups, table.read(list(groups.values()), self.samples), strict=True)
        return self._converted(parts)

    @property
    def stated_rate(self) -> float:
        """Sampling rate that the settings state, Hz; InputError where they state none."""
        if self.settings.rate is None:
            raise InputError(
                "no time column and no rate; set record.rate (Hz) or record.columns.t",
                file=self.first.file,
            )
        return self.settings.rate

    def close(self) -> None:
        """End the processes that read the files."""
        for table in self.tables:
            table.close()

    def _converted(self, parts: dict[str, Array]) -> Samples:
        """Samples as the files hold them in the joint side, SI."""
        missing = (
            np.isnan(parts["q"]) if self.missing else np.empty((len(parts["q"]), 0), dtype=bool)
        )
        if missing.any():
            parts["q"] = bridged(parts["q"], missing)
        sides = {"tau": self.side.torque, "tau_known": self._on_joints, "t": self._time}
        sides |= dict.fromkeys(("q", "q_r"), self.side.position)
        sides |= dict.fromkeys(("qd", "qd_ref"), self.side.velocity)
        sides |= {"tau_ff": self.side.torque, "q_link": self._behind_gears}
        wrench = partial(np.multiply, self.settings.scale.wrench)
        sides |= dict.fromkeys(self.columns.further, wrench)
        sides |= dict.fromkeys(self.columns.channels, np.asarray)
        x: dict[str, Array] = {}
        for table, groups in groups_of(self.columns, self.tables):
            for key, names in groups.items():
                hint = COUNTS if key == "q" and not self.missing else ""
                values = require_finite(parts[key], names, table.file, table.row, hint)
                x[key] = y = sides[key](values)
                if key != "t":
                    most = LIMIT.LARGEST_NUMBER
                    y = y[:, ~np.isnan(y).all(axis=0)] if key == "q_link" else y
                    require_finite(y, names, table.file, table.row, largest=most)
        channels = {k: x[k] for k in (*JOINT_CHANNELS, *self.columns.further) if k in x}
        return Samples(x.get("t"), x["q"], x.get("tau"), missing, x.get("tau_known"), channels)

    def _on_joints(self, known: Array) -> Array:
        """Known torques with zeros where a joint has none, shape (N, n)."""
        return _spread(known, self.columns.tau_known, 0.0)

    def _behind_gears(self, q: Array) -> Array:
        """Positions behind the gears, rad or m; nan where a joint has no encoder there."""
        return np.asarray(_spread(q, self.columns.q_link, np.nan) * self.side.positions)

    def _time(self, t: Array) -> Array:
        return np.asarray(t[:, 0] * time_unit(self.settings.units.t))


def open_records(
    settings: Sequence[RecordSettings],
    model: GeneratedModel | None,
    folder: str | Path | None,
    *,
    missing: bool = False,
) -> Iterator[RecordFiles]:
    """The files of each record of one robot, opened behind one another; no name twice.

    Parameters
    ----------
    model : module, optional
        Emitted model of the robot, for its drives and its number of joints.
    folder : str or Path, optional
        Where relative file names start; default: the current folder.
    missing : bool
        Whether positions may be missing: nan, an empty field, a null.
    """
    settings, drives = each_record(tuple(settings)), None if model is None else drives_of(model)
    for one, label in zip(settings, labels(settings), strict=True):
        joints = names_of(model)
        opened = open_record(
            one,
            label,
            drives,
            Path(folder or ""),
            joints,
            missing=missing,
            limits=dict(getattr(model, "LIMITS", {})),
        )
        if model is not None and opened.n != len(model.JOINTS):
            raise InputError(
                f"{opened.n} joints; {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}",
                file=", ".join(opened.hashes),
            )
        yield opened if model is None else replace(opened, joints=joint_labels(model))


def open_record(
    settings: RecordSettings,
    label: Label,
    drives: Drives | None,
    folder: Path,
    joints: Sequence[str],
    *,
    missing: bool,
    limits: Mapping[str, Any],
) -> RecordFiles:
    """The files of a record, opened.

    Parameters
    ----------
    label : Label
        Names of the record and of its files.
    drives : Drives or None
        Of the robot.
    folder : Path
        Where relative file names start.
    joints : sequence of str
        Names of the joints of the robot, where it has them.
    missing : bool
        As for `open_records`.
    limits : mapping
        LIMITS of the robot.
    """
    opened = [
        open_table(path, settings.topic, settings.decimal)
        for path in record_files(settings, folder)
    ]
    first, last, other = tables = places(settings, opened)
    names = column_names(settings, first, last, joints)
    first.positions, first.missing = frozenset(names.q), missing
    counts: dict[Table, int] = {}
    widths: dict[str, int] = {}
    for table, groups in groups_of(names, tables):
        counts[table] = table.samples(list(groups.values()))
        widths |= zip(groups, table.widths(list(groups.values())), strict=True)
    samples, n = counts[first], widths["q"]
    torques = (counts.get(last, samples), widths.get("tau", n))
    require_alike(names, first, last, (samples, n), torques)
    if drives is not None and drives.n != n:
        raise InputError(
            f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file
        )
    if "tau_known" in widths:
        widths["tau_known"] += names.tau_known.count(NONE)
    widths["q_link"] = widths.get("q_link", n) + names.q_link.count(NONE)
    for key, title in (
        ("q_r", "reference positions"),
        ("qd", "velocities"),
        ("qd_ref", "reference velocities"),
        ("q_link", "positions behind the gears"),
        ("tau_ff", "feed-forward torques"),
        ("tau_known", "known torques"),
    ):
        if widths.get(key, n) != n:
            raise InputError(
                f"{widths[key]} {title} {', '.join(asked_columns(names)[key])}; expected {n}",
                file=first.file,
            )
    if "tau_known" in widths and counts[other] != samples:
        raise InputError(
            (
                f"{samples} samples in {first.file}, {counts[other]} known torques; expected the "
                "same "
                "instants"
            ),
            file=other.file,
        )
    hashes = dict(zip(label.files, (table.digest for table in opened), strict=True))
    return RecordFiles(
        settings,
        label.name,
        hashes,
        tables,
        names,
        samples,
        n,
        conversion(settings, drives, first, last, n),
        missing,
        torque_law(settings.controller, n, limits) if settings.by_law else None,
    )


def _spread(x: Array, names: Sequence[str], absent: float) -> Array:
    """Columns x of the joints that have one, `absent` for the others, shape (N, n)."""
    own = [name != NONE for name in names]
    if all(own):
        return x
    spread = np.full((len(x), len(own)), absent)
    spread[:, own] = x
    return spread


def places(settings: RecordSettings, opened: Sequence[Table]) -> tuple[Table, Table, Table]:
    """The files of the positions, of the torques and of the known torques.

    Of two files the second holds the torques, but for known torques that it has and the first has
    not, beside torques of the first.
    """
    first, last, columns = opened[0], opened[-1], settings.columns
    if len(opened) == 3 or not columns.tau_known:
        return first, opened[min(1, len(opened) - 1)], last
    known = {name for name in columns.tau_known if name != NONE}
    in_first = known <= {*first.names}
    torques = {*columns.tau} if columns.tau else {"tau1"}
    apart = not in_first and torques <= {*first.names}
    return first, first if apart else last, first if in_first else last


def record_files(settings: RecordSettings, folder: Path) -> list[Path]:
    """Paths of the files of a record; those of a dataset are looked up, and downloaded where need
    be.
    """
    if not settings.files:
        raise InputError("the record names no file; set record.files")
    if settings.dataset is None:
        return [folder / file for file in settings.files]
    return [fetch(settings.dataset, file) for file in settings.files]


def names_of(model: Any) -> tuple[str, ...]:
    """Names of the joints of an emitted model, in the order of JOINTS; none where the robot file
    does not name every joint.
    """
    labels = getattr(model, "LABELS", {})
    if not isinstance(labels, Mapping) or not all(
        isinstance(label, str) and label.isprintable() for label in labels.values()
    ):
        raise ModelError("LABELS are no table of names; emit the model again", file=model.NAME)
    return (
        tuple(labels[j] for j in model.JOINTS)
        if model is not None and labels.keys() >= {*model.JOINTS}
        else ()
    )
