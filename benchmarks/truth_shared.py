"""What every question of `benchmarks/truth.py` uses: emitted modules, true parameters, true errors
on unseen motion, tables.
"""

# ruff: noqa: E402
from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"  # before numpy

import numpy as np
import truth_simulator as world
from truth_simulator import Motion, Robot, Truth

import runtime
import symgen
from runtime.study import study_from_mapping

Array = np.ndarray
Row = dict[str, Any]
LEVEL = 1.96
"""Half of a 95 % interval, deviations."""
RESIDUAL = 1e-9
"""Of pinocchio's torques, that the emitted regressor may leave."""


def robots_of(seeds: str) -> tuple[Robot, ...]:
    """Five robots to tune on; three times four others, each judged once and tuned on since."""
    return {
        "first": world.FIRST,
        "second": world.SECOND,
        "third": world.THIRD,
        "fourth": world.FOURTH,
        "final": (*world.FIRST, *world.SECOND, *world.THIRD, *world.FOURTH),
    }[seeds]


@cache
def emitted(name: str) -> tuple[Any, Any]:
    """The module of a robot and that of its variants, from the URDF with its nominal bodies."""
    robot = world.ROBOTS[name]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.urdf"
        file.write_text(robot.urdf(robot.nominal), encoding="utf-8")
        return symgen.model(file), symgen.variants(file)


def true_parameters(truth: Truth, seed: int = 0) -> Array:
    """Base parameters that give pinocchio's torques, shape (b,); ValueError where none do."""
    model, _ = emitted(truth.robot.name)
    rng, n = np.random.default_rng([seed, 3]), truth.robot.n
    states = Motion(np.arange(400.0), *rng.uniform(-2, 2, (3, 400, n)))
    W, Y = np.asarray(model.regressor(states.q, states.qd, states.qdd)), truth.torque(states)
    W, Y = W.reshape(-1, W.shape[2]), Y.ravel()
    X = least_squares(W, Y)
    left = np.linalg.norm(Y - W @ X) / np.linalg.norm(Y)
    if left > RESIDUAL:
        raise ValueError(
            f"{truth.robot.name}: the regressor leaves {left:.1e} of pinocchio's torques"
        )
    return X


def least_squares(W: Array, Y: Array) -> Array:
    """Columns of norm one."""
    norm = np.linalg.norm(W, axis=0)
    norm[norm == 0] = 1.0
    return np.asarray(np.linalg.lstsq(W / norm, Y, rcond=1e-10)[0] / norm)


class Unseen:
    """Two motions that no record of a robot has, a Fourier one and one from point to point; of slow
    records two slow ones, since they do not tell what fast ones need.

    Attributes
    ----------
    D : ndarray, shape (K, n, b)
    tau : ndarray, shape (K, n)
        Without noise.
    """

    def __init__(self, truth: Truth, seed: int, *, slow: bool = False) -> None:
        other = seed + 500_000
        moves = (
            [world.slow(truth.robot, other), world.slow(truth.robot, other + 1)]
            if slow
            else [world.fourier(truth.robot, other), world.points(truth.robot, other, rest=0.0)]
        )
        q, qd, qdd = (
            np.concatenate([getattr(m, key)[::10] for m in moves]) for key in ("q", "qd", "qdd")
        )
        self.model = emitted(truth.robot.name)[0]
        self.D = np.asarray(self.model.regressor(q, qd, qdd))
        self.tau = truth.torque(Motion(np.arange(float(len(q))), q, qd, qdd))

    def errors(self, names: Sequence[str], X: Array) -> tuple[float, float]:
        """True error of parameters in %, in total and of the worst joint."""
        full = np.zeros(self.D.shape[2])
        full[[self.model.BASE_PARAMETERS.index(name) for name in names]] = X
        left = self.tau - self.D @ full
        by_joint = np.linalg.norm(left, axis=0) / np.linalg.norm(self.tau, axis=0)
        return 100 * float(np.linalg.norm(left) / np.linalg.norm(self.tau)), 100 * float(
            by_joint.max()
        )


def study(**sections: Any) -> Any:
    """Default settings, beside those of the given sections."""
    return study_from_mapping(sections)


def record_of(move: Motion, tau: Array, q: Array | None = None) -> Any:
    return runtime.Record(move.t, move.q if q is None else q, tau)


def deviations(fit: Any) -> Array:
    """Those that the program says to quote."""
    return np.asarray(fit.sigma_corrected)


def percent(part: float, whole: float) -> str:
    return "-" if not whole else f"{100 * part / whole:.0f}"


def middle(values: Sequence[float]) -> str:
    usable = [v for v in values if v is not None and np.isfinite(v)]
    return f"{np.median(usable):.2g}" if usable else "-"


def markdown(head: Sequence[str], lines: Sequence[Sequence[Any]]) -> str:
    rule = ["---"] * len(head)
    return "\n".join(
        "| " + " | ".join(str(c) for c in line) + " |" for line in (head, rule, *lines)
    )


def among(rows: Sequence[Row], **fields: Any) -> list[Row]:
    return [row for row in rows if all(row.get(key) == value for key, value in fields.items())]
