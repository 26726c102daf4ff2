"""States of a free-flyer of pinocchio, and the same motion as the argument `base` of generated models."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

Array = np.ndarray[Any, Any]


class FreeFlyer(NamedTuple):
    """Random states of a tree with a free-flyer at its root; N states, n joints, L links.

    Attributes
    ----------
    base : ndarray, shape (N, 9)
        w0, wd0 and a0 of the root, in its axes: spatial velocities and accelerations of pinocchio.
    q, qd, qdd : ndarray, shape (N, n)
        Joint states, in the order of the given names.
    tau : ndarray, shape (N, n)
        Torques of the joints by the recursion of Newton and Euler.
    W : ndarray, shape (N, n, 10*L)
        Rows of the joints of computeJointTorqueRegressor.
    """

    base: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    W: Array


def free_flyer(
    text: str, joints: list[str], count: int, seed: int = 0, *, wrench: bool = False
) -> FreeFlyer:
    """Draw states of the free-flyer of a URDF; `joints` are the names of the joints in order.

    wrench : whether the force and the moment on the root are six rows before those of the joints.
    """
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, rng = model.createData(), np.random.default_rng(seed)
    moved = [model.joints[model.getJointId(name)] for name in joints]
    q, qd, qdd = rng.uniform(-2, 2, (3, count, len(joints)))
    base, tau, W = [], [], []
    for k in range(count):
        Q = np.zeros(model.nq)
        Q[3:7] = rng.normal(size=4)
        Q[3:7] /= np.linalg.norm(Q[3:7])
        v, a = rng.normal(size=(2, model.nv))
        for i, joint in enumerate(moved):
            given = [q[k, i]] if joint.nq == 1 else [np.cos(q[k, i]), np.sin(q[k, i])]
            Q[joint.idx_q : joint.idx_q + joint.nq] = given
            v[joint.idx_v], a[joint.idx_v] = qd[k, i], qdd[k, i]
        R = pin.Quaternion(Q[3:7]).matrix()
        # the spatial acceleration becomes that of the origin, minus gravity
        a0 = a[:3] + np.cross(v[3:6], v[:3]) - R.T @ model.gravity.linear
        base.append([*v[3:6], *a[3:6], *a0])
        rows = [*range(6 * wrench), *(joint.idx_v for joint in moved)]
        tau.append(pin.rnea(model, data, Q, v, a)[rows])
        W.append(pin.computeJointTorqueRegressor(model, data, Q, v, a)[rows])
    return FreeFlyer(np.array(base), q, qd, qdd, np.array(tau), np.array(W))
