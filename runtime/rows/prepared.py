"""One record as a study reads it: filtered, selected and decimated once, for whoever asks.

    own = prepared(model, record, study)
    own.states                                q, qd, qdd, by the reader of the study
    own.selection                             window, decimated instants, rows left out
    own.torque                                Y before rows are left out, shape (n, K)
    own.observation(model)                    Y = W X + rho

A study that perturbs the positions (CESTAC) takes `selection` and `torque` of the measured record
and repeats `observed_states` and `observation_from_states` with perturbed positions: Y and the
choice of rows stay those of the record, so that a row is never kept or dropped because of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from runtime.errors import InputError
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, check_states, drives_of
from runtime.records.missing import COUNTS, require_positions
from runtime.records.record import JOINT_CHANNELS, Record
from runtime.rows.observation import Observation
from runtime.rows.regressor import Columns
from runtime.rows.selection import (
    Selection,
    certain_rows,
    nothing_left,
    select_rows,
    window_of,
)
from runtime.settings.study import Study
from runtime.signals.cutoff import EXCERPT, cutoff
from runtime.signals.decimation import decimate
from runtime.signals.filters import States, filtered_states, median_filtered
from runtime.signals.recorded_speed import crossings
from runtime.signals.states import observed_states
from runtime.signals.torque_median import taken

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Prepared:
    """A record, and what the settings of a study make of it; each is made when first asked for.

    Attributes
    ----------
    record : Record
        Joint side, SI.
    study : Study
        Signals and rows.
    drives : Drives or None
        Motor side: those by which the record was read, or those of the robot.
    keep : ndarray of bool, shape (N,) or (N, n), or None
        Samples (and joints) that may be used; None: all.
    """

    record: Record
    study: Study
    drives: Drives | None = None
    keep: Array | None = None

    @cached_property
    def filtered(self) -> States:
        """q, qd, qdd of the positions as they are, shape (N, n) each; straight lines over gaps."""
        record, v = self.record, self.record.channels.get("qd")
        states = filtered_states(record.q, record.rate, self.study.signals, v)
        return replace(states, channels=self.channels)

    @cached_property
    def states(self) -> States:
        """q, qd, qdd by the reader of the study, shape (N, n) each."""
        record, signals = self.record, self.study.signals
        if signals.reader == "lowpass":
            require_positions(record.missing, "reader: lowpass", record.name, COUNTS)
            return self.filtered
        states = observed_states(
            record.q,
            record.rate,
            signals,
            self.drives,
            missing=record.missing,
            name=record.name,
        )
        return replace(states, channels=self.channels)

    @property
    def channels(self) -> dict[str, Array]:
        """Channels of one column that are no joint's, shape (N,)."""
        given = self.record.channels.items()
        return {c: x[:, 0] for c, x in given if c not in JOINT_CHANNELS and x.shape[1] == 1}

    @cached_property
    def selection(self) -> Selection:
        """Window, decimated instants, and the rows left out by trim, low speed and `keep`."""
        signals, rows = self.study.signals, self.study.rows
        return select_rows(self.record, self.states.qd, signals, rows, keep=self.keep)

    @cached_property
    def torque(self) -> Array:
        """Y before rows are left out, shape (n, K), N m or N."""
        return decimated_torque(self.record.torque, self.selection)

    def certain(
        self, model: GeneratedModel, constants: Mapping[str, float] | None = None
    ) -> Selection:
        """The selection without rows of unknown state or of uncertain direction of friction."""
        return certain(model, self.states, self.selection, constants)

    def observation(
        self,
        model: GeneratedModel,
        columns: Sequence[str] | None = None,
        constants: Mapping[str, float] | None = None,
    ) -> Observation:
        """Y = W X + rho of the rows that are used."""
        return observation_from_states(
            model,
            self.states,
            self.torque,
            self.selection,
            files=self.record.files,
            columns=columns,
            constants=constants,
        )

    def by(self, study: Study) -> Prepared:
        """The same record by another study; what both make alike is shared."""
        other = replace(self, study=study)
        if study.signals != self.study.signals:
            return other
        if study.rows == self.study.rows:
            return self
        shared = ("states", "filtered") if study.signals.reader == "lowpass" else ("states",)
        vars(other).update({name: getattr(self, name) for name in shared})
        return other

    def __getstate__(self) -> dict[str, Any]:
        """For other processes: nothing of what was made."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


Source: TypeAlias = Record | Prepared


def prepared(model: GeneratedModel, record: Source, study: Study) -> Prepared:
    """The record as `study` reads it; one that was prepared shares what was made of it."""
    study, _ = resolved(study, [record])
    if isinstance(record, Prepared):
        return record.by(study)
    return Prepared(record, study, record.origin.drives or drives_of(model))


def resolved(study: Study, records: Sequence[Source]) -> tuple[Study, str]:
    """The study with numbers for signals.lowpass.cutoff: auto, for signals.torque_median: auto
    where it is none and, where velocities were recorded, for signals.velocity: auto, one for all
    records, and what they became and why, in words; empty where nothing changes.

    The first EXCERPT samples in the window of the study are looked at, of every record.
    """
    signals, low = study.signals, study.signals.lowpass
    automatic = low is not None and low.cutoff == "auto"
    recorded = signals.velocity == "auto" and signals.reader == "lowpass"
    recorded = recorded and all("qd" in record_of(record).measured for record in records)
    torques = signals.torque_median == "auto" and signals.median > 1
    if not automatic and not torques and not (recorded and records):
        return study, ""
    parts, shares = [], []
    for record in map(record_of, records):
        start, stop = window_of(record.t, study.rows.window, record.name)
        part = slice(start, min(stop, start + EXCERPT))
        q, tau = record.q[part], record.tau[part]
        channels = {key: x[part] for key, x in record.channels.items()}
        parts.append((q, channels, record.rate))
        shares += [taken(tau, q, record.rate, signals.median)] if torques else []
    positions, texts = [(q, rate) for q, _, rate in parts], []
    if np.max(shares, initial=0.0) > LIMIT.MEDIAN_TAKES:
        signals, worst = replace(signals, torque_median=1), np.max(shares, axis=0)
        texts.append(
            "Torques without a median (torque_median: auto): it would take "
            f"{100 * worst.max():.2g} % of the torque of joint {1 + worst.argmax()} in time with "
            "the motion, as from a controller that answers every count of its encoder."
        )
    if recorded and records:
        first = cutoff(positions, signals)[0] if automatic else 0.0
        known = replace(signals, lowpass=replace(low, cutoff=first)) if low and first else signals
        crossing, why = crossings(parts, known)
        signals = replace(signals, velocity=crossing)
        texts.append(why)
    if low is not None and automatic:
        given = np.inf if isinstance(signals.velocity, str) else signals.velocity
        hertz, why = cutoff(positions, signals, given)
        signals = replace(signals, lowpass=replace(low, cutoff=hertz))
        texts.insert(0, f"Low-pass at {hertz:g} Hz (cutoff: auto): {why}.")
    return replace(study, signals=signals), " ".join(texts)


def common_drives(model: GeneratedModel, records: Sequence[Prepared]) -> Drives | None:
    """Drives of all records; InputError where these were read with different couplings. Without
    records those of the model.
    """
    coupled = {own.drives.coupling for own in records if own.drives is not None}
    if len(coupled) > 1:
        raise InputError(f"records read with coupling {', '.join(sorted(coupled))}; expected one")
    return records[0].drives if records else drives_of(model)


def record_of(record: Source) -> Record:
    """The record itself."""
    return record.record if isinstance(record, Prepared) else record


def decimated_torque(tau: Array, selection: Selection) -> Array:
    """Y before rows are left out, shape (n, K), of measured joint torques tau, shape (N, n): median
    filter, window, decimation.
    """
    tau = median_filtered(tau, selection.signals.window_of_torques)
    windowed = np.ascontiguousarray(tau[selection.samples].T)
    return windowed if selection.plan is None else decimate(windowed, selection.plan)


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
    """W of the given states, shape (N, n) each, beside Y = torque, shape (n, K), as decimated
    before.

    columns : names of the columns wanted; the others are neither filtered nor stored. Default: all.
    """
    wanted = Columns(model, columns, constants)
    return observation_of(wanted, states, torque, selection, files=files)


def observation_of(
    columns: Columns,
    states: States,
    torque: Array,
    selection: Selection,
    *,
    files: Mapping[str, str] | None = None,
) -> Observation:
    """The same by columns that many records share.

    Where errors of the velocities are known, rows in which missing positions leave the state
    unknown ("missing") or the direction of dry friction is uncertain ("direction") are left out as
    well.
    """
    model = columns.model
    check_states(model, q=states.q, qd=states.qd, qdd=states.qdd)
    n, K = selection.mask.shape
    if torque.shape != (n, K) or len(model.JOINTS) != n:
        raise InputError(
            f"torque {torque.shape}, model {model.NAME} with {len(model.JOINTS)} joints; expected "
            f"{(n, K)} and {n} joints"
        )
    window = states[selection.samples]
    used = np.flatnonzero(selection.mask.any(axis=0))
    inside = slice(used[0], used[-1] + 1)
    store = columns.decimated(window, selection.plan, inside)
    selection = certain(model, states, selection, columns.constants)
    if not selection.mask.any():
        left_out = nothing_left(selection.dropped, K)
        raise InputError(left_out, file=", ".join(files or ()) or None)
    mask = selection.mask[:, inside].ravel()
    rows = store.reshape(len(columns.names), len(mask))
    return Observation(
        W=(rows if mask.all() else np.compress(mask, rows, axis=1)).T,
        Y=torque[:, inside].ravel()[mask],
        rows=tuple(int(k) for k in selection.mask.sum(axis=1)),
        names=columns.names,
        t=np.tile(selection.t[inside], n)[mask],
        record=np.zeros(int(mask.sum()), dtype=int),
        rate=selection.rate,
        dropped=selection.dropped,
        settings=selection.settings,
        files=dict(files or {}),
        findings=states.findings,
    )


def certain(
    model: GeneratedModel,
    states: States,
    selection: Selection,
    constants: Mapping[str, float] | None = None,
) -> Selection:
    """The selection without rows in which missing positions leave the state unknown ("missing") or
    the direction of dry friction is uncertain
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
