"""A fixed short set of ratios, each against a peer in the same process or beside it, compared with
the ones that are checked in.

    python benchmarks/gate.py              # 1.25 times the baseline is told; twice, twice in a row, ends with 1
    python benchmarks/gate.py --write      # writes gate.json and the table in benchmarks/performance.md

Each ratio is the cost of ours over that of a peer, CPU time, median of interleaved rounds on one
core; smaller is better. Machines differ in such a ratio by a tenth or two, which the margins allow
for; a regression shows all the same. The record of the TX40 is read from the dataset cache. The
identification counts time outside the kernel: the plain way asks it for arrays of 130 MB, which
took 0.07 to 1.8 s beside 0.4 s of its own within one minute.
"""

# ruff: noqa: E402 (the number of BLAS threads is set before numpy is loaded)

from __future__ import annotations

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy.signal
from cestac_run import KEY, plain_run, task_of
from rounds import Clock, Times, interleave, user_time

from runtime import identify, load_model
from runtime.compose import essential
from runtime.core.cestac.cestac import one_run
from runtime.core.model import GeneratedModel
from runtime.reading.datasets import dataset_study, fetch
from runtime.reading.files import read_bytes
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping
from symgen.derive.derivation import derive
from symgen.description import load_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files, generate_module
from symgen.emit.spec import spec_of
from symgen.regroup.regrouping import _regrouped

HERE = Path(__file__).resolve().parent
BASELINE, PAGE = HERE / "gate.json", HERE / "performance.md"
BEGIN, END = "<!-- gate.py writes from here -->", "<!-- to here -->"
TOLD, FAILED = 1.25, 2.0
ROUNDS = 5
FILES = ("pos_read_data.csv", "curr_data.csv")


@dataclass(frozen=True)
class Ratio:
    """One line of the gate.

    Attributes
    ----------
    what, peer : str
        What is timed, and against what.
    measure : callable
        CPU seconds of both by round, {"ours": ..., "peer": ...}.
    """

    what: str
    peer: str
    measure: Callable[[], Times]

    def value(self) -> tuple[float, float, float]:
        """Median, least and largest of ours / peer over the rounds."""
        times = self.measure()
        ratios = [a / b for a, b in zip(times["ours"], times["peer"], strict=True)]
        return statistics.median(ratios), min(ratios), max(ratios)


class Command:
    """A fresh interpreter that runs one statement; `cpu`: its own user and system time."""

    def __init__(self, statement: str) -> None:
        self.statement = statement

    def __call__(self) -> None:
        subprocess.run(
            [sys.executable, "-c", self.statement], check=True, stdout=subprocess.DEVNULL
        )

    def cpu(self, repeats: int) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        for _ in range(repeats):
            self()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / repeats


def plain_job(model: GeneratedModel, study: Study, files: list[Path]) -> np.ndarray:
    """From two CSV files to all base parameters as anyone would write it: loadtxt, sosfiltfilt,
    differences, dense W, decimate, lstsq.
    """
    turned, current = (np.loadtxt(file, delimiter=",", skiprows=1) for file in files)
    ratio, rate, factor = np.array(model.DRIVES["ratio"]), 5000.0, 40
    q, tau = (
        np.linalg.solve(ratio, np.deg2rad(turned).T).T,
        current * np.array(model.DRIVES["torque_constant"]) @ ratio,
    )
    q = scipy.signal.sosfiltfilt(scipy.signal.butter(4, 50, fs=rate, output="sos"), q, axis=0)
    qd = np.gradient(q, 1 / rate, axis=0)
    qdd = np.gradient(qd, 1 / rate, axis=0)
    D = model.regressor(q, qd, qdd)
    W = np.vstack(
        [
            scipy.signal.decimate(D[:, j], factor, axis=0, zero_phase=True)
            for j in range(len(model.JOINTS))
        ]
    )
    Y = np.concatenate(
        [
            scipy.signal.decimate(tau[:, j], factor, zero_phase=True)
            for j in range(len(model.JOINTS))
        ]
    )
    return np.asarray(np.linalg.lstsq(W, Y, rcond=None)[0])


def ratios(folder: Path) -> list[Ratio]:
    """The set."""
    for file, text in generate_files(
        load_robot("tx40"), targets=("numpy",), command="tx40"
    ).items():
        (folder / file).write_text(text, encoding="utf-8")
    model, rng = load_model("tx40", folder=folder, trust=True), np.random.default_rng(0)
    q, qd, qdd = rng.uniform(-1, 1, (3, 7103, 6))
    room = model.store(7103)

    study = study_from_mapping(dataset_study("tx40"))
    files = [folder / name for name in FILES]
    for file in files:
        file.write_bytes(read_bytes(fetch("tx40", file.name)))
    read = tuple(
        replace(settings, files=tuple(map(str, files)), dataset=None) for settings in study.record
    )
    study = replace(study, record=read)

    def job() -> None:
        identify(model, read_records(study.record, model), study)

    stepped = replace(
        study,
        cestac=replace(study.cestac, delta=(2 * np.pi / 5000,), rounding="two-point", side="joint"),
    )
    record = read_records(stepped.record, model)[0]
    names = essential(model, record, stepped).names
    task = task_of(model, record, stepped, names)
    columns = task.columns

    def timed(
        ours: Callable[[], object], peer: Callable[[], object], clock: Clock = time.process_time
    ) -> Callable[[], Times]:
        return lambda: interleave({"ours": ours, "peer": peer}, ROUNDS, clock=clock)

    filled = np.zeros_like(room)

    def fill() -> None:
        filled[...] = 1.0

    def derivation(robot: Robot) -> None:
        _regrouped.cache_clear()
        spec_of.cache_clear()
        derive.cache_clear()
        generate_module(robot)

    robots = {name: load_robot(name) for name in ("tx40", "panda")}
    sympy = Command("import sympy")
    return [
        Ratio(
            "NumPy regressor, TX40, 7103 samples",
            "filling its store",
            timed(lambda: model.regressor(q, qd, qdd, out=room), fill),
        ),
        Ratio(
            "identification of the TX40 record, from two CSV files",
            "plain NumPy and SciPy",
            timed(job, lambda: plain_job(model, study, files), user_time),
        ),
        Ratio(
            "resolution run, essential columns, NumPy",
            "plain NumPy and SciPy",
            timed(lambda: one_run(columns, task, KEY), lambda: plain_run(task, KEY)),
        ),
        *(
            Ratio(
                f"derivation to text, {name}",
                "import sympy",
                timed(lambda robot=robot: derivation(robot), sympy),
            )
            for name, robot in robots.items()
        ),
        Ratio(
            "start: import runtime, first Record and Study",
            "import numpy",
            timed(
                Command(
                    "import numpy as np, runtime; t = np.arange(99) / 100; runtime.Record(t, t[:, "
                    "None], t[:, None]); runtime.Study()"
                ),
                Command("import numpy"),
            ),
        ),
        Ratio(
            "start: symgen --help",
            "import numpy",
            timed(
                Command(
                    "import sys; sys.argv = ['symgen', '--help']; from symgen.cli.main import "
                    "main; main()"
                ),
                Command("import numpy"),
            ),
        ),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="write the baseline and the table")
    write = parser.parse_args().write
    baseline = json.loads(BASELINE.read_text()) if BASELINE.exists() else {}
    found, slow = {}, []
    with TemporaryDirectory() as folder:
        for line in ratios(Path(folder)):
            value = line.value()
            was = baseline.get(line.what, value[0])
            if value[0] > FAILED * was and not write:
                value = min(value, line.value())  # once more: something else may have run beside it
            found[line.what] = value
            verdict = (
                "twice as slow"
                if value[0] > FAILED * was
                else "slower"
                if value[0] > TOLD * was
                else ""
            )
            print(
                (
                    f"{line.what:55} / {line.peer:22} {value[0]:8.3g} [{value[1]:.3g}, "
                    f"{value[2]:.3g}]  baseline {was:.3g}  {verdict}"
                ),
                flush=True,
            )
            slow += [line.what] * (verdict == "twice as slow")
            if write:
                found[line.what] = (*value, line.peer)
    if write:
        BASELINE.write_text(
            json.dumps({what: round(value[0], 4) for what, value in found.items()}, indent=1) + "\n"
        )
        rows = [
            f"| {what} | {v[3]} | {v[0]:.3g} [{v[1]:.3g}, {v[2]:.3g}] |"
            for what, v in found.items()
        ]
        head, _, rest = PAGE.read_text().partition(BEGIN)
        table = "\n".join(["", "", "| ours | peer | ours / peer |", "|---|---|---|", *rows, "", ""])
        PAGE.write_text(f"{head}{BEGIN}{table}{END}{rest.partition(END)[2]}")
        return 0
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
