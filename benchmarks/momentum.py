"""Regressors without accelerations beside the usual one: which tolerates the coarser encoder?

    python benchmarks/momentum.py [--robots scara tx40] [--records 6] [--seed 1]

Four forms of the same equations, linear in X, of the same states, decimated alike:

    torque      Gamma = D(q, qd, qdd) X                 two derivatives of q
    momentum    Gamma = d/dt(P(q, qd) X) - N(q, qd) X   one of q, one of the product P X
    energy      int qd' Gamma dt = (dE + int qd' F dt) X between decimated instants; one row for all
                joints

States are those of the low-pass, of the best cut-off of a grid for each form, robot and step, and
those of the reader of counts. Motions are five sines a joint of some 0.1 to 1 Hz, torques those of
the values of the file, or of random bodies where it has none, with noise of 1 % of the largest
torque of each joint; the encoder rounds at a random phase. The error is that of the predicted
torques on an exact motion that was not fitted, of its rms: medians over records.
"""

# ruff: noqa: E402
from __future__ import annotations

import argparse
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import sys

import numpy as np

from runtime import load_model
from runtime.core.signals.filters import decimated, derivative
from runtime.study import Signals, study_from_mapping
from symgen import load_robot
from symgen.certify.witness import bodies
from symgen.emit.generate import generate_files

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from problems import observed_states

Array = np.ndarray[Any, Any]
RATE, SECONDS, FACTOR = 1000.0, 20.0, 20  # Hz, s, decimation
TURN = (20000, 5000, 1000, 250)  # steps in a turn of 2 pi; prismatic: of 2 pi/10 m
CUTOFFS = (4.0, 6.0, 9.0, 13.0, 20.0, 30.0, 50.0)  # Hz
FORMS = ("torque", "momentum", "energy")
ENDS = 30  # decimated instants that are left out at each end


def motion(sigma: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """q, qd, qdd, shape (N, n)."""
    t = np.arange(int(RATE * SECONDS))[:, None] / RATE
    q, qd, qdd = np.zeros((3, len(t), len(sigma)))
    for f in (0.1, 0.23, 0.41, 0.67, 1.0):
        w, phase = 2 * np.pi * f * rng.uniform(0.9, 1.1, len(sigma)), rng.uniform(0, 6, len(sigma))
        a = rng.uniform(0.1, 0.4, len(sigma)) / (1 + 2 * f) * sigma
        q, qd, qdd = (
            q + a * np.sin(w * t + phase),
            qd + a * w * np.cos(w * t + phase),
            qdd - a * w**2 * np.sin(w * t + phase),
        )
    return q, qd, qdd


def rows(model: Any, form: str, states: Any, tau: Array, rubs: Array) -> tuple[Array, Array]:
    """W and Y of a form; noise of every row of one joint alike."""
    q, qd, qdd = states.q, states.qd, states.qdd

    def kept(x: Array) -> Array:
        flat = x.reshape(len(x), -1)
        return decimated(flat, FACTOR, None)[ENDS:-ENDS].reshape(-1, *x.shape[1:])

    if form == "energy":
        D = model.regressor(q, qd, 0 * q) * rubs
        power = np.einsum("ti,tik->tk", qd, D)
        done = np.cumsum(np.column_stack([power, (qd * tau).sum(axis=1)]), axis=0) / RATE
        stored = model.energy_regressor(q, qd).sum(axis=1)
        both = kept(np.column_stack([stored + done[:, :-1], done[:, -1]]))
        return np.diff(both, axis=0)[:, :-1], np.diff(both, axis=0)[:, -1]
    if form == "momentum":
        P = model.momentum_regressor(q, qd)
        D = derivative(P.reshape(len(P), -1), RATE).reshape(P.shape)
        D = D - model.momentum_rate_regressor(q, qd)
    else:
        D = model.regressor(q, qd, qdd)
    weight = 1 / np.abs(tau).max(axis=0)
    W, Y = kept(D) * weight[:, None], kept(tau) * weight
    return W.reshape(-1, W.shape[-1]), Y.ravel()


def cells(name: str, records: int, seed: int) -> None:
    """Print the table of a robot."""
    robot = load_robot(name)
    ((file, text),) = generate_files(robot, options=("momentum", "energy")).items()
    with TemporaryDirectory() as folder:
        (Path(folder) / file).write_text(text, encoding="utf-8")
        model: Any = load_model(Path(folder) / file, trust=True)
    chi = bodies(robot, np.random.default_rng(3))
    given = any(robot.values.values())
    X = model.base_parameters(model.VALUES if given else chi)
    slide = np.array([robot.frame(j).sigma for j in robot.joints])
    sigma, kinds = np.where(slide, 0.1, 1.0), {n: e[0] for n, e in model.ELEMENTS.items()}
    rubs = np.array([kinds.get(x) in ("viscous", "coulomb") for x in model.BASE_PARAMETERS])
    errors: dict[tuple[int, str, str], list[list[float]]] = {}
    for record in range(records):
        rng = np.random.default_rng([seed, record])
        exact, other = motion(sigma, rng), motion(sigma, rng)
        tau = model.inverse_dynamics(*exact, X)
        tau = tau + rng.normal(size=tau.shape) * 0.01 * np.abs(tau).max(axis=0)
        unseen = np.array(model.regressor(*(x[::20] for x in other)))
        truth = unseen @ X
        for turn in TURN:
            step, phase = 2 * np.pi / turn * sigma, rng.uniform(size=len(sigma))
            q = step * (np.floor(exact[0] / step + phase) + 0.5 - phase)
            readers = {"low-pass": CUTOFFS, "counts": (None,)}
            for reader, cutoffs in readers.items():
                states = [observed_states(q, RATE, signals(c, tuple(step))) for c in cutoffs]
                for form in FORMS:
                    found = []
                    for s in states:
                        W, Y = rows(model, form, s, tau, rubs)
                        size = np.linalg.norm(W, axis=0)
                        estimate = np.linalg.lstsq(W / size, Y, rcond=None)[0] / size
                        found.append(np.linalg.norm(unseen @ estimate - truth))
                    of = errors.setdefault((turn, reader, form), [])
                    of.append([100 * x / np.linalg.norm(truth) for x in found])
    print(
        f"{name}, {records} records, seed {seed}: error on an unseen motion, % (best cut-off, Hz)"
    )
    print(f"{'step':>12}  " + "".join(f"{r + ', ' + f:>22}" for r in readers for f in FORMS))
    for turn in TURN:
        line = f"{'2 pi/' + str(turn):>12}  "
        for reader in readers:
            for form in FORMS:
                median = np.median(errors[turn, reader, form], axis=0)
                at = int(np.argmin(median))
                hertz = f" ({CUTOFFS[at]:g})" if reader == "low-pass" else ""
                line += f"{median[at]:.2g}{hertz}".rjust(22)
        print(line, flush=True)


def signals(cutoff: float | None, step: tuple[float, ...]) -> Signals:
    """Settings of the low-pass, or of the reader of counts."""
    given = (
        {"lowpass": {"cutoff": cutoff}}
        if cutoff
        else {"reader": "counts", "step": list(step), "side": "joint"}
    )
    return study_from_mapping({"record": {"files": ["-"]}, "signals": given}).signals


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="+", default=["scara", "tx40"])
    parser.add_argument("--records", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for name in given.robots:
        cells(name, given.records, given.seed)


if __name__ == "__main__":
    main()
