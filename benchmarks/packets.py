"""Rows that repeat packets, and torques without their sign: `python benchmarks/packets.py WHAT [FIRST-LAST]`.

right    right records (slow and fast motion, moves with rests, coarse and noisy encoders, coarse
         torques, 25 Hz to 5 kHz): what is found of them is false
buses    right records whose signals are made to repeat packets: what is found, and the error of the
         torque of the values
signs    right torques, also those that stay on one side of zero, for false findings; and the same
         torques as registers with a bit for the sign, as two's complement, and as magnitudes

Records of the arm of two_links.py, by seeds FIRST to LAST. The counts are those of packets.md.
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import two_links

from runtime import compose
from runtime.core.problem import estimated, observe_rows
from runtime.core.record import Record
from runtime.ground.errors import InputError
from runtime.packets.held import held_positions, repeated_mostly
from runtime.packets.packets import slowest_bus
from runtime.plausible.registers import LIMIT, kinks_at_zero, register_bit
from runtime.study import study_from_mapping

Array = np.ndarray
ARM = {"L": 0.3, "ZZ1R": 0.1887, "MX1R": 0.540, "ZZ2": 0.0180, "MX2": 0.100, "Ia2": 0.0}
ARM |= {"FV": np.array([0.30, 0.15]), "FS": np.array([0.4, 0.2])}
RATES = (25, 100, 500, 1000, 5000)  # Hz
MOTIONS = ("sines", "slow", "one stands", "quintic", "trapezoid", "line")
ENCODERS = (0.0, 2 * np.pi / 500, 2 * np.pi / 4096, 2 * np.pi / 100000)  # rad; 0: none
SIGNALS = list(itertools.product(ENCODERS, (0.0, 1.0, 3.0), (0.0, 0.05, 0.5), (0.0, 0.03)))
"""Step of the encoder, its noise in steps (without encoder in 0.1 mrad), step and noise of the torque, N m."""
DRAWN = 8  # of SIGNALS, for each seed, rate and motion


def sines(seed: int, rate: float, seconds: float, size: float = 0.5, f: float = 0.15, n: int = 5):
    """t, q, qd, qdd of n sines of each joint."""
    rng, t = np.random.default_rng(seed), np.arange(round(rate * seconds)) / rate
    q, qd, qdd = np.zeros((3, len(t), 2))
    for j, k in itertools.product(range(2), range(1, n + 1)):
        w = 2 * np.pi * f * k
        a, b = rng.uniform(-size, size, 2) / k**0.7
        s, c = np.sin(w * t), np.cos(w * t)
        q[:, j] += a * s + b * c
        qd[:, j] += w * (a * c - b * s)
        qdd[:, j] -= w * w * (a * s + b * c)
    return t, q, qd, qdd


def moves(seed: int, rate: float, seconds: float, kind: str):
    """t, q, qd, qdd of moves from point to point with rests between them."""
    rng, t = np.random.default_rng(seed), np.arange(round(rate * seconds)) / rate
    q = np.zeros((len(t), 2))
    for x in q.T:
        at, here = 0.0, rng.uniform(-1, 1)
        x[:] = here
        while at < seconds:
            last, rest, there = (
                rng.uniform(0.4, 1.5),
                rng.uniform(0.05, 1.0),
                rng.uniform(-1.2, 1.2),
            )
            s = np.clip((t - at) / last, 0, 1)
            if kind == "quintic":
                s = 10 * s**3 - 15 * s**4 + 6 * s**5
            elif kind == "trapezoid":  # a fifth of the time to speed up, and to slow down
                a = 0.2
                ends = np.where(s < a, s**2 / 2 / a, 1 - a - (1 - s) ** 2 / 2 / a)
                s = np.where((s >= a) & (s < 1 - a), s - a / 2, ends) / (1 - a)
            x[t >= at] = here + (there - here) * s[t >= at]
            here, at = there, at + last + rest
    qd = np.gradient(q, 1 / rate, axis=0)
    return t, q, qd, np.gradient(qd, 1 / rate, axis=0)


def motion(kind: str, seed: int, rate: float):
    """t, q, qd, qdd of a motion of MOTIONS, of 20 s or 60000 rows at most."""
    seconds = min(20.0, 60000 / rate)
    if kind == "slow":
        return sines(seed, rate, seconds, size=0.1, f=0.03, n=2)
    if kind not in ("sines", "one stands"):
        return moves(seed, rate, seconds, kind)
    t, q, qd, qdd = sines(seed, rate, seconds)
    if kind == "one stands":
        q[:, 1], qd[:, 1], qdd[:, 1] = 0.3, 0.0, 0.0
    return t, q, qd, qdd


def right_records(seeds: range) -> Iterator[tuple[str, Record]]:
    """Yield right records with a description; three in ten are written with few digits."""
    for seed, rate, kind in itertools.product(seeds, RATES, MOTIONS):
        rng = np.random.default_rng([seed, rate, MOTIONS.index(kind)])
        t, q, qd, qdd = motion(kind, seed, rate)
        tau = two_links.torque(ARM, q, qd, qdd)
        for k in rng.choice(len(SIGNALS), DRAWN, replace=False):
            step, steps, torque_step, noise = SIGNALS[k]
            x = q + steps * (step or 1e-4) * rng.standard_normal(q.shape)
            x = step * np.round(x / step) if step else x
            y = tau + noise * rng.standard_normal(q.shape)
            y = torque_step * np.round(y / torque_step) if torque_step else y
            if rng.random() < 0.3:
                x, y = np.round(x, 5), np.round(y, 3)
            text = f"seed {seed}, {rate} Hz, {kind}, encoder {step:.5f} rad, noise {steps:g} steps"
            yield f"{text}, torque step {torque_step:g}, noise {noise:g} N m", Record(t, x, y)


def found_in(record: Record) -> list[str]:
    """Name what the detectors find in a record."""
    found = []
    try:
        bus = slowest_bus(record)
        found += [f"bus of the {bus.carries}"] if bus else []
    except InputError:
        found.append("signals of different times")
    if any(repeated_mostly(x) for x in record.q.T):
        found.append("positions that repeat at no uniform times")
    if (held := held_positions(record.q).any(axis=1)).any():
        found.append(f"held packets ({held.sum()} of {len(held)} rows)")
    return found


def right(seeds: range) -> None:
    total, counts = 0, Counter[str]()
    for text, record in right_records(seeds):
        total += 1
        for finding in found_in(record):
            counts[finding.partition(" (")[0]] += 1
            print(f"{finding}: {text}", flush=True)
    print(f"{total} right records; false: {dict(counts) or 'none'}")


def repeated(x: Array, period: float, phase: float = 0.0, jitter: float = 0.0) -> Array:
    """Return the last packet of a bus in each row of x; period, phase and jitter in rows."""
    rows = np.arange(len(x))
    rng, k = np.random.default_rng(3), np.arange(-2, int(len(x) / period) + 2)
    ticks = phase + period * k + rng.uniform(-jitter, jitter, len(k))
    at = np.clip(ticks[np.searchsorted(ticks, rows + 1e-9, side="right") - 1], 0, len(x) - 1)
    return np.stack([np.interp(at, rows, column) for column in x.T], axis=1)


def lost(x: Array, rows: Array, length: int) -> Array:
    """Return x where the packet of each of `rows` is held for `length` more rows."""
    x = x.copy()
    for k in rows:
        x[k + 1 : k + 1 + length] = x[k]
    return x


def repeating(q: Array, tau: Array, seed: int) -> dict[str, tuple[Array, Array]]:
    """Make positions q and torques tau of right rows repeat packets."""
    cases = {"right": (q, tau)}
    for period in (10, 20 / 3, 4 / 3, 50):
        cases[f"all, {period:.4g} rows"] = repeated(q, period), repeated(tau, period)
    for period in (10, 2.5):
        cases[f"positions, {period:g} rows"] = repeated(q, period), tau
    for period in (10, 40):
        cases[f"torques, {period} rows"] = q, repeated(tau, period)
    cases["positions 5, torques 10 rows"] = repeated(q, 5), repeated(tau, 10)
    cases["positions 4, torques 10 rows"] = repeated(q, 4), repeated(tau, 10)
    turns = [np.column_stack([repeated(x, 10)[:, 0], repeated(x, 10, 5)[:, 1]]) for x in (q, tau)]
    cases["joints in turn, 10 rows"] = turns[0], turns[1]
    for jitter in (0.8, 4.0):
        both = (repeated(x, 10, jitter=jitter) for x in (q, tau))
        cases[f"all, 10 +- {jitter:g} rows"] = next(both), next(both)
    for count, length in ((14, 3), (60, 1), (40, 8), (3, 1), (5, 200)):
        rows = np.random.default_rng(seed).choice(np.arange(20, len(q) - 300, 10), count, False)
        name = f"{count} packets held for {length} rows"
        cases[name] = lost(q, rows, length), lost(tau, rows, length)
    return cases


def buses(seeds: range) -> None:
    study, model, rate = study_from_mapping({}), two_links.model_of(ARM), 1000.0
    print("| repeats | error, %, by seed | told |\n|---|---|---|")
    errors: dict[str, list[str]] = {}
    told: dict[str, set[str]] = {}
    for seed in seeds:
        t, q, qd, qdd = sines(seed, rate, 20.0)
        noise = np.random.default_rng(seed + 1000).standard_normal(q.shape) * (0.05, 0.02)
        tau = two_links.torque(ARM, q, qd, qdd) + noise
        step = 2 * np.pi / 65536
        for name, (x, y) in repeating(step * np.round(q / step), tau, seed).items():
            try:
                problem = compose.problem(model, Record(t, x, y, rate=rate, name="r"), study)
            except InputError as error:
                errors.setdefault(name, []).append("refused")
                told.setdefault(name, set()).add("refused: " + words(error.message))
                continue
            fit = estimated(problem, observe_rows(problem))
            note = problem.noted("packets")
            error = two_links.error_of(model, ARM, fit, q, rate)
            errors.setdefault(name, []).append(f"{error:.2f}")
            told.setdefault(name, set()).add("" if note is None else words(note.text))
    for name, own in errors.items():
        print(f"| {name} | {', '.join(own)} | {'; '.join(sorted(told[name]))} |", flush=True)


def words(text: str) -> str:
    """Return what a note on packets tells of a record, before its consequences."""
    return text.removeprefix("r: ").partition(", as if")[0].partition(": ")[0].partition(", but")[0]


def unsigned(x: Array, rate: float) -> bool:
    """Whether a torque is judged to have no sign."""
    return register_bit(x) is not None or kinks_at_zero(x, rate) >= LIMIT.FEWEST_KINKS


def signs(seeds: range) -> None:
    total, false, counts = 0, 0, Counter[str]()
    for seed, rate in itertools.product(seeds, (100, 250, 1000)):
        _, q, qd, qdd = sines(seed, rate, 20.0)
        q[:, 0] += np.pi / 2 * (seed % 2)  # upright: gravity changes its sign
        friction = {"FS": np.array([0.05, 0.02]), "FV": np.array([0.05, 0.02])}
        tau = two_links.torque(ARM | (friction if seed % 3 == 0 else {}), q, qd, qdd)
        rng, lowest, size = np.random.default_rng(seed), tau.min(axis=0), np.ptp(tau, axis=0)
        offset = np.abs(tau).max(axis=0) * rng.uniform(0, 1.2, 2)
        above = (tau, tau + offset, tau - lowest, tau - lowest + 0.02 * size)
        for y, noise, step in itertools.product(above, (0.0, 0.02), (0.0, 0.01, 0.1)):
            y = y + noise * rng.standard_normal(tau.shape) * tau.std(axis=0)
            y = step * np.round(y / step) if step else y
            total += 2
            false += sum(unsigned(x, rate) for x in y.T)
        for noise, x in itertools.product((0.0, 0.02), tau.T):
            if np.count_nonzero(np.diff(np.sign(x))) < 6:  # a sign that hardly changes
                continue
            step = np.abs(x).max() / 700
            y = x + noise * rng.standard_normal(x.shape) * x.std()
            raw = np.round(y / step)
            counts["torques, half of them with noise"] += 1
            signed = register_bit(step * np.where(raw < 0, 1024 - raw, raw))
            counts["bit for the sign"] += signed == (10, False)
            twos = register_bit(step * np.where(raw < 0, 65536 + raw, raw))
            counts["two's complement"] += twos == (15, True)
            kind = "magnitudes with noise" if noise else "magnitudes"
            counts[kind] += kinks_at_zero(np.abs(y), rate) >= LIMIT.FEWEST_KINKS
    print(f"{total} right torques, {false} false; found: {dict(counts)}")


def main(words: list[str]) -> None:
    commands: dict[str, Any] = {"right": right, "buses": buses, "signs": signs}
    first, last = map(int, (words[1] if len(words) > 1 else "1-2").split("-"))
    commands[words[0]](range(first, last + 1))


if __name__ == "__main__":
    main(sys.argv[1:])
