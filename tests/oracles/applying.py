"""Values applied to files of robots: other physical values, records played by the emitted module,
and torques that other programs compute from a file.
"""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from oracles.urdf_table import snapped_text
from runtime.core.least_squares.estimate import Estimate
from symgen.description.mjcf import compiled as compiled_mjcf
from symgen.description.robot import INERTIAL
from symgen.description.xml_text import read_elements

Array = np.ndarray[Any, Any]
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
ADDED = re.compile(
    rb'\s(?:damping|friction|frictionloss|armature|quat|xyz|stiffness|springref)="[# ]*"'
    rb'|\s*<(?:inertial|inertia|origin|dynamics)(?: [a-z]+="[# ]*")*/>'
)


def exact(model: ModuleType, chi: dict[str, float]) -> Estimate:
    """The Estimate that a perfect record gives of standard parameters `chi`."""
    X = np.asarray(model.base_parameters(chi))
    b, sigma = len(X), np.full(len(X), 1e-3)
    return Estimate(
        tuple(model.BASE_PARAMETERS),
        X,
        sigma,
        np.diag(sigma**2),
        sigma,
        1.0,
        1.0,
        1.0,
        b,
        0.0,
        0.0,
        (),
        "exact",
    )


def other_values(model: ModuleType, seed: int, *, offset: float = 0.0) -> dict[str, float]:
    """Values of another physical robot: every body denser, with three further masses on it; another
    friction where there is some.
    """
    rng, chi = np.random.default_rng(seed), dict(model.VALUES)
    for j in model.LINKS:
        density = rng.uniform(1.0, 1.3)
        ten = density * np.array([chi[f"{family}{j}"] for family in INERTIAL])
        for m, x in zip(
            rng.uniform(0.02, 0.1, 3) * ten[9], rng.uniform(-0.1, 0.1, (3, 3)), strict=True
        ):
            J = m * (x @ x * np.eye(3) - np.outer(x, x))
            ten += [*J[np.triu_indices(3)], *(m * x), m]
        chi |= {f"{family}{j}": x for family, x in zip(INERTIAL, ten.tolist(), strict=True)}
    for name in chi:
        if name.startswith(("FV", "FS", "Ia")):
            chi[name] *= 1.2
        elif name.startswith("OFFSET"):
            chi[name] += offset
    return chi


def motion(
    n: int, seed: int, seconds: float, rate: float = 100.0
) -> tuple[Array, Array, Array, Array]:
    """t (N,), and q, qd, qdd (N, n) of three sines by joint."""
    rng, t = np.random.default_rng(seed), np.arange(0, seconds, 1 / rate)
    w = 2 * np.pi * np.outer([0.17, 0.41, 0.83], rng.uniform(0.8, 1.25, n))
    a, phase = np.array([0.6, 0.3, 0.12])[:, None], t[:, None, None] * w + rng.uniform(0, 6, (3, n))
    return (
        t,
        (a * np.sin(phase)).sum(1),
        (a * w * np.cos(phase)).sum(1),
        (-a * w**2 * np.sin(phase)).sum(1),
    )


def torques_of(
    path: Path,
    model: ModuleType,
    states: tuple[Array, Array, Array],
    placeless: dict[str, float],
    lock: dict[str, float],
) -> Array:
    """Torques (N, n) that pinocchio, or MuJoCo, computes from the file, with what the file has no
    place for added; some joints held.
    """
    links = (
        _pinocchio(path, model, lock, *states)
        if path.suffix == ".urdf"
        else _mujoco(path, model, *states)
    )
    added = [
        placeless.get(f"OFFSET{j}", 0.0) + placeless.get(f"Ia{j}", 0.0) * states[2][:, k]
        for k, j in enumerate(model.JOINTS)
    ]
    return links + np.array(added).T


def _pinocchio(
    path: Path, model: ModuleType, lock: dict[str, float], q: Array, qd: Array, qdd: Array
) -> Array:
    robot = pin.buildModelFromXML(snapped_text(path.read_text("utf-8")))
    data = robot.createData()
    elements = {e.word("name"): e for e in read_elements(path.read_bytes()) if e.tag == "joint"}
    joints = [
        (
            robot.joints[robot.getJointId(model.LABELS[j])],
            elements[model.LABELS[j]].find("dynamics"),
        )
        for j in model.JOINTS
    ]
    leaders = {
        name: mimic.word("joint")
        for name, e in elements.items()
        if (mimic := e.find("mimic")) is not None
    }
    rest = np.array(pin.neutral(robot))
    for name, place in ((name, lock.get(leaders.get(name, name))) for name in elements):
        if place is not None:
            rest[robot.joints[robot.getJointId(name)].idx_q] = place
    tau = np.zeros_like(q)
    for i in range(len(q)):
        x, v, a = rest.copy(), np.zeros(robot.nv), np.zeros(robot.nv)
        for k, (joint, _) in enumerate(joints):
            x[joint.idx_q : joint.idx_q + joint.nq] = (
                [q[i, k]] if joint.nq == 1 else [np.cos(q[i, k]), np.sin(q[i, k])]
            )
            v[joint.idx_v], a[joint.idx_v] = qd[i, k], qdd[i, k]
        gamma = pin.rnea(robot, data, x, v, a)
        for k, (joint, e) in enumerate(joints):
            damping, friction = (
                0.0 if e is None else e.number(key, "0") for key in ("damping", "friction")
            )
            tau[i, k] = gamma[joint.idx_v] + damping * qd[i, k] + friction * np.sign(qd[i, k])
    return tau


def _mujoco(path: Path, model: ModuleType, q: Array, qd: Array, qdd: Array) -> Array:
    """MuJoCo computes dry friction as a constraint: it is added here from the numbers of the
    compiled file.
    """
    content = path.read_bytes()
    compiled = (
        compiled_mjcf(content).model
        if b"<mesh" in content
        else mujoco.MjModel.from_xml_string(content.decode())
    )
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(compiled)
    places = [
        (joint.qposadr[0], joint.dofadr[0])
        for joint in (compiled.joint(model.LABELS[j]) for j in model.JOINTS)
    ]
    tau = np.zeros_like(q)
    for i in range(len(q)):
        for k, (place, dof) in enumerate(places):
            data.qpos[place], data.qvel[dof], data.qacc[dof] = q[i, k], qd[i, k], qdd[i, k]
        mujoco.mj_inverse(compiled, data)
        tau[i] = [
            data.qfrc_inverse[dof] + compiled.dof_frictionloss[dof] * np.sign(qd[i, k])
            for k, (_, dof) in enumerate(places)
        ]
    return tau


def skeleton(content: bytes, *, without: bool = False) -> bytes:
    """The text with # for every number; `without` attributes and elements that may be added."""
    text = NUMBER.sub(b"#", content)
    return (
        ADDED.sub(b"", text).replace(b'inertiafromgeom="true"', b'inertiafromgeom="auto"')
        if without
        else text
    )
