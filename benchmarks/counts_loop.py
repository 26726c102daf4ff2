"""Positions read as counts where the encoder also drives the controller: simulated records of known truth, bias and scatter beside other estimators.

    python benchmarks/counts_loop.py [--records 12] [--robots tx40 emps]

Records, loops and other estimators are those of `benchmarks/estimators.py`. OLS and WLS read as counts know neither controller nor reference. IV and
DIDIM start from WLS read as counts; IV also takes W from the reader. Estimates are kept in counts_loop_runs.jsonl; the same command goes on from there.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
from estimators import AROUND, Key, bench, determined, made, with_encoder

from runtime import InputError
from runtime.estimators.closed_loop import closed_loop
from runtime.estimators.methods import estimate_of
from runtime.observation.counts import read_counts
from runtime.settings.study import EstimateSettings
from runtime.table import aligned

Array = np.ndarray
STEPS = {"tx40": [2 * np.pi / k for k in (4000, 2000, 1000, 500)], "emps": [2e-5, 5e-5, 1e-4]}
LOW, COUNTS = ("ols", "wls", "iv", "didim"), ("counts ols", "counts wls", "counts iv", "counts didim")


def estimates(robot: str, step: float, seed: int, methods: Sequence[str]) -> list[dict[str, Any]]:
    """Estimates of one record by every method, and the calibration of the reader."""
    b = bench(robot)
    record, loop = made(Key(robot, step, seed, ()))
    study = replace(b.study, signals=replace(b.study.signals, reader="counts", step=step))
    by_counts = closed_loop(b.model, [replace(record, q_r=b.reference.q)], study, b.simulator, around=AROUND[robot])
    observations = {"low": loop.measured(), "counts": by_counts.measured()}
    rows, start = [], {}
    for method in ("ols", "wls", "counts ols", "counts wls", "iv", "didim", "counts iv", "counts didim"):
        reader, _, kind = method.rpartition(" ")
        if kind not in methods:
            continue
        options = {"start": start, "gains": "one"} if kind in ("iv", "didim") else {}
        row = {"robot": robot, "step": step, "seed": seed, "method": method}
        try:
            if kind in ("iv", "didim") and not reader:  # 15 % off, as in benchmarks/estimators.py
                signs = np.random.default_rng([seed, 1]).uniform(-1, 1, len(b.truth))
                options["start"] = dict(zip(b.model.BASE_PARAMETERS, (b.truth * (1 + 0.15 * signs)).tolist(), strict=True))
            e = estimate_of(observations[reader or "low"], EstimateSettings(kind, options=options), model=b.model)
            row |= {"X": e.X.tolist(), "corrected": e.sigma_corrected.tolist(), "status": e.status}
            if method == "counts wls":
                start = dict(zip(e.names, e.X.tolist(), strict=True))
        except InputError as error:
            row |= {"status": str(error)}
        rows.append(row)
    rows.append({"robot": robot, "step": step, "seed": seed, "method": "calibration", "status": "ok", "X": calibration(robot, step, seed)})
    return rows


def calibration(robot: str, step: float, seed: int) -> list[float]:
    """rms of the errors of q, qd, qdd over their stated deviations, where the arm moves faster than the rows of the study need."""
    b = bench(robot)
    run = with_encoder(robot, step).run(b.truth, b.reference, seed=seed)
    reading = read_counts(run.record().q, run.rate, step)
    slowest = float(np.max(b.study.rows.low_speed))
    moving = np.abs(run.qd[: len(reading.qd)]) > slowest
    offset = np.median(reading.q - run.q[: len(reading.q)], axis=0)  # floor against round cannot be told
    pairs = ((reading.q - offset, reading.s_q, run.q), (reading.qd, reading.s_qd, run.qd), (reading.qdd, reading.s_qdd, run.qdd))
    return [float(np.sqrt(np.mean((((x - truth[: len(x)]) / s)[moving]) ** 2))) for x, s, truth in pairs]


def table(rows: Sequence[dict[str, Any]], robot: str) -> str:
    """One line for each step and method: rms over the determined parameters, % of the truth."""
    kept = determined(robot)
    truth = bench(robot).truth[kept]
    lines: list[Sequence[str]] = [
        ("step", "method", "records", "not ok", "rms bias %", "largest", "rms scatter %", "scatter/corrected", "rms error %")
    ]
    for step in STEPS[robot]:
        for method in (*LOW, *COUNTS, "calibration"):
            mine = [r for r in rows if (r["robot"], r["step"], r["method"]) == (robot, step, method)]
            good = [r for r in mine if r["status"] == "ok"]
            if not good:
                continue
            if method == "calibration":
                z = np.mean([r["X"] for r in good], axis=0)
                lines.append((f"{step:.3g}", "error over stated s_q, s_qd, s_qdd", str(len(good)), "", *(f"{x:.2f}" for x in z), "", ""))
                continue
            X = 100 * (np.array([r["X"] for r in good])[:, kept] - truth) / np.abs(truth)
            stated = 100 * np.array([r["corrected"] for r in good])[:, kept].mean(axis=0) / np.abs(truth)
            bias, scatter = X.mean(axis=0), X.std(axis=0)
            cells = (
                np.sqrt(np.mean(bias**2)),
                np.abs(bias).max(),
                np.sqrt(np.mean(scatter**2)),
                np.median(scatter / stated),
                np.sqrt(np.mean(X**2)),
            )
            lines.append((f"{step:.3g}", method, str(len(good)), str(len(mine) - len(good)), *(f"{x:.2f}" for x in cells)))
    return aligned(lines)


def main() -> None:
    """Compute what is missing, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=12)
    parser.add_argument("--methods", nargs="*", default=["ols", "wls", "iv", "didim"])
    parser.add_argument("--robots", nargs="*", default=["tx40", "emps"])
    given = parser.parse_args()
    file = Path("counts_loop_runs.jsonl")
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    there = {(r["robot"], r["step"], r["seed"]) for r in rows}
    for seed in range(given.records):
        for robot in given.robots:
            for step in STEPS[robot]:
                if (robot, step, seed) not in there:
                    found = estimates(robot, step, seed, given.methods)
                    rows += found
                    with file.open("a") as out:
                        out.writelines(json.dumps(row) + "\n" for row in found)
    for robot in given.robots:
        print(robot, table(rows, robot), sep="\n")


if __name__ == "__main__":
    main()
