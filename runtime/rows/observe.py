"""From records to the observed linear system Y = W X + rho, eqs. (6) and (14).

    observe(model, records, study)        one record or several stacked, in memory or by blocks

Records that are read by blocks give the same Observation while W stays below HELD bytes. Beyond,
its rows are reduced to triangular factors of
segments of time (`runtime.rows.segments`), from which estimators that need no single row
read what they need.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.parallel import Workers, in_order, started
from runtime.records.stream import RecordStream, Stream
from runtime.rows.by_blocks import BlockTask, piece_rows, row_counts
from runtime.rows.observation import (
    HELD,
    Observation,
    Reduced,
    default_block,
    halves,
    in_time,
    rows_reduced,
    stack,
)
from runtime.rows.pieces import Piece, pieces
from runtime.rows.prepared import (
    Prepared,
    Source,
    decimated_torque,
    prepared,
    resolved,
)
from runtime.rows.segments import Cuts, Segment, Window, joined
from runtime.rows.selection import instants_of, nothing_left
from runtime.settings.study import SIMULATING, Study
from runtime.signals.states import require_motion, sentences

Array = np.ndarray


def observe(
    model: GeneratedModel,
    records: Source | Sequence[Source],
    study: Study | None = None,
    *,
    keep: Array | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
    windows: Sequence[Window] | None = None,
    needed_by: str = "",
    workers: int | Workers = 1,
) -> Observation:
    """Y = W X + rho of one record, or of several stacked: filtered, differentiated, decimated, rows
    left out.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Prepared, Stream, or a sequence of them
        Joint side, SI. All are read by blocks where one of them is a Stream.
    study : Study, optional
        Signals and rows; default: Study().
    keep : ndarray of bool, shape (N,) or (N, n), optional
        Samples (and joints) of the one record that may be used, e.g. from a simulated velocity.
    columns : sequence of str, optional
        Columns wanted; default: all.
    constants : mapping of str to float, optional
        Values in place of the robot file's, for the model's keyword arguments.
    windows : sequence of (float or None, float or None), s, optional
        Windows that `Observation.between` will be asked for where rows are reduced; default:
        study.validate.split, or the two halves.
    needed_by : str, optional
        What needs the rows themselves, such as a method of estimation.
    workers : int or Workers, optional
        Processes, this one among them, that observe the pieces of long records read by blocks. The
        results do not depend on it in any bit.

    Returns
    -------
    Observation
        Rows held; reduced where records are read by blocks and W takes more than HELD bytes.

    Raises
    ------
    InputError
        No record; `keep` with several records or a Stream; no row left; processes that always die.
    SettingsError
        Rows would be reduced, and `needed_by` needs them.
    """
    several = list(records) if isinstance(records, Sequence) else [records]
    study = resolved(study or Study(), several)[0]
    if not several or (keep is not None and (len(several) > 1 or isinstance(several[0], Stream))):
        raise InputError(
            "no record to observe" if not several else "keep goes with one record in memory"
        )
    blocks = [record.block for record in several if isinstance(record, Stream)]
    if blocks:
        require_motion(study.signals, "reading by blocks (stream)")
        streams = [
            record
            if isinstance(record, Stream)
            else RecordStream(prepared(model, record, study).record, blocks[0])
            for record in several
        ]
        with started(workers) as processes:
            observation = _observed_by_blocks(
                model, streams, study, constants or {}, windows, needed_by, processes
            )
        return observation if columns is None else observation.columns(columns)
    own = [prepared(model, record, study) for record in several if not isinstance(record, Stream)]
    if keep is not None:
        own = [replace(own[0], keep=keep)]
    parts = [one.observation(model, columns, constants) for one in own]
    return parts[0] if len(parts) == 1 else stack(parts)


def at_rest(model: GeneratedModel, records: Sequence[Source], study: Study) -> tuple[Study, str]:
    """The study without the columns that vanish in poses at rest, qd = qdd = 0: those of inertias
    and of friction; and a sentence on it. As it is, and "", where the records are of a motion.

    Raises
    ------
    InputError
        Every column vanishes.
    SettingsError
        Records by blocks, a method that simulates the loop, a load.
    """
    if study.signals.reader != "static":
        return study, ""
    if study.estimate.method in SIMULATING or study.payload is not None:
        require_motion(study.signals, "a load, or a method that simulates the loop,")
    W, asked = observe(model, records, study).W, study.estimate.columns
    moving = np.abs(W).max(axis=0) > 1e-9 * np.abs(W).max()  # not zero but for rounding
    acting = set(np.array(model.BASE_PARAMETERS)[moving])
    names = model.BASE_PARAMETERS if asked == "all" else asked
    shown = tuple(name for name in names if name in acting)
    if not shown:
        raise InputError(
            f"poses at rest show no parameter of {model.NAME}: gravity acts along none of its "
            "joints, and there is no offset or spring; record a motion, or correct gravity in the "
            "robot file"
        )
    text = (
        f"Poses at rest: {len(shown)} of {len(names)} base parameters have a torque in them, the "
        "others (inertias, friction) are left out. Dry friction holds a joint with a torque of "
        "unknown sign: approach every pose from both sides and record the mean, or both as poses."
    )
    return replace(study, estimate=replace(study.estimate, columns=shown)), text


def with_torques(
    observation: Observation, records: Sequence[Prepared], torques: Sequence[Array]
) -> Observation:
    """The same rows of W beside other torques, shape (N, n), of the records observed."""
    Y = np.empty_like(observation.Y)
    for number, (own, tau) in enumerate(zip(records, torques, strict=True)):
        rows = observation.record == number
        Y[rows] = decimated_torque(tau, own.selection)[
            observation.joints[rows], np.searchsorted(own.selection.t, observation.t[rows])
        ]
    return replace(observation, Y=Y)


def _observed_by_blocks(
    model: GeneratedModel,
    streams: Sequence[Stream],
    study: Study,
    constants: Mapping[str, float],
    windows: Sequence[Window] | None,
    needed_by: str,
    workers: Workers,
) -> Observation:
    """Rows of several records read by blocks: held while W takes at most HELD bytes, else reduced.

    A record is read once; twice where rows are left out by speed, since their number is needed
    first.
    """
    signals, chosen, numbers = study.signals, study.rows, range(len(streams))
    instants = [instants_of(x.times(), x.rate, signals, chosen, x.name) for x in streams]
    every = [
        piece
        for k, stream, whole in zip(numbers, streams, instants, strict=True)
        for piece in pieces(k, stream, signals, whole)
    ]
    task = BlockTask(model, tuple(streams), study, constants).with_starts(every)
    if not all(stream.in_any_order for stream in streams):
        workers = Workers(1)  # pieces are read behind one another
    asked = (
        every
        if task.filters_choose
        else [Piece(k, 0, len(streams[k]), instants[k], ()) for k in numbers]
    )
    rows = np.zeros((len(streams), len(model.JOINTS)), dtype=int)
    spans = np.array([[np.inf, -np.inf]] * len(streams))
    for piece, (count, t0, t1) in zip(
        asked, in_order(row_counts, task, asked, workers), strict=True
    ):
        rows[piece.record] += count
        first, last = spans[piece.record]
        spans[piece.record] = min(first, t0), max(last, t1)
    held = 8 * int(rows.sum()) * len(model.BASE_PARAMETERS) <= HELD
    if needed_by and not held:
        raise rows_reduced(needed_by)
    rate = max(x.rate / whole.factor for x, whole in zip(streams, instants, strict=True))
    span = float(spans[:, 0].min()), float(spans[:, 1].max())
    cuts = tuple(windows if windows is not None else study.validate.split or halves(*span))
    in_all = tuple(rows.sum(axis=0).tolist())
    length = float(study.estimate.options.get("block") or default_block(in_all, rate))
    if not held:
        task = replace(task, cuts=tuple(Cuts(float(t0), length, cuts) for t0, _ in spans))
    parts: list[list[Observation]] = [[] for _ in streams]
    segments: list[Segment] = []
    counts = dict(task.skimmed)
    for piece, (chunks, reduced, stage) in zip(
        every, in_order(piece_rows, task, every, workers), strict=True
    ):
        parts[piece.record] += chunks
        segments += reduced
        if stage is not None:
            counts.setdefault(piece.record, stage).join(stage)
    records = []
    for k, stream in enumerate(streams):
        own = in_time(parts.pop(0))
        first, last = instants[k].used
        trimmed = instants[k].kept - (last - first)
        dropped = {**own.dropped, "trim": (trimmed,) * stream.n}
        if not rows[k].any():
            raise InputError(nothing_left(dropped, instants[k].kept), file=stream.name)
        found = sentences(counts[k].findings, stream.name) if k in counts else ()
        records.append(replace(own, dropped=dropped, files=stream.origin.files, findings=found))
    observation = stack(records)
    block = {"block": max(stream.block for stream in streams)}
    observation = replace(observation, settings={**observation.settings, "stream": block})
    if held:
        return observation
    none = observation.where(np.zeros(len(observation.Y), dtype=bool))
    factors = Reduced(joined(segments), cuts, span, length, observation)
    return replace(none, rows=in_all, reduced=factors)
