# Certificate by symgen 0.2.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
# with probability below 4e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
# inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian at random states,
# parameters and random constants agree with Lagrange's equations and products of frames to 1e-09;
# SCHEMA, NAME, SOURCE_SHA256, JOINTS, CONSTANTS, BASE_PARAMETERS, STANDARD_PARAMETERS, NO_EFFECT,
# FORMULAS, UNITS, STRUCTURE, ELEMENTS, LINKS, DRIVES, LIMITS, VALUES, HEADER, DEFAULTS with the
# robot file.
# sha256 of what follows: 4e26155916f5a0b357794f24a0348ea8e0a3442ae6bc180753b9e5e0b65d43b8
"""SCARA with joints RRRP: base parameters, regressor, dynamics.

GENERATED from scara.yaml, sha256 de085ba960d7, by symgen 0.2.0.
Do not edit; symgen generate scara

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha   d  theta   r
    1    0      0      0   0     q1   0
    2    1      0      0  D2     q2   0
    3    2      0      0  D3     q3   0
    4    3      1      0   0      0  q4
Gravity     acceleration (0, 0, -g) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Element     Ia      inertia: along q1, q2, q3, q4
Element     FV      viscous: along q1, q2, q3, q4
Element     FS      coulomb: along q1, q2, q3, q4
Element     OFFSET  offset: along q1, q2, q3, q4

Base parameters, 22 of 56; Gautier and Khalil (1990)
    exact over F_p
    FORMULAS says what they are made of; what it leaves out is as it is
    No effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2 XX3 XY3 XZ3 YY3 YZ3 MZ3
        XX4 XY4 XZ4 YY4 YZ4 MZ4

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
    VS   the same, in the antecedent's frame
    F    force that moves a link
    N    moment that moves a link, about the origin of its frame
    E    force transmitted to a link by its antecedent, in its frame
    NE   moment transmitted to a link by its antecedent, about the origin of its frame
    FDI  the transmitted force, in the antecedent's frame
    JP   inertia tensor of a link with all that it carries, about the origin of its frame
    MSP  first moments of a link with all that it carries, in its frame
    AS   the first moments MSP in the antecedent's frame
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque
    P    origin of a frame in frame 0

Cost per sample
    regressor          39 multiplications, 28 additions, 2 sin, 2 cos
    inverse_dynamics   51 multiplications, 44 additions, 2 sin, 2 cos
    inertia_matrix     13 multiplications, 18 additions, 2 sin, 2 cos
    bias               37 multiplications, 29 additions, 2 sin, 2 cos
    gravity            0 multiplications, 0 additions, 0 sin, 0 cos
    frame_poses        4 multiplications, 4 additions, 3 sin, 3 cos

Arguments   q, qd, qdd, tau of shape (N, 4), or (4,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (22,) in the order of BASE_PARAMETERS; constants of the robot by keyword
"""

import numpy as np

SCHEMA = 1
NAME = 'scara'
SOURCE_SHA256 = 'de085ba960d792c532df597174021ff49a1ac3e6792828ed279c37ecd08941b0'
JOINTS = (1, 2, 3, 4)
CONSTANTS = {'D2': 0.425, 'D3': 0.375, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R FV1 FS1 OFFSET1 ZZ2R MX2R MY2 Ia2 FV2 FS2 OFFSET2 ZZ3R MX3R MY3R Ia3 FV3 FS3 OFFSET3 M4R FV4
FS4 OFFSET4R
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 Ia3 FV3 FS3 OFFSET3 XX4 XY4 XZ4 YY4 YZ4
ZZ4 MX4 MY4 MZ4 M4 Ia4 FV4 FS4 OFFSET4
""".split())
NO_EFFECT = tuple("""
XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2 XX3 XY3 XZ3 YY3 YZ3 MZ3 XX4 XY4 XZ4 YY4
YZ4 MZ4
""".split())
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + D2**2*(M2 + M3 - Ia4)',
    'ZZ2R': 'ZZ2 + D3**2*(M3 - Ia4)',
    'MX2R': 'MX2 + D3*(M3 - Ia4)',
    'ZZ3R': 'ZZ3 + ZZ4',
    'MX3R': 'MX3 + MX4',
    'MY3R': 'MY3 + MY4',
    'M4R': 'M4 + Ia4',
    'OFFSET4R': 'OFFSET4 - g*Ia4',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m kg*m kg*m**2
N*m*s/rad N*m N*m kg N*s/m N N
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x...", "x...", "x...", "x...", "xx..", "xx..", "xx..", ".x..", ".x..", ".x..", ".x..", "xxx.",
    "xxx.", "xxx.", "..x.", "..x.", "..x.", "..x.", "xx.x", "...x", "...x", "...x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (22, 4, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    zeros = np.zeros((22, 4, N)).view(Store)
    zeros[3, 0] = zeros[10, 1] = zeros[17, 2] = zeros[21, 3] = 1.0
    zeros.ready = True
    return zeros


def _states(*arrays):
    """The states as rows of samples, shape (N, 4) each; ValueError unless all have shape
    (N, 4), or all (4,).
    """
    states = [np.asarray(x, dtype=float) for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (4,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 4) each, or (4,) each")
    return tuple([x.reshape(-1, 4) for x in states])


def _parameters(X):
    """X as an array; ValueError unless it has a value for each base parameter."""
    X = np.asarray(X, dtype=float)
    if X.shape != (22,):
        raise ValueError(f"X of shape {X.shape}; expected (22,) in the order of BASE_PARAMETERS")
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


def elements(*, D2: float = 0.425, D3: float = 0.375, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
        'Ia3': ('inertia', 'both', {3: 1.0}), 'FV3': ('viscous', 'both', {3: 1.0}),
        'FS3': ('coulomb', 'both', {3: 1.0}), 'OFFSET3': ('offset', 'both', {3: 1.0}),
        'Ia4': ('inertia', 'both', {4: 1.0}), 'FV4': ('viscous', 'both', {4: 1.0}),
        'FS4': ('coulomb', 'both', {4: 1.0}), 'OFFSET4': ('offset', 'both', {4: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(
    standard: np.ndarray, *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """X, shape (22,), from the 56 standard parameters: a mapping by name, or a vector in the
    order of STANDARD_PARAMETERS.
    """
    if hasattr(standard, "keys"):
        standard = [standard[name] for name in STANDARD_PARAMETERS]
    (
        _, _, _, _, _, ZZ1, _, _, _, _, Ia1, FV1, FS1, OFFSET1, _, _, _, _, _, ZZ2, MX2, MY2, _,
        M2, Ia2, FV2, FS2, OFFSET2, _, _, _, _, _, ZZ3, MX3, MY3, _, M3, Ia3, FV3, FS3, OFFSET3,
        _, _, _, _, _, ZZ4, MX4, MY4, _, M4, Ia4, FV4, FS4, OFFSET4
    ) = standard
    ZZ1R = ZZ1 + Ia1 + D2**2*(M2 + M3 - Ia4)
    ZZ2R = ZZ2 + D3**2*(M3 - Ia4)
    MX2R = MX2 + D3*(M3 - Ia4)
    ZZ3R = ZZ3 + ZZ4
    MX3R = MX3 + MX4
    MY3R = MY3 + MY4
    M4R = M4 + Ia4
    OFFSET4R = OFFSET4 - g*Ia4
    return np.array([
        ZZ1R, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, Ia2, FV2, FS2, OFFSET2, ZZ3R, MX3R, MY3R, Ia3,
        FV3, FS3, OFFSET3, M4R, FV4, FS4, OFFSET4R,
    ])


def regressor(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """D of Gamma = D X. Shape (N, 4, 22).

    A view on one store of shape (22, 4, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    filled = _filled_store(q, qd, qdd, out, D2, D3, g).transpose(2, 1, 0)
    return filled[0] if np.ndim(q) == 1 else filled


def observation_matrix(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, *, out: Store | None = None,
    D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """W of Y = W X + rho, shape (4*N, 22), Fortran order, rows joint-major: the same
    store, no copy.
    """
    return _filled_store(q, qd, qdd, out, D2, D3, g).reshape(22, -1).T


def _ready(out, N):
    """`out`, or a new store of N samples, as an array; ValueError unless `store(N)` made it."""
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (22, 4, N)):
        kind = f"{type(out).__name__} of shape {np.shape(out)}"
        raise ValueError(f"out: expected store({N}) of shape {(22, 4, N)}, found {kind}")
    return out.view(np.ndarray)


def _filled_store(q, qd, qdd, out, D2, D3, g):
    """`out`, or a new store, filled."""
    states = _states(q, qd, qdd)
    result = _ready(out, len(states[0]))
    _fill(_regressor_block, result, states, D2, D3, g)
    return result


def inverse_dynamics(
    q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, X: np.ndarray, *, D2: float = 0.425,
    D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 4).
    """
    X = _parameters(X)
    states = _states(q, qd, qdd)
    result = np.zeros((4, len(states[0])))
    _fill(_inverse_dynamics_block, result, states, X, D2, D3, g)
    return _by_sample(result, q)


def inertia_matrix(
    q: np.ndarray, X: np.ndarray, *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 4, 4).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((4, 4, len(states[0])))
    _fill(_inertia_matrix_block, result, states, X, D2, D3)
    return _by_sample(result, q)


def bias(
    q: np.ndarray, qd: np.ndarray, X: np.ndarray, *, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> np.ndarray:
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 4).
    """
    X = _parameters(X)
    states = _states(q, qd)
    result = np.zeros((4, len(states[0])))
    _fill(_bias_block, result, states, X, D2, D3, g)
    return _by_sample(result, q)


def gravity(
    q: np.ndarray, X: np.ndarray, *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 4).
    """
    X = _parameters(X)
    states = _states(q)
    result = np.zeros((4, len(states[0])))
    _fill(_gravity_block, result, (), X, g)
    return _by_sample(result, q)


def frame_poses(
    q: np.ndarray, *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 4, 4, 4).
    """
    states = _states(q)
    result = np.zeros((4, 4, 4, len(states[0])))
    result[0, 2, 2] = result[0, 3, 3] = result[1, 2, 2] = result[1, 3, 3] = result[2, 2, 2] = 1.0
    result[2, 3, 3] = result[3, 2, 2] = result[3, 3, 3] = 1.0
    _fill(_frame_poses_block, result, states, D2, D3)
    return _by_sample(result, q)


def forward_dynamics(
    q: np.ndarray, qd: np.ndarray, tau: np.ndarray, X: np.ndarray, *, D2: float = 0.425,
    D3: float = 0.375, g: float = 9.81
) -> np.ndarray:
    """Qdd = A(q)**-1 (tau - bias). Shape (N, 4)."""
    _states(q, qd, tau)
    rest = np.asarray(tau, dtype=float) - bias(q, qd, X, D2=D2, D3=D3, g=g)
    inertia = inertia_matrix(q, X, D2=D2, D3=D3)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: np.ndarray, *, frame: int | None = None, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> np.ndarray:
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 4).
    """
    frame = 4 if frame is None else frame
    poses = frame_poses(q, D2=D2, D3=D3).reshape(-1, 4, 4, 4)
    result = _jacobian(_paths()[frame], poses, frame)
    return result[0] if np.ndim(q) == 1 else result


def _jacobian(path, T, frame):
    """Columns of the joints on `path`, shape (N, 6, 4), from the poses T of all frames."""
    J, P = np.zeros((len(T), 6, 4)), T[:, frame - 1, :3, 3]
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
        3: ((1, 0, ((0, 1.0),)), (2, 0, ((1, 1.0),)), (3, 0, ((2, 1.0),)),),
        4: ((1, 0, ((0, 1.0),)), (2, 0, ((1, 1.0),)), (3, 0, ((2, 1.0),)), (4, 1, ((3, 1.0),)),),
    }


def _regressor_block(q, qd, qdd, D, D2, D3, g):
    """Fill D, shape (22, 4, N), where it is not constant, from q (4, N); qd (4, N); qdd (4, N)."""
    # Inputs
    q2, q3 = q[1:3]
    QP1, QP2, QP3, QP4 = qd
    QDP1, QDP2, QDP3, QDP4 = qdd
    # Trigonometry
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    C3 = np.cos(q3)
    S3 = np.sin(q3)
    # Link 1
    DV331 = QP1**2
    # Link 2
    W32 = QP1 + QP2
    WP32 = QDP1 + QDP2
    DV332 = W32**2
    VSP12 = -D2*DV331
    VSP22 = D2*QDP1
    VP12 = C2*VSP12 + S2*VSP22
    VP22 = C2*VSP22 - S2*VSP12
    # Link 3
    W33 = QP3 + W32
    WP33 = QDP3 + WP32
    DV333 = W33**2
    VSP13 = VP12 - D3*DV332
    VSP23 = VP22 + D3*WP32
    VP13 = C3*VSP13 + S3*VSP23
    VP23 = C3*VSP23 - S3*VSP13
    # Link 4
    VP34 = QDP4 + g
    # Joint axes Z and velocities V seen from link 2
    V121 = D2*S2
    V221 = D2*C2
    # Joint axes Z and velocities V seen from link 3
    VS231 = D3 + V221
    V131 = C3*V121 + S3*VS231
    V231 = C3*VS231 - S3*V121
    V132 = D3*S3
    V232 = D3*C3
    # Joint 1
    D[0, 0] = QDP1                             # DG1ZZ1
    D[1, 0] = QP1                              # DG1FV1
    D[2, 0] = np.sign(QP1)                     # DG1FS1
    D[4, 0] = WP32                             # DG1ZZ2
    D[5, 0] = VP22 + WP32*V221 - DV332*V121    # DG1MX2
    D[6, 0] = -VP12 - WP32*V121 - DV332*V221   # DG1MY2
    D[11, 0] = WP33                            # DG1ZZ3
    D[12, 0] = VP23 + WP33*V231 - DV333*V131   # DG1MX3
    D[13, 0] = -VP13 - WP33*V131 - DV333*V231  # DG1MY3
    D[18, 0] = VP13*V131 + VP23*V231           # DG1M4
    # Joint 2
    D[4, 1] = WP32                             # DG2ZZ2
    D[5, 1] = VP22                             # DG2MX2
    D[6, 1] = -VP12                            # DG2MY2
    D[7, 1] = QDP2                             # DG2Ia2
    D[8, 1] = QP2                              # DG2FV2
    D[9, 1] = np.sign(QP2)                     # DG2FS2
    D[11, 1] = WP33                            # DG2ZZ3
    D[12, 1] = VP23 + WP33*V232 - DV333*V132   # DG2MX3
    D[13, 1] = -VP13 - WP33*V132 - DV333*V232  # DG2MY3
    D[18, 1] = VP13*V132 + VP23*V232           # DG2M4
    # Joint 3
    D[11, 2] = WP33          # DG3ZZ3
    D[12, 2] = VP23          # DG3MX3
    D[13, 2] = -VP13         # DG3MY3
    D[14, 2] = QDP3          # DG3Ia3
    D[15, 2] = QP3           # DG3FV3
    D[16, 2] = np.sign(QP3)  # DG3FS3
    # Joint 4
    D[18, 3] = VP34          # DG4M4
    D[19, 3] = QP4           # DG4FV4
    D[20, 3] = np.sign(QP4)  # DG4FS4


def _inverse_dynamics_block(q, qd, qdd, GAM, X, D2, D3, g):
    """Fill GAM, shape (4, N), where it is not constant, from q (4, N); qd (4, N); qdd (4, N)."""
    # Inputs
    q2, q3 = q[1:3]
    QP1, QP2, QP3, QP4 = qd
    QDP1, QDP2, QDP3, QDP4 = qdd
    (
        ZZ1R, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, Ia2, FV2, FS2, OFFSET2, ZZ3R, MX3R, MY3R, Ia3,
        FV3, FS3, OFFSET3, M4R, FV4, FS4, OFFSET4R
    ) = X
    # Trigonometry
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    C3 = np.cos(q3)
    S3 = np.sin(q3)
    # Link 1
    DV331 = QP1**2
    # Link 2
    W32 = QP1 + QP2
    WP32 = QDP1 + QDP2
    DV332 = W32**2
    VSP12 = -D2*DV331
    VSP22 = D2*QDP1
    VP12 = C2*VSP12 + S2*VSP22
    VP22 = C2*VSP22 - S2*VSP12
    # Link 3
    W33 = QP3 + W32
    WP33 = QDP3 + WP32
    DV333 = W33**2
    VSP13 = VP12 - D3*DV332
    VSP23 = VP22 + D3*WP32
    VP13 = C3*VSP13 + S3*VSP23
    VP23 = C3*VSP23 - S3*VSP13
    # Link 4
    VP34 = QDP4 + g
    # Joint 4
    F14 = M4R*VP13
    F24 = M4R*VP23
    F34 = M4R*VP34
    # Joint 3
    F13 = -MX3R*DV333 - MY3R*WP33
    F23 = MX3R*WP33 - MY3R*DV333
    E13 = F14 + F13
    E23 = F24 + F23
    N33 = ZZ3R*WP33 + MX3R*VP23 - MY3R*VP13
    FDI13 = C3*E13 - S3*E23
    FDI23 = S3*E13 + C3*E23
    # Joint 2
    F12 = -MX2R*DV332 - MY2*WP32
    F22 = MX2R*WP32 - MY2*DV332
    E12 = FDI13 + F12
    E22 = FDI23 + F22
    N32 = ZZ2R*WP32 + MX2R*VP22 - MY2*VP12
    NE32 = N33 + D3*FDI23 + N32
    FDI22 = S2*E12 + C2*E22
    # Joint 1
    N31 = ZZ1R*QDP1
    NE31 = NE32 + D2*FDI22 + N31
    # Torques
    GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*np.sign(QP1)
    GAM[1] = OFFSET2 + NE32 + Ia2*QDP2 + FV2*QP2 + FS2*np.sign(QP2)
    GAM[2] = OFFSET3 + N33 + Ia3*QDP3 + FV3*QP3 + FS3*np.sign(QP3)
    GAM[3] = OFFSET4R + F34 + FV4*QP4 + FS4*np.sign(QP4)


def _inertia_matrix_block(q, A, X, D2, D3):
    """Fill A, shape (4, 4, N), where it is not constant, from q (4, N)."""
    # Inputs
    q2, q3 = q[1:3]
    ZZ1R = X[0]
    ZZ2R = X[4]
    MX2R = X[5]
    MY2 = X[6]
    Ia2 = X[7]
    ZZ3R = X[11]
    MX3R = X[12]
    MY3R = X[13]
    Ia3 = X[14]
    M4R = X[18]
    # Trigonometry
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    C3 = np.cos(q3)
    S3 = np.sin(q3)
    # Composite link 3
    AS13 = MX3R*C3 - MY3R*S3
    AS23 = MX3R*S3 + MY3R*C3
    JP332a = AS13 + D3*M4R
    D3AS13 = D3*AS13
    JP332 = ZZ2R + ZZ3R + D3AS13 + D3*JP332a
    MSP12 = MX2R + JP332a
    MSP22 = MY2 + AS23
    # Composite link 2
    AS12 = C2*MSP12 - S2*MSP22
    D2AS12 = D2*AS12
    JP331 = ZZ1R + JP332 + D2AS12 + D2*(AS12 + D2*M4R)
    # Unit acceleration of joint 2
    NE312 = JP332 + D2AS12
    # Unit acceleration of joint 3
    NE323 = ZZ3R + D3AS13
    E213 = C2*AS13 - S2*AS23
    NE313 = NE323 + D2*E213
    # Inertia matrix
    A[0, 0] = JP331
    A[0, 1] = A[1, 0] = NE312
    A[1, 1] = Ia2 + JP332
    A[0, 2] = A[2, 0] = NE313
    A[1, 2] = A[2, 1] = NE323
    A[2, 2] = ZZ3R + Ia3
    A[3, 3] = M4R


def _bias_block(q, qd, GAM, X, D2, D3, g):
    """Fill GAM, shape (4, N), where it is not constant, from q (4, N); qd (4, N)."""
    # Inputs
    q2, q3 = q[1:3]
    QP1, QP2, QP3, QP4 = qd
    FV1 = X[1]
    FS1 = X[2]
    OFFSET1 = X[3]
    MX2R = X[5]
    MY2 = X[6]
    FV2 = X[8]
    FS2 = X[9]
    OFFSET2 = X[10]
    MX3R = X[12]
    MY3R = X[13]
    FV3 = X[15]
    FS3 = X[16]
    OFFSET3 = X[17]
    M4R = X[18]
    FV4 = X[19]
    FS4 = X[20]
    OFFSET4R = X[21]
    # Constants
    F34 = g*M4R
    # Trigonometry
    C2 = np.cos(q2)
    S2 = np.sin(q2)
    C3 = np.cos(q3)
    S3 = np.sin(q3)
    # Link 1
    DV331 = QP1**2
    # Link 2
    W32 = QP1 + QP2
    DV332 = W32**2
    VSP12 = -D2*DV331
    C2VSP12 = C2*VSP12
    S2VSP12 = S2*VSP12
    # Link 3
    W33 = QP3 + W32
    DV333 = W33**2
    VSP13 = C2VSP12 - D3*DV332
    VP13 = C3*VSP13 - S3*S2VSP12
    VP23 = -C3*S2VSP12 - S3*VSP13
    # Joint 4
    F14 = M4R*VP13
    F24 = M4R*VP23
    # Joint 3
    F13 = -MX3R*DV333
    F23 = -MY3R*DV333
    E13 = F14 + F13
    E23 = F24 + F23
    N33 = MX3R*VP23 - MY3R*VP13
    FDI13 = C3*E13 - S3*E23
    FDI23 = S3*E13 + C3*E23
    # Joint 2
    F12 = -MX2R*DV332
    F22 = -MY2*DV332
    E12 = FDI13 + F12
    E22 = FDI23 + F22
    N32 = -MX2R*S2VSP12 - MY2*C2VSP12
    NE32 = N33 + D3*FDI23 + N32
    FDI22 = S2*E12 + C2*E22
    NE31 = NE32 + D2*FDI22
    # Torques
    GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*np.sign(QP1)
    GAM[1] = OFFSET2 + NE32 + FV2*QP2 + FS2*np.sign(QP2)
    GAM[2] = OFFSET3 + N33 + FV3*QP3 + FS3*np.sign(QP3)
    GAM[3] = OFFSET4R + F34 + FV4*QP4 + FS4*np.sign(QP4)


def _gravity_block(GAM, X, g):
    """Fill GAM, shape (4, N), where it is not constant."""
    # Inputs
    OFFSET1 = X[3]
    OFFSET2 = X[10]
    OFFSET3 = X[17]
    M4R = X[18]
    OFFSET4R = X[21]
    # Constants
    F34 = g*M4R
    # Torques
    GAM[0] = OFFSET1
    GAM[1] = OFFSET2
    GAM[2] = OFFSET3
    GAM[3] = OFFSET4R + F34


def _frame_poses_block(q, T, D2, D3):
    """Fill T, shape (4, 4, 4, N), where it is not constant, from q (4, N)."""
    # Inputs
    q1, q2, q3, q4 = q
    # Trigonometry
    C1 = np.cos(q1)
    S1 = np.sin(q1)
    th12 = q1 + q2
    C12 = np.cos(th12)
    S12 = np.sin(th12)
    th123 = th12 + q3
    C123 = np.cos(th123)
    S123 = np.sin(th123)
    # Frame 2
    P12 = D2*C1
    P22 = D2*S1
    # Frame 3
    P13 = P12 + D3*C12
    P23 = P22 + D3*S12
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
    T[2, 0, 0] = C123
    T[2, 0, 1] = -S123
    T[2, 0, 3] = P13
    T[2, 1, 0] = S123
    T[2, 1, 1] = C123
    T[2, 1, 3] = P23
    T[3, 0, 0] = C123
    T[3, 0, 1] = -S123
    T[3, 0, 3] = P13
    T[3, 1, 0] = S123
    T[3, 1, 1] = C123
    T[3, 1, 3] = P23
    T[3, 2, 3] = q4


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4)
DRIVES = None
LIMITS = {}
VALUES = {}
