"""The reader of counts beside the best low-pass of a grid, with faults, and on random readings: two
questions of `benchmarks/truth.py`.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np
import truth_simulator as world
from truth_shared import (
    LEVEL,
    Array,
    Row,
    Unseen,
    among,
    emitted,
    least_squares,
    markdown,
    middle,
    record_of,
    robots_of,
)
from truth_simulator import Encoder, Motion, Robot, Truth, encoded, noise

import runtime
from runtime.counts.reading import read_counts
from runtime.study import study_from_mapping

GRID = (6.0, 8.0, 10.0, 15.0, 20.0, 30.0, 50.0, 80.0)
"""Cut-offs of the low-pass that the reader of counts is compared with, Hz."""
STEPS = (5000, 1000, 250)


@dataclass(frozen=True)
class Fault:
    """Something the encoders or the motion have; `name`: what a finding that names it matches."""

    label: str
    encoder: Encoder
    name: str = ""
    motion: str = ""
    loop: bool = False


EVEN = Encoder(2 * pi / 1000)
FAULTS = (
    Fault("three lost counts", replace(EVEN, lost=3), r"lost|jump|slip"),
    Fault("jitter of 0.2 period", replace(EVEN, jitter=0.2), r"jitter|stamps?|instants"),
    Fault(
        "eccentric by 4 steps", replace(EVEN, eccentric=4.0), r"eccentric|once a turn|a turn|uneven"
    ),
    Fault("quadrature of 0.05 step", replace(EVEN, quadrature=0.05), r"uneven|quadrature|lines"),
    Fault("slow motion", EVEN, r"slow|few|speed", motion="slow"),
    Fault("rests 20 to 27 %", EVEN, r"rest|low_speed|stand", motion="points"),
    Fault("encoder in the loop", EVEN, r"to and fro|loop|shakes?", loop=True),
)


def contradiction(
    q: Array, s_q: Array, told: Array, steps: Array, errors: float
) -> tuple[float, float]:
    """Share of samples whose position lies outside the interval of its count by more than three of
    its deviations and the true errors of the lines, in steps, and the largest distance beyond the
    interval, steps. nan: everywhere.
    """
    if not (np.isfinite(q).all() and np.isfinite(s_q).all()):
        return 1.0, float("inf")
    beyond = np.abs(q - told) / steps - 0.5
    return float((beyond > 3 * s_q / steps + errors).mean()), float(beyond.max())


def line_errors(encoder: Encoder) -> float:
    """Largest error of a line, steps, that the encoder can have."""
    return 4 * encoder.random + encoder.eccentric + 2 * encoder.quadrature + 0.02


def counts(k: int, seed: int, seeds: str) -> list[Row]:
    """One record of counts, of even encoders (even k) or with a fault: true error by the reader and
    by the low-pass of each cut-off of GRID, all parameters by least squares.
    """
    robots = robots_of(seeds)
    rng, fault = (
        np.random.default_rng([seed, 61]),
        FAULTS[(k // 2) % len(FAULTS)] if k % 2 else None,
    )
    cell = k // 2
    robot = robots[(cell // (len(FAULTS) if fault else 1)) % len(robots)]
    motion = (fault.motion if fault else "") or ("fourier", "chirp", "points", "fourier")[
        int(rng.integers(4)) if fault is None else int(rng.integers(2))
    ]
    if motion == "slow" and (cell // (len(FAULTS) * len(robots))) % 2:
        motion = "crawl"
    encoder = (
        fault.encoder if fault else Encoder(2 * pi / STEPS[(cell // len(robots)) % len(STEPS)])
    )
    truth, steps = Truth(robot, seed), encoder.steps(robot)
    move = (
        world.points(robot, seed, rest=0.24)
        if motion == "points"
        else world.MOTIONS[motion](robot, seed)
    )
    if fault and fault.loop:
        move, told, tau = world.in_loop(truth, move, encoder, seed)
    else:
        told, tau = encoded(robot, move, encoder, seed), truth.torque(move)
        tau = tau + noise(tau, 0.9, 0.01, seed)
    record, unseen = (
        record_of(move, tau, told),
        Unseen(truth, seed, slow=motion in ("slow", "crawl")),
    )
    low = [0.02 * j.speed for j in robot.joints]
    rows = {"rows": {"low_speed": low}} if motion == "points" and not fault else {}
    own: Row = {
        "robot": robot.name,
        "motion": motion,
        "fault": fault.label if fault else "",
        "per_turn": round(2 * pi / encoder.step),
    }
    errors = {
        cutoff: solved(
            record, robot, unseen, signals={"median": 1, "lowpass": {"cutoff": cutoff}}, **rows
        )[0]
        for cutoff in GRID
    }
    best = min(errors, key=lambda c: errors[c])
    error, findings = solved(
        record, robot, unseen, signals={"reader": "counts", "step": steps.tolist()}, **rows
    )
    try:
        reading = read_counts(told, world.RATE, steps)
        share, beyond = contradiction(reading.q, reading.s_q, told, steps, line_errors(encoder))
        off = np.sqrt(((reading.q - move.q) ** 2).mean(axis=0)) / steps
        z = np.abs(reading.q - move.q) / np.maximum(reading.s_q, 1e-12)
        own |= {"position": float(off.max()), "outside": share, "beyond": beyond, "inside": float((z < LEVEL).mean()),
                "acceleration": float((np.sqrt((reading.qdd**2).mean(axis=0)) / np.sqrt((move.qdd**2).mean(axis=0))).max())}  # fmt: skip
        findings = (*reading.findings, *findings)
    except runtime.InputError as e:
        findings = (f"refused: {e}",)
        own |= {
            "position": None,
            "outside": None,
            "beyond": None,
            "inside": None,
            "acceleration": None,
        }
    own |= {"counts": error, "lowpass": errors[best], "cutoff": best, "at 50 Hz": errors[50.0], "findings": list(dict.fromkeys(findings)),
            "named": bool(fault and any(re.search(fault.name, text) for text in findings))}  # fmt: skip
    return [own]


def solved(
    record: Any, robot: Robot, unseen: Unseen, **sections: Any
) -> tuple[float, tuple[str, ...]]:
    """True error of all parameters in %, and the findings; nan where the record is refused."""
    try:
        seen = runtime.observe(emitted(robot.name)[0], record, study_from_mapping(sections))
    except (runtime.InputError, ValueError) as e:
        return float("nan"), (f"refused: {e}",)
    if not np.isfinite(seen.W).all():
        return float("nan"), (*seen.findings, "W is not finite")
    return unseen.errors(seen.names, least_squares(seen.W, seen.Y))[0], tuple(seen.findings)


def counts_table(rows: list[Row]) -> str:
    lines, head = [], ("record", "cells", "counts, median % (largest)", "best low-pass, median %", "low-pass 50 Hz, median %",
                       "counts over best low-pass, median (largest)", "worse than 1.05 times and 0.5 %", "error above 1.5 times and not named",
                       "named", "any finding", "positions outside their counts, nan", "inside 95 %, %", "error of q, steps, median (largest)")  # fmt: skip
    groups = [
        (f"even, 2 pi/{s}", [r for r in rows if not r["fault"] and r["per_turn"] == s])
        for s in STEPS
    ]
    groups += [(fault.label, among(rows, fault=fault.label)) for fault in FAULTS]
    for label, own in groups:
        if not own:
            continue
        ratio = [r["counts"] / r["lowpass"] for r in own]
        worse = sum(not (r["counts"] <= max(1.05 * r["lowpass"], r["lowpass"] + 0.5)) for r in own)
        silent = sum(not (r["counts"] <= 1.5 * r["lowpass"] or r["named"]) for r in own)
        inside = [r["inside"] for r in own if r["inside"] is not None]
        place = [r["position"] for r in own if r["position"] is not None]
        lines.append((label, len(own), f"{middle([r['counts'] for r in own])} ({np.nanmax([r['counts'] for r in own]):.0f})", middle([r["lowpass"] for r in own]),
                      middle([r["at 50 Hz"] for r in own]), f"{middle(ratio)} ({np.nanmax(ratio):.1f})", worse, silent if "even" not in label else "-",
                      sum(r["named"] for r in own) if "even" not in label else "-", sum(bool(r["findings"]) for r in own),
                      sum(r["outside"] is None or r["outside"] > 1e-3 for r in own), f"{100 * np.mean(inside):.0f}" if inside else "-",
                      f"{middle(place)} ({max(place, default=np.nan):.1f})"))  # fmt: skip
    return markdown(head, lines)


CONDITIONS = ("healthy", "jitter", "lost", "eccentric", "random lines", "quadrature", "rough")
FREE = world.Robot(
    "free",
    tuple(replace(world.FIRST[0].joints[0], reach=r, speed=s) for r, s in ((1.0, 2.0), (2.5, 6.0))),
)


def counts_random(k: int, seed: int, seeds: str) -> list[Row]:
    """One reading of two encoders, 2 s of any motion, half of them healthy."""
    rng = np.random.default_rng([seed, 67, ("first", "second", "third", "fourth").index(seeds)])
    condition = "healthy" if k % 2 == 0 else CONDITIONS[1 + (k // 2) % (len(CONDITIONS) - 1)]
    step, motion = 2 * pi / 10 ** rng.uniform(2.0, 5.0), list(world.MOTIONS)[int(rng.integers(4))]
    size = 10 ** rng.uniform(-2, 0)
    move = world.MOTIONS[motion](FREE, seed, seconds=2.0)
    move = Motion(move.t, move.q * size, move.qd * size, move.qdd * size)
    encoder = {
        "jitter": Encoder(step, jitter=float(rng.uniform(0.05, 0.3))),
        "lost": Encoder(step, lost=int(rng.integers(1, 30))),
        "eccentric": Encoder(step, eccentric=float(rng.uniform(0.5, 6.0))),
        "random lines": Encoder(step, random=float(rng.uniform(0.02, 0.2))),
        "quadrature": Encoder(step, quadrature=float(rng.uniform(0.02, 0.2))),
    }.get(condition, Encoder(step))
    if condition == "rough":
        move = replace(
            move, q=move.q + step * rng.uniform(0.1, 2.0) * rng.standard_normal(move.q.shape)
        )
    told = encoded(FREE, move, encoder, seed)
    row: Row = {
        "condition": condition,
        "motion": motion,
        "per_turn": 2 * pi / step,
        "steps": float(np.ptp(move.q, axis=0).min() / step),
    }
    began = time.process_time()
    try:
        reading = read_counts(told, world.RATE, encoder.steps(FREE))
    except runtime.InputError as e:
        return [row | {"refused": str(e)}]
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as e:
        return [row | {"refused": "", "exception": repr(e)}]
    share, beyond = contradiction(
        reading.q, reading.s_q, told, encoder.steps(FREE), line_errors(encoder)
    )
    z = np.abs(reading.q - move.q) / np.maximum(reading.s_q, 1e-12)
    energy = np.sqrt((reading.qdd**2).mean(axis=0)) / np.sqrt((move.qdd**2).mean(axis=0))
    return [row | {"refused": "", "outside": share, "beyond": beyond, "inside": float((z < LEVEL).mean()), "energy": float(np.max(energy)),
                   "off": float((np.sqrt(((reading.q - move.q) ** 2).mean(axis=0)) / encoder.steps(FREE)).max()),
                   "findings": list(reading.findings), "time": time.process_time() - began}]  # fmt: skip


def counts_random_table(rows: list[Row]) -> str:
    lines = []
    for condition in (*CONDITIONS, "all"):
        own = [r for r in rows if condition in (r["condition"], "all")]
        read = [r for r in own if "outside" in r]
        wrong = [r for r in read if r["outside"] > 1e-3 or not np.isfinite(r["beyond"])]
        lines.append((condition, len(own), sum(bool(r["refused"]) for r in own), sum("exception" in r for r in own), len(wrong),
                      sum(not np.isfinite(r["beyond"]) for r in read), sum(not r["findings"] for r in wrong),
                      sum(r["energy"] > 50 for r in read), sum(r["off"] > 1.0 for r in read), f"{100 * np.mean([r['inside'] for r in read]):.0f}" if read else "-"))  # fmt: skip
    head = ("encoders", "readings", "refused", "other exceptions", "positions outside their counts", "of these nan", "of these without a finding",
            "accelerations above 50 times the true rms", "error above one step rms", "positions inside 95 %, %")  # fmt: skip
    return markdown(head, lines)
