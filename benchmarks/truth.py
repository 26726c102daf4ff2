"""Is what identify, its intervals, its verdict and the reader of counts say true? Asked of robots of
known bodies by simulators of another make (`benchmarks/truth_simulator.py`).

    python benchmarks/truth.py --question coverage --records 60 --seeds first --workers 1

prints one table as Markdown and writes truth_NAME_SEEDS.json every half minute; --more goes on from it. Record k of a question always has the
seed BASE[seeds] + k, whatever the number of records: `first` is for tuning; `second`,
`third` and `fourth` have other robots each and are run once, at the end of the work of their time; `final` has all
of them; `classes` was run once on it for docs/reliability.md (truth_classes_final.json). The code that is judged is called by its public interface alone.

    coverage       intervals of the sets of parameters against the truth; their errors on unseen motion
    ends           records without noise: what the ends of the filters leave
    homogeneity    pairs of one robot said to differ; pairs that differ by 3 % on one link
    verdict        the word beside the true error on unseen motion
    causes         causes told of right studies; wrong studies told by name
    counts         the reader of counts beside the best low-pass of a grid, and with faults
    counts_random  random readings: which contradict their counts, which are refused
    classes        right studies of seven classes: causes, intervals, expected error, verdict
    rests          right records with rests and stick friction, by the defaults
    weights        true error by weights by joint over that of the default
    physics        feasibility of right records, and what bounds by reach cut off

Truth of base parameters: least squares of pinocchio's torques in random states on the emitted
regressor, which must leave less than 1e-9. The true error of an estimate is
100 ||tau - D X||/||tau||, tau without noise, on two motions that it has not seen.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import pi
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
import truth_simulator as world
from scipy.stats import spearmanr
from truth_classes import classes, classes_table, share, stribeck
from truth_counts import counts, counts_random, counts_random_table, counts_table
from truth_rests import rests, rests_table
from truth_shared import (
    LEVEL,
    Array,
    Row,
    Unseen,
    among,
    deviations,
    emitted,
    markdown,
    middle,
    percent,
    record_of,
    robots_of,
    study,
    true_parameters,
)
from truth_simulator import Encoder, Motion, Robot, Truth, encoded, noise
from truth_weights import weights, weights_table

import runtime

BASE = {
    "first": 1_000_000,
    "second": 2_000_000,
    "third": 3_000_000,
    "fourth": 4_000_000,
    "final": 6_000_000,
}
"""Seeds: record k has BASE + k."""
SAVED = 30.0
"""Time between two writings of the rows, s."""
NOISES = list(world.NOISES)


# (1) Intervals ------------------------------------------------------------------------------------

MOVES = ("fourier", "chirp", "points")
SHARE = 0.02  # deviation of the noise over the rms torque of the joint


def coverage(k: int, seed: int, seeds: str) -> list[Row]:
    """One record: parameters of each set inside their 95 % intervals, and errors on unseen motion."""
    robots = robots_of(seeds)
    kind, robot = NOISES[k % 4], robots[(k // 4) % len(robots)]
    motion = MOVES[(k // 4 // len(robots)) % len(MOVES)]
    truth = Truth(robot, seed)
    X, move, model = (
        true_parameters(truth),
        world.MOTIONS[motion](robot, seed),
        emitted(robot.name)[0],
    )
    tau = truth.torque(move)
    record = record_of(move, tau + noise(tau, world.NOISES[kind], SHARE, seed))
    settings = study()
    result = runtime.identify(model, record, settings)
    fits = dict(result.sets) or {"all": result.estimate}
    unseen = Unseen(truth, seed)
    rows = []
    for name, fit in (
        *fits.items(),
        ("printed first", fits.get(result.model_columns, result.estimate)),
    ):
        s = deviations(fit)
        at = [model.BASE_PARAMETERS.index(p) for p in fit.names]
        known = np.isfinite(s) & (s > 0)
        z = np.abs(fit.X - X[at])[known] / s[known]
        total, worst = unseen.errors(fit.names, fit.X)
        removed = [
            abs(X[model.BASE_PARAMETERS.index(p)]) / d
            for p, d in zip(fits["all"].names, deviations(fits["all"]), strict=True)
            if p not in fit.names
        ]
        rows.append(
            {"noise": kind, "robot": robot.name, "motion": motion, "set": name, "count": len(z), "inside": int((z < LEVEL).sum()),
             "largest": float(z.max(initial=0.0)), "worst": fit.names[int(np.flatnonzero(known)[z.argmax()])] if len(z) else "",
             "error": total, "error of a joint": worst, "removed": max(removed, default=0.0), "chosen": result.model_columns}
        )  # fmt: skip
    return rows


def coverage_table(rows: list[Row]) -> str:
    lines = []
    for kind in NOISES:
        for name in ("printed first", "essential", "all", "feasible"):
            own = among(rows, noise=kind, set=name)
            stated = [r for r in own if r["count"]]
            count, inside = sum(r["count"] for r in stated), sum(r["inside"] for r in stated)
            worst = [
                100 * sum(r["inside"] for r in part) / sum(r["count"] for r in part)
                for motion in MOVES
                if (part := among(stated, motion=motion))
            ]
            lines.append(
                (kind, name, len(own), len(stated), f"{percent(inside, count)} ({count})", f"{min(worst):.0f}" if worst else "-",
                 f"{max((r['largest'] for r in stated), default=0.0):.3g}", middle([r["error"] for r in own]), middle([r["error of a joint"] for r in own]))
            )  # fmt: skip
    head = ("noise", "set", "records", "with intervals", "inside 95 %, % (values)", "worst motion, %", "largest error, deviations",
            "true error, median %", "of the worst joint, median %")  # fmt: skip
    pairs = [
        (e["error"], a["error"])
        for e, a in zip(among(rows, set="essential"), among(rows, set="all"), strict=True)
    ]
    removed = [r["removed"] for r in among(rows, set="essential")]
    return (
        markdown(head, lines)
        + f"\n\nAll parameters predict unseen motion better than the essential ones in {sum(a < e for e, a in pairs)} of {len(pairs)} records; "
        f"the largest parameter that was removed is {middle(removed)} of its deviations (median), {max(removed, default=0):.0f} (largest)."
    )


# (2) Ends of records ------------------------------------------------------------------------------


def ends(k: int, seed: int, seeds: str) -> list[Row]:
    """One record without noise, all parameters, by cut-off and by what is left out at the ends."""
    robots = robots_of(seeds)
    robot, motion = robots[k % len(robots)], ("fourier", "chirp")[(k // len(robots)) % 2]
    truth, rows = Truth(robot, seed), []
    X, move, model = (
        true_parameters(truth),
        world.MOTIONS[motion](robot, seed),
        emitted(robot.name)[0],
    )
    record, unseen = record_of(move, truth.torque(move)), Unseen(truth, seed)
    for cutoff in (20.0, 50.0):
        factor = max(int(0.8 * world.RATE / 2 / cutoff), 1)
        cases: dict[str, dict[str, Any]] = {
            "default": {},
            "2/cutoff + 27 samples": {"rows": {"trim": 27 + int(2 * world.RATE / cutoff / factor)}},
        }
        for label, more in cases.items():
            settings = study(signals={"lowpass": {"cutoff": cutoff}}, **more)
            fit = runtime.estimate(model, record, settings)
            z = np.abs(fit.X - X) / deviations(fit)
            rows.append({"robot": robot.name, "motion": motion, "cutoff": cutoff, "ends": label, "left": fit.relative_error,
                         "error": unseen.errors(fit.names, fit.X)[0], "largest": float(z.max()), "inside": float((z < LEVEL).mean())})  # fmt: skip
    return rows


def ends_table(rows: list[Row]) -> str:
    lines = []
    for cutoff in (20.0, 50.0):
        for label in dict.fromkeys(r["ends"] for r in rows):
            own = among(rows, cutoff=cutoff, ends=label)
            left = [r["left"] for r in own]
            lines.append((f"{cutoff:g}", label, len(own), middle(left), f"{max(left):.2f}", middle([r["error"] for r in own]),
                          f"{max(r['error'] for r in own):.2f}", f"{100 * np.mean([r['inside'] for r in own]):.0f}"))  # fmt: skip
    head = (
        "cut-off, Hz",
        "left out at each end",
        "records",
        "unexplained, median %",
        "largest %",
        "true error, median %",
        "largest %",
        "inside 95 %, %",
    )
    return markdown(head, lines)


# (3) Homogeneity ----------------------------------------------------------------------------------


def homogeneity(k: int, seed: int, seeds: str) -> list[Row]:
    """One pair of records of one robot, of 3 or 8 s; every fourth pair one link of the second is 3 %
    heavier.
    """
    kind, different = NOISES[:3][k % 3], (k // 3) % 4 == 3
    robots = robots_of(seeds)[:3]
    robot = robots[(k // 3) % len(robots)]
    motion, seconds = MOVES[(k // 9) % 3], (8.0, 3.0)[(k // 27) % 2]
    truth, records = Truth(robot, seed), []
    for i in range(2):
        own = truth.changed(0.03, seed) if different and i else truth
        move = world.MOTIONS[motion](robot, seed + 250_000 * i, seconds=seconds)
        tau = own.torque(move)
        records.append(record_of(move, tau + noise(tau, world.NOISES[kind], SHARE, seed + i)))
    agree = runtime.identify(emitted(robot.name)[0], records, study()).part("homogeneity")
    assert agree is not None
    tested = len(agree.records) > 1
    return [{"noise": kind, "robot": robot.name, "motion": motion, "seconds": seconds, "different": different, "tested": tested,
             "said": bool(tested and not agree.agree), "doubted": bool(tested and agree.records_differ), "largest": max((d.difference for d in agree.disagreements), default=0.0)}]  # fmt: skip


def homogeneity_table(rows: list[Row]) -> str:
    lines = []
    for label, fields in (
        *((f"noise {kind}", {"noise": kind}) for kind in NOISES[:3]),
        *((f"motion {motion}", {"motion": motion}) for motion in MOVES),
        *((f"{seconds:g} s", {"seconds": seconds}) for seconds in (8.0, 3.0)),
        ("all", {}),
    ):
        for different in (False, True):
            own = among(rows, tested=True, different=different, **fields)
            said, doubted = sum(r["said"] for r in own), sum(r["doubted"] for r in own)
            pairs = "3 % on one link" if different else "one robot"
            lines.append((label, pairs, len(own), share(said, len(own)), share(doubted, len(own))))
    head = ("class", "pairs of", "pairs", "said to differ, %", "verdict With care for it, %")
    return markdown(head, lines)


# (4) Verdict --------------------------------------------------------------------------------------

LEVELS = (0.005, 0.02, 0.05, 0.15)
STUDIES = (
    "right",
    "right",
    "one joint hardly moves",
    "encoder",
    "right",
    "short",
    "slow",
    "unmodelled friction",
    "right",
    "two joints as one",
)


def study_of(
    kind: str, robot: Robot, seed: int, k: int
) -> tuple[Truth, str, Motion, Array, Array, float]:
    """Truth, motion's name, motion, positions and torques of a record that is right in unit, sign and time."""
    rng, truth = np.random.default_rng([seed, 53]), Truth(robot, seed)
    motion = "slow" if kind == "slow" else MOVES[(k // 2) % 3]
    seconds, share = (
        (3.0 if kind == "short" else 10.0),
        float(LEVELS[int(rng.integers(len(LEVELS)))]),
    )
    move = world.MOTIONS[motion](robot, seed, seconds=seconds)
    j = int(rng.integers(robot.n))
    if kind == "one joint hardly moves":
        scale = np.where(np.arange(robot.n) == j, 0.003, 1.0)
        move = Motion(move.t, move.q * scale, move.qd * scale, move.qdd * scale)
    if kind == "two joints as one":
        other = (j + 1) % robot.n
        move = Motion(move.t, *(_alike(x, j, other) for x in (move.q, move.qd, move.qdd)))
    tau = truth.torque(move)
    if kind == "unmodelled friction":
        tau = tau + 3 * stribeck(truth, move)
    q = (
        encoded(robot, move, Encoder(2 * pi / float(rng.choice([500, 2000, 8000, 20000]))), seed)
        if kind == "encoder"
        else move.q
    )
    return (
        truth,
        motion,
        move,
        q,
        tau + noise(tau, float(rng.choice([0.0, 0.9, 0.99])), share, seed),
        share,
    )


def _alike(x: Array, j: int, other: int) -> Array:
    x = x.copy()
    x[:, other] = 0.8 * x[:, j]
    return x


def verdict(k: int, seed: int, seeds: str, **sections: Any) -> list[Row]:
    """One study as `symgen identify` does it: word, doubts, error that it states, true error.

    sections : settings in place of the default ones.
    """
    robots = robots_of(seeds)
    kind, robot = STUDIES[k % len(STUDIES)], robots[(k // len(STUDIES) + k) % len(robots)]
    truth, motion, move, q, tau, share = study_of(kind, robot, seed, k)
    model, variants = emitted(robot.name)
    result = runtime.identify(model, record_of(move, tau, q), study(**sections), variants=variants)
    checks = result.checklist.checks
    total, worst = Unseen(truth, seed).errors(result.model_estimate.names, result.model_estimate.X)
    if not result.determined:  # no values are printed
        total = worst = float("inf")
    grade = getattr(result.checklist, "grade", None)
    return [{"kind": kind, "robot": robot.name, "motion": motion, "noise": share, "state": result.checklist.state, "grade": grade,
             "doubts": sum({"doubtful": 1, "no": 2}.get(c.state, 0) for c in checks), "questions": [c.question for c in checks if c.state in ("doubtful", "no")],
             "stated": result.prediction_error, "error": total, "error of a joint": worst}]  # fmt: skip


WORDS = {"good": 0, "doubtful": 1, "no": 2}
CLASSES = ((0.0, 3.0), (3.0, 5.0), (5.0, 20.0), (20.0, np.inf))


def by_class(rows: list[Row], key: str) -> list[tuple[Any, ...]]:
    """Words by the class of an error."""
    lines = []
    for low, high in CLASSES:
        own = [r for r in rows if low <= r[key] < high or r[key] == high == np.inf]
        label = f"{low:g} to {high:g} %"
        if not np.isfinite(high):
            label = f"above {low:g} %, or not determined"
        words = [sum(r["state"] == state for r in own) for state in WORDS]
        lines.append((label, len(own), *words))
    return lines


def verdict_table(rows: list[Row]) -> str:
    heads = {"error": "true error on unseen motion", "error of a joint": "that of the worst joint"}
    text = [
        markdown((head, "studies", "Yes", "With care", "No"), by_class(rows, key))
        for key, head in heads.items()
    ]
    error = [min(r["error"], 1e6) for r in rows]
    tell = "Can the values be told apart?"
    without = [
        max((WORDS["doubtful"] for q in r["questions"] if q != tell), default=0)
        if r["state"] != "no"
        else 2
        for r in rows
    ]
    stated = [
        (r["stated"], e) for r, e in zip(rows, error, strict=True) if np.isfinite(r["stated"])
    ]
    ranks = {
        "the word": rank([WORDS[r["state"]] for r in rows], error),
        f'the word without "{tell}"': rank(without, error),
        "the number of doubts (no: two)": rank([r["doubts"] for r in rows], error),
        "the stated error on unseen data": rank(*zip(*stated, strict=True)) if stated else np.nan,
    }
    if all(r["grade"] is not None for r in rows):
        ranks["the grade"] = rank([r["grade"] for r in rows], error)
    joint = [min(r["error of a joint"], 1e6) for r in rows]
    ranks["the word, with the error of the worst joint"] = rank(
        [WORDS[r["state"]] for r in rows], joint
    )
    text.append(
        markdown(
            ("rank correlation with the true error", "Spearman"),
            [(a, f"{b:.2f}") for a, b in ranks.items()],
        )
    )
    asked: dict[str, list[float]] = {}
    for r in rows:
        for q in r["questions"] if r["error"] < 3 else ():
            asked.setdefault(q, []).append(r["error"])
    text.append(
        markdown(
            ("doubts where the true error is below 3 %", "studies"),
            sorted(((q, len(v)) for q, v in asked.items()), key=lambda x: -x[1]),
        )
    )
    return "\n\n".join(text)


def rank(a: Sequence[float], b: Sequence[float]) -> float:
    return float(spearmanr(a, b).statistic)


# (5) Wrong causes ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Wrong:
    """What is wrong with a study: `spoil` takes truth, motion, positions, torques, a joint and random
    numbers; `name` is a pattern that a finding which names it matches, {j} the joint, {i} the one
    after it.
    """

    label: str
    name: str
    spoil: Callable[[Truth, Motion, Array, Array, int, np.random.Generator], tuple[Array, Array]]


def _column(x: Array, j: int, values: Array) -> Array:
    x = x.copy()
    x[:, j] = values
    return x


def _late(
    truth: Truth, move: Motion, q: Array, tau: Array, j: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    by = int(0.02 * world.RATE)
    return q, _column(tau, j, np.concatenate([np.repeat(tau[:1, j], by), tau[:-by, j]]))


def _frozen(
    truth: Truth, move: Motion, q: Array, tau: Array, j: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    a = int(len(q) * rng.uniform(0.2, 0.5))
    held = q[:, j].copy()
    held[a : a + len(q) // 6] = held[a]
    return _column(q, j, held), tau


def _lost(
    truth: Truth, move: Motion, q: Array, tau: Array, j: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    a = int(len(q) * rng.uniform(0.3, 0.7))
    left = np.r_[0:a, a + 50 : len(q)]
    return q[left], tau[left]


def _swapped(x: Array, i: int, j: int) -> Array:
    x = x.copy()
    x[:, [i, j]] = x[:, [j, i]]
    return x


WRONG = (
    Wrong("torque of a joint 20 ms late", r"late|delay|same instants|shift", _late),
    Wrong("zero of a joint off by 15 degrees", r"zero of joint {j}|theta of (joint|frame) {j}", lambda w, m, q, y, j, r: (_column(q, j, q[:, j] + pi / 12), y)),
    Wrong("torque coupling of two joints", r"coupling of joints ({j} and {i}|{i} and {j})", lambda w, m, q, y, j, r: (q, _column(y, j, y[:, j] + y[:, (j + 1) % y.shape[1]]))),
    Wrong("frozen encoder", r"froze|frozen|holds|does not move|dropped|jumps", _frozen),
    Wrong("50 samples lost", r"missing|lost|jump|two records", _lost),
    Wrong("sign of a torque", r"torque of joint {j} has the wrong sign", lambda w, m, q, y, j, r: (q, _column(y, j, -y[:, j]))),
    Wrong("sign of a ratio", r"joint {j} counts in the other sense|position of joint {j} has the wrong sign", lambda w, m, q, y, j, r: (_column(q, j, -q[:, j]), _column(y, j, -y[:, j]))),
    Wrong("two torque columns exchanged", r"torque columns of joints ({j} and {i}|{i} and {j})", lambda w, m, q, y, j, r: (q, _swapped(y, j, (j + 1) % y.shape[1]))),
    Wrong("ratio of a joint 1.4 times", r"torque of joint {j} (is|must)", lambda w, m, q, y, j, r: (q, _column(y, j, 1.4 * y[:, j]))),
    Wrong("all torques 10 ms late", r"late|delay|same instants|shift", lambda w, m, q, y, j, r: (q, np.concatenate([np.repeat(y[:1], 10, axis=0), y[:-10]]))),
)  # fmt: skip
ONE_OF = 3
"""Every third study of `causes` is wrong."""


def causes(k: int, seed: int, seeds: str) -> list[Row]:
    """One study: right, or with one of WRONG; the findings that are not good, and causes that are named.

    Right studies have records of 3 or 10 s, noise of 0.5 to 10 % and, every third, friction that is
    not the model's; wrong ones 10 s, at most 3 % and the friction of the model.
    """
    wrong = WRONG[(k // ONE_OF) % len(WRONG)] if k % ONE_OF == ONE_OF - 1 else None
    robots = robots_of(seeds) if wrong else (*robots_of(seeds), *world.SPECIAL)
    rng, robot = np.random.default_rng([seed, 59]), robots[(k // 3 + k // 30 + k) % len(robots)]
    motion, kind = MOVES[int(rng.integers(3))], NOISES[int(rng.integers(3))]
    seconds = 10.0 if wrong or rng.uniform() < 0.7 else 3.0
    share = float(rng.choice([0.005, 0.01, 0.03] if wrong else [0.005, 0.01, 0.03, 0.1]))
    truth, move = Truth(robot, seed), world.MOTIONS[motion](robot, seed, seconds=seconds)
    tau = truth.torque(move)
    other = wrong is None and rng.uniform() < 1 / 3
    if other:
        tau = tau + stribeck(truth, move)
    q, tau = move.q, tau + noise(tau, world.NOISES[kind], share, seed)
    j = int(rng.integers(1, robot.n))  # the first joint's zero and sign can often not be told
    if wrong is not None:
        q, tau = wrong.spoil(truth, move, q, tau, j, rng)
    model, variants = emitted(robot.name)
    record = runtime.Record(np.arange(len(q)) / world.RATE, q, tau)
    found = runtime.plausibility(model, record, study(), variants=variants)
    told = [c for c in found.checks() if c.state in ("doubtful", "no")]
    named = [one["cause"] for one in found.named_causes]
    texts = [*(f"{c.question} {c.finding}" for c in told), *named]
    texts, named = ([re.sub(r"(\d+) joint\1\b", r"\1", x) for x in own] for own in (texts, named))
    pattern = wrong.name.format(j=j + 1, i=(j + 1) % robot.n + 1) if wrong else "nothing is wrong"
    return [
        {
            "wrong": wrong.label if wrong else "",
            "robot": robot.name,
            "motion": motion,
            "noise": kind,
            "share": share,
            "seconds": seconds,
            "other friction": other,
            "joint": j + 1,
            "texts": texts,
            "states": [c.state for c in told],
            "named": any(re.search(pattern, text) for text in texts),
            "other causes": [text for text in named if not re.search(pattern, text)],
            "equivalent": list(found.equivalent),
        }
    ]


def causes_table(rows: list[Row]) -> str:
    lines = []
    hidden = [
        r
        for r in rows
        if r["wrong"].startswith("zero") and f"the zero of joint {r['joint']}" in r["equivalent"]
    ]
    rows = [r for r in rows if r not in hidden]
    for label in ("", *(w.label for w in WRONG)):
        own = among(rows, wrong=label)
        lines.append(
            (
                label or "nothing (right studies)",
                len(own),
                sum(r["named"] for r in own) if label else "-",
                sum(bool(r["other causes"]) for r in own),
                sum("no" in r["states"] for r in own),
                sum(bool(r["texts"]) for r in own),
            )
        )
    right: dict[str, int] = {}
    for r in among(rows, wrong=""):
        for text in r["texts"]:
            key = re.sub(r"[-+]?\d[\d.]*", "#", text.split("?")[0] + "?" if "?" in text else text)
            right[key] = right.get(key, 0) + 1
    head = (
        "what is wrong",
        "studies",
        "told by name",
        "another cause named, alone or beside it",
        "a No",
        "any finding that is not good",
    )
    wrong = [r for r in rows if r["wrong"]]
    return (
        markdown(head, lines)
        + f"\n\nWrong studies told by name: {sum(r['named'] for r in wrong)} of {len(wrong)}; {len(hidden)} zeros that no record can tell are left out.\n\n"
        + markdown(("told of right studies", "times"), sorted(right.items(), key=lambda x: -x[1]))
    )


# (8) Physics --------------------------------------------------------------------------------------

PHYSICAL = ("pan_tilt", "gantry", "planar", "anthropomorphic", "finger", "one joint at rest")


def physics(k: int, seed: int, seeds: str) -> list[Row]:
    """One right record with 0.5 % of noise: said to be feasible? masses and parameters of the feasible fit."""
    label = PHYSICAL[k % len(PHYSICAL)]
    robot = finger() if label == "finger" else world.ROBOTS.get(label, world.ROBOTS["wrist"])
    truth = Truth(robot, seed)
    X, move, (model, _) = true_parameters(truth), world.fourier(robot, seed), emitted(robot.name)
    if label == "one joint at rest":
        still = np.where(np.arange(robot.n) == 3, 0.0, 1.0)
        move = Motion(move.t, move.q * still, move.qd * still, move.qdd * still)
    tau = truth.torque(move)
    record = record_of(move, tau + noise(tau, 0.0, 0.005, seed))
    row: Row = {
        "robot": label,
        "feasible": None,
        "margin": None,
        "blocking": [],
        "masses": None,
        "off": None,
        "error": None,
        "error free": None,
        "said": "",
    }
    try:
        result = runtime.identify(model, record, study(), physical=True)
    except (runtime.InputError, ValueError) as e:
        return [row | {"said": str(e)}]
    row["said"] = "; ".join(result.missing) if label == "one joint at rest" else ""
    judged = result.part("feasibility").judged
    if judged is not None:
        row |= {
            "feasible": bool(judged.feasible),
            "margin": float(judged.margin),
            "blocking": [c for c, _ in judged.blocking],
        }
    own = study(estimate={"method": "feasible"})
    try:
        fit = runtime.estimate(model, record, own)
    except (runtime.InputError, ValueError) as e:
        return [row | {"said": f"{row['said']} feasible: {e}"}]
    unseen, standard = Unseen(truth, seed), dict(fit.details.get("standard", {}))
    masses = {name: value for name, value in standard.items() if re.fullmatch(r"M\d+", name)}
    free = result.sets.get("all")
    scale = np.maximum(np.abs(X), 1e-12)
    return [row | {"masses": masses, "true masses": truth.bodies.mass.tolist(), "off": float(100 * np.median(np.abs(fit.X - X) / scale)) if len(fit.X) == len(X) else None,
                   "message": fit.message, "error": unseen.errors(fit.names, fit.X)[0], "error free": unseen.errors(free.names, free.X)[0] if free is not None else None}]  # fmt: skip


@cache
def finger() -> Robot:
    """The planar arm at a tenth of its lengths and a five-hundredth of its masses."""
    joints = tuple(
        replace(
            j,
            xyz=tuple(0.1 * x for x in j.xyz),
            mass=j.mass / 500,
            box=tuple(0.1 * x for x in j.box),
            centre=tuple(0.1 * x for x in j.centre),
        )
        for j in world.ROBOTS["planar"].joints
    )
    robot = Light("finger", joints)
    world.ROBOTS[robot.name] = robot  # type: ignore[index]
    return robot


class Light(Robot):
    """A robot of grams, whose friction is small beside its own weight."""

    @property
    def nominal(self) -> world.Bodies:
        own = Robot(self.name, self.joints).nominal
        return replace(own, viscous=1e-2 * own.viscous, dry=1e-2 * own.dry)


def physics_table(rows: list[Row]) -> str:
    lines = []
    for label in PHYSICAL:
        own = among(rows, robot=label)
        asked = [r for r in own if r["feasible"] is not None]
        fitted = [r for r in own if r.get("message")]
        blocked = sorted({b for r in asked for b in r["blocking"] if not r["feasible"]})
        low = [
            min(m / t for m, t in zip(r["masses"].values(), r["true masses"], strict=False))
            for r in own
            if r["masses"]
        ]
        high = [
            max(m / t for m, t in zip(r["masses"].values(), r["true masses"], strict=False))
            for r in own
            if r["masses"]
        ]
        said = dict.fromkeys(r["said"].strip() for r in own if r["said"].strip())
        lines.append((label, len(own), len(asked), sum(not r["feasible"] for r in asked), ", ".join(blocked[:4]), sum("NOT physically" in r["message"] for r in fitted), middle([r["error free"] for r in own]), middle([r["error"] for r in own]),
                      middle(low), middle(high), "; ".join(text[:120] for text in list(said)[:2])))  # fmt: skip
    head = ("robot", "records", "judged", "said not to be physical", "by", "the feasible fit says so", "true error of all, median %", "of the feasible, median %",
            "mass over true mass: smallest link", "largest link", "what is said")  # fmt: skip
    return markdown(head, lines)


# Running ------------------------------------------------------------------------------------------

QUESTIONS: dict[
    str, tuple[Callable[[int, int, str], list[Row]], Callable[[list[Row]], str], int]
] = {
    "coverage": (coverage, coverage_table, 400),
    "ends": (ends, ends_table, 20),
    "homogeneity": (homogeneity, homogeneity_table, 400),
    "verdict": (verdict, verdict_table, 200),
    "causes": (causes, causes_table, 300),
    "counts": (counts, counts_table, 600),
    "counts_random": (counts_random, counts_random_table, 10_000),
    "physics": (physics, physics_table, 60),
    "classes": (classes, classes_table, 700),
    "rests": (rests, rests_table, 100),
    "weights": (weights, weights_table, 204),
}


def one(task: tuple[str, int, str]) -> tuple[int, list[Row]]:
    """Rows of record k; what breaks is a row with its text."""
    question, k, seeds = task
    try:
        with np.errstate(all="ignore"):
            return k, QUESTIONS[question][0](k, BASE[seeds] + k, seeds)
    except Exception as e:
        return k, [{"broke": f"{type(e).__name__}: {e}"}]


def asked(
    question: str,
    records: int,
    seeds: str,
    workers: int = 1,
    minutes: float = np.inf,
    *,
    before: Sequence[Row] = (),
    saved: Callable[[list[Row]], None] = lambda rows: None,
) -> list[Row]:
    """Rows of the first records, in their order; fewer where the time ends before.

    before : rows of the first of them, from an earlier call. saved : called with all rows from time
    to time.
    """
    rows, first = list(before), 1 + max((row["record"] for row in before), default=-1)
    began = last = time.monotonic()
    for k, own in done([(question, k, seeds) for k in range(first, records)], workers):
        rows += [row | {"record": k} for row in own]
        now = time.monotonic()
        if now - last > SAVED:
            saved(rows)
            last = now
        if now - began > 60 * minutes:
            break
    saved(rows)
    return rows


def done(tasks: Sequence[tuple[str, int, str]], workers: int) -> Iterator[tuple[int, list[Row]]]:
    """(record, rows) in the order of the records."""
    if workers == 1:
        yield from map(one, tasks)
        return
    with Pool(workers) as pool:
        yield from pool.imap(one, tasks)


def report(question: str, rows: Sequence[Row]) -> str:
    """The table of the rows, and the records that broke."""
    broke = [row for row in rows if "broke" in row]
    lines = [f"record {row['record']} ended with {row['broke'][:300]}" for row in broke]
    table = QUESTIONS[question][1]([row for row in rows if "broke" not in row])
    return "\n\n".join([*lines, table])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--question", choices=[*QUESTIONS, "all"], required=True)
    add("--records", type=int, help="default: as many as the page is to have")
    add("--seeds", choices=list(BASE), default="first")
    add("--workers", type=int, default=1)
    add("--minutes", type=float, default=np.inf, help="of a question, after which no record starts")
    add("--folder", type=Path, default=Path(), help="where truth_QUESTION_SEEDS.json is written")
    add("--more", action="store_true", help="go on from the records in that file")
    given = parser.parse_args()
    for question in QUESTIONS if given.question == "all" else [given.question]:
        file = given.folder / f"truth_{question}_{given.seeds}.json"
        head = {"question": question, "seeds": given.seeds, "base": BASE[given.seeds]}

        def saved(rows: list[Row], file: Path = file, head: Row = head) -> None:
            lines = ",\n".join(json.dumps(row, default=float) for row in rows)
            file.write_text(f'{json.dumps(head)[:-1]}, "rows": [\n{lines}\n]}}\n')

        before = json.loads(file.read_text())["rows"] if given.more and file.exists() else []
        records = given.records or QUESTIONS[question][2]
        rows = asked(
            question,
            records,
            given.seeds,
            given.workers,
            given.minutes,
            before=before,
            saved=saved,
        )
        count = len({row["record"] for row in rows})
        print(f"\n**{question}**, seeds {given.seeds}, {count} records\n", flush=True)
        print(report(question, rows), flush=True)


if __name__ == "__main__":
    main()
