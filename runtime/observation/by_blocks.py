"""Rows of Y = W X + rho of a record that is read by blocks: those of the whole record, with nothing of its length kept.

Each block goes through the filters of `runtime.observation.streaming_filters`, the distinct signals of the regressor and the decimation. Filters,
ends, instants and rows are those of `runtime.observation.observation.observe` on the record in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.observation.counts_by_blocks import CountStage
from runtime.observation.filters import SpeedErrors, States, decimation_factor, decimation_plan, kept_samples
from runtime.observation.regressor_signals import DistinctSignals, Entries
from runtime.observation.rows import nothing_left, per_joint
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


@dataclass(frozen=True)
class Layout:
    """Which samples of a record are used.

    Attributes
    ----------
    start, stop : int
        Raw samples of the window, [start, stop).
    factor, first, kept : int
        Decimation keeps one sample in `factor` from `first` on, `kept` in all.
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

    start: int
    stop: int
    factor: int
    first: int
    kept: int
    rows: tuple[int, ...]
    shown: tuple[int, ...]
    t0: float
    t1: float
    dropped: Mapping[str, tuple[int, ...]]
    findings: tuple[str, ...] = ()


def layout(model: GeneratedModel, stream: Stream, study: Study, constants: Mapping[str, float]) -> Layout:
    """Window, decimation and rows of a record; the record is read and filtered only where rows are left out by speed or direction."""
    rows, signals = study.rows, study.signals
    start, stop = _window(stream, *rows.window)
    factor = decimation_factor(signals, stream.rate)
    instants = kept_samples(stop - start, factor, signals.decimate.phase if signals.decimate else "first")
    K, n = len(instants), stream.n
    if 2 * rows.trim >= K:
        raise InputError(
            f"{K} rows per joint after decimation by {factor}, of which rows.trim leaves out {2 * rows.trim}; "
            "use a longer record or window, or a smaller rows.trim",
            file=stream.name,
        )
    at = Layout(start, stop, factor, int(instants[0]), K, (), (), np.inf, -np.inf, {})
    counts, fast, known, shown, k = *np.zeros((4, n), dtype=int), 0
    counted = CountStage(len(stream), stream.rate, signals, stream.name) if signals.reader == "counts" else None
    for t, mask, of_state, certain in _instants(model, stream, study, at, constants, counted):
        fast += mask.sum(axis=1)
        known += (mask & of_state).sum(axis=1)
        mask = mask & certain
        counts += mask.sum(axis=1)
        shown += mask[:, : max(SHOWN - k, 0)].sum(axis=1)
        k += len(t)
        used = t[mask.any(axis=0)]
        if len(used):
            at = replace(at, t0=min(at.t0, float(used[0])), t1=max(at.t1, float(used[-1])))
    dropped = {"trim": (2 * rows.trim,) * n, "low_speed": tuple((K - 2 * rows.trim - fast).tolist()), "mask": (0,) * n}
    if signals.reader == "counts":
        dropped["missing"], dropped["direction"] = tuple((fast - known).tolist()), tuple((known - counts).tolist())
    if not counts.any():
        raise InputError(nothing_left(dropped, K), file=stream.name)
    findings = sentences(counted.findings, stream.name) if counted else ()
    return replace(at, rows=tuple(counts.tolist()), shown=tuple(shown.tolist()), dropped=dropped, findings=findings)


def _instants(
    model: GeneratedModel, stream: Stream, study: Study, at: Layout, constants: Mapping[str, float], counts: CountStage | None
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Time (k,) of the kept instants, rows used but for state and direction, bool (n, k), instants of known state, (k,), and rows in which both are
    known, (n, k), by blocks."""
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    k = 0
    if speeds.any() or counts is not None:
        timed = ((t, qd, s) for t, _, qd, _, s, _ in filtered_blocks(model, stream, study.signals, counts))
    else:
        timed = ((t, np.empty((len(t), stream.n)), np.empty((len(t), 0))) for t in stream.times())
    for begin, (t, qd, s) in _windowed(timed, at):
        kept = _kept(begin, len(t), at)
        mask = _mask(k, qd[kept], speeds, study.rows.trim, at)
        k += mask.shape[1]
        states = _states(model, study.signals, qd[kept], qd[kept], qd[kept], s[kept])
        yield t[kept], mask, np.isfinite(s[kept]).all(axis=1), certain_rows(model, states, constants)


def observed_blocks(
    model: GeneratedModel, stream: Stream, study: Study, at: Layout, entries: Entries, constants: Mapping[str, float]
) -> Iterator[tuple[Array, Array, list[Array]]]:
    """Time (k,), mask (n, k) of the kept instants, and the rows [W_j[:, C_j] Y_j]' of every joint where its mask is true, by blocks."""
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    N = at.stop - at.start
    plan = decimation_plan(N, at.factor, study.signals.decimate)
    whole, torques = (Chain() if plan is None else StreamedDecimation(plan) for _ in range(2))
    evaluate = DistinctSignals(model, entries, constants)
    of_joint = [entries.j == j for j in range(stream.n)]
    times, masks = Queue(), Queue()
    k = 0

    def ready(signals: Array, torque: Array) -> Iterator[tuple[Array, Array, list[Array]]]:
        if signals.shape[1]:
            mask = masks.take(signals.shape[1]).T
            W = [entries.sign[m, None] * signals[entries.which[m]] for m in of_joint]
            yield times.take(signals.shape[1]), mask, [np.vstack([W[j], torque[j]])[:, mask[j]] for j in range(stream.n)]

    uniform = list(pairwise([*range(0, N, EVALUATED), N]))
    pieces = uniform if plan is None else plan.pieces(EVALUATED)
    blocks = (block for _, block in _windowed(filtered_blocks(model, stream, study.signals), at))
    for (begin, end), (t, q, qd, qdd, s, tau) in zip(pieces, recut(blocks, [b - a for a, b in pieces]), strict=True):
        kept = _kept(begin, end - begin, at)
        states = _states(model, study.signals, q, qd, qdd, s)
        mask = _mask(k, qd[kept], speeds, study.rows.trim, at) & certain_rows(model, states[kept], constants)
        k += mask.shape[1]
        times.put(t[kept])
        masks.put(mask.T)
        yield from ready(whole.push(evaluate(states)), torques.push(tau.T))
    yield from ready(whole.finish(), torques.finish())


def filtered_blocks(
    model: GeneratedModel, stream: Stream, signals: Signals, counts: CountStage | None = None
) -> Iterator[tuple[Array, Array, Array, Array, Array, Array]]:
    """t (B,), q, qd, qdd, deviations of the velocities at the encoders and torques (B, n), by blocks of their own lengths.

    Positions and torques have passed the median and low-pass filters, or the reader of counts in place of the median; without it there are no
    deviations, (B, 0).
    """
    drives = None
    if signals.reader == "counts":
        counts, drives = counts or CountStage(len(stream), stream.rate, signals, stream.name), encoder_drives(model, signals)
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
        at_columns = Missing(missing, stream.follows) if missing.any() else None
        if counts is None:
            require_positions(at_columns, "reader: lowpass", stream.name, COUNTS)
        else:
            q, s = counts.push(encoder_position(q, drives, None if at_columns is None else at_columns.at_encoders(drives)))
            q = q if drives is None or not len(q) else drives.joint_position(q)
        q = position.push(q)
        qd = velocity.push(q) if len(q) else q
        put(t, torque.push(tau), s, q, qd, acceleration.push(qd) if len(qd) else qd)
        yield from known()
    q = position.finish()
    qd = _pushed_and_finished(velocity, q)
    put(np.empty(0), torque.finish(), np.empty(0), q, qd, _pushed_and_finished(acceleration, qd))
    yield from known()


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


def _windowed(blocks: Iterable[Block], at: Layout) -> Iterator[tuple[int, Block]]:
    """The parts of the blocks in the window, and where they begin in it."""
    begin = 0
    for block in blocks:
        end = begin + len(block[0])
        a, b = max(begin, at.start), min(end, at.stop)
        if a < b:
            yield a - at.start, tuple(x[a - begin : b - begin] for x in block)  # type: ignore[misc]
        begin = end


def _kept(begin: int, count: int, at: Layout) -> slice:
    """Which of `count` samples from `begin` on, in the window, decimation keeps."""
    return slice(at.first - begin if begin < at.first else -(begin - at.first) % at.factor, count, at.factor)


def _mask(k: int, qd: Array, speeds: Array, trim: int, at: Layout) -> Array:
    """Rows used at the kept instants k, k + 1 ... with velocities qd (B, n), bool (n, B)."""
    number = k + np.arange(len(qd))
    inside = (number >= trim) & (number < at.kept - trim)
    return inside & (np.abs(qd.T) >= speeds[:, None]) if speeds.any() else np.tile(inside, (qd.shape[1], 1))


def _pushed_and_finished(stage: Stage, x: Array) -> Array:
    parts = [part for part in (*([stage.push(x)] if len(x) else []), stage.finish()) if len(part)]
    return np.concatenate(parts) if parts else x[:0]
