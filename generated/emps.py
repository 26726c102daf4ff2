"""EMPS, one prismatic axis: base parameters, regressor, dynamics.

GENERATED from emps.yaml, sha256 819142f28b57, by symgen 0.1.0. Do not edit; symgen generate emps

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha  d  theta   r
    1    0      1      0  0      0  q1
Gravity     acceleration (-g, 0, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd + FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY MZ first moments
Element     Ia      inertia: along q1
Element     FV      viscous: along q1
Element     FS      coulomb: along q1
Element     OFFSET  offset: along q1

Base parameters, 4 of 14; Gautier and Khalil (1990), exact over F_p
    M1R = M1 + Ia1
    as they are: FV1 FS1 OFFSET1
No effect: XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1

Cost per sample
    regressor         0 multiplications, 0 additions, 0 sin, 0 cos
    inverse_dynamics  3 multiplications, 3 additions, 0 sin, 0 cos
    inertia_matrix    0 multiplications, 0 additions, 0 sin, 0 cos
    bias              2 multiplications, 2 additions, 0 sin, 0 cos
    gravity           0 multiplications, 0 additions, 0 sin, 0 cos
    frame_poses       0 multiplications, 0 additions, 0 sin, 0 cos
"""

import numpy as np

SCHEMA = 1
NAME = 'emps'
SOURCE_SHA256 = '819142f28b57b4229603a127b0d6c9480c4d33b0409fb6506f5a20314e54f5c4'
JOINTS = (1,)
CONSTANTS = {'g': 9.81}
BASE_PARAMETERS = ('M1R', 'FV1', 'FS1', 'OFFSET1')
STANDARD_PARAMETERS = (
    'XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'ZZ1', 'MX1', 'MY1', 'MZ1', 'M1', 'Ia1', 'FV1', 'FS1', 'OFFSET1',
)
UNITS = {'M1R': 'kg', 'FV1': 'N*s/m', 'FS1': 'N', 'OFFSET1': 'N'}
FORMULAS = {'M1R': 'M1 + Ia1', 'FV1': 'FV1', 'FS1': 'FS1', 'OFFSET1': 'OFFSET1'}
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'ZZ1', 'MX1', 'MY1', 'MZ1')
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (  # [k, j]: whether base parameter k acts on joint j
    "x", "x", "x", "x",
)])
DRIVES = {  # qm = ratio (q - offset), tau = ratio' (torque_constant * u)
    'ratio': (
        (1.0,),
    ),
    'offset': (0.0,),
    'torque_constant': (35.15065188248547,),
}
LIMITS = {'tau': (351.5065188248547,)}
VALUES = {
    'XX1': 0.0, 'XY1': 0.0, 'XZ1': 0.0, 'YY1': 0.0, 'YZ1': 0.0, 'ZZ1': 0.0, 'MX1': 0.0, 'MY1': 0.0, 'MZ1': 0.0,
    'M1': 95.1089, 'Ia1': 0.0, 'FV1': 203.5034, 'FS1': 20.3935, 'OFFSET1': -3.1648,
}
LINKS = (1,)
ELEMENTS = {  # (kind, direction of motion, row G of s = G q as {j: G_j} or form q'Bq as {(i, j): B_ij}, i <= j)
    'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}), 'FS1': ('coulomb', 'both', {1: 1.0}),
    'OFFSET1': ('offset', 'both', {1: 1.0}),
}
_PATHS = {1: ((1, 1, ((0, 1.0),)),)}


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N):
    """Room for N samples, shape (4, 1, N): zeros and constants are written here, once. Reuse it: a fresh one costs page faults."""
    S = np.zeros((4, 1, N)).view(Store)
    S[3, 0] = 1.0
    S.ready = True
    return S


def _fill(block, result, states, *arguments):
    """Run `block` over 4096 samples at a time; states (N, ...) enter as contiguous rows (..., B), result ends in samples."""
    states = [np.atleast_2d(np.asarray(x, dtype=float)) for x in states]
    N = len(states[0])
    B = max(N, 1) if N <= 8192 else 4096
    for t in range(0, N, B):
        block(*(np.ascontiguousarray(x[t:t + B].T) for x in states), result[..., t:t + B], *arguments)
    return result


def _filled_store(q, qd, qdd, out, *constants):
    N = np.size(q) // 1
    if out is None:
        out = store(N)
    elif not (isinstance(out, Store) and out.ready and out.shape == (4, 1, N)):
        raise ValueError(f"out: expected store({N}) of shape {(4, 1, N)}, found {type(out).__name__} of shape {np.shape(out)}")
    return _fill(_regressor_block, out.view(np.ndarray), (q, qd, qdd), *constants)


def _by_sample(result, q):
    """Samples first; for a single state (n,) without them."""
    result = np.moveaxis(result, -1, 0)
    return result[0] if np.ndim(q) == 1 else result


def base_parameters(standard, *, g=9.81):
    """X, shape (4,), from the 14 standard parameters: a mapping by name, or a vector in the order of STANDARD_PARAMETERS."""
    if hasattr(standard, "keys"):
        standard = [standard[name] for name in STANDARD_PARAMETERS]
    (
        XX1, XY1, XZ1, YY1, YZ1, ZZ1, MX1, MY1, MZ1, M1, Ia1, FV1, FS1, OFFSET1
    ) = standard
    M1R = M1 + Ia1
    return np.array([
        M1R, FV1, FS1, OFFSET1,
    ])


def regressor(q, qd, qdd, *, out=None, g=9.81):
    """D of Gamma = D X, shape (N, 1, 4); q, qd, qdd of shape (N, 1) or (1,), rad or m and seconds.

    A view on one store of shape (4, 1, N). `out` is such a store, made by `store(N)` and reused: a fresh one costs page
    faults, up to several times the arithmetic for large N.
    """
    S = _filled_store(q, qd, qdd, out, g)
    D = S.transpose(2, 1, 0)
    return D[0] if np.ndim(q) == 1 else D


def observation_matrix(q, qd, qdd, *, out=None, g=9.81):
    """W of Y = W X + rho, shape (1*N, 4), Fortran order, rows joint-major: the same store, no copy."""
    return _filled_store(q, qd, qdd, out, g).reshape(4, -1).T


def inverse_dynamics(q, qd, qdd, X, *, g=9.81):
    """Joint torques Gamma, shape (N, 1), of base parameters X, shape (4,)."""
    GAM = np.empty((1, np.size(q) // 1))
    states = (q, qd, qdd)
    return _by_sample(_fill(_inverse_dynamics_block, GAM, states, X, g), q)


def inertia_matrix(q, X, *, g=9.81):
    """A(q), shape (N, 1, 1), actuators included."""
    A = np.empty((1, 1, np.size(q) // 1))
    states = (q,)
    return _by_sample(_fill(_inertia_matrix_block, A, states, X, g), q)


def bias(q, qd, X, *, g=9.81):
    """Gamma at qdd = 0, shape (N, 1): Coriolis, centrifugal, gravity, friction and offset."""
    GAM = np.empty((1, np.size(q) // 1))
    states = (q, qd)
    return _by_sample(_fill(_bias_block, GAM, states, X, g), q)


def gravity(q, X, *, g=9.81):
    """Gamma at rest without friction, shape (N, 1): gravity, offset and springs (a base parameter may mix them)."""
    GAM = np.empty((1, np.size(q) // 1))
    states = (q,)
    return _by_sample(_fill(_gravity_block, GAM, states, X, g), q)


def forward_dynamics(q, qd, tau, X, *, g=9.81):
    """qdd = A(q)**-1 (tau - bias), shape (N, 1)."""
    A, H = inertia_matrix(q, X, g=g), bias(q, qd, X, g=g)
    return np.linalg.solve(A, (np.asarray(tau, dtype=float) - H)[..., None])[..., 0]


def frame_poses(q, *, g=9.81):
    """Homogeneous transform of every frame j in frame 0, shape (N, 1, 4, 4), at index j - 1."""
    T = np.zeros((1, 4, 4, np.size(q) // 1))
    T[:, 3, 3] = 1.0
    states = (q,)
    return _by_sample(_fill(_frame_poses_block, T, states, g), q)


def jacobian(q, *, frame=1, g=9.81):
    """J, shape (N, 6, 1): velocity of the origin of `frame` (default: the last), then its angular velocity, in frame 0."""
    T = frame_poses(q, g=g).reshape(-1, 1, 4, 4)
    J = np.zeros((len(T), 6, 1))
    P = T[:, (1 if frame is None else frame) - 1, :3, 3]
    for j, sigma, rates in _PATHS[1 if frame is None else frame]:
        z = T[:, j - 1, :3, 2]
        v, w = (z, np.zeros_like(z)) if sigma else (np.cross(z, P - T[:, j - 1, :3, 3]), z)
        for k, rate in rates:
            J[:, :3, k] += rate * v
            J[:, 3:, k] += rate * w
    return J[0] if np.ndim(q) == 1 else J


def _regressor_block(q, qd, qdd, D, g):
    """Fill D, shape (4, 1, N): Gamma_j = sum_k D[k, j] X[k]. q, qd, qdd: (1, N)."""
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    # Joint 1
    D[0, 0] = QDP1          # DG1M1
    D[1, 0] = QP1           # DG1FV1
    D[2, 0] = np.sign(QP1)  # DG1FS1


def _inverse_dynamics_block(q, qd, qdd, GAM, X, g):
    """Fill GAM, shape (1, N). q, qd, qdd: (1, N)."""
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    M1R, FV1, FS1, OFFSET1 = X
    # Joint 1
    F31 = M1R*QDP1
    # Torques
    GAM[0] = OFFSET1 + F31 + FV1*QP1 + FS1*np.sign(QP1)


def _inertia_matrix_block(q, A, X, g):
    """Fill A, shape (1, 1, N): column i is Gamma for a unit acceleration of joint i from rest. q: (1, N)."""
    # Inputs
    M1R = X[0]
    # Inertia matrix
    A[0, 0] = M1R


def _bias_block(q, qd, GAM, X, g):
    """Fill GAM, shape (1, N), for qdd = 0. q, qd: (1, N)."""
    # Inputs
    QP1 = qd[0]
    FV1 = X[1]
    FS1 = X[2]
    OFFSET1 = X[3]
    # Torques
    GAM[0] = OFFSET1 + FV1*QP1 + FS1*np.sign(QP1)


def _gravity_block(q, GAM, X, g):
    """Fill GAM, shape (1, N), at rest. q: (1, N)."""
    # Inputs
    OFFSET1 = X[3]
    # Torques
    GAM[0] = OFFSET1


def _frame_poses_block(q, T, g):
    """Fill T, shape (1, 4, 4, N). q: (1, N)."""
    # Inputs
    q1 = q[0]
    # Poses
    T[0, 0, 0] = 1.0
    T[0, 0, 1] = 0.0
    T[0, 0, 2] = 0.0
    T[0, 1, 0] = 0.0
    T[0, 1, 1] = 1.0
    T[0, 1, 2] = 0.0
    T[0, 2, 0] = 0.0
    T[0, 2, 1] = 0.0
    T[0, 2, 2] = 1.0
    T[0, 0, 3] = 0.0
    T[0, 1, 3] = 0.0
    T[0, 2, 3] = q1
