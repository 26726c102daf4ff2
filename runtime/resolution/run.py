"""One run of a resolution study, from perturbed positions to the estimate of Y on W_CESTAC, eqs.
(15)-(17): by the way of the identification, every method alike.

Ordinary least squares on low-passed positions of a compiled model is done in C
(`runtime.resolution.c.workspace`), with the same draws and the same estimates to rounding. What
does not change from run to run is made once in each thread. Times: docs/performance.md,
`benchmarks/cestac_run.py`.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from runtime.errors import InputError
from runtime.estimators.method import LINEAR, linear_system
from runtime.loop.methods import estimate_of
from runtime.model.compiled import CompiledSignals
from runtime.model.generated import GeneratedModel
from runtime.model.narrowing import narrowed
from runtime.resolution.c.workspace import CompiledWorkspace
from runtime.resolution.perturbed import Task, perturbed, with_deviation
from runtime.resolution.runs import Level, Run, Runs
from runtime.rows.observation import Observation

Array = np.ndarray

USABLE = ("ok", "weak-instruments")  # Status of an estimate that counts as a run


def run_block(task: Task, keys: Sequence[tuple[int, int]]) -> Runs:
    """Several runs, one after the other; key = (level, run)."""
    return Runs.of([one_run(task, key) for key in keys], len(task.names))


def one_run(task: Task, key: tuple[int, int]) -> Run:
    """One estimate from perturbed measurements; key = (level, run). X of nan where the method finds
    no estimate.
    """
    level, (columns, in_c) = task.levels[key[0]], workspace(task)
    draw = key[1:] if task.settings.common else key
    if in_c is not None:
        fit = in_c.fit(level, draw)
        return Run(*key, tuple(fit.X.tolist()), fit.residual_norm)
    observation = perturbed(columns, task, level, draw)
    X = _estimated(task, observation, level)
    norm = float(np.linalg.norm(observation.Y - observation.W @ X))
    return Run(*key, tuple(X.tolist()), norm)


def _estimated(task: Task, observation: Observation, level: Level) -> Array:
    """X of the method of the task, shape (b,); of nan where it finds no estimate."""
    if task.estimate.method in LINEAR:
        return linear_system(observation, task.estimate).solve().X
    try:
        estimate = estimate_of(*with_deviation(observation, task, level), model=task.model)
        if estimate.status in USABLE:
            return estimate.X
    except InputError:
        pass
    return np.full(len(observation.names), np.nan)


_of_thread = threading.local()  # task and workspace of the last run of this thread


def workspace(task: Task) -> tuple[GeneratedModel, CompiledWorkspace | None]:
    """What a task runs on, made at its first run in this thread: the model, its regressor filling
    the columns of the task alone; and the workspace in C, where the runs are ordinary least squares
    of a compiled model on low-passed positions.
    """
    if getattr(_of_thread, "task", None) is not task:
        model = task.model
        lowpass = all(record.selection.signals.reader == "lowpass" for record in task.records)
        room = (
            CompiledWorkspace(task, model)
            if isinstance(model, CompiledSignals) and lowpass and plain(task)
            else None
        )
        numbers = [model.BASE_PARAMETERS.index(name) for name in task.names]
        entries = {(k, j) for k in numbers for j in np.flatnonzero(model.STRUCTURE[k]).tolist()}
        _of_thread.work = narrowed(model, entries), room
        _of_thread.task = task
    work: tuple[GeneratedModel, CompiledWorkspace | None] = _of_thread.work
    return work


def plain(task: Task) -> bool:
    """Whether its estimates are ordinary least squares, as the workspace in C makes them."""
    return task.estimate.method == "ols" and not task.estimate.options and task.loop is None


def forget() -> None:
    """Give back the room of this thread's workspace."""
    _of_thread.__dict__.clear()
