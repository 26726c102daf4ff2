"""A resolution study on a Dask cluster of two workers, on two processes, and in one: wall time, and
the bits.

    python benchmarks/cluster.py [--runs 2000] [--rounds 3]

TX40 record in motion, its essential columns, two-point rounding, 2 pi/5000; `runs` runs in all. In
each round every way is taken once, in rotated order: this process alone; `--workers 2`, the start
of the other one included; a LocalCluster of two worker processes of one thread each that is already
up, one of them killed halfway in the last round. Every X and residual norm is compared bit by bit
with those of the first study. Wall time, so look at the load: with other work on two cores no ratio
above one can be expected. Goals: cluster
1.5, two workers 1.6 times faster than one.
"""

# ruff: noqa: E402 (the number of BLAS threads is set before numpy is loaded)

from __future__ import annotations

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import platform
import signal
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import distributed
import numpy as np
from rounds import processor

from runtime import Record, Study, load_model
from runtime.compose import cestac, essential
from runtime.core.cestac.cestac import Cestac
from runtime.core.model import GeneratedModel
from runtime.parallel.processes import processes
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.description import load_robot
from symgen.emit.generate import generate_files

ROBOT, DELTA = "tx40", 2 * np.pi / 5000


def prepared(folder: Path, runs: int) -> tuple[GeneratedModel, Record, Study, tuple[str, ...]]:
    """Model, record, study and the names of the columns."""
    for file, text in generate_files(load_robot(ROBOT), targets=("numpy",), command=ROBOT).items():
        Path(folder, file).write_text(text, encoding="utf-8")
    model = load_model(ROBOT, folder=folder, trust=True)
    study = study_from_mapping(dataset_study(ROBOT))
    record = read_records(study.record, model)[0]
    names = essential(model, record, study).names
    study = replace(study, cestac=replace(study.cestac, delta=(DELTA,), runs=runs))
    return model, record, study, names


def same_bits(a: Cestac, b: Cestac) -> bool:
    """Whether all runs of two studies agree."""
    return all(
        np.array_equal(x.runs.X, y.runs.X)
        and np.array_equal(x.runs.residual_norm, y.runs.residual_norm)
        for x, y in zip(a.levels, b.levels, strict=True)
    )


def kill_halfway(cluster: distributed.LocalCluster) -> Callable[[int, int], None]:
    """What ends one worker when half of the runs are done."""
    killed: list[int] = []

    def progress(done: int, total: int) -> None:
        if done >= total // 2 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    return progress


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=3)
    settings = parser.parse_args()
    print(
        f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, distributed "
        f"{distributed.__version__}"
    )
    with (
        TemporaryDirectory() as folder,
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            host="127.0.0.1",
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        model, record, study, names = prepared(Path(folder), settings.runs)

        def dask_map(function: Callable, keys: Iterable) -> Iterator:
            return (future.result() for future in client.map(function, keys))

        def way(**how: object) -> Cestac:
            return cestac(model, record, study, columns=names, **how)

        few = replace(study, cestac=replace(study.cestac, runs=8))

        def several() -> Cestac:
            with processes(2) as own_map:
                return way(map=own_map)

        def on_cluster(**how: object) -> Cestac:
            return way(map=dask_map, **how)

        cestac(model, record, few, columns=names, map=dask_map)  # workers import once
        ways: dict[str, Callable[[], Cestac]] = {
            "one process": way,
            "2 workers": several,
            "cluster of 2": on_cluster,
        }
        first, spent = None, {name: [] for name in ways}
        order = list(ways)
        for k in range(settings.rounds):
            for name in order[k % len(order) :] + order[: k % len(order)]:
                start = time.perf_counter()
                found = ways[name]()
                spent[name].append(time.perf_counter() - start)
                first = first or found
                if not same_bits(found, first):
                    raise SystemExit(f"{name}: other bits than the first study")
            print(
                f"    round {k + 1}, load {os.getloadavg()[0]:.1f}: "
                + ", ".join(f"{name} {row[-1]:.1f} s" for name, row in spent.items())
            )
        start = time.perf_counter()
        with_kill = on_cluster(progress=kill_halfway(cluster))
        seconds = time.perf_counter() - start
        if not same_bits(with_kill, first):
            raise SystemExit("one worker killed: other bits")
    print(f"{settings.runs} runs, {len(names)} columns; all of them agree in every bit")
    for name, above, goal in (
        ("cluster of 2", "one process", 1.5),
        ("2 workers", "one process", 1.6),
    ):
        ratios = [a / b for a, b in zip(spent[above], spent[name], strict=True)]
        shown = f"{statistics.median(ratios):5.2f}  [{min(ratios):.2f}, {max(ratios):.2f}]"
        print(f"    {above + ' / ' + name:28} {shown}   goal {goal}")
    print(f"    cluster with one worker killed halfway: {seconds:.1f} s, the same bits")


if __name__ == "__main__":
    main()
