"""Dynamics from energies, differentiated by CasADi: an independent check of the recursions.

This module shares no formula with the Newton-Euler recursions. With T_j(q) the pose of frame j in
frame 0 (4 x 4) and Sigma_j the pseudo-inertia of link j about the origin of its frame,

    E = sum_j 1/2 tr(Tdot_j Sigma_j Tdot_j')      U = - sum_j (g', 0) T_j Sigma_j e4

    Sigma = | tr(J)/2 E3 - J   MS |      J  = [XX XY XZ; XY YY YZ; XZ YZ ZZ]
            |      MS'          M |      MS = [MX MY MZ]'

both linear in the standard parameters chi. Since dTdot/dqd_i = dT/dq_i, Lagrange's equations are
[U65]

    Gamma_i = d/dt dE/dqd_i - dE/dq_i + dU/dq_i
            = sum_j tr(dT_j/dq_i Sigma_j Tddot_j') - (g', 0) dT_j/dq_i Sigma_j e4

CasADi gives dT/dq and Tddot. A base that moves has six more coordinates: the pose T_0 of frame 0 in
the world. At T_0 = 1, the second derivative of the products of poses T_0 T_j,

    Tddot = T_0dd T_j + 2 T_0d T_jd + T_jdd,   T_0d = | hat(w0)  0 |   T_0dd = | hat(wd0) + hat(w0)^2  a0 |
                                                      | 0        0 |           | 0                     0  |

replaces T_jdd, with gravity in a0. The rows of a free base are Lagrange's equations of these
coordinates: the poses have the derivatives G_i T_j, with G_i = dT_0/dx_i for a shift x_i of frame 0
along its axes, then for a turn about them, and link 0 has T_j = 1. An element with parameter c acts
along a motion s = G q, or has a matrix B (B = G'G if it acts along s). It adds to Gamma

    c B qdd          inertia
    c G'             offset
    c B q            stiffness
    c B qd           viscous friction
    c G' sign(sd)    Coulomb friction

With `when: positive` it acts for sd > 0 only, with `when: negative` for sd < 0 only. The
coordinates are all joints that move, also the cut and passive ones (the open tree). A mechanism
with loops is this tree restricted to q = f(qa), where phi(q) = 0 closes the loops:

    Gamma_a = G' Gamma_tree,   G = dq/dqa,   qd = G qad,   qdd = G qadd + Gdot qad .

Only the certificate and the tests import this module.

[U65] J. J. Uicker, On the dynamic analysis of spatial linkages using 4 x 4 matrices, Northwestern
University, 1965.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symgen.derive.assembly import newton
from symgen.derive.loops import close
from symgen.description.element import CHANNEL
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.robot import INERTIAL, PRISMATIC, REVOLUTE, Element, Frame, Robot, parameter
from symgen.errors import DescriptionError

Array = np.ndarray[Any, Any]
NEWTON_STEPS, CLOSED = 50, 1e-11  # iterations, defect of a closed loop
SETTLED, FOLLOWED = 1e-15, 8  # defect where iterations end; places on the way from `start`
# of the smallest singular value of the closure at `start`, over its largest: less is near a dead
# point
REGULAR = 0.05
ASTRAY = 0.1  # rad or m beside the tangent after a step: on another branch
DRAWS = 20  # attempts to find states in which the loops close
SX = Any  # casadi.SX


def pose(frame: Frame, q: SX, constants: Mapping[str, SX]) -> SX:
    """Return the pose iTj of frame j in its antecedent frame i, a 4 x 4 matrix.

        iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)

    The joint position q is added to theta (revolute) or to r (prismatic).
    """
    gamma, b, alpha, d, theta, r = (
        _symbolic(e, {}, constants)
        for e in (frame.gamma, frame.b, frame.alpha, frame.d, frame.theta0, frame.r0)
    )
    theta = theta + q if frame.sigma == REVOLUTE else theta
    r = r + q if frame.sigma == PRISMATIC else r
    return _screw(2, gamma, b) @ _screw(0, alpha, d) @ _screw(2, theta, r)


def _screw(axis: int, angle: SX, shift: SX) -> SX:
    """Return the 4 x 4 matrix of a rotation about x (axis 0) or z (axis 2) and a shift along it."""
    T = ca.SX.eye(4)
    u, v = (axis + 1) % 3, (axis + 2) % 3
    T[u, u], T[u, v], T[v, u], T[v, v] = ca.cos(angle), -ca.sin(angle), ca.sin(angle), ca.cos(angle)
    T[axis, 3] = shift
    return T


def poses(
    robot: Robot, q: Mapping[int, SX], constants: Mapping[str, SX], root: int = 0
) -> dict[int, SX]:
    """Return {j: rTj}: the poses, in frame r = `root`, of frame r and all frames j mounted on it.

    The positions q are given by joint number; a missing joint has position 0.
    """
    T = {root: ca.SX.eye(4)}
    for f in (f for f in robot.frames if f.ant in T):
        T[f.j] = T[f.ant] @ pose(f, q.get(f.j, 0), constants)
    return T


def pseudo_inertia(name: str) -> Array:
    """Return the pseudo-inertia Sigma, 4 x 4, of a link with parameter `name` = 1, all others 0."""
    S = np.zeros((4, 4))
    if name == "M":
        S[3, 3] = 1
    elif name.startswith("M"):
        k = "XYZ".index(name[1])
        S[k, 3] = S[3, k] = 1
    else:
        k, l = ("XYZ".index(c) for c in name)
        J = np.zeros((3, 3))
        J[k, l] = J[l, k] = 1
        S[:3, :3] = np.trace(J) / 2 * np.eye(3) - J
    return S


LINK = np.array([pseudo_inertia(name) for name in INERTIAL])  # (10, 4, 4)


def _floats(function: Any, *arguments: Array) -> Array:
    """Evaluate a CasADi function of column vectors at many samples.

    The arguments have shape (..., m_k), the result has shape (..., rows, columns).
    """
    shape = np.broadcast_shapes(*(np.shape(a)[:-1] for a in arguments))
    columns = [
        np.broadcast_to(a, (*shape, np.shape(a)[-1])).reshape(-1, np.shape(a)[-1]).T
        for a in arguments
    ]
    N = columns[0].shape[1]
    rows, width = function.size_out(0)
    out = np.zeros((N, width, rows))  # column-major, as CasADi writes it
    buffer, evaluate = function.map(N).buffer()
    given = [np.ascontiguousarray(c.T, dtype=float) for c in columns]
    for k, c in enumerate(given):
        buffer.set_arg(k, c.data)
    buffer.set_res(0, out.data)
    evaluate()
    return np.ascontiguousarray(out.transpose(0, 2, 1)).reshape(*shape, rows, width)


def _matrices(columns: Array) -> Array:
    """Reshape n columns of F stacked 4 x 4 matrices, (..., 16 F, n), to shape (..., n, F, 4, 4)."""
    stacked = np.moveaxis(columns, -1, -2)
    return np.swapaxes(stacked.reshape(*stacked.shape[:-1], -1, 4, 4), -1, -2)


class Lagrange:
    """Dynamics of a robot with its loops cut (open tree), in all moving joints, from its energies.

    The joints have the order `robot.moving`. Arrays q, qd, qdd have shape (..., n), in rad or m and
    their rates; results have the same leading axes. The parameters chi have shape (p,), in the
    order of `robot.parameters`, or (..., p).
    """

    def __init__(self, robot: Robot, constants: Mapping[str, float] | None = None) -> None:
        self.robot, self.names = robot, robot.parameters
        self.constants = {**robot.constants, **(constants or {})}
        self._functions, self._moves = _functions(robot)
        self._values = np.array([*self.constants.values(), 1.0])
        self._elements = {
            parameter(e.family, j): (e, *self._row_and_form(e, j))
            for e in robot.elements
            for j in e.keys
        }
        start = robot.start
        self._home = (
            np.array([start[j] for j in robot.moving]) if set(robot.moving) <= set(start) else None
        )

    def _floats(self, name: str, *arguments: Array) -> Array:
        return _floats(self._functions[name], *arguments, self._values)

    def vary(self, rng: np.random.Generator, states: int) -> None:
        """Draw random values, one per state, of each channel (a quantity that the record gives at
        each sample, such as temperature).
        """
        self._values = np.tile(self._values, (states, 1))
        for name in self.robot.channels:
            self._values[:, [*self.constants].index(name)] = rng.uniform(0.5, 2, states)

    def poses(self, q: Array) -> Array:
        """Return the pose 0Tj of every frame in file order, shape (..., frames, 4, 4)."""
        return _matrices(self._floats("poses", q))[..., 0, :, :, :]

    def slopes(self, q: Array) -> Array:
        """Return the derivatives d0Tj/dq_i of all poses, shape (..., n, frames, 4, 4)."""
        dT = np.zeros((*np.shape(q)[:-1], np.shape(q)[-1], len(self.robot.frames), 4, 4))
        dT[..., self._moves.joint, self._moves.frame, :, :] = self._moving(q)
        return dT

    def _moving(self, q: Array) -> Array:
        """Return d0Tj/dq_i of the pairs of a joint i and a frame j that it moves, (..., pairs, 4, 4).

        Other derivatives are zero: in a tree, a joint moves the frames of its own branches only.
        """
        values = self._floats("slopes", q)[..., 0]
        stacked = np.zeros((*values.shape[:-1], 16 * len(self._moves.joint)))
        stacked[..., self._moves.entry] = values
        return np.swapaxes(stacked.reshape(*values.shape[:-1], -1, 4, 4), -1, -2)

    def regressor(self, q: Array, qd: Array, qdd: Array, base: Array | None = None) -> Array:
        """Return the standard regressor D of Gamma = D chi, shape (..., n, p).

        base : w0, wd0 and a0 of a base that moves, shape (..., 9); None: the base is fixed.

        A free base has six rows more, before the joints: D has the shape (..., 6 + n, p).
        """
        robot, dT, (joint, frame, _) = self.robot, self._moving(q), self._moves
        ddT = _matrices(self._floats("accelerations", q, qd, qdd))[..., 0, :, :, :]
        links, rows = [f.j for f in robot.frames], np.shape(q)[-1]
        if base is None:
            ddT[..., :3, 3] -= [e.value(self.constants) for e in robot.gravity]
        else:
            T, rate = self.poses(q), np.zeros_like(ddT)
            for i in range(rows):
                own = joint == i
                rate[..., frame[own], :, :] += dT[..., own, :, :] * qd[..., i, None, None, None]
            if robot.base_is_free:
                links, rows, zero = [0, *links], 6 + rows, np.zeros((4, 4))
                T, rate, ddT = (
                    _with_link_0(x, own) for x, own in ((T, np.eye(4)), (rate, zero), (ddT, zero))
                )
                of_base = SHIFTS_AND_TURNS @ T[..., None, :, :, :]
                of_base = of_base.reshape(*T.shape[:-3], 6 * len(links), 4, 4)
                dT = np.concatenate([of_base, dT], axis=-3)
                joint = np.concatenate([np.repeat(np.arange(6), len(links)), 6 + joint])
                frame = np.concatenate([np.tile(np.arange(len(links)), 6), 1 + frame])
            ddT = ddT + _carried(T, rate, base)
        products = np.swapaxes(dT, -1, -2) @ ddT[..., frame, :, :]
        by_link = products.reshape(*products.shape[:-2], 16) @ LINK.reshape(-1, 16).T
        column = {name: k for k, name in enumerate(self.names)}
        D = np.zeros((*by_link.shape[:-2], rows, len(self.names)))
        first = np.array([column.get(parameter(INERTIAL[0], j), -1) for j in links])
        has = first[frame] >= 0
        columns = first[frame[has], None] + np.arange(len(INERTIAL))
        D[..., joint[has, None], columns] = by_link[..., has, :]
        for name in self._elements:
            D[..., -q.shape[-1] :, column[name]] = self._element(name, q, qd, qdd)
        return D

    def _element(self, name: str, q: Array, qd: Array, qdd: Array) -> Array:
        """Return the joint torques, shape (..., n), of an element (friction, spring, ...) whose
        parameter `name`, such as FV2, is 1.
        """
        e, G, B = self._elements[name]
        if e.is_own:
            return np.asarray(self._floats(name, q, qd)[..., 0])
        if e.kind in ("inertia", "stiffness"):
            return np.asarray({"inertia": qdd, "stiffness": q}[e.kind] @ B)
        if e.kind == "offset":
            return np.broadcast_to(G, np.shape(q))
        sd = np.asarray(qd @ G)[..., None]
        force = np.asarray(qd @ B if e.kind == "viscous" else np.sign(sd) * G)
        return force if e.when is None else force * (sd > 0 if e.when == "positive" else sd < 0)

    def _row_and_form(self, e: Element, j: int) -> tuple[Array, Array]:
        """Return the coefficients G, shape (n,), of the motion s = G q on which an element
        (friction, spring, ...) acts, and the matrix B of an element with parameter c: torque c B q
        of a spring, c B qd of viscous friction, c B qdd of an inertia.

        B has shape (n, n). B is G'G if the element acts along a row G. j is the number in the name
        of the parameter c, for instance 2 for FV2.
        """
        moving = self.robot.moving
        G = np.zeros(len(moving))
        for i, x in e.along.get(j, {}).items():
            G[moving.index(i)] = x.value(self.constants)
        B = np.outer(G, G)
        for (i, l), x in e.form.get(j, {}).items():
            B[moving.index(i), moving.index(l)] = x.value(self.constants)
        return G, B

    def torque(self, q: Array, qd: Array, qdd: Array, chi: Array) -> Array:
        """Return the joint torques Gamma = D chi, shape (..., n)."""
        return np.asarray((self.regressor(q, qd, qdd) @ np.asarray(chi)[..., None])[..., 0])

    def inertia_matrix(self, q: Array, chi: Array) -> Array:
        """Return the inertia matrix A = d2E/dqd2, shape (..., n, n).

            A_ik = sum_j tr(dT_j/dq_i Sigma_j dT_j/dq_k')

        and, for each element with a moment of inertia c, c B.
        """
        value, dT = dict(zip(self.names, chi, strict=True)), self._moving(q)
        n = np.shape(q)[-1]
        A = np.zeros((*np.shape(q), n))
        for j in self.robot.links:
            pairs = np.flatnonzero(self._moves.frame == j - 1)
            own = np.array([value[parameter(name, j)] for name in INERTIAL])
            left = dT[..., pairs, :, :] @ np.tensordot(own, LINK, 1)
            left, right = (x.reshape(*x.shape[:-2], 16) for x in (left, dT[..., pairs, :, :]))
            i = self._moves.joint[pairs]
            A[..., i[:, None], i] += left @ np.swapaxes(right, -1, -2)
        for name, (e, _, B) in self._elements.items():
            if e.kind == "inertia":
                A += value[name] * B
        return A

    def jacobian(self, q: Array, frame: int | None = None) -> Array:
        """Return the Jacobian of a frame (default: the last) in frame 0, shape (..., 6, n).

        Rows 1 to 3 are the velocity of the origin, rows 4 to 6 the angular velocity w from
        hat(w) = Rdot R'.
        """
        return self.jacobians(q)[..., (frame or self.robot.frames[-1].j) - 1, :, :]

    def jacobians(self, q: Array) -> Array:
        """Return the Jacobians of all frames in frame 0, shape (..., frames, 6, n)."""
        slopes, R = self.slopes(q)[..., :3, :], self.poses(q)[..., :3, :3]
        W = slopes[..., :3] @ np.swapaxes(R, -1, -2)[..., None, :, :, :]
        return np.moveaxis(np.concatenate([slopes[..., 3], _axial(W)], axis=-1), -3, -1)

    def acceleration(self, q: Array, qd: Array, qdd: Array, frame: int) -> Array:
        """Return the linear and angular acceleration of a frame, in frame 0, shape (..., 6).

        The first three rows are the acceleration of its origin, the others its angular acceleration
        wd from hat(wd) = Rddot R' + Rdot Rdot'.
        """
        if frame == 0:
            return np.zeros((*np.shape(q)[:-1], 6))
        R = self.poses(q)[..., frame - 1, :3, :3]
        rate = np.einsum("...iab,...i->...ab", self.slopes(q)[..., frame - 1, :3, :3], qd)
        second = _matrices(self._floats("accelerations", q, qd, qdd))[..., 0, frame - 1, :3, :]
        W = second[..., :3] @ np.swapaxes(R, -1, -2) + rate @ np.swapaxes(rate, -1, -2)
        return np.concatenate([second[..., 3], _axial(W)], axis=-1)

    def base_regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Return the regressor of the wrench at the base, in frame 0, shape (..., 6, p).

        The wrench is the force, then the moment about O_0, that move the links against gravity. The
        moment is computed from the products of position and acceleration of the mass points, Tdd
        Sigma T'.
        """
        g = np.array([e.value(self.constants) for e in self.robot.gravity])
        T, Tdd = (
            self.poses(q),
            _matrices(self._floats("accelerations", q, qd, qdd))[..., 0, :, :, :],
        )
        D = np.zeros((*np.shape(q)[:-1], 6, len(self.names)))
        for j in self.robot.links:
            second = Tdd[..., j - 1, :3, :].copy()
            second[..., 3] -= g
            R = np.einsum("...ab,pbc,...dc->...pad", second, LINK, T[..., j - 1, :, :])
            first = self.names.index(parameter(INERTIAL[0], j))
            wrench = np.concatenate([R[..., :3, 3], _axial(R) - _axial(R.swapaxes(-1, -2))], -1)
            D[..., first : first + len(INERTIAL)] = np.swapaxes(wrench, -1, -2)
        return D

    def potential_energy(self, q: Array, chi: Array) -> Array:
        """Return the potential energy U of gravity, springs, constant torques and user laws."""
        value, T = dict(zip(self.names, chi, strict=True)), self.poses(q)
        g = np.array([e.value(self.constants) for e in self.robot.gravity] + [0.0])
        U = np.zeros(np.shape(q)[:-1])
        for j in self.robot.links:
            first = np.array([value[parameter(name, j)] for name in ("MX", "MY", "MZ", "M")])
            U -= T[..., j - 1, :, :] @ first @ g
        for name, (e, G, B) in self._elements.items():
            if e.kind == "offset":
                U += value[name] * (q @ G)
            elif e.kind == "stiffness":
                U += value[name] * (q @ B * q / 2).sum(axis=-1)
            elif e.energy is not None:
                U += value[name] * self._floats(f"U_{name}", q)[..., 0, 0]
        return U

    def motion(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array, Array]:
        """Compute the motion of all moving joints from the motion of the actuated joints.

        The arguments have shape (..., n_a). Return the tree motion q, qd, qdd, shape (..., n), and
        G = dq/dqa, shape (..., n, n_a). Newton's method closes the loops. It begins with the
        constraints of the file, or moves in small steps from a `start` that gives all joints. A
        state is NaN if the loops cannot be closed, or can only be reached near a dead point.
        """
        actuated = [self.robot.moving.index(j) for j in self.robot.joints]
        passive = [self.robot.moving.index(j) for j in self.robot.passive]
        x = self._floats("start", q)[..., 0]
        G = np.zeros((*x.shape, len(actuated)))
        G[..., actuated, :] = np.eye(len(actuated))
        if not passive:
            return x, np.asarray(qd), np.asarray(qdd), G
        wanted, regular = x[..., actuated].copy(), np.ones(x.shape[:-1], dtype=bool)
        if self._home is not None:  # a `start` as it is drawn does not close to the last digit
            x = newton(
                self._gap,
                np.broadcast_to(self._home, x.shape),
                passive,
                steps=NEWTON_STEPS,
                tolerance=SETTLED,
            )
        for left in range(1 if self._home is None else FOLLOWED, 0, -1):
            J = self._floats("loop_jacobian", x)
            step = (wanted - x[..., actuated]) / left
            along = -np.linalg.pinv(J[..., passive]) @ J[..., actuated] @ step[..., None]
            x[..., actuated] += step
            x[..., passive] += along[..., 0]
            ahead = x.copy()
            x = newton(self._gap, x, passive, steps=NEWTON_STEPS, tolerance=SETTLED)
            if self._home is not None:
                regular &= (np.abs(x - ahead).max(axis=-1) < ASTRAY) & (
                    self._regularity(x, passive) > REGULAR * self._regularity(self._home, passive)
                )
        J = self._floats("loop_jacobian", x)
        inverse = np.linalg.pinv(J[..., passive])
        G[..., passive, :] = -inverse @ J[..., actuated]
        xd = (G @ np.asarray(qd)[..., None])[..., 0]
        xdd = (G @ np.asarray(qdd)[..., None])[..., 0]
        xdd[..., passive] -= (inverse @ self._floats("loop_rate", x, xd))[
            ..., 0
        ]  # Jp qddp + Ja qdda + Jdot qd = 0
        x[(np.abs(self._gap(x)).max(axis=-1) > CLOSED) | ~regular] = np.nan
        return x, xd, xdd, G

    def _gap(self, x: Array) -> Array:
        """Return the residual phi of the closure equations, shape (..., equations)."""
        return self._floats("loop", x)[..., 0]

    def _regularity(self, x: Array, passive: list[int]) -> Array:
        """Return the ratio of the smallest to the largest singular value of the closure Jacobian
        dphi/dq_passive.

        The ratio is small near a dead point of the mechanism.
        """
        s = np.linalg.svd(self._floats("loop_jacobian", x)[..., passive], compute_uv=False)
        return np.asarray(s[..., -1] / s[..., 0])

    def actuated_regressor(
        self, q: Array, qd: Array, qdd: Array, base: Array | None = None
    ) -> Array:
        """Return the standard regressor D of the actuated joint torques D chi, (..., n_a, p).

        The six rows of a free base come before the joints.

        D = G' D_tree, with G = dq/dq_a and the regressor D_tree of the open tree. The arguments q,
        qd, qdd of the actuated joints have shape (..., n_a), in the order of `robot.joints`; `base`
        is that of `regressor`.
        """
        x, xd, xdd, G = self.motion(q, qd, qdd)
        D, n = self.regressor(x, xd, xdd, base), x.shape[-1]
        joints = np.swapaxes(G, -1, -2) @ D[..., -n:, :]
        return np.concatenate([D[..., :-n, :], joints], axis=-2)


def _carried(T: Array, Td: Array, base: Array) -> Array:
    """Return T_0dd T_j + 2 T_0d T_jd at T_0 = 1, shape (..., frames, 4, 4): the accelerations that
    a moving base adds.

    T, Td : poses of the frames j in frame 0, and their rates, shape (..., frames, 4, 4).
    base : w0, wd0 and a0, shape (..., 9).
    """
    T0d, T0dd = np.zeros((2, *base.shape[:-1], 1, 4, 4))
    T0d[..., 0, :3, :3] = W = _hat(base[..., :3])
    T0dd[..., 0, :3, :3] = _hat(base[..., 3:6]) + W @ W
    T0dd[..., 0, :3, 3] = base[..., 6:]
    return np.asarray(T0dd @ T + 2 * T0d @ Td)


def _with_link_0(of_frames: Array, own: Array) -> Array:
    """Put the matrix `own` of link 0 before the matrices of the frames, shape (..., 1 + frames, 4,
    4).
    """
    own = np.broadcast_to(own, (*of_frames.shape[:-3], 1, 4, 4))
    return np.concatenate([own, of_frames], axis=-3)


def _generators() -> Array:
    """Return dT_0/dx_i at T_0 = 1, shape (6, 1, 4, 4): three shifts, then three turns."""
    G = np.zeros((6, 1, 4, 4))
    for k in range(3):
        G[k, 0, k, 3] = 1
        G[3 + k, 0, :3, :3] = _hat(np.eye(3)[k])
    return G


def _hat(w: Array) -> Array:
    """Return the matrix of the cross product w x, shape (..., 3, 3)."""
    return np.asarray(np.cross(np.eye(3), w[..., None, :]))


def _axial(W: Array) -> Array:
    """Return the vector w, shape (..., 3), of a skew-symmetric matrix W = hat(w)."""
    return np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)


class Moves(NamedTuple):
    """The pairs of a joint i and a frame j that it moves, so that dT_j/dq_i is not zero.

    Attributes
    ----------
    joint, frame : ndarray, shape (pairs,)
        Index of the joint in `robot.moving`, and of the frame in `robot.frames`.
    entry : ndarray
        Places of the derivatives that CasADi computes, in a table (pairs, 16) of columns.
    """

    joint: Array
    frame: Array
    entry: Array


def _moves(slopes: SX) -> Moves:
    """Return the pairs of joint and frame whose derivatives in dt/dq are not structurally zero."""
    row, joint = (np.array(x, dtype=int) for x in slopes.sparsity().get_triplet())
    pairs, of = np.unique(joint * slopes.shape[0] + row // 16, return_inverse=True)
    return Moves(pairs // slopes.shape[0], pairs % slopes.shape[0], of * 16 + row % 16)


SHIFTS_AND_TURNS = _generators()


@lru_cache(maxsize=8)
def _functions(robot: Robot) -> tuple[dict[str, Any], Moves]:
    """Return the CasADi functions of a robot by name, such as the poses and their derivatives.

    Their arguments are q, qd, qdd of all moving joints, as far as needed, then the constants with
    one more number at the end. Only derivatives of the poses that are not zero are computed;
    `Moves` lists their places.
    """
    n, symbols = len(robot.moving), ca.SX.sym("c", len(robot.constants) + 1)
    constants = dict(zip(robot.constants, ca.vertsplit(symbols), strict=False))
    q, qd, qdd = ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("qdd", n)
    T = poses(robot, {j: q[k] for k, j in enumerate(robot.moving)}, constants)
    t = ca.vertcat(*(ca.vec(T[f.j]) for f in robot.frames))
    rate = ca.jtimes(t, q, qd)
    phi = _closure(robot, q, constants)
    actuated, start = _start(robot, q, constants)
    slopes = ca.jacobian(t, q)
    outputs = {
        "poses": ([q], t),
        "slopes": ([q], slopes.nz[:]),
        "accelerations": (
            [q, qd, qdd],
            ca.jtimes(rate, ca.vertcat(q, qd), ca.vertcat(qd, qdd)),
        ),
        "loop": ([q], phi),
        "loop_jacobian": ([q], ca.jacobian(phi, q)),
        "loop_rate": ([q, qd], ca.jtimes(ca.jtimes(phi, q, qd), q, qd)),
        "start": ([actuated], start),
    }
    for e in (e for e in robot.elements if e.is_own):
        for j in e.along:
            name, (torque, U) = parameter(e.family, j), _law(robot, e, j, q, qd, constants)
            outputs |= {name: ([q, qd], torque), f"U_{name}": ([q], U)}
    functions = {
        name: ca.Function(name, [*inputs, symbols], [ca.densify(value)])
        for name, (inputs, value) in outputs.items()
    }
    return functions, _moves(slopes)


def _closure(robot: Robot, q: SX, constants: Mapping[str, SX]) -> SX:
    """Return the closure residual phi(q), zero if all loops close and all constraints hold.

    A loop closes if its twin frame coincides with its cut frame. Positions are relative to the
    frame on which the loop is mounted and are divided by the longest length of the loops: with the
    lengths of a large arm, the digits of a small loop on the arm would be lost.
    """
    phi, by_joint = [], {j: q[k] for k, j in enumerate(robot.moving)}
    for loop in robot.loops:
        T = poses(robot, by_joint, constants, robot.root(loop))
        cut, twin = T[loop.cut], T[loop.twin]
        phi += [
            ca.vec(cut[:3, :3].T @ twin[:3, :3] - ca.SX.eye(3)),
            (twin[:3, 3] - cut[:3, 3]) / robot.longest,
        ]
    phi += [
        by_joint[j] - _symbolic(e, {f"q{i}": x for i, x in by_joint.items()}, constants)
        for j, e in robot.constraints.items()
    ]
    return ca.densify(ca.vertcat(*phi)) if phi else ca.SX.zeros(0)


def _start(robot: Robot, q: SX, constants: Mapping[str, SX]) -> tuple[SX, SX]:
    """Return symbols of the actuated joints, and start positions of all moving joints as functions
    of them.

    A passive joint has the position of its constraint, else the `start` of its loop, else 0.
    """
    names = {f"q{j}": q[k] for k, j in enumerate(robot.moving)}
    x = [
        names[f"q{j}"] if j in robot.joints else ca.SX(robot.start.get(j, 0.0))
        for j in robot.moving
    ]
    for _ in robot.constraints:  # a constraint may name joints that have one themselves
        now = dict(zip(names, x, strict=True))
        x = [
            _symbolic(robot.constraints[j], now, constants)
            if j in robot.constraints
            else now[f"q{j}"]
            for j in robot.moving
        ]
    return ca.vertcat(*(names[f"q{j}"] for j in robot.joints)), ca.vertcat(*x)


def _law(
    robot: Robot, e: Element, j: int, q: SX, qd: SX, constants: Mapping[str, SX]
) -> tuple[SX, SX]:
    """Return joint torques, shape (n,), and energy of a torque law of the user whose parameter is
    1.

    j is the number in the name of the parameter. CasADi differentiates an energy U to the torque
    dU/dq.
    """
    G = ca.SX.zeros(len(robot.moving))
    for i, g in e.along[j].items():
        G[robot.moving.index(i)] = _symbolic(g, {}, constants)
    states = {"q": ca.dot(G, q), "qd": ca.dot(G, qd)}
    for k, i in enumerate(robot.moving):
        states |= {f"q{i}": q[k], f"qd{i}": qd[k]}
    states |= {f"{CHANNEL}{name}": constants[name] for name in e.channels(j)}
    U = _symbolic(e.potential(j), states, constants)
    return ca.gradient(U, q) + G * _symbolic(e.law(j), states, constants), U


def _symbolic(e: Expression, q: Mapping[str, SX], constants: Mapping[str, SX]) -> SX:
    values = {"pi": np.pi, **constants, **q}

    def function(name: str, *operands: Expression) -> SX:
        x = [_symbolic(operand, q, constants) for operand in operands]
        return 1 / x[0] if name == "inv" else getattr(ca, FUNCTIONS[name].casadi)(*x)

    return ca.SX(e.evaluate(values.__getitem__, function, float))


class Sample(NamedTuple):
    """Random states of a robot, and its standard regressor at these states.

    Attributes
    ----------
    model : Lagrange
        Dynamics by energies.
    q, qd, qdd : ndarray, shape (N, n), SI and rad
        States of the actuated joints, in the order of `robot.joints`.
    D : ndarray, shape (N, n, p), or (N, 6 + n, p) of a free base
        Gamma = D chi at each state, chi in the order of `robot.parameters`.
    base : ndarray, shape (N, 9), or None
        Motion w0, wd0, a0 of a base that moves.
    """

    model: Lagrange
    q: Array
    qd: Array
    qdd: Array
    D: Array
    base: Array | None = None

    @property
    def W(self) -> Array:
        """Observation matrix, shape (n*N, p): regressors of all N states, rows of joint 1 first."""
        return self.D.transpose(1, 0, 2).reshape(-1, self.D.shape[2])


def _leverage(robot: Robot, constants: Mapping[str, float]) -> Array:
    """Return the largest factor of each actuated velocity in friction that acts on several joints.

    Friction along q4 + 101.25 q5, for instance, depends on the velocity q4d + 101.25 q5d: the
    factor of joint 5 is 101.25. The factor is 1 for a joint without such friction. The result has
    the shape (n,).
    """
    closure = close(robot)
    rows = [dict(closure.in_independent(r)) for e in robot.elements for r in e.along.values()]
    shared = [row for row in rows if len(row) > 1]
    return np.array(
        [
            max([abs(row[j].value(constants)) for row in shared if j in row], default=1.0)
            for j in robot.joints
        ]
    )


def sampled(
    robot: Robot,
    states: int,
    seed: int = 0,
    constants: Mapping[str, float] | None = None,
    in_time: bool = False,
) -> Sample:
    """Draw random states of a robot, and compute the standard regressor at these states.

    Positions are within pi rad or 1 m; in general loops they are within 0.5 rad or m of the start
    of the loop, less for short links. Velocities and accelerations are standard normal. In every
    other state each velocity is divided by the leverage of its joint, so that the sign of q4d +
    101.25 q5d is not always the sign of q5d. `in_time`: whether channels are drawn at every state.
    Raises DescriptionError if the torques are not finite or the loops close in too few of the
    states.
    """
    model, rng = Lagrange(robot, constants), np.random.default_rng(seed)
    free = not robot.loops or set(robot.passive) <= set(robot.constraints)
    slide = 1.0 if free else min(0.5, robot.longest / 4)
    reach = np.array(
        [
            (np.pi if free else 0.5) if robot.frame(j).sigma == REVOLUTE else slide
            for j in robot.joints
        ]
    )
    centre = np.array([robot.start.get(j, 0.0) for j in robot.joints])
    n, leverage = len(robot.joints), _leverage(robot, model.constants)
    if in_time:
        model.vary(np.random.default_rng(seed + 1), states)
    state, D = np.empty((3, 0, n)), np.empty((0, len(robot.rows), len(robot.parameters)))
    of_base, bases = np.random.default_rng(seed + 2), np.empty((0, 9))
    for _ in range(DRAWS):
        q, qd, qdd = (
            centre + reach * rng.uniform(-1, 1, (states, n)),
            *rng.standard_normal((2, states, n)),
        )
        qd[::2] /= leverage
        base = of_base.standard_normal((states, 9)) if robot.base_moves else None
        block = model.actuated_regressor(q, qd, qdd, base)
        closed = np.isfinite(block).all(axis=(1, 2))
        D = np.concatenate([D, block[closed]])[:states]
        state = np.concatenate([state, np.array([q, qd, qdd])[:, closed]], axis=1)[:, :states]
        if base is not None:
            bases = np.concatenate([bases, base[closed]])[:states]
        if len(D) == states:
            return Sample(model, state[0], state[1], state[2], D, bases if len(bases) else None)
    if not robot.passive:
        raise DescriptionError(
            (
                f"{robot.name}: torques are not finite for the constants {dict(robot.constants)}; "
                "check their values"
            ),
            path=("constants",),
        )
    raise DescriptionError(
        (
            f"{robot.name}: the loops close in {len(D)} of {DRAWS * states} random states near "
            "their start; give each loop a `start` at which the loop closes"
        ),
        path=("loops",),
    )


def in_one_mode(robot: Robot) -> Robot:
    """Return the robot with constraints or start positions that fix the assembly mode of its loops.

    If all passive joints are linear in the actuated joints, these relations become constraints of
    the robot; else its loops get a start configuration that closes them. The dynamics by energies
    still close every loop themselves, and refuse states in which the declared positions do not
    close it.
    """
    closure = close(robot)
    if closure.tied:
        return replace(
            robot, loops=tuple(replace(loop, start=dict(closure.start)) for loop in robot.loops)
        )
    declared = {j: closure.formula(j) for j in robot.passive}
    return replace(robot, constraints=declared) if declared else robot
