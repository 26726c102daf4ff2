"""Planar arm of two revolute joints in the vertical plane, written by hand from its Lagrangian, in
the form of an emitted module.

Gamma_2 = d/dt dL/dqd2 - dL/dq2 with L = 1/2 ZZ1R qd1^2 + 1/2 ZZ2 (qd1 + qd2)^2 + L qd1 (qd1 + qd2)
(MX2 C2 - MY2 S2) - g (MX1R S1 + MY1 C1 + MX2 S12 + MY2 C12),
ZZ1R = ZZ1 + L^2 M2, MX1R = MX1 + L M2.
"""

import numpy as np

NAME = "planar_2r_test"
SCHEMA = 1
JOINTS = (1, 2)
BASE_PARAMETERS = ("ZZ1R", "MX1R", "MY1", "FV1", "FS1", "ZZ2", "MX2", "MY2", "FV2", "FS2")
STANDARD_PARAMETERS = (
    "ZZ1",
    "MX1",
    "MY1",
    "M1",
    "FV1",
    "FS1",
    "ZZ2",
    "MX2",
    "MY2",
    "M2",
    "FV2",
    "FS2",
)
UNITS = {
    "ZZ1R": "kg*m**2",
    "MX1R": "kg*m",
    "MY1": "kg*m",
    "FV1": "N*m*s/rad",
    "FS1": "N*m",
    "ZZ2": "kg*m**2",
    "MX2": "kg*m",
    "MY2": "kg*m",
    "FV2": "N*m*s/rad",
    "FS2": "N*m",
}
FORMULAS = {"ZZ1R": "ZZ1 + L**2*M2", "MX1R": "MX1 + L*M2"}
STRUCTURE = np.array(
    [[1, 0], [1, 0], [1, 0], [1, 0], [1, 0], [1, 1], [1, 1], [1, 1], [0, 1], [0, 1]], dtype=bool
)
DRIVES = {"ratio": [[50.0, 0.0], [20.0, 40.0]], "offset": [0.0, 0.0], "torque_constant": 1.0}
LIMITS = {}
VALUES = {}
CONSTANTS = {"L": 0.5, "g": 9.81}
SOURCE_SHA256 = "0" * 64


def store(N):
    """Workspace of shape (b, n, N)."""
    return np.zeros((10, 2, N))


def regressor(q, qd, qdd, *, out=None, L=0.5, g=9.81):
    """D, shape (N, n, b)."""
    q, qd, qdd = (
        np.asarray(q, dtype=float),
        np.asarray(qd, dtype=float),
        np.asarray(qdd, dtype=float),
    )
    single = q.ndim == 1
    (q1, q2), (v1, v2), (a1, a2) = np.atleast_2d(q).T, np.atleast_2d(qd).T, np.atleast_2d(qdd).T
    C2, S2, C12, S12 = np.cos(q2), np.sin(q2), np.cos(q1 + q2), np.sin(q1 + q2)
    D = store(len(q1)) if out is None else out
    D[0, 0] = a1
    D[1, 0] = g * np.cos(q1)
    D[2, 0] = -g * np.sin(q1)
    D[3, 0] = v1
    D[4, 0] = np.sign(v1)
    D[5, 0] = a1 + a2
    D[5, 1] = a1 + a2
    D[6, 0] = L * (C2 * (2 * a1 + a2) - S2 * (2 * v1 * v2 + v2**2)) + g * C12
    D[6, 1] = L * (C2 * a1 + S2 * v1**2) + g * C12
    D[7, 0] = -L * (S2 * (2 * a1 + a2) + C2 * (2 * v1 * v2 + v2**2)) - g * S12
    D[7, 1] = L * (-S2 * a1 + C2 * v1**2) - g * S12
    D[8, 1] = v2
    D[9, 1] = np.sign(v2)
    view = D.transpose(2, 1, 0)
    return view[0] if single else view


def observation_matrix(q, qd, qdd, *, out=None, L=0.5, g=9.81):
    """W of eq. (6), shape (n*N, b), Fortran order, rows joint-major."""
    D = store(len(q)) if out is None else out
    regressor(q, qd, qdd, out=D, L=L, g=g)
    return D.reshape(10, -1).T


def inverse_dynamics(q, qd, qdd, X, *, L=0.5, g=9.81):
    """Gamma, shape (N, n)."""
    return regressor(q, qd, qdd, L=L, g=g) @ np.asarray(X)
