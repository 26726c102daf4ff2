"""From records to the observed linear system Y = W X + rho, eqs. (6) and (14).

    observe(model, records, study)                   the whole way, one record or several stacked, in memory or by blocks; or its steps:
    observed_states(model, q, rate, signals)         q, qd, qdd, by the reader of the study
    select_rows(record, qd, study)                   window, decimated instants, rows left out
    decimated_torque(tau, selection)                 Y, shape (n, K)
    observation_from_states(model, states, torque, selection)

A study that perturbs the positions (CESTAC) calls `select_rows` and `decimated_torque` once, on the measured record, and repeats
`observed_states` and `observation_from_states` with perturbed positions: Y and the choice of rows stay those of the record, so that a row is
never kept or dropped because of noise.

Records that are read by blocks give the same Observation while W stays below HELD bytes. Beyond, its rows are reduced to triangular factors of
segments of time (`runtime.observation.segments`), from which estimators that need no single row read what they need.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel, check_states
from runtime.observation.by_blocks import BlockTask, Layout, instants_of, piece_rows, row_counts
from runtime.observation.filters import States, decimated, filtered_states, median_filtered
from runtime.observation.pieces import Piece, pieces
from runtime.observation.regressor_signals import decimated_columns
from runtime.observation.rows import Selection, nothing_left, select_rows
from runtime.observation.segments import HeldRows, SegmentFactors, Window
from runtime.observation.states import certain_rows, observed_states
from runtime.observation.system import (
    HELD,
    Observation,
    Reduced,
    all_files,
    column_numbers,
    default_block,
    halves,
    rows_reduced,
    same_settings,
    stack,
)
from runtime.parallel import Workers, in_order, started
from runtime.records.record import Record
from runtime.records.stream import RecordStream, Stream
from runtime.settings.study import Rows, Signals, Study, to_mapping

Array = np.ndarray

__all__ = [
    "Observation",
    "Selection",
    "decimated_torque",
    "filtered_states",
    "observation_from_states",
    "observe",
    "observed_states",
    "select_rows",
    "stack",
    "with_torques",
]


def observe(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream],
    study: Study | None = None,
    *,
    keep: Array | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
    windows: Sequence[Window] | None = None,
    needed_by: str = "",
    workers: int | Workers = 1,
) -> Observation:
    """Y = W X + rho of one record, or of several stacked: filtered, differentiated, decimated, rows left out.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Stream, or a sequence of them
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
        Windows that `Observation.between` will be asked for where rows are reduced; default: study.validate.split, or the two halves.
    needed_by : str, optional
        What needs the rows themselves, such as a method of estimation.
    workers : int or Workers, optional
        Processes, this one among them, that observe the pieces of long records read by blocks. The results do not depend on it in any bit.

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
    if not several or (keep is not None and (len(several) > 1 or not isinstance(several[0], Record))):
        raise InputError("no record to observe" if not several else "keep goes with one record in memory")
    blocks = [record.block for record in several if not isinstance(record, Record)]
    if blocks:
        streams = [RecordStream(record, blocks[0]) if isinstance(record, Record) else record for record in several]
        with started(workers) as processes:
            observation = _observed_by_blocks(model, streams, study, constants or {}, windows, needed_by, processes)
        return observation if columns is None else observation.columns(columns)
    parts = []
    for record in several:
        assert isinstance(record, Record)
        states = observed_states(model, record.q, record.rate, study.signals, missing=record.missing, name=record.name)
        selection = select_rows(record, states.qd, study.signals, study.rows, keep=keep)
        torque = decimated_torque(record.tau, selection)
        parts.append(observation_from_states(model, states, torque, selection, files=record.files, columns=columns, constants=constants))
    return parts[0] if len(parts) == 1 else stack(parts)


def decimated_torque(tau: Array, selection: Selection) -> Array:
    """Y before rows are left out, shape (n, K), of measured joint torques tau, shape (N, n): median filter, window, decimation."""
    windowed = median_filtered(tau, selection.signals.median)[selection.samples]
    return decimated(np.ascontiguousarray(windowed.T), selection.factor, selection.signals.decimate)


def observation_from_states(
    model: GeneratedModel,
    states: States,
    torque: Array,
    selection: Selection,
    *,
    files: Mapping[str, str] | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Observation:
    """W of the given states, shape (N, n) each, beside Y = torque, shape (n, K), as decimated before.

    Where errors of the velocities are known, rows in which missing positions leave the state unknown ("missing") or the direction of dry friction is
    uncertain ("direction") are left out as well.
    columns : names of the columns wanted; the others are neither filtered nor stored. Default: all.
    """
    check_states(model, states.q, states.qd, states.qdd)
    n, K = selection.mask.shape
    if torque.shape != (n, K) or len(model.JOINTS) != n:
        raise InputError(f"torque {torque.shape}, model {model.NAME} with {len(model.JOINTS)} joints; expected {(n, K)} and {n} joints")
    names = tuple(model.BASE_PARAMETERS) if columns is None else tuple(columns)
    numbers = column_numbers(names, model.BASE_PARAMETERS)
    window = states[selection.samples]
    store = decimated_columns(model, window, selection.factor, selection.signals.decimate, constants or {}, numbers)
    selection = certain(model, states, selection, constants)
    mask = selection.mask.ravel()
    if not mask.any():
        raise InputError(nothing_left(selection.dropped, K), file=", ".join(files or ()) or None)
    return Observation(
        W=np.compress(mask, store.reshape(len(names), n * K), axis=1).T,
        Y=torque.ravel()[mask],
        rows=tuple(int(k) for k in selection.mask.sum(axis=1)),
        names=names,
        t=np.tile(selection.t, n)[mask],
        record=np.zeros(int(mask.sum()), dtype=int),
        rate=selection.rate,
        dropped=selection.dropped,
        settings=_settings(selection.signals, selection.rows, selection.factor),
        files=dict(files or {}),
        findings=states.findings,
    )


def certain(model: GeneratedModel, states: States, selection: Selection, constants: Mapping[str, float] | None = None) -> Selection:
    """The selection without rows in which missing positions leave the state unknown ("missing") or the direction of dry friction is uncertain
    ("direction"); the same where errors of the velocities are not known."""
    if states.errors is None:
        return selection
    known = selection.mask & states.errors[selection.samples][selection.kept].known
    mask = known & certain_rows(model, states[selection.samples][selection.kept], constants)
    dropped = dict(selection.dropped)
    for reason, before, after in (("missing", selection.mask, known), ("direction", known, mask)):
        left_out = before.sum(axis=1) - after.sum(axis=1) + np.array(dropped.get(reason, 0))
        dropped[reason] = tuple(left_out.tolist())
    return replace(selection, mask=mask, dropped=dropped)


def with_torques(observation: Observation, records: Sequence[Record], torques: Sequence[Array], study: Study) -> Observation:
    """The same rows of W beside other torques, shape (N, n), of the records observed."""
    Y, every = np.empty_like(observation.Y), replace(study.rows, trim=0, low_speed=0.0)
    for number, (record, tau) in enumerate(zip(records, torques, strict=True)):
        selection = select_rows(record, record.q, study.signals, every)
        own = observation.record == number
        Y[own] = decimated_torque(tau, selection)[observation.joints[own], np.searchsorted(selection.t, observation.t[own])]
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

    A record is read once; twice where rows are left out by speed, since their number is needed first.
    """
    records = [(k, stream, instants_of(stream, study)) for k, stream in enumerate(streams)]
    every = [piece for k, stream, whole in records for piece in pieces(k, stream, study.signals, whole)]
    task = BlockTask(model, tuple(streams), study, constants).with_starts(every)
    asked = every if task.filters_choose else [Piece(k, 0, len(stream), whole, ()) for k, stream, whole in records]
    counted = list(zip(asked, in_order(row_counts, task, asked, workers), strict=True))
    layouts = [
        Layout.of(stream, study, whole, [part for piece, part in counted if piece.record == k], task.skimmed.get(k))
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
    for piece, (blocks, own) in zip(every, in_order(piece_rows, wanted, every, workers), strict=True):
        for block in blocks:
            kept.take(piece.record, *block)
        if own is not None:
            factors[piece.record].join(own)
    settings = same_settings([_settings(study.signals, study.rows, whole.factor) for *_, whole in records])
    observation = Observation(
        W=kept.transposed.T,
        Y=kept.Y,
        rows=kept.rows,
        names=names,
        t=kept.t,
        record=kept.record,
        rate=rate,
        dropped={reason: tuple(np.sum([at.dropped[reason] for at in layouts], axis=0).tolist()) for reason in layouts[0].dropped},
        settings={**settings, "stream": {"block": max(stream.block for stream in streams)}},
        files=all_files([stream.files for stream in streams]),
        findings=tuple(dict.fromkeys(text for at in layouts for text in at.findings)),
    )
    if held:
        return observation
    no_rows = np.empty(0)
    segments = tuple(segment for of_record in factors for segment in of_record.finish())
    reduced = Reduced(segments, cuts, span, length, observation)
    return replace(observation, W=np.empty((0, len(names))), Y=no_rows, t=no_rows, record=no_rows.astype(int), rows=rows, reduced=reduced)


def _settings(signals: Signals, rows: Rows, factor: int) -> dict[str, Any]:
    return {"signals": to_mapping(signals), "rows": to_mapping(rows), "factor": factor}
