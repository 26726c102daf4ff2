"""The whole identification job of the TX40 against figaroh's on the same record: from two CSV files
to base parameters with their deviations.

    python -m venv FOLDER && FOLDER/bin/pip install figaroh
    python benchmarks/figaroh_job.py --figaroh FOLDER/bin/python [--rounds 7]        needs the record `tx40`: SYMGEN_DATA, or be on line

Both read the same files, take the motor side to the joints, cut the record at 7.5 s, filter (median
5, Butterworth of order 4 at 50 Hz on the positions, which is what figaroh filters), differentiate
twice, evaluate the regressor with friction, actuators, offsets and the coupled wrist, decimate by
40 with zero phase, and solve by ordinary least squares. Differences that stay: figaroh pads its
median with zeros and cuts the record before it filters, and does not filter torques by the median
(here they are taken through it, which costs more); it finds its base parameters by QR in every job,
here they are known from the generation; its wrist has one parameter more (Iam6 apart from Ia6).
figaroh's report of the result is counted, ours (%sigma, residuals by joint) too.

First the results are compared: relative error, and the predicted torques of both against each
other. Then each round runs every contender once, in rotated order, pinned to one core, one BLAS
thread, CPU time without imports; ratios are taken per round and given as median [range], of the
whole job and of what follows the reading of the files, which is half of ours.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy, and for figaroh

import numpy as np

from runtime.compose import estimate_of, observe
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel, load_model
from runtime.core.rows.observation import Observation
from runtime.core.study import Decimate, Lowpass
from runtime.reading.datasets import dataset_study, fetch
from runtime.reading.files import read_bytes
from runtime.reading.records import read_records
from runtime.study import Rows, Signals, Study, study_from_mapping
from symgen.description import load_robot
from symgen.emit.generate import generate_files

END, FACTOR, CUTOFF = 7.5, 40, 50.0  # s, n_d, Hz
FILES = ("pos_read_data.csv", "curr_data.csv")


def study_of(files: list[str]) -> Study:
    given = study_from_mapping(dataset_study("tx40"))
    records = tuple(replace(record, files=tuple(files), dataset=None) for record in given.record)
    signals = Signals(
        median=5,
        torque_median=5,
        lowpass=Lowpass(cutoff=CUTOFF, on=("q",)),
        decimate=Decimate(factor=FACTOR),
    )
    return replace(given, record=records, signals=signals, rows=Rows(window=(0.0, END), trim=0))


@dataclass(frozen=True)
class Done:
    """CPU seconds of one job, and those of reading its files."""

    seconds: float
    reading: float

    @property
    def rest(self) -> float:
        return self.seconds - self.reading


def job(model: GeneratedModel, study: Study) -> tuple[Done, Observation, Estimate]:
    """From files to parameters and their deviations."""
    start = time.process_time()
    record = read_records(study.record, model)[0]
    read = time.process_time()
    observation = observe(model, record, study)
    found = estimate_of(observation, study.estimate, model=model)
    return Done(time.process_time() - start, read - start), observation, found


class Figaroh:
    """figaroh in a process of its own."""

    def __init__(self, python: str, settings: dict[str, Any]) -> None:
        worker = Path(__file__).with_name("figaroh_worker.py")
        self.process = subprocess.Popen(
            [python, str(worker)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._write(json.dumps(settings))

    def _write(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def ask(self, line: str) -> dict[str, Any]:
        self._write(line)
        assert self.process.stdout is not None
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit("figaroh stopped; its message stands above")
        return dict(json.loads(answer))


def settings_of(files: list[str], study: Study) -> dict[str, Any]:
    robot = load_robot("tx40")
    value = robot.constants
    assert robot.drives is not None
    return {
        "files": files,
        "frames": [
            (f.j, f.ant, f.alpha.value(value), f.d.value(value), f.r.value(value))
            for f in robot.frames
        ],
        "gravity": [e.value(value) for e in robot.gravity],
        "ratio": robot.drives.ratio,
        "offset": robot.drives.offset,
        "truncate": [0, int(END * 5000) + 1],
        "factor": FACTOR,
        "filter": {"nbutter": 4, "f_butter": CUTOFF, "med_fil": 5, "f_sample": 5000},
    }


def compare(observation: Observation, found: Estimate, other: dict[str, Any]) -> None:
    """Relative errors of both, and predicted torques against each other, on rows away from the
    ends.
    """
    n = observation.n
    W = observation.W
    ours, Y = (W @ found.X).reshape(n, -1), observation.Y.reshape(n, -1)
    theirs, Y_theirs = (np.array(other[key]).reshape(n, -1) for key in ("predicted", "Y"))
    K = min(ours.shape[1], theirs.shape[1])
    inside = slice(3, K - 3)
    norm = np.linalg.norm
    print(f"parameters        {len(found.X)} and {other['parameters']}")
    print(
        f"relative error    {found.relative_error:.3f} % and "
        f"{100 * norm(Y_theirs - theirs) / norm(Y_theirs):.3f} %"
    )
    print(
        f"measured torques  differ by {100 * norm((Y - Y_theirs[:, :K])[:, inside]) / norm(Y):.3f} "
        "% (the median on ours)"
    )
    print(
        "predicted torques differ by "
        f"{100 * norm((ours[:, :K] - theirs[:, :K])[:, inside]) / norm(Y):.3f} % of the measured "
        "ones\n"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figaroh", default=sys.executable, help="a Python that has figaroh")
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    if subprocess.run([arguments.figaroh, "-c", "import figaroh"], check=False).returncode:
        sys.exit(f"{arguments.figaroh} has no figaroh; see the head of this file")
    load = os.getloadavg()[0]
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with TemporaryDirectory() as folder:
        files = []
        for name in FILES:
            (Path(folder) / name).write_bytes(read_bytes(fetch("tx40", name)))
            files.append(str(Path(folder) / name))
        for name, text in generate_files(
            load_robot("tx40"), targets=("numpy",), command="tx40"
        ).items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        study = study_of(files)
        model = load_model("tx40", folder=Path(folder), trust=True)
        figaroh = Figaroh(arguments.figaroh, settings_of(files, study))
        contenders: dict[str, Callable[[], Done]] = {
            "figaroh": lambda: Done(**figaroh.ask("run")),
            "symgen, NumPy": lambda: job(model, study)[0],
        }
        for run in contenders.values():
            run()
        compare(*job(model, study)[1:], figaroh.ask("result"))
        times: dict[str, list[Done]] = {name: [] for name in contenders}
        for r in range(arguments.rounds):
            for k in range(len(contenders)):
                name = list(contenders)[(k + r) % len(contenders)]
                times[name].append(contenders[name]())
        figaroh.process.terminate()
    print(f"CPU time on one core, {arguments.rounds} rounds, load at the start {load:.1f}")
    for name, row in times.items():
        print(f"{name:14} {milliseconds(row, 'seconds')} ms, of which reading {milliseconds(row, 'reading')}   "
              f"figaroh / it: whole {spread(times['figaroh'], row, 'seconds')}, after reading {spread(times['figaroh'], row, 'rest')}")  # fmt: skip


def milliseconds(row: list[Done], part: str) -> str:
    return f"{1e3 * statistics.median(getattr(done, part) for done in row):.0f}"


def spread(above: list[Done], below: list[Done], part: str) -> str:
    ratios = [getattr(a, part) / getattr(b, part) for a, b in zip(above, below, strict=True)]
    return f"{statistics.median(ratios):.1f} [{min(ratios):.1f}, {max(ratios):.1f}]"


if __name__ == "__main__":
    main()
