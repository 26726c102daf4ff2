"""The files of one record, opened and checked: columns, lengths, joints, and how their numbers
become joint side, SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import InputError, ModelError
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of
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
from runtime.records.missing import COUNTS, bridged
from runtime.records.record import require_finite
from runtime.settings.record import NONE, Columns, RecordSettings, each_record
from runtime.settings.units import time_unit


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a record, joint side, SI; None: the files hold no such columns.

    Attributes
    ----------
    t : ndarray, shape (N,), s, or None
    q : ndarray, shape (N, n), rad or m
    tau : ndarray, shape (N, n), N m or N
        As measured, known torques included.
    q_r : ndarray, shape (N, n), rad or m, or None
        Reference.
    tau_ff, tau_known : ndarray, shape (N, n), N m or N, or None
        Feed-forward torques of the controller, and torques that do not come from the model.
    missing : ndarray of bool, shape (N, n), or (N, 0) where none may be missing
        Columns of positions that hold none.
    """

    t: Array | None
    q: Array
    tau: Array
    missing: Array
    q_r: Array | None = None
    tau_ff: Array | None = None
    tau_known: Array | None = None

    @property
    def signals(self) -> dict[str, Array]:
        """What is resampled together, by name."""
        given = {key: getattr(self, key) for key in ("q", "tau", "q_r", "tau_ff", "tau_known")}
        given |= {"missing": self.missing} if self.missing.any() else {}
        return {key: x for key, x in given.items() if x is not None}


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
        The files of the positions, of the torques, of the known torques; one file may stand for
        several.
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
        return self._converted(0, parts)[0]

    def blocks(self, size: int, start: int = 0, stop: int | None = None) -> Iterator[Samples]:
        """The same by blocks of `size` samples; [start, stop) of them, default: all."""
        asked, stop = groups_of(self.columns, self.tables), self.samples if stop is None else stop
        streams = [
            table.blocks(list(groups.values()), size, start, stop) for table, groups in asked
        ]
        keys = [key for _, groups in asked for key in groups]
        last = None
        for a, blocks in zip(range(start, stop, size), zip(*streams, strict=True), strict=True):
            samples, last = self._converted(
                a, dict(zip(keys, (x for block in blocks for x in block), strict=True)), last
            )
            yield samples

    def times(self, size: int) -> Iterator[Array]:
        """t by blocks of `size` samples, s; the record has a time column."""
        for a, (t,) in zip(
            range(0, self.samples, size),
            self.first.blocks([[self.columns.t or ""]], size),
            strict=True,
        ):
            names = [self.columns.t or ""]
            yield self._time(require_finite(t, names, self.first.file, self.first.row, a))

    def largest_known(self, size: int) -> Array | None:
        """Size of the known torques, shape (n,), read by blocks; None where there are none."""
        names = asked_columns(self.columns)["tau_known"]
        if not names:
            return None
        blocks = self.tables[2].blocks([names], size)
        largest = np.max([np.abs(x).max(axis=0) for (x,) in blocks], axis=0)
        return np.ravel(self._on_joints(largest[None]))

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

    def _converted(
        self, start: int, parts: dict[str, Array], before: Array | None = None
    ) -> tuple[Samples, Array]:
        """Samples from `start` on, as the files hold them, in the joint side, SI, and the last
        positions, shape (n,), of the file.

        before : positions of the file ahead of `start`.
        """
        missing = (
            np.isnan(parts["q"]) if self.missing else np.empty((len(parts["q"]), 0), dtype=bool)
        )
        if missing.any():
            parts["q"] = bridged(parts["q"], missing, before)
        sides = {"q": self.side.position, "tau": self.side.torque, "tau_known": self._on_joints}
        sides |= {"q_r": self.side.position, "tau_ff": self.side.torque, "t": self._time}
        converted: dict[str, Any] = {"t": None, "missing": missing}
        for table, groups in groups_of(self.columns, self.tables):
            for key, names in groups.items():
                hint = COUNTS if key == "q" and not self.missing else ""
                x = require_finite(parts[key], names, table.file, table.row, start, hint)
                converted[key] = sides[key](x)
        return Samples(**converted), parts["q"][-1]

    def _on_joints(self, known: Array) -> Array:
        """Known torques with zeros where a joint has none, shape (N, n)."""
        own = [name != NONE for name in self.columns.tau_known]
        if all(own):
            return known
        spread = np.zeros((len(known), len(own)))
        spread[:, own] = known
        return spread

    def _time(self, t: Array) -> Array:
        return np.asarray(t[:, 0] * time_unit(self.settings.units.t))


def open_records(
    settings: Sequence[RecordSettings],
    model: GeneratedModel | None,
    folder: str | Path | None,
    *,
    by_blocks: bool = False,
    missing: bool = False,
) -> Iterator[RecordFiles]:
    """The files of each record of one robot, opened behind one another; no name twice.

    Parameters
    ----------
    model : module, optional
        Emitted model of the robot, for its drives and its number of joints.
    folder : str or Path, optional
        Where relative file names start; default: the current folder.
    by_blocks : bool
        Refuse formats that are read whole only.
    missing : bool
        Whether positions may be missing: nan, an empty field, a null.
    """
    settings, drives = each_record(tuple(settings)), None if model is None else drives_of(model)
    for one, label in zip(settings, labels(settings), strict=True):
        joints = names_of(model)
        opened = open_record(
            one, label, drives, Path(folder or ""), joints, by_blocks=by_blocks, missing=missing
        )
        if model is not None and opened.n != len(model.JOINTS):
            raise InputError(
                f"{opened.n} joints; {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}",
                file=", ".join(opened.hashes),
            )
        yield opened


def open_record(
    settings: RecordSettings,
    label: Label,
    drives: Drives | None,
    folder: Path,
    joints: Sequence[str],
    *,
    by_blocks: bool,
    missing: bool,
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
    by_blocks, missing : bool
        As for `open_records`.
    """
    opened = [
        open_table(path, settings.topic, settings.decimal, by_blocks=by_blocks)
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
        if (
            by_blocks and counts[table] < LIMIT.FEWEST_SAMPLES
        ):  # a whole record says so itself, after what is wrong with its lines
            raise InputError(
                f"{counts[table]} samples; a record has at least {LIMIT.FEWEST_SAMPLES}",
                file=table.file,
            )
    samples, n = counts[first], widths["q"]
    require_alike(names, first, last, (samples, n), (counts[last], widths["tau"]))
    if drives is not None and drives.n != n:
        raise InputError(
            f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file
        )
    if "tau_known" in widths:
        widths["tau_known"] += names.tau_known.count(NONE)
    for key, title in (
        ("q_r", "reference positions"),
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
    )


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
