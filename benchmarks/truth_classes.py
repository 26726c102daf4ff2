"""Right studies of seven classes: causes that are named, intervals, expected error, verdict.

A question of `benchmarks/truth.py`: `python benchmarks/truth.py --question classes --seeds final`.
Class k % 7; every class has all robots by turns. docs/reliability.md has its table.

    ordinary            Fourier or chirp motion of 10 s, white torque noise of 1 or 2 %
    slow                a quarter of the speed, 16 s
    coarse encoder      500 to 2000 counts per turn at the joint, positions as counted; half of them slow
    short               3 s
    rests               point to point with stick friction, 15 to 50 % of the time at rest (truth_rests.py)
    AR(0.99)            noise that a first-order recursion with 0.99 makes, point to point
    friction left out   Stribeck friction that the model does not have
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import truth_simulator as world
from truth_rests import resting_record
from truth_shared import (
    LEVEL,
    Array,
    Row,
    among,
    deviations,
    emitted,
    markdown,
    record_of,
    robots_of,
    true_parameters,
)
from truth_simulator import Encoder, Motion, Truth, encoded, noise

import runtime
from runtime.expected import reference_states

CLASSES = ("ordinary", "slow", "coarse encoder", "short", "rests", "AR(0.99)", "friction left out")


def classes(k: int, seed: int, seeds: str) -> list[Row]:
    """One right study as `symgen identify` does it."""
    kind, robots = CLASSES[k % len(CLASSES)], robots_of(seeds)
    turn = k // len(CLASSES)
    robot = robots[turn % len(robots)]
    rng, truth = np.random.default_rng([seed, 71]), Truth(robot, seed)
    if kind == "rests":
        record, _ = resting_record(robot, truth, seed, turn)
        return [{"class": kind, "robot": robot.name, "motion": kind, **judged(record, truth, seed)}]
    motion = {"slow": "slow", "AR(0.99)": "points"}.get(kind, str(rng.choice(["fourier", "chirp"])))
    seconds = {"short": 3.0, "slow": 16.0}.get(kind, 10.0)
    if kind == "coarse encoder" and rng.uniform() < 0.5:
        motion, seconds = "slow", float(rng.choice([3.0, 10.0]))
    move = world.MOTIONS[motion](robot, seed, seconds=seconds)
    tau = truth.torque(move)
    if kind == "friction left out":
        tau = tau + stribeck(truth, move)
    share, rho = float(rng.choice([0.01, 0.02])), 0.99 if kind == "AR(0.99)" else 0.0
    q = move.q
    if kind == "coarse encoder":
        q = encoded(robot, move, Encoder(2 * pi / float(rng.choice([500, 1000, 2000]))), seed)
    record = record_of(move, tau + noise(tau, rho, share, seed), q)
    return [{"class": kind, "robot": robot.name, "motion": motion, **judged(record, truth, seed)}]


def stribeck(truth: Truth, move: Motion) -> Array:
    """What friction has above Coulomb's at low speed: half of it again, over a tenth of the speed."""
    slow = np.array([0.1 * joint.speed for joint in truth.robot.joints])
    return np.asarray(0.5 * truth.bodies.dry * np.sign(move.qd) * np.exp(-((move.qd / slow) ** 2)))


def judged(record: Any, truth: Truth, seed: int) -> Row:
    """What the identification of a record by the defaults says, beside the truth."""
    model, variants = emitted(truth.robot.name)
    result = runtime.identify(model, record, variants=variants)
    plausible = result.part("plausibility")
    causes = [one["cause"] for one in plausible.named_causes] if plausible else []
    row: Row = {"state": result.checklist.answer, "causes": causes}
    row["doubts"] = [c.question for c in result.checklist.checks if c.state in ("no", "doubtful")]
    if not (result.determined and result.usable):
        return row | {"count": 0, "inside": 0}
    fit = result.model_estimate
    X = true_parameters(truth, seed)
    expected = result.part("expected_error").expected
    full = np.zeros(len(model.BASE_PARAMETERS))
    full[[model.BASE_PARAMETERS.index(name) for name in fit.names]] = fit.X
    error = own_terms(result, truth, full)
    count, inside = held(fit, model, X)
    all_count, all_inside = held(result.estimate, model, X)
    return row | {
        "count": count, "inside": inside, "all count": all_count, "all inside": all_inside,
        "expected": expected.error, "low": expected.low, "high": expected.high, "true": error,
    }  # fmt: skip


def held(fit: Any, model: Any, X: Array) -> tuple[int, int]:
    """Number of 95 % intervals of an estimate, and of those that hold the truth."""
    s = deviations(fit)
    known = np.isfinite(s) & (s > 0)
    at = [model.BASE_PARAMETERS.index(name) for name in fit.names]
    return int(known.sum()), int((np.abs(fit.X - X[at])[known] < LEVEL * s[known]).sum())


def own_terms(result: Any, truth: Truth, X: Array) -> float:
    """True error of the estimate over the motion that the expected error speaks of, %."""
    states = reference_states(result.model, result.prepared)
    if states is None:
        return float("nan")
    tau = truth.torque(Motion(np.arange(float(len(states[0]))), *states))
    left = tau - np.asarray(result.model.regressor(*states)) @ X
    return 100 * float(np.linalg.norm(left) / np.linalg.norm(tau))


def share(part: int, whole: int) -> str:
    """A share in %, with its binomial deviation."""
    if not whole:
        return "-"
    p = part / whole
    return f"{100 * p:.1f} ± {100 * sqrt(p * (1 - p) / whole):.1f}"


def classes_table(rows: list[Row]) -> str:
    head = (
        "class", "studies", "false cause", "95 % intervals of what is printed first hold, %", "of all parameters, %",
        "90 % interval of the expected error holds, %", "Yes", "With care", "No",
    )  # fmt: skip
    lines = []
    for kind in (*CLASSES, "all"):
        own = rows if kind == "all" else among(rows, **{"class": kind})
        graded = [r for r in own if np.isfinite(r.get("true", np.nan))]
        hold = sum(r["low"] <= r["true"] <= r["high"] for r in graded)
        words = [sum(r["state"].startswith(word) for r in own) for word in ("Yes", "With", "No")]
        lines.append(
            (
                kind, len(own), sum(bool(r["causes"]) for r in own),
                *(
                    share(*(sum(r.get(f"{of}{key}", 0) for r in own) for key in ("inside", "count")))
                    for of in ("", "all ")
                ),
                share(hold, len(graded)), *words,
            )
        )  # fmt: skip
    causes = sorted({cause for r in rows for cause in r["causes"][:1]})
    return markdown(head, lines) + "".join(f"\n- named: {cause}" for cause in causes)
