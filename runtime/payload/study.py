"""Analysis of a load: its inertial parameters, and the torque constants of the drives.

The computations are in `runtime.payload.load` and `runtime.payload.gains`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.model import (
    GeneratedModel,
    base_columns,
    elements_of,
    joint_torque_units,
    require_no_channels,
)
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared
from runtime.ground.documents import Result
from runtime.ground.errors import SettingsError
from runtime.ground.part import Part
from runtime.ground.table import Table, in_lines, with_intervals
from runtime.payload.body import Body
from runtime.payload.gains import DriveGains, drive_gains, scaled
from runtime.payload.load import Payload, payload
from runtime.payload.settings import LOADED


@dataclass(frozen=True, eq=False)
class PayloadStudy(Result, Part, keys="payload drive_gains:gains"):
    """Result of the analysis of a load: inertial parameters, and torque constants of drives.

    Attributes
    ----------
    payload : Payload
        Parameters from the records without and with the load, fitted together.
    gains : DriveGains or None
        Torque constants of the drives; None if study.payload.gains is false.
    """

    payload: Payload
    gains: DriveGains | None

    name = "payload"
    title = "Load"

    def text(self) -> str:
        """Return a text on how the load and the torque constants were estimated."""
        how = "Records with and without the load, fitted together."
        return how if self.gains is None else f"{how}\nTorque constants: {self.gains.text}."

    def tables(self) -> list[Table]:
        """Return the tables of the load, and the table of the torque constants if it exists."""
        gains = [] if self.gains is None else [self.gains.table()]
        body = self.payload.body
        return [*([] if body is None else [body.table()]), self.payload.table(), *gains]

    def entries(self) -> dict[str, Any]:
        """Return the entries of estimate.json: the load and the torque constants."""
        return self.summary()

    def brief(self) -> str:
        """Return the load and the torque constants, with 95 % confidence intervals, as text."""
        load, body, gains = self.payload, self.payload.body, self.gains
        lines = [] if body is None else _brief(body)
        given = [f"{name} {value:.4g} (given)" for name, value in load.given.items()]
        estimated = with_intervals(load.names, load.value, load.sigma)
        lines += [f"The load on {load.place}, SI, +- 95 %", *in_lines([*given, *estimated])]
        if gains is not None:
            value, sigma = (gains.constant * x for x in (gains.together, gains.sigma))
            values = with_intervals([f"motor {joint}" for joint in gains.joints], value, sigma)
            known = [x for j, x in zip(gains.joints, values, strict=True) if j not in gains.refused]
            lines += ["Torque constants, SI, +- 95 %", *in_lines(known), gains.text]
        return "\n".join(lines)


def _brief(body: Body) -> list[str]:
    """Write mass, centre and inertia of a load in lines, with 95 % confidence intervals."""

    def cells(of: str) -> list[str]:
        rows = [row for row in body.rows if row[0].startswith(of)]
        labels = [name.split()[-1] for name, *_ in rows]
        return with_intervals(labels, [x for _, x, *_ in rows], [s for _, _, s, _ in rows])

    mass, centre = " ".join(cells("mass")[0].split()), cells("centre")
    return [
        f"The load at {body.place.words}, +- 95 %: {mass} kg{', centre, m' * bool(centre)}",
        *in_lines(centre),
        *(
            ["Inertia about the centre, kg m^2", *in_lines(inertia)]
            if (inertia := cells("inertia"))
            else []
        ),
        *([body.missing] if body.missing else []),
    ]


def load_of_study(result: Identification) -> PayloadStudy | None:
    """Estimate the load that study.payload describes; None if the study has no load."""
    study: Any = result.study
    if study.payload is None:
        return None
    loaded = result.problem.noted(LOADED)
    return payload_study(result.problem, () if loaded is None else loaded.result)


def payload_study(problem: Problem, loaded: Sequence[Record]) -> PayloadStudy:
    """Estimate the load of settings.payload by linear least squares with the weights of the settings.

    Parameters
    ----------
    problem : Problem
        Problem with prepared records, all without the load.
    loaded : sequence of Record
        Records with the load, joint side, prepared by the same steps.

    Raises
    ------
    SettingsError
        No record with the load, inertial columns left out, or torques in A or V without gains.
    """
    study: Any = problem.settings
    model, settings = problem.model, study.payload
    if settings is None or not loaded:
        raise SettingsError(
            "no record with the load is given; name this record in payload.record",
            path=("payload", "record"),
        )
    kept = study.estimate.columns
    columns = base_columns(model, kept, (), "estimate", "columns")
    if lacking := [x for x in model.BASE_PARAMETERS if x not in {*columns, *elements_of(model)}]:
        raise SettingsError(
            f"a load needs all inertial base parameters, but {', '.join(lacking)} are left out; "
            "remove estimate.columns",
            path=("estimate", "columns"),
        )
    command = next((unit for unit in joint_torque_units(model) if unit[0] != "N"), "")
    if command and not settings.gains:
        raise SettingsError(
            f"a load in kg needs torques in N m, but the torques are in {command}; set "
            "record.torque_constant, or payload.gains: true with a weighed mass",
            path=("payload",),
        )
    require_no_channels(model, "the study of a load")
    problem.require_motion("a load")
    full = [problem.reading(record) for record in loaded]
    gains = None
    if settings.gains:
        gains = drive_gains(model, problem.prepared, full, settings)
    rows = [_rows(model, record, gains) for record in problem.prepared]
    loaded_rows = [_rows(model, record, gains) for record in full]
    load = payload(
        model,
        rows,
        loaded_rows,
        settings,
        problem.linear_system,
        columns=kept,
        provenance=problem.provenance,
    )
    if gains is not None:
        load = replace(load, sigma=np.fmax(load.sigma, gains.sigma_load))
    return PayloadStudy(load, gains)


def _rows(model: GeneratedModel, record: Prepared, gains: DriveGains | None) -> Observation:
    """Build the system Y = W X + rho of a record, with corrected torque constants, if these are
    estimated.
    """
    return record.observation(model) if gains is None else scaled(model, record, gains)
