"""Processor time and memory of `symgen identify` against the rows of a record of six joints.

    python benchmarks/records.py [--rows 10000 30000 100000 300000 1000000 3000000]

The TX40 at 1 kHz, four sines per joint, torques with noise of 0.3 N m; from a NumPy file. Each
command is one process, of which the system tells the processor time and the largest resident set.
The kinds are: the least squares alone (ols without the check of plausibility), the command as it is
by default, and both without decimation, up to EVERY rows. The size of report.html is that of the
default. The exponents are those of what a record adds to the command with the fewest rows; the load
of the machine is printed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import symgen

RATE, NOISE = 1000.0, 0.3  # Hz, N m
EVERY = 300_000
KINDS = {
    "ols alone": ({"estimate": {"method": "ols"}}, ["--no-plausible"]),
    "default": ({}, []),
    "ols alone, every row": ({"signals": {"decimate": None}}, ["--no-plausible"]),
    "default, every row": ({"signals": {"decimate": None}}, []),
}
COMMAND = "from symgen.cli.main import main; main()"


def write_record(path: Path, N: int) -> None:
    """Write N samples of a motion, with the torques of the parameters of the robot file."""
    model, rng = symgen.model("tx40"), np.random.default_rng(0)
    n = len(model.JOINTS)
    w = 2 * np.pi * np.array([[0.09], [0.17], [0.31], [0.43]]) * rng.uniform(0.9, 1.1, (4, n))
    a, start = rng.uniform(0.1, 0.4, (4, n)), rng.uniform(0, 6, (4, n))
    t = np.arange(N) / RATE
    q, qd, qdd = np.zeros((3, N, n))
    for wk, ak, phase in zip(w, a, start, strict=True):
        angle = t[:, None] * wk + phase
        q += ak * np.sin(angle)
        qd += ak * wk * np.cos(angle)
        qdd -= ak * wk**2 * np.sin(angle)
    X = model.base_parameters(model.VALUES)
    tau = model.inverse_dynamics(q, qd, qdd, X) + rng.normal(0, NOISE, q.shape)
    columns = {f"q{j + 1}": q[:, j] for j in range(n)}
    columns |= {f"tau{j + 1}": tau[:, j] for j in range(n)}
    np.savez(path, t=t, **columns)


def cost(arguments: list[str]) -> tuple[float, float]:
    """Seconds of processor time and MB of the largest resident set of one command."""
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):  # 1: the verdict No
        raise SystemExit(f"{arguments} ended with {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def exponent(rows: list[int], values: np.ndarray) -> float:
    """Slope in a log-log figure of what the records after the first add, against their rows."""
    added = np.clip(values[1:] - values[0], 1e-3, None)
    return float(np.polyfit(np.log(np.array(rows[1:]) - rows[0]), np.log(added), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--rows",
        type=int,
        nargs="+",
        default=[10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000],
    )
    asked = parser.parse_args().rows
    with TemporaryDirectory() as name:
        folder = Path(name)
        for N in asked:
            written = get_context("spawn").Process(
                target=write_record, args=(folder / f"{N}.npz", N)
            )
            written.start()  # a command inherits the largest resident set of its parent
            written.join()
        for kind, (settings, options) in KINDS.items():
            rows = [N for N in asked if N <= EVERY or "every" not in kind]
            found = []
            for N in rows:
                study = folder / f"{N}.yaml"
                study.write_text(json.dumps({"record": {"files": [f"{N}.npz"]}, **settings}))
                found.append(cost(["identify", "tx40", str(study), *options]))
                if kind == "default":
                    cost(["identify", "tx40", str(study), "-o", str(folder / "report")])
                    size = (folder / "report" / "report.html").stat().st_size
                    print(f"{N} rows: report.html has {size / 1e6:.2f} MB")
            for what, unit, values in zip(
                ("time", "memory"), ("s", "MB"), np.array(found).T, strict=True
            ):
                told = "  ".join(f"{N}: {x:.3g} {unit}" for N, x in zip(rows, values, strict=True))
                print(f"{kind:22} {what:7} {told}  exponent {exponent(rows, values):.2f}")
            print(f"{'':22} load {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
