"""Positions read as counts where the encoder also drives the controller: simulated records of known
truth, bias and scatter beside other estimators.

    python benchmarks/counts_loop.py [--records 66] [--simulating 6] [--robots tx40 emps]

Records, loops and other estimators are those of `benchmarks/estimators.py`. OLS and WLS read as
counts know neither controller nor reference. IV and DIDIM start from WLS read as counts; "counts
iv" and "counts didim" also take W, or the rows, from the reader, "didim from counts" starts there
and does the rest by the low-pass. Estimates are kept in counts_loop_runs.jsonl; the same command
goes on from there.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import sys

import numpy as np
from estimators import AROUND, bench, determined, with_encoder

from runtime import InputError
from runtime.compose import estimate_of, problem
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.signals.filters import lowpass_filtered
from runtime.core.study import EstimateSettings, Lowpass
from runtime.counts.reading import read_counts
from runtime.ground.table import aligned
from runtime.loop.closed_loop import ClosedLoop
from runtime.study import Study

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from problems import loop_of_records

Array = np.ndarray
STEPS = {
    "tx40": [2 * np.pi / k for k in (4000, 2000, 1000, 500)],
    "emps": [2e-5, 5e-5, 1e-4],
    "haptic": [2 * np.pi / k for k in (200, 100, 50, 25)],
}
LOW, COUNTS = (
    ("ols", "wls", "iv", "didim"),
    ("counts ols", "counts wls", "counts iv", "counts didim"),
)
STARTED = "didim from counts"
BAND = {"tx40": 50.0, "emps": 100.0, "haptic": 10.0}  # Hz


def estimates(robot: str, step: float, seed: int, simulating: bool) -> list[dict[str, Any]]:
    """Estimates of one record by every method, and the calibration of the reader. simulating : iv
    and didim too, which simulate the loop.
    """
    b = bench(robot)
    run = with_encoder(robot, step).run(b.truth, b.reference, seed=seed)
    record = replace(run.record(), q_r=b.reference.q)
    signals = replace(
        b.study.signals, reader="counts", step=step, side=b.study.controller.encoder.side
    )
    study = replace(b.study, signals=signals)
    observations = {
        reader: observed(robot, record, own) for reader, own in (("", b.study), ("counts", study))
    }
    key = {"robot": robot, "step": step, "seed": seed}
    rows, start = [], {}
    for method in (
        *LOW[:2],
        *COUNTS[:2],
        *((*LOW[2:], *COUNTS[2:], STARTED) if simulating else ()),
    ):
        reader, _, kind = method.removesuffix(" from counts").rpartition(" ")
        row = {**key, "method": method}
        try:
            options: dict[str, Any] = {}
            if kind in ("iv", "didim"):
                signs = np.random.default_rng([seed, 1]).uniform(
                    -1, 1, len(b.truth)
                )  # 15 % off, as in benchmarks/estimators.py
                away = dict(
                    zip(
                        b.model.BASE_PARAMETERS,
                        (b.truth * (1 + 0.15 * signs)).tolist(),
                        strict=True,
                    )
                )
                options = {"start": start if "counts" in method else away, "gains": "one"}
            e = estimate_of(
                observations[reader], EstimateSettings(kind, options=options), model=b.model
            )
            row |= {"X": e.X.tolist(), "corrected": e.sigma_corrected.tolist(), "status": e.status}
            if method == "counts wls":
                start = dict(zip(e.names, e.X.tolist(), strict=True))
        except InputError as error:
            row |= {"status": str(error)}
        rows.append(row)
    return [
        *rows,
        {**key, "method": "calibration", "status": "ok", "X": calibration(robot, run, step)},
    ]


@cache
def first_loop(robot: str) -> ClosedLoop:
    """The loop of a record with an exact encoder: rows are chosen by the reference, so those of
    every record are the same.
    """
    b = bench(robot)
    record = with_encoder(robot, 0.0).run(b.truth, b.reference, seed=0).record()
    return loop_of_records(
        b.model, [replace(record, q_r=b.reference.q)], b.study, b.simulator, around=AROUND[robot]
    )


def observed(robot: str, record: Record, study: Study) -> Observation:
    """Rows of one record with its loop, through the filters of a study."""
    loop = first_loop(robot)
    selection = replace(loop.parts[0].selection, signals=study.signals)
    prepared = problem(bench(robot).model, record, study).prepared[0]
    part = replace(loop.parts[0], prepared=replace(prepared, selected=selection))
    return replace(loop, parts=(part,), law=()).measured()


def calibration(robot: str, run: Any, step: float) -> list[float]:
    """rms of the errors of q, qd, qdd over their stated deviations, and of the errors below BAND, where the
    arm is faster than the rows of the study need."""
    study = bench(robot).study
    law = with_encoder(robot, step).law
    reading = read_counts((run.record().q - law.offset) @ law.R.T, run.rate, step)
    N = len(reading.q)
    moving = np.abs(run.qd[:N]) > float(np.max(study.rows.low_speed))
    true = ((run.q[:N] - law.offset) @ law.R.T, run.qd[:N] @ law.R.T, run.qdd[:N] @ law.R.T)
    errors = [
        read - of for read, of in zip((reading.q, reading.qd, reading.qdd), true, strict=True)
    ]
    errors[0] = errors[0] - np.median(errors[0], axis=0)  # floor against round cannot be told
    low = Lowpass(cutoff=BAND[robot])
    slow = [lowpass_filtered(e, run.rate, low) for e in errors]
    parts = ((errors, reading), (slow, reading))
    return [
        float(np.sqrt(np.mean(((e / s)[moving]) ** 2)))
        for part, of in parts
        for e, s in zip(part, (of.s_q, of.s_qd, of.s_qdd), strict=True)
    ]


def table(rows: Sequence[dict[str, Any]], robot: str) -> str:
    """One line for each step and method: rms over the determined parameters, % of the truth."""
    kept = determined(robot)
    truth = bench(robot).truth[kept]
    lines: list[Sequence[str]] = [
        (
            "step",
            "method",
            "records",
            "not ok",
            "rms bias %",
            "largest",
            "rms scatter %",
            "scatter/corrected",
            "rms error %",
        )
    ]
    for step in STEPS[robot]:
        for method in (*LOW, *COUNTS, STARTED, "calibration"):
            mine = [
                r for r in rows if (r["robot"], r["step"], r["method"]) == (robot, step, method)
            ]
            good = [r for r in mine if r["status"] == "ok"]
            if not good:
                continue
            if method == "calibration":
                z = np.mean([r["X"] for r in good], axis=0)
                for label, part in (
                    ("", z[:3]),
                    (f" below {BAND[robot]:g} Hz", z[3:]),
                ):
                    lines.append(
                        (
                            f"{step:.3g}",
                            f"error over stated s_q, s_qd, s_qdd{label}",
                            str(len(good)),
                            "",
                            *(f"{x:.2f}" for x in part),
                            "",
                            "",
                        )
                    )
                continue
            X = 100 * (np.array([r["X"] for r in good])[:, kept] - truth) / np.abs(truth)
            stated = (
                100 * np.array([r["corrected"] for r in good])[:, kept].mean(axis=0) / np.abs(truth)
            )
            bias, scatter = X.mean(axis=0), X.std(axis=0)
            cells = (
                np.sqrt(np.mean(bias**2)),
                np.abs(bias).max(),
                np.sqrt(np.mean(scatter**2)),
                np.median(scatter / stated),
                np.sqrt(np.mean(X**2)),
            )
            lines.append(
                (
                    f"{step:.3g}",
                    method,
                    str(len(good)),
                    str(len(mine) - len(good)),
                    *(f"{x:.2f}" for x in cells),
                )
            )
    return aligned(lines)


def main() -> None:
    """Compute what is missing, print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--records", type=int, default=66)
    parser.add_argument(
        "--simulating",
        type=int,
        default=6,
        help="records on which iv and didim are tried: a minute each",
    )
    parser.add_argument("--robots", nargs="*", default=["tx40", "emps"])
    given = parser.parse_args()
    file = Path("counts_loop_runs.jsonl")
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    there = {(r["robot"], r["step"], r["seed"]) for r in rows}
    for seed in range(given.records):
        for robot in given.robots:
            for step in STEPS[robot]:
                if (robot, step, seed) not in there:
                    found = estimates(robot, step, seed, seed < given.simulating)
                    rows += found
                    with file.open("a") as out:
                        out.writelines(json.dumps(row) + "\n" for row in found)
    for robot in given.robots:
        print(robot, table(rows, robot), sep="\n")


if __name__ == "__main__":
    main()
