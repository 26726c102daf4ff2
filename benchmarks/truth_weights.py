"""Do weights by joint (estimate.method: wls) lower the true error of the parameters printed first?

A question of `benchmarks/truth.py`: `python benchmarks/truth.py --question weights --seeds final`.
Right records of three groups by turns, each identified by the default and by wls:

    equal noise     white torque noise of one deviation for all joints of one unit: 2 % of the mean rms
    unequal noise   by joint 0.1 to 5 % of the rms of its torque
    model error     dry friction that grows by 6 % of the rigid torque, or Stribeck friction; noise 1 %

The rule for a default: in each group the geometric mean of the ratio (wls over default) is below 1,
and no record has a ratio above 1.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import truth_simulator as world
from truth_rests import dwelling, held_torques
from truth_shared import (
    Array,
    Row,
    Unseen,
    among,
    emitted,
    markdown,
    record_of,
    robots_of,
    study,
)
from truth_simulator import Motion, Truth

import runtime

GROUPS = ("equal noise", "unequal noise", "model error")
WORSE = 1.3
"""Ratio of a record that no default may exceed."""


def weights(k: int, seed: int, seeds: str) -> list[Row]:
    """True error on unseen motion by the default and by wls, for one record."""
    robots = robots_of(seeds)
    group, robot = GROUPS[k % 3], robots[(k // 3) % len(robots)]
    rng, truth = np.random.default_rng([seed, 59]), Truth(robot, seed)
    motion = str(rng.choice(["fourier", "chirp", "rests"]))
    if motion == "rests":
        move = dwelling(robot, seed)
        tau = held_torques(truth, move, seed)
    else:
        move = world.MOTIONS[motion](robot, seed)
        tau = truth.torque(move)
    rms = np.sqrt((tau**2).mean(axis=0))
    if group == "model error":
        tau = tau + lacking(truth, move, load=bool(rng.uniform() < 0.5))
    slides = robot.slides
    common = np.array([rms[slides == own].mean() for own in slides])
    sigma = {
        "equal noise": 0.02 * common,
        "unequal noise": rms * np.exp(rng.uniform(np.log(0.001), np.log(0.05), robot.n)),
        "model error": 0.01 * rms,
    }[group]
    record = record_of(move, tau + sigma * rng.standard_normal(tau.shape))
    model, unseen = emitted(robot.name)[0], Unseen(truth, seed)
    row: Row = {"group": group, "robot": robot.name, "motion": motion}
    for name, settings in (("default", study()), ("wls", study(estimate={"method": "wls"}))):
        result: Any = runtime.identify(model, record, settings)
        if not (result.determined and result.usable):
            return [row | {"undetermined": name}]
        fit = result.model_estimate
        total, worst = unseen.errors(fit.names, fit.X)
        row |= {name: total, f"{name}, worst joint": worst, f"{name}, set": result.model_columns}
    return [row]


def lacking(truth: Truth, move: Motion, *, load: bool) -> Array:
    """Friction that the model lacks: 6 % of the rigid torque, or Stribeck's, of half of FS."""
    if load:
        rigid = truth.torque(move) - truth.friction(move.qd)
        return np.asarray(0.06 * np.abs(rigid) * np.sign(move.qd))
    slow = np.array([0.1 * joint.speed for joint in truth.robot.joints])
    return np.asarray(0.5 * truth.bodies.dry * np.sign(move.qd) * np.exp(-((move.qd / slow) ** 2)))


def weights_table(rows: list[Row]) -> str:
    head = (
        "group", "records", "geometric mean of wls over default", "of the worst joint", "better", f"more than {WORSE} times worse",
        "largest ratio", "at", "from, %", "to, %",
    )  # fmt: skip
    lines = []
    for group in (*GROUPS, "all"):
        own = [r for r in (rows if group == "all" else among(rows, group=group)) if "wls" in r]
        if not own:
            continue
        ratio = np.array([r["wls"] / r["default"] for r in own])
        joint = [r["wls, worst joint"] / r["default, worst joint"] for r in own]
        worst = own[int(ratio.argmax())]
        lines.append(
            (
                group, len(own), f"{np.exp(np.log(ratio).mean()):.3f}", f"{np.exp(np.log(joint).mean()):.3f}",
                int((ratio < 1).sum()), int((ratio > WORSE).sum()), f"{ratio.max():.2f}",
                f"{worst['robot']}, {worst['motion']}", f"{worst['default']:.2g}", f"{worst['wls']:.2g}",
            )
        )  # fmt: skip
    return markdown(head, lines)
