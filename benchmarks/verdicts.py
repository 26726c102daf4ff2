"""Verdicts on right studies of eleven classes and on wrong studies with one error each.

    python benchmarks/verdicts.py right --seed 1000 --count 264 -o right.json
    python benchmarks/verdicts.py wrong --seed 1000 --count 64 -o wrong.json
    python benchmarks/verdicts.py table right.json wrong.json > benchmarks/verdicts.md

Robots of two to four joints, records of 3 to 8 s at 250 Hz, every setting its default. Torques are
pinocchio's (`benchmarks/truth_simulator.py`) plus the friction below; nothing is shared with
symgen or runtime. The robot file has bodies that are some 25 % off, unless a wrong study says so.

    ordinary            Fourier or chirp motion, white torque noise of 1 or 2 %
    slow                a twelfth of the speed
    coarse encoder      500 to 2000 counts per turn at the joint
    short               3 s
    rests               point to point, a quarter of the time at rest; stiction holds the joint
    AR(0.99)            slow torque noise
    friction left out   Stribeck: half of FS again, over a tenth of the speed
    load friction       FL |tau_r| sign(qd), FL .03 to .1, tau_r the rigid torque
    cogging             3 to 8 % of the torque, c sin(k q + phase), k 1 to 12
    Dahl                hysteresis in place of FS: F' = s qd (1 - F sign(qd)/FS), FS/s .01 to .05
    backlash            the encoder is off by half a gap of .002 to .01 towards the torque

The true error is that of predicted torques over the motions that the expected error speaks of.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import truth_simulator as world
from scipy.signal import lfilter
from truth_shared import emitted, markdown, true_parameters
from truth_simulator import Encoder, Motion, Robot, Truth, encoded, noise

import runtime
from runtime.expected import reference_states

Array = np.ndarray
Row = dict[str, Any]
CLASSES = (
    "ordinary", "slow", "coarse encoder", "short", "rests", "AR(0.99)", "friction left out",
    "load friction", "cogging", "Dahl", "backlash",
)  # fmt: skip
SMALL = ("planar", "elbow", "scara", "anthropomorphic", "skewed", "cylindrical", "rail", "snake")
EVERY = 4
"""Samples of the simulation between two of a record."""
FRICTION = re.compile(r"(FV|FS|OFFSET)\d+")


# Friction that the model lacks -------------------------------------------------------------------


@dataclass(frozen=True)
class World:
    """A robot and what its joints do besides FV qd + FS sign(qd).

    Attributes
    ----------
    truth : Truth
    kind : str
        The class.
    size, order, phase : ndarray, shape (n,)
        Size of the effect, by class; order and phase of cogging.
    """

    truth: Truth
    kind: str
    size: Array
    order: Array
    phase: Array

    @classmethod
    def of(cls, truth: Truth, kind: str, rng: np.random.Generator) -> World:
        n = truth.robot.n
        low, high = {
            "load friction": (0.03, 0.10), "cogging": (0.03, 0.08), "Dahl": (0.01, 0.05),
            "backlash": (0.002, 0.01),
        }.get(kind, (0.0, 0.0))  # fmt: skip
        size = rng.uniform(low, high, n)
        return cls(truth, kind, size, rng.integers(1, 13, n), rng.uniform(0, 2 * pi, n))

    def torque(self, move: Motion, rms: Array) -> Array:
        """Torques, (N, n), of states; rms : of the rigid torques of the record, (n,)."""
        truth, qd = self.truth, move.qd
        tau = truth.torque(move)
        dry = truth.bodies.dry * np.sign(qd)
        if self.kind == "friction left out":
            slow = np.array([0.1 * joint.speed for joint in truth.robot.joints])
            tau = tau + 0.5 * dry * np.exp(-((qd / slow) ** 2))
        if self.kind == "load friction":
            tau = tau + self.size * np.abs(self.rigid(move)) * np.sign(qd)
        if self.kind == "cogging":
            turns = np.where(truth.robot.slides, 20.0, 1.0)
            tau = tau + self.size * rms * np.sin(self.order * turns * move.q + self.phase)
        return tau

    def rigid(self, move: Motion) -> Array:
        return self.truth.torque(move) - self.truth.friction(move.qd)

    def recorded(self, move: Motion, seed: int) -> tuple[Array, Array]:
        """Positions and torques of a record without noise, (N, n) each."""
        truth, rigid = self.truth, self.rigid(move)
        q, tau = move.q, self.torque(move, rms_of(rigid))
        dry, metres = truth.bodies.dry, np.where(truth.robot.slides, 0.1, 1.0)
        if self.kind == "Dahl":
            tau = tau - dry * np.sign(move.qd) + dahl(move.qd, dry, self.size * metres)
        if self.kind == "backlash":
            side = lfilter([0.2], [1, -0.8], np.sign(rigid), axis=0)
            q = q + 0.5 * self.size * metres * side
        if self.kind == "rests":  # held by friction, at a part of it that chance decides
            rng, still = np.random.default_rng([seed, 41]), move.qd == 0
            start = np.diff(still.astype(int), axis=0, prepend=0) == 1
            part = np.where(start, rng.uniform(-0.9, 0.9, move.q.shape), 0.0)
            index = np.maximum.accumulate(np.where(start, np.arange(len(part))[:, None], 0), axis=0)
            tau = tau + np.where(still, dry * np.take_along_axis(part, index, axis=0), 0.0)
        return q, tau


def rms_of(x: Array) -> Array:
    return np.asarray(np.sqrt((x**2).mean(axis=0)))


def dahl(qd: Array, dry: Array, way: Array) -> Array:
    """Dahl's friction, exact over each step of constant velocity; way = FS/s, rad or m."""
    F, out = np.zeros(qd.shape[1]), np.empty_like(qd)
    for k, v in enumerate(qd):
        end = dry * np.sign(v)
        F = end + (F - end) * np.exp(-np.abs(v) / way / world.RATE)
        out[k] = F
    return out


# Right studies -----------------------------------------------------------------------------------


def right(k: int, seed: int) -> Row:
    """One right study, as `symgen identify` does it."""
    kind = CLASSES[k % len(CLASSES)]
    robot = world.ROBOTS[SMALL[(k // len(CLASSES)) % len(SMALL)]]
    rng = np.random.default_rng([seed, k])
    truth = Truth(robot, seed + k)
    own = World.of(truth, kind, rng)
    motion = {"slow": "slow", "rests": "points"}.get(kind, str(rng.choice(["fourier", "chirp"])))
    seconds = {"short": 3.0, "rests": 8.0, "slow": 8.0}.get(kind, float(rng.choice([5.0, 8.0])))
    move = world.MOTIONS[motion](robot, seed + k, seconds=seconds)
    q, tau = own.recorded(move, seed + k)
    rho = 0.99 if kind == "AR(0.99)" else 0.0
    tau = tau + noise(tau, rho, float(rng.choice([0.01, 0.02])), seed + k)
    if kind == "coarse encoder":
        q = encoded(robot, move, Encoder(2 * pi / float(rng.choice([500, 1000, 2000]))), seed + k)
    model, variants = emitted(robot.name)
    result = runtime.identify(model, record_of(move.t, q, tau), variants=variants)
    row = {"class": kind, "robot": robot.name, "motion": motion, "seed": seed, "k": k}
    return row | told(result) | measured(result, own, rms_of(own.rigid(move)))


def record_of(t: Array, q: Array, tau: Array) -> Any:
    return runtime.Record(t[::EVERY], q[::EVERY], tau[::EVERY])


def told(result: Any) -> Row:
    """What an identification says."""
    plausible = result.part("plausibility")
    causes = [one["cause"] for one in plausible.named_causes] if plausible else []
    checks = [c for c in result.checklist.checks if c.state in ("no", "doubtful")]
    return {
        "answer": result.checklist.answer, "causes": causes, "doubt": result.checklist.doubt,
        "next": result.checklist.next, "doubts": [f"{c.question} {c.finding}" for c in checks],
        "fit": result.model_estimate.relative_error, "unseen": result.prediction_error,
    }  # fmt: skip


def measured(result: Any, own: World, rms: Array) -> Row:
    """The result beside the truth: error over other motions, %, and intervals."""
    if not (result.determined and result.usable):
        return {}
    model, row = result.model, Row()
    X = true_parameters(own.truth)
    for name, fit in (("all", result.estimate), ("first", result.model_estimate)):
        at = [model.BASE_PARAMETERS.index(one) for one in fit.names]
        s = np.asarray(fit.sigma_corrected)
        known = np.isfinite(s) & (s > 0)
        inside = np.abs(fit.X - X[at]) < 1.96 * s
        bodies = np.array([not FRICTION.fullmatch(one) for one in fit.names])
        for group, mask in (("", known), (" bodies", known & bodies)):
            row[f"{name}{group}"] = [int(inside[mask].sum()), int(mask.sum())]
        size = np.abs(X[at])
        row[f"{name} width"] = float(np.median((s / np.where(size > 0, size, np.inf))[known]))
    states = reference_states(model, result.prepared)
    fit, expected = result.model_estimate, result.part("expected_error").expected
    if states is None:
        return row
    tau = own.torque(Motion(np.arange(float(len(states[0]))), *states), rms)
    full = np.zeros(len(model.BASE_PARAMETERS))
    full[[model.BASE_PARAMETERS.index(one) for one in fit.names]] = fit.X
    left = tau - np.asarray(model.regressor(*states)) @ full
    error = 100 * float(np.linalg.norm(left) / np.linalg.norm(tau))
    return row | {
        "true": error, "expected": expected.error, "low": expected.low, "high": expected.high,
    }  # fmt: skip


# Wrong studies -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Given:
    """What a user gives: positions and torques, (N, n) each, and the true robot."""

    q: Array
    tau: Array
    robot: Robot
    rate: float = 1.0


Slip = tuple[str, str, Callable[[Given, int, np.random.Generator], Given]]
"""An error: its name, what names it, and what it does to a record at joint j."""


def only(j: int, n: int, factor: float) -> Array:
    return np.where(np.arange(n) == j, factor, 1.0)


def late(x: Array, by: int) -> Array:
    return np.concatenate([np.repeat(x[:1], by, axis=0), x[:-by]])


def turned(g: Given, j: int, degrees: float) -> Given:
    return replace(g, q=g.q + np.deg2rad(degrees) * (np.arange(g.robot.n) == j))


def exchanged(x: Array, j: int) -> Array:
    order = np.arange(x.shape[1])
    i = (j + 1) % len(order)
    order[[i, j]] = order[[j, i]]
    return x[:, order]


SLIPS: tuple[Slip, ...] = (
    ("sign of a torque", r"sign", lambda g, j, r: replace(g, tau=g.tau * only(j, g.robot.n, -1))),
    ("sign of a position", r"sign", lambda g, j, r: replace(g, q=g.q * only(j, g.robot.n, -1))),
    ("all torques negative", r"sign", lambda g, j, r: replace(g, tau=-g.tau)),
    ("two torques exchanged", r"exchanged|order", lambda g, j, r: replace(g, tau=exchanged(g.tau, j))),
    ("two positions exchanged", r"exchanged|order", lambda g, j, r: replace(g, q=exchanged(g.q, j))),
    ("positions in degrees", r"degree|deg\b", lambda g, j, r: replace(g, q=np.rad2deg(g.q))),
    ("a torque times 2", r"torque|values of the robot", lambda g, j, r: replace(g, tau=g.tau * only(j, g.robot.n, 2))),
    ("a torque times 0.5", r"torque|values of the robot", lambda g, j, r: replace(g, tau=g.tau * only(j, g.robot.n, 0.5))),
    ("a position times 0.8", r"position of joint|ratio", lambda g, j, r: replace(g, q=g.q * only(j, g.robot.n, 0.8))),
    ("gear ratio times 1.25", r"ratio|position of joint", lambda g, j, r: replace(g, q=g.q / only(j, g.robot.n, 1.25), tau=g.tau * only(j, g.robot.n, 1.25))),
    ("gear ratio times 0.7", r"ratio|position of joint", lambda g, j, r: replace(g, q=g.q / only(j, g.robot.n, 0.7), tau=g.tau * only(j, g.robot.n, 0.7))),
    ("zero off by 15 degrees", r"zero of joint|offset of joint", lambda g, j, r: turned(g, j, 15)),
    ("zero off by 90 degrees", r"zero of joint|offset of joint|90 degrees", lambda g, j, r: turned(g, j, 90)),
    ("rate times 1.25", r"sampling rate|rate is", lambda g, j, r: replace(g, rate=1.25)),
    ("rate times 0.5", r"sampling rate|rate is", lambda g, j, r: replace(g, rate=0.5)),
    ("all torques 40 ms late", r"late|delay", lambda g, j, r: replace(g, tau=late(g.tau, 40))),
)  # fmt: skip


def wrong(k: int, seed: int) -> Row:
    """One wrong study: an error of SLIPS in a record that is right otherwise."""
    name, pattern, slip = SLIPS[k % len(SLIPS)]
    robot = world.ROBOTS[
        ("anthropomorphic", "skewed", "snake", "scara", "wrist")[k // len(SLIPS) % 5]
    ]
    rng = np.random.default_rng([seed, 7, k])
    truth = Truth(robot, seed + k)
    move = world.fourier(robot, seed + k, seconds=6.0)
    tau = truth.torque(move)
    tau = tau + noise(tau, 0.0, 0.01, seed + k)
    turning = np.flatnonzero(~robot.slides)
    j = int(rng.choice(turning[turning > 0]))
    given = slip(Given(move.q, tau, robot), j, rng)
    model, variants = emitted(robot.name)
    row = {"class": name, "robot": robot.name, "joint": j + 1, "seed": seed, "k": k}
    try:
        record = record_of(move.t / given.rate, given.q, given.tau)
        said = told(runtime.identify(model, record, variants=variants))
    except runtime.InputError as e:
        said = {"answer": "refused", "causes": [], "doubt": str(e), "next": "", "doubts": [str(e)]}
    first = said["causes"][0] if said["causes"] else f"{said['doubt']} {said['next']}"
    row["right"] = bool(re.search(pattern, first))
    row["among"] = any(re.search(pattern, text) for text in (*said["causes"], *said["doubts"]))
    row["alone"] = bool(said["causes"]) and not any(re.search(pattern, c) for c in said["causes"])
    return row | said


# Tables ------------------------------------------------------------------------------------------


def share(pairs: Sequence[Sequence[int]]) -> str:
    part, whole = (sum(column) for column in zip(*pairs, strict=True)) if pairs else (0, 0)
    if not whole:
        return "-"
    p = part / whole
    return f"{100 * p:.1f} ± {100 * sqrt(p * (1 - p) / whole):.1f}"


def right_table(rows: Sequence[Row]) -> str:
    """Verdicts, true errors and intervals by class."""
    head = (
        "class", "studies", "Yes", "With care", "No", "Yes above 5 %", "largest true error of a Yes, %",
        "false causes", "95 % of all", "95 % of the bodies", "95 % printed first", "90 % expected",
        "median width, %",
    )  # fmt: skip
    lines = []
    for kind in (*CLASSES, "all"):
        own = [r for r in rows if kind in ("all", r["class"])]
        yes = [r for r in own if r["answer"].startswith("Yes")]
        graded = [r for r in own if np.isfinite(r.get("true", np.nan))]
        hold = [[int(r["low"] <= r["true"] <= r["high"]), 1] for r in graded]
        errors = [r["true"] for r in yes if "true" in r]
        widths = [r["all width"] for r in own if "all width" in r]
        lines.append((
            kind, len(own), len(yes),
            *(sum(r["answer"].startswith(word) for r in own) for word in ("With", "No")),
            sum(e > 5 for e in errors), f"{max(errors):.1f}" if errors else "-",
            sum(bool(r["causes"]) for r in own),
            *(share([r[key] for r in own if key in r]) for key in ("all", "all bodies", "first")),
            share(hold), f"{196 * np.median(widths):.1f}" if widths else "-",
        ))  # fmt: skip
    causes = sorted({f"{r['class']}: {r['causes'][0]}" for r in rows if r["causes"]})
    return markdown(head, lines) + "".join(f"\n- named: {cause}" for cause in causes)


def wrong_table(rows: Sequence[Row]) -> str:
    """What is said of each error."""
    head = ("error", "studies", "named first", "named", "another alone", "Yes")
    lines = []
    for kind in (*dict.fromkeys(r["class"] for r in rows), "all"):
        own = [r for r in rows if kind in ("all", r["class"])]
        counts = [sum(r[key] for r in own) for key in ("right", "among", "alone")]
        lines.append((kind, len(own), *counts, sum(r["answer"].startswith("Yes") for r in own)))
    alone = sorted(f"{r['class']}, {r['robot']}: {r['causes'][0]}" for r in rows if r["alone"])
    return markdown(head, lines) + "".join(f"\n- alone: {cause}" for cause in alone)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("right", "wrong", "table"))
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--count", type=int, default=264)
    parser.add_argument("--only", default="", help="one class")
    parser.add_argument("-o", dest="out", type=Path)
    args = parser.parse_args()
    if args.what == "table":
        for file in args.files:
            rows = json.loads(file.read_text("utf-8"))
            print((wrong_table if "right" in rows[0] else right_table)(rows), end="\n\n")
        return
    rows, make = [], right if args.what == "right" else wrong
    names = CLASSES if args.what == "right" else [name for name, *_ in SLIPS]
    for k in range(args.count):
        if args.only and names[k % len(names)] not in args.only.split(","):
            continue
        rows.append(make(k, args.seed))
        print(k, rows[-1]["class"], rows[-1]["answer"], rows[-1]["causes"][:1], file=sys.stderr)
        if args.out:
            args.out.write_text(json.dumps(rows, indent=1), "utf-8")
    print((right_table if args.what == "right" else wrong_table)(rows))


if __name__ == "__main__":
    main()
