"""Runs of a resolution study in C: filters, signals, decimation and least squares of `runtime.resolution.c.kernels` in place of NumPy's.

The same draws as `runtime.resolution.run` and the same estimates to rounding; the same bits for the same seed on one kind of machine, whoever works.
Only perturbed positions go in and small matrices come out; room is reused from run to run. Estimators other than ordinary least squares take the
way of the identification, with the regressor in C.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from runtime.errors import InputError
from runtime.estimators import linear_system
from runtime.estimators.normal_equations import LeastSquares
from runtime.model.compile_cache import FallbackWarning
from runtime.model.compiled import CompiledModel, compiled_model
from runtime.model.generated import GeneratedModel
from runtime.model.text import ModelText
from runtime.observation.observation import decimated_torque
from runtime.resolution.c import kernels as fused
from runtime.resolution.c.least_squares import KeptRows, least_squares
from runtime.resolution.c.self_test import unavailable
from runtime.resolution.result import Level
from runtime.resolution.rounding import bits, stream
from runtime.resolution.run import Part, Task, observed, part_key, perturbed_position, perturbed_torque
from runtime.resolution.runs import TRIANGULAR, Run, Runs

Array = np.ndarray


@dataclass(frozen=True)
class CompiledText(ModelText):
    """Module and C file of a model as text, for another process, which compiles into its own cache."""

    source: bytes = b""

    @classmethod
    def of(cls, model: GeneratedModel) -> CompiledText:
        """The texts of a compiled model."""
        assert isinstance(model, CompiledModel)
        module = ModelText.of(model)
        return cls(module.name, module.text, module.digest, model.source)

    def load(self) -> GeneratedModel:
        """The compiled model; InputError where it cannot be compiled there, as NumPy would not give the same bits."""
        module = super().load()
        with TemporaryDirectory(prefix="symgen-") as folder:
            path = Path(folder) / Path(self.name).with_suffix(".c")
            path.write_bytes(self.source)
            model = compiled_model(module, source=path)
        if not isinstance(model, CompiledModel):
            raise InputError(
                f"a worker has no compiled {module.NAME} (its log says why); use --target numpy, or install a C compiler there"
            )
        return model


def usable(model: GeneratedModel) -> GeneratedModel:
    """`model`, or the NumPy module of a compiled one, with a FallbackWarning saying why, where the kernels of studies cannot be had."""
    if isinstance(model, CompiledModel) and (reason := unavailable()):
        warnings.warn(f"{model.NAME}: NumPy in place of C: {reason}", FallbackWarning, stacklevel=3)
        return model.module
    return model


def run_block(task: Task, keys: Sequence[tuple[int, int]]) -> Runs:
    """Several runs, one after the other; key = (level, run)."""
    work = _workspace(task)
    return Runs.of([work.run(key) for key in keys], len(task.names))


class FusedWorkspace:
    """What one thread keeps from run to run."""

    def __init__(self, task: Task) -> None:
        self.task = task
        model = task.model.load() if isinstance(task.model, ModelText) else task.model
        assert isinstance(model, CompiledModel)
        self.model, self.entries = model, fused.Entries(model, task.names)
        self.constants = fused.constant_values(model, task.constants)
        self.room = fused.Room()
        self.parts = [(part, np.asfortranarray(part.q), fused.Room()) for part in task.parts]
        self.two_point = task.settings.rounding == "two-point" and (task.settings.side == "joint" or task.drives is None)

    def run(self, key: tuple[int, int]) -> Run:
        """One estimate from perturbed measurements."""
        number, run = key
        level, draw = self.task.levels[number], (run,) if self.task.settings.common else (number, run)
        if self.task.estimate.method != "ols" or self.task.estimate.options:
            system = linear_system(observed(self.task, self.model, level, draw), self.task.estimate)
            X = system.solve().X
            norms, method = np.array([joint.residual_norm(X) for joint in system.raw.joints]), TRIANGULAR
        else:
            fit = self._fit(level, draw)
            X, norms, method = fit.X, fit.residual_norms, fit.method
        return Run(number, run, tuple(X.tolist()), float(np.linalg.norm(norms)), method)

    def _fit(self, level: Level, draw: tuple[int, ...]) -> LeastSquares:
        rows = []
        for k, (part, q, room) in enumerate(self.parts):
            position_key, torque_key = part_key(draw, k)
            y = self._signals(part, q, level, position_key, room)
            torque = part.torque
            if level.torque:
                tau = perturbed_torque(part.tau, level, self.task.settings, self.task.drives, torque_key)
                torque = decimated_torque(tau, part.selection)
            rows.append((y, torque, part.selection.mask))
        return least_squares(KeptRows(self.entries, rows, self.room))

    def _signals(self, part: Part, q: Array, level: Level, key: tuple[int, ...], room: fused.Room) -> Array:
        """Distinct signals of the wanted columns at the kept samples, shape (S, K)."""
        settings, chosen = self.task.settings, part.selection
        if self.two_point and level.delta and chosen.signals.median == 1:  # the sum is left to C
            up = bits(q.shape, stream(settings.seed, *key))
            states = fused.FilteredStates(q, part.rate, chosen.signals, room, up=up, step=level.delta)
        else:
            states = fused.FilteredStates(perturbed_position(q, level, settings, self.task.drives, key), part.rate, chosen.signals, room)
        y = fused.decimated(self.entries, states, chosen.samples, chosen.factor, chosen.signals.decimate, self.constants, room)
        if not np.isfinite(y).all():
            raise InputError(f"the regressor of {self.model.NAME} is not finite at perturbed positions; use smaller steps")
        return y


class _Kept(threading.local):
    """The workspace of the last task of this thread."""

    work: FusedWorkspace | None = None


_kept = _Kept()


def _workspace(task: Task) -> FusedWorkspace:
    """The workspace of a task, made at its first run in this thread."""
    if _kept.work is None or _kept.work.task is not task:
        _kept.work = FusedWorkspace(task)
    return _kept.work


def forget() -> None:
    """Give back the room of this thread's workspace."""
    _kept.work = None
