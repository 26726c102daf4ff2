"""Dynamics of mechanisms with loops by Lagrange multipliers: an independent oracle.

The open tree moves in all its joints q; phi(q) = 0 says that every twin coincides with its cut
frame and that every declared relation holds. With the energies of the tree (symgen.certify.lagrange)
and Jc = dphi/dq, S the columns of the actuated joints,

    S tau + Jc' lambda = Gamma_tree(q, qd, qdd) ,     Jc qd = 0 ,     Jc qdd + Jcdot qd = 0 .

Rows of Jc are redundant (a planar loop in space), so lambda is one of many; tau is unique and the
residual of the system is checked.
Frames are products of 4 x 4 matrices, derivatives CasADi's; nothing is shared with the derivation
of the closure or of the emitted models.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symgen.certify.lagrange import Lagrange
from symgen.description.expression import Expression
from symgen.description.robot import PRISMATIC, REVOLUTE, Robot

Array = np.ndarray[Any, Any]
REDUNDANT = 1e-9  # singular values of Jc below, relative to the largest: rows that say nothing new
STEPS = 12


class Multipliers:
    """A mechanism with loops at samples of its actuated joints; `around` are positions of all
    moving joints near closed ones.

    Motion is solved at construction: q, qd, qdd (N, moving), and `rates` G (N, moving, n) with qd =
    G qd_a.
    """

    def __init__(
        self, robot: Robot, around: Array, qd: Array, qdd: Array, tree: Lagrange | None = None
    ) -> None:
        self.robot, self.tree = robot, tree or Lagrange(robot)
        moving = robot.moving
        self.actuated = [moving.index(j) for j in robot.joints]
        self.passive = [k for k in range(len(moving)) if k not in self.actuated]
        q, v = ca.SX.sym("q", len(moving)), ca.SX.sym("v", len(moving))
        phi = closure(robot, q)
        jacobian = ca.jacobian(phi, q)
        self._phi = ca.Function("phi", [q], [ca.densify(phi)])
        self._jacobian = ca.Function("jacobian", [q], [ca.densify(jacobian)])
        self._bend = ca.Function(
            "bend", [q, v], [ca.densify(ca.jacobian(jacobian @ v, q) @ v)]
        )  # Jcdot qd
        self.q = self._closed(np.array(around, dtype=float))
        self.J = self.jacobian(self.q)
        J_p, J_a = self.J[..., self.passive], self.J[..., self.actuated]
        inverse = np.linalg.pinv(J_p, rcond=REDUNDANT)
        self.rates = np.zeros((len(self.q), len(moving), len(self.actuated)))
        self.rates[:, self.actuated] = np.eye(len(self.actuated))
        self.rates[:, self.passive] = -inverse @ J_a
        self.qd = (self.rates @ qd[..., None])[..., 0]
        self.qdd = (self.rates @ qdd[..., None])[..., 0]
        bend = np.array(
            [np.asarray(self._bend(x, xd)) for x, xd in zip(self.q, self.qd, strict=True)]
        )
        self.qdd[:, self.passive] -= (inverse @ bend)[..., 0]
        for left in (self.J @ self.qd[..., None], self.J @ self.qdd[..., None] + bend):
            assert np.abs(left).max() < 1e-9 * max(1.0, np.abs(self.qdd).max())

    def defect(self, q: Array) -> Array:
        """Largest entry of phi at each sample (metres and direction cosines)."""
        return np.array([np.abs(np.asarray(self._phi(x))).max() for x in q])

    def jacobian(self, q: Array) -> Array:
        """Jc, (N, equations, moving)."""
        return np.array([np.asarray(self._jacobian(x)) for x in q])

    def regularity(self, q: Array) -> Array:
        """Smallest over largest singular value of Jc in the passive joints: 0 where the loops are
        singular.
        """
        s = np.linalg.svd(self.jacobian(q)[..., self.passive], compute_uv=False)
        return np.asarray(s[:, len(self.passive) - 1] / s[:, 0])

    def _closed(self, q: Array) -> Array:
        """Newton for the passive joints; the actuated ones stay."""
        for _ in range(STEPS):
            r = np.array([np.asarray(self._phi(x)) for x in q])
            q[:, self.passive] -= (
                np.linalg.pinv(self.jacobian(q)[..., self.passive], rcond=REDUNDANT) @ r
            )[..., 0]
        assert self.defect(q).max() < 1e-12
        return q

    def solve(self, generalised: Array) -> Array:
        """tau (N, n, k) of S tau + Jc' lambda = generalised (N, moving, k)."""
        S = np.zeros((len(self.q), len(self.robot.moving), len(self.actuated)))
        S[:, self.actuated] = np.eye(len(self.actuated))
        M = np.concatenate([S, np.swapaxes(self.J, 1, 2)], axis=2)
        solution = np.linalg.pinv(M, rcond=REDUNDANT) @ generalised
        assert np.abs(M @ solution - generalised).max() <= 1e-10 * max(
            np.abs(generalised).max(), 1e-3
        )
        return solution[:, : len(self.actuated)]

    def torque(self, chi: Array) -> Array:
        """tau, (N, n)."""
        return self.solve(self.tree.torque(self.q, self.qd, self.qdd, chi)[..., None])[..., 0]

    def regressor(self) -> Array:
        """d tau / d chi, (N, n, p), one right-hand side per standard parameter."""
        return self.solve(self.tree.regressor(self.q, self.qd, self.qdd))

    def inertia_matrix(self, chi: Array) -> Array:
        """A of the actuated joints, (N, n, n): tau per unit acceleration at rest, without gravity."""
        return self.solve(self.tree.inertia_matrix(self.q, chi) @ self.rates)

    def gravity(self, chi: Array) -> Array:
        """tau at rest without friction, (N, n)."""
        return self.solve(self.tree.torque(self.q, 0 * self.q, 0 * self.q, chi)[..., None])[..., 0]

    def projected_regressor(self) -> Array:
        """G' D_tree, (N, n, p): the principle of virtual power instead of multipliers."""
        return np.swapaxes(self.rates, 1, 2) @ self.tree.regressor(self.q, self.qd, self.qdd)


def closure(robot: Robot, q: Any) -> Any:
    """phi(q): twelve entries per loop (origins; rotation matrices) and one per declared relation."""
    T = {0: ca.SX.eye(4)}
    at = {j: q[k] for k, j in enumerate(robot.moving)}
    for f in robot.frames:
        gamma, b, alpha, d, theta, r = (
            e.value(robot.constants) for e in (f.gamma, f.b, f.alpha, f.d, f.theta0, f.r0)
        )
        turn = theta + (at[f.j] if f.sigma == REVOLUTE else 0)
        slide = r + (at[f.j] if f.sigma == PRISMATIC else 0)
        T[f.j] = (
            T[f.ant]
            @ _about_z(gamma)
            @ _shift(0, 0, b)
            @ _about_x(alpha)
            @ _shift(d, 0, 0)
            @ _about_z(turn)
            @ _shift(0, 0, slide)
        )
    rows = [ca.vec((T[loop.cut] - T[loop.twin])[:3, :]) for loop in robot.loops]
    rows += [at[j] - _value(e, robot, at) for j, e in robot.constraints.items()]
    return ca.vertcat(*rows)


def _value(e: Expression, robot: Robot, at: dict[int, Any]) -> Any:
    symbols = {"pi": np.pi, **robot.constants, **{f"q{j}": x for j, x in at.items()}}
    return e.evaluate(
        symbols.__getitem__,
        lambda name, a: getattr(np, name)(float(a.value(robot.constants))),
        float,
    )


def _about_z(a: Any) -> Any:
    c, s = ca.cos(a), ca.sin(a)
    return ca.vertcat(
        ca.horzcat(c, -s, 0, 0),
        ca.horzcat(s, c, 0, 0),
        ca.horzcat(0, 0, 1, 0),
        ca.horzcat(0, 0, 0, 1),
    )


def _about_x(a: Any) -> Any:
    c, s = ca.cos(a), ca.sin(a)
    return ca.vertcat(
        ca.horzcat(1, 0, 0, 0),
        ca.horzcat(0, c, -s, 0),
        ca.horzcat(0, s, c, 0),
        ca.horzcat(0, 0, 0, 1),
    )


def _shift(x: Any, y: Any, z: Any) -> Any:
    return ca.vertcat(
        ca.horzcat(1, 0, 0, x),
        ca.horzcat(0, 1, 0, y),
        ca.horzcat(0, 0, 1, z),
        ca.horzcat(0, 0, 0, 1),
    )
