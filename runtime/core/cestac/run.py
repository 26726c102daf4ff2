"""One run of a resolution study, from perturbed positions to the estimate of Y on W_CESTAC, eqs. (15)-(17): by the way of the identification, every method alike.

What does not change from run to run is made once for each block of runs. Times:
benchmarks/performance.md, `benchmarks/cestac_run.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.core.cestac.perturbed import Task, perturbed
from runtime.core.cestac.runs import Run, Runs
from runtime.core.errors import InputError
from runtime.core.estimation import estimate_of, point_estimate
from runtime.core.least_squares.method import LINEAR, linear_system
from runtime.core.rows.observation import Observation
from runtime.core.rows.regressor import Columns

Array = np.ndarray

USABLE = ("ok", "weak-instruments")  # Status of an estimate that counts as a run


def run_block(task: Task, keys: Sequence[tuple[int, int]]) -> Runs:
    """Compute several runs one after the other; key = (level, run)."""
    columns = task.columns
    return Runs.of([one_run(columns, task, key) for key in keys], len(task.names))


def one_run(columns: Columns, task: Task, key: tuple[int, int]) -> Run:
    """Estimate from perturbed measurements, eq. (17); key = (level, run).

    X is nan if the method finds no estimate.
    """
    level = task.levels[key[0]]
    draw = key[1:] if task.settings.common else key
    with np.errstate(over="ignore", invalid="ignore"):
        observation = perturbed(columns, task, level, draw)
    if not np.isfinite(observation.W).all():
        raise InputError(
            f"the regressor of {task.model.NAME} is not finite at perturbed positions; use smaller steps"
        )
    X = _estimated(task, observation)
    norm = float(np.linalg.norm(observation.Y - observation.W @ X))
    return Run(*key, tuple(X.tolist()), norm)


def _estimated(task: Task, observation: Observation) -> Array:
    """X of the method of the task, shape (b,); of nan if it finds no estimate."""
    if task.estimate.method in LINEAR:
        return linear_system(observation, task.estimate).solve().X
    try:
        settings = point_estimate(task.estimate, task.methods)
        estimate = estimate_of(observation, settings, task.methods, model=task.model)
        if estimate.status in USABLE:
            return estimate.X
    except InputError:
        pass
    return np.full(len(observation.names), np.nan)
