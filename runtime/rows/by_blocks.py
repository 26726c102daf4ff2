"""Rows of Y = W X + rho of a record that is read by pieces: those of the whole record, with nothing
of its length kept.

Each piece goes through the filters of a whole record (`runtime.signals.filters`), its chunks
through the distinct signals of the regressor and the decimation. Ends, instants and rows are those
of the record in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of
from runtime.records.missing import COUNTS, Missing, require_positions
from runtime.records.stream import PieceReader, Stream
from runtime.rows.pieces import Piece, chunks
from runtime.rows.regressor import DecimatedSignals, Entries, distinct_entries
from runtime.rows.segments import SegmentFactors
from runtime.rows.selection import Instants, certain_rows, nothing_left, per_joint
from runtime.settings.study import Study
from runtime.signals.counts.by_blocks import CountStage, CountStart
from runtime.signals.counts.reading import stretches
from runtime.signals.decimation import Plan, decimate
from runtime.signals.filters import (
    SpeedErrors,
    States,
    decimation_plan,
    filtered_states,
    median_filtered,
)
from runtime.signals.states import (
    encoder_drives,
    encoder_position,
    encoder_root,
    sentences,
)

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
    starts : mapping of (int, int) to CountStart
        What is ahead of a piece of counts, by record and first sample; of none where it is the only
        one of its record.
    skimmed : mapping of int to CountStage
        What the counts of a record in several pieces say in all, by its number.
    factors : tuple of SegmentFactors, or None
        Segments of each record, still empty; None where rows are held.
    """

    model: GeneratedModel
    streams: tuple[Stream, ...]
    study: Study
    constants: Mapping[str, float]
    starts: Mapping[tuple[int, int], CountStart] = field(default_factory=dict)
    skimmed: Mapping[int, CountStage] = field(default_factory=dict)
    factors: tuple[SegmentFactors, ...] | None = None

    @cached_property
    def entries(self) -> Entries:
        """Where its regressor is not zero."""
        return distinct_entries(self.model, self.constants)

    def __getstate__(self) -> dict[str, Any]:
        """For other processes: nothing of what was computed."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def columns(self) -> list[Array]:
        """C_j, columns that act on joint j."""
        return [self.entries.k[self.entries.j == j] for j in range(self.streams[0].n)]

    @property
    def filters_choose(self) -> bool:
        """Whether rows are left out by speed or direction, which filtered positions tell."""
        return self.study.signals.reader == "counts" or bool(np.any(self.study.rows.low_speed))

    def with_starts(self, pieces: Sequence[Piece]) -> BlockTask:
        """Where counts are read in several pieces: what is ahead of each, in one pass over the
        positions that reads nothing.
        """
        signals = self.study.signals
        starts: dict[tuple[int, int], CountStart] = {}
        skimmed: dict[int, CountStage] = {}
        for number in (
            {a.record for a, b in pairwise(pieces) if a.record == b.record}
            if signals.reader == "counts"
            else ()
        ):
            stream, begins = (
                self.streams[number],
                [piece.begin for piece in pieces if piece.record == number],
            )
            stage = CountStage(stretches(len(stream)), stream.rate, signals, stream.name)
            drives = encoder_drives(signals.side, motors(self.model, stream))
            reader = PieceReader(stream)

            def positions(
                a: int,
                b: int,
                reader: PieceReader = reader,
                stream: Stream = stream,
                drives: Drives | None = drives,
            ) -> Array:
                _, q, _, missing = reader.read(a, b)
                return _at_encoders(q, missing, stream, drives)

            stage.skim(positions, begins)
            starts |= {(number, begin): start for begin, start in stage.starts.items()}
            skimmed[number] = stage
        return replace(self, starts=starts, skimmed=skimmed)

    @cached_property
    def readers(self) -> list[PieceReader]:
        """What reads the pieces of each stream."""
        return [PieceReader(stream) for stream in self.streams]

    def count_stage(self, piece: Piece) -> CountStage | None:
        """The reader of its counts, where the study asks for it."""
        signals, stream = self.study.signals, self.streams[piece.record]
        if signals.reader != "counts":
            return None
        return CountStage(
            piece.stretches,
            stream.rate,
            signals,
            stream.name,
            self.starts.get((piece.record, piece.begin)),
        )


@dataclass(frozen=True, eq=False)
class RowCounts:
    """Rows of a piece.

    Attributes
    ----------
    fast, known, used, shown : ndarray of int, shape (n,)
        Fast enough, of known state besides, of known direction besides, and those of them among the
        first SHOWN instants.
    t0, t1 : float, s
        Time of the first and of the last row.
    counts : CountStage or None
        What the reader of counts says.
    """

    fast: Array
    known: Array
    used: Array
    shown: Array
    t0: float
    t1: float
    counts: CountStage | None


@dataclass(frozen=True)
class Layout:
    """Which rows of a record are used.

    Attributes
    ----------
    instants : Instants
        Kept samples.
    rows : tuple of int
        Rows used, by joint.
    shown : tuple of int
        Those of the first SHOWN instants.
    t0, t1 : float, s
        Time of the first and of the last row.
    dropped : mapping of str to tuple of int
        Rows left out, per joint, by reason.
    findings : tuple of str
        What the reader of counts says of the encoders.
    """

    instants: Instants
    rows: tuple[int, ...]
    shown: tuple[int, ...]
    t0: float
    t1: float
    dropped: Mapping[str, tuple[int, ...]]
    findings: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        stream: Stream,
        study: Study,
        instants: Instants,
        parts: Sequence[RowCounts],
        skimmed: CountStage | None,
    ) -> Layout:
        """From the counts of all pieces of a record."""
        fast, known, used, shown = (
            np.sum([getattr(part, name) for part in parts], axis=0)
            for name in ("fast", "known", "used", "shown")
        )
        trim, n = study.rows.trim, stream.n
        dropped = {
            "trim": (2 * trim,) * n,
            "low_speed": tuple((instants.kept - 2 * trim - fast).tolist()),
            "mask": (0,) * n,
        }
        if study.signals.reader == "counts":
            dropped["missing"], dropped["direction"] = (
                tuple((fast - known).tolist()),
                tuple((known - used).tolist()),
            )
        if not used.any():
            raise InputError(nothing_left(dropped, instants.kept), file=stream.name)
        counts = skimmed or parts[0].counts
        if skimmed is not None:
            for part in parts:
                skimmed.join(part.counts)
        times = min(part.t0 for part in parts), max(part.t1 for part in parts)
        findings = () if counts is None else sentences(counts.findings, stream.name)
        return cls(instants, tuple(used.tolist()), tuple(shown.tolist()), *times, dropped, findings)


def filtered(task: BlockTask, piece: Piece) -> tuple[Array, States, Array, CountStage | None]:
    """Time (N,), states (N, n) and measured torques (N, n) of a piece, and the reader of its
    counts.
    """
    stream, signals = task.streams[piece.record], task.study.signals
    t, q, tau, gaps = task.readers[piece.record].read(piece.begin, piece.end)
    missing = Missing(gaps, stream.follows) if gaps.any() else None
    counts = task.count_stage(piece)
    if counts is None:
        require_positions(missing, "reader: lowpass", stream.name, COUNTS)
        return t, filtered_states(q, stream.rate, signals), tau, None
    drives = encoder_drives(signals.side, motors(task.model, stream))
    q, s = counts.read(_at_encoders(q, gaps, stream, drives))
    q = q if drives is None else drives.joint_position(q)
    states = filtered_states(q, stream.rate, replace(signals, median=1))
    errors = SpeedErrors(s, encoder_root(drives, stream.n))
    return t, replace(states, errors=errors), tau, counts


def row_counts(task: BlockTask, piece: Piece) -> RowCounts:
    """Numbers of the rows of a piece; it is read and filtered only where rows are left out by speed
    or direction.
    """
    at, stream = piece.instants, task.streams[piece.record]
    if not task.filters_choose:
        count = np.full(stream.n, at.used[1] - at.used[0])
        shown = np.clip(SHOWN - at.used[0], 0, count)
        times = _times(stream, [piece.begin + at.sample(k) for k in (at.used[0], at.used[1] - 1)])
        return RowCounts(count, count, count, shown, times[0], times[1], None)
    t, states, _, counts = filtered(task, piece)
    own = slice(at.sample(at.used[0]), at.sample(at.used[1] - 1) + 1, at.factor)
    masks = _masks(task, stream, states[own])
    rows = t[own][masks[-1].any(axis=0)]
    t0, t1 = (float(rows[0]), float(rows[-1])) if len(rows) else (np.inf, -np.inf)
    fast, known, used = (mask.sum(axis=1) for mask in masks)
    shown = masks[-1][:, : max(SHOWN - at.used[0], 0)].sum(axis=1)
    return RowCounts(fast, known, used, shown, t0, t1, counts)


def observed_chunks(
    task: BlockTask, piece: Piece
) -> Iterator[tuple[int, Array, Array, list[Array]]]:
    """Number of the first instant, time (k,), mask (n, k) of the instants, and the rows
    [W_j[:, C_j] Y_j]' of every joint where its mask is true, by chunks of a piece.
    """
    stream, entries = task.streams[piece.record], task.entries
    t, states, tau, _ = filtered(task, piece)
    tau = median_filtered(tau, task.study.signals.median)
    of_joint = [entries.j == j for j in range(stream.n)]
    evaluated: dict[Plan | None, DecimatedSignals] = {}
    for at in chunks(piece.instants):
        window = slice(at.start, at.stop)
        plan = decimation_plan(at.stop - at.start, at.factor, task.study.signals.decimate, at.first)
        if plan not in evaluated:
            evaluated = {plan: DecimatedSignals(task.model, entries, task.constants, plan)}
        own = slice(at.used[0] - at.number, at.used[1] - at.number)
        signals = evaluated[plan](states[window])[:, own]
        Y = np.ascontiguousarray(tau[window].T)
        Y = (Y if plan is None else decimate(Y, plan))[:, own]
        kept = slice(at.sample(at.used[0]), at.sample(at.used[1] - 1) + 1, at.factor)
        mask = _masks(task, stream, states[kept])[-1]
        W = [entries.sign[m, None] * signals[entries.which[m]] for m in of_joint]
        rows = [np.vstack([W[j], Y[j]])[:, mask[j]] for j in range(stream.n)]
        yield at.used[0], t[kept], mask, rows


def piece_rows(
    task: BlockTask, piece: Piece
) -> tuple[list[tuple[Array, Array, list[Array]]], SegmentFactors | None]:
    """Rows of a piece as `HeldRows.take` takes them, those of the first SHOWN instants alone where
    the rows are reduced, and their segments then.
    """
    blocks, factors = [], None if task.factors is None else deepcopy(task.factors[piece.record])
    for number, t, mask, rows in observed_chunks(task, piece):
        inside = mask.any(axis=0)
        block = t[inside], mask[:, inside], rows
        if factors is None or number < SHOWN:
            blocks.append(block)
        if factors is not None:
            factors.take(*block)
    if factors is not None:
        factors.reduce()
    return blocks, factors


def _masks(task: BlockTask, stream: Stream, states: States) -> tuple[Array, Array, Array]:
    """Rows fast enough, of known state besides, of known direction besides, bool (n, K) each, at
    the states (K, n).
    """
    speeds = per_joint(task.study.rows.low_speed, stream.n, "rows.low_speed")
    fast = np.abs(states.qd.T) >= speeds[:, None]
    known = fast if states.errors is None else fast & states.errors.known
    return fast, known, known & certain_rows(task.model, states, task.constants)


def _at_encoders(q: Array, missing: Array, stream: Stream, drives: Drives | None) -> Array:
    """Positions at the encoders, shape (B, n), nan where they are missing."""
    return encoder_position(
        q,
        drives,
        Missing(missing, stream.follows).at_encoders(drives) if missing.any() else None,
    )


def motors(model: GeneratedModel, stream: Stream) -> Drives | None:
    """Drives by which a stream is read, or those of the robot."""
    return stream.origin.drives or drives_of(model)


def _times(stream: Stream, samples: Sequence[int]) -> list[float]:
    """Time of some samples, s."""
    found: dict[int, float] = {}
    begin = 0
    for t in stream.times():
        found |= {k: float(t[k - begin]) for k in samples if begin <= k < begin + len(t)}
        begin += len(t)
    return [found[k] for k in samples]
