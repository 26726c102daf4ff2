"""The Go2 quadruped in MuJoCo: hung from a rope, on the floor, falling; sensors at 200 Hz without noise."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

Array = np.ndarray[Any, Any]
FILE = Path(os.environ.get("SYMGEN_DATA", "")) / "go2" / "go2.xml"
STEP, STEPS = 0.001, 5  # s, and steps a sample: sensors read the mean
STAND = np.tile([0.0, 0.9, -1.8], 4)
LEGS = ("FL", "FR", "RL", "RR")
HOOK, ANCHOR = np.array([0.03, 0.02, 0.06]), np.array([0.0, 0.0, 1.6])
GAINS = {"hung": 60.0, "floor": 150.0, "fall": 60.0}
SIGNALS = {"q": 12, "tau": 12, "w": 3, "wd": 3, "a0": 3, "rope": 6, "feet": 24}


def _model(floor: bool) -> Any:
    """Compile the robot with viscous friction alone, without ends of joints; its feet touch a floor."""
    spec = mujoco.MjSpec.from_file(str(FILE))
    spec.option.timestep = STEP
    for joint in spec.joints:
        joint.limited, joint.frictionloss = False, 0
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = int(geom.name in LEGS), 0
    if floor:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[5, 5, 1],
            solref=[0.04, 1.0],
            priority=2,
            friction=[0.9, 0.02, 0.01],
            condim=6,
            contype=0,
            conaffinity=1,
        )
    return spec.compile()


def _waves(rng: Any, size: Array, harmonics: int) -> Any:
    """Return a function of time: positions and rates of a sum of harmonics of 0.1 Hz."""
    k = np.arange(1, harmonics + 1)
    a, b = rng.normal(size=(2, len(size), len(k))) * size[:, None] / np.sqrt(len(k))
    w = 0.2 * np.pi * k

    def at(t: float) -> tuple[Array, Array]:
        s, c = np.sin(w * t), np.cos(w * t)
        return a @ s + b @ c, (a * w) @ c - (b * w) @ s

    return at


def _legs(x: Array) -> Array:
    """Angles of the legs for height, pitch, roll, sway of a trunk on feet that stand, and small rest."""
    front, left = np.array([1, 1, -1, -1]), np.array([1, -1, 1, -1])
    a = x[0] + x[1] * front + x[2] * left
    r = np.stack([np.full(4, x[4]), a + x[3], -2 * a], axis=1)
    r += np.concatenate([x[5:], np.zeros(5)]).reshape(4, 3)
    return r.ravel()


def simulated(kind: str, seconds: float, seed: int = 0) -> dict[str, Array]:
    """Simulate the robot under a PD law: `hung`, on the `floor`, or in a `fall`.

    Returns q, tau (N, 12); w, wd, a0 (N, 3) of the trunk in its axes; the wrench of the rope on the
    trunk, and those of the floor on the four calves, all in the axes of the trunk about its origin,
    (N, 6) and (N, 24).
    """
    model = _model(kind == "floor")
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    small = np.concatenate([[0.22, 0.10, 0.07, 0.08, 0.08], np.full(7, 0.02)])
    standing = kind == "floor"
    waves = _waves(rng, small, 12) if standing else _waves(rng, np.tile([0.25, 0.35, 0.35], 4), 10)
    data.qpos[2], data.qpos[7:] = (0.30 if standing else 1.0), STAND
    trunk = model.body("base").id
    calves = [model.body(f"{leg}_calf").id for leg in LEGS]
    limits, rows = model.actuator_ctrlrange.T, []
    for k in range(int(seconds / STEP)):
        t, ramp = k * STEP, min(1.0, k * STEP)
        r, rd = map(_legs, waves(t)) if standing else waves(t)
        error = GAINS[kind] * (STAND + ramp * r - data.qpos[7:])
        data.ctrl[:] = np.clip(error + 2.0 * (ramp * rd - data.qvel[6:]), *limits)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        R = data.xmat[trunk].reshape(3, 3).copy()
        rope = np.zeros(6)
        if kind == "hung":
            F, M = _pulls(t, ramp, R, data.qpos[:3], data.qvel)
            arm = data.qpos[:3] + R @ HOOK - data.xipos[trunk]
            data.xfrc_applied[trunk] = [*F, *(np.cross(arm, F) + M)]
            rope = np.concatenate([R.T @ F, np.cross(HOOK, R.T @ F) + R.T @ M])
        mujoco.mj_forward(model, data)
        a0 = R.T @ (data.qacc[:3] - model.opt.gravity)
        feet = _contacts(model, data, calves, trunk)
        motion = (data.qpos[7:], data.actuator_force, data.qvel[3:6], data.qacc[3:6], a0)
        rows.append(np.concatenate([*motion, rope, feet]))
        mujoco.mj_step(model, data)
    x = np.array(rows)[: len(rows) // STEPS * STEPS].reshape(-1, STEPS, sum(SIGNALS.values()))
    found = np.split(x, np.cumsum([*SIGNALS.values()])[:-1], axis=2)
    return {
        name: one[:, STEPS // 2] if name == "q" else one.mean(axis=1)
        for name, one in zip(SIGNALS, found, strict=True)
    }


def _pulls(t: float, ramp: float, R: Array, p: Array, v: Array) -> tuple[Array, Array]:
    """Force at the hook and moment on the trunk, in the world: an elastic rope, and somebody pulls."""
    hook = p + R @ HOOK
    length = float(np.linalg.norm(ANCHOR - hook))
    along = (ANCHOR - hook) / length
    speed = (v[:3] + R @ np.cross(v[3:6], HOOK)) @ along
    F = max(0.0, 900 * (length - 0.38) - 60 * speed) * along
    F = F + ramp * np.array([6 * np.sin(2.2 * t), 5 * np.sin(3.1 * t + 1), 0])
    turning = [0.7 * np.sin(1.7 * t), 0.9 * np.sin(2.3 * t + 2), 0.7 * np.sin(1.1 * t + 1)]
    return F, ramp * np.array(turning) - 0.25 * R @ v[3:6]


def _contacts(model: Any, data: Any, calves: list[int], trunk: int) -> Array:
    """Wrenches of the floor on the calves, in the axes of the trunk about its origin, (24,)."""
    feet, R = np.zeros((4, 6)), data.xmat[trunk].reshape(3, 3)
    for c in range(data.ncon):
        contact, f = data.contact[c], np.zeros(6)
        mujoco.mj_contactForce(model, data, c, f)
        axes = contact.frame.reshape(3, 3)
        calf = calves.index(model.geom_bodyid[contact.geom2])  # the floor is the first
        F = R.T @ axes.T @ f[:3]
        N = R.T @ axes.T @ f[3:] + np.cross(R.T @ (contact.pos - data.xpos[trunk]), F)
        feet[calf] += np.concatenate([F, N])
    return feet.ravel()
