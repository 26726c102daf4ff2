"""Rows of Y = W X + rho of a record that is read by pieces: those of the whole record, with nothing
of its length kept.

Each piece goes through the filters of a whole record (`runtime.signals.filters`), its chunks
through the rows of one (`runtime.rows.prepared`). Ends, instants and rows are those of the record
in memory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of
from runtime.records.missing import Missing
from runtime.records.stream import PieceReader, Stream
from runtime.rows.observation import Observation
from runtime.rows.pieces import Piece, chunks
from runtime.rows.prepared import certain, decimated_rows, rows_of
from runtime.rows.regressor import Columns
from runtime.rows.segments import Cuts, Segment
from runtime.rows.selection import selected
from runtime.settings.study import Study
from runtime.signals.counts.by_blocks import CountStage
from runtime.signals.counts.reading import stretches
from runtime.signals.filters import States, median_filtered
from runtime.signals.states import encoder_drives, encoder_position, observed_states

Array = np.ndarray

SHOWN = 4096  # instants of every record whose rows are kept for figures


@dataclass(frozen=True, eq=False)
class BlockTask:
    """What every piece of the records needs; it travels to other processes once.

    Attributes
    ----------
    model : GeneratedModel
        Emitted module; its text in other processes.
    streams : tuple of Stream
        The records.
    study : Study
        Signals and rows.
    constants : mapping of str to float
        Values in place of the robot file's.
    skimmed : mapping of int to CountStage
        What the counts of a record in several pieces say in all, by its number.
    cuts : tuple of Cuts, or None
        Where the time of each record is cut; None where rows are held.
    """

    model: GeneratedModel
    streams: tuple[Stream, ...]
    study: Study
    constants: Mapping[str, float]
    skimmed: Mapping[int, CountStage] = field(default_factory=dict)
    cuts: tuple[Cuts, ...] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """For other processes: nothing of what was computed."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def columns(self) -> list[Array]:
        """C_j, columns that act on joint j."""
        return [np.flatnonzero(acts) for acts in np.asarray(self.model.STRUCTURE).T]

    @property
    def filters_choose(self) -> bool:
        """Whether rows are left out by speed or direction, which filtered positions tell."""
        return self.study.signals.reader == "counts" or bool(np.any(self.study.rows.low_speed))

    def with_starts(self, pieces: Sequence[Piece]) -> BlockTask:
        """Where counts are read in several pieces: what is ahead of each, in one pass over the
        positions that reads nothing.
        """
        skimmed = {}
        several = {a.record for a, b in pairwise(pieces) if a.record == b.record}
        for number in several if self.study.signals.reader == "counts" else ():
            stream = self.streams[number]
            stage = CountStage(stretches(len(stream)), stream.rate, self.study.signals, stream.name)
            begins = [piece.begin for piece in pieces if piece.record == number]
            stage.skim(partial(self.encoder_positions, number), begins)
            skimmed[number] = stage
        return replace(self, skimmed=skimmed)

    @cached_property
    def readers(self) -> list[PieceReader]:
        """What reads the pieces of each stream."""
        return [PieceReader(stream) for stream in self.streams]

    def read(
        self, number: int, begin: int, end: int
    ) -> tuple[Array, Array, Array, Missing | None, Drives | None, Mapping[str, Array]]:
        """Time, positions, torques, missing positions, drives and channels of samples of a
        record.
        """
        stream = self.streams[number]
        t, q, tau, gaps, channels = self.readers[number].read(begin, end)
        missing = Missing(gaps, stream.follows) if gaps.any() else None
        return t, q, tau, missing, stream.origin.drives or drives_of(self.model), channels

    def encoder_positions(self, number: int, begin: int, end: int) -> Array:
        """Positions at the encoders, shape (B, n), nan where they are missing."""
        _, q, _, missing, motors, _ = self.read(number, begin, end)
        drives = encoder_drives(self.study.signals.side, motors)
        return encoder_position(q, drives, missing)

    def states(self, piece: Piece) -> tuple[Array, States, Array, CountStage | None]:
        """Time (N,), states (N, n) and measured torques (N, n) of a piece, and the reader of its
        counts, where the study asks for it.
        """
        signals, stream = self.study.signals, self.streams[piece.record]
        t, q, tau, missing, motors, channels = self.read(piece.record, piece.begin, piece.end)
        counts = None
        if signals.reader == "counts":
            whole = self.skimmed.get(piece.record)
            start = None if whole is None else whole.starts[piece.begin]
            counts = CountStage(piece.stretches, stream.rate, signals, stream.name, start)
        states = observed_states(
            q,
            stream.rate,
            signals,
            motors,
            missing=missing,
            name=stream.name,
            counts=counts,
            v=channels.get("qd"),
        )
        return t, states, tau, counts


def row_counts(task: BlockTask, piece: Piece) -> tuple[Array, float, float]:
    """Number of the rows of a piece by joint, shape (n,), and the times of the first and of the
    last; it is read and filtered only where rows are left out by speed or direction.
    """
    at, stream = piece.instants, task.streams[piece.record]
    if not task.filters_choose:
        t0, t1 = _times(stream, [at.sample(k) for k in (at.used[0], at.used[1] - 1)])
        return np.full(stream.n, at.used[1] - at.used[0]), t0, t1
    t, states, *_ = task.states(piece)
    study = task.study
    fast = selected(at, t, states.qd, stream.rate, study.signals, study.rows)
    mask = certain(task.model, states, fast, task.constants).mask
    used = fast.t[mask.any(axis=0)]
    return mask.sum(axis=1), used.min(initial=np.inf), used.max(initial=-np.inf)


def piece_rows(
    task: BlockTask, piece: Piece
) -> tuple[list[Observation], list[Segment], CountStage | None]:
    """Rows of a piece, by chunks; where the rows are reduced, those of the first SHOWN instants
    and the segments of all. The reader of its counts.
    """
    number, study = piece.record, task.study
    t, states, tau, counts = task.states(piece)
    tau = median_filtered(tau, study.signals.window_of_torques)
    rate = task.streams[number].rate
    rows, segments = [], []
    for samples, at in chunks(piece.instants):
        own = states[samples]
        selection = selected(at, t[samples], own.qd, rate, study.signals, study.rows)
        torque = decimated_rows(tau[samples], selection)
        part = rows_of(Columns(task.model, constants=task.constants), own, torque, selection)
        if task.cuts is not None:
            segments += part.cut(number, task.cuts[number], task.columns)
            first = selection.t[: max(SHOWN - at.number, 0)]
            part = part.where(part.t <= first.max(initial=-np.inf))
        rows.append(part)
    return rows, segments, counts


def _times(stream: Stream, samples: Sequence[int]) -> list[float]:
    """Time of some samples, s."""
    found: dict[int, float] = {}
    begin = 0
    for t in stream.times():
        found |= {k: float(t[k - begin]) for k in samples if begin <= k < begin + len(t)}
        begin += len(t)
    return [found[k] for k in samples]
