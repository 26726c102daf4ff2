"""From the files of a measurement to a record that is read by blocks, joint side, SI:
`runtime.records.reading` for files larger than memory.

    stream = open_streams(study.record, model, block=65536)[0]

The same settings, checks and errors; hashes and the clock are read when the stream is opened,
finite numbers are required as blocks come by.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.limits import LIMIT
from runtime.model.generated import GeneratedModel
from runtime.records.clock import clock
from runtime.records.formats.columns import BLOCK, Array
from runtime.records.formats.table import is_read_by_blocks
from runtime.records.joint_side import asked_columns
from runtime.records.opening import RecordFiles, open_records, record_files
from runtime.records.reading import read_records
from runtime.records.record import JOINT_CHANNELS, Record
from runtime.records.stream import Part, Stream
from runtime.settings.record import RecordSettings, each_record

KEPT = 2**23  # samples whose time is kept, 64 MB; read again and again in longer records
# bytes of the files of a record from which it is read by blocks when nothing is said
LARGE = 100_000_000


@dataclass(frozen=True, eq=False, kw_only=True)
class FileStream(Stream):
    """A record in files, read by blocks.

    Attributes
    ----------
    opened : RecordFiles
        The files.
    """

    opened: RecordFiles

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""
        if len(self) <= KEPT:
            yield from np.split(self._clock, range(self.block, len(self), self.block))
        else:
            yield from self._times()

    @cached_property
    def _clock(self) -> Array:
        return np.concatenate(list(self._times()))

    def _times(self) -> Iterator[Array]:
        if self.opened.columns.t is None:
            return (
                self._counted(a, min(self.block, len(self) - a))
                for a in range(0, len(self), self.block)
            )
        return self.opened.times(self.block)

    def _counted(self, start: int, count: int) -> Array:
        return np.arange(start, start + count) / self.rate

    @property
    def in_any_order(self) -> bool:
        """Whether samples are read without those before them."""
        return all(table.in_any_order() for table in self.opened.tables)

    def __getstate__(self) -> dict[str, Any]:
        """Other processes read what they need."""
        return {key: value for key, value in vars(self).items() if key != "_clock"}

    def parts(self, start: int = 0, stop: int | None = None) -> Iterator[Part]:
        """t (B,), q (B, n), tau (B, n), joint side, SI, the columns without a position, and the
        channels, of the samples [start, stop).
        """
        law, before = self.opened.law, None
        if law is not None and start:
            (last,) = self.opened.blocks(1, start - 1, start)
            before = last.q[0]
        for x in self.opened.blocks(self.block, start, stop):
            tau, known = x.tau, 0.0 if x.tau_known is None else x.tau_known
            if law is not None:
                tau = law.torque(x.q, x.channels, self.rate, before)
            yield (
                self._counted(start, len(x.q)) if x.t is None else x.t,
                x.q,
                np.asarray(tau) - known,
                x.missing,
                x.channels,
            )
            start, before = start + len(x.q), x.q[-1]


def open_stream(
    settings: RecordSettings,
    model: GeneratedModel | None = None,
    *,
    folder: str | Path | None = None,
    block: int = BLOCK,
    missing: bool = False,
) -> FileStream:
    """The record that the settings describe, to be read by blocks of `block` samples; its files are
    read once, for hashes and clock.
    """
    return open_streams([settings], model, folder=folder, block=block, missing=missing)[0]


def open_streams(
    settings: Sequence[RecordSettings],
    model: GeneratedModel | None = None,
    *,
    folder: str | Path | None = None,
    block: int = BLOCK,
    missing: bool = False,
) -> list[FileStream]:
    """Several records of one robot, to be read by blocks of `block` samples; as `read_records`."""
    if block < LIMIT.FEWEST_SAMPLES:
        raise InputError(f"blocks of {block} samples; expected at least {LIMIT.FEWEST_SAMPLES}")
    for one in settings:
        if one.resample is not None:
            raise InputError(
                "record.resample needs the whole record; set stream: off", file=", ".join(one.files)
            )
        law = None if one.controller is None else one.controller.law
        if law is not None and (law.kd == "fit" or law.delay):
            message = "fit, or a delay, needs the whole record; set stream: off"
            raise SettingsError(message, path=("controller", "law"))
    opened = open_records(settings, model, folder, by_blocks=True, missing=missing)
    return [_stream(files, block) for files in opened]


def _stream(opened: RecordFiles, block: int) -> FileStream:
    timed = opened.columns.t is not None
    return FileStream(
        name=opened.name,
        n=opened.n,
        rate=clock(opened.stamps, lambda: opened.times(block)) if timed else opened.stated_rate,
        origin=opened.origin(),
        samples=opened.samples,
        block=block,
        follows=opened.side.follows,
        largest_known=opened.largest_known(block),
        measured=frozenset(key for key in JOINT_CHANNELS if asked_columns(opened.columns)[key]),
        opened=opened,
    )


def records_or_streams(
    settings: Sequence[RecordSettings],
    model: GeneratedModel,
    stream: Literal["auto", "off"] | int,
    *,
    folder: str | Path | None = None,
    missing: bool = False,
) -> list[Record] | list[Stream]:
    """The records, all of them in memory, or all of them to be read by blocks, as the setting
    `stream` of a study says.
    """
    if stream == "off" or not is_stream(settings, stream, folder):
        return read_records(settings, model, folder=folder, missing=missing)
    streams: list[Stream] = [
        *open_streams(
            settings,
            model,
            folder=folder,
            block=BLOCK if stream == "auto" else stream,
            missing=missing,
        )
    ]
    return streams


def is_stream(
    settings: Sequence[RecordSettings],
    stream: Literal["auto", "off"] | int,
    folder: str | Path | None = None,
) -> bool:
    """Whether these records are to be read by blocks."""
    return are_large(settings, folder) if stream == "auto" else stream != "off"


def are_large(settings: Sequence[RecordSettings], folder: str | Path | None = None) -> bool:
    """Whether the files of these records, of formats that can be read by blocks, hold LARGE bytes
    or more in all; those of data sets do not, nor those
    that are resampled."""
    if any(s.resample is not None for s in settings):
        return False
    paths = [
        path
        for s in each_record(tuple(settings))
        if s.dataset is None
        for path in record_files(s, Path(folder or ""))
    ]
    readable = all(is_read_by_blocks(path) for path in paths)
    return readable and sum(path.stat().st_size for path in paths if path.is_file()) >= LARGE
