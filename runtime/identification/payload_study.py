"""The load of a study: its parameters, and the torque constants of the drives that carry it
(`runtime.identification.payload`, `runtime.identification.drive_gains`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import SettingsError
from runtime.estimators.method import linear_companion
from runtime.identification.drive_gains import DriveGains, drive_gains, scaled
from runtime.identification.payload import Payload, payload
from runtime.json_documents import Result
from runtime.model.generated import GeneratedModel, require_no_channels
from runtime.records.reading import read_records
from runtime.records.record import Record
from runtime.rows.prepared import Prepared, prepared, resolved
from runtime.settings.study import Study
from runtime.table import in_lines, with_intervals

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class PayloadStudy(Result, keys="payload drive_gains:gains"):
    """A load.

    Attributes
    ----------
    payload : Payload
        From the records without and with the load, fitted together.
    gains : DriveGains or None
        Torque constants of the drives; None where study.payload.gains does not ask for them.
    """

    payload: Payload
    gains: DriveGains | None

    def brief(self) -> str:
        """Load and torque constants with their 95 % intervals, four in a line."""
        load, gains = self.payload, self.gains
        given = [f"{name} {value:.4g} (given)" for name, value in load.given.items()]
        estimated = with_intervals(load.names, load.value, load.sigma)
        lines = [f"The load on {load.place}, SI, +- 95 %", *in_lines([*given, *estimated])]
        if gains is not None:
            value, sigma = (gains.constant * x for x in (gains.together, gains.sigma))
            values = with_intervals([f"motor {joint}" for joint in gains.joints], value, sigma)
            known = [x for j, x in zip(gains.joints, values, strict=True) if j not in gains.refused]
            lines += ["Torque constants, SI, +- 95 %", *in_lines(known), gains.text]
        return "\n".join(lines)

    def to_table(self) -> str:
        """The tables one below the other."""
        gains = [] if self.gains is None else [self.gains.to_table(), self.gains.text]
        return "\n\n".join([self.payload.to_table(), *gains])


def payload_study(
    model: GeneratedModel,
    without: Sequence[Record | Prepared],
    study: Study,
    *,
    loaded: Sequence[Record | Prepared] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> PayloadStudy:
    """The load of study.payload, by ols, or by wls where the study has weights.

    Parameters
    ----------
    without : sequence of Record or Prepared
        Joint side, without the load.
    loaded : sequence of Record or Prepared, optional
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
        raise SettingsError(
            "no record with the load; name it in payload.record", path=("payload", "record")
        )
    method = linear_companion(study.estimate)
    if method.columns != "all":
        raise SettingsError(
            "a load needs all base parameters; remove estimate.columns",
            path=("estimate", "columns"),
        )
    require_no_channels(model, "the study of a load")
    study, _ = resolved(study, [*without, *loaded])
    without, loaded = (
        [prepared(model, record, study) for record in records] for records in (without, loaded)
    )
    gains = drive_gains(model, without, loaded, study, settings) if settings.gains else None
    empty, full = (
        [own.observation(model) if gains is None else scaled(model, own, gains) for own in records]
        for records in (without, loaded)
    )
    joint = payload(model, empty, full, settings, method, provenance=provenance)
    if gains is not None:
        joint = replace(joint, sigma=np.fmax(joint.sigma, gains.sigma_load))
    return PayloadStudy(joint, gains)
