"""Study of the encoder resolution by CESTAC: how coarser encoders change the estimated parameters.

Chapter, section 3.

    q_CESTAC  every raw sample of the position rounded at random, steps of Delta:
              eqs. (15), (28), `runtime.core.cestac.rounding`
    W_CESTAC = W(q_CESTAC, qd_CESTAC, qdd_CESTAC), through the filters of the study: eq. (16)
    X_CESTAC = least squares of Y on W_CESTAC, Y as measured: eq. (17)
    X_LS     = the estimate of the identification on these columns, with the median of its signals

N runs per Delta (`one_run`) give the mean (18), the standard deviation (19), %sigma
(20), %e (21) and the residual (22); `runtime.core.cestac.result` holds these numbers and the
verdict. Every run uses the rows that were selected on the measured record. Steps of the motor
torque (`torque`, section 4.1.3) are studied alone and with the first Delta. By default the columns
are the essential parameters of the identification. If the settings name parameters, only these are
judged, in a fit together with the essential ones. Rounding is by default two-point and on the joint
side, which reproduces the figures of the chapter.

The result depends above all on the bandwidth of the noise. The settings of the result therefore
include the sampling rate, the cut-off and the median window.

The filters and the method are those of the identification, for every method alike. Data that do
not change from run to run are computed once for each block of runs. Times: benchmarks/performance.md, `benchmarks/cestac_run.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from itertools import groupby
from typing import Any

import numpy as np

from runtime.core.cestac.perturbed import (
    PreparedRecord,
    Task,
    measured_rows,
    perturbed,
    prepared_record,
    study_columns,
)
from runtime.core.cestac.result import LEAST_SQUARES, Cestac, level_result, names_judged
from runtime.core.cestac.runs import Level, Run, Runs
from runtime.core.cestac.sources import Checkpoint, EncoderOf, LoopOf
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.method import method_of
from runtime.core.problem import Problem, estimate_of, point_estimate
from runtime.core.provenance import processor
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import common_drives
from runtime.core.rows.regressor import Columns
from runtime.core.study import CestacSettings
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import LIMIT
from runtime.ground.settings import to_mapping

Progress = Callable[[int, int], None]
Key = tuple[int, int]
Map = Callable[..., Iterable[Any]]


def cestac(
    problem: Problem,
    *,
    own_encoder: EncoderOf,
    loop_of: LoopOf,
    columns: Sequence[str] | None = None,
    map: Map = map,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Cestac:
    """Find how coarser encoders and torque sensors change the estimated parameters.

    Eqs. (15) to (22), (28). The settings of the study are study.cestac, those of the method are
    study.estimate.

    Parameters
    ----------
    problem : Problem
        Problem with prepared records.
    own_encoder : callable
        Function of a record, the study and the drives. It returns the encoder that measured the
        record, or None if the law of rounding does not need it.
    loop_of : callable
        Function of a problem. It returns the closed loop that the study simulates, or None.
    columns : sequence of str, optional
        Names of the essential parameters if they are known; default: those of the problem. Unused
        if settings.cestac.columns is "all".
    map : callable, optional
        Works like the built-in map and computes the runs, for instance in processes
        (`runtime.parallel.processes.processes`) or on a Dask cluster (docs/many_runs.md). The results are the same in every bit.
    progress : callable, optional
        Called with the number of runs done and their total.
    checkpoint : Checkpoint, optional
        Store of the runs while the study lasts. Runs of an interrupted or shorter study with the
        same settings are not repeated.
    provenance : mapping, optional
        Further entries of Cestac.provenance; names and time stamps of the records are there.

    Raises
    ------
    SettingsError
        Motor side without drives, a column that is no base parameter, or a closed loop that the
        settings do not describe.
    InputError
        The method finds no estimate from the measured record, or fewer than two at one of the
        steps.
    """
    model, study = problem.model, problem.settings
    settings = study.cestac
    as_measured = list(problem.prepared)
    drives = common_drives(model, as_measured)
    if settings.side == "motor" and drives is None:
        raise SettingsError(
            (
                f"side: motor needs drives, but {model.NAME} has no drives; set side: joint, or "
                "give drives in the robot file"
            ),
            path=("cestac", "side"),
        )
    name = study.signals.reader
    if settings.delta and not problem.reader.reads_rounded:
        raise SettingsError(
            f"signals.reader: {name} cannot read rounded positions; set another reader, or "
            "delta: []",
            path=("cestac", "delta"),
        )
    if problem.reader.encoder is not None and settings.delta and settings.rounding != "phase":
        raise SettingsError(
            (
                f"rounding: {settings.rounding} does not work with signals.reader: {name}, because "
                "it rounds each sample independently and so destroys the changes of the encoder "
                "count; set rounding: phase"
            ),
            path=("cestac", "rounding"),
        )
    loop = loop_of(problem)
    asked = to_mapping(study.estimate)
    if loop is not None:
        as_measured = list(loop.records)
        study = replace(study, estimate=loop.estimate)
    in_loop = loop is not None and loop.in_loop
    task = Task(
        records=tuple(
            prepared_record(own, study, own_encoder, drives, exact=bool(settings.delta))
            for own in (() if in_loop else as_measured)
        ),
        model=model,
        names=study_columns(problem, as_measured, columns, loop),
        estimate=replace(study.estimate, columns="all"),
        settings=settings,
        levels=levels_of(settings, in_loop),
        drives=drives,
        reader=problem.reader,
        methods=problem.methods,
        loop=loop,
    )
    measured = measured_rows(task, as_measured)
    whole = [reading.record for reading in as_measured]
    origins = {**problem.provenance, **names_judged(study.cestac), **(provenance or {})}
    point = point_estimate(task.estimate, problem.methods)
    reference = estimate_of(measured, point, problem.methods, model=model, provenance=origins)
    _refuse(reference)
    described = {
        **measured.settings,
        "estimate": asked,
        "cestac": to_mapping(settings),
        "rate": [record.rate for record in whole],
        "torque_side": "joint" if drives is None else "motor",
        **({} if loop is None else loop.described),
    }
    runs = _all_runs(
        task,
        partial(_identity, task, described, reference.provenance),
        map,
        progress,
        checkpoint,
    )
    by_level = [runs.where(runs.level == k) for k in range(len(task.levels))]
    levels = list(zip(task.levels, by_level, strict=True))
    linear = method_of(task.estimate, task.methods).linear
    if in_loop:
        (_, exact), *levels = levels
        reference = replace(reference, X=np.nanmean(exact.X, axis=0))
    if in_loop or not linear:  # their residuals are not those of `measured`
        norm = float(np.linalg.norm(measured.Y - measured.W @ reference.X))
        reference = replace(reference, residual_norm=norm)
    return Cestac(
        names=task.names,
        reference=reference,
        levels=tuple(level_result(level, own, measured, reference) for level, own in levels),
        settings=described,
        provenance={**reference.provenance, "seed": settings.seed, "processor": processor()},
        notes=(
            *(() if loop is None else loop.notes),
            *(record.note for record in task.records if record.note),
            *(_note_of_own(record) for record in task.records if record.own is not None),
        ),
        estimator=LEAST_SQUARES if linear else reference.method.upper(),
    )


def _note_of_own(record: PreparedRecord) -> str:
    """Say with what runs of simulated encoders are compared, and how much they round."""
    assert record.own is not None
    own = float(record.own.step.max())
    steps = f", with the effect of its own encoder steps of {own:.3g}" if own > 0 else ""
    return (
        f"Rounding phase simulates real encoders, whose error has the variance Delta^2/12, a twelfth "
        "of that of two-point: for the same change, a step may be 3.5 times as coarse. Changes are "
        f"against the estimate from {record.record.name}{steps}."
    )


def _refuse(reference: Estimate) -> None:
    """Raise InputError if the method finds no estimate from the record without rounding.

    Estimates from rounded records are compared with this estimate.
    """
    if reference.status not in (*USABLE, "rank-deficient", "no-redundancy", "singular-weights"):
        raise InputError(
            f"{reference.method} finds no estimate from the measured record, which is the reference "
            f"for the estimates from rounded records: {reference.message}"
        )


def levels_of(settings: CestacSettings, in_loop: bool = False) -> tuple[Level, ...]:
    """List the levels of a study: each level is a position step Delta with a torque step Phi.

    The order is: each Delta alone, each Phi alone, each Phi with the first Delta. If the encoder of
    a simulated loop is studied (in_loop): a level without steps, then each Delta.
    """
    if in_loop:
        return (Level(0.0), *map(Level, settings.delta))
    steps = settings.torque or ()
    with_position = [Level(settings.delta[0], phi) for phi in steps] if settings.delta else []
    return (
        *(Level(delta, 0.0) for delta in settings.delta),
        *(Level(0.0, phi) for phi in steps),
        *with_position,
    )


def key_blocks(keys: Sequence[Key], runs: int, levels: int, common: bool) -> list[tuple[Key, ...]]:
    """Group the runs of a study of encoder resolution into tasks for worker processes.

    A task holds successive runs of one level, or of all levels if these share their random numbers.
    The number of runs in a task is limited (TASK_RUNS in limits.toml); a task of all levels has at
    least one run of each. A study with few runs has smaller tasks, so that every worker gets some.
    The tasks do not depend on the number of workers.
    """
    size = max(1, min(LIMIT.TASK_RUNS, runs // 4) // (levels if common else 1))

    def block(key: Key) -> Key:
        return (0 if common else key[0], key[1] // size)

    return [
        tuple(group)
        for _, group in groupby(
            sorted(keys, key=lambda key: (block(key), key[1], key[0])), key=block
        )
    ]


def _all_runs(
    task: Task,
    identity: Callable[[], Mapping[str, Any]],
    map: Map,
    progress: Progress | None,
    checkpoint: Checkpoint | None,
) -> Runs:
    """Compute the runs of a study that are not yet on disk; return all its runs, sorted.

    identity : function that returns the data that identify this study on disk.
    """
    runs, levels, b = task.settings.runs, range(len(task.levels)), len(task.names)
    finished = checkpoint.resume(identity(), b) if checkpoint else Runs.of((), b)
    parts = [finished.where((finished.level < len(levels)) & (finished.run < runs))]
    done, total, known = len(parts[0]), runs * len(levels), parts[0].keys
    missing = [key for level in levels for run in range(runs) if (key := (level, run)) not in known]
    try:
        blocks = key_blocks(missing, runs, len(levels), task.settings.common)
        for part in map(partial(run_block, task), blocks):
            parts.append(part)
            done += len(part)
            if checkpoint is not None:
                checkpoint.add(part)
            if progress is not None:
                progress(done, total)
    finally:  # also when Ctrl-C or an error ends the study
        if checkpoint is not None:
            checkpoint.flush()
    return Runs.joined(parts, b)


def _measured(record: Record) -> Iterator[memoryview]:
    """Yield the bytes of the positions, torques and missing-sample flags of a record, for a hash.

    A hash of these bytes identifies the record.
    """
    missing = () if record.missing is None else (np.packbits(record.missing.samples),)
    return (np.ascontiguousarray(x).data for x in (record.q, record.torque, *missing))


def _identity(
    task: Task, described: Mapping[str, Any], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the data that identify a study on disk: all data that influence its runs.

    The number of runs is left out, so that a finished study can continue with more runs.
    """
    drives = task.drives
    return {
        **{key: value for key, value in described.items() if key != "cestac"},
        **{f"cestac.{key}": value for key, value in described["cestac"].items() if key != "runs"},
        "columns": list(task.names),
        "constants": dict(task.model.CONSTANTS),
        "drives": None
        if drives is None
        else [
            drives.ratio.tolist(),
            drives.offset.tolist(),
            drives.torque_constant.tolist(),
            drives.coupling,
        ],
        "robot": provenance.get("robot"),
        "robot_sha256": provenance.get("robot_sha256"),
        "records": [
            sha256(b"".join(map(bytes, _measured(r.record)))).hexdigest() for r in task.records
        ],
        "versions": provenance["versions"],
    }


def resolution(result: Identification, own_encoder: EncoderOf, loop_of: LoopOf) -> Cestac:
    """Study the encoder resolution of a finished identification, by the settings in study.cestac.

    own_encoder, loop_of : as for `cestac`.
    """
    if not result.determined:
        raise InputError(
            "the record does not determine the parameters, so this record cannot judge an encoder; "
            "record a richer motion"
        )
    essential = result.study.cestac.columns != "all"
    return cestac(
        result.problem,
        own_encoder=own_encoder,
        loop_of=loop_of,
        columns=result.essential.names if essential else None,
    )


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
    method = method_of(task.estimate, task.methods)
    if method.linear:
        return method.system(observation, task.estimate).solve().X
    try:
        settings = point_estimate(task.estimate, task.methods)
        estimate = estimate_of(
            observation, settings, task.methods, model=task.model, corrected=False
        )
        if estimate.status in USABLE:
            return estimate.X
    except InputError:
        pass
    return np.full(len(observation.names), np.nan)
