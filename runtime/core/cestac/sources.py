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
    """The encoder of one record.

    step : ndarray, shape (n,), rad or m.   read : whether its counts have been read.
    """

    @property
    def step(self) -> Array: ...

    @property
    def read(self) -> bool: ...

    def positions(self, q: Array, delta: float, rng: np.random.Generator) -> Array:
        """Joint positions, shape (N, n), that an encoder of step delta may be judged on."""


class LoopRecord(Protocol):
    """Rows of one record of a simulated loop; torque, shape (n, K), before rows are left out."""

    @property
    def prepared(self) -> Prepared: ...

    @property
    def selection(self) -> Selection: ...

    @property
    def torque(self) -> Array: ...


class Loop(Protocol):
    """A closed loop that is simulated.

    estimate : settings of the estimate without what is the loop's.   described : for JSON.   notes : sentences for the reader of the study.
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
        """Rows of the records as measured."""

    def perturbed(self, observation: Observation, positions: Sequence[Array]) -> Observation:
        """`observation` of the perturbed positions of every record, with the loop attached."""

    def rows(self, level: Level, draw: tuple[int, ...]) -> Observation:
        """Rows of a record made with encoders of steps of level.delta."""


class Checkpoint(Protocol):
    """Where runs are kept while a study lasts."""

    def resume(self, identity: Mapping[str, Any], b: int) -> Runs:
        """The runs, b parameters each, that an earlier study of this identity left."""

    def add(self, runs: Runs) -> None:
        """Take new runs."""

    def flush(self) -> None:
        """Keep all that were taken."""


EncoderOf: TypeAlias = Callable[[Record, Study, Drives | None], RecordEncoder | None]
LoopOf: TypeAlias = Callable[[Problem], Loop | None]
