"""Records with rests and stick friction, and how `symgen identify` does on them with its defaults.

A question of `benchmarks/truth.py`: `python benchmarks/truth.py --question rests --seeds first`.
A joint at rest is held by dry friction, whose torque there is any number between -FSS and FSS
(FSS = 1 to 1.3 FS, the torque that breaks it away). Two ways to get the torques, by turns:

    planned     q as planned, exact rests; the held torque drifts from one random number to another
    loop        a PD controller with a feed-forward of the nominal bodies; stick and slip by Karnopp
                (1985): a joint of speed zero sticks while the friction that holds it is below FSS

and two motions: every joint with moves and rests of its own (`dwelling`), or all joints together
(`truth_simulator.points`). No code of symgen makes any of it.
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pinocchio as pin
import truth_simulator as world
from truth_shared import (
    Array,
    Row,
    Unseen,
    among,
    deviations,
    emitted,
    markdown,
    middle,
    robots_of,
    true_parameters,
)
from truth_simulator import RATE, Encoder, Motion, Robot, Truth, encoded, noise

import runtime

SECONDS = 10.0
BREAKAWAY = (1.0, 1.3)
"""FSS/FS."""


def dwelling(robot: Robot, seed: int, seconds: float = SECONDS, rest: float = 0.35) -> Motion:
    """Moves of every joint by itself, polynomials of degree 5, with rests between them.

    About the share `rest` of the time of every joint is rest.
    """
    rng = np.random.default_rng([seed, 19])
    t = np.arange(round(seconds * RATE)) / RATE
    q, qd, qdd = np.zeros((3, len(t), robot.n))
    for j, joint in enumerate(robot.joints):
        here, begin = joint.reach * rng.uniform(-0.9, 0.9), seconds * rng.uniform(0.02, 0.08)
        q[:, j] = here
        while begin < seconds:
            way = joint.reach * rng.uniform(-0.9, 0.9) - here
            last = max(1.875 * abs(way) / joint.speed, 0.25) * rng.uniform(1.0, 2.0)
            u = np.clip((t - begin) / last, 0.0, 1.0)
            q[:, j] += way * (10 * u**3 - 15 * u**4 + 6 * u**5)
            qd[:, j] += way / last * 30 * (u * (1 - u)) ** 2
            qdd[:, j] += way / last**2 * 60 * u * (1 - u) * (1 - 2 * u)
            here += way
            begin += last * (1 + rest / (1 - rest) * rng.uniform(0.4, 1.6))
    return Motion(t, q, qd, qdd)


def held_torques(truth: Truth, move: Motion, seed: int) -> Array:
    """Torques of a planned motion, (N, n): in every rest the friction drifts between two random levels."""
    rng = np.random.default_rng([seed, 43])
    most = truth.bodies.dry * rng.uniform(*BREAKAWAY, truth.robot.n)
    tau = truth.torque(move)
    for j in range(truth.robot.n):
        still = np.concatenate([[False], move.qd[:, j] == 0, [False]])
        for a, b in np.flatnonzero(np.diff(still)).reshape(-1, 2):
            tau[a:b, j] += most[j] * np.linspace(*rng.uniform(-1, 1, 2), b - a)
    return np.asarray(tau)


def stick_slip(
    truth: Truth, reference: Motion, encoder: Encoder, seed: int
) -> tuple[Motion, Array, Array]:
    """The reference followed with stick and slip: motion, positions of the encoder, torques.

    tau = tau_ff + Kp (q_r - q_e) + Kd (qd_r - qd_e), qd_e through a low-pass of 40 Hz, held for a
    tick; semi-implicit Euler, two steps a tick. A joint whose speed passes zero stops, and stays
    while the torque that holds it is below FSS.
    """
    robot, model, data, n = truth.robot, truth.model, truth.data, truth.robot.n
    rng = np.random.default_rng([seed, 47])
    viscous, dry = truth.bodies.viscous, truth.bodies.dry
    most = dry * rng.uniform(*BREAKAWAY, n)
    lines = world.lines_of(robot, encoder, seed)
    ff = Truth(robot, 0, bodies=robot.nominal).torque(reference)
    M = np.mean([np.diag(pin.crba(model, data, q)) for q in reference.q[::500]], axis=0)
    w = 2 * pi * rng.uniform(3.0, 7.0)
    Kp, Kd = w**2 * M, 1.4 * w * M
    x, v = reference.q[0].copy(), reference.qd[0].copy()
    N, h, keep = len(reference.t), 0.5 / RATE, np.exp(-2 * pi * 40 / RATE)
    q, qd, qdd, told, tau = np.empty((5, N, n))
    seen, speed = lines.position(lines.counts(x)), v.copy()

    def acceleration(torque: Array) -> Array:
        full = pin.crba(model, data, x)
        full = np.triu(full) + np.triu(full, 1).T
        drive = torque - pin.nonLinearEffects(model, data, x, v) - viscous * v
        held, friction = v == 0, dry * np.sign(v)
        while True:  # each pass releases a joint at least
            a = np.zeros(n)
            free = ~held
            if free.any():
                a[free] = np.linalg.solve(full[np.ix_(free, free)], (drive - friction)[free])
            needed = drive - full @ a
            slips = held & (np.abs(needed) > most)
            if not slips.any():
                return a
            first = int(np.argmax(np.where(slips, np.abs(needed) / most, 0)))
            held[first], friction[first] = False, dry[first] * np.sign(needed[first])

    for i in range(N):
        before, seen = seen, lines.position(lines.counts(x))
        if i:
            speed = keep * speed + (1 - keep) * (seen - before) * RATE
        torque = ff[i] + Kp * (reference.q[i] - seen) + Kd * (reference.qd[i] - speed)
        q[i], qd[i], told[i], tau[i] = x, v, seen, torque
        for k in range(2):
            a = acceleration(torque)
            if not k:
                qdd[i] = a
            after = v + h * a
            after[after * v < 0] = 0.0
            x, v = x + h * (v + after) / 2, after
    return Motion(reference.t, q, qd, qdd), told, tau


def resting_record(robot: Robot, truth: Truth, seed: int, kind: int) -> tuple[Any, float]:
    """A record with rests, by the four ways in turn, and the share of rest of its joint that rests most."""
    rng = np.random.default_rng([seed, 53])
    plan = dwelling if kind % 2 == 0 else world.points
    move = plan(robot, seed, seconds=SECONDS, rest=float(rng.uniform(0.15, 0.5)))
    encoder = Encoder(2 * pi / float(rng.choice([2e4, 6.5e4, 2.6e5])))
    if kind % 4 < 2:
        tau, q = held_torques(truth, move, seed), encoded(robot, move, encoder, seed)
        share = float((move.qd == 0).mean(axis=0).max())
    else:
        done, q, tau = stick_slip(truth, move, encoder, seed)
        share = float((done.qd == 0).mean(axis=0).max())
    tau = tau + noise(tau, 0.0, float(rng.choice([0.003, 0.01, 0.02])), seed)
    every = int(rng.choice([1, 2, 4]))
    return runtime.Record(move.t[::every], q[::every], tau[::every]), share


WAYS = ("planned, own moves", "planned, together", "loop, own moves", "loop, together")


def rests(k: int, seed: int, seeds: str) -> list[Row]:
    """One record with rests, by the defaults: verdict, true error on unseen motion, intervals."""
    robots = robots_of(seeds)
    robot, kind = robots[(k // 4) % len(robots)], k % 4
    truth = Truth(robot, seed)
    model, variants = emitted(robot.name)
    record, rest = resting_record(robot, truth, seed, kind)
    result = runtime.identify(model, record, variants=variants)
    plausible = result.part("plausibility")
    row: Row = {
        "way": WAYS[kind], "robot": robot.name, "rest": rest, "state": result.checklist.answer,
        "doubts": [c.question for c in result.checklist.checks if c.state in ("no", "doubtful")],
        "causes": [one["cause"] for one in plausible.named_causes] if plausible else [],
        "rows": list(result.observation.rows), "dropped": list(result.observation.dropped["low_speed"]),
    }  # fmt: skip
    if not (result.determined and result.usable):
        return [row | {"count": 0, "inside": 0, "error": float("nan")}]
    fit, X = result.model_estimate, true_parameters(truth, seed)
    s, at = deviations(fit), [model.BASE_PARAMETERS.index(name) for name in fit.names]
    known = np.isfinite(s) & (s > 0)
    inside = np.abs(fit.X - X[at])[known] < 1.96 * s[known]
    total, _ = Unseen(truth, seed).errors(fit.names, fit.X)
    return [row | {"count": int(known.sum()), "inside": int(inside.sum()), "error": total}]


def rests_table(rows: list[Row]) -> str:
    head = (
        "way", "studies", "Yes", "With care", "No", "largest true error of a Yes, %", "median true error, %",
        "95 % intervals hold, %", "false cause",
    )  # fmt: skip
    lines = []
    for way in (*WAYS, "all"):
        own = rows if way == "all" else among(rows, way=way)
        words = [sum(r["state"].startswith(word) for r in own) for word in ("Yes", "With", "No")]
        yes = [r["error"] for r in own if r["state"].startswith("Yes")]
        count = sum(r["count"] for r in own)
        lines.append(
            (
                way, len(own), *words, f"{max(yes):.2g}" if yes else "-", middle([r["error"] for r in own]),
                f"{100 * sum(r['inside'] for r in own) / count:.1f}" if count else "-",
                sum(bool(r["causes"]) for r in own),
            )
        )  # fmt: skip
    return markdown(head, lines)
