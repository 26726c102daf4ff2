"""What the coupling of the drives explains: the same records as if the drives were coupled in
position and torque, in one of them, or in none.

W depends on the positions alone: two observations serve all four, of which that of the coupling
used exists already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, overload

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.estimators.method import linear_companion
from runtime.loop.methods import CLOSED_LOOP, estimate_of, point_estimate
from runtime.model.drives import Coupling, Drives
from runtime.model.generated import GeneratedModel
from runtime.records.record import Record
from runtime.records.stream import ChangedStream, Stream
from runtime.rows.observation import Observation
from runtime.rows.observe import with_torques
from runtime.rows.prepared import Prepared, record_of
from runtime.settings.study import Study

Array = np.ndarray
Observed: TypeAlias = Callable[[Sequence[Record | Stream]], Observation]

COUPLINGS: tuple[Coupling, ...] = ("both", "position", "torque", "none")


def coupling_fits(
    model: GeneratedModel,
    records: Sequence[Prepared | Stream],
    study: Study,
    observation: Observation,
    fit: Estimate,
    observed: Observed,
) -> dict[Coupling, Estimate]:
    """Estimates of all parameters by the coupling used; empty unless all records are of the motor
    side of coupled drives.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : sequence of Prepared or Stream
        As they were read.
    study : Study
        Settings.
    observation : Observation
        Rows of the records as they are.
    fit : Estimate
        Of all parameters from these rows.
    observed : callable
        The rows of records that were read with another coupling.
    """
    read_with = [settings.coupling for settings in study.record]
    if len(records) != len(
        study.record
    ):  # a record that was split at gaps, or records from elsewhere
        read_with = [*set(read_with)] * len(records)
    if (
        model.DRIVES is None
        or any(settings.sides != ("motor", "motor") for settings in study.record)
        or len(read_with) != len(records)
    ):
        return {}
    drives = Drives.from_mapping(model.DRIVES)
    if not (drives.ratio - np.diag(np.diag(drives.ratio))).any():
        return {}
    simulated = study.estimate.method in CLOSED_LOOP
    method = linear_companion(study.estimate) if simulated else point_estimate(study.estimate)
    used = read_with[0] if len(set(read_with)) == 1 and not simulated else None
    rows = {} if used is None else {turned(used): observation}  # by whether positions are coupled
    whole = [record for record in records if isinstance(record, Prepared)]
    fits: dict[Coupling, Estimate] = {}
    for coupling in COUPLINGS:
        changes = [Change(drives.decoupled(own), drives.decoupled(coupling)) for own in read_with]
        if coupling == used:
            fits[coupling] = fit
            continue
        if turned(coupling) in rows and len(whole) == len(records):
            torques = [
                replace(own.record, tau=change.torque(own.record.tau)).torque
                for change, own in zip(changes, whole, strict=True)
            ]
            own_rows = with_torques(rows[turned(coupling)], whole, torques)
        else:
            own_rows = rows[turned(coupling)] = observed(
                [
                    recoupled(record_of(r), c.used, c.wanted)
                    for r, c in zip(records, changes, strict=True)
                ]
            )
        fits[coupling] = estimate_of(own_rows, method, model=model)
    return fits


def turned(coupling: Coupling) -> bool:
    """Whether positions are coupled."""
    return coupling in ("both", "position")


@dataclass(frozen=True, eq=False)
class Change:
    """From the joint side by the drives that a record was read with to the joint side by other
    drives.
    """

    used: Drives
    wanted: Drives

    def torque(self, tau: Array) -> Array:
        """Joint torques, shape (N, n), N m or N."""
        return self.wanted.joint_torque(self.used.motor_command(tau))

    def __call__(self, q: Array, tau: Array) -> tuple[Array, Array]:
        """Joint positions and torques, shape (N, n) each."""
        return self.wanted.joint_position(self.used.motor_position(q)), self.torque(tau)


@overload
def recoupled(record: Record, used: Drives, wanted: Drives) -> Record: ...
@overload
def recoupled(record: Record | Stream, used: Drives, wanted: Drives) -> Record | Stream: ...
def recoupled(record: Record | Stream, used: Drives, wanted: Drives) -> Record | Stream:
    """The record as the drives `wanted` would have turned its motor side into the joint side;
    `used` are those it was read with.
    """

    change = Change(used, wanted)
    if not isinstance(record, Record):
        return ChangedStream.of(record, change, wanted)
    q, tau = change(record.q, record.tau)
    return record.moved(q, tau=tau, origin=replace(record.origin, drives=wanted))
