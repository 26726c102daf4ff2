"""The workspace of a compiled model: filters, signals and decimation of
`runtime.resolution.c.kernels` in place of NumPy's.

The same draws as with NumPy and the same estimates to rounding; the same bits for the same seed on
one kind of machine, whoever works. Only
perturbed positions go in and decimated signals come out; room is reused from run to run.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.errors import InputError
from runtime.estimators.solution import Solution, solve
from runtime.model.compile_cache import FallbackWarning
from runtime.model.compiled import CompiledSignals, compiled_model
from runtime.model.generated import GeneratedModel, require_no_channels
from runtime.resolution.c import kernels
from runtime.resolution.c.self_test import unavailable
from runtime.resolution.perturbed import (
    PreparedRecord,
    Task,
    run_position,
    stream_keys,
    torque_rows,
)
from runtime.resolution.rounding import packed_bits, stream
from runtime.resolution.runs import Level
from runtime.signals.filters import States

Array = np.ndarray


def usable(model: GeneratedModel) -> GeneratedModel:
    """`model`, or the NumPy module of a compiled one, with a FallbackWarning saying why, where the
    kernels of studies cannot be had; InputError for one that reads channels.
    """
    require_no_channels(model, "a study of encoders")
    if isinstance(model, CompiledSignals) and (reason := unavailable()):
        warnings.warn(f"{model.NAME}: NumPy in place of C: {reason}", FallbackWarning, stacklevel=3)
        return model.module
    return model


def model_of_runs(model: GeneratedModel, source: Path) -> GeneratedModel:
    """`model` with its signals in C, for the runs of resolution studies; without a word `model`
    itself where that cannot be had.

    source : the C file of the robot.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FallbackWarning)
        return usable(compiled_model(model, source=source, signals=True))


class CompiledWorkspace:
    """What one thread keeps from run to run of one task."""

    def __init__(self, task: Task, model: CompiledSignals) -> None:
        self.task, self.compiled, self.entries = (
            task,
            model,
            kernels.SignalEntries(model, task.names),
        )
        self.constants = model.constant_values(task.constants)
        self.records = [
            (record, self._positions(record, record.q, kernels.Room()), kernels.Room())
            for record in task.records
        ]
        self.two_point = task.settings.rounding == "two-point" and (
            task.settings.side == "joint" or task.drives is None
        )

    def fit(self, level: Level, draw: tuple[int, ...]) -> Solution:
        """Ordinary least squares of Y on W_CESTAC of one draw, eq. (17)."""
        rows = []
        for k, (record, measured, room) in enumerate(self.records):
            position, torque = stream_keys(draw, k)
            y = self._signals(record, self._states(record, measured, level, position, room), room)
            rows.append((y, torque_rows(self.task, record, level, torque), record.selection.mask))
        return solve(self.entries.factor(rows))

    def fit_of(self, parts: Sequence[tuple[States, Array]]) -> Solution:
        """The same of the states of every record, shape (N, n) each, in these rows, bool, shape
        (n, K), torques as measured.
        """
        rows = []
        for (record, _, room), (states, mask) in zip(self.records, parts, strict=True):
            y = self._signals(record, kernels.GivenStates(states, room), room)
            rows.append((y, record.torque, mask))
        return solve(self.entries.factor(rows))

    def _positions(self, record: PreparedRecord, q: Array, room: kernels.Room) -> kernels.Positions:
        """Positions q, shape (N, n), as C reads them."""
        return kernels.Positions(q, record.selection.signals.median, room)

    def _states(
        self,
        record: PreparedRecord,
        measured: kernels.Positions,
        level: Level,
        key: tuple[int, ...],
        room: kernels.Room,
    ) -> kernels.FilteredStates:
        """States of one draw."""
        settings, signals = self.task.settings, record.selection.signals
        if self.two_point and level.delta and signals.median == 1:  # the sum is left to C
            up = packed_bits(record.q.size, stream(settings.seed, *key))
            return kernels.FilteredStates(
                measured, record.rate, signals, room, up=up, step=level.delta
            )
        drawn = self._positions(record, run_position(self.task, record, level, key), room)
        return kernels.FilteredStates(drawn, record.rate, signals, room)

    def _signals(
        self, record: PreparedRecord, states: kernels.FilteredStates, room: kernels.Room
    ) -> Array:
        """Distinct signals of the wanted columns at the kept samples, shape (S, K)."""
        selection = record.selection
        y = kernels.decimated(
            self.entries,
            states,
            selection.samples,
            selection.factor,
            selection.signals.decimate,
            self.constants,
            room,
        )
        if not np.isfinite(y).all():
            raise InputError(
                f"the regressor of {self.compiled.NAME} is not finite at perturbed positions; use "
                "smaller steps"
            )
        return y
