"""One run of a study of the encoder resolution: rounded measurements and the estimate from them.

Eqs. (15)-(17). The filters and the method are those of the identification, for every method alike.
Data that do not change from run to run are computed once for each block of runs. Times:
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
    """Compute the runs of a study with the given (level, run) numbers, one after the other."""
    columns = task.columns
    return Runs.of([one_run(columns, task, key) for key in keys], len(task.names))


def one_run(columns: Columns, task: Task, key: tuple[int, int]) -> Run:
    """Estimate the parameters once from randomly rounded measurements, eq. (17).

    key : number of the level and of the run. X is nan if the method finds no estimate.
    """
    level = task.levels[key[0]]
    draw = key[1:] if task.settings.common else key
    with np.errstate(over="ignore", invalid="ignore"):
        observation = perturbed(columns, task, level, draw)
    if not np.isfinite(observation.W).all():
        raise InputError(
            f"the regressor of {task.model.NAME} is not finite at rounded positions; "
            "use smaller steps"
        )
    X = _estimated(task, observation)
    norm = float(np.linalg.norm(observation.Y - observation.W @ X))
    return Run(*key, tuple(X.tolist()), norm)


def _estimated(task: Task, observation: Observation) -> Array:
    """Estimate X, shape (b,), from the system of one run; nan if the method finds no estimate."""
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
