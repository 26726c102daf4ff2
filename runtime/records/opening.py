"""The files of one record, opened and checked: columns, lengths, joints, and how their numbers become joint side, SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.errors import InputError, ModelError
from runtime.model.drives import Drives
from runtime.records.clock import Stamps
from runtime.records.formats.columns import Array, Groups, Table
from runtime.records.formats.table import open_table
from runtime.records.joint_side import Conversion, column_names, conversion, require_alike, require_finite
from runtime.records.labels import Label
from runtime.settings.record import SHORTEST, Columns, RecordSettings
from runtime.settings.units import time_unit


@dataclass(frozen=True, eq=False)
class RecordFiles:
    """One or two measured files: positions, time and reference in the first, torques in the last.

    Attributes
    ----------
    settings : RecordSettings
        What the columns mean.
    name : str
        Of the record.
    hashes : mapping of str to str
        SHA-256 by file.
    tables : tuple of Table
        The files.
    columns : Columns
        Names of the columns.
    samples : int
        N.
    n : int
        Number of joints.
    side : Conversion
        From the columns to joint side, SI.
    """

    settings: RecordSettings
    name: str
    hashes: Mapping[str, str]
    tables: tuple[Table, ...]
    columns: Columns
    samples: int
    n: int
    side: Conversion

    @property
    def first(self) -> Table:
        """The file of the positions."""
        return self.tables[0]

    @property
    def stamps(self) -> Stamps:
        """How messages name the time stamps, and what they must be."""
        return Stamps(self.first.file, self.columns.t, self.first.row, self.settings.rate, self.settings.jitter)

    def read(self) -> tuple[Array, Array, Array, Array]:
        """t (N, 1) or (N, 0), q (N, n), tau (N, n), q_r (N, n) or (N, 0), joint side, SI."""
        groups, torques = _groups(self.columns, len(self.tables))
        arrays = self.first.read(groups, self.samples)
        return self._converted(0, *arrays, *(self.tables[1].read(torques, self.samples) if torques else ()))

    def blocks(self, size: int) -> Iterator[tuple[Array, Array, Array, Array]]:
        """The same by blocks of `size` samples."""
        groups, torques = _groups(self.columns, len(self.tables))
        blocks = self.first.blocks(groups, size)
        others: Iterator[tuple[Array, ...]] = self.tables[1].blocks(torques, size) if torques else iter(())
        for a, block in zip(range(0, self.samples, size), blocks, strict=True):
            yield self._converted(a, *block, *(next(others) if torques else ()))

    def times(self, size: int) -> Iterator[Array]:
        """t by blocks of `size` samples, s; the record has a time column."""
        for a, (t,) in zip(range(0, self.samples, size), self.first.blocks([[self.columns.t or ""]], size), strict=True):
            yield self._time(t, a)[:, 0]

    def close(self) -> None:
        """End the processes that read the files."""
        for table in self.tables:
            table.close()

    def _converted(self, start: int, t: Array, q: Array, q_r: Array, tau: Array) -> tuple[Array, Array, Array, Array]:
        """Samples from `start` on, as the files hold them, in the joint side, SI."""
        names, first, last = self.columns, self.first, self.tables[-1]
        q, tau = require_finite(q, names.q, first, start), require_finite(tau, names.tau, last, start)
        if names.qr:
            q_r = self.side.position(require_finite(q_r, names.qr, first, start))
        return self._time(t, start), self.side.position(q), self.side.torque(tau), q_r

    def _time(self, t: Array, start: int) -> Array:
        return require_finite(t, [self.columns.t or ""], self.first, start) * time_unit(self.settings.units.t)


def open_record(
    settings: RecordSettings, label: Label, drives: Drives | None, folder: Path, *, joints: Sequence[str] = (), by_blocks: bool = False
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
    by_blocks : bool
        Refuse formats that are read whole only.
    """
    tables = [open_table(path, settings.topic, settings.decimal, by_blocks=by_blocks) for path in record_files(settings, folder)]
    first, last = tables[0], tables[-1]
    names = column_names(settings, first, last, joints)
    groups, torques = _groups(names, len(tables))
    samples, widths = first.samples(groups), first.widths(groups)
    others = last.samples(torques) if torques else samples
    for table, count in ((first, samples), (last, others)):
        if by_blocks and count < SHORTEST:  # a whole record says so itself, after what is wrong with its lines
            raise InputError(f"{count} samples; a record has at least {SHORTEST}", file=table.file)
    n, reference = widths[1], widths[2]
    require_alike(names, first, last, (samples, n), (others, last.widths(torques)[0] if torques else widths[3]))
    if drives is not None and drives.n != n:
        raise InputError(f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file)
    if reference not in (0, n):
        raise InputError(f"{reference} reference positions {', '.join(names.qr)}; expected {n}", file=first.file)
    hashes = dict(zip(label.files, (table.digest for table in tables), strict=True))
    return RecordFiles(settings, label.name, hashes, tuple(tables), names, samples, n, conversion(settings, drives, first, last, n))


def record_files(settings: RecordSettings, folder: Path) -> list[Path]:
    """Paths of the files of a record; those of a dataset are looked up, and downloaded where need be."""
    if not settings.files:
        raise InputError("the record names no file; set record.files")
    if settings.dataset is None:
        return [folder / file for file in settings.files]
    from runtime.records.datasets import fetch  # pooch, only where a dataset is asked for

    return [fetch(settings.dataset, file) for file in settings.files]


def drives_of(model: Any) -> Drives | None:
    """Drives of an emitted model, where it has them."""
    drives = getattr(model, "DRIVES", None)
    return None if drives is None else Drives.from_mapping(drives)


def names_of(model: Any) -> tuple[str, ...]:
    """Names of the joints of an emitted model, in the order of JOINTS; none where the robot file does not name every joint."""
    labels = getattr(model, "LABELS", {})
    if not isinstance(labels, Mapping) or not all(isinstance(label, str) and label.isprintable() for label in labels.values()):
        raise ModelError("LABELS are no table of names; emit the model again", file=model.NAME)
    return tuple(labels[j] for j in model.JOINTS) if model is not None and labels.keys() >= {*model.JOINTS} else ()


def _groups(names: Columns, files: int) -> tuple[Groups, Groups]:
    """Columns of the first file: t, q, q_r and, where there is no other, tau; then those of the other."""
    groups = [[] if names.t is None else [names.t], list(names.q), list(names.qr)]
    return ([*groups, list(names.tau)], []) if files == 1 else (groups, [list(names.tau)])
