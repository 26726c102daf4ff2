"""Growth of cost: time and memory against samples, joints, columns, runs and workers, as a log-log
figure.

    python benchmarks/growth.py [-o benchmarks/growth.png] [--quick]
    python benchmarks/growth.py --trees [--joints 10 30 60 100]         # writes benchmarks/growth.md

Samples: the TX40 regressor into a reused store and the distinct signals through the decimation;
largest resident set of `symgen identify`. Joints: the trees of `trees.py`; `symgen show`, and
what `symgen generate` does by `stages.py`, as processes, their processor seconds and largest
resident set; the size of each module, and its import without a compiled copy. Runs, columns, workers: a resolution study of the TX40 with 9000 samples.

One core, one BLAS thread, CPU time, the least of three after a warm-up; workers: every core,
elapsed time. The least of three under an unknown load is good for slopes, which is what the figure
is for; ratios between contenders are measured in interleaved rounds by the other files of this
folder. The numbers of the figure are printed.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from trees import TREES

from runtime.compose import cestac
from runtime.core.model import GeneratedModel, load_model
from runtime.core.record import Record
from runtime.core.rows.regressor import Columns
from runtime.core.signals.filters import States, decimation_plan
from runtime.core.study import Decimate
from runtime.parallel.processes import processes
from runtime.study import CestacSettings, Study
from symgen.description import load_robot
from symgen.emit.generate import generate_files

SAMPLES = (1_000, 10_000, 100_000, 1_000_000)
JOINTS = (10, 30, 60, 100)
SIZES = ("show, s", "generate, s", "generate, MB", "module, KB", "import, s")
RUNS = (4, 16, 64, 256)
COLUMNS = (3, 6, 12, 24, 60)
WORKERS = (1, 2, 4, 8)  # as many as there are cores
Curves = dict[str, list[tuple[float, float]]]  # label: points


def least(function: Callable[[], object], repeats: int = 3) -> float:
    """Least CPU time of some calls, after one that is not counted."""
    function()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def emitted(name: str, folder: Path) -> GeneratedModel:
    """The module of a packaged robot."""
    for file, text in generate_files(load_robot(name), targets=("numpy",), command=name).items():
        (folder / file).write_text(text, encoding="utf-8")
    return load_model(name, folder=folder, trust=True)


def motion(N: int, n: int) -> States:
    return States(*np.random.default_rng(N).uniform(-2, 2, (3, N, n)))


def evaluation(model: GeneratedModel, states: States) -> float:
    """Seconds of a regressor into a store already in use."""
    out = model.store(len(states))
    return least(lambda: model.regressor(states.q, states.qd, states.qdd, out=out))


def by_samples(models: dict[str, GeneratedModel], samples: tuple[int, ...]) -> Curves:
    """Seconds of a regressor, and of the decimated signals."""
    found: Curves = {}
    for label, model in models.items():
        for N in samples:
            states = motion(N, len(model.JOINTS))
            found.setdefault(f"regressor, {label}", []).append((N, evaluation(model, states)))
            columns = Columns(model)
            columns.entries  # noqa: B018 (found once)
            plan = decimation_plan(N, 40, Decimate(factor=40))
            found.setdefault(f"decimated signals, {label}", []).append(
                (N, least(lambda: list(columns.signals(states, plan))))  # noqa: B023
            )
    return found


def process(folder: Path, *arguments: str, codes: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """Processor seconds of a command of Python, and its largest resident set in MB; at least that of
    this process, which it inherits.
    """
    started = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode not in codes:
        raise RuntimeError(f"{' '.join(arguments)} ended with {started.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6


def memory(folder: Path, model: GeneratedModel, samples: tuple[int, ...]) -> Curves:
    """MB of `symgen identify`, and what W would take at every sample."""
    path, columns = folder / "record.npz", np.arange(1, 7)
    found: Curves = {"identification": [], "W at every sample (never formed)": []}
    for N in samples:
        t = np.arange(N) / 1000.0
        q = np.sin(t[:, None] * columns)
        states = q, columns * np.cos(t[:, None] * columns), -(columns**2) * q
        tau = model.inverse_dynamics(*states, model.base_parameters(model.VALUES))
        named = {f"q{j}": q[:, j - 1] for j in columns} | {
            f"tau{j}": tau[:, j - 1] for j in columns
        }
        np.savez(path, t=t, **named)
        _, peak = process(  # the verdict may be no
            folder, "-m", "symgen", "identify", "tx40", str(path), "--no-plausible", codes=(0, 1)
        )
        found["identification"].append((N, peak))
        W = 8 * 6 * len(model.BASE_PARAMETERS) * N
        found["W at every sample (never formed)"].append((N, W / 1e6))
    return found


def by_joints(folder: Path, joints: tuple[int, ...]) -> dict[str, dict[str, Curves]]:
    """Seconds and MB of commands and of the stages of `generate`, {size: {shape: points}}."""
    commands: dict[str, Curves] = {name: {} for name in SIZES}
    stages: dict[str, Curves] = {}
    stager = str(Path(__file__).with_name("stages.py"))
    for shape, written in TREES.items():
        for n in joints:
            out = folder / f"{shape}{n}"
            out.mkdir()
            (out / "robot.yaml").write_bytes(written(n))
            show, _ = process(out, "-m", "symgen", "show", "robot.yaml")
            seconds, _ = process(out, stager, "robot.yaml", "-o", ".")
            spent = json.loads((out / "stages.json").read_text())
            peak = max(x for _, x in spent.values())  # each stage sets that of the process back
            size = (out / f"{shape}{n}.py").stat().st_size / 1e3
            imported, _ = process(out, "-B", "-c", f"import {shape}{n}")
            sizes = show, seconds, peak, size, imported
            for name, x in zip(SIZES, sizes, strict=True):
                commands[name].setdefault(shape, []).append((n, x))
            for stage, used in spent.items():
                for unit, x in zip(("s", "MB"), used, strict=True):
                    stages.setdefault(f"{stage}, {unit}", {}).setdefault(shape, []).append((n, x))
            print(shape, n, *(f"{x:.3g}" for x in sizes), flush=True)
    return {"commands": commands, "stages": stages}


def table(title: str, curves: Curves) -> list[str]:
    """Rows of sizes by joints, and the exponent of the last two."""
    joints = [n for n, _ in next(iter(curves.values()))]
    lines = [f"| {title} | {' | '.join(f'{n:g}' for n in joints)} | exponent |"]
    lines.append("|---|" + "---|" * (len(joints) + 1))
    for name, points in curves.items():
        sizes = " | ".join(f"{size:.3g}" for _, size in points)
        told = f"{slope(points[-2:]):.2f}" if min(size for _, size in points[-2:]) > 0 else ""
        lines.append(f"| {name} | {sizes} | {told} |")
    return [*lines, ""]


def table_of_trees(found: dict[str, dict[str, Curves]], load: str) -> str:
    """The page growth.md."""
    lines = [
        "# Growth with the joints",
        "",
        "Written by `python benchmarks/growth.py --trees`, which says what is measured; the trees are those of `trees.py`, the stages those of `stages.py`.",
        f"One run of each, two virtual cores, load average {load}.",
        "Exponents are those of the two largest trees; the start of Python, some 0.3 s, is in all seconds of commands.",
        "",
    ]
    for shape in TREES:
        for kind, sizes in found.items():
            title = shape if kind == "commands" else f"{shape}, stage of generate"
            lines += table(title, {name: curves[shape] for name, curves in sizes.items()})
    return "\n".join(lines)


def study_record() -> Record:
    """The record of the resolution studies: a motion and random torques."""
    rng, N, n = np.random.default_rng(5), 9000, 6
    t = np.arange(N) / 5000
    w = 2 * np.pi * rng.uniform(0.3, 2.5, (5, n))
    q = (
        rng.uniform(-0.4, 0.4, (5, n)) * np.sin(w * t[:, None, None] + rng.uniform(0, 6, (5, n)))
    ).sum(1)
    return Record(t=t, q=q, tau=rng.standard_normal((N, n)), rate=5000.0, name="motion")


def by_runs(models: dict[str, GeneratedModel], record: Record, runs: tuple[int, ...]) -> Curves:
    """Seconds of a resolution study."""
    found: Curves = {}
    for label, model in models.items():
        for R in runs:
            study = Study(cestac=CestacSettings(delta=(1e-3,), runs=R, columns="all"))
            found.setdefault(label, []).append((R, least(lambda: cestac(model, record, study), 1)))  # noqa: B023
    return found


def by_columns(
    models: dict[str, GeneratedModel], record: Record, columns: tuple[int, ...], runs: int
) -> Curves:
    """Seconds of a resolution study of some columns, spread over all."""
    found: Curves = {}
    for label, model in models.items():
        for b in columns:
            own = np.linspace(0, len(model.BASE_PARAMETERS) - 1, b).round().astype(int)
            study = Study(
                cestac=CestacSettings(
                    delta=(1e-3,), runs=runs, columns=[model.BASE_PARAMETERS[k] for k in own]
                )
            )
            found.setdefault(label, []).append((b, least(lambda: cestac(model, record, study), 1)))  # noqa: B023
    return found


def by_workers(
    models: dict[str, GeneratedModel], record: Record, workers: tuple[int, ...], runs: int
) -> Curves:
    """Elapsed seconds of a resolution study by several processes, their start included."""
    found: Curves = {}
    for label, model in models.items():
        for count in workers:
            start = time.perf_counter()
            settings = CestacSettings(delta=(1e-3,), runs=runs, columns="all")
            with processes(count) as several:
                cestac(model, record, Study(cestac=settings), map=several)
            found.setdefault(label, []).append((count, time.perf_counter() - start))
    return found


def slope(points: list[tuple[float, float]]) -> float:
    """Exponent of the growth over the last three points."""
    upper = points[-3:]
    (x, y) = np.log(np.array(upper)).T
    return float(np.polyfit(x, y, 1)[0])


def panel(axes: object, curves: Curves, x: str, y: str) -> None:
    print(f"\n{y} against {x}")
    for k, (label, points) in enumerate(curves.items()):
        exponent = slope(points)
        axes.loglog(
            *zip(*points, strict=True),
            marker="o",
            ms=3,
            lw=1.2,
            ls="-" if k % 2 == 0 else "--",
            label=f"{label}  ({exponent:.2f})",
        )  # type: ignore[attr-defined]
        print(
            f"  {label:32} exponent {exponent:5.2f}   "
            + "  ".join(f"{a:g}: {b:.3g}" for a, b in points)
        )
    axes.set(xlabel=x, ylabel=y)  # type: ignore[attr-defined]
    if not x.startswith("samples"):
        counts = (
            [10, 30, 60, 100]
            if x == "joints"
            else [count for count, _ in next(iter(curves.values()))]
        )
        axes.set_xticks(counts, list(map(str, counts)))  # type: ignore[attr-defined]
    for axis in (axes.xaxis, axes.yaxis):  # type: ignore[attr-defined]
        axis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", lw=0.4, alpha=0.6)  # type: ignore[attr-defined]
    title = f"(exponent over the last {min(3, max(map(len, curves.values())))} points)"
    axes.legend(fontsize=7, frameon=False, title=title, title_fontsize=6.5)  # type: ignore[attr-defined]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("benchmarks/growth.png"))
    parser.add_argument("--quick", action="store_true", help="few points, to see whether it runs")
    parser.add_argument("--trees", action="store_true", help="only the trees, into growth.md")
    parser.add_argument("--joints", type=int, nargs="+", default=JOINTS, metavar="N")
    arguments = parser.parse_args()
    samples, joints, runs, columns = (
        (SAMPLES[:3], (10, 20), RUNS[:2], COLUMNS[-3:])
        if arguments.quick
        else (SAMPLES, tuple(arguments.joints), RUNS, COLUMNS)
    )
    cores = os.sched_getaffinity(0)
    workers = (
        WORKERS[:2]
        if arguments.quick or len(cores) < 2
        else tuple(count for count in WORKERS if count <= len(cores))
    )
    os.sched_setaffinity(0, {max(cores)})
    with TemporaryDirectory() as name:
        folder = Path(name)
        trees = by_joints(folder, joints)  # first, like the next
        if arguments.trees:
            load = "{:.1f}, {:.1f}, {:.1f}".format(*os.getloadavg())
            page = Path(__file__).with_name("growth.md")
            page.write_text(table_of_trees(trees, load), encoding="utf-8")
            print(page)
            return
        model = emitted("tx40", folder)
        models = {"NumPy": model}
        peaks = memory(
            folder, model, samples[1:]
        )  # first: a process inherits the largest resident set of the one that starts it
        figure, record = Figure(figsize=(14.5, 6.6), layout="constrained"), study_record()
        axes = figure.subplots(2, 4).ravel()
        axes[7].axis("off")
        panel(axes[0], by_samples(models, samples), "samples, TX40", "CPU time, s")
        panel(axes[1], peaks, "samples, TX40", "peak memory of an identification, MB")
        panel(
            axes[2],
            by_runs(models, record, runs),
            "runs of 9000 samples, TX40",
            "CPU time of a resolution study, s",
        )
        panel(
            axes[3],
            by_columns(models, record, columns, runs[-2]),
            f"columns, {runs[-2]} runs, TX40",
            "CPU time of a resolution study, s",
        )
        panel(axes[4], trees["commands"]["generate, s"], "joints", "CPU time of symgen generate, s")
        panel(
            axes[5],
            trees["commands"]["generate, MB"],
            "joints",
            "peak memory of symgen generate, MB",
        )
        os.sched_setaffinity(0, cores)
        elapsed = by_workers(models, record, workers, runs[-1])
        panel(
            axes[6],
            elapsed,
            f"workers, {len(cores)} cores, {runs[-1]} runs, TX40",
            "elapsed time of a resolution study, s",
        )
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.output, dpi=130)
    print(f"\n{arguments.output}")


if __name__ == "__main__":
    main()
