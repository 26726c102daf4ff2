"""Pinocchio as an oracle: a model built joint by joint from a Robot, and the elements of its joints
in plain numpy.

Every frame becomes a pinocchio joint about or along its z axis whose frame is Khalil's frame j at
q_j; a fixed frame is a revolute joint that stays at 0 and whose row is dropped. So every link has
its own body and its own ten columns. Pinocchio orders them M MX MY MZ XX XY YY XZ YZ ZZ, tensor
elements about the frame origin (products with our sign). Serial robots and trees.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from symgen.description.robot import PRISMATIC, Frame, Robot

Array = np.ndarray[Any, Any]
COLUMNS = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")


class PinocchioModel:
    """Dynamics at one state; q, qd, qdd (n,) in the order of `robot.moving`, chi (p,) in the order
    of `robot.parameters`.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self.names = robot, robot.parameters
        self.model = pin.Model()
        self.model.gravity.linear = np.array([e.value(robot.constants) for e in robot.gravity])
        self.joint = {
            0: 0
        }  # pinocchio's number of each frame: depth first, as its composite rigid body algorithm assumes
        for j in _depth_first(robot, 0):
            f = robot.frame(j)
            model = pin.JointModelPZ() if f.sigma == PRISMATIC else pin.JointModelRZ()
            self.joint[j] = self.model.addJoint(
                self.joint[f.ant], model, placement(robot, f), f"joint{j}"
            )
        self.data = self.model.createData()
        self.rows = [self.joint[j] - 1 for j in robot.moving]
        self.columns = {
            (p, f.j): 10 * (self.joint[f.j] - 1) + k
            for f in robot.frames
            for k, p in enumerate(COLUMNS)
        }

    def _full(self, q: Array) -> Array:
        x = np.zeros(len(self.robot.frames))
        x[self.rows] = q
        return x

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """D with Gamma = D chi, (n, p)."""
        links = pin.computeJointTorqueRegressor(
            self.model, self.data, *map(self._full, (q, qd, qdd))
        )
        links = links.reshape(len(self.robot.frames), -1)[
            self.rows
        ]  # one joint: pinocchio returns a vector
        D = np.zeros((len(self.rows), len(self.names)))
        for (p, j), k in self.columns.items():
            if f"{p}{j}" in self.names:
                D[:, self.names.index(f"{p}{j}")] = links[:, k]
        for name, column in element_columns(self.robot, q, qd, qdd).items():
            D[:, self.names.index(name)] = column
        return D

    def _set_inertias(self, chi: Array) -> dict[str, float]:
        value = dict(zip(self.names, chi, strict=True))
        for f in self.robot.frames:
            if f.j in self.robot.links:
                body = np.array([value[f"{p}{f.j}"] for p in COLUMNS])
                self.model.inertias[self.joint[f.j]] = pin.Inertia.FromDynamicParameters(
                    body
                )  # divides by M: chi needs M != 0
        return value

    def _elements(self, value: dict[str, float], q: Array, qd: Array, qdd: Array) -> Array:
        total = np.zeros(len(self.rows))
        for name, column in element_columns(self.robot, q, qd, qdd).items():
            total += value[name] * column
        return total

    def torque(self, q: Array, qd: Array, qdd: Array, chi: Array) -> Array:
        """Gamma by pinocchio's recursive Newton-Euler algorithm and the elements, (n,)."""
        value = self._set_inertias(chi)
        rnea = pin.rnea(self.model, self.data, *map(self._full, (q, qd, qdd)))[self.rows]
        return np.asarray(rnea + self._elements(value, q, qd, qdd))

    def inertia_matrix(self, q: Array, chi: Array) -> Array:
        """A by the composite rigid body algorithm and the inertia elements, (n, n)."""
        value = self._set_inertias(chi)
        pin.crba(self.model, self.data, self._full(q))
        A = np.triu(self.data.M.reshape(len(self.robot.frames), -1))
        A = (A + np.triu(A, 1).T)[np.ix_(self.rows, self.rows)]
        zero = np.zeros(len(self.rows))
        rest = self._elements(value, q, zero, zero)
        return np.asarray(
            A
            + np.column_stack([self._elements(value, q, zero, e) - rest for e in np.eye(len(zero))])
        )

    def gravity(self, q: Array, chi: Array) -> Array:
        """Gamma at rest without friction, (n,): gravity, offsets and springs."""
        value = self._set_inertias(chi)
        zero = np.zeros(len(self.rows))
        weight = pin.computeGeneralizedGravity(self.model, self.data, self._full(q))[self.rows]
        return np.asarray(weight + self._elements(value, q, zero, zero))

    def poses(self, q: Array) -> Array:
        """0Tj of every frame in file order, (frames, 4, 4)."""
        pin.forwardKinematics(self.model, self.data, self._full(q))
        return np.array([self.data.oMi[self.joint[f.j]].homogeneous for f in self.robot.frames])

    def jacobian(self, q: Array, frame: int | None = None) -> Array:
        """Velocity of the origin, then angular velocity, of `frame` (default: the last) in frame 0
        per qd, (6, n).
        """
        pin.computeJointJacobians(self.model, self.data, self._full(q))
        j = self.joint[frame or self.robot.frames[-1].j]
        J = pin.getJointJacobian(self.model, self.data, j, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return np.asarray(J.reshape(6, -1)[:, self.rows])


def _depth_first(robot: Robot, i: int) -> list[int]:
    return [k for f in robot.frames if f.ant == i for k in (f.j, *_depth_first(robot, f.j))]


def placement(robot: Robot, f: Frame) -> Any:
    """Pose of frame j in its antecedent at q_j = 0, as SE3."""
    gamma, b, alpha, d, theta, r = (
        e.value(robot.constants) for e in (f.gamma, f.b, f.alpha, f.d, f.theta0, f.r0)
    )
    x, z = np.eye(3)[0], np.eye(3)[2]
    turns = ((z, gamma, b), (x, alpha, d), (z, theta, r))
    M = pin.SE3.Identity()
    for axis, angle, shift in turns:
        M = M * pin.SE3(pin.AngleAxis(angle, axis).matrix(), shift * axis)
    return M


def element_columns(robot: Robot, q: Array, qd: Array, qdd: Array) -> dict[str, Array]:
    """Columns (n,) of the element parameters by name, written out from the definitions in
    `robot.py`.
    """
    place = {j: k for k, j in enumerate(robot.moving)}
    columns: dict[str, Array] = {}
    for e in robot.elements:
        motion = {"inertia": qdd, "viscous": qd, "coulomb": qd, "stiffness": q, "offset": None}[
            e.kind
        ]
        for j, row in e.along.items():
            G = np.zeros(len(place))
            for i, c in row.items():
                G[place[i]] = c.value(robot.constants)
            s = 1.0 if motion is None else float(G @ motion)
            s = {None: s, "positive": max(s, 0.0), "negative": min(s, 0.0)}[e.when]
            columns[f"{e.family}{j}"] = G * (np.sign(s) if e.kind == "coulomb" else s)
        for j, form in e.form.items():
            column = np.zeros(len(place))
            for (i, k), c in form.items():
                column[place[i]] += c.value(robot.constants) * motion[place[k]]  # type: ignore[index]
            columns[f"{e.family}{j}"] = column
    return columns
