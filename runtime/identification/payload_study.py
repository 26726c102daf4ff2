"""What a study says about a load: its parameters jointly and as a difference, and the torque constants it weighs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.errors import SettingsError
from runtime.estimators import estimate, linear_companion
from runtime.identification.drive_gains import DriveGains, drive_gains
from runtime.identification.payload import Payload, payload, payload_difference
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import observe, stack
from runtime.records.record import Record
from runtime.settings.study import Study


@dataclass(frozen=True, eq=False)
class Loads:
    """payload : joint solution.   difference : from two estimates, None where either record alone does not determine the robot."""

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


def loads(
    model: GeneratedModel, study: Study, without: Sequence[Record], loaded: Sequence[Record], *, provenance: Mapping[str, Any] | None = None
) -> Loads:
    """The load of study.payload from records without and with it, joint side; by ols, or wls where the study has weights."""
    settings = study.payload
    if settings is None or not loaded:
        raise SettingsError("no record with the load; name it in payload.record", path=("payload", "record"))
    method = linear_companion(study.estimate)
    if method.columns != "all":
        raise SettingsError("a load needs all base parameters; remove estimate.columns", path=("estimate", "columns"))
    empty, full = ([observe(model, record, study) for record in records] for records in (without, loaded))
    joint = payload(model, empty, full, settings, method, provenance=provenance)
    a, b = (estimate(stack(seen), method, model=model) for seen in (empty, full))
    apart = payload_difference(model, a, b, settings) if a.status == b.status == "ok" else None
    gains = drive_gains(model, without, loaded, study, settings) if settings.gains else None
    return Loads(joint, apart, gains)
