"""From a record that does not fit into memory to what its rows leave behind: `observe` and `stack` by blocks, without W.

    reduction = reduce_records(model, streams, study)        a Reduction: estimators, essential parameters and validation take it like an Observation

Each block goes through the drives, the filters of `runtime.observation.streaming_filters`, the distinct signals of the regressor and the decimation, and its rows into the
triangular factors of their segment. Nothing of the length of the record is kept, and the result is that of the whole record: same filters,
ends, instants and rows. A record is read once; twice where rows are left out by speed, since the blocks of residuals depend on their number.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.estimators import LINEAR
from runtime.estimators.block_covariance import BLOCKS, SHORTEST
from runtime.model.generated import GeneratedModel
from runtime.observation.filters import States, decimation_factor, decimation_plan, kept_samples
from runtime.observation.observation import Observation, all_files, stack
from runtime.observation.reduction import Reduction, Segment, SegmentFactors, Window
from runtime.observation.regressor_signals import DistinctSignals, Entries, distinct_entries
from runtime.observation.rows import per_joint
from runtime.observation.streaming_filters import (
    Chain,
    Stage,
    StreamedDecimation,
    derivative_stage,
    median_stage,
    position_stage,
    velocity_stage,
)
from runtime.records.stream import Queue, Stream, recut
from runtime.settings.study import EstimateSettings, Signals, Study, to_mapping

Array = np.ndarray
Block = TypeVar("Block", bound=tuple[Array, ...])

EVALUATED = 8192  # samples of the regressor at a time
SHOWN = 4096  # instants of every record whose rows are kept for figures


@dataclass(frozen=True)
class Layout:
    """Which samples of a record are used: [start, stop), of which one in `factor` from `first` on, `kept` in all.

    rows : by joint.   t0, t1 : time of the first and the last row, s.   dropped : as in an Observation.
    """

    start: int
    stop: int
    factor: int
    first: int
    kept: int
    rows: tuple[int, ...]
    t0: float
    t1: float
    dropped: Mapping[str, tuple[int, ...]]


def reduce_records(
    model: GeneratedModel,
    streams: Sequence[Stream],
    study: Study,
    *,
    windows: Sequence[Window] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Reduction:
    """The rows of several records of one robot, reduced to triangular factors of segments of time.

    windows : those that `between` will be asked for; default: study.validate.split, or the two halves of the rows.
    """
    if not streams:
        raise InputError("no record to reduce")
    _require_reducible(study.estimate)
    layouts = [layout(stream, study) for stream in streams]
    span = min(at.t0 for at in layouts), max(at.t1 for at in layouts)
    cuts = tuple(windows if windows is not None else study.validate.split or halves(*span))
    rate = max(stream.rate / at.factor for stream, at in zip(streams, layouts, strict=True))
    counted = max(sum(at.rows[j] for at in layouts) for j in range(streams[0].n))
    length = float(study.estimate.options.get("block", max(counted / BLOCKS, SHORTEST) / rate))
    entries = distinct_entries(model, constants or {})
    segments: list[Segment] = []
    shown = []
    for number, (stream, at) in enumerate(zip(streams, layouts, strict=True)):
        sink = SegmentFactors(number, at.t0, length, cuts, [entries.k[entries.j == j] for j in range(stream.n)])
        beginning = _Beginning(model, stream, study, at, entries)
        for t, mask, signals, torque in decimated_blocks(model, stream, study, at, entries, constants or {}):
            beginning.take(t, mask, signals, torque)
            rows = [np.vstack([_rows_of(entries, j, signals), torque[j]])[:, mask[j]] for j in range(stream.n)]
            sink.take(t, mask, rows)
        segments += sink.finish()
        shown.append(beginning.observation())
    several = stack(shown)
    return Reduction(
        names=tuple(model.BASE_PARAMETERS),
        segments=tuple(segments),
        windows=cuts,
        span=span,
        rate=rate,
        residual_block=length,
        shown=several,
        dropped={reason: tuple(np.sum([at.dropped[reason] for at in layouts], axis=0).tolist()) for reason in layouts[0].dropped},
        settings={**several.settings, "stream": {"block": max(stream.block for stream in streams)}},
        files=all_files([stream.files for stream in streams]),
    )


def _require_reducible(settings: EstimateSettings) -> None:
    """Raise SettingsError, before anything is read, for estimates that need the rows themselves."""
    if settings.method not in LINEAR:
        message = f"{settings.method} needs the rows, and this record is read by blocks; use {' or '.join(LINEAR)}, or stream: off"
        raise SettingsError(message, path=("estimate", "method"))
    if settings.weights == "covariance":
        message = "covariance needs the rows of an instant together, and this record is read by blocks; use weights: joint, or stream: off"
        raise SettingsError(message, path=("estimate", "weights"))


def halves(t0: float, t1: float) -> tuple[Window, Window]:
    """The two halves of [t0, t1], s; no instant belongs to both."""
    middle = (t0 + t1) / 2
    return (t0, middle), (float(np.nextafter(middle, t1)), t1)


def layout(stream: Stream, study: Study) -> Layout:
    """Window, decimation and rows of a record; where rows are left out by speed, the filtered velocities are needed and the record is read."""
    rows, signals = study.rows, study.signals
    start, stop = _window(stream, *rows.window)
    factor = decimation_factor(signals, stream.rate)
    instants = kept_samples(stop - start, factor, signals.decimate.phase if signals.decimate else "first")
    first, K, n = int(instants[0]), len(instants), stream.n
    if 2 * rows.trim >= K:
        raise InputError(
            f"{K} rows per joint after decimation by {factor}, of which rows.trim leaves out {2 * rows.trim}; "
            "use a longer record or window, or a smaller rows.trim",
            file=stream.name,
        )
    at = Layout(
        start,
        stop,
        factor,
        first,
        K,
        (K - 2 * rows.trim,) * n,
        0.0,
        0.0,
        {"trim": (2 * rows.trim,) * n, "low_speed": (0,) * n, "mask": (0,) * n},
    )
    counts, t0, t1 = np.zeros(n, dtype=int), np.inf, -np.inf
    for t, mask in instants_of(stream, study, at):
        counts += mask.sum(axis=1)
        used = t[mask.any(axis=0)]
        if len(used):
            t0, t1 = min(t0, float(used[0])), max(t1, float(used[-1]))
    slow = tuple((K - 2 * rows.trim - counts).tolist())
    dropped = {**at.dropped, "low_speed": slow}
    if not counts.any():
        raise InputError(f"no row is left: {dropped} rows per joint were left out of {K}", file=stream.name)
    return replace(at, rows=tuple(counts.tolist()), t0=t0, t1=t1, dropped=dropped)


def instants_of(stream: Stream, study: Study, at: Layout) -> Iterator[tuple[Array, Array]]:
    """Time (k,) and mask (n, k) of the kept instants, by blocks."""
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    k = 0
    if speeds.any():
        timed = ((t, qd) for t, _, qd, _, _ in filtered_blocks(stream, study.signals))
    else:
        timed = ((t, np.empty((len(t), stream.n))) for t in stream.times())
    for begin, (t, qd) in _windowed(timed, at):
        kept = _kept(begin, len(t), at)
        mask = _mask(k, qd[kept], speeds, study.rows.trim, at)
        k += mask.shape[1]
        yield t[kept], mask


def decimated_blocks(
    model: GeneratedModel, stream: Stream, study: Study, at: Layout, entries: Entries, constants: Mapping[str, float]
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Time (k,), mask (n, k), distinct signals (S, k) and torques (n, k) of the kept instants, by blocks."""
    speeds = per_joint(study.rows.low_speed, stream.n, "rows.low_speed")
    N = at.stop - at.start
    plan = decimation_plan(N, at.factor, study.signals.decimate)
    whole, torques = (Chain() if plan is None else StreamedDecimation(plan) for _ in range(2))
    evaluate = DistinctSignals(model, entries, constants)
    times, masks = Queue(), Queue()
    k = 0

    def ready(y: Array, Y: Array) -> Iterator[tuple[Array, Array, Array, Array]]:
        if y.shape[1]:
            yield times.take(y.shape[1]), masks.take(y.shape[1]).T, y, Y

    pieces = uniform_pieces(N) if plan is None else plan.pieces(EVALUATED)
    blocks = (block for _, block in _windowed(filtered_blocks(stream, study.signals), at))
    for (begin, end), (t, q, qd, qdd, tau) in zip(pieces, recut(blocks, [b - a for a, b in pieces]), strict=True):
        kept = _kept(begin, end - begin, at)
        mask = _mask(k, qd[kept], speeds, study.rows.trim, at)
        k += mask.shape[1]
        times.put(t[kept])
        masks.put(mask.T)
        yield from ready(whole.push(evaluate(States(q, qd, qdd))), torques.push(tau.T))
    yield from ready(whole.finish(), torques.finish())


def uniform_pieces(N: int) -> list[tuple[int, int]]:
    """[t0, t1) of N samples, EVALUATED at a time."""
    return list(pairwise([*range(0, N, EVALUATED), N]))


def filtered_blocks(stream: Stream, signals: Signals) -> Iterator[tuple[Array, Array, Array, Array, Array]]:
    """t (B,), q, qd, qdd and torques (B, n) after the median and low-pass filters, by blocks of their own lengths."""
    position, velocity = position_stage(stream.rate, signals), velocity_stage(stream.rate, signals)
    acceleration, torque = derivative_stage(stream.rate, signals.ends), Chain(*median_stage(signals.median))
    queues = [Queue() for _ in range(5)]

    def put(t: Array, tau: Array, q: Array, qd: Array, qdd: Array) -> None:
        for queue, x in zip(queues, (t, q, qd, qdd, tau), strict=True):
            queue.put(x)

    def known() -> Iterator[tuple[Array, Array, Array, Array, Array]]:
        count = min(queue.count for queue in queues)
        if count:
            t, q, qd, qdd, tau = (queue.take(count) for queue in queues)
            yield t, q, qd, qdd, tau

    for t, q, tau in stream.blocks():
        q = position.push(q)
        qd = velocity.push(q)
        put(t, torque.push(tau), q, qd, acceleration.push(qd))
        yield from known()
    q = position.finish()
    qd = _pushed_and_finished(velocity, q)
    put(np.empty(0), torque.finish(), q, qd, _pushed_and_finished(acceleration, qd))
    yield from known()


class _Beginning:
    """The rows of the first instants of a record, as an Observation, for figures."""

    def __init__(self, model: GeneratedModel, stream: Stream, study: Study, at: Layout, entries: Entries) -> None:
        self.model, self.stream, self.study, self.at, self.entries = model, stream, study, at, entries
        self.parts: list[tuple[Array, Array, Array, Array]] = []
        self.count = 0

    def take(self, t: Array, mask: Array, signals: Array, torque: Array) -> None:
        """The next instants."""
        k = min(len(t), SHOWN - self.count)
        if k > 0:
            self.parts.append((t[:k], mask[:, :k].copy(), signals[:, :k].copy(), torque[:, :k].copy()))
            self.count += k

    def observation(self) -> Observation:
        """Those of the instants whose rows are used."""
        t, mask, signals, torque = (np.concatenate(x, axis=-1) for x in zip(*self.parts, strict=True))
        e, n, b = self.entries, self.stream.n, len(self.model.BASE_PARAMETERS)
        store = np.zeros((b, n, len(t)))
        store[e.row, e.j] = e.sign[:, None] * signals[e.which]
        used = mask.ravel()
        return Observation(
            W=np.compress(used, store.reshape(b, -1), axis=1).T,
            Y=torque.ravel()[used],
            rows=tuple(int(k) for k in mask.sum(axis=1)),
            names=tuple(self.model.BASE_PARAMETERS),
            t=np.tile(t, n)[used],
            record=np.zeros(int(used.sum()), dtype=int),
            rate=self.stream.rate / self.at.factor,
            dropped=self.at.dropped,
            settings={"signals": to_mapping(self.study.signals), "rows": to_mapping(self.study.rows), "factor": self.at.factor},
            files=self.stream.files,
        )


def _rows_of(entries: Entries, j: int, signals: Array) -> Array:
    """W_j[:, C_j]', shape (|C_j|, k)."""
    mine = entries.j == j
    return np.asarray(entries.sign[mine, None] * signals[entries.which[mine]])


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
