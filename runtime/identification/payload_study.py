"""The load of a study: its parameters jointly and as a difference, and the torque constants of the drives that carry it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.errors import SettingsError
from runtime.estimators.methods import estimate_of, linear_companion
from runtime.identification.drive_gains import DriveGains, drive_gains
from runtime.identification.payload import Payload, payload, payload_difference
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import observe, stack
from runtime.records.reading import read_records
from runtime.records.record import Record
from runtime.settings.study import Study


@dataclass(frozen=True, eq=False)
class PayloadStudy:
    """A load, three ways.

    Attributes
    ----------
    payload : Payload
        From the records without and with the load, fitted together.
    difference : Payload or None
        From two estimates; None where either set of records alone does not determine the robot.
    gains : DriveGains or None
        Torque constants of the drives; None where study.payload.gains does not ask for them.
    """

    payload: Payload
    difference: Payload | None
    gains: DriveGains | None

    def __str__(self) -> str:
        return self.to_table()

    def to_table(self) -> str:
        """The tables one below the other."""
        parts = [self.payload.to_table()]
        if self.difference is not None:
            parts += ["the same from the difference of two estimates", self.difference.to_table()]
        if self.gains is not None:
            parts += [self.gains.to_table(), self.gains.text]
        return "\n\n".join(parts)

    def summary(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "payload": self.payload.summary(),
            "payload_difference": None if self.difference is None else self.difference.summary(),
            "drive_gains": None if self.gains is None else self.gains.summary(),
        }


def payload_study(
    model: GeneratedModel,
    without: Sequence[Record],
    study: Study,
    *,
    loaded: Sequence[Record] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> PayloadStudy:
    """The load of study.payload, by ols, or by wls where the study has weights.

    Parameters
    ----------
    without : sequence of Record
        Joint side, without the load.
    loaded : sequence of Record, optional
        Joint side, with the load; default: those of study.payload.record, read from their files.

    Raises
    ------
    SettingsError
        No record with the load, or columns left out.
    """
    settings = study.payload
    if settings is not None and loaded is None:
        loaded = read_records(settings.record, model, missing=study.signals.admits_missing)
    if settings is None or not loaded:
        raise SettingsError("no record with the load; name it in payload.record", path=("payload", "record"))
    method = linear_companion(study.estimate)
    if method.columns != "all":
        raise SettingsError("a load needs all base parameters; remove estimate.columns", path=("estimate", "columns"))
    empty, full = ([observe(model, record, study) for record in records] for records in (without, loaded))
    joint = payload(model, empty, full, settings, method, provenance=provenance)
    a, b = (estimate_of(stack(observations), method, model=model) for observations in (empty, full))
    difference = payload_difference(model, a, b, settings) if a.status == b.status == "ok" else None
    gains = drive_gains(model, without, loaded, study, settings) if settings.gains else None
    return PayloadStudy(joint, difference, gains)
