"""What a study of encoders is told of the encoder that made a record, and of a closed loop that is simulated anew: features give both."""

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
from runtime.core.rows.selection import Selection
from runtime.core.study import EstimateSettings, Study

Array = np.ndarray


class RecordEncoder(Protocol):
    """Encoder that measured one record.

    step : ndarray, shape (n,), rad or m.   read : whether its counts have been read.
    """

    @property
    def step(self) -> Array: ...

    @property
    def read(self) -> bool: ...

    def positions(self, q: Array, delta: float, rng: np.random.Generator) -> Array:
        """Joint positions, shape (N, n), from which a coarser encoder of step delta can be simulated."""


class LoopRecord(Protocol):
    """Rows of one record of a simulated loop.

    torque : ndarray, shape (n, K), before the selection of rows.
    """

    @property
    def prepared(self) -> Prepared: ...

    @property
    def selection(self) -> Selection: ...

    @property
    def torque(self) -> Array: ...


class Loop(Protocol):
    """Closed loop that a study simulates again in each run.

    estimate : settings of the estimate without those of the loop.   described : description for JSON.   notes : sentences for the user.
    """

    @property
    def parts(self) -> Sequence[LoopRecord]: ...

    @property
    def estimate(self) -> EstimateSettings: ...

    @property
    def described(self) -> Mapping[str, Any]: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    def measured(self) -> Observation:
        """Rows of the measured records."""

    def perturbed(self, observation: Observation, positions: Sequence[Array]) -> Observation:
        """`observation` from the perturbed positions of every record, with this loop attached."""

    def rows(self, level: Level, draw: tuple[int, ...]) -> Observation:
        """Rows of a record that is simulated with encoder steps of level.delta."""


class Checkpoint(Protocol):
    """Store for the runs of a study that may be interrupted."""

    def resume(self, identity: Mapping[str, Any], b: int) -> Runs:
        """Runs, with b parameters each, that an interrupted study with the same identity has stored."""

    def add(self, runs: Runs) -> None:
        """Add new runs."""

    def flush(self) -> None:
        """Write all added runs."""


EncoderOf: TypeAlias = Callable[[Record, Study, Drives | None], RecordEncoder | None]
LoopOf: TypeAlias = Callable[[Problem], Loop | None]
