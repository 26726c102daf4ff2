"""Delay of a control law that is fitted by default: `python benchmarks/law_delay.py [FIRST-LAST] [DELAY, s]`.

Simulated records of arms of two links under tau(t) = kp (q_ref - q) + kd (qd_ref - qd) at t - DELAY:
RK4 at 4 kHz, logged at 200 to 1000 Hz, encoders of 4096 to 65536 steps or with noise, velocities with
noise. Prints a line per seed, and the counts of law_delay.md.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import two_links

from runtime import compose
from runtime.core.problem import estimated, observe_rows
from runtime.reading.records import read_records
from runtime.study import study_from_mapping

Array = np.ndarray
TICK = 4000.0  # Hz, of the controller and the integration
SECONDS = 16.0  # of which the first is not logged
RATES = (200.0, 250.0, 500.0, 1000.0)  # Hz
STEPS = (2 * np.pi / 4096, 2 * np.pi / 16384, 2 * np.pi / 65536, 0.0)  # rad; 0: noise of 10 urad
HARMONICS = np.arange(1, 7)


def drawn(seed: int) -> dict[str, Any]:
    """Draw an arm, the gains of its controller, and the reference of its motion."""
    r = np.random.default_rng(seed)
    L, m2, c2 = r.uniform(0.2, 0.4), r.uniform(0.5, 2), r.uniform(0.05, 0.15)
    ZZ2 = m2 * c2**2 * r.uniform(1.2, 1.8)
    m1, c1 = r.uniform(1, 4), r.uniform(0.05, 0.2)
    ZZ1R = m1 * c1**2 * r.uniform(1.2, 1.8) + m2 * L**2 + r.uniform(0.005, 0.05)
    p: dict[str, Any] = {"L": L, "ZZ1R": ZZ1R, "ZZ2": ZZ2, "MX2": m2 * c2, "MX1R": m1 * c1 + m2 * L}
    p["Ia2"] = r.uniform(0.003, 0.03)
    p["FV"] = r.uniform(0.1, 0.6, 2) * [1, 0.5]
    p["FS"] = r.uniform(0.1, 0.5, 2) * [1, 0.5]
    inertia = np.array([ZZ1R, ZZ2 + p["Ia2"]])
    p["kp"] = np.array([r.uniform(150, 600), r.uniform(150, 600)]) * inertia
    p["kd"] = 2 * r.uniform(0.4, 1.0) * np.sqrt(p["kp"] * inertia)
    p["a"], p["b"] = r.uniform(-0.35, 0.35, (6, 2)), r.uniform(-0.35, 0.35, (6, 2))
    p["f"] = r.uniform(0.08, 0.2)
    return p


def reference(p: dict[str, Any], t: float) -> tuple[Array, Array]:
    """Reference of positions and velocities, shape (B, 2), of B arms."""
    w = 2 * np.pi * p["f"][:, None, None] * HARMONICS[:, None]
    s, c, size = np.sin(w * t), np.cos(w * t), np.sqrt(HARMONICS)[:, None]
    a, b = p["a"] / size, p["b"] / size
    return (a * s + b * c).sum(axis=1), ((a * c - b * s) * w).sum(axis=1)


def simulated(seeds: list[int], delay: float) -> list[dict[str, Any]]:
    """Simulate the controlled arms, and log their records."""
    arms = [drawn(seed) for seed in seeds]
    p = {key: np.array([arm[key] for arm in arms]) for key in arms[0]}
    N, h, late = round(SECONDS * TICK), 1 / TICK, round(delay * TICK)
    Q, V, QR, VR, U = np.empty((5, N, len(seeds), 2))
    q, v = reference(p, 0.0)
    for i in range(N):
        Q[i], V[i] = q, v
        QR[i], VR[i] = reference(p, i * h)
        U[i] = p["kp"] * (QR[i] - q) + p["kd"] * (VR[i] - v)
        u = U[max(i - late, 0)]
        k1 = two_links.acceleration(p, q, v, u)
        k2 = two_links.acceleration(p, q + h / 2 * v, v + h / 2 * k1, u)
        k3 = two_links.acceleration(p, q + h / 2 * (v + h / 2 * k1), v + h / 2 * k2, u)
        k4 = two_links.acceleration(p, q + h * (v + h / 2 * k2), v + h * k3, u)
        q = q + h * v + h * h / 6 * (k1 + k2 + k3)
        v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    runs = []
    for j, seed in enumerate(seeds):
        r, rate, step = np.random.default_rng(seed + 9999), RATES[seed % 4], STEPS[seed // 4 % 4]
        cut = slice(int(TICK), None, int(TICK / rate))
        true = Q[cut, j]
        x = step * np.round(true / step) if step else true + 1e-5 * r.standard_normal(true.shape)
        qd = V[cut, j] + 0.01 * r.standard_normal(x.shape)
        log = {
            "t": np.arange(len(x)) / rate,
            "q": x,
            "qd": qd,
            "q_ref": QR[cut, j],
            "qd_ref": VR[cut, j],
        }
        runs.append({"log": log, "arm": arms[j], "q": true, "rate": rate})
    return runs


def judged(run: dict[str, Any], delay: float | None) -> tuple[float, Any]:
    """Error of the torque, %, and the estimate of the law; delay None: fitted, as by default."""
    arm, given = run["arm"], {} if delay is None else {"delay": delay}
    law = {"kp": arm["kp"].tolist(), "kd": arm["kd"].tolist(), **given}
    model = two_links.model_of(arm)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.npz"
        np.savez(file, **run["log"])
        record = {"files": str(file), "columns": {name: name for name in run["log"]}}
        study = study_from_mapping({"record": record, "controller": {"law": law}})
        records = read_records(study.record, model)
    problem = compose.problem(model, records, study)
    fit = estimated(problem, observe_rows(problem))
    note = problem.noted("law")
    error = two_links.error_of(model, arm, fit, run["q"], run["rate"])
    return error, None if note is None else note.result


def main(words: list[str]) -> None:
    first, last = map(int, (words[0] if words else "101-130").split("-"))
    delay = float(words[1]) if len(words) > 1 else 0.01
    seeds = list(range(first, last + 1))
    inside, ratios = 0, []
    print(
        "| seed | rate, Hz | delay, ms | error without, % | error with, % |\n|---|---|---|---|---|"
    )
    for seed, run in zip(seeds, simulated(seeds, delay), strict=True):
        without, _ = judged(run, 0.0)
        error, law = judged(run, None)
        half = 1.96 * law.sigma_delay
        inside += bool(abs(law.delay - delay) < half)
        ratios.append(error / without)
        told = f"{1e3 * law.delay:.2f} +- {1e3 * half:.2f}"
        print(f"| {seed} | {run['rate']:.0f} | {told} | {without:.2f} | {error:.2f} |", flush=True)
    ratio = np.exp(np.mean(np.log(ratios)))
    print(
        f"\n{inside} of {len(seeds)} intervals hold {1e3 * delay:g} ms; "
        f"geometric mean of the error with over without {ratio:.2f}"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
