"""What is lost if joints that a record holds still are locked before the derivation.

    python benchmarks/held_joints.py            # writes benchmarks/held_joints.md

A UR5e (airo-models) moves by random Fourier series for 20 s; some joints are held. Its torques have
white noise. The full model has the rows of all joints, or those of the moving joints only; the model
of the locked robot has those of the moving joints. Each base parameter of the locked robot is a
combination of those of the full one, whose standard deviations under this noise are compared.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from airo_models import get_urdf_path

import symgen
from symgen.description.files import read_robot

PERIOD, TERMS = 20.0, 6
NOISE = np.array([0.3, 0.3, 0.18, 0.06, 0.06, 0.06])  # N m
POSITIONS = np.array([0.3, -0.7, 0.9, -0.4, 0.6, 0.2])  # of held joints, rad
HELD = ([5], [4, 5], [3, 4, 5], [2], [1, 2], [0], [2, 3, 4, 5])
HEAD = """# Joints that stand still

`python benchmarks/held_joints.py`; UR5e, 58 base parameters, simulated.
`rank`: combinations of base parameters that the rows determine.
`wider`: largest standard deviation of a base parameter of the locked robot over that of the full model, with the rows of all joints.

| held | rank, all rows | rank, rows of moving joints | base parameters, locked | wider |
| --- | --- | --- | --- | --- |
"""


def motion(rng: np.random.Generator) -> list[np.ndarray]:
    """q, qd, qdd, shape (N, 6), of one period."""
    t = np.arange(0, PERIOD, 0.01)
    w = 2 * np.pi / PERIOD * np.arange(1, TERMS + 1)
    a = 0.5 * rng.normal(size=(6, TERMS)) / np.sqrt(np.arange(1, TERMS + 1))
    phase = w * t[:, None, None] + rng.uniform(0, 2 * np.pi, (6, TERMS))
    waves = (a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase))
    return [wave.sum(axis=-1) for wave in waves]


def rank(W: np.ndarray) -> int:
    """Rank with columns of norm 1, without those that are zero."""
    norms = np.linalg.norm(W, axis=0)
    used = norms > 1e-9 * norms.max()
    return int(np.linalg.matrix_rank(W[:, used] / norms[used], tol=1e-6))


def deviations(W: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Standard deviations of T X of rows whose noise is 1."""
    norms = np.linalg.norm(W, axis=0)
    norms[norms == 0] = 1
    root = T / norms @ np.linalg.pinv(W / norms, rcond=1e-6)
    return np.linalg.norm(root, axis=1)


def main() -> None:
    warnings.simplefilter("ignore")  # notes on the URDF
    file = get_urdf_path("ur5e")
    full = symgen.model(file)
    names = [full.LABELS[j] for j in full.JOINTS]
    states = motion(np.random.default_rng(1))
    lines = []
    for held in HELD:
        q, qd, qdd = (x.copy() for x in states)
        q[:, held], qd[:, held], qdd[:, held] = POSITIONS[held], 0, 0
        moving = [j for j in range(6) if j not in held]
        robot, _ = read_robot(file, lock={names[j]: float(POSITIONS[j]) for j in held})
        locked = symgen.model(robot)
        W = full.observation_matrix(q, qd, qdd).reshape(6, len(q), -1) / NOISE[:, None, None]
        own = locked.observation_matrix(*(x[:, moving] for x in (q, qd, qdd)))
        W_L = own.reshape(len(moving), len(q), -1) / NOISE[moving, None, None]
        every, part, W_L = (x.reshape(-1, x.shape[-1]) for x in (W, W[moving], W_L))
        T = np.linalg.lstsq(W_L, part, rcond=None)[0]
        if not np.allclose(W_L @ T, part, atol=1e-9 * np.abs(part).max()):
            raise SystemExit("the locked robot is not the full one with joints at rest")
        wider = deviations(W_L, np.eye(len(T))) / deviations(every, T)
        lines.append(
            f"| {', '.join(names[j] for j in held)} | {rank(every)} | {rank(part)} | {len(T)} | {wider.max():.2f} |"
        )
    text = HEAD + "\n".join(lines) + "\n"
    Path(__file__).with_suffix(".md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
