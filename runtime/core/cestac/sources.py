"""Interfaces of the objects that a study of encoders gets from other packages.

The objects are the encoder that measured a record, a closed loop that is simulated again in each
run, and a store of runs on disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np

from runtime.core.cestac.runs import Level, Runs
from runtime.core.drives import Drives
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared
from runtime.core.study import EstimateSettings, Study

Array = np.ndarray


class RecordEncoder(Protocol):
    """Encoder that measured one record: its step, and positions that agree with its counts.

    step : ndarray, shape (n,), rad or m.   read : whether the counts of the record have been read.
    """

    @property
    def step(self) -> Array: ...

    @property
    def read(self) -> bool: ...

    def positions(self, q: Array, delta: float, rng: np.random.Generator) -> Array:
        """Return the joint positions, shape (N, n), before they are rounded to steps of `delta`.

        They are the measured q, or a random motion that agrees with the recorded counts.
        """


class Loop(Protocol):
    """Control loop of robot and controller that a study of encoders simulates again in each run.

    in_loop : whether the encoder of the study is the one in the loop: each run is a record of its
        own, simulated with this encoder. Otherwise the positions of the records are rounded.
    estimate : settings of the estimate without those of the loop.
    described : description for JSON.   notes : sentences for the user.
    """

    @property
    def in_loop(self) -> bool: ...

    @property
    def records(self) -> Sequence[Prepared]: ...

    @property
    def estimate(self) -> EstimateSettings: ...

    @property
    def described(self) -> Mapping[str, Any]: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    def measured(self) -> Observation:
        """Build the system Y = W X + rho of the measured records of the control loop."""

    def perturbed(self, observation: Observation, positions: Sequence[Array]) -> Observation:
        """Return `observation` with this control loop, whose records have the rounded positions."""

    def rows(self, level: Level, draw: tuple[int, ...]) -> Observation:
        """Simulate the loop with encoder steps level.delta, and build its system Y = W X + rho."""


class Checkpoint(Protocol):
    """Store on disk for the runs of a study, so that an interrupted study can continue."""

    def resume(self, identity: Mapping[str, Any], b: int) -> Runs:
        """Return the runs that an earlier study with the same identity stored on disk."""

    def add(self, runs: Runs) -> None:
        """Add new runs of a study to the store on disk."""

    def flush(self) -> None:
        """Write all added runs to disk."""


EncoderOf: TypeAlias = Callable[[Record, Study, Drives | None], RecordEncoder | None]
LoopOf: TypeAlias = Callable[[Problem], Loop | None]
