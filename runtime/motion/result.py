"""What a closed-loop simulation gives: exact states, what a record of it would hold, sensitivities to the parameters."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from runtime.errors import InputError
from runtime.records.record import Record

Array = np.ndarray


class SimulationError(InputError):
    """A run that cannot be made: inertia not positive definite, loop unstable, motion lost. `time` : s, where it was seen."""

    def __init__(self, message: str, *, time: float) -> None:
        self.time = time
        super().__init__(message)


@dataclass(frozen=True, eq=False)
class Simulation:
    """A run, at the recorded ticks; arrays of shape (N, n), joint side, SI.

    q, qd, qdd, tau : exact states, and the torque on the arm without the disturbance.   q_measured, tau_measured : what a record would hold.
    saturated : share of ticks with the torque at its limit, per joint.   state : last state of the loop, for a run that goes on.
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
    name: str = "simulation"

    def record(self) -> Record:
        """What was measured, with its reference."""
        return Record(self.t, self.q_measured, self.tau_measured, self.rate, self.name, {}, self.q_r)

    def to_csv(self) -> str:
        """t, q1 ..., tau1 ..., qr1 ...: the measured columns, SI, joint side, as `identify` reads them."""
        n = self.q.shape[1]
        names = ["t", *(f"{x}{j}" for x in ("q", "tau", "qr") for j in range(1, n + 1))]
        rows = np.column_stack([self.t, self.q_measured, self.tau_measured, self.q_r])
        return "\n".join([",".join(names), *(",".join(f"{x:.10g}" for x in row) for row in rows), ""])


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives by the base parameters X at the recorded ticks, shape (N, n, b): of the position q, of its rate, and of the torque.

    The loop is closed: gains, reference and g do not move. The instants at which slips stop move with X.
    """

    q: Array
    qd: Array
    tau: Array
