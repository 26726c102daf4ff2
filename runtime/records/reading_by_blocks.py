"""From the files of a measurement to a record that is read by blocks, joint side, SI: `runtime.records.reading` for files larger than memory.

    stream = open_streams(study.record, model, block=65536)[0]
    reduction = runtime.observation.by_blocks.reduce_records(model, [stream], study)

The same settings, checks and errors; hashes and the clock are read when the stream is opened, finite numbers are required as blocks come by.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from runtime.errors import InputError
from runtime.files import sha256_of
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.records.clock import clock
from runtime.records.formats.table import BLOCK_READERS, BlockTable, open_table
from runtime.records.joint_side import Conversion, column_names, conversion, finite_columns, require_alike
from runtime.records.reading import file_hashes, read_records, record_files
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.settings.record import SHORTEST, Columns, RecordSettings, each_record
from runtime.settings.units import time_unit

Array = np.ndarray

BLOCK = 65536  # samples read at a time
KEPT = 2**23  # samples whose time is kept, 64 MB; read again and again in longer records
LARGE = 100_000_000  # bytes of the files of a record from which it is read by blocks when nothing is said


@dataclass(frozen=True, eq=False)
class FileStream:
    """A record in files, read by blocks of `block` samples."""

    name: str
    n: int
    rate: float
    files: Mapping[str, str]
    samples: int
    block: int
    settings: RecordSettings
    columns: Columns
    tables: tuple[BlockTable, ...]  # of the positions, of the torques; one where they share a file
    side: Conversion

    def __len__(self) -> int:
        return self.samples

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""
        if self.samples <= KEPT:
            yield from np.split(self._clock, range(self.block, self.samples, self.block))
        else:
            yield from self._times()

    @cached_property
    def _clock(self) -> Array:
        return np.concatenate(list(self._times()))

    def _times(self) -> Iterator[Array]:
        if self.columns.t is None:
            for a in range(0, self.samples, self.block):
                yield np.arange(a, min(a + self.block, self.samples)) / self.rate
        else:
            for table in self.tables[0].blocks([self.columns.t], self.block):
                yield finite_columns(table, [self.columns.t])[:, 0] * time_unit(self.settings.units.t)

    def blocks(self) -> Iterator[tuple[Array, Array, Array]]:
        """t (B,), q (B, n), tau (B, n), joint side, SI."""
        time = [] if self.columns.t is None else [self.columns.t]
        first = self.tables[0].blocks([*time, *self.columns.q, *(self.columns.tau if len(self.tables) == 1 else ())], self.block)
        last = None if len(self.tables) == 1 else self.tables[1].blocks(self.columns.tau, self.block)
        for a, table in zip(range(0, self.samples, self.block), first, strict=True):
            torques = table if last is None else next(last)
            q, tau = finite_columns(table, self.columns.q), finite_columns(torques, self.columns.tau)
            if self.columns.t is None:
                t = np.arange(a, a + len(q)) / self.rate
            else:
                t = finite_columns(table, time)[:, 0] * time_unit(self.settings.units.t)
            yield t, self.side.position(q), self.side.torque(tau)


def open_stream(settings: RecordSettings, drives: Drives | None = None, *, folder: Path | None = None, block: int = BLOCK) -> FileStream:
    """The record that the settings describe, to be read by blocks of `block` samples; its files are read once, for hashes and clock."""
    if block < SHORTEST:
        raise InputError(f"blocks of {block} samples; expected at least {SHORTEST}")
    if settings.resample is not None:
        raise InputError("record.resample needs the whole record; set stream: off", file=settings.name or settings.files[0])
    paths = record_files(settings, folder)
    tables = tuple(open_table(path, settings.decimal) for path in paths)
    first, last = tables[0], tables[-1]
    names = column_names(settings, first, last)
    samples = first.samples([*([] if names.t is None else [names.t]), *names.q])
    others = last.samples(names.tau)
    for table, count in ((first, samples), (last, others)):
        if count < SHORTEST:
            raise InputError(f"{count} samples; a record has at least {SHORTEST}", file=table.file)
    beginning, torques = next(first.blocks(names.q, SHORTEST)), next(last.blocks(names.tau, SHORTEST))
    q, tau = beginning.stack(names.q), torques.stack(names.tau)
    require_alike(names, first, last, (samples, q.shape[1]), (others, tau.shape[1]))
    n = q.shape[1]
    if drives is not None and drives.n != n:
        raise InputError(f"{n} positions and torques {names.q}; the robot has {drives.n} joints", file=first.file)
    return FileStream(
        name=settings.name or settings.dataset or paths[0].name.split(".")[0],
        n=n,
        rate=_rate(settings, first, names.t, block),
        files=file_hashes(settings, [sha256_of(path) for path in paths]),
        samples=samples,
        block=block,
        settings=settings,
        columns=names,
        tables=tables,
        side=conversion(settings, drives, beginning, torques, n),
    )


def open_streams(
    settings: Sequence[RecordSettings], model: GeneratedModel, *, folder: Path | None = None, block: int = BLOCK
) -> list[FileStream]:
    """Several records of the robot of an emitted model, with its drives."""
    drives = None if model.DRIVES is None else Drives.from_mapping(model.DRIVES)
    streams = [open_stream(s, drives, folder=folder, block=block) for s in each_record(tuple(settings))]
    for stream in streams:
        if stream.n != len(model.JOINTS):
            raise InputError(f"{stream.n} joints; {model.NAME} has {len(model.JOINTS)}, {model.JOINTS}", file=stream.name)
    return streams


def records_or_streams(
    settings: Sequence[RecordSettings], model: GeneratedModel, stream: Literal["auto", "off"] | int, *, folder: Path | None = None
) -> list[Record | Stream]:
    """The records in memory, or to be read by blocks, as the setting `stream` of a study says."""
    if stream == "off" or (stream == "auto" and not are_large(settings, folder)):
        return [*read_records(settings, model, folder=folder)]
    return [*open_streams(settings, model, folder=folder, block=BLOCK if stream == "auto" else stream)]


def are_large(settings: Sequence[RecordSettings], folder: Path | None = None) -> bool:
    """Whether the files of these records, of formats that can be read by blocks, hold LARGE bytes or more in all; those of data sets do not, nor those
    that are resampled."""
    if any(s.resample is not None for s in settings):
        return False
    paths = [path for s in settings if s.dataset is None for path in record_files(s, folder)]
    readable = all(any(suffix.lower() in BLOCK_READERS for suffix in path.suffixes) for path in paths)
    return readable and sum(path.stat().st_size for path in paths if path.is_file()) >= LARGE


def _rate(settings: RecordSettings, table: BlockTable, time: str | None, block: int) -> float:
    if time is not None:
        return clock(settings, lambda: table.blocks([time], block), time).rate
    if settings.rate is None:
        raise InputError("no time column and no rate; set record.rate (Hz) or record.columns.t", file=table.file)
    return settings.rate
