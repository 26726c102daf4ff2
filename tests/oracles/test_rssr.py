"""A spatial RSSR loop, whose base columns are nearly dependent: torques by Lagrange's equations,
written here anew from the table, the energies of the links, and the twelve differences of the frames
at the cut.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

import symgen
from oracles.test_urdf_agrees import loaded
from symgen.certify.modules import certify

TEXT = """
symgen: 1
name: rssr
gravity: [0, 0, -g]
constants: {L0: 0.9, L1: 0.2, L2: 0.8, L3: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, mu: 1, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q4, r: 0}
  5: {ant: 4, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q5, r: 0}
  6: {ant: 0, sigma: 0, mu: 0, alpha: pi/2, d: L0, theta: q6, r: 0.1}
  7: {ant: 5, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q7, r: 0}
  8: {ant: 6, sigma: 2, mu: 0, alpha: 0.4, d: L3, theta: 0.2, r: 0.05}
loops:
  - {cut: 7, twin: 8, start: {q1: 0.5}}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
  OFFSET: {kind: offset, along: all}
"""
# ant, alpha, d, r, and theta of the fixed frame
TABLE = {
    1: (0, 0, 0, 0), 2: (1, 0, 0.2, 0), 3: (2, np.pi / 2, 0, 0), 4: (3, 0, 0.8, 0),
    5: (4, np.pi / 2, 0, 0), 6: (0, np.pi / 2, 0.9, 0.1), 7: (5, np.pi / 2, 0, 0), 8: (6, 0.4, 0.5, 0.05),
}  # fmt: skip
GRAVITY = ca.DM([0, 0, -9.81])
LINKS = range(1, 7)


def turn(axis: int, x):
    c, s = ca.cos(x), ca.sin(x)
    R = ca.SX.eye(3)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


class Lagrange:
    """Torque of the crank for 60 inertial parameters, shape (6, 10), and Ia FV FS OFFSET."""

    def __init__(self) -> None:
        q, qd, qdd = (ca.SX.sym(name, 7) for name in ("q", "qd", "qdd"))
        chi = ca.SX.sym("chi", 6, 10)
        A, P = {0: ca.SX.eye(3)}, {0: ca.SX.zeros(3)}
        for j, (ant, alpha, d, r) in TABLE.items():
            R = turn(0, alpha)
            A[j] = A[ant] @ R @ turn(2, q[j - 1] if j < 8 else 0.2)
            P[j] = P[ant] + A[ant] @ (ca.vertcat(d, 0, 0) + R @ ca.vertcat(0, 0, r))
        energy = 0
        for j in LINKS:
            xx, xy, xz, yy, yz, zz, mx, my, mz, M = ca.horzsplit(chi[j - 1, :])
            v = A[j].T @ ca.jtimes(P[j], q, qd)
            W = A[j].T @ ca.jtimes(A[j], q, qd)
            w = ca.vertcat(W[2, 1], W[0, 2], W[1, 0])
            J = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
            MS = ca.vertcat(mx, my, mz)
            kinetic = w.T @ J @ w / 2 + M * v.T @ v / 2 + MS.T @ ca.cross(v, w)
            energy += kinetic + GRAVITY.T @ (M * P[j] + A[j] @ MS)
        p = ca.gradient(energy, qd)
        tau = ca.jtimes(p, q, qd) + ca.jtimes(p, qd, qdd) - ca.gradient(energy, q)
        r = ca.vertcat(P[7] - P[8], ca.reshape(A[7] - A[8], 9, 1))
        J = ca.jacobian(r, q)
        self.tree = ca.Function("tau", [q, qd, qdd, chi], [tau])
        self.loop = ca.Function("r", [q, qd], [r, J, ca.jtimes(J @ qd, q, qd)])

    def state(self, q, qd1: float, qdd1: float):
        """q closed by Newton, qd, qdd and dq/dq1, at the crank's q1, its rate and acceleration."""
        q = np.array(q, dtype=float)
        for _ in range(50):
            r, J, _ = map(np.array, self.loop(q, 0 * q))
            q[1:] -= np.linalg.lstsq(J[:, 1:], r.ravel(), rcond=None)[0]
        assert np.abs(r).max() < 1e-13
        G = np.r_[1.0, -np.linalg.lstsq(J[:, 1:], J[:, 0], rcond=None)[0]]
        curved = np.array(self.loop(q, G * qd1)[2]).ravel()
        bend = np.r_[0.0, -np.linalg.lstsq(J[:, 1:], curved, rcond=None)[0]]
        return q, G * qd1, G * qdd1 + bend, G

    def torque(self, state, chi, own) -> float:
        q, qd, qdd, G = state
        tau = np.array(self.tree(q, qd, qdd, chi)).ravel()
        return float(G @ tau + own @ [qdd[0], qd[0], np.sign(qd[0]), 1.0])


def test_torques_of_an_rssr_loop():
    robot = symgen.parse_robot(TEXT.encode(), "rssr.yaml")
    module, oracle, rng = loaded(robot), Lagrange(), np.random.default_rng(5)
    q1 = np.array([0.3, 0.45, 0.5, 0.55, 0.7, 0.9])
    passive = module.passive_joints(q1[:, None])
    assert list(robot.passive) == [2, 3, 4, 5, 6, 7]
    qd, qdd = rng.standard_normal((2, len(q1)))
    states = [
        oracle.state(np.r_[a, b], c, d) for a, b, c, d in zip(q1, passive, qd, qdd, strict=True)
    ]
    for _ in range(5):
        chi, own = rng.standard_normal((6, 10)), rng.standard_normal(4)
        values = {
            f"{p}{j}": chi[j - 1, k]
            for j in LINKS
            for k, p in enumerate(["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"])
        }
        values |= dict(zip(("Ia1", "FV1", "FS1", "OFFSET1"), own, strict=True))
        theirs = np.array([oracle.torque(state, chi, own) for state in states])
        ours = module.inverse_dynamics(
            q1[:, None], qd[:, None], qdd[:, None], module.base_parameters(values)
        )
        assert np.abs(ours.ravel() - theirs).max() < 1e-11 * np.abs(theirs).max()


def test_the_certificate_says_what_it_cannot_verify():
    """The smallest of the 28 singular values is 1e-10 of the largest: the columns are verified, but
    double precision shows no gap below it.
    """
    robot = symgen.parse_robot(TEXT.encode(), "rssr.yaml")
    regrouping = symgen.regrouping(robot)
    certificate = certify(regrouping)
    assert len(regrouping) == 28 and len(robot.parameters) == 64
    (failure,) = certificate.failures
    assert "the rank of the base columns cannot be verified in double precision" in failure
    assert certificate.torque_error < 1e-11
