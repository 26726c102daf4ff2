"""Rows of Y = W X + rho of a record that is read by blocks: those of the whole record, with nothing of its length kept.

Each block goes through the filters of `runtime.observation.streaming_filters`, the distinct signals of the regressor and the decimation. Filters,
ends, instants and rows are those of `runtime.observation.observation.observe` on the record in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from runtime.errors import InputError
from runtime.model.compiled import text_of
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, ModelText, loaded
from runtime.observation.counts import stretches
from runtime.observation.counts_by_blocks import CountStage, CountStart
from runtime.observation.filters import SpeedErrors, States, decimation_factor, decimation_plan, kept_samples
from runtime.observation.pieces import Instants, Piece
from runtime.observation.regressor_signals import DistinctSignals, Entries, distinct_entries
from runtime.observation.rows import nothing_left, per_joint
from runtime.observation.segments import SegmentFactors
from runtime.observation.states import certain_rows, encoder_drives, encoder_position, encoder_root, sentences
from runtime.observation.streaming_filters import (
    Chain,
    Stage,
    StreamedDecimation,
    derivative_stage,
    median_stage,
    position_stage,
    velocity_stage,
)
from runtime.records.missing import COUNTS, Missing, require_positions
from runtime.records.stream import Queue, Stream, recut
from runtime.settings.study import Signals, Study

Array = np.ndarray
Block = TypeVar("Block", bound=tuple[Array, ...])

EVALUATED = 8192  # samples of the regressor at a time
SHOWN = 4096  # instants of every record whose rows are kept for figures


@dataclass(frozen=True, eq=False)
class BlockTask:
    """What every piece of the records needs; it travels to other processes once.

    Attributes
    ----------
    model : GeneratedModel or ModelText
        Emitted module; its text in other processes.
    streams : tuple of Stream
        The records.
    study : Study
        Signals and rows.
    constants : mapping of str to float
        Values in place of the robot file's.
    starts : mapping of (int, int) to CountStart
        What is ahead of a piece of counts, by record and first sample; of none where it is the only one of its record.
    skimmed : mapping of int to CountStage
        What the counts of a record in several pieces say in all, by its number.
    factors : tuple of SegmentFactors, or None
        Segments of each record, still empty; None where rows are held.
    """

    model: GeneratedModel | ModelText
    streams: tuple[Stream, ...]
    study: Study
    constants: Mapping[str, float]
    starts: Mapping[tuple[int, int], CountStart] = field(default_factory=dict)
    skimmed: Mapping[int, CountStage] = field(default_factory=dict)
    factors: tuple[SegmentFactors, ...] | None = None

    @cached_property
    def loaded(self) -> GeneratedModel:
        """The model."""
        return loaded(self.model)

    @cached_property
    def entries(self) -> Entries:
        """Where its regressor is not zero."""
        return distinct_entries(self.loaded, self.constants)

    def __getstate__(self) -> dict[str, Any]:
        """For other processes: the model as text, nothing of what was computed from it."""
        return {**{f.name: getattr(self, f.name) for f in fields(self)}, "model": text_of(self.model)}

    @property
    def columns(self) -> list[Array]:
        """C_j, columns that act on joint j."""
        return [self.entries.k[self.entries.j == j] for j in range(self.streams[0].n)]

    @property
    def filters_choose(self) -> bool:
        """Whether rows are left out by speed or direction, which filtered positions tell."""
        return self.study.signals.reader == "counts" or bool(np.any(self.study.rows.low_speed))

    def with_starts(self, pieces: Sequence[Piece]) -> BlockTask:
        """Where counts are read in several pieces: what is ahead of each, in one pass over the positions that reads nothing."""
        signals = self.study.signals
        starts: dict[tuple[int, int], CountStart] = {}
        skimmed: dict[int, CountStage] = {}
        for number in {a.record for a, b in pairwise(pieces) if a.record == b.record} if signals.reader == "counts" else ():
            stream, begins = self.streams[number], [piece.begin for piece in pieces if piece.record == number]
            stage = CountStage(stretches(len(stream)), stream.rate, signals, stream.name, remembered=begins)
            drives = encoder_drives(self.loaded, signals)
            for _, q, _, missing in stream.blocks():
                stage.skim(_at_encoders(q, missing, stream, drives))
            starts |= {(number, begin): start for begin, start in stage.starts.items()}
            skimmed[number] = stage
        return replace(self, starts=starts, skimmed=skimmed)

    def stream_of(self, piece: Piece) -> Stream:
        """The samples of a piece."""
        stream = self.streams[piece.record]
        return stream if piece.end - piece.begin == len(stream) else stream.part(piece.begin, piece.end)

    def count_stage(self, piece: Piece) -> CountStage | None:
        """The reader of its counts, where the study asks for it."""
        signals, stream = self.study.signals, self.streams[piece.record]
        if signals.reader != "counts":
            return None
        return CountStage(piece.stretches, stream.rate, signals, stream.name, self.starts.get((piece.record, piece.begin)))


@dataclass(frozen=True, eq=False)
class RowCounts:
    """Rows of a piece.

    Attributes
    ----------
    fast, known, used, shown : ndarray of int, shape (n,)
        Fast enough, of known state besides, of known direction besides, and those of them among the first SHOWN instants.
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
    def of(cls, stream: Stream, study: Study, instants: Instants, parts: Sequence[RowCounts], skimmed: CountStage | None) -> Layout:
        """From the counts of all pieces of a record."""
        fast, known, used, shown = (np.sum([getattr(part, name) for part in parts], axis=0) for name in ("fast", "known", "used", "shown"))
        trim, n = study.rows.trim, stream.n
        dropped = {"trim": (2 * trim,) * n, "low_speed": tuple((instants.kept - 2 * trim - fast).tolist()), "mask": (0,) * n}
        if study.signals.reader == "counts":
            dropped["missing"], dropped["direction"] = tuple((fast - known).tolist()), tuple((known - used).tolist())
        if not used.any():
            raise InputError(nothing_left(dropped, instants.kept), file=stream.name)
        counts = skimmed or parts[0].counts
        if skimmed is not None:
            for part in parts:
                skimmed.join(part.counts)
        times = min(part.t0 for part in parts), max(part.t1 for part in parts)
        findings = () if counts is None else sentences(counts.findings, stream.name)
        return cls(instants, tuple(used.tolist()), tuple(shown.tolist()), *times, dropped, findings)


def instants_of(stream: Stream, study: Study) -> Instants:
    """Window and decimation of a record."""
    rows, signals = study.rows, study.signals
    start, stop = _window(stream, *rows.window)
    factor = decimation_factor(signals, stream.rate)
    kept = kept_samples(stop - start, factor, signals.decimate.phase if signals.decimate else "first")
    K = len(kept)
    if 2 * rows.trim >= K:
        raise InputError(
            f"{K} rows per joint after decimation by {factor}, of which rows.trim leaves out {2 * rows.trim}; "
            "use a longer record or window, or a smaller rows.trim",
            file=stream.name,
        )
    return Instants(start, stop, factor, int(kept[0]), K, (rows.trim, K - rows.trim))


def row_counts(task: BlockTask, piece: Piece) -> RowCounts:
    """Numbers of the rows of a piece; it is read and filtered only where rows are left out by speed or direction."""
    model, study, at = task.loaded, task.study, piece.instants
    stream, counts = task.stream_of(piece), task.count_stage(piece)
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    if task.filters_choose:
        timed = ((t, qd, s) for t, _, qd, _, s, _ in filtered_blocks(model, stream, study.signals, counts))
    else:
        timed = ((t, np.empty((len(t), stream.n)), np.empty((len(t), 0))) for t in stream.times())
    fast, known, used, shown = np.zeros((4, stream.n), dtype=int)
    k, t0, t1 = at.number, np.inf, -np.inf
    for begin, (t, qd, s) in _windowed(timed, at):
        kept = _kept(begin, len(t), at)
        mask = _mask(k, qd[kept], speeds, at)
        fast += mask.sum(axis=1)
        known += (mask & np.isfinite(s[kept]).all(axis=1)).sum(axis=1)
        mask &= certain_rows(model, _states(model, study.signals, qd[kept], qd[kept], qd[kept], s[kept]), task.constants)
        used += mask.sum(axis=1)
        shown += mask[:, : max(SHOWN - k, 0)].sum(axis=1)
        k += mask.shape[1]
        own = t[kept][mask.any(axis=0)]
        if len(own):
            t0, t1 = min(t0, float(own[0])), max(t1, float(own[-1]))
    return RowCounts(fast, known, used, shown, t0, t1, counts)


def observed_blocks(task: BlockTask, piece: Piece) -> Iterator[tuple[Array, Array, list[Array]]]:
    """Time (k,), mask (n, k) of the kept instants, and the rows [W_j[:, C_j] Y_j]' of every joint where its mask is true, by blocks."""
    model, study, entries, at = task.loaded, task.study, task.entries, piece.instants
    stream = task.stream_of(piece)
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    N = at.stop - at.start
    plan = decimation_plan(N, at.factor, study.signals.decimate, at.first)
    whole, torques = (Chain() if plan is None else StreamedDecimation(plan) for _ in range(2))
    evaluate = DistinctSignals(model, entries, task.constants)
    of_joint = [entries.j == j for j in range(stream.n)]
    times, masks = Queue(), Queue()
    k = at.number

    def ready(signals: Array, torque: Array) -> Iterator[tuple[Array, Array, list[Array]]]:
        if signals.shape[1]:
            mask = masks.take(signals.shape[1]).T
            W = [entries.sign[m, None] * signals[entries.which[m]] for m in of_joint]
            yield times.take(signals.shape[1]), mask, [np.vstack([W[j], torque[j]])[:, mask[j]] for j in range(stream.n)]

    uniform = list(pairwise([*range(0, N, EVALUATED), N]))
    cuts = uniform if plan is None else plan.pieces(EVALUATED)
    blocks = (block for _, block in _windowed(filtered_blocks(model, stream, study.signals, task.count_stage(piece)), at))
    for (begin, end), (t, q, qd, qdd, s, tau) in zip(cuts, recut(blocks, [b - a for a, b in cuts]), strict=True):
        kept = _kept(begin, end - begin, at)
        states = _states(model, study.signals, q, qd, qdd, s)
        mask = _mask(k, qd[kept], speeds, at) & certain_rows(model, states[kept], task.constants)
        k += mask.shape[1]
        times.put(t[kept])
        masks.put(mask.T)
        yield from ready(whole.push(evaluate(states)), torques.push(tau.T))
    yield from ready(whole.finish(), torques.finish())


def piece_rows(task: BlockTask, piece: Piece) -> tuple[list[tuple[Array, Array, list[Array]]], SegmentFactors | None]:
    """Rows of a piece as `HeldRows.take` takes them, those of the first SHOWN instants alone where the rows are reduced, and their segments then."""
    blocks, k, factors = [], piece.instants.number, None if task.factors is None else deepcopy(task.factors[piece.record])
    for t, mask, rows in observed_blocks(task, piece):
        inside = mask.any(axis=0)
        block = t[inside], mask[:, inside], rows
        if factors is None or k < SHOWN:
            blocks.append(block)
        if factors is not None:
            factors.take(*block)
        k += len(t)
    if factors is not None:
        factors.reduce()
    return blocks, factors


def filtered_blocks(
    model: GeneratedModel, stream: Stream, signals: Signals, counts: CountStage | None = None
) -> Iterator[tuple[Array, Array, Array, Array, Array, Array]]:
    """t (B,), q, qd, qdd, deviations of the velocities at the encoders and torques (B, n), by blocks of their own lengths.

    Positions and torques have passed the median and low-pass filters, or the reader of counts in place of the median; without it there are no
    deviations, (B, 0).
    """
    drives = None if counts is None else encoder_drives(model, signals)
    position, velocity = (
        position_stage(stream.rate, replace(signals, median=1) if counts else signals),
        velocity_stage(stream.rate, signals),
    )
    acceleration, torque = derivative_stage(stream.rate, signals.ends), Chain(*median_stage(signals.median))
    queues = [Queue() for _ in range(6)]

    def put(t: Array, tau: Array, s: Array, q: Array, qd: Array, qdd: Array) -> None:
        for queue, x in zip(queues, (t, q, qd, qdd, s, tau), strict=True):
            queue.put(x)

    def known() -> Iterator[tuple[Array, Array, Array, Array, Array, Array]]:
        count = min(queue.count for queue in queues)
        if count:
            t, q, qd, qdd, s, tau = (queue.take(count) for queue in queues)
            yield t, q, qd, qdd, s, tau

    for t, q, tau, missing in stream.blocks():
        s = np.empty((len(t), 0))
        if counts is None:
            require_positions(Missing(missing, stream.follows) if missing.any() else None, "reader: lowpass", stream.name, COUNTS)
        else:
            q, s = counts.push(_at_encoders(q, missing, stream, drives))
            q = q if drives is None or not len(q) else drives.joint_position(q)
        q = position.push(q)
        qd = velocity.push(q) if len(q) else q
        put(t, torque.push(tau), s, q, qd, acceleration.push(qd) if len(qd) else qd)
        yield from known()
    q = position.finish()
    qd = _pushed_and_finished(velocity, q)
    put(np.empty(0), torque.finish(), np.empty(0), q, qd, _pushed_and_finished(acceleration, qd))
    yield from known()


def _at_encoders(q: Array, missing: Array, stream: Stream, drives: Drives | None) -> Array:
    """Positions at the encoders, shape (B, n), nan where they are missing."""
    return encoder_position(q, drives, Missing(missing, stream.follows).at_encoders(drives) if missing.any() else None)


def _states(model: GeneratedModel, signals: Signals, q: Array, qd: Array, qdd: Array, s: Array) -> States:
    """States with deviations s, shape (B, encoders), of the velocities; (B, 0): none are known."""
    if not s.shape[1]:
        return States(q, qd, qdd)
    return States(q, qd, qdd, SpeedErrors(s, encoder_root(encoder_drives(model, signals), q.shape[1])))


def _window(stream: Stream, t0: float | None, t1: float | None) -> tuple[int, int]:
    """Raw samples with t0 <= t <= t1: [start, stop)."""
    start = stop = 0
    first = last = np.nan
    for t in stream.times():
        start += 0 if t0 is None else int(np.searchsorted(t, t0, side="left"))
        stop += len(t) if t1 is None else int(np.searchsorted(t, t1, side="right"))
        first, last = (float(t[0]) if np.isnan(first) else first), float(t[-1])
    if stop <= start:
        raise InputError(f"no sample in rows.window [{t0}, {t1}] s; the record spans [{first:g}, {last:g}] s", file=stream.name)
    return start, stop


def _windowed(blocks: Iterable[Block], at: Instants) -> Iterator[tuple[int, Block]]:
    """The parts of the blocks in the window, and where they begin in it."""
    begin = 0
    for block in blocks:
        end = begin + len(block[0])
        a, b = max(begin, at.start), min(end, at.stop)
        if a < b:
            yield a - at.start, tuple(x[a - begin : b - begin] for x in block)  # type: ignore[misc]
        begin = end


def _kept(begin: int, count: int, at: Instants) -> slice:
    """Which of `count` samples from `begin` on, in the window, decimation keeps."""
    return slice(at.first - begin if begin < at.first else -(begin - at.first) % at.factor, count, at.factor)


def _mask(k: int, qd: Array, speeds: Array, at: Instants) -> Array:
    """Rows used at the kept instants k, k + 1 ... of the record with velocities qd (B, n), bool (n, B)."""
    number = k + np.arange(len(qd))
    inside = (number >= at.used[0]) & (number < at.used[1])
    return inside & (np.abs(qd.T) >= speeds[:, None]) if speeds.any() else np.tile(inside, (qd.shape[1], 1))


def _pushed_and_finished(stage: Stage, x: Array) -> Array:
    parts = [part for part in (*([stage.push(x)] if len(x) else []), stage.finish()) if len(part)]
    return np.concatenate(parts) if parts else x[:0]
