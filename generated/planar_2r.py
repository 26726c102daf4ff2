# Certificate by symgen 0.2.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
# with probability below 1e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
# inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian at random states,
# parameters and random constants agree with Lagrange's equations and products of frames to 1e-09;
# SCHEMA, NAME, SOURCE_SHA256, JOINTS, CONSTANTS, BASE_PARAMETERS, STANDARD_PARAMETERS, NO_EFFECT,
# FORMULAS, UNITS, STRUCTURE, ELEMENTS, LINKS, DRIVES, LIMITS, VALUES, HEADER, DEFAULTS with the
# robot file.
# sha256 of what follows: ced955a0437791cb23f2f3a00013bbebbbd478f161abee0d5f8d2e558757f073
"""Planar arm, 2 revolute joints, vertical plane: base parameters, regressor, dynamics.

GENERATED from planar_2r.yaml, sha256 42ca3cd332bb, by symgen 0.2.0.
Do not edit; symgen generate planar_2r

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha   d  theta  r
    1    0      0      0   0     q1  0
    2    1      0      0  D2     q2  0
Gravity     acceleration (0, -g, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Element     Ia      inertia: along q1, q2
Element     FV      viscous: along q1, q2
Element     FS      coulomb: along q1, q2
Element     OFFSET  offset: along q1, q2

Base parameters, 13 of 28; Gautier and Khalil (1990)
    exact over F_p
    FORMULAS says what they are made of; what it leaves out is as it is
    No effect: XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; a letter at the end is a
            part that several share, N16a of N16
    th   joint angle with its constant, rad
    C    cosine of a joint angle or of a sum of angles
    S    sine of a joint angle or of a sum of angles
    QP   joint velocity; with the name of an element, QPFSM6, the velocity that it acts along
    QDP  joint acceleration
    W    angular velocity of a link, in its frame
    WP   angular acceleration of a link, in its frame
    DV   products of angular velocity components W_k W_l
    VSP  acceleration of the origin of a frame minus gravity, in the antecedent's frame
    VP   the same, in the frame itself
    V    velocity of a frame's origin per unit rate of a joint, in that frame
    F    force that moves a link
    N    moment that moves a link, about the origin of its frame
    NE   moment transmitted to a link by its antecedent, about the origin of its frame
    FDI  the transmitted force, in the antecedent's frame
    JP   inertia tensor of a link with all that it carries, about the origin of its frame
    AS   the first moments MSP in the antecedent's frame
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque
    P    origin of a frame in frame 0

Cost per sample
    regressor          16 multiplications, 10 additions, 2 sin, 2 cos
    inverse_dynamics   28 multiplications, 22 additions, 2 sin, 2 cos
    inertia_matrix     4 multiplications, 4 additions, 1 sin, 1 cos
    bias               22 multiplications, 15 additions, 2 sin, 2 cos
    gravity            10 multiplications, 7 additions, 2 sin, 2 cos
    frame_poses        2 multiplications, 1 additions, 2 sin, 2 cos

Arguments   q, qd, qdd, tau of shape (N, 2), or (2,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (13,) in the order of BASE_PARAMETERS; constants of the robot by keyword
"""

import numpy as np

SCHEMA = 1
NAME = 'planar_2r'
SOURCE_SHA256 = '42ca3cd332bb23550600b8a94036134d00e0a3ee1e3b0d0625eed309c8742beb'
JOINTS = (1, 2)
CONSTANTS = {'D2': 0.5, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R MX1R MY1 FV1 FS1 OFFSET1 ZZ2 MX2 MY2 Ia2 FV2 FS2 OFFSET2
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2
""".split())
NO_EFFECT = tuple("""
XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2
""".split())
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + D2**2*M2',
    'MX1R': 'MX1 + D2*M2',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x.", "x.", "x.", "x.", "x.", "x.", "xx", "xx", "xx", ".x", ".x", ".x", ".x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (13, 2, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    zeros = np.zeros((13, 2, N)).view(Store)
    zeros[5, 0] = zeros[12, 1] = 1.0
    zeros.ready = True
    return zeros


def _states(*arrays):
    """The states as rows of samples, shape (N, 2) each; ValueError unless all have shape
    (N, 2), or all (2,).
    """
    states = [np.asarray(x, dtype=float) for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (2,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 2) each, or (2,) each")
    return tuple([x.reshape(-1, 2) for x in states])


def _parameters(X):
    """X as an array; ValueError unless it has a value for each base parameter."""
    X = np.asarray(X, dtype=float)
    if X.shape != (13,):
        raise ValueError(f"X of shape {X.shape}; expected (13,) in the order of BASE_PARAMETERS")
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


def elements(*, D2: float = 0.5, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(standard: np.ndarray, *, D2: float = 0.5, g: float = 9.81) -> np.ndarray:
    """X, shape (13,), from the 28 standard parameters: a mapping by name, or a vector in the
    order of STANDARD_PARAMETERS.
    """
    if hasattr(standard, "keys"):
        standard = [standard[name] for name in STANDARD_PARAMETERS]
    (
        _, _, _, _, _, ZZ1, MX1, MY1, _, _, Ia1, FV1, FS1, OFFSET1, _, _, _, _, _, ZZ2, MX2,
        MY2, _, M2, Ia2, FV2, FS2, OFFSET2
    ) = standard
    ZZ1R = ZZ1 + Ia1 + D2**2*M2
    MX1R = MX1 + D2*M2
    return np.array([
        ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2, MX2, MY2, Ia2, FV2, FS2, OFFSET2,
    ])


def regressor(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    D2: float = 0.5, g: float = 9.81
) -> np.ndarray:
    """D of Gamma = D X. Shape (N, 2, 13).

    A view on one store of shape (13, 2, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    filled = _filled_store(q, qd, qdd, out, D2, g).transpose(2, 1, 0)
    return filled[0] if np.ndim(q) == 1 else filled


def observation_matrix(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    D2: float = 0.5, g: float = 9.81
) -> np.ndarray:
    """W of Y = W X + rho, shape (2*N, 13), Fortran order, rows joint-major: the same
    store, no copy.
    """
    return _filled_store(q, qd, qdd, out, D2, g).reshape(13, -1).T


def _ready(out, N):
    """`out`, or a new store of N samples, as an array; ValueError unless `store(N)` made it."""
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (13, 2, N)):
        kind = f"{type(out).__name__} of shape {np.shape(out)}"
        raise ValueError(f"out: expected store({N}) of shape {(13, 2, N)}, found {kind}")
    return out.view(np.ndarray)


def _filled_store(q, qd, qdd, out, D2, g):
    """`out`, or a new store, filled."""
    states = _states(q, qd, qdd)
    result = _ready(out, len(states[0]))
    _fill(_regressor_block, result, states, D2, g)
    return result


def inverse_dynamics(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, X: np.ndarray, *, D2: float = 0.5,
    g: float = 9.81
) -> np.ndarray:
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 2).
    """
    X = _parameters(X)
    states = _states(q, qd, qdd)
    result = np.zeros((2, len(states[0])))
    _fill(_inverse_dynamics_block, result, states, X, D2, g)
    return _by_sample(result, q)


def inertia_matrix(q: np.ndarray, X: np.ndarray, *, D2: float = 0.5, g: float = 9.81) -> np.ndarray:
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 2, 2).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((2, 2, len(states[0])))
    _fill(_inertia_matrix_block, result, states, X, D2)
    return _by_sample(result, q)


def bias(
    q: np.ndarray, qd: np.ndarray, X: np.ndarray, *, D2: float = 0.5, g: float = 9.81
) -> np.ndarray:
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 2).
    """
    X = _parameters(X)
    states = _states(q, qd)
    result = np.zeros((2, len(states[0])))
    _fill(_bias_block, result, states, X, D2, g)
    return _by_sample(result, q)


def gravity(q: np.ndarray, X: np.ndarray, *, D2: float = 0.5, g: float = 9.81) -> np.ndarray:
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 2).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((2, len(states[0])))
    _fill(_gravity_block, result, states, X, g)
    return _by_sample(result, q)


def frame_poses(q: np.ndarray, *, D2: float = 0.5, g: float = 9.81) -> np.ndarray:
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 2, 4, 4).
    """
    states = _states(q)
    result = np.zeros((2, 4, 4, len(states[0])))
    result[0, 2, 2] = result[0, 3, 3] = result[1, 2, 2] = result[1, 3, 3] = 1.0
    _fill(_frame_poses_block, result, states, D2)
    return _by_sample(result, q)


def forward_dynamics(
    q: np.ndarray, qd: np.ndarray, tau: np.ndarray, X: np.ndarray, *, D2: float = 0.5,
    g: float = 9.81
) -> np.ndarray:
    """Qdd = A(q)**-1 (tau - bias). Shape (N, 2)."""
    _states(q, qd, tau)
    rest = np.asarray(tau, dtype=float) - bias(q, qd, X, D2=D2, g=g)
    inertia = inertia_matrix(q, X, D2=D2)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: np.ndarray, *, frame: int | None = None, D2: float = 0.5, g: float = 9.81
) -> np.ndarray:
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 2).
    """
    frame = 2 if frame is None else frame
    poses = frame_poses(q, D2=D2).reshape(-1, 2, 4, 4)
    result = _jacobian(_paths()[frame], poses, frame)
    return result[0] if np.ndim(q) == 1 else result


def _jacobian(path, T, frame):
    """Columns of the joints on `path`, shape (N, 6, 2), from the poses T of all frames."""
    J, P = np.zeros((len(T), 6, 2)), T[:, frame - 1, :3, 3]
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
        1: ((1, 0, ((0, 1.0),)),), 2: ((1, 0, ((0, 1.0),)), (2, 0, ((1, 1.0),)),),
    }


def _regressor_block(q, qd, qdd, D, D2, g):
    """Fill D, shape (13, 2, N), where it is not constant, from q (2, N); qd (2, N); qdd (2, N)."""
    # Inputs
    q1, q2 = q
    QP1, QP2 = qd
    QDP1, QDP2 = qdd
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    # Link 1
    DV331 = QP1**2
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    W32 = QP1 + QP2
    WP32 = QDP1 + QDP2
    DV332 = W32**2
    VSP12 = VP11 - D2*DV331
    VSP22 = VP21 + D2*QDP1
    VP12 = C2*VSP12 + S2*VSP22
    VP22 = C2*VSP22 - S2*VSP12
    # Joint axes Z and velocities V seen from link 2
    V121 = D2*S2
    V221 = D2*C2
    # Joint 1
    D[0, 0] = QDP1                            # DG1ZZ1
    D[1, 0] = VP21                            # DG1MX1
    D[2, 0] = -VP11                           # DG1MY1
    D[3, 0] = QP1                             # DG1FV1
    D[4, 0] = np.sign(QP1)                    # DG1FS1
    D[6, 0] = WP32                            # DG1ZZ2
    D[7, 0] = VP22 + WP32*V221 - DV332*V121   # DG1MX2
    D[8, 0] = -VP12 - WP32*V121 - DV332*V221  # DG1MY2
    # Joint 2
    D[6, 1] = WP32           # DG2ZZ2
    D[7, 1] = VP22           # DG2MX2
    D[8, 1] = -VP12          # DG2MY2
    D[9, 1] = QDP2           # DG2Ia2
    D[10, 1] = QP2           # DG2FV2
    D[11, 1] = np.sign(QP2)  # DG2FS2


def _inverse_dynamics_block(q, qd, qdd, GAM, X, D2, g):
    """Fill GAM, shape (2, N), where it is not constant, from q (2, N); qd (2, N); qdd (2, N)."""
    # Inputs
    q1, q2 = q
    QP1, QP2 = qd
    QDP1, QDP2 = qdd
    ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2, MX2, MY2, Ia2, FV2, FS2, OFFSET2 = X
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    # Link 1
    DV331 = QP1**2
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    W32 = QP1 + QP2
    WP32 = QDP1 + QDP2
    DV332 = W32**2
    VSP12 = VP11 - D2*DV331
    VSP22 = VP21 + D2*QDP1
    VP12 = C2*VSP12 + S2*VSP22
    VP22 = C2*VSP22 - S2*VSP12
    # Joint 2
    F12 = -MX2*DV332 - MY2*WP32
    F22 = MX2*WP32 - MY2*DV332
    N32 = ZZ2*WP32 + MX2*VP22 - MY2*VP12
    FDI22 = S2*F12 + C2*F22
    # Joint 1
    N31 = ZZ1R*QDP1 + MX1R*VP21 - MY1*VP11
    NE31 = N32 + D2*FDI22 + N31
    # Torques
    GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*np.sign(QP1)
    GAM[1] = OFFSET2 + N32 + Ia2*QDP2 + FV2*QP2 + FS2*np.sign(QP2)


def _inertia_matrix_block(q, A, X, D2):
    """Fill A, shape (2, 2, N), where it is not constant, from q (2, N)."""
    # Inputs
    q2 = q[1]
    ZZ1R = X[0]
    ZZ2 = X[6]
    MX2 = X[7]
    MY2 = X[8]
    Ia2 = X[9]
    # Trigonometry
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    # Composite link 2
    AS12 = MX2*C2 - MY2*S2
    D2AS12 = D2*AS12
    JP331 = ZZ1R + ZZ2 + 2*D2AS12
    # Unit acceleration of joint 2
    NE312 = ZZ2 + D2AS12
    # Inertia matrix
    A[0, 0] = JP331
    A[0, 1] = A[1, 0] = NE312
    A[1, 1] = ZZ2 + Ia2


def _bias_block(q, qd, GAM, X, D2, g):
    """Fill GAM, shape (2, N), where it is not constant, from q (2, N); qd (2, N)."""
    # Inputs
    q1, q2 = q
    QP1, QP2 = qd
    MX1R = X[1]
    MY1 = X[2]
    FV1 = X[3]
    FS1 = X[4]
    OFFSET1 = X[5]
    MX2 = X[7]
    MY2 = X[8]
    FV2 = X[10]
    FS2 = X[11]
    OFFSET2 = X[12]
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    # Link 1
    DV331 = QP1**2
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    W32 = QP1 + QP2
    DV332 = W32**2
    VSP12 = VP11 - D2*DV331
    VP12 = C2*VSP12 + S2*VP21
    VP22 = C2*VP21 - S2*VSP12
    # Joint 2
    F12 = -MX2*DV332
    F22 = -MY2*DV332
    N32 = MX2*VP22 - MY2*VP12
    FDI22 = S2*F12 + C2*F22
    # Joint 1
    N31 = MX1R*VP21 - MY1*VP11
    NE31 = N32 + D2*FDI22 + N31
    # Torques
    GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*np.sign(QP1)
    GAM[1] = OFFSET2 + N32 + FV2*QP2 + FS2*np.sign(QP2)


def _gravity_block(q, GAM, X, g):
    """Fill GAM, shape (2, N), where it is not constant, from q (2, N)."""
    # Inputs
    q1, q2 = q
    MX1R = X[1]
    MY1 = X[2]
    OFFSET1 = X[5]
    MX2 = X[7]
    MY2 = X[8]
    OFFSET2 = X[12]
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    # Link 1
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    VP12 = C2*VP11 + S2*VP21
    VP22 = C2*VP21 - S2*VP11
    # Joint 2
    N32 = MX2*VP22 - MY2*VP12
    # Joint 1
    N31 = MX1R*VP21 - MY1*VP11
    NE31 = N32 + N31
    # Torques
    GAM[0] = OFFSET1 + NE31
    GAM[1] = OFFSET2 + N32


def _frame_poses_block(q, T, D2):
    """Fill T, shape (2, 4, 4, N), where it is not constant, from q (2, N)."""
    # Inputs
    q1, q2 = q
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    th12 = q1 + q2
    C12 = np.cos(th12)
    S12 = np.sin(th12)
    # Frame 2
    P12 = D2*C1
    P22 = D2*S1
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[1, 0, 0] = C12
    T[1, 0, 1] = -S12
    T[1, 0, 3] = P12
    T[1, 1, 0] = S12
    T[1, 1, 1] = C12
    T[1, 1, 3] = P22


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2)
DRIVES = None
LIMITS = {
    'q': ((-3.141592653589793, 3.141592653589793), (-3.141592653589793, 3.141592653589793)),
    'qd': (3.0, 5.0),
    'qdd': (20.0, 40.0),
    'tau': (40.0, 15.0),
}
VALUES = {
    'XX1': 0.0012, 'XY1': 0.0, 'XZ1': 0.0, 'YY1': 0.1673, 'YZ1': 0.0, 'ZZ1': 0.1673, 'MX1': 0.5,
    'MY1': 0.0, 'MZ1': 0.0, 'M1': 2.0, 'Ia1': 0.05, 'FV1': 0.5, 'FS1': 0.8, 'OFFSET1': 0.1,
    'XX2': 0.0012, 'XY2': 0.0, 'XZ2': 0.0, 'YY2': 0.1673, 'YZ2': 0.0, 'ZZ2': 0.1673, 'MX2': 0.5,
    'MY2': 0.0, 'MZ2': 0.0, 'M2': 2.0, 'Ia2': 0.02, 'FV2': 0.3, 'FS2': 0.4, 'OFFSET2': -0.05,
}
