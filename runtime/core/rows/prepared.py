"""One record with its filtered states, selected rows and decimated torques, each computed once.

    own = problem.prepared[0]
    own.states                                q, qd, qdd, by the reader of the study
    own.selection                             window, decimated instants, rows left out
    own.torque                                Y before rows are left out, shape (n, K)
    own.observation(model)                    Y = W X + rho

A study that perturbs the positions (CESTAC) uses `selection` and `torque` of the measured record
and repeats the filters and `observation_of` with perturbed positions. Y and the choice of rows stay
those of the record, so that noise never decides whether a row is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from runtime.core.drives import Drives
from runtime.core.model import GeneratedModel, check_states, drives_of
from runtime.core.record import JOINT_CHANNELS, Record
from runtime.core.rows.observation import Observation, stack
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import Selection, certain_rows, nothing_left, select_rows
from runtime.core.rows.streamed import WHOLE, Source, StreamedMatrix
from runtime.core.signals.base import base_motion
from runtime.core.signals.decimation import decimate
from runtime.core.signals.filters import States, median_filtered
from runtime.core.signals.reader import Reader
from runtime.core.study import Study
from runtime.ground.errors import InputError
from runtime.ground.memory import require_memory

Array = np.ndarray

COPIES = 2
"""Copies of W while rows are made and factored; 1.8 were measured without decimation."""
ROW = 150
"""Bytes of a row of a long record, whose W is not kept: Y, t, record and motion, and their sorting."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A record with its filtered states, torques Y and selected rows, each computed at first use.

    Attributes
    ----------
    record : Record
        Joint side, SI.
    study : Study
        Settings of signals and rows, with numbers in place of "auto".
    reader : Reader
        Computes the states of the record.
    selected : Selection or None
        Rows to use; None: the settings choose them.
    """

    record: Record
    study: Study
    reader: Reader
    selected: Selection | None = None

    @property
    def drives(self) -> Drives | None:
        """Drives (gear ratios, torque constants) of the robot, as used when the record was read.

        None: the drives of the model.
        """
        return self.record.origin.drives

    @cached_property
    def states(self) -> States:
        """Filtered joint states q, qd, qdd of the record, shape (N, n) each."""
        states = self.reader.states(self.record, self.study.signals)
        return replace(states, channels=self.channels)

    @property
    def channels(self) -> dict[str, Array]:
        """Recorded signals with one column, such as a temperature, by name, shape (N,) each.

        The filtered motion of a base that moves is included.
        """
        given = self.record.channels
        own = {c: x[:, 0] for c, x in given.items() if c not in JOINT_CHANNELS and x.shape[1] == 1}
        return own | base_motion(given, self.record.rate, self.study.signals)

    @cached_property
    def selection(self) -> Selection:
        """Used rows of the record: the given selection, or a choice by time, decimation and speed."""
        if self.selected is not None:
            return self.selected
        return select_rows(self.record, self.states.qd, self.study.signals, self.study.rows)

    @cached_property
    def torque(self) -> Array:
        """Decimated measured torques Y before the selection of rows, shape (n, K), N m or N."""
        return decimated_torque(self.record.torque, self.selection)

    def certain(self, model: GeneratedModel) -> Selection:
        """Return the used rows, without rows of unknown state or uncertain friction direction."""
        return certain(model, self.states, self.selection)

    def observation(
        self, model: GeneratedModel, columns: Sequence[str] | None = None, *, whole: bool = True
    ) -> Observation:
        """Build the system Y = W X + rho of the selected rows.

        whole : whether W is made now, or piece by piece when its rows are asked for.
        """
        return observation_of(
            Columns(model, columns),
            self.states,
            self.torque,
            self.selection,
            files=self.record.files,
            whole=whole,
        )

    def by(self, study: Study) -> Prepared:
        """Return the same record prepared with the settings of another study.

        States that were computed are reused if the signals are the same.
        """
        if study.signals == self.study.signals and study.rows == self.study.rows:
            return self
        other = replace(self, study=study)
        if study.signals == self.study.signals:
            other.take_states(self)
        return other

    def take_states(self, other: Prepared) -> None:
        """Copy the filtered states of another Prepared if positions and filters are the same."""
        same = self.record.q is other.record.q and self.record.missing is other.record.missing
        same &= self.record.channels.get("qd") is other.record.channels.get("qd")
        same &= self.reader == other.reader and self.study.signals == other.study.signals
        if same and "states" in vars(other):
            vars(self)["states"] = replace(other.states, channels=self.channels)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields that are sent to another process; computed results are left out."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def study_of_record(study: Study, record: Record) -> Study:
    """Return the study with the cut-off of the record, if the record has a cut-off of its own."""
    low, own = study.signals.lowpass, record.origin.cutoff
    if low is None or own is None:
        return study
    return replace(study, signals=replace(study.signals, lowpass=replace(low, cutoff=own)))


def common_drives(model: GeneratedModel, records: Sequence[Prepared]) -> Drives | None:
    """Return the drives that all records have, or the drives of the model if there is no record.

    Raise InputError if the records were read with different couplings.
    """
    coupled = {own.drives.coupling for own in records if own.drives is not None}
    if len(coupled) > 1:
        raise InputError(
            f"the records have different values of record.coupling, {', '.join(sorted(coupled))}; expected the same value"
        )
    return records[0].drives if records else drives_of(model)


def decimated_torque(tau: Array, selection: Selection) -> Array:
    """Filter and decimate joint torques tau, shape (N, n), to the rows of Y, shape (n, K).

    Median, window, decimation; rows are not yet selected.
    """
    tau = median_filtered(tau, selection.signals.torque_median)
    windowed = np.ascontiguousarray(tau[selection.samples].T)
    return windowed if selection.plan is None else decimate(windowed, selection.plan)


def observation_of(
    columns: Columns,
    states: States,
    torque: Array,
    selection: Selection,
    *,
    files: Mapping[str, str] | None = None,
    whole: bool = True,
) -> Observation:
    """Build the system Y = W X + rho of one record; `columns` computes the observation matrix W.

    If errors of the velocities are known, two more kinds of rows are left out: rows in which
    missing positions leave the state unknown ("missing"), and rows in which the direction of dry
    friction is uncertain ("direction"). whole : as for `Prepared.observation`.
    """
    model = columns.model
    check_states(model, q=states.q, qd=states.qd, qdd=states.qdd)
    n, K = selection.mask.shape
    if torque.shape != (n, K) or len(model.JOINTS) != n:
        raise InputError(
            f"torque has shape {torque.shape}, and {model.NAME} has {len(model.JOINTS)} joints; "
            f"expected {(n, K)} and {n} joints"
        )
    window = states[selection.samples]
    instants = np.flatnonzero(selection.mask.any(axis=0))
    inside = slice(instants[0], instants[-1] + 1)
    made = (columns.decimated if whole else columns.read)(window, selection.plan, inside)
    selection = certain(model, states, selection)
    if not selection.mask.any():
        left_out = nothing_left(selection.dropped, K)
        raise InputError(left_out, file=", ".join(files or ()) or None)
    used = selection.mask[:, inside]
    mask = used.ravel()
    if isinstance(made, np.ndarray):
        rows = made.reshape(len(columns.names), len(mask))
        W = (rows if mask.all() else np.compress(mask, rows, axis=1)).T
    else:
        source = Source(columns.entries, made, used)
        W = cast("Array", StreamedMatrix((source,), np.arange(len(columns.names))))
    return Observation(
        W=W,
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
        motion=np.stack(
            [x[selection.kept][inside].T.ravel()[mask] for x in (window.q, window.qd)], 1
        ),
    )


def certain(
    model: GeneratedModel,
    states: States,
    selection: Selection,
) -> Selection:
    """Remove rows of unknown state, or of uncertain friction direction, from a selection of rows.

    A row removed because of missing positions is counted as "missing"; a row near zero speed, as
    "direction". Without known errors of the velocities, the selection does not change.
    """
    if states.errors is None:
        return selection
    known = selection.mask & states.errors[selection.samples][selection.kept].known
    mask = known & certain_rows(model, states[selection.samples][selection.kept])
    dropped = dict(selection.dropped)
    for reason, before, after in (("missing", selection.mask, known), ("direction", known, mask)):
        left_out = before.sum(axis=1) - after.sum(axis=1) + np.array(dropped.get(reason, 0))
        dropped[reason] = tuple(left_out.tolist())
    return replace(selection, mask=mask, dropped=dropped)


def stacked(
    model: GeneratedModel, records: Sequence[Prepared], columns: Sequence[str] | None = None
) -> Observation:
    """Build one system Y = W X + rho from the rows of several records.

    columns : names of the columns; default: all.

    W of long records, of more than WHOLE bytes, is made piece by piece when its rows are asked for.

    Raise InputError if there is no record, or if the rows are larger than the memory.
    """
    if not records:
        raise InputError("no record is given; expected at least one")
    b = len(model.BASE_PARAMETERS if columns is None else columns)
    rows = sum(int(record.selection.mask.sum()) for record in records)
    whole = 8.0 * rows * b <= WHOLE
    require_memory(
        8.0 * COPIES * rows * b if whole else float(ROW * rows),
        f"{rows:,} rows of {b} columns",
        "decimate (signals.decimate), use a piece of the record (rows.window), or a robot of fewer "
        "columns (symgen convert --lock)",
    )
    return stack([record.observation(model, columns, whole=whole) for record in records])


def with_torques(
    observation: Observation, records: Sequence[Prepared], torques: Sequence[Array]
) -> Observation:
    """Replace Y in a system Y = W X + rho by other joint torques of the same records.

    The torques have the shape (N, n), one array for each record.
    """
    Y = np.empty_like(observation.Y)
    for number, (own, tau) in enumerate(zip(records, torques, strict=True)):
        rows = observation.record == number
        Y[rows] = decimated_torque(tau, own.selection)[
            observation.joints[rows], np.searchsorted(own.selection.t, observation.t[rows])
        ]
    return replace(observation, Y=Y)
