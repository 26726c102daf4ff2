"""Result of a closed-loop simulation: exact states, and the signals that a record would hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from runtime.core.model import GeneratedModel, joint_labels, joint_units
from runtime.core.record import Origin, Record
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.ground.table import Table

LIMIT = limits(__package__)

Array = np.ndarray

TORQUE = {"rad": "N m", "m": "N"}  # unit of the torque by that of the position


class SimulationError(InputError):
    """Error of a simulation: inertia not positive definite, loop unstable, reference not followed.

    `time` : time of the reference at which the error appears, s.
    """

    def __init__(self, message: str, *, time: float) -> None:
        self.time = time
        super().__init__(message)


@dataclass(frozen=True, eq=False)
class Simulation(Result):
    """Signals of one closed-loop simulation at N recorded samples, on the joint side, in SI units.
    Arrays without a given shape have the shape (N, n).

    Attributes
    ----------
    t : ndarray, shape (N,), s
    q, qd, qdd, tau : ndarray
        Exact states, and the torque on the arm without the disturbance.
    q_measured, tau_measured : ndarray
        Positions and torques that a record would hold.
    q_r : ndarray
        Reference positions.
    rate : float, Hz
        Rate of the recorded ticks.
    saturated : ndarray, shape (n,)
        Share of ticks with the torque at its limit.
    substeps : int
        Integration steps per tick.
    state : ndarray, shape (6n,)
        Last state of the loop.
    model : GeneratedModel
    X : ndarray, shape (b,)
        Base parameters.
    ideal : bool
        Whether the run had no noise and no steps of encoder and converter.
    name : str
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    q_measured: Array
    tau_measured: Array
    q_r: Array
    rate: float
    saturated: Array
    substeps: int
    state: Array = field(repr=False)
    model: GeneratedModel = field(repr=False)
    X: Array = field(repr=False)
    ideal: bool = False
    name: str = "simulation"

    def record(self) -> Record:
        """Make a record of the simulated measurements, with its reference."""
        return Record(
            self.t,
            self.q_measured,
            self.tau_measured,
            rate=self.rate,
            name=self.name,
            origin=Origin(simulated=True),
            q_r=self.q_r,
        )

    def to_csv(self) -> str:
        """Write the simulated measurements as CSV text, which `identify` reads.

        The columns are t, q1 ..., tau1 ..., qr1 ..., on the joint side, in SI units.
        """
        return csv_text(self.t, q=self.q_measured, tau=self.tau_measured, qr=self.q_r)

    @property
    def units(self) -> tuple[tuple[str, str], ...]:
        """Units of position and torque of each joint, for instance ("rad", "N m")."""
        return tuple((unit, TORQUE[unit]) for unit in joint_units(self.model))

    @property
    def at_rest(self) -> Array:
        """Share of the recorded samples at which each joint is at rest, shape (n,)."""
        return np.asarray((np.abs(self.qd) <= LIMIT.SLIP_REST).mean(axis=0))

    def summary(self) -> dict[str, Any]:
        """Return tracking errors, torques and parameters as JSON values, for simulation.json."""
        error = self.q - self.q_r
        return {
            "robot": self.model.NAME,
            "source_sha256": self.model.SOURCE_SHA256,
            "note": "SIMULATED: nothing was measured",
            "ideal": self.ideal,
            "rate": self.rate,
            "samples": len(self.t),
            "substeps": self.substeps,
            "joints": list(self.model.JOINTS),
            "tracking_error": {
                "rms": _rms(error).tolist(),
                "max": np.abs(error).max(axis=0).tolist(),
            },
            "torque": {
                "rms": _rms(self.tau).tolist(),
                "max": np.abs(self.tau).max(axis=0).tolist(),
            },
            "saturated": self.saturated.tolist(),
            "at_rest": self.at_rest.tolist(),
            "parameters": dict(zip(self.model.BASE_PARAMETERS, self.X.tolist(), strict=True)),
        }

    def table(self) -> Table:
        """Make a table of the tracking error and the torque of each joint."""
        error, effort = self.q - self.q_r, np.abs(self.tau).max(axis=0)
        columns = (
            joint_labels(self.model),
            _rms(error),
            np.abs(error).max(axis=0),
            effort,
            self.saturated,
            self.at_rest,
            self.units,
        )
        rows = [
            (
                j,
                f"{rms:.3g}",
                f"{most:.3g}",
                f"{tau:.4g}",
                f"{100 * saturated:.2f} %",
                f"{100 * rest:.2f} %",
                ", ".join(units),
            )
            for j, rms, most, tau, saturated, rest, units in zip(*columns, strict=True)
        ]
        steps = f"{self.substeps} integration step{'s' * (self.substeps > 1)} per tick"
        caption = f"{len(self.t)} samples at {self.rate:g} Hz, {steps}; nothing was measured"
        return Table(
            caption,
            ("joint", "rms error", "max error", "max torque", "saturated", "at rest", "units"),
            rows,
            wide=(6,),
        )

    def to_table(self) -> str:
        """Write the tracking error and the torque of each joint as text."""
        table = self.table()
        return f"{table.caption}\n{table.to_text()}"


def csv_text(t: Array, **signals: Array) -> str:
    """Write signals as CSV text: the column t, then NAME1, NAME2 ... for each signal, shape (N, n).

    Numbers have ten digits.
    """
    names = ["t", *(f"{name}{j + 1}" for name, x in signals.items() for j in range(x.shape[1]))]
    rows = np.column_stack([t, *signals.values()])
    return "\n".join([",".join(names), *(",".join(f"{x:.10g}" for x in row) for row in rows), ""])


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt((x**2).mean(axis=0)))
