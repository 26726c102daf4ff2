# Certificate by symgen 0.2.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
# with probability below 1e-16; base_parameters, regressor, observation_matrix, inverse_dynamics,
# inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian at random states,
# parameters and random constants agree with Lagrange's equations and products of frames to 1e-09;
# SCHEMA, NAME, SOURCE_SHA256, JOINTS, CONSTANTS, BASE_PARAMETERS, STANDARD_PARAMETERS, NO_EFFECT,
# FORMULAS, UNITS, STRUCTURE, ELEMENTS, LINKS, DRIVES, LIMITS, VALUES, HEADER, DEFAULTS with the
# robot file.
# sha256 of what follows: 09c54d3b74154f4c41eb5fa6b26785f7c0ad42532f14a370a080f7429c6d6d29
"""EMPS, one prismatic axis, asymmetric friction: base parameters, regressor, dynamics.

GENERATED from emps_asymmetric.yaml, sha256 bca2b7106ba8, by symgen 0.2.0.
Do not edit; symgen generate emps_asymmetric

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha  d  theta   r
    1    0      1      0  0      0  q1
Gravity     acceleration (-g, 0, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Element     Ia      inertia: along q1
Element     FVP     viscous, positive motion only: along q1
Element     FSP     coulomb, positive motion only: along q1
Element     FVN     viscous, negative motion only: along q1
Element     FSN     coulomb, negative motion only: along q1

Base parameters, 5 of 15; Gautier and Khalil (1990)
    exact over F_p
    FORMULAS says what they are made of; what it leaves out is as it is
    No effect: XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; a letter at the end is a
            part that several share, N16a of N16
    QP   joint velocity; with the name of an element, QPFSM6, the velocity that it acts along
    QDP  joint acceleration
    F    force that moves a link
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque

Cost per sample
    regressor          0 multiplications, 0 additions, 0 sin, 0 cos
    inverse_dynamics   5 multiplications, 4 additions, 0 sin, 0 cos
    inertia_matrix     0 multiplications, 0 additions, 0 sin, 0 cos
    bias               4 multiplications, 3 additions, 0 sin, 0 cos
    gravity            0 multiplications, 0 additions, 0 sin, 0 cos
    frame_poses        0 multiplications, 0 additions, 0 sin, 0 cos

Arguments   q, qd, qdd, tau of shape (N, 1), or (1,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (5,) in the order of BASE_PARAMETERS; constants of the robot by keyword
"""

import numpy as np

SCHEMA = 1
NAME = 'emps_asymmetric'
SOURCE_SHA256 = 'bca2b7106ba82dc4dfc0002d7ea03c19990490c139ab2b9eb78f8c7cf5a50970'
JOINTS = (1,)
CONSTANTS = {'g': 9.81}
BASE_PARAMETERS = ('M1R', 'FVP1', 'FSP1', 'FVN1', 'FSN1')
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FVP1 FSP1 FVN1 FSN1
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'ZZ1', 'MX1', 'MY1', 'MZ1')
FORMULAS = {
    'M1R': 'M1 + Ia1',
}
UNITS = dict(zip(BASE_PARAMETERS, ('kg', 'N*s/m', 'N', 'N*s/m', 'N')))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x", "x", "x", "x", "x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (5, 1, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    zeros = np.zeros((5, 1, N)).view(Store)
    zeros.ready = True
    return zeros


def _states(*arrays):
    """The states as rows of samples, shape (N, 1) each; ValueError unless all have shape
    (N, 1), or all (1,).
    """
    states = [np.asarray(x, dtype=float) for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (1,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 1) each, or (1,) each")
    return tuple([x.reshape(-1, 1) for x in states])


def _parameters(X):
    """X as an array; ValueError unless it has a value for each base parameter."""
    X = np.asarray(X, dtype=float)
    if X.shape != (5,):
        raise ValueError(f"X of shape {X.shape}; expected (5,) in the order of BASE_PARAMETERS")
    return X


def _fill(block, result, states, *arguments):
    """Run `block` over 4096 samples at a time; states (N, ...) enter as contiguous rows
    (..., B), result ends in samples.
    """
    N = result.shape[-1]
    B = max(N, 1) if N <= 8192 else 4096
    for t in range(0, N, B):
        rows = [np.ascontiguousarray(x[t:t + B].T) for x in states]
        block(*rows, result[..., t:t + B], *arguments)


def _by_sample(result, q):
    """Samples first; for a single state (n,) without them."""
    result = np.moveaxis(result, -1, 0)
    return result[0] if np.ndim(q) == 1 else result


def elements(*, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FVP1': ('viscous', 'positive', {1: 1.0}),
        'FSP1': ('coulomb', 'positive', {1: 1.0}), 'FVN1': ('viscous', 'negative', {1: 1.0}),
        'FSN1': ('coulomb', 'negative', {1: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(standard: np.ndarray, *, g: float = 9.81) -> np.ndarray:
    """X, shape (5,), from the 15 standard parameters: a mapping by name, or a vector in the
    order of STANDARD_PARAMETERS.
    """
    if hasattr(standard, "keys"):
        standard = [standard[name] for name in STANDARD_PARAMETERS]
    _, _, _, _, _, _, _, _, _, M1, Ia1, FVP1, FSP1, FVN1, FSN1 = standard
    M1R = M1 + Ia1
    return np.array([
        M1R, FVP1, FSP1, FVN1, FSN1,
    ])


def regressor(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    g: float = 9.81
) -> np.ndarray:
    """D of Gamma = D X. Shape (N, 1, 5).

    A view on one store of shape (5, 1, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    filled = _filled_store(q, qd, qdd, out).transpose(2, 1, 0)
    return filled[0] if np.ndim(q) == 1 else filled


def observation_matrix(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    g: float = 9.81
) -> np.ndarray:
    """W of Y = W X + rho, shape (1*N, 5), Fortran order, rows joint-major: the same
    store, no copy.
    """
    return _filled_store(q, qd, qdd, out).reshape(5, -1).T


def _ready(out, N):
    """`out`, or a new store of N samples, as an array; ValueError unless `store(N)` made it."""
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (5, 1, N)):
        kind = f"{type(out).__name__} of shape {np.shape(out)}"
        raise ValueError(f"out: expected store({N}) of shape {(5, 1, N)}, found {kind}")
    return out.view(np.ndarray)


def _filled_store(q, qd, qdd, out):
    """`out`, or a new store, filled."""
    states = _states(q, qd, qdd)
    result = _ready(out, len(states[0]))
    _fill(_regressor_block, result, (states[1], states[2]))
    return result


def inverse_dynamics(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, X: np.ndarray, *, g: float = 9.81
) -> np.ndarray:
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 1).
    """
    X = _parameters(X)
    states = _states(q, qd, qdd)
    result = np.zeros((1, len(states[0])))
    _fill(_inverse_dynamics_block, result, (states[1], states[2]), X)
    return _by_sample(result, q)


def inertia_matrix(q: np.ndarray, X: np.ndarray, *, g: float = 9.81) -> np.ndarray:
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 1, 1).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((1, 1, len(states[0])))
    _fill(_inertia_matrix_block, result, (), X)
    return _by_sample(result, q)


def bias(q: np.ndarray, qd: np.ndarray, X: np.ndarray, *, g: float = 9.81) -> np.ndarray:
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 1).
    """
    X = _parameters(X)
    states = _states(q, qd)
    result = np.zeros((1, len(states[0])))
    _fill(_bias_block, result, (states[1],), X)
    return _by_sample(result, q)


def gravity(q: np.ndarray, X: np.ndarray, *, g: float = 9.81) -> np.ndarray:
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 1).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((1, len(states[0])))
    return _by_sample(result, q)


def frame_poses(q: np.ndarray, *, g: float = 9.81) -> np.ndarray:
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 1, 4, 4).
    """
    states = _states(q)
    result = np.zeros((1, 4, 4, len(states[0])))
    result[0, 0, 0] = result[0, 1, 1] = result[0, 2, 2] = result[0, 3, 3] = 1.0
    _fill(_frame_poses_block, result, states)
    return _by_sample(result, q)


def forward_dynamics(
    q: np.ndarray, qd: np.ndarray, tau: np.ndarray, X: np.ndarray, *, g: float = 9.81
) -> np.ndarray:
    """Qdd = A(q)**-1 (tau - bias). Shape (N, 1)."""
    _states(q, qd, tau)
    rest = np.asarray(tau, dtype=float) - bias(q, qd, X)
    inertia = inertia_matrix(q, X)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(q: np.ndarray, *, frame: int | None = None, g: float = 9.81) -> np.ndarray:
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 1).
    """
    frame = 1 if frame is None else frame
    poses = frame_poses(q).reshape(-1, 1, 4, 4)
    result = _jacobian(_paths()[frame], poses, frame)
    return result[0] if np.ndim(q) == 1 else result


def _jacobian(path, T, frame):
    """Columns of the joints on `path`, shape (N, 6, 1), from the poses T of all frames."""
    J, P = np.zeros((len(T), 6, 1)), T[:, frame - 1, :3, 3]
    for j, sigma, rates in path:
        z = T[:, j - 1, :3, 2]
        v, w = (z, np.zeros_like(z)) if sigma else (np.cross(z, P - T[:, j - 1, :3, 3]), z)
        for k, rate in rates:
            J[:, :3, k] += rate * v
            J[:, 3:, k] += rate * w
    return J


def _paths():
    """{frame: ((joint, sigma, ((column, rate), ...)), ...)}: the moving joints below each frame and
    how the joints in the columns move them.
    """
    return {
        1: ((1, 1, ((0, 1.0),)),),
    }


def _regressor_block(qd, qdd, D):
    """Fill D, shape (5, 1, N), where it is not constant, from qd (1, N); qdd (1, N)."""
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    # Friction, actuators
    DG1FSP1a = np.sign(QP1)
    # Joint 1
    D[0, 0] = QDP1                       # DG1M1
    D[1, 0] = np.maximum(QP1, 0.0)       # DG1FVP1
    D[2, 0] = np.maximum(DG1FSP1a, 0.0)  # DG1FSP1
    D[3, 0] = np.minimum(QP1, 0.0)       # DG1FVN1
    D[4, 0] = np.minimum(DG1FSP1a, 0.0)  # DG1FSN1


def _inverse_dynamics_block(qd, qdd, GAM, X):
    """Fill GAM, shape (1, N), where it is not constant, from qd (1, N); qdd (1, N)."""
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    M1R, FVP1, FSP1, FVN1, FSN1 = X
    # Joint 1
    F31 = M1R*QDP1
    # Friction, actuators
    GAM1a = np.sign(QP1)
    # Torques
    GAM[0] = (F31 + FVP1*np.maximum(QP1, 0.0) + FSP1*np.maximum(GAM1a, 0.0) - FVN1*(-np.minimum(QP1,
        0.0)) - FSN1*(-np.minimum(GAM1a, 0.0)))


def _inertia_matrix_block(A, X):
    """Fill A, shape (1, 1, N), where it is not constant."""
    # Inputs
    M1R = X[0]
    # Inertia matrix
    A[0, 0] = M1R


def _bias_block(qd, GAM, X):
    """Fill GAM, shape (1, N), where it is not constant, from qd (1, N)."""
    # Inputs
    QP1 = qd[0]
    FVP1, FSP1, FVN1, FSN1 = X[1:]
    # Friction, actuators
    GAM1a = np.sign(QP1)
    # Torques
    GAM[0] = (FVP1*np.maximum(QP1, 0.0) + FSP1*np.maximum(GAM1a, 0.0) - FVN1*(-np.minimum(QP1, 0.0))
        - FSN1*(-np.minimum(GAM1a, 0.0)))


def _frame_poses_block(q, T):
    """Fill T, shape (1, 4, 4, N), where it is not constant, from q (1, N)."""
    # Inputs
    q1 = q[0]
    # Poses
    T[0, 2, 3] = q1


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1,)
DRIVES = {  # qm = ratio (q - offset), tau = ratio' (torque_constant * u)
    'ratio': (
        (1.0,),
    ),
    'offset': (0.0,),
    'torque_constant': (35.15065188248547,),
}
LIMITS = {'tau': (351.5065188248547,)}
VALUES = {
    'XX1': 0.0, 'XY1': 0.0, 'XZ1': 0.0, 'YY1': 0.0, 'YZ1': 0.0, 'ZZ1': 0.0, 'MX1': 0.0,
    'MY1': 0.0, 'MZ1': 0.0, 'M1': 95.154, 'Ia1': 0.0, 'FVP1': 166.7061, 'FSP1': 20.144,
    'FVN1': 240.4236, 'FSN1': 20.6277,
}
