"""Does `--repair` mend what is wrong, and leave what is right? Asked of simulated robots.

    python benchmarks/repair.py --set right --studies 60 --seeds final

prints a table and writes repair_SET_SEEDS.json after each study; --more goes on from it. The robots,
their torques (pinocchio), noise, encoders and motions are those of `benchmarks/truth_simulator.py`,
which shares no code with symgen or runtime; the errors are planted here, in arrays and URDF text.
Study k of a set has the seed BASE[seeds] + k. `first` and `second` are for tuning; `final` and
`third` have other robots, and are run after a design stands.

    right      nine classes: the seven of docs/reliability.md, load friction, cogging
    one, two   one error, or two of different kinds

A study is a CSV file and a study file, as a user has them. It is judged on a second motion that is
recorded with the same errors and read by the mended study: error of the predicted torques. A changed
study is *right* if it reads the positions, torques, clock, table and gravity of the truth;
*equivalent* if a noise-free record fits it as well as the right study; *partly* right if each part of
the reading is that of the truth, as it was given, or that of the truth with one of the two errors
alone, of any joint: a factor that is left on a torque whose delay is mended; otherwise *false*,
whatever it predicts. *Told*: beside friction that is not negative, free parameters leave more of a noise-free
record, read by the wrong study, than a fifth of the noise (pinocchio's regressor).
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import json
import os
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from time import process_time
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
import pinocchio as pin
import truth_simulator as world
from scipy.interpolate import CubicSpline
from scipy.optimize import lsq_linear
from truth_classes import stribeck
from truth_shared import among, markdown, middle
from truth_simulator import Encoder, Robot, Truth, encoded, noise

import runtime
import symgen
from runtime.compose import records_of
from runtime.study import load_study, located, study_from_mapping, study_text

Array = np.ndarray
Row = dict[str, Any]
BASE = {"first": 10_000, "second": 40_000, "final": 90_000, "third": 300_000}
EVERY = 4
"""Samples of the simulation of which one is recorded: 250 Hz."""
CLASSES = (
    "ordinary", "slow", "coarse encoder", "short", "rests", "AR(0.99)", "friction left out",
    "load friction", "cogging",
)  # fmt: skip


def robots_of(seeds: str) -> list[Robot]:
    """Robots of two to four joints, and one of five or six."""
    names = {
        "first": ("planar", "scara", "anthropomorphic"),
        "second": ("elbow", "skewed", "rail", "anthropomorphic"),
    }.get(seeds, ("elbow", "cylindrical", "skewed", "rail", "polar", "snake", "hanging"))
    return [world.ROBOTS[name] for name in names]


@dataclass
class World:
    """One recorded motion, and the robot file given with it: changed by the errors.

    q, tau : (N, n), t : (N,); qd, qdd: exact, for the oracle. lengths : factor on the place of a
    joint in the URDF, by joint. gravity : (3,), of the simulated robot.
    """

    robot: Robot
    t: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    urdf: Robot
    study: dict[str, Any]


Plant = Callable[[World, int, np.random.Generator], World]


@dataclass(frozen=True)
class Error:
    """What is wrong with a study: `plant` takes the world, a joint and random numbers."""

    label: str
    plant: Plant
    gravity: bool = False
    suits: Callable[[Robot, int], bool] = lambda robot, j: True


def scaled(w: World, j: int, q: float, tau: float) -> World:
    a, b = np.ones(w.robot.n), np.ones(w.robot.n)
    a[j], b[j] = q, tau
    return replace(w, q=w.q * a, qd=w.qd * a, qdd=w.qdd * a, tau=w.tau * b)


def geared(w: World, j: int, x: float) -> World:
    return scaled(w, j, x, 1 / x)


def moved(w: World, j: int, by: float) -> World:
    return replace(w, q=w.q + by * (np.arange(w.robot.n) == j))


def exchanged(w: World, j: int, what: str) -> World:
    order = [*range(w.robot.n)]
    k = (j + 1) % w.robot.n
    order[j], order[k] = k, j
    if what == "tau":
        return replace(w, tau=w.tau[:, order])
    return replace(w, q=w.q[:, order], qd=w.qd[:, order], qdd=w.qdd[:, order])


def faster(w: World, factor: float) -> World:
    return replace(w, t=w.t / factor, qd=w.qd * factor, qdd=w.qdd * factor**2)


def late(w: World, seconds: float) -> World:
    tau = np.stack(
        [CubicSpline(w.t, x)(np.clip(w.t - seconds, w.t[0], w.t[-1])) for x in w.tau.T], axis=1
    )
    return replace(w, tau=tau)


def longer(w: World, j: int, factor: float) -> World:
    joints = list(w.urdf.joints)
    joints[j] = replace(joints[j], xyz=tuple(factor * x for x in joints[j].xyz))
    return replace(w, urdf=replace(w.urdf, joints=tuple(joints)))


def turns(robot: Robot, j: int) -> bool:
    return not robot.joints[j].slides


def has_length(robot: Robot, j: int) -> bool:
    return j > 0 and np.linalg.norm(robot.joints[j].xyz) > 0.1


ERRORS = (
    Error("sign of a torque", lambda w, j, r: scaled(w, j, 1, -1)),
    Error("sign of a position", lambda w, j, r: scaled(w, j, -1, 1)),
    Error("torques exchanged", lambda w, j, r: exchanged(w, j, "tau")),
    Error("positions exchanged", lambda w, j, r: exchanged(w, j, "q")),
    Error("degrees", lambda w, j, r: scaled(w, j, 180 / pi, 1), suits=turns),
    Error("torque factor", lambda w, j, r: scaled(w, j, 1, r.choice([0.5, 2**-0.5, 1.6, 2.0]))),
    Error("gear ratio", lambda w, j, r: geared(w, j, r.choice([0.8, 1.25, 1.5]))),
    Error("zero", lambda w, j, r: moved(w, j, r.choice([-1, 1]) * r.uniform(0.3, 1.3)), suits=turns),
    Error("length", lambda w, j, r: longer(w, j, r.choice([0.75, 1.3])), suits=has_length),
    Error("gravity angle", lambda w, j, r: w, gravity=True),
    Error("rate", lambda w, j, r: faster(w, r.choice([0.5, 2.0]))),
    Error("delay", lambda w, j, r: late(w, r.uniform(0.015, 0.05))),
)  # fmt: skip


def tilt(rng: np.random.Generator) -> Array:
    """Gravity of a base that is mounted at an angle of 6 to 40 degrees."""
    angle, way = np.radians(rng.uniform(6, 40)), rng.uniform(0, 2 * pi)
    side = np.sin(angle)
    return 9.81 * np.array([side * np.cos(way), side * np.sin(way), -np.cos(angle)])


def recorded(
    robot: Robot, seed: int, kind: str, g: Array, motion_seed: int, *, share: float
) -> tuple[World, World]:
    """A motion with noise, encoder and unmodelled torques of its class, and without any of them."""
    rng, truth = np.random.default_rng([seed, 71]), Truth(robot, seed)
    truth.model.gravity.linear = g
    names = {"slow": "slow", "rests": "points", "AR(0.99)": "points"}
    motion = names.get(kind, "fourier" if rng.uniform() < 0.7 else "chirp")
    seconds = {"short": 3.0, "slow": 14.0}.get(kind, 8.0)
    move = world.MOTIONS[motion](robot, motion_seed, seconds=seconds)
    rigid = truth.torque(move) - truth.friction(move.qd)
    tau = clean = rigid + truth.friction(move.qd)
    if kind == "friction left out":
        tau = tau + stribeck(truth, move)
    if kind == "load friction":
        tau = tau + 0.06 * np.abs(rigid) * np.sign(move.qd)
    if kind == "cogging":
        tau = tau + 0.03 * np.sqrt((tau**2).mean(axis=0)) * np.sin(24 * move.q + 1.0)
    q = move.q
    if kind == "coarse encoder":
        q = encoded(robot, move, Encoder(2 * pi / float(rng.choice([500, 1000, 2000]))), seed)
    rho = 0.99 if kind == "AR(0.99)" else 0.0
    noisy = tau + (noise(tau, rho, share, seed + motion_seed) if share else 0.0)
    cut = slice(None, None, EVERY)
    made = [
        World(robot, move.t[cut], x[cut], move.qd[cut], move.qdd[cut], y[cut], robot, {})
        for x, y in ((q, noisy), (move.q, clean))
    ]
    return made[0], made[1]


def written(w: World, folder: Path, name: str) -> None:
    n = w.robot.n
    head = ",".join(["t", *(f"q{j + 1}" for j in range(n)), *(f"tau{j + 1}" for j in range(n))])
    rows = np.column_stack([w.t, w.q, w.tau])
    np.savetxt(folder / name, rows, delimiter=",", header=head, comments="", fmt="%.9g")


def study_mapping(w: World, name: str) -> dict[str, Any]:
    return {"record": {"files": [name]}, **w.study}


def one(k: int, seed: int, seeds: str, which: str) -> Row:
    """One study, with and without --repair."""
    rng, robots = np.random.default_rng([seed, 5]), robots_of(seeds)
    robot = robots[k % len(robots)]
    errors: list[tuple[Error, int]] = []
    kind = CLASSES[(k // len(robots)) % len(CLASSES)] if which == "right" else "ordinary"
    share = float(rng.choice([0.01, 0.02]))
    count = {"right": 0, "one": 1, "two": 2}[which]
    start = k // len(robots) + 3 * (k % len(robots))
    while len(errors) < count:
        error = ERRORS[(start if not errors else int(rng.integers(len(ERRORS)))) % len(ERRORS)]
        suited = [j for j in range(robot.n) if error.suits(robot, j)]
        if suited and all(error.label != other.label for other, _ in errors):
            errors.append((error, int(rng.choice(suited))))
        start += 1
    tilted = any(error.gravity for error, _ in errors)
    g = tilt(rng) if tilted else np.array([0.0, 0.0, -9.81])
    noisy, clean = recorded(robot, seed, kind, g, seed, share=share)
    other = recorded(robot, seed, "ordinary", g, seed + 500_000, share=0.0)[1]
    planted, alone = [noisy, clean, other], []
    for error, j in errors:
        state = rng.bit_generator.state
        for joint in range(robot.n):
            rng.bit_generator.state = state
            alone.append(error.plant(clean, joint, rng))
        for i, w in enumerate(planted):
            rng.bit_generator.state = state
            planted[i] = error.plant(w, j, rng)
    row: Row = {
        "set": which, "class": kind, "robot": robot.name, "errors": [e.label for e, _ in errors],
        "joints": [j + 1 for _, j in errors], "noise": share,
    }  # fmt: skip
    row["told"] = bool(errors) and told(planted[1], share)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, w in zip(("run.csv", "clean.csv", "other.csv"), planted, strict=True):
            written(w, folder, name)
        (folder / "arm.urdf").write_text(planted[0].urdf.urdf(robot.nominal), encoding="utf-8")
        (folder / "truth.urdf").write_text(robot.urdf(robot.nominal), encoding="utf-8")
        return row | judged(folder, clean, alone, g)


def judged(folder: Path, clean: World, alone: list[World], g: Array) -> Row:
    """The study as given, repaired, and what the repair did."""
    file = folder / "arm.urdf"
    model, variants = symgen.model(file), symgen.variants(file)
    given = located(study_from_mapping({"record": {"files": ["run.csv"]}}), folder)
    records = records_of(given.record, model, given)
    began = process_time()
    before = runtime.identify(model, records, given, variants=variants)
    middle_ = process_time()
    row: Row = {"identify s": middle_ - began}
    row["error given"] = true_error(before, model, given, folder, clean, g)
    began = process_time()
    try:
        repair = runtime.repair(model, records, given, variants=variants)
    except runtime.InputError as e:
        return row | {"refused": str(e), "kept": False, "outcome": "refused", "repair s": process_time() - began, "error": row["error given"]}  # fmt: skip
    row |= {
        "repair s": process_time() - began, "kept": repair.kept, "before": repair.before, "after": repair.after,
        "lines": [c.line for c in repair.changes] or [list(c.lines) for c in repair.candidates[:1]],
        "equivalents": [list(one.lines) for one in repair.equivalent], "outcome": "unchanged", "error": row["error given"],
    }  # fmt: skip
    if not repair.kept:
        return row
    study = folder / "repaired.yaml"
    text = study_text(repair.study, folder, defaults=False, comments=repair.comments)
    study.write_text(text, encoding="utf-8")
    new = located(load_study(study), folder)
    robot = symgen.corrected(file, new)
    model = symgen.model(robot)
    result = runtime.identify(model, records_of(new.record, model, new), new)
    row["error"] = true_error(result, model, new, folder, clean, g)
    row["state"] = result.checklist.answer
    row["outcome"] = outcome(robot, model, new, folder, clean, alone, g)
    return row


def reading(study: Any, model: Any, name: str) -> Any:
    """Another record of the folder, read by the study."""
    own = study.record[0]
    files = (str(Path(own.files[0]).with_name(name)),)
    return records_of((replace(own, files=files),), model, study)[0]


def true_error(result: Any, model: Any, study: Any, folder: Path, clean: World, g: Array) -> float:
    """Error of torques of a second motion, %, read by the study; in the units of the true torques."""
    if not (result.determined and result.usable):
        return 100.0
    record = reading(study, model, "other.csv")
    W = runtime.observe(model, [record], study_like(study))
    fit = result.model_estimate
    index = [W.names.index(name) for name in fit.names]
    left = W.Y - W.W[:, index] @ fit.X
    size = [np.linalg.norm(W.Y[W.joint(j)]) for j in range(W.n)]
    by_joint = [np.linalg.norm(left[W.joint(j)]) / max(size[j], 1e-12) for j in range(W.n)]
    return 100 * float(np.sqrt(np.mean(np.minimum(by_joint, 10.0) ** 2)))


def study_like(study: Any) -> Any:
    return replace(study, record=())


def outcome(
    robot: Any, model: Any, study: Any, folder: Path, clean: World, alone: list[World], g: Array
) -> str:
    """Whether a mended study is right, equivalent, partly right, or false.

    alone : the truth with one of the errors, of any joint.
    """
    right = symgen.load_robot(folder / "truth.urdf")
    record = reading(study, model, "clean.csv")
    wrong = symgen.load_robot(folder / "arm.urdf")
    plain = runtime.read_record(str(folder / "clean.csv"), symgen.model(folder / "arm.urdf"))
    off = [
        float(robot.frame(j).theta0.value(robot.constants) - right.frame(j).theta0.value(right.constants))
        for j in robot.joints
    ]  # fmt: skip
    q = record.q + np.where(clean.robot.slides, 0.0, off)
    parts: list[tuple[bool, bool]] = []  # of each part: right, as given
    parts.append((near_rate(record, clean.t), near_rate(record, plain.t)))
    N = min(len(record), len(clean.t))
    k = min(int(np.argmin(np.abs(clean.t / clean.t[1] - record.t[0] / (record.t[1] - record.t[0])))), len(clean.t) - N)  # fmt: skip
    turns_ = np.where(clean.robot.slides, 0.0, 2 * pi)
    for j in range(record.n):
        own = q[:N, j]
        for key, tolerance in (("q", 0.06), ("tau", 0.06)):
            found_, true, given_ = (
                (own, clean.q, plain.q) if key == "q" else (record.tau[:N, j], clean.tau, plain.tau)
            )
            alike = []
            for part in (true, given_, *(getattr(w, key) for w in alone)):
                wanted = part[k : k + N, j]
                left = found_ - wanted
                if key == "q" and turns_[j]:
                    left = left - np.round(left.mean() / (2 * pi)) * 2 * pi
                size = np.sqrt((wanted**2).mean()) if key == "tau" else 1.0
                if key == "q" and not turns_[j]:
                    size = np.ptp(wanted) / 2
                alike.append(bool(np.sqrt((left**2).mean()) < tolerance * size))
            parts.append((alike[0], any(alike[1:])))
    for j in right.joints:
        for key in ("alpha", "d", "r0"):
            a, b, c = (
                float(getattr(one.frame(j), key).value(one.constants))
                for one in (robot, right, wrong)
            )
            parts.append((abs(a - b) < 0.02 + 0.05 * abs(b), abs(a - c) < 1e-6))
    found = np.array([float(x.value(robot.constants)) for x in robot.gravity])
    angles = [
        np.degrees(np.arccos(np.clip(found @ x / np.linalg.norm(found) / 9.81, -1, 1)))
        for x in (g, np.array([0, 0, -9.81]))
    ]
    parts.append((bool(angles[0] < 2.5), bool(angles[1] < 1e-3)))
    if all(true for true, _ in parts):
        return "right"
    best = left_of(right, None, folder, clean, g)
    own = left_of(robot, study, folder, clean, g)
    if own < 1.5 * best + 0.1:
        return "equivalent"
    return "partly" if all(true or given_ for true, given_ in parts) else "false"


def near_rate(record: Any, t: Array) -> bool:
    return bool(abs(record.rate * (t[-1] - t[0]) / (len(t) - 1) - 1) < 0.02)


def left_of(robot: Any, study: Any, folder: Path, clean: World, g: Array) -> float:
    """Error that a physical robot leaves of the noise-free record, %: by a study, or by the truth."""
    if study is None:
        robot = symgen.corrected(robot, {"gravity": [float(x) for x in g]})
        model = symgen.model(robot)
        record = runtime.Record(clean.t, clean.q, clean.tau)
    else:
        model = symgen.model(robot)
        record = reading(study, model, "clean.csv")
    part = runtime.plausibility(model, record, variants=symgen.variants(robot))
    result = runtime.identify(
        model, record, study_from_mapping({"estimate": {"method": "feasible"}})
    )
    del part
    return float(result.estimate.relative_error)


def told(w: World, share: float) -> bool:
    """Whether a noise-free record contradicts the study as given, by pinocchio's regressor."""
    model = pin.buildModelFromXML(w.urdf.urdf(w.urdf.nominal))
    data, n = model.createData(), w.robot.n
    kept = slice(50, -50, max(1, len(w.t) // 300))
    q, qd, qdd, tau = (x[kept] for x in (w.q, w.qd, w.qdd, w.tau))
    D = np.array(
        [pin.computeJointTorqueRegressor(model, data, *x) for x in zip(q, qd, qdd, strict=True)]
    )
    K, b = len(q), D.shape[2]
    W = np.zeros((K, n, b + 2 * n))
    W[:, :, :b] = D
    for j in range(n):
        W[:, j, b + j], W[:, j, b + n + j] = qd[:, j], np.sign(qd[:, j])
    size = np.sqrt((tau**2).mean(axis=0))
    A, y = (W / size[:, None]).reshape(K * n, -1), (tau / size).ravel()
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    least = np.concatenate([np.full(b, -np.inf), np.zeros(2 * n)])
    R = np.linalg.qr(np.column_stack([A / scale, y]), mode="r")
    x = lsq_linear(
        np.concatenate([R[:, :-1], 1e-6 * np.eye(len(scale))]),
        np.append(R[:, -1], 0 * scale),
        (least, np.inf),
        method="bvls",
    ).x
    left = np.sqrt((((y - A / scale @ x).reshape(K, n)) ** 2).mean(axis=0))
    return bool((left > 0.2 * share).any())


def table(rows: list[Row]) -> str:
    head = (
        "set", "studies", "told", "true error below 5 %: without", "with", "changed", "right", "equivalent", "partly", "false", "refused",
        "mended of those told", "s, median (most)", "identifications, most",
    )  # fmt: skip
    lines = []
    groups: list[tuple[str, list[Row]]] = []
    for which in ("right", "one", "two"):
        own = among(rows, set=which)
        if own:
            groups.append((which, own))
    for which, own in groups:
        kinds = [r["outcome"] for r in own]
        mended = [r for r in own if r["told"]]
        good = sum(r["outcome"] in ("right", "equivalent") for r in mended)
        seconds = [r["repair s"] for r in own]
        ratio = max(r["repair s"] / max(r["identify s"], 1e-3) for r in own)
        lines.append(
            (
                which, len(own), len(mended), sum(r["error given"] < 5 for r in own), sum(r["error"] < 5 for r in own),
                sum(r["kept"] for r in own), *(kinds.count(k) for k in ("right", "equivalent", "partly", "false", "refused")),
                f"{good} of {len(mended)}" if mended else "-", f"{middle(seconds)} ({max(seconds):.1f})", f"{ratio:.1f}",
            )
        )  # fmt: skip
    text = markdown(head, lines)
    kinds = [*dict.fromkeys(r["class"] for r in rows if r["set"] == "right")]
    if kinds:
        text += "\n\n" + markdown(
            ("class of right studies", "studies", "changed", "below 5 %: without", "with"),
            [
                (c, len(own), sum(r["kept"] for r in own), sum(r["error given"] < 5 for r in own), sum(r["error"] < 5 for r in own))
                for c in kinds
                for own in [[r for r in rows if r["set"] == "right" and r["class"] == c]]
            ],
        )  # fmt: skip
    labels = [e.label for e in ERRORS]
    wrong = [r for r in rows if r["errors"]]
    if wrong:
        text += "\n\n" + markdown(
            ("error", "studies with it", "told", "right or equivalent", "unchanged", "false", "below 5 % with"),
            [
                (label, len(own), sum(r["told"] for r in own), sum(r["outcome"] in ("right", "equivalent") for r in own),
                 sum(r["outcome"] == "unchanged" for r in own), sum(r["outcome"] == "false" for r in own), sum(r["error"] < 5 for r in own))
                for label in labels
                for own in [[r for r in wrong if label in r["errors"]]]
            ],
        )  # fmt: skip
    return text


def main() -> None:
    warnings.filterwarnings("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("--set", choices=("right", "one", "two"), required=True)
    parser.add_argument("--studies", type=int, default=12)
    parser.add_argument("--seeds", choices=[*BASE], default="first")
    parser.add_argument("--seconds", type=float, default=1e9, help="of processor time, then stop")
    parser.add_argument("--more", action="store_true")
    parser.add_argument("-o", type=Path, default=Path())
    parser.add_argument("-v", action="store_true")
    asked = parser.parse_args()
    file = asked.o / f"repair_{asked.set}_{asked.seeds}.json"
    rows: list[Row] = json.loads(file.read_text()) if asked.more and file.is_file() else []
    began = process_time()
    for k in range(len(rows), asked.studies):
        if process_time() - began > asked.seconds:
            break
        rows.append(one(k, BASE[asked.seeds] + k, asked.seeds, asked.set))
        file.write_text(json.dumps(rows, indent=1))
        if asked.v:
            r = rows[-1]
            print(k, r["robot"], r["class"], list(zip(r["errors"], r["joints"], strict=True)), "told", r["told"], r["outcome"], f"{r['error given']:.1f} -> {r['error']:.1f}", f"unseen {r.get('before', 0):.1f} {r.get('after', 0):.1f}", r.get("lines"), r.get("refused", ""), f"{r['repair s']:.1f}s {r['repair s'] / r['identify s']:.1f}", flush=True)  # fmt: skip
    print(table(rows))


if __name__ == "__main__":
    main()
