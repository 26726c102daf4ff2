"""Encoder resolution by the CESTAC method (chapter, section 3): what would a coarser encoder have done to the estimate?

    q_CESTAC  every raw sample of the position rounded at random, steps of Delta                     eqs. (15), (28), `runtime.rounding`
    W_CESTAC = W(q_CESTAC, qd_CESTAC, qdd_CESTAC), through the filters of the identification          eq. (16)
    X_CESTAC = least squares of Y on W_CESTAC, Y as measured                                         eq. (17)

N runs per Delta give the mean (18), the deviation (19), %sigma (20), %e (21) and the residual (22); `runtime.cestac_result` holds and judges
them. The rows used are those of the measured record in every run. Steps of the motor torque (`torque`, section 4.1.3) are studied alone and
with the first Delta. Columns are by default the essential ones of the identification, rounding is two-point, on the joint side: those
reproduce the chapter's figures.

The bandwidth of the noise decides everything, so sampling rate, cut-off and median window stand in the settings of the result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from runtime.cestac_result import Cestac, Level, Run, level_result
from runtime.drives import Drives
from runtime.errors import InputError, SettingsError
from runtime.essential import essential
from runtime.estimators import linear_system
from runtime.estimators.linear import assemble
from runtime.model import GeneratedModel, load_model
from runtime.observation import Observation, Selection, decimated_torque, observation_from_states, observe, select_rows, stack
from runtime.processes import results
from runtime.record import Record
from runtime.rounding import rounded, stream
from runtime.signals import filtered_states
from runtime.study import CestacSettings, EstimateSettings, Study, to_mapping

Array = np.ndarray
Progress = Callable[[Run, int, int], None]


@dataclass(frozen=True, eq=False)
class Part:
    """One record, with what does not change from run to run.

    q, tau : ndarray, shape (N, n), as measured, joint side.   selection : rows used, those of the measured record.
    torque : ndarray, shape (n, K), Y before rows are left out.
    """

    q: Array
    tau: Array
    rate: float
    files: Mapping[str, str]
    selection: Selection
    torque: Array


@dataclass(frozen=True, eq=False)
class Task:
    """What every run needs; travels once to each process. `model` is the module, or the path of its file for another process."""

    parts: tuple[Part, ...]
    model: GeneratedModel | str
    names: tuple[str, ...]
    estimate: EstimateSettings
    settings: CestacSettings
    levels: tuple[Level, ...]
    drives: Drives | None
    constants: Mapping[str, float]


def cestac(
    model: GeneratedModel,
    records: Record | Sequence[Record],
    study: Study,
    *,
    columns: Sequence[str] | None = None,
    drives: Drives | None = None,
    constants: Mapping[str, float] | None = None,
    workers: int = 0,
    progress: Progress | None = None,
    finished: Sequence[Run] = (),
    provenance: Mapping[str, Any] | None = None,
) -> Cestac:
    """Resolution study by the settings study.cestac.

    Parameters
    ----------
    records : one record of the robot, or several that are stacked.
    columns : essential names where they are known; default: those of `study` on these records. Unused unless study.cestac.columns is "essential".
    drives : motor side; default: DRIVES of the model.
    constants : values in place of the robot file's.
    workers : processes, 0 for this one (`runtime.processes`); the results do not depend on it. A script that asks for processes needs the usual
        `if __name__ == "__main__"`.
    progress : called with every finished run, the number of runs done and their total.
    finished : runs of an interrupted or shorter study with the same settings, not repeated.
    """
    settings = study.cestac
    records = (records,) if isinstance(records, Record) else tuple(records)
    drives = Drives.from_mapping(model.DRIVES) if drives is None and model.DRIVES is not None else drives
    if settings.side == "motor" and drives is None:
        raise SettingsError(
            f"motor, but {model.NAME} has no drives; use side: joint or give drives in the robot file", path=("cestac", "side")
        )
    names = _columns(model, records, study, columns, constants)
    task = Task(
        parts=tuple(_part(record, study) for record in records),
        model=model,
        names=names,
        estimate=replace(study.estimate, columns="all"),
        settings=settings,
        levels=levels_of(settings),
        drives=drives,
        constants=dict(constants or {}),
    )
    seen = _observed(task, model, Level(0.0), ())
    system = linear_system(seen, task.estimate)
    reference = assemble(system, system.solve(), model=model, provenance=provenance)
    runs = _all_runs(task, workers, progress, finished)
    return Cestac(
        names=names,
        reference=reference,
        levels=tuple(level_result(level, runs[k], seen, reference) for k, level in enumerate(task.levels)),
        settings={
            **seen.settings,
            "estimate": to_mapping(study.estimate),
            "cestac": to_mapping(settings),
            "rate": [record.rate for record in records],
            "torque_side": "joint" if drives is None else "motor",
        },
        provenance={**reference.provenance, "seed": settings.seed},
    )


def levels_of(settings: CestacSettings) -> tuple[Level, ...]:
    """Positions alone for every Delta; then torques alone, and torques with the first Delta, for every Phi."""
    steps = settings.torque or ()
    with_position = [Level(settings.delta[0], phi) for phi in steps] if settings.delta else []
    return (*(Level(delta, 0.0) for delta in settings.delta), *(Level(0.0, phi) for phi in steps), *with_position)


def perturbed_position(q: Array, level: Level, settings: CestacSettings, drives: Drives | None, key: Sequence[int]) -> Array:
    """q_CESTAC of eqs. (15), (28), shape (N, n), from the measured q; `key` of its random stream."""
    if not level.delta:
        return q
    rng = stream(settings.seed, *key)
    if settings.side == "joint" or drives is None:
        return rounded(q, level.delta, settings.rounding, rng)
    return drives.joint_position(rounded(drives.motor_position(q), level.delta, settings.rounding, rng))


def perturbed_torque(tau: Array, level: Level, settings: CestacSettings, drives: Drives | None, key: Sequence[int]) -> Array:
    """Joint torques, shape (N, n), with motor torques (N m) rounded in steps of Phi; joint torques where there are no drives."""
    rng = stream(settings.seed, *key)
    if drives is None:
        return rounded(tau, level.torque, settings.rounding, rng)
    motor = drives.motor_command(tau) * drives.torque_constant
    return drives.joint_torque(rounded(motor, level.torque, settings.rounding, rng) / drives.torque_constant)


def one_run(task: Task, key: tuple[int, int]) -> Run:
    """One estimate from perturbed measurements; key = (level, run)."""
    number, run = key
    model = _loaded(task.model) if isinstance(task.model, str) else task.model
    seen = _observed(task, model, task.levels[number], (run,) if task.settings.common else (number, run))
    system = linear_system(seen, task.estimate)
    fit = system.solve()
    norm = float(np.linalg.norm([joint.residual_norm(fit.X) for joint in system.raw.joints]))
    return Run(number, run, tuple(fit.X.tolist()), norm)


def _observed(task: Task, model: GeneratedModel, level: Level, key: tuple[int, ...]) -> Observation:
    """The system with perturbed measurements. Record k draws positions with (*key, 2 k) and torques with (*key, 2 k + 1), record 0 positions
    with `key` itself: a draw is the same with and without torques, and whatever records follow.
    """
    observations = []
    for k, part in enumerate(task.parts):
        position_key = (*key, 2 * k) if k else key
        q = perturbed_position(part.q, level, task.settings, task.drives, position_key)
        torque = part.torque
        if level.torque:
            tau = perturbed_torque(part.tau, level, task.settings, task.drives, (*key, 2 * k + 1))
            torque = decimated_torque(tau, part.selection)
        states = filtered_states(q, part.rate, part.selection.signals)
        seen = observation_from_states(
            model, states, torque, part.selection, files=part.files, columns=task.names, constants=task.constants
        )
        observations.append(seen)
    return observations[0] if len(observations) == 1 else stack(observations)


def _part(record: Record, study: Study) -> Part:
    """Rows and torques of the measured record, through the filters of the study."""
    signals = replace(study.signals, median=study.cestac.median)
    selection = select_rows(record, filtered_states(record.q, record.rate, signals).qd, signals, study.rows)
    return Part(record.q, record.tau, record.rate, dict(record.files), selection, decimated_torque(record.tau, selection))


def _all_runs(task: Task, workers: int, progress: Progress | None, finished: Sequence[Run]) -> tuple[tuple[Run, ...], ...]:
    """Runs by level, in the order of their numbers whatever the order in which they finished."""
    keys = [(level, run) for level in range(len(task.levels)) for run in range(task.settings.runs)]
    known = {(run.level, run.run): run for run in finished}
    wrong = [run for run in known.values() if len(run.X) != len(task.names) or (run.level, run.run) not in keys]
    if wrong:
        raise InputError(f"{len(wrong)} of {len(known)} finished runs belong to another study (levels, runs or columns differ)")
    missing = [key for key in keys if key not in known]
    sent = replace(task, model=_file(task.model)) if workers and missing else task
    for run in results(one_run, sent, missing, workers):
        known[run.level, run.run] = run
        if progress is not None:
            progress(run, len(known), len(keys))
    return tuple(tuple(known[level, run] for run in range(task.settings.runs)) for level in range(len(task.levels)))


def _columns(
    model: GeneratedModel, records: Sequence[Record], study: Study, columns: Sequence[str] | None, constants: Mapping[str, float] | None
) -> tuple[str, ...]:
    """Names of the columns: a list, all, or the essential ones of the identification that `study` describes."""
    wanted = study.cestac.columns
    if wanted == "essential":
        if columns is None:
            observations = [observe(model, record, study, constants=constants) for record in records]
            return essential(stack(observations), study.essential, study.estimate).names
        wanted = tuple(columns)
    elif wanted == "all":
        wanted = tuple(model.BASE_PARAMETERS)
    unknown = [name for name in wanted if name not in model.BASE_PARAMETERS]
    if unknown:
        message = f"no parameter {', '.join(unknown)}; {model.NAME} has {', '.join(model.BASE_PARAMETERS)}"
        raise SettingsError(message, path=("cestac", "columns"))
    return wanted


@lru_cache(maxsize=1)
def _loaded(path: str) -> GeneratedModel:
    return load_model(path)


def _file(model: GeneratedModel | str) -> str:
    """Path of an emitted module: what another process loads it from."""
    path = model if isinstance(model, str) else getattr(model, "__file__", None)
    if not path:
        raise InputError("this model was not loaded from a file, which other processes need; use workers=0")
    return str(Path(path).resolve())
