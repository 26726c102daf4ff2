"""Records of small arms: torques by pinocchio, errors planted in the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

Array = np.ndarray

URDF = """<robot name="arm">
<link name="base"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="300" velocity="5"/><dynamics damping="1.5" friction="2"/></joint>
<link name="l1"><inertial><origin xyz="0.03 0 -0.1"/><mass value="12"/><inertia ixx="0.15" ixy="0" ixz="0" iyy="0.15" iyz="0" izz="0.1"/></inertial></link>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.05 0 0" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="300" velocity="5"/><dynamics damping="1.2" friction="1.6"/></joint>
<link name="l2"><inertial><origin xyz="0.24 0 0.04"/><mass value="8"/><inertia ixx="0.03" ixy="0" ixz="0" iyy="0.17" iyz="0" izz="0.17"/></inertial></link>
<joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0.45 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="200" velocity="6"/><dynamics damping="0.6" friction="0.8"/></joint>
<link name="l3"><inertial><origin xyz="0.18 -0.02 -0.02"/><mass value="4"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.07" iyz="0" izz="0.07"/></inertial></link>
</robot>
"""
RATE = 200.0


def motion(seed: int, seconds: float = 8.0) -> tuple[Array, Array, Array, Array]:
    """t, q, qd, qdd of three joints: sums of five sines."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    q, qd, qdd = np.zeros((3, len(t), 3))
    for k in range(1, 6):
        w = 2 * np.pi * 0.2 * k
        for j in range(3):
            a, b = rng.standard_normal(2) / k * (0.9, 0.7, 0.8)[j]
            q[:, j] += a * np.sin(w * t) + b * np.cos(w * t)
            qd[:, j] += w * (a * np.cos(w * t) - b * np.sin(w * t))
            qdd[:, j] -= w**2 * (a * np.sin(w * t) + b * np.cos(w * t))
    return t, q, qd, qdd


def recorded(
    seed: int, noise: float = 0.01, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> tuple[Array, Array, Array]:
    """t, q and tau of the arm, with white noise of the torques."""
    model = pin.buildModelFromXML(URDF)
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    t, q, qd, qdd = motion(seed)
    tau = np.array([pin.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    tau += np.array([1.5, 1.2, 0.6]) * qd + np.array([2.0, 1.6, 0.8]) * np.sign(qd)
    rng = np.random.default_rng(seed + 1000)
    return t, q, tau + noise * tau.std(axis=0) * rng.standard_normal(tau.shape)


def written(folder: Path, t: Array, q: Array, tau: Array, name: str = "run.csv") -> Path:
    """Write a log with the columns t, q1 .., tau1 .."""
    head = ",".join(["t", *(f"{k}{j}" for k in ("q", "tau") for j in range(1, q.shape[1] + 1))])
    path = folder / name
    rows = np.column_stack([t, q, tau])
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.10g")
    return path


def arm(folder: Path) -> Path:
    """Write the robot file."""
    path = folder / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    return path


def lines(repair: Any) -> list[str]:
    """The changed lines of a repair."""
    return [change.line for change in repair.changes]
