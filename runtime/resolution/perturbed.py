"""Measurements as coarser sensors would have given them, and the system Y = W X + rho that they make, eqs. (15), (16), (28).

    q_CESTAC = R^-1 rounded(R (q - offset)) + offset        on the motor side; R = 1 on the joint side
    W_CESTAC = W(q_CESTAC, qd_CESTAC, qdd_CESTAC)           through the filters of the identification, on the rows of the measured record

Every record draws from streams of its own (`runtime.resolution.rounding.stream`), torques from others than positions, so that a draw is the same with
and without torques and whatever records follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.essential import essential_of
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, ModelText, base_columns
from runtime.observation.filters import filtered_states
from runtime.observation.observation import Observation, decimated_torque, observation_from_states, observe, stack
from runtime.observation.rows import Selection, select_rows
from runtime.records.record import Record
from runtime.resolution.rounding import rounded, stream
from runtime.resolution.runs import Level
from runtime.settings.study import CestacSettings, EstimateSettings, Study

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class PreparedRecord:
    """One record, with what does not change from run to run.

    Attributes
    ----------
    q, tau : ndarray, shape (N, n)
        As measured, joint side, rad or m, N m or N.
    rate : float, Hz
    files : mapping
        SHA-256 by file name.
    selection : Selection
        Rows used: those of the measured record.
    torque : ndarray, shape (n, K), N m or N
        Y before rows are left out.
    """

    q: Array
    tau: Array
    rate: float
    files: Mapping[str, str]
    selection: Selection
    torque: Array


@dataclass(frozen=True, eq=False)
class Task:
    """What every run needs; travels once to each process.

    Attributes
    ----------
    records : tuple of PreparedRecord
    model : GeneratedModel or ModelText
        The module, or its text for another process.
    names : tuple of str
        Columns, as fitted.
    estimate, settings : EstimateSettings, CestacSettings
    levels : tuple of Level
    drives : Drives or None
        Motor side.
    constants : mapping
        Values in place of the robot file's.
    """

    records: tuple[PreparedRecord, ...]
    model: GeneratedModel | ModelText
    names: tuple[str, ...]
    estimate: EstimateSettings
    settings: CestacSettings
    levels: tuple[Level, ...]
    drives: Drives | None
    constants: Mapping[str, float]


def prepared(record: Record, study: Study) -> PreparedRecord:
    """Rows and torques of the measured record, through the filters of the study with the median of study.cestac."""
    signals = replace(study.signals, median=study.cestac.median)
    selection = select_rows(record, filtered_states(record.q, record.rate, signals).qd, signals, study.rows)
    return PreparedRecord(record.q, record.tau, record.rate, dict(record.files), selection, decimated_torque(record.tau, selection))


def study_columns(
    model: GeneratedModel, records: Sequence[Record], study: Study, columns: Sequence[str] | None, constants: Mapping[str, float] | None
) -> tuple[str, ...]:
    """Columns of study.cestac.columns: a list, all, or the essential ones of the identification that `study` describes.

    columns : essential names where they are known.   Raises SettingsError for a name that is no base parameter.
    """
    if study.cestac.columns == "essential" and columns is None:
        observations = [observe(model, record, study, constants=constants) for record in records]
        return essential_of(stack(observations), study.essential, study.estimate).names
    return base_columns(model, study.cestac.columns, columns or (), "cestac", "columns")


def stream_keys(draw: tuple[int, ...], k: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Streams of the positions and of the torques of record k: (*draw, 2 k) and (*draw, 2 k + 1), positions of record 0 `draw` itself."""
    return ((*draw, 2 * k) if k else draw), (*draw, 2 * k + 1)


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


def torque_rows(task: Task, record: PreparedRecord, level: Level, key: Sequence[int]) -> Array:
    """Y of one record before rows are left out, shape (n, K): as measured, or rounded in steps of Phi."""
    if not level.torque:
        return record.torque
    return decimated_torque(perturbed_torque(record.tau, level, task.settings, task.drives, key), record.selection)


def perturbed(model: GeneratedModel, task: Task, level: Level, draw: tuple[int, ...]) -> Observation:
    """The system with perturbed measurements; that of the measurements themselves at a level without steps."""
    keys = [stream_keys(draw, k) for k in range(len(task.records))]
    positions = [perturbed_position(r.q, level, task.settings, task.drives, own) for r, (own, _) in zip(task.records, keys, strict=True)]
    return system_of(model, task, positions, [torque_rows(task, r, level, own) for r, (_, own) in zip(task.records, keys, strict=True)])


def system_of(model: GeneratedModel, task: Task, positions: Sequence[Array], torques: Sequence[Array]) -> Observation:
    """The stacked system of positions, shape (N, n), and torque rows, shape (n, K), of every record, by the way of the identification."""
    observations = [
        observation_from_states(
            model,
            filtered_states(q, record.rate, record.selection.signals),
            torque,
            record.selection,
            files=record.files,
            columns=task.names,
            constants=task.constants,
        )
        for record, q, torque in zip(task.records, positions, torques, strict=True)
    ]
    return observations[0] if len(observations) == 1 else stack(observations)
