"""Records that are read by blocks: what a source of samples offers, and pieces of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from runtime.errors import InputError
from runtime.model.drives import Drives
from runtime.records.record import Origin, Record, known_text

Array = np.ndarray
T = TypeVar("T")
Block = tuple[Array, Array, Array, Array]
Part = tuple[Array, Array, Array, Array, Mapping[str, Array]]  # a block and its channels


@dataclass(frozen=True, eq=False, kw_only=True)
class Stream:
    """A record that is read by blocks, joint side, SI, as often as asked.

    Attributes
    ----------
    name : str
        Name of the record.
    n : int
        Number of joints.
    rate : float, Hz
        Sampling rate.
    origin : Origin
        Files, clock and drives by which it is read.
    samples : int
        N.
    block : int
        Samples of a block.
    follows : ndarray of bool, shape (n, n), or None
        Joint j follows from column i of the positions, as in `runtime.records.missing`.
    largest_known : ndarray, shape (n,), or None
        Size of the known torques that are subtracted; None where there are none.
    measured : frozenset of str
        Names of the channels.
    """

    name: str
    n: int
    rate: float
    origin: Origin
    samples: int
    block: int
    follows: Array | None = None
    largest_known: Array | None = None
    measured: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return self.samples

    @property
    def file(self) -> str:
        """What messages call it: its files, or its name where there are none."""
        return ", ".join(self.origin.files) or self.name

    @property
    def subtracted(self) -> str:
        """What known torques take from the record, a sentence; "" where there are none."""
        return known_text(self.largest_known, self.origin.joints)

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""
        return (t for t, *_ in self.blocks())

    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[Block]:
        """t (B,), q (B, n), tau (B, n), columns without a position, bool (B, n), or (B, 0) where
        none may be missing, of the samples [start, stop);
        default: all. A stream has this method or `parts` of its own."""
        return (part[:4] for part in self.parts(start, stop))

    def parts(self, start: int = 0, stop: int | None = None) -> Iterator[Part]:
        """The same with the channels (B, k) by name."""
        return ((*block, {}) for block in self.blocks(start, stop))

    @property
    def in_any_order(self) -> bool:
        """Whether samples are read without those before them."""
        return True


@dataclass(frozen=True, eq=False, init=False)
class RecordStream(Stream):
    """A Record in memory, read by blocks of `block` samples."""

    record: Record

    def __init__(self, record: Record, block: int) -> None:
        follows = None if record.missing is None else record.missing.follows
        known = None if record.tau_known is None else np.abs(record.tau_known).max(axis=0)
        super().__init__(
            name=record.name,
            n=record.n,
            rate=record.rate,
            origin=record.origin,
            samples=len(record),
            block=block,
            follows=follows,
            largest_known=known,
            measured=record.measured,
        )
        object.__setattr__(self, "record", record)

    def parts(self, start: int = 0, stop: int | None = None) -> Iterator[Part]:
        missing = (
            np.empty((len(self), 0), dtype=bool)
            if self.record.missing is None
            else self.record.missing.samples
        )
        stop = len(self) if stop is None else stop
        for a in range(start, stop, self.block):
            samples = slice(a, min(a + self.block, stop))
            yield (
                self.record.t[samples],
                self.record.q[samples],
                self.record.torque[samples],
                missing[samples],
                {key: x[samples] for key, x in self.record.channels.items()},
            )


@dataclass(frozen=True, eq=False, kw_only=True)
class ChangedStream(Stream):
    """A stream whose positions and torques are changed, sample by sample: change(q, tau) of arrays
    (B, n).
    """

    stream: Stream
    change: Callable[[Array, Array], tuple[Array, Array]]

    @classmethod
    def of(
        cls,
        stream: Stream,
        change: Callable[[Array, Array], tuple[Array, Array]],
        drives: Drives,
    ) -> ChangedStream:
        """The changed stream, as if it were read by `drives`, without channels."""
        same = {f.name: getattr(stream, f.name) for f in fields(Stream)}
        same |= {"origin": replace(stream.origin, drives=drives), "measured": frozenset()}
        return cls(stream=stream, change=change, **same)

    def times(self) -> Iterator[Array]:
        return self.stream.times()

    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[Block]:
        return (
            (t, *self.change(q, tau), missing)
            for t, q, tau, missing in self.stream.blocks(start, stop)
        )

    @property
    def in_any_order(self) -> bool:
        return self.stream.in_any_order


class PieceReader:
    """Samples of a stream by overlapping ranges, in order of time; each is read once where samples
    are read behind those before them only.
    """

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        self.parts: Iterator[Part] = iter(())
        self.held: list[Part] = []
        self.first = self.next = len(stream)  # samples that `held` and the next block begin with

    def read(self, begin: int, end: int) -> Part:
        """t, q, tau, missing samples and channels of [begin, end)."""
        if self.stream.in_any_order:  # all that was asked for is read: a process that reads stays
            return _joined(list(self.stream.parts(begin, end)), slice(None))
        if begin < self.first:
            self.parts, self.held, self.first, self.next = self.stream.parts(), [], 0, 0
        while self.next < end:
            self.held.append(next(self.parts))
            self.next += len(self.held[-1][0])
            self._forget(begin)
        self._forget(begin)
        own = slice(begin - self.first, end - self.first)
        return _joined(self.held, own)

    def _forget(self, begin: int) -> None:
        """Hold no block that ends before sample `begin`."""
        while self.held and self.first + len(self.held[0][0]) <= begin:
            self.first += len(self.held.pop(0)[0])


def _joined(parts: Sequence[Part], own: slice) -> Part:
    """Parts that follow each other as one, of which the samples `own`."""
    *columns, named = zip(*parts, strict=True)
    t, q, tau, missing = (np.concatenate(x)[own] for x in columns)
    channels = {key: np.concatenate([x[key] for x in named])[own] for key in named[0]}
    return t, q, tau, missing, channels


def in_memory(records: Sequence[T | Stream], who: str) -> list[T]:
    """The records, none of them read by blocks; InputError "`who` whole records" where one is."""
    whole = [record for record in records if not isinstance(record, Stream)]
    if len(whole) < len(records):
        raise InputError(f"{who} whole records; set stream: off")
    return whole
