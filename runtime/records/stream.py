"""Records that are read by blocks: what a source of samples offers, and samples that wait for one another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from runtime.records.record import Record

Array = np.ndarray


class Stream(Protocol):
    """A record that is read by blocks, joint side, SI, as often as asked."""

    @property
    def name(self) -> str:
        """Name of the record."""

    @property
    def n(self) -> int:
        """Number of joints."""

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 by file name."""

    @property
    def block(self) -> int:
        """Samples of a block."""

    def __len__(self) -> int:
        """Number of samples."""

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""

    def blocks(self) -> Iterator[tuple[Array, Array, Array]]:
        """t (B,), q (B, n), tau (B, n)."""


@dataclass(frozen=True, eq=False)
class RecordStream:
    """A Record in memory, read by blocks of `block` samples."""

    record: Record
    block: int

    @property
    def name(self) -> str:
        """Name of the record."""
        return self.record.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.record.n

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return self.record.rate

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 by file name."""
        return self.record.files

    def __len__(self) -> int:
        return len(self.record)

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""
        return (self.record.t[a : a + self.block] for a in range(0, len(self), self.block))

    def blocks(self) -> Iterator[tuple[Array, Array, Array]]:
        """t, q, tau by blocks."""
        for a in range(0, len(self), self.block):
            samples = slice(a, a + self.block)
            yield self.record.t[samples], self.record.q[samples], self.record.tau[samples]


@dataclass(frozen=True, eq=False)
class ChangedStream:
    """A stream whose positions and torques are changed, sample by sample: change(q, tau) of arrays (B, n)."""

    stream: Stream
    change: Callable[[Array, Array], tuple[Array, Array]]

    @property
    def name(self) -> str:
        """Name of the record."""
        return self.stream.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.stream.n

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return self.stream.rate

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 by file name."""
        return self.stream.files

    @property
    def block(self) -> int:
        """Samples of a block."""
        return self.stream.block

    def __len__(self) -> int:
        return len(self.stream)

    def times(self) -> Iterator[Array]:
        """Time of the samples, s, by blocks."""
        return self.stream.times()

    def blocks(self) -> Iterator[tuple[Array, Array, Array]]:
        """t, q, tau by blocks."""
        for t, q, tau in self.stream.blocks():
            yield t, *self.change(q, tau)


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
