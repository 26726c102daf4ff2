"""Records that are read by blocks: what a source of samples offers, and samples that wait for one another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields

import numpy as np

from runtime.records.record import Record

Array = np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class Stream(ABC):
    """A record that is read by blocks, joint side, SI, as often as asked.

    Attributes
    ----------
    name : str
        Name of the record.
    n : int
        Number of joints.
    rate : float, Hz
        Sampling rate.
    files : mapping of str to str
        SHA-256 by file name.
    samples : int
        N.
    block : int
        Samples of a block.
    follows : ndarray of bool, shape (n, n), or None
        Joint j follows from column i of the positions, as in `runtime.records.missing`.
    """

    name: str
    n: int
    rate: float
    files: Mapping[str, str]
    samples: int
    block: int
    follows: Array | None = None

    def __len__(self) -> int:
        return self.samples

    @abstractmethod
    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""

    @abstractmethod
    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[Array, Array, Array, Array]]:
        """t (B,), q (B, n), tau (B, n), columns without a position, bool (B, n), or (B, 0) where none may be missing, of the samples [start, stop);
        default: all."""

    @property
    def in_any_order(self) -> bool:
        """Whether samples are read without those before them."""
        return True

    def part(self, start: int, stop: int) -> Stream:
        """The samples [start, stop) as a stream of their own."""
        same = {f.name: getattr(self, f.name) for f in fields(Stream)}
        return PartStream(**{**same, "samples": stop - start}, stream=self, start=start)


@dataclass(frozen=True, eq=False, init=False)
class RecordStream(Stream):
    """A Record in memory, read by blocks of `block` samples."""

    record: Record

    def __init__(self, record: Record, block: int) -> None:
        follows = None if record.missing is None else record.missing.follows
        name, n, rate, files = record.name, record.n, record.rate, record.files
        super().__init__(name=name, n=n, rate=rate, files=files, samples=len(record), block=block, follows=follows)
        object.__setattr__(self, "record", record)

    def times(self) -> Iterator[Array]:
        return (t for t, *_ in self.blocks())

    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[Array, Array, Array, Array]]:
        missing = np.empty((len(self), 0), dtype=bool) if self.record.missing is None else self.record.missing.samples
        stop = len(self) if stop is None else stop
        for a in range(start, stop, self.block):
            samples = slice(a, min(a + self.block, stop))
            yield self.record.t[samples], self.record.q[samples], self.record.tau[samples], missing[samples]


@dataclass(frozen=True, eq=False, kw_only=True)
class ChangedStream(Stream):
    """A stream whose positions and torques are changed, sample by sample: change(q, tau) of arrays (B, n)."""

    stream: Stream
    change: Callable[[Array, Array], tuple[Array, Array]]

    @classmethod
    def of(cls, stream: Stream, change: Callable[[Array, Array], tuple[Array, Array]]) -> ChangedStream:
        """The changed stream."""
        same = {f.name: getattr(stream, f.name) for f in fields(Stream)}
        return cls(stream=stream, change=change, **same)

    def times(self) -> Iterator[Array]:
        return self.stream.times()

    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[Array, Array, Array, Array]]:
        return ((t, *self.change(q, tau), missing) for t, q, tau, missing in self.stream.blocks(start, stop))

    @property
    def in_any_order(self) -> bool:
        return self.stream.in_any_order


@dataclass(frozen=True, eq=False, kw_only=True)
class PartStream(Stream):
    """Consecutive samples of a stream, from number `start` on."""

    stream: Stream
    start: int

    def times(self) -> Iterator[Array]:
        return (t for t, *_ in self.blocks())

    def blocks(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[Array, Array, Array, Array]]:
        return self.stream.blocks(self.start + start, self.start + (len(self) if stop is None else stop))


class Queue:
    """Samples in the order in which they came, along the first axis."""

    def __init__(self) -> None:
        self.parts: list[Array] = []
        self.count = 0

    def put(self, x: Array) -> None:
        """The next samples."""
        if len(x):
            self.parts.append(x)
            self.count += len(x)

    def take(self, count: int) -> Array:
        """The first `count` of those that wait."""
        if len(self.parts[0]) < count:
            self.parts = [np.concatenate(self.parts)]
        head = self.parts[0]
        self.parts[0], self.count = head[count:], self.count - count
        return head[:count]


def recut(blocks: Iterable[tuple[Array, ...]], lengths: Iterable[int]) -> Iterator[tuple[Array, ...]]:
    """The same samples in blocks of these lengths; every array of a block has its length."""
    queues: list[Queue] = []
    source = iter(blocks)
    for length in lengths:
        while not queues or queues[0].count < length:
            block = next(source)
            queues = queues or [Queue() for _ in block]
            for queue, x in zip(queues, block, strict=True):
                queue.put(x)
        yield tuple(queue.take(length) for queue in queues)
