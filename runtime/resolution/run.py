"""One run of a resolution study, from perturbed positions to the least squares of Y on W_CESTAC, eqs. (15)-(17).

What does not change from run to run is made once in each process and kept in a Workspace: Y, filtered positions of the record, the plan of the
decimation, the distinct signals of the regressor and where they stand, and room for all of them. A run on 60 columns is then 11 times faster than the
plain way (filter, dense regressor, scipy's decimate column by column, lstsq), on 26 columns 8 times: `benchmarks/cestac_run.py`.

Filters are linear, their padding too: filter(q + Delta xi) = filter(q) + Delta filter(xi). With common random numbers xi is the same for every Delta and
is filtered once; the median filter and true quantisation are not linear and take the whole way. Least squares by the normal equations of each joint
and one refinement (`runtime.estimators.normal_equations`) while the condition allows it, else by the triangular factor; every run says which.

Runs are not stacked into longer arrays: a run of 2500 samples costs 1.4 times as much per sample as one of 45000, which is all there is to save, and
longer arrays leave the cache.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.estimators import linear_system
from runtime.estimators.normal_equations import least_squares
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.model.text import ModelText
from runtime.observation.filters import States, decimation_plan, filtered_states
from runtime.observation.observation import Observation, Selection, decimated_torque, observation_from_states, stack
from runtime.observation.regressor_signals import DecimatedSignals, distinct_entries
from runtime.resolution.result import Level
from runtime.resolution.rounding import ADDED, noise, rounded, stream
from runtime.resolution.runs import TRIANGULAR, Run, Runs
from runtime.settings.study import CestacSettings, EstimateSettings

Array = np.ndarray


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
    """What every run needs; travels once to each process. `model` is the module, or its text for another process."""

    parts: tuple[Part, ...]
    model: GeneratedModel | ModelText
    names: tuple[str, ...]
    estimate: EstimateSettings
    settings: CestacSettings
    levels: tuple[Level, ...]
    drives: Drives | None
    constants: Mapping[str, float]


def one_run(task: Task, key: tuple[int, int]) -> Run:
    """One estimate from perturbed measurements; key = (level, run)."""
    number, run = key
    level, work = task.levels[number], workspace(task)
    draw = (run,) if task.settings.common else (number, run)
    if task.estimate.method != "ols" or task.estimate.options:
        system = linear_system(observed(task, work.model, level, draw), task.estimate)
        X = system.solve().X
        norms, method = np.array([joint.residual_norm(X) for joint in system.raw.joints]), TRIANGULAR
    else:
        rows = [part.rows(level, part_key(draw, k)) for k, part in enumerate(work.parts)]
        fit = least_squares(lambda: rows, work.columns, len(task.names))
        X, norms, method = fit.X, fit.residual_norms, fit.method
    return Run(number, run, tuple(X.tolist()), float(np.linalg.norm(norms)), method)


def run_block(task: Task, keys: Sequence[tuple[int, int]]) -> Runs:
    """Several runs, one after the other."""
    return Runs.of([one_run(task, key) for key in keys], len(task.names))


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


def observed(task: Task, model: GeneratedModel, level: Level, draw: tuple[int, ...]) -> Observation:
    """The system with perturbed measurements, by the way of the identification."""
    observations = []
    for k, part in enumerate(task.parts):
        key = part_key(draw, k)
        states = filtered_states(perturbed_position(part.q, level, task.settings, task.drives, key[0]), part.rate, part.selection.signals)
        torque = part.torque
        if level.torque:
            torque = decimated_torque(perturbed_torque(part.tau, level, task.settings, task.drives, key[1]), part.selection)
        observations.append(
            observation_from_states(model, states, torque, part.selection, files=part.files, columns=task.names, constants=task.constants)
        )
    return observations[0] if len(observations) == 1 else stack(observations)


def part_key(draw: tuple[int, ...], k: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Streams of the positions and of the torques of record k: (*draw, 2 k) and (*draw, 2 k + 1), positions of record 0 `draw` itself.

    A draw is the same with and without torques, and whatever records follow.
    """
    return ((*draw, 2 * k) if k else draw), (*draw, 2 * k + 1)


class Workspace:
    """What one thread keeps from run to run."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.model = task.model.load() if isinstance(task.model, ModelText) else task.model
        numbers = np.array([self.model.BASE_PARAMETERS.index(name) for name in task.names], dtype=int)
        self.entries = distinct_entries(self.model, task.constants, numbers)
        self.by_joint = [np.flatnonzero(self.entries.j == j) for j in range(len(self.model.JOINTS))]
        self.columns = [self.entries.row[chosen] for chosen in self.by_joint]
        self.parts = [PartWorkspace(self, part) for part in task.parts]


class PartWorkspace:
    """The same for one record."""

    def __init__(self, work: Workspace, part: Part) -> None:
        self.work, self.part, self.selection = work, part, part.selection
        task, samples = work.task, part.selection.samples
        plan = decimation_plan(samples.stop - samples.start, self.selection.factor, self.selection.signals.decimate)
        self.signals = DecimatedSignals(work.model, work.entries, task.constants, plan)
        self.q = np.asfortranarray(part.q)
        self.kept = [np.flatnonzero(mask) for mask in self.selection.mask]
        self.filtered = filtered_states(self.q, part.rate, self.selection.signals)
        self.measured: Array | None = None  # signals of the record itself
        self.noise: tuple[tuple[int, ...], States] | None = None  # of the last draw: its key, filter(xi)
        linear = self.selection.signals.median == 1 and task.settings.rounding in ADDED
        self.shares_noise = linear and task.settings.common and len(task.levels) > 1

    def rows(self, level: Level, keys: tuple[tuple[int, ...], tuple[int, ...]]) -> list[Array]:
        """[W_j[:, C_j] Y_j]' of every joint, shape (|C_j| + 1, rows of joint j), with perturbed measurements."""
        task, signals, torque = self.work.task, self._signals(level, keys[0]), self.part.torque
        if level.torque:
            torque = decimated_torque(perturbed_torque(self.part.tau, level, task.settings, task.drives, keys[1]), self.selection)
        return [self._joint(j, signals, torque[j]) for j in range(len(torque))]

    def _joint(self, j: int, signals: Array, torque: Array) -> Array:
        chosen, kept, entries = self.work.by_joint[j], self.kept[j], self.work.entries
        rows = np.empty((len(chosen) + 1, len(kept)))
        np.multiply(entries.sign[chosen, None], signals[entries.which[chosen]][:, kept], out=rows[:-1])
        rows[-1] = torque[kept]
        return rows

    def _signals(self, level: Level, key: tuple[int, ...]) -> Array:
        """Distinct signals at the kept samples, shape (S, K)."""
        if not level.delta:
            if self.measured is None:
                self.measured = self._of(self.filtered)
            return self.measured
        if self.shares_noise:
            return self._of(_moved(self.filtered, level.delta, self._filtered_noise(key)))
        task = self.work.task
        q = perturbed_position(self.q, level, task.settings, task.drives, key)
        return self._of(filtered_states(np.asfortranarray(q), self.part.rate, self.selection.signals))

    def _of(self, states: States) -> Array:
        signals = self.signals(states[self.selection.samples])
        if not np.isfinite(signals).all():
            raise InputError(f"the regressor of {self.work.model.NAME} is not finite at perturbed positions; use smaller steps")
        return signals

    def _filtered_noise(self, key: tuple[int, ...]) -> States:
        """filter(xi) of one draw, joint side."""
        if self.noise is None or self.noise[0] != key:
            settings, drives = self.work.task.settings, self.work.task.drives
            xi = noise(self.q.shape, settings.rounding, stream(settings.seed, *key))
            if settings.side == "motor" and drives is not None:
                xi = drives.joint_position(xi) - drives.offset
            self.noise = key, filtered_states(np.asfortranarray(xi), self.part.rate, self.selection.signals)
        return self.noise[1]


def _moved(states: States, delta: float, by: States) -> States:
    """filter(q) + Delta filter(xi)."""
    return States(states.q + delta * by.q, states.qd + delta * by.qd, states.qdd + delta * by.qdd)


class _Kept(threading.local):
    """The workspace of the last task of this thread."""

    task: Task | None = None
    work: Workspace | None = None


_kept = _Kept()


def workspace(task: Task) -> Workspace:
    """The workspace of a task, made at its first run in this thread."""
    if _kept.work is None or _kept.task is not task:
        _kept.task, _kept.work = task, Workspace(task)
    return _kept.work


def forget() -> None:
    """Give back the room of this thread's workspace."""
    _kept.task = _kept.work = None
