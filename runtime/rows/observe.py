"""From records to the observed linear system Y = W X + rho, eqs. (6) and (14).

    observe(model, records, study)        one record or several stacked, in memory or by blocks

Records that are read by blocks give the same Observation while W stays below HELD bytes. Beyond,
its rows are reduced to triangular factors of
segments of time (`runtime.rows.segments`), from which estimators that need no single row
read what they need.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.parallel import Workers, in_order, started
from runtime.records.stream import RecordStream, Stream
from runtime.rows.by_blocks import BlockTask, Layout, piece_rows, row_counts
from runtime.rows.observation import (
    HELD,
    Observation,
    Reduced,
    all_files,
    default_block,
    halves,
    rows_reduced,
    same_settings,
    stack,
)
from runtime.rows.pieces import Piece, pieces
from runtime.rows.prepared import (
    Prepared,
    Source,
    decimated_torque,
    prepared,
    record_of,
    settings_of,
)
from runtime.rows.segments import HeldRows, SegmentFactors, Window
from runtime.rows.selection import instants_of
from runtime.settings.study import Study

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
    study = study or Study()
    several = list(records) if isinstance(records, Sequence) else [records]
    if not several or (keep is not None and (len(several) > 1 or isinstance(several[0], Stream))):
        raise InputError(
            "no record to observe" if not several else "keep goes with one record in memory"
        )
    blocks = [record.block for record in several if isinstance(record, Stream)]
    if blocks:
        streams = [
            record if isinstance(record, Stream) else RecordStream(record_of(record), blocks[0])
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
    records = [
        (
            k,
            stream,
            instants_of(stream.times(), stream.rate, study.signals, study.rows, stream.name),
        )
        for k, stream in enumerate(streams)
    ]
    every = [
        piece for k, stream, whole in records for piece in pieces(k, stream, study.signals, whole)
    ]
    task = BlockTask(model, tuple(streams), study, constants).with_starts(every)
    if not all(stream.in_any_order for stream in streams):
        workers = Workers(1)  # pieces are read behind one another
    asked = (
        every
        if task.filters_choose
        else [Piece(k, 0, len(stream), whole, ()) for k, stream, whole in records]
    )
    counted = list(zip(asked, in_order(row_counts, task, asked, workers), strict=True))
    layouts = [
        Layout.of(
            stream,
            study,
            whole,
            [part for piece, part in counted if piece.record == k],
            task.skimmed.get(k),
        )
        for k, stream, whole in records
    ]
    counts = np.array([at.rows for at in layouts])
    names, columns = tuple(model.BASE_PARAMETERS), task.columns
    held = 8 * int(counts.sum()) * len(names) <= HELD
    if needed_by and not held:
        raise rows_reduced(needed_by)
    rows = tuple(counts.sum(axis=0).tolist())
    rate = max(stream.rate / whole.factor for _, stream, whole in records)
    span = min(at.t0 for at in layouts), max(at.t1 for at in layouts)
    cuts = tuple(windows if windows is not None else study.validate.split or halves(*span))
    length = float(study.estimate.options.get("block") or default_block(rows, rate))
    kept = HeldRows(columns, counts if held else np.array([at.shown for at in layouts]), len(names))
    factors = tuple(SegmentFactors(k, at.t0, length, cuts, columns) for k, at in enumerate(layouts))
    wanted = replace(task, factors=None if held else deepcopy(factors))
    for piece, (blocks, own) in zip(
        every, in_order(piece_rows, wanted, every, workers), strict=True
    ):
        for block in blocks:
            kept.take(piece.record, *block)
        if own is not None:
            factors[piece.record].join(own)
    settings = same_settings(
        [settings_of(study.signals, study.rows, whole.factor) for *_, whole in records]
    )
    observation = Observation(
        W=kept.transposed.T,
        Y=kept.Y,
        rows=kept.rows,
        names=names,
        t=kept.t,
        record=kept.record,
        rate=rate,
        dropped={
            reason: tuple(np.sum([at.dropped[reason] for at in layouts], axis=0).tolist())
            for reason in layouts[0].dropped
        },
        settings={**settings, "stream": {"block": max(stream.block for stream in streams)}},
        files=all_files([stream.origin.files for stream in streams]),
        findings=tuple(dict.fromkeys(text for at in layouts for text in at.findings)),
    )
    if held:
        return observation
    no_rows = np.empty(0)
    segments = tuple(segment for of_record in factors for segment in of_record.finish())
    reduced = Reduced(segments, cuts, span, length, observation)
    return replace(
        observation,
        W=np.empty((0, len(names))),
        Y=no_rows,
        t=no_rows,
        record=no_rows.astype(int),
        rows=rows,
        reduced=reduced,
    )
