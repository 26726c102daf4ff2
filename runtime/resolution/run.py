"""One run of a resolution study, from perturbed positions to the least squares of Y on W_CESTAC, eqs. (15)-(17).

What does not change from run to run is made once in each thread and kept in a workspace: Y, filtered positions of the record, the plan of the
decimation, the distinct signals of the regressor and where they stand, and room for all of them. A compiled model has a workspace of its own
(`runtime.resolution.c.workspace`). Times: docs/performance.md, `benchmarks/cestac_run.py`.

Filters are linear, their padding too: filter(q + Delta xi) = filter(q) + Delta filter(xi). With common random numbers xi is the same for every Delta and
is filtered once; the median filter and true quantisation are not linear and take the whole way. Least squares by the normal equations of each joint
and one refinement (`runtime.estimators.normal_equations`) while the condition allows it, else by the triangular factor; every run says which.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from runtime.errors import InputError
from runtime.estimators.methods import LINEAR, estimate_of, linear_system
from runtime.estimators.normal_equations import LeastSquares, least_squares
from runtime.model.compiled import CompiledSignals
from runtime.model.generated import GeneratedModel
from runtime.model.narrowing import narrowed
from runtime.observation.filters import States, decimation_plan, filtered_states
from runtime.observation.regressor_signals import DecimatedSignals, distinct_entries
from runtime.resolution.c.workspace import CompiledWorkspace
from runtime.resolution.perturbed import PreparedRecord, Task, perturbed, run_position, stream_keys, system_of, torque_rows, with_deviation
from runtime.resolution.rounding import ADDED, noise, stream
from runtime.resolution.runs import TRIANGULAR, Level, Run, Runs

Array = np.ndarray

USABLE = ("ok", "weak-instruments")  # Status of an estimate that counts as a run


def run_block(task: Task, keys: Sequence[tuple[int, int]]) -> Runs:
    """Several runs, one after the other; key = (level, run)."""
    return Runs.of([one_run(task, key) for key in keys], len(task.names))


def one_run(task: Task, key: tuple[int, int]) -> Run:
    """One estimate from perturbed measurements; key = (level, run). Estimators other than ordinary least squares take the way of the identification."""
    number, run = key
    level, work = task.levels[number], workspace(task)
    draw = (run,) if task.settings.common else (number, run)
    if task.estimate.method not in LINEAR:
        return _estimated(work, key, level, draw)
    if not _plain(task):
        system = linear_system(perturbed(work.wanted, work.task, level, draw), task.estimate)
        X = system.solve().X
        norms, method = np.array([joint.residual_norm(X) for joint in system.raw.joints]), TRIANGULAR
    else:
        fit = work.fit(level, draw)
        X, norms, method = fit.X, fit.residual_norms, fit.method
    return Run(number, run, tuple(X.tolist()), float(np.linalg.norm(norms)), method)


def moved_estimate(task: Task, errors: Sequence[Array]) -> Array:
    """X, shape (b,), of linear least squares with the positions of every record moved by `errors`, shape (N, n) each, torques as measured."""
    work = workspace(task)
    if _plain(task):
        return work.moved_fit(errors).X
    positions = [record.q + error for record, error in zip(task.records, errors, strict=True)]
    observation = system_of(work.wanted, work.task, positions, [record.torque for record in task.records])
    return linear_system(observation, task.estimate).solve().X


def _plain(task: Task) -> bool:
    """Whether the runs are ordinary least squares on low-passed positions, which a workspace does."""
    lowpass = all(record.selection.signals.reader == "lowpass" for record in task.records)
    return task.estimate.method == "ols" and not task.estimate.options and task.loop is None and lowpass


def _estimated(work: Workspace, key: tuple[int, int], level: Level, draw: tuple[int, ...]) -> Run:
    """A run of a method that is not one linear system; X of nan where it finds no estimate."""
    observation = perturbed(work.model, work.task, level, draw)
    try:
        estimate = estimate_of(*with_deviation(observation, work.task, level), model=work.model)
        X = estimate.X if estimate.status in USABLE else np.full(len(observation.names), np.nan)
    except InputError:
        X = np.full(len(observation.names), np.nan)
    return Run(*key, tuple(X.tolist()), float(np.linalg.norm(observation.Y - observation.W @ X)))


class NumpyWorkspace:
    """The workspace of an emitted module. narrowed, wanted : the module with the distinct signals of the columns alone, and with all their entries."""

    def __init__(self, task: Task, model: GeneratedModel) -> None:
        self.task, self.model = task, model
        numbers = np.array([model.BASE_PARAMETERS.index(name) for name in task.names], dtype=int)
        self.entries = distinct_entries(model, task.constants, numbers)
        source = self.entries.source
        self.narrowed = narrowed(model, set(zip(self.entries.k[source].tolist(), self.entries.j[source].tolist(), strict=True)))
        self.wanted = narrowed(model, set(zip(self.entries.k.tolist(), self.entries.j.tolist(), strict=True)))
        self.by_joint = [np.flatnonzero(self.entries.j == j) for j in range(len(model.JOINTS))]
        self.columns = [self.entries.row[own] for own in self.by_joint]
        self.records = [RecordWorkspace(self, record) for record in task.records]

    def fit(self, level: Level, draw: tuple[int, ...]) -> LeastSquares:
        """Ordinary least squares of Y on W_CESTAC of one draw, eq. (17)."""
        return self._solved([record.rows(level, stream_keys(draw, k)) for k, record in enumerate(self.records)])

    def moved_fit(self, errors: Sequence[Array]) -> LeastSquares:
        """The same with the positions of every record moved by `errors`, shape (N, n) each, torques as measured."""
        return self._solved([record.moved_rows(error) for record, error in zip(self.records, errors, strict=True)])

    def _solved(self, rows: Sequence[list[Array]]) -> LeastSquares:
        return least_squares(lambda: rows, self.columns, len(self.task.names))


class RecordWorkspace:
    """The same for one record."""

    def __init__(self, work: NumpyWorkspace, record: PreparedRecord) -> None:
        self.work, self.record, self.selection = work, record, record.selection
        task, samples = work.task, record.selection.samples
        plan = decimation_plan(samples.stop - samples.start, self.selection.factor, self.selection.signals.decimate)
        self.signals = DecimatedSignals(work.narrowed, work.entries, task.constants, plan)
        self.q = np.asfortranarray(record.q)
        self.kept = [np.flatnonzero(mask) for mask in self.selection.mask]
        self.filtered = filtered_states(self.q, record.rate, self.selection.signals)
        self.measured: Array | None = None  # signals of the record itself
        self.noise: tuple[tuple[int, ...], States] | None = None  # of the last draw: its key, filter(xi)
        linear = self.selection.signals.median == 1 and task.settings.rounding in ADDED
        self.shares_noise = linear and task.settings.common and len(task.levels) > 1

    def rows(self, level: Level, keys: tuple[tuple[int, ...], tuple[int, ...]]) -> list[Array]:
        """[W_j[:, C_j] Y_j]' of every joint, shape (|C_j| + 1, rows of joint j), with perturbed measurements."""
        return self._rows(self._signals(level, keys[0]), torque_rows(self.work.task, self.record, level, keys[1]))

    def moved_rows(self, error: Array) -> list[Array]:
        """The same with positions moved by `error`, shape (N, n), torques as measured. Only joints that move are filtered."""
        rate, signals, states = self.record.rate, self.selection.signals, self.filtered
        if signals.median == 1:
            moving = np.flatnonzero(error.any(axis=0))
            added = filtered_states(np.asfortranarray(error[:, moving]), rate, signals)
            states = States(states.q.copy(order="K"), states.qd.copy(order="K"), states.qdd.copy(order="K"))
            for of, more in ((states.q, added.q), (states.qd, added.qd), (states.qdd, added.qdd)):
                of[:, moving] += more
        else:
            states = filtered_states(np.asfortranarray(self.q + error), rate, signals)
        return self._rows(self._of(states), self.record.torque)

    def _rows(self, signals: Array, torque: Array) -> list[Array]:
        return [self._joint(j, signals, torque[j]) for j in range(len(torque))]

    def _joint(self, j: int, signals: Array, torque: Array) -> Array:
        own, kept, entries = self.work.by_joint[j], self.kept[j], self.work.entries
        rows = np.empty((len(own) + 1, len(kept)))
        np.multiply(entries.sign[own, None], signals[entries.which[own]][:, kept], out=rows[:-1])
        rows[-1] = torque[kept]
        return rows

    def _signals(self, level: Level, key: tuple[int, ...]) -> Array:
        """Distinct signals at the kept samples, shape (S, K)."""
        if not level.delta:
            if self.measured is None:
                self.measured = self._of(self.filtered)
            return self.measured
        if self.shares_noise:
            xi, q = self._filtered_noise(key), self.filtered
            return self._of(States(q.q + level.delta * xi.q, q.qd + level.delta * xi.qd, q.qdd + level.delta * xi.qdd))
        task = self.work.task
        q_run = run_position(task, self.record, level, key)
        return self._of(filtered_states(np.asfortranarray(q_run), self.record.rate, self.selection.signals))

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
            self.noise = key, filtered_states(np.asfortranarray(xi), self.record.rate, self.selection.signals)
        return self.noise[1]


Workspace = NumpyWorkspace | CompiledWorkspace


_kept = threading.local()  # task and workspace of the last run of this thread


def workspace(task: Task) -> Workspace:
    """The workspace of a task, made at its first run in this thread."""
    if getattr(_kept, "task", None) is not task:
        own, model = task.opened()
        _kept.work = CompiledWorkspace(own, model) if isinstance(model, CompiledSignals) else NumpyWorkspace(own, model)
        _kept.task = task
    work: Workspace = _kept.work
    return work


def forget() -> None:
    """Give back the room of this thread's workspace."""
    _kept.__dict__.clear()
