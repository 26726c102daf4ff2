"""Encoder resolution by the CESTAC method (chapter, section 3): what would a coarser encoder have done to the estimate?

    q_CESTAC  every raw sample of the position rounded at random, steps of Delta:
              eqs. (15), (28), `runtime.core.cestac.rounding`
    W_CESTAC = W(q_CESTAC, qd_CESTAC, qdd_CESTAC), through the filters of the study: eq. (16)
    X_CESTAC = least squares of Y on W_CESTAC, Y as measured: eq. (17)
    X_LS     = the estimate of the identification on these columns, with the median of the study

N runs per Delta (`runtime.core.cestac.run`) give the mean (18), the deviation (19), %sigma (20), %e
(21) and the residual (22); `runtime.core.cestac.result` holds them and their verdict. The rows used
are those of the measured record in every run. Steps of the motor torque (`torque`, section 4.1.3)
are studied alone and with the first Delta. Columns are the essential ones of the identification;
parameters that the settings name are judged alone, in that fit. Rounding is by default two-point,
on the joint side: those reproduce the chapter's figures.

The bandwidth of the noise decides everything, so sampling rate, cut-off and median window stand in
the settings of the result.
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
    prepared_records,
    study_columns,
)
from runtime.core.cestac.result import Cestac, level_result, names_judged
from runtime.core.cestac.run import USABLE, run_block
from runtime.core.cestac.runs import Level, Runs
from runtime.core.cestac.sources import Checkpoint, EncoderOf, LoopOf
from runtime.core.errors import InputError, SettingsError
from runtime.core.estimation import estimate_of, point_estimate
from runtime.core.least_squares.estimate import Estimate
from runtime.core.limits import LIMIT
from runtime.core.problem import Problem
from runtime.core.provenance import processor
from runtime.core.result import Identification
from runtime.core.rows.prepared import common_drives
from runtime.core.settings import to_mapping
from runtime.core.study import CestacSettings

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
    """Change of the estimate with coarser encoders and torque sensors, eqs. (15) to (22), (28).

    study.cestac has the settings, study.estimate the method.

    Parameters
    ----------
    problem : Problem
        Prepared.
    own_encoder : callable
        From a record to the encoder that made it, where the law of rounding asks for it.
    loop_of : callable
        From a problem to the closed loop that it simulates; None if it simulates none.
    columns : sequence of str, optional
        Essential names if they are known; default: those of the problem. Unused where settings.cestac.columns is "all".
    map : callable, optional
        As the built-in one; computes the runs, in processes (`runtime.parallel.processes.processes`) or by a
        Dask cluster (`runtime.parallel.cluster.cluster`). The results do not depend on it in any bit.
    progress : callable, optional
        Called with the number of runs done and their total.
    checkpoint : Checkpoint, optional
        Where runs are kept while the study lasts; those of an interrupted or shorter study with the
        same settings are not repeated.
    provenance : mapping, optional
        Further entries of Cestac.provenance; names and time stamps of the records are there.

    Raises
    ------
    SettingsError
        Motor side without drives, a column that is no base parameter, or a closed loop that the
        study does not tell.
    InputError
        A method that finds no estimate, or fewer than two at one of
        the steps.
    """
    model, study = problem.model, problem.settings
    settings = study.cestac
    as_measured = list(problem.prepared)
    drives = common_drives(model, as_measured)
    if settings.side == "motor" and drives is None:
        raise SettingsError(
            (
                f"motor, but {model.NAME} has no drives; use side: joint or give drives in the "
                "robot file"
            ),
            path=("cestac", "side"),
        )
    if study.signals.reader == "counts" and settings.delta and settings.rounding != "phase":
        raise SettingsError(
            (
                f"{settings.rounding} does not work with signals.reader: counts. It rounds each sample "
                "independently, which destroys the changes of the count that the reader needs; use phase"
            ),
            path=("cestac", "rounding"),
        )
    loop = loop_of(problem)
    if settings.place == "loop":
        assert loop is not None
        as_measured = [part.prepared for part in loop.parts]
    asked = to_mapping(study.estimate)
    if loop is not None:
        study = replace(study, estimate=loop.estimate)
    task = Task(
        records=prepared_records(as_measured, study, own_encoder, drives, loop),
        model=model,
        names=study_columns(problem, as_measured, columns, loop),
        estimate=replace(study.estimate, columns="all"),
        settings=settings,
        levels=levels_of(settings),
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
    if settings.place == "loop":
        (_, exact), *levels = levels
        X = np.nanmean(exact.X, axis=0)
        reference = replace(
            reference, X=X, residual_norm=float(np.linalg.norm(measured.Y - measured.W @ X))
        )
    return Cestac(
        names=task.names,
        reference=reference,
        levels=tuple(level_result(level, own, measured, reference) for level, own in levels),
        settings=described,
        provenance={**reference.provenance, "seed": settings.seed, "processor": processor()},
        notes=(
            *(() if loop is None else loop.notes),
            *(record.note for record in task.records if record.note),
        ),
    )


def _refuse(reference: Estimate) -> None:
    """InputError if the method finds no estimate that runs could be compared with."""
    if reference.status not in (*USABLE, "rank-deficient", "no-redundancy", "singular-weights"):
        raise InputError(
            f"{reference.method} finds no estimate from the record as measured, so rounded records "
            f"have nothing to be compared with: {reference.message}"
        )


def levels_of(settings: CestacSettings) -> tuple[Level, ...]:
    """Levels of a study: each Delta alone, then each Phi alone and together with the first Delta.

    In a simulated loop: a level without steps, then each Delta.
    """
    if settings.place == "loop":
        return (Level(0.0), *map(Level, settings.delta))
    steps = settings.torque or ()
    with_position = [Level(settings.delta[0], phi) for phi in steps] if settings.delta else []
    return (
        *(Level(delta, 0.0) for delta in settings.delta),
        *(Level(0.0, phi) for phi in steps),
        *with_position,
    )


def key_blocks(keys: Sequence[Key], runs: int, levels: int, common: bool) -> list[tuple[Key, ...]]:
    """Split the runs into tasks of at most LIMIT.TASK_RUNS runs; the split does not depend on the workers.

    A task holds contiguous runs of one level, or of all levels if these share their random numbers.
    Tasks of a study with few runs are small, so that every worker gets some.
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
    """All runs, sorted by level and number; identity : function that identifies this study on disk."""
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


def _measured(record: PreparedRecord) -> Iterator[memoryview]:
    """Positions, torques and missing samples of a record."""
    missing = () if record.missing is None else (np.packbits(record.missing.samples),)
    return (np.ascontiguousarray(x).data for x in (record.q, record.tau, *missing))


def _identity(
    task: Task, described: Mapping[str, Any], provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """Data that determine every bit of every run, as JSON values that identify a study; without the number of runs."""
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
        "records": [sha256(b"".join(map(bytes, _measured(r)))).hexdigest() for r in task.records],
        "versions": provenance["versions"],
    }


def resolution(result: Identification, own_encoder: EncoderOf, loop_of: LoopOf) -> Cestac:
    """Resolution study of an identification, with the steps and columns of settings.cestac.

    own_encoder, loop_of : as for `cestac`.
    """
    if not result.determined:
        raise InputError(
            "the record does not determine the parameters, so no encoder can be judged by it; "
            "record a richer motion"
        )
    essential = result.study.cestac.columns != "all"
    return cestac(
        result.problem,
        own_encoder=own_encoder,
        loop_of=loop_of,
        columns=result.essential.names if essential else None,
    )
