"""Is an encoder that CESTAC calls good enough good enough? Errors with it and without, on simulated records.

    python benchmarks/resolution_verdicts.py --seed 1 --count 24 > benchmarks/resolution_verdicts.md

Robots of two to four joints, records of 5 s at 1 kHz, torques of pinocchio
(`benchmarks/truth_simulator.py`) with white or slow noise of 1 to 10 %; all parameters are fitted. A
study of five runs judges each parameter at four steps, from the exact positions alone. Two further
roundings, eq. (15), then give what a user of this encoder gets: estimates X, whose errors against
the true values are compared with the 95 % intervals of the study.

    z = (X - X_true)/s,    s the corrected standard deviation of the estimate without rounding

The rule of the verdict is change / max(1 %, h/10) below 1 or above 5, with +-h the 95 % interval;
that of the chapter is 1 % and 5 %, here for %sigma up to 10 %.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
import truth_simulator as world
from truth_shared import emitted, markdown, study, true_parameters
from truth_simulator import Truth, noise

import runtime
from runtime.ground.limits import LIMIT

Array = np.ndarray
ROBOTS = ("planar", "elbow", "scara", "anthropomorphic", "skewed", "snake")
STEPS = tuple(2 * pi / counts for counts in (200000, 50000, 20000, 5000))
VERDICTS = ("unbiased", "doubtful", "biased")
FURTHER = 2
"""Further roundings, each an encoder that somebody uses."""


def judged(k: int, seed: int) -> list[dict[str, Any]]:
    """One row for each parameter and step: verdicts, and z without and with the encoder."""
    rng = np.random.default_rng([seed, k])
    robot = world.ROBOTS[ROBOTS[k % len(ROBOTS)]]
    truth = Truth(robot, seed + k)
    move = world.MOTIONS[str(rng.choice(["fourier", "chirp"]))](robot, seed + k, seconds=5.0)
    tau = truth.torque(move)
    share, slow = float(rng.choice([0.01, 0.03, 0.1])), float(rng.choice([0.0, 0.95]))
    record = runtime.Record(move.t, move.q, tau + noise(tau, slow, share, seed + k))
    model, _ = emitted(robot.name)
    asked = {"columns": "all", "delta": [*STEPS], "runs": 5, "seed": 1}
    found = runtime.cestac(model, record, study(cestac=asked))
    used = runtime.cestac(model, record, study(cestac=asked | {"runs": FURTHER, "seed": 2}))
    X = true_parameters(truth)
    fit = found.reference
    s = np.fmax(fit.sigma, fit.sigma_corrected)
    rows = []
    for level, of_user in zip(found.levels, used.levels, strict=True):
        for i, name in enumerate(fit.names):
            here = X[model.BASE_PARAMETERS.index(name)]
            main = fit.relative_sigma[i] <= LIMIT.MAIN
            rows.append(
                {
                    "name": name,
                    "level": level.level.label,
                    "new": verdict(level.weighed[i]),
                    "chapter": verdict(level.e[i]) if main else "not judged",
                    "without": (fit.X[i] - here) / s[i],
                    "with": ((of_user.runs.X[:, i] - here) / s[i]).tolist(),
                }
            )
    return rows


def verdict(x: float) -> str:
    """Verdict on one parameter."""
    return VERDICTS[int(x >= LIMIT.NEGLIGIBLE) + int(x > LIMIT.BIASED)]


def line(kind: str, rows: Sequence[dict[str, Any]]) -> tuple[Any, ...]:
    """Intervals that hold the true value; median and 90 % quantile of |z|, without and with."""
    without = np.abs([row["without"] for row in rows])
    users = np.abs([z for row in rows for z in row["with"]])
    hold = [f"{100 * np.mean(z < 1.96):.1f}" for z in (without, users)]
    spread = [f"{np.median(z):.2f}, {np.quantile(z, 0.9):.2f}" for z in (without, users)]
    return (kind, len(rows), *hold, *spread)


def tables(rows: Sequence[dict[str, Any]]) -> str:
    """Write the tables of both rules, and of the parameters on which they differ."""
    head = (
        "verdict", "parameters at a step", "95 % intervals right without the encoder", "with it",
        "z without, median and 90 % quantile of its size", "with it",
    )  # fmt: skip
    out = []
    for key, title in (("new", "By the interval"), ("chapter", "By 1 % and 5 %")):
        kinds = [kind for kind in (*VERDICTS, "not judged") if any(r[key] == kind for r in rows)]
        lines = [line(kind, [r for r in rows if r[key] == kind]) for kind in kinds]
        out += [f"## {title}", markdown(head, lines)]
    pairs = sorted({(r["chapter"], r["new"]) for r in rows if r["chapter"] != r["new"]})
    lines = [
        line(f"{a}, now {b}", [r for r in rows if (r["chapter"], r["new"]) == (a, b)])
        for a, b in pairs
    ]
    return "\n\n".join([*out, "## Where the rules differ", markdown(head, lines)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=24)
    given = parser.parse_args()
    found = [row for k in range(given.count) for row in judged(k, given.seed)]
    print("# Verdicts of CESTAC beside the truth\n")
    print(f"`python benchmarks/resolution_verdicts.py --seed {given.seed} --count {given.count}`\n")
    print(tables(found))
