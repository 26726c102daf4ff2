"""Dynamics from energies, differentiated by CasADi: an independent oracle that shares nothing with the Newton-Euler recursions.

With T_j(q) the pose of frame j in frame 0 (4 x 4) and Sigma_j the pseudo-inertia of link j about
the origin of its frame,

    E = sum_j 1/2 tr(Tdot_j Sigma_j Tdot_j')      U = - sum_j (g', 0) T_j Sigma_j e4

    Sigma = | tr(J)/2 E3 - J   MS |      J  = [XX XY XZ; XY YY YZ; XZ YZ ZZ]
            |      MS'          M |      MS = [MX MY MZ]'

both linear in the standard parameters chi. Since dTdot/dqd_i = dT/dq_i, Lagrange's equations are
[U65]

    Gamma_i = d/dt dE/dqd_i - dE/dq_i + dU/dq_i = sum_j tr(dT_j/dq_i Sigma_j Tddot_j') - (g', 0)
    dT_j/dq_i Sigma_j e4 ,

dT/dq and Tddot by CasADi. Elements with parameter c along s = G q, or of form B (G'G where they act
along s), add

    c B qdd (inertia),  c G' (offset),  c B q (stiffness),  c B qd (viscous),  c G' sign(sd)
    (coulomb)

with `when: positive` where sd > 0 only, negative where sd < 0. Coordinates are all joints that
move, the cut and passive ones included (the open tree). A mechanism with loops is the tree
restricted to q = f(qa), where phi(q) = 0 closes the loops:

    Gamma_a = G' Gamma_tree,   G = dq/dqa,   qd = G qad,   qdd = G qadd + Gdot qad .

The certificates and the tests import this module; nothing else does.

[U65] J. J. Uicker, On the dynamic analysis of spatial linkages using 4 x 4 matrices, Northwestern
University, 1965.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from symgen.derive.assembly import inertia_of, newton
from symgen.derive.loops import close
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.kinds import CHANNEL
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
    """iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r), i = ant(j).

    4 x 4.
    """
    gamma, b, alpha, d, theta, r = (
        _symbolic(e, {}, constants)
        for e in (frame.gamma, frame.b, frame.alpha, frame.d, frame.theta0, frame.r0)
    )
    theta = theta + q if frame.sigma == REVOLUTE else theta
    r = r + q if frame.sigma == PRISMATIC else r
    return _screw(2, gamma, b) @ _screw(0, alpha, d) @ _screw(2, theta, r)


def _screw(axis: int, angle: SX, shift: SX) -> SX:
    """Rotation about x (axis 0) or z (axis 2) and translation along it, 4 x 4."""
    T = ca.SX.eye(4)
    u, v = (axis + 1) % 3, (axis + 2) % 3
    T[u, u], T[u, v], T[v, u], T[v, v] = ca.cos(angle), -ca.sin(angle), ca.sin(angle), ca.cos(angle)
    T[axis, 3] = shift
    return T


def poses(
    robot: Robot, q: Mapping[int, SX], constants: Mapping[str, SX], root: int = 0
) -> dict[int, SX]:
    """rTj of every frame that frame r, the `root`, carries, by frame number; q by joint number."""
    T = {root: ca.SX.eye(4)}
    for f in (f for f in robot.frames if f.ant in T):
        T[f.j] = T[f.ant] @ pose(f, q.get(f.j, 0), constants)
    return T


def pseudo_inertia(name: str) -> Array:
    """Sigma of a link whose only nonzero standard parameter is `name` = 1."""
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
    """A CasADi function of column vectors on samples: arguments (..., m_k), result (..., rows, columns)."""
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
    """Columns of stacked vec(4 x 4), (..., 16 F, n), as matrices, (..., n, F, 4, 4)."""
    stacked = np.moveaxis(columns, -1, -2)
    return np.swapaxes(stacked.reshape(*stacked.shape[:-1], -1, 4, 4), -1, -2)


class Lagrange:
    """Dynamics of the open tree of a robot in all its moving joints (order `robot.moving`), geometry in floats.

    Every method takes q, qd, qdd of shape (..., n), rad or m and their rates, and returns the same
    leading axes. chi is (p,) in the order of `robot.parameters`, or (..., p).
    """

    def __init__(self, robot: Robot, constants: Mapping[str, float] | None = None) -> None:
        self.robot, self.names = robot, robot.parameters
        self.constants = {**robot.constants, **(constants or {})}
        self._functions, self._values = _functions(robot), np.array([*self.constants.values(), 1.0])
        start = robot.start
        self._home = (
            np.array([start[j] for j in robot.moving]) if set(robot.moving) <= set(start) else None
        )

    def _floats(self, name: str, *arguments: Array) -> Array:
        return _floats(self._functions[name], *arguments, self._values)

    def vary(self, rng: np.random.Generator, states: int) -> None:
        """Draw channels (functions of time) at each of `states` states."""
        self._values = np.tile(self._values, (states, 1))
        for name in self.robot.channels:
            self._values[:, [*self.constants].index(name)] = rng.uniform(0.5, 2, states)

    def poses(self, q: Array) -> Array:
        """0Tj of every frame in file order, (..., frames, 4, 4)."""
        return _matrices(self._floats("poses", q))[..., 0, :, :, :]

    def slopes(self, q: Array) -> Array:
        """d0Tj/dq_i, (..., n, frames, 4, 4)."""
        return _matrices(self._floats("slopes", q))

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """D with Gamma = D chi, (..., n, p)."""
        robot = self.robot
        dT, ddT = (
            self.slopes(q),
            _matrices(self._floats("accelerations", q, qd, qdd))[..., 0, :, :, :],
        )
        g = np.array([e.value(self.constants) for e in robot.gravity] + [0.0])
        column = {name: k for k, name in enumerate(self.names)}
        D = np.zeros((*dT.shape[:-3], len(self.names)))
        for j in robot.links:
            slope, first = dT[..., j - 1, :, :], column[parameter(INERTIAL[0], j)]
            inertia = np.einsum("...iab,...ac->...ibc", slope, ddT[..., j - 1, :, :])
            D[..., first : first + len(INERTIAL)] = np.einsum("...ibc,sbc->...is", inertia, LINK)
            D[..., first : first + len(INERTIAL)] -= np.einsum(
                "a,...iab,sb->...is", g, slope, LINK[:, :, 3]
            )
        for e in robot.elements:
            for j in e.keys:
                D[..., column[parameter(e.family, j)]] = self._element(e, j, q, qd, qdd)
        return D

    def _element(self, e: Element, j: int, q: Array, qd: Array, qdd: Array) -> Array:
        """Gamma of an element's key j for parameter 1, (..., n)."""
        if e.is_own:
            return np.asarray(self._floats(parameter(e.family, j), q, qd)[..., 0])
        G, B = self._row(e, j), self._form(e, j)
        if e.kind in ("inertia", "stiffness"):
            return np.asarray({"inertia": qdd, "stiffness": q}[e.kind] @ B)
        if e.kind == "offset":
            return np.broadcast_to(G, np.shape(q))
        sd = np.asarray(qd @ G)[..., None]
        force = np.asarray(qd @ B if e.kind == "viscous" else np.sign(sd) * G)
        return force if e.when is None else force * (sd > 0 if e.when == "positive" else sd < 0)

    def _row(self, e: Element, j: int) -> Array:
        """G of an element's key j, (n,)."""
        G = np.zeros(len(self.robot.moving))
        for i, x in e.along.get(j, {}).items():
            G[self.robot.moving.index(i)] = x.value(self.constants)
        return G

    def _form(self, e: Element, j: int) -> Array:
        """B of an element's key j, (n, n); G'G along a row."""
        G, moving = self._row(e, j), self.robot.moving
        B = np.outer(G, G)
        for (i, l), x in e.form.get(j, {}).items():
            B[moving.index(i), moving.index(l)] = x.value(self.constants)
        return B

    def torque(self, q: Array, qd: Array, qdd: Array, chi: Array) -> Array:
        """Gamma, (..., n)."""
        return np.asarray((self.regressor(q, qd, qdd) @ np.asarray(chi)[..., None])[..., 0])

    def inertia_matrix(self, q: Array, chi: Array) -> Array:
        """A = d2E/dqd2, (..., n, n): column i is Gamma for qdd_i = 1 from rest, less that at rest."""
        return inertia_of(lambda qdd: self.torque(q, 0 * q, qdd, chi), q)

    def jacobian(self, q: Array, frame: int | None = None) -> Array:
        """Velocity of the origin, then angular velocity w from hat(w) = Rdot R', of `frame` (default: the last) in frame 0 per qd, (..., 6, n)."""
        j = frame or self.robot.frames[-1].j
        slope, R = self.slopes(q)[..., j - 1, :3, :], self.poses(q)[..., j - 1, :3, :3]
        W = slope[..., :3] @ np.swapaxes(R, -1, -2)[..., None, :, :]
        return np.swapaxes(np.concatenate([slope[..., 3], _axial(W)], axis=-1), -1, -2)

    def acceleration(self, q: Array, qd: Array, qdd: Array, frame: int) -> Array:
        """Acceleration of the origin of `frame`, then angular acceleration wd from hat(wd) = Rddot R' + Rdot Rdot', in frame 0, (..., 6)."""
        if frame == 0:
            return np.zeros((*np.shape(q)[:-1], 6))
        R = self.poses(q)[..., frame - 1, :3, :3]
        rate = np.einsum("...iab,...i->...ab", self.slopes(q)[..., frame - 1, :3, :3], qd)
        second = _matrices(self._floats("accelerations", q, qd, qdd))[..., 0, frame - 1, :3, :]
        W = second[..., :3] @ np.swapaxes(R, -1, -2) + rate @ np.swapaxes(rate, -1, -2)
        return np.concatenate([second[..., 3], _axial(W)], axis=-1)

    def base_regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Force and moment about O_0, in frame 0, that move the links against gravity, by standard
        parameter, (..., 6, p): the moments of mass of hat(r) rdd, from Tdd Sigma T'.
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
        """U of gravity, springs and offsets, (...)."""
        value, T = dict(zip(self.names, chi, strict=True)), self.poses(q)
        g = np.array([e.value(self.constants) for e in self.robot.gravity] + [0.0])
        U = np.zeros(np.shape(q)[:-1])
        for j in self.robot.links:
            first = np.array([value[parameter(name, j)] for name in ("MX", "MY", "MZ", "M")])
            U -= T[..., j - 1, :, :] @ first @ g
        for e in self.robot.elements:
            for j in e.keys:
                if e.kind == "offset":
                    U += value[parameter(e.family, j)] * (q @ self._row(e, j))
                elif e.kind == "stiffness":
                    Bq = q @ self._form(e, j) * q / 2
                    U += value[parameter(e.family, j)] * Bq.sum(axis=-1)
                elif e.energy is not None:
                    own = self._floats(f"U_{parameter(e.family, j)}", q)[..., 0, 0]
                    U += value[parameter(e.family, j)] * own
        return U

    def motion(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array, Array]:
        """Tree motion q, qd, qdd (..., n) and G = dq/dqa (..., n, n_a) of the actuated q, qd, qdd (..., n_a).

        Loops are closed by Newton's method from the constraints, or followed from a `start` of all
        joints; a state that it cannot close, or reach without passing near a dead point, is NaN.
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
        """phi, (..., equations)."""
        return self._floats("loop", x)[..., 0]

    def _regularity(self, x: Array, passive: list[int]) -> Array:
        """Smallest over largest singular value of the closure's derivatives by the passive joints."""
        s = np.linalg.svd(self._floats("loop_jacobian", x)[..., passive], compute_uv=False)
        return np.asarray(s[..., -1] / s[..., 0])

    def actuated_regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """G' D_tree at actuated q, qd, qdd (..., n_a), order `robot.joints`: (..., n_a, p)."""
        *state, G = self.motion(q, qd, qdd)
        return np.swapaxes(G, -1, -2) @ self.regressor(*state)


def _axial(W: Array) -> Array:
    """w of hat(w), (..., 3)."""
    return np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)


@lru_cache(maxsize=8)
def _functions(robot: Robot) -> dict[str, Any]:
    """The functions of q, qd, qdd of all moving joints, then of the constants and a number more."""
    n, symbols = len(robot.moving), ca.SX.sym("c", len(robot.constants) + 1)
    constants = dict(zip(robot.constants, ca.vertsplit(symbols), strict=False))
    q, qd, qdd = ca.SX.sym("q", n), ca.SX.sym("qd", n), ca.SX.sym("qdd", n)
    T = poses(robot, {j: q[k] for k, j in enumerate(robot.moving)}, constants)
    t = ca.vertcat(*(ca.vec(T[f.j]) for f in robot.frames))
    rate = ca.jtimes(t, q, qd)
    phi = _closure(robot, q, constants)
    actuated, start = _start(robot, q, constants)
    outputs = {
        "poses": ([q], t),
        "slopes": ([q], ca.jacobian(t, q)),
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
    return {
        name: ca.Function(name, [*inputs, symbols], [ca.densify(value)])
        for name, (inputs, value) in outputs.items()
    }


def _closure(robot: Robot, q: SX, constants: Mapping[str, SX]) -> SX:
    """phi(q), zero if every twin coincides with its cut frame and every constrained joint has its value.

    Positions per longest length, from the frame that carries a loop: beside the lengths of an arm
    the digits of a small loop on it would be lost.
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
    """The actuated joints, and all from them: passive ones from their constraint, else from `start` of their loop, else 0."""
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
    """Torque (n,) of key j for parameter 1, dU/dq of an energy by CasADi, and the energy."""
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


@dataclass(frozen=True)
class Sample:
    """The standard regressor at random states.

    Attributes
    ----------
    model : Lagrange
        Dynamics by energies.
    q, qd, qdd : ndarray, shape (N, n), SI and rad
        States of the actuated joints, in the order of `robot.joints`.
    D : ndarray, shape (N, n, p)
        Gamma = D chi at each state, chi in the order of `robot.parameters`.
    """

    model: Lagrange
    q: Array
    qd: Array
    qdd: Array
    D: Array

    @property
    def W(self) -> Array:
        """D of all states, shape (n*N, p), rows joint-major."""
        return self.D.transpose(1, 0, 2).reshape(-1, self.D.shape[2])


def _leverage(robot: Robot, constants: Mapping[str, float]) -> Array:
    """Largest coefficient of each actuated joint among the rows of elements that several of these share, 1 if there is none.

    Shape (n,).
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
    """The standard regressor at `states` random states: q within pi rad or 1 m, general loops within 0.5 of their start.

    Velocities and accelerations are standard normal; in every other state each velocity is divided
    by its leverage, so that the sign of q4 + 101.25 q5 is not that of q5 alone. `in_time`: channels
    are drawn at every state. Raises DescriptionError if the loops close in too few of the
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
    state, D = np.empty((3, 0, n)), np.empty((0, n, len(robot.parameters)))
    for _ in range(DRAWS):
        q, qd, qdd = (
            centre + reach * rng.uniform(-1, 1, (states, n)),
            *rng.standard_normal((2, states, n)),
        )
        qd[::2] /= leverage
        block = model.actuated_regressor(q, qd, qdd)
        closed = np.isfinite(block).all(axis=(1, 2))
        D = np.concatenate([D, block[closed]])[:states]
        state = np.concatenate([state, np.array([q, qd, qdd])[:, closed]], axis=1)[:, :states]
        if len(D) == states:
            return Sample(model, state[0], state[1], state[2], D)
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
            "their start; give each loop a `start` that closes it"
        ),
        path=("loops",),
    )


def in_one_mode(robot: Robot) -> Robot:
    """`robot` with its passive joints declared where they are linear in the actuated ones: no state lies in an antiparallelogram.

    The dynamics by energies still closes every loop itself and refuses states in which the declared
    joints do not close it.
    """
    closure = close(robot)
    if closure.tied:
        return replace(
            robot, loops=tuple(replace(loop, start=dict(closure.start)) for loop in robot.loops)
        )
    declared = {j: closure.formula(j) for j in robot.passive}
    return replace(robot, constraints=declared)
