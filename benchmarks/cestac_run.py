"""One run of a resolution study: the plain pipeline and ours, and two workers against one.

    python benchmarks/cestac_run.py [--rounds 7] [--runs 2000]

A run perturbs every sample of the position (two-point, 2 pi/5000), filters, evaluates W, decimates
by 40 and solves Y = W X. Plain: low-pass by scipy, the dense W of the emitted NumPy module,
scipy.signal.decimate column by column, numpy.linalg.lstsq; Y is decimated once for both. TX40, on
its record in motion (37501 samples) with its essential and with all 60 columns, and on all 45000
samples with 60 columns.

One process pinned to one core, one BLAS thread, CPU time, contenders in rotated order in every
round, ratios per round as median [range]. X of both is compared before timing. Workers: processes,
the one that asks among them, wall time of a whole study with its start, with the load of the
machine. Goal: two workers 1.6 times faster than one.
"""

# ruff: noqa: E402 (the number of BLAS threads is set before numpy is loaded)

from __future__ import annotations

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy
from rounds import interleave, processor, ratio

from runtime import Record, Study, load_model
from runtime.compose import cestac, essential, problem
from runtime.core.cestac.cestac import levels_of, one_run
from runtime.core.cestac.perturbed import Task, perturbed_position, prepared_record
from runtime.core.drives import Drives
from runtime.core.model import GeneratedModel
from runtime.core.signals.filters import filtered_states
from runtime.counts.own_encoder import own_encoder
from runtime.parallel.processes import processes
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.description import load_robot
from symgen.emit.generate import generate_files

Array = np.ndarray
ROBOT, KEY = "tx40", (0, 0)


def task_of(model: GeneratedModel, record: Record, study: Study, names: tuple[str, ...]) -> Task:
    """What every run of the study needs."""
    study = replace(study, cestac=replace(study.cestac, median=1))
    drives = Drives.from_mapping(model.DRIVES) if model.DRIVES else None
    whole = problem(model, record, study)
    return Task(
        (prepared_record(whole.prepared[0], study, own_encoder),),
        model,
        names,
        replace(study.estimate, columns="all"),
        study.cestac,
        levels_of(study.cestac),
        drives,
        whole.reader,
        whole.methods,
    )


def plain_run(task: Task, key: tuple[int, int]) -> Array:
    """The same estimate as anyone would write it."""
    (part,), n = task.records, len(task.model.JOINTS)
    chosen = part.selection
    q = perturbed_position(part.record.q, task.levels[key[0]], task.settings, task.drives, key)
    states = filtered_states(q, part.record.rate, chosen.signals)[chosen.samples]
    W = task.model.observation_matrix(states.q, states.qd, states.qdd)
    numbers = [task.model.BASE_PARAMETERS.index(name) for name in task.names]
    W_j = [W[j * len(states) : (j + 1) * len(states), numbers] for j in range(n)]
    W_fd = [
        np.column_stack([scipy.signal.decimate(w, chosen.factor, zero_phase=True) for w in rows.T])
        for rows in W_j
    ]
    mask = chosen.mask
    return np.linalg.lstsq(
        np.vstack([w[m] for w, m in zip(W_fd, mask, strict=True)]), part.torque[mask], rcond=None
    )[0]


def measure(
    title: str,
    module: GeneratedModel,
    record: Record,
    study: Study,
    names: tuple[str, ...],
    rounds: int,
) -> None:
    task = task_of(module, record, study, names)
    part = task.records[0]
    columns = task.columns
    N, K = part.selection.samples.stop - part.selection.samples.start, len(part.selection.kept)
    print(f"\n{title}: {len(record.q)} samples, {N} of them used, {K} kept, {len(names)} columns")
    X = plain_run(task, KEY)
    found = np.array(one_run(columns, task, KEY).X)
    difference = np.abs(found - X).max() / np.abs(X).max()
    print(f"    largest difference from plain {difference:.1e} of the largest parameter")
    contenders: dict[str, Callable[[], object]] = {
        "plain": lambda: plain_run(task, KEY),
        "ours": lambda: one_run(columns, task, KEY),
    }
    times = interleave(contenders, rounds)
    for name, row in times.items():
        print(f"    {name:24} {1e3 * statistics.median(row):8.2f} ms")
    print(f"    plain / ours {ratio(times, 'plain', 'ours')}")


def workers(model: GeneratedModel, record: Record, study: Study, runs: int, rounds: int) -> None:
    """Wall time of a study of `runs` runs on one and two processes, its start and that of the
    second process included.
    """
    settings = replace(study.cestac, delta=study.cestac.delta[:1], runs=runs, columns="all")

    def wall(count: int) -> float:
        start = time.perf_counter()
        with processes(count) as several:
            cestac(model, record, replace(study, cestac=settings), map=several)
        return time.perf_counter() - start

    per_round, spent = [], {1: [], 2: []}
    for k in range(rounds):
        taken = {count: wall(count) for count in ((1, 2) if k % 2 else (2, 1))}
        per_round.append(taken[1] / taken[2])
        for count, seconds in taken.items():
            spent[count].append(seconds)
    shown = ", ".join(
        f"{count} worker{'s' * (count > 1)} {statistics.median(row):.2f} s"
        for count, row in spent.items()
    )
    print(
        f"\n{runs} runs, 60 columns, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} "
        f"(this study included): {shown}"
    )
    print(
        f"    1 / 2 {statistics.median(per_round):6.2f}  [{min(per_round):.2f}, "
        f"{max(per_round):.2f}]   goal 1.6"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--runs", type=int, default=2000)
    settings = parser.parse_args()
    load, cores = os.getloadavg(), os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    versions = (
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    )
    print(f"{processor()}, {versions}, load {load[0]:.1f}")
    print(f"CPU time on one core, {settings.rounds} interleaved rounds, ratios as median [range]")
    with TemporaryDirectory() as folder:
        for file, text in generate_files(
            load_robot(ROBOT), targets=("numpy",), command=ROBOT
        ).items():
            Path(folder, file).write_text(text, encoding="utf-8")
        model = load_model(ROBOT, folder=Path(folder), trust=True)
        study = study_from_mapping(dataset_study(ROBOT))
        study = replace(
            study,
            cestac=replace(
                study.cestac, delta=(2 * np.pi / 5000,), rounding="two-point", side="joint"
            ),
        )
        record = read_records(study.record, model)[0]
        names = essential(model, record, study).names
        every, whole = (
            tuple(model.BASE_PARAMETERS),
            replace(study, rows=replace(study.rows, window=(None, None))),
        )
        measure("TX40 in motion, essential columns", model, record, study, names, settings.rounds)
        measure("TX40 in motion, all columns", model, record, study, every, settings.rounds)
        measure("TX40, all samples, all columns", model, record, whole, every, settings.rounds)
        os.sched_setaffinity(0, cores)
        workers(model, record, study, settings.runs, max(3, settings.rounds // 2))


if __name__ == "__main__":
    main()
