"""Planar five-bar linkage, 2 actuated joints, general closed loop: base parameters, regressor,
    dynamics.

GENERATED from five_bar.yaml, sha256 2b4cc8e44743, by symgen 0.5.0.
Do not edit; symgen generate five_bar

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  mu  sigma  alpha   d  theta  r
    1    0   1      0      0   0     q1  0
    2    1   0      0      0  L1     q2  0
    3    0   1      0      0  L0     q3  0
    4    3   0      0      0  L3     q4  0
    5    2   0      0      0  L2     q5  0
    6    4   0      2      0  L4      0  0
Gravity     acceleration (0, -g, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q3
    FV      viscous: along q1, q3
    FS      coulomb: along q1, q3
    OFFSET  offset: along q1, q3
Loop        frame 6 coincides with cut frame 5
Loop        q5 = -q1 - q2 + q3 + q4
Loop        q2, q4 from the closure equations by Newton; assembly mode of q1 = 2.2, q3 = 0.9, q2 =
            -1.464, q4 = 1.489

Base parameters, 17 of 48; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2 XX3 XY3 XZ3 YY3 YZ3 MZ3 M3 XX4 XY4
        XZ4 YY4 YZ4 MZ4

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; what several share is
            named by its factors, C4DV134, by its function, signQP1, or by a letter, N16a in N16
    th   joint angle with its constant, rad
    C    cosine of a joint angle or of a sum of angles
    S    sine of a joint angle or of a sum of angles
    QP   joint velocity; with the name of an element, QPFSM6, the velocity that it acts along
    QDP  joint acceleration
    G    rate of a passive joint per unit rate of an actuated one
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
    JP   inertia tensor of a link and all links after it, about the origin of its frame
    AS   the first moments MSP in the antecedent's frame
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque
    P    origin of a frame in frame 0

Cost per sample
    regressor          38 multiplications, 22 additions, 4 sin, 4 cos
    inverse_dynamics   49 multiplications, 36 additions, 4 sin, 4 cos
    inertia_matrix     20 multiplications, 17 additions, 2 sin, 1 cos
    gravity            21 multiplications, 14 additions, 4 sin, 4 cos
    frame_poses        8 multiplications, 7 additions, 4 sin, 4 cos
    linearised_closure 8 multiplications, 10 additions, 4 sin, 4 cos
    curvature          24 multiplications, 10 additions, 4 sin, 4 cos

Arguments   q, qd, qdd, tau of shape (N, 2), or (2,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (17,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's, float64: joints that only the closure equations tie are found by iteration

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 8e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian, passive_joints, elements
at random states, parameters and random constants agree with Lagrange's equations and products of
frames to 1e-09, on NumPy's arrays.
sha256 of all but these lines: 856a1403a41124d30b79ee6c86e3add6036af9dc801f096f07881f694ea17d92
"""

import numpy as np

SCHEMA = 1
NAME = 'five_bar'
SOURCE_SHA256 = '2b4cc8e4474326a906119102db0f1bf535a90a4786fa82f82d634d09856e3304'
JOINTS = (1, 3)
PASSIVE = (2, 4, 5)
CONSTANTS = {'L0': 0.2, 'L1': 0.25, 'L2': 0.36, 'L3': 0.27, 'L4': 0.34, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R MX1R MY1 FV1 FS1 OFFSET1 ZZ2R MX2R MY2 ZZ3R MX3R MY3 FV3 FS3 OFFSET3 ZZ4R MY4
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 Ia3 FV3 FS3 OFFSET3 XX4 XY4 XZ4 YY4 YZ4 ZZ4 MX4 MY4 MZ4 M4
""".split())
NO_EFFECT = tuple("""
XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2 XX3 XY3 XZ3 YY3 YZ3 MZ3 M3 XX4 XY4 XZ4 YY4 YZ4
MZ4
""".split())
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + L1**2*M2 + L1**2/L4*MX4',
    'MX1R': 'MX1 + L1*M2 + L1/L4*MX4',
    'ZZ2R': 'ZZ2 + L2**2/L4*MX4',
    'MX2R': 'MX2 + L2/L4*MX4',
    'ZZ3R': 'ZZ3 + Ia3 - L3**2/L4*MX4 + L3**2*M4',
    'MX3R': 'MX3 - L3/L4*MX4 + L3*M4',
    'ZZ4R': 'ZZ4 - L4*MX4',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2 kg*m kg*m kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2
kg*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x.", "x.", "x.", "x.", "x.", "x.", "xx", "xx", "xx", ".x", ".x", ".x", ".x", ".x", ".x", "xx",
    "xx",
)])
_START = (2.2, 0.9, -1.4637535910825177, 1.4891269023374534)
_MODE = -1.0  # sign of det J_u in the assembly mode of _START


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (17, 2, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((17, 2, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[5, 0] = D[14, 1] = 1.0
    return D


# Arrays and their packages
def _real(x, name):
    """x as float64; ValueError, in one sentence, unless it holds real numbers alone: a cast would
    drop dates, imaginary parts and masks in silence.
    """
    try:
        array = np.asarray(x)
    except Exception as error:
        raise ValueError(f"{name}: {type(x).__name__}, no numbers in rows of one length") from error
    masked = array is not x and np.ma.is_masked(x)
    if array.dtype.kind not in "iuf" or masked or hasattr(x, "units") or hasattr(x, "unit"):
        kind = "a masked array" if masked else f"{type(x).__name__} of {array.dtype}"
        raise ValueError(f"{name}: {kind}; expected real numbers")
    return array.astype(float, copy=False)


def _numbers(constants):
    """The constants; ValueError unless each is a real number."""
    for x in constants:
        if type(x) is not float and _real(x, "a constant").ndim:
            raise ValueError(f"a constant: {type(x).__name__}; expected a real number")
    return constants


def _states(*arrays):
    """The states as rows of samples, shape (N, 2) each; ValueError unless all have shape
    (N, 2), or all (2,).
    """
    states = [_real(x, "states") for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (2,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 2) each, or (2,) each")
    return tuple([x.reshape(-1, 2) for x in states])


def _parameters(X):
    """X; ValueError unless it has a value for each base parameter."""
    if tuple(X.shape) != (17,):
        raise ValueError(f"X of shape {X.shape}; expected (17,) in the order of BASE_PARAMETERS")
    return X


def _filled(block, result, states, arguments):
    """`result` from `block`, 4096 samples at a time; states (N, ...) enter as contiguous rows
    (..., B), result ends in samples.
    """
    N = result.shape[-1]
    if N <= 8192:
        rows = [np.ascontiguousarray(x.T) for x in states]
        block(np, *rows, result, *arguments)
        return result
    for t in range(0, N, 4096):
        part = slice(t, t + 4096)
        rows = [np.ascontiguousarray(x[part].T) for x in states]
        block(np, *rows, result[..., part], *arguments)
    return result


def _evaluated(block, shape, states, X, constants, closing=None):
    """The result of `block`, samples first: NumPy's is filled in place, that of another package
    gathered from a table. X is empty where no parameter is read.
    """
    rows, X = _states(*states), [_parameters(_real(x, "X")) for x in X]
    rows = _closed(rows, closing)
    result = np.zeros((*shape, len(rows[0])))
    _filled(block, result, rows, (*X, *_numbers(constants)))
    result = result.transpose(-1, *range(len(shape)))
    return result[0] if np.ndim(states[0]) == 1 else result


def elements(
    *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36, L3: float = 0.27, L4: float = 0.34,
    g: float = 9.81
) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((L1, L3, g))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia3': ('inertia', 'both', {3: 1.0}), 'FV3': ('viscous', 'both', {3: 1.0}),
        'FS3': ('coulomb', 'both', {3: 1.0}), 'OFFSET3': ('offset', 'both', {3: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(
    standard: "Array", *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36, L3: float = 0.27,
    L4: float = 0.34, g: float = 9.81
) -> "Array":
    """X, shape (17,), from the 48 standard parameters: a mapping by name, or a vector in the
    order of STANDARD_PARAMETERS.
    """
    if hasattr(standard, "keys"):
        rest = [x for x in STANDARD_PARAMETERS if x not in standard and x not in NO_EFFECT]
        if rest:
            raise ValueError(f"standard: no value of {', '.join(rest)}")
        standard = [standard.get(name) for name in STANDARD_PARAMETERS]
    else:
        try:
            shape = tuple(standard.shape if hasattr(standard, "shape") else np.shape(standard))
        except ValueError:  # rows of several lengths
            shape = ()
        if shape[:1] != (48,):
            raise ValueError(
                f"standard of shape {shape}; expected (48,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
    (
        _, _, _, _, _, ZZ1, MX1, MY1, _, _, Ia1, FV1, FS1, OFFSET1, _, _, _, _, _, ZZ2, MX2,
        MY2, _, M2, _, _, _, _, _, ZZ3, MX3, MY3, _, _, Ia3, FV3, FS3, OFFSET3, _, _, _, _, _,
        ZZ4, MX4, MY4, _, M4
    ) = standard
    ZZ1R = ZZ1 + Ia1 + L1**2*M2 + L1**2/L4*MX4
    MX1R = MX1 + L1*M2 + L1/L4*MX4
    ZZ2R = ZZ2 + L2**2/L4*MX4
    MX2R = MX2 + L2/L4*MX4
    ZZ3R = ZZ3 + Ia3 - L3**2/L4*MX4 + L3**2*M4
    MX3R = MX3 - L3/L4*MX4 + L3*M4
    ZZ4R = ZZ4 - L4*MX4
    return np.array([
        ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, ZZ3R, MX3R, MY3, FV3, FS3, OFFSET3,
        ZZ4R, MY4,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, L0: float = 0.2,
    L1: float = 0.25, L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 2, 17).

    A view on one store of shape (17, 2, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    filled = _stored(q, qd, qdd, out, (L1, L3, g), closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, L0: float = 0.2,
    L1: float = 0.25, L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (2*N, 17), Fortran order, rows joint-major: the same
    store, no copy.
    """
    filled = _stored(q, qd, qdd, out, (L1, L3, g), closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))
    return filled.reshape(17, -1).T


def _stored(q, qd, qdd, out, constants, closing=None):
    """`out`, or a new store, filled."""
    states = _closed(_states(q, qd, qdd), closing)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (17, 2, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(17, 2, N)}, found {kind}")
    D = out.view(np.ndarray)
    return _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, L0: float = 0.2, L1: float = 0.25,
    L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 2).
    """
    return _evaluated(_inverse_dynamics_block, (2,), (q, qd, qdd), (X,), (L1, L3, g),
        closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))


def inertia_matrix(
    q: "Array", X: "Array", *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36,
    L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 2, 2).
    """
    return _evaluated(_inertia_matrix_block, (2, 2), (q,), (X,), (L1, L3),
        closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))


def bias(
    q: "Array", qd: "Array", X: "Array", *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36,
    L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 2).
    """
    return inverse_dynamics(q, qd, np.zeros_like(_real(qd, "qd")), X, L0=L0, L1=L1, L2=L2, L3=L3,
        L4=L4, g=g)


def gravity(
    q: "Array", X: "Array", *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36,
    L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 2).
    """
    return _evaluated(_gravity_block, (2,), (q,), (X,), (g,),
        closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))


def frame_poses(
    q: "Array", *, L0: float = 0.2, L1: float = 0.25, L2: float = 0.36, L3: float = 0.27,
    L4: float = 0.34, g: float = 9.81
) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 6, 4, 4).
    """
    return _evaluated(_frame_poses_block, (6, 4, 4), (q,), (), (L0, L1, L2, L3, L4),
        closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, L0: float = 0.2, L1: float = 0.25,
    L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 2)."""
    _states(q, qd, tau)
    rest = _real(tau, "tau") - inverse_dynamics(q, qd, np.zeros_like(qd), X, L0=L0, L1=L1, L2=L2,
        L3=L3, L4=L4, g=g)
    inertia = inertia_matrix(q, X, L0=L0, L1=L1, L2=L2, L3=L3, L4=L4, g=g)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, L0: float = 0.2, L1: float = 0.25,
    L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 2).
    """
    frame = 6 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 6:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 6")
    return _evaluated(_jacobian_block, (6, 2), (q,), (), (frame, L0, L1, L2, L3, L4),
        closing=((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))


def _jacobian_block(xp, q, qd, qdd, G, J, frame, *constants):
    """Fill J, shape (6, 2, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(6, 4, 4), 0.0)
    _frame_poses_block(xp, q, qd, qdd, G, T, *constants[:5])
    joints, columns, j = _moving(xp, *constants[5:]), {}, frame
    while j:
        antecedent, sigma, rates = joints[j]
        z = [T[j - 1, k, 2] for k in range(3)]
        P = [T[frame - 1, k, 3] - T[j - 1, k, 3] for k in range(3)]
        twist = [z[1]*P[2] - z[2]*P[1], z[2]*P[0] - z[0]*P[2], z[0]*P[1] - z[1]*P[0], *z]
        if sigma:
            twist = [*z, 0.0, 0.0, 0.0]
        for column, rate in rates:
            for k in range(6):
                columns[k, column] = columns.get((k, column), 0.0) + rate*twist[k]
        j = antecedent
    for k, column in np.ndindex(6, 2):
        J[k, column] = columns.get((k, column), 0.0)
        for u in range(2):
            J[k, column] += columns.get((k, 2 + u), 0.0)*G[2*u + column]


def _moving(xp):
    """{frame: (antecedent, sigma, ((column, rate), ...))}: how the joints in the columns move the
    joint of each frame.
    """
    return {
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((2, 1.0),)), 3: (0, 0, ((1, 1.0),)),
        4: (3, 0, ((3, 1.0),)), 5: (2, 0, ((1, 1.0), (3, 1.0), (0, -1.0), (2, -1.0))),
        6: (4, 2, ()),
    }


def passive_joints(
    q: "Array", qd: "Array | None" = None, qdd: "Array | None" = None, *, L0: float = 0.2,
    L1: float = 0.25, L2: float = 0.36, L3: float = 0.27, L4: float = 0.34, g: float = 9.81
) -> "Array | tuple":
    """Positions of the joints PASSIVE, shape (N, 3); with qd also their velocities, with qdd
    also their accelerations.
    """
    given = [state for state in (q, qd, qdd) if state is not None]
    xp = np
    rows = _passive(xp)
    states = _states(*[np.zeros_like(q) if x is None else x for x in (q, qd, qdd)])
    states = _closed(states, ((L0, L1, L2, L3, L4), (L1, L2, L3, L4)))
    given = [x for x, state in zip(states, (q, qd, qdd)) if state is not None]
    origin, rates = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    shape = (*np.shape(q)[:-1], 3)
    results = [(x @ rates.T).reshape(shape) for x in given]
    results[0] += origin
    return results[0] if len(results) == 1 else tuple(results)


def _passive(xp):
    """(origin, rates) of the joints PASSIVE over the joints of the columns."""
    return (
        (0.0, (0.0, 0.0, 1.0, 0.0)),
        (0.0, (0.0, 0.0, 0.0, 1.0)),
        (0.0, (-1.0, 1.0, -1.0, 1.0)),
    )


def _closed(states, constants):
    """Joints of the closed mechanism, actuated then tied: q, qd, qdd (N, 4), and G (N, 2*2),
    rates of the tied ones. `constants` are those of `_closure`, then those of `_curvature`.
    """
    _numbers([x for part in constants for x in part])
    q, qd, qdd = (*states, *[np.zeros_like(states[0])] * (3 - len(states)))
    N = len(q)
    q = np.concatenate([q, _assembled(q, constants[0])], axis=1)
    J = _closure((q,), *constants[0])[:, 1:]
    J_a, J_u = J[:, :2], J[:, 2:]
    volume = _determinant(J_u) / np.prod(np.sqrt((J**2).sum(axis=1)), axis=0)
    if (np.abs(volume) < 1e-6).any():  # a dead point is found to half the digits of the closure
        t = int(np.abs(volume).argmin())
        raise ValueError(
            f"singular configuration at sample {t}: q = {q[t, :2]}, "
            f"tied joints {q[t, 2:]} move freely there"
        )
    G = -_solved(J_u, J_a)
    qd = np.concatenate([qd, np.einsum("uit,ti->tu", G, qd)], axis=1)
    B = _curvature((q, qd), *constants[1])
    # Beyond a dead point, or frames opposite (trace -1, not 3)
    other = (volume * _MODE < 0) | (B[2:] < 0).any(axis=0)
    if other.any():
        t = int(other.argmax())
        raise ValueError(
            "the mechanism does not close in the assembly mode of _START "
            f"at sample {t}: q = {q[t, :2]}"
        )
    qdd_u = np.einsum("uit,ti->tu", G, qdd) - _solved(J_u, B[:2]).T
    return q, qd, np.concatenate([qdd, qdd_u], axis=1), G.reshape(4, N).T


def _closure(states, L0, L1, L2, L3, L4):
    """Closure residuals, then their derivatives by the joints.

    Shape (2, 5, N).
    """
    result = np.zeros((2, 5, len(states[0])))
    return _filled(_linearised_closure_block, result, states, (L0, L1, L2, L3, L4))


def _curvature(states, L1, L2, L3, L4):
    """Second derivatives of the residuals at constant rates, then traces of A_cut' A_twin.

    Shape (2, N).
    """
    result = np.zeros((2, len(states[0])))
    return _filled(_curvature_block, result, states, (L1, L2, L3, L4))


def _assembled(q, constants):
    """Tied joints (N, 2) that close the loops, in the assembly mode of _START and continuous in q.

    Along a smooth record only knots are followed from _START; the samples between them start from
    interpolation.
    """
    N = len(q)
    pace = np.abs(np.diff(q, axis=0)).max(initial=0.0)
    every = int(np.clip(0.25 / max(pace, 1e-12), 1, 64)) if N > 64 else 1
    knots = np.unique(np.append(np.arange(0, N, every), N - 1)) if N else np.arange(0)
    start, x = _start(constants)
    x = np.tile(x, (len(knots), 1))
    away = q[knots] - start
    steps = int(np.ceil(np.abs(away).max(initial=0.0) / 0.2))
    for s in range(1, steps):
        x, _ = _newton(start + s / steps * away, x, 2, constants)
    x, residual = _newton(q[knots], x, 20, constants)
    if every > 1:
        x = np.stack([np.interp(np.arange(N), knots, column) for column in x.T], axis=1)
        x, residual = _newton(q, x, 5, constants)
    if not (residual < 1e-10).all():
        t = int((~(residual < 1e-10)).argmax())
        raise ValueError(
            f"the mechanism does not close at sample {t}: residual {residual[t]:.3g} at q = {q[t]}"
        )
    return x


def _start(constants):
    """Actuated and tied joints of _START, the loops closed anew at other constants."""
    q, x = np.array(_START[:2]), np.array([_START[2:]])
    given = np.array([CONSTANTS[name] for name in ['L0', 'L1', 'L2', 'L3', 'L4']])
    away = np.array(constants) - given
    for s in np.arange(1, 17) / 16 if away.any() else ():  # along a straight line of the constants
        x, residual = _newton(q[None], x, 20, given + s * away)
        J_u = _closure((np.append(q, x)[None],), *(given + s * away))[:, 3:]
        if not (residual[0] < 1e-10 and _determinant(J_u)[0] * _MODE > 0):
            raise ValueError(
                "the loops do not close in the assembly mode of _START at the constants "
                f"L0, L1, L2, L3, L4 = {given + away}; "
                "generate the model from a robot file with these constants"
            )
    return q, x[0]


def _newton(q, x, passes, constants):
    """At most `passes` Newton steps on the tied joints x; returns x and the largest residual of
    each sample.
    """
    for k in range(passes + 1):
        R = _closure((np.concatenate([q, x], axis=1),), *constants)
        residual = np.abs(R[:, 0]).max(axis=0)
        if k == passes or not residual.max(initial=0.0) > 1e-13:
            return x, residual
        # A singular sample ends as one that does not close
        step = _solved(R[:, 3:] + 1e-14 * np.eye(2)[..., None], R[:, 0])
        x = x - np.clip(step, -0.5, 0.5).T


def _determinant(J):
    """det J for every sample, J (2, 2, N)."""
    return J[0, 0]*J[1, 1] - J[0, 1]*J[1, 0]


def _solved(J, b):
    """J**-1 b for every sample, J (2, 2, N), b (2, ..., N), by Cramer's rule."""
    (J11, J12), (J21, J22) = J
    return np.stack([J22*b[0] - J12*b[1], J11*b[1] - J21*b[0]]) / _determinant(J)


def _regressor_block(xp, q, qd, qdd, G, D, L1, L3, g):
    """Fill D, shape (17, 2, N), where it is not constant, from q, qd, qdd (4, N) and G (4, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, G, L1, L3, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, G, GAM, X, L1, L3, g):
    """Fill GAM, shape (2, N), from q, qd, qdd (4, N) and G (4, N)."""
    _, _torques = _motion(xp, q, qd, qdd, G, L1, L3, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, G, L1, L3, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q1, q3, q2, q4 = q
    QP1, QP3, QP2, QP4 = qd
    QDP1, QDP3, QDP2, QDP4 = qdd
    G21, G23, G41, G43 = G
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    # Link 1
    DV331 = QP1**2
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    W32 = QP1 + QP2
    WP32 = QDP1 + QDP2
    DV332 = W32**2
    VSP12 = VP11 - L1*DV331
    VSP22 = VP21 + L1*QDP1
    VP12 = C2*VSP12 + S2*VSP22
    VP22 = C2*VSP22 - S2*VSP12
    # Link 3
    DV333 = QP3**2
    VP13 = g*S3
    VP23 = g*C3
    # Link 4
    W34 = QP3 + QP4
    WP34 = QDP3 + QDP4
    DV334 = W34**2
    VSP14 = VP13 - L3*DV333
    VSP24 = VP23 + L3*QDP3
    VP14 = C4*VSP14 + S4*VSP24
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP3 = xp.sign(QP3)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 2
        V121 = L1*S2
        V221 = L1*C2
        # Joint axes Z and velocities V seen from link 4
        V143 = L3*S4
        V243 = L3*C4
        # Joint 1
        D[0, 0] = QDP1                                       # DG1ZZ1
        D[1, 0] = VP21                                       # DG1MX1
        D[2, 0] = -VP11                                      # DG1MY1
        D[3, 0] = QP1                                        # DG1FV1
        D[4, 0] = signQP1                                    # DG1FS1
        D[6, 0] = WP32 + WP32*G21                            # DG1ZZ2
        D[7, 0] = VP22 + WP32*V221 + VP22*G21 - DV332*V121   # DG1MX2
        D[8, 0] = -VP12 - WP32*V121 - DV332*V221 - VP12*G21  # DG1MY2
        D[15, 0] = WP34*G41                                  # DG1ZZ4
        D[16, 0] = -VP14*G41                                 # DG1MY4
        # Joint 3
        D[6, 1] = WP32*G23                                    # DG3ZZ2
        D[7, 1] = VP22*G23                                    # DG3MX2
        D[8, 1] = -VP12*G23                                   # DG3MY2
        D[9, 1] = QDP3                                        # DG3ZZ3
        D[10, 1] = VP23                                       # DG3MX3
        D[11, 1] = -VP13                                      # DG3MY3
        D[12, 1] = QP3                                        # DG3FV3
        D[13, 1] = signQP3                                    # DG3FS3
        D[15, 1] = WP34 + WP34*G43                            # DG3ZZ4
        D[16, 1] = -VP14 - WP34*V143 - DV334*V243 - VP14*G43  # DG3MY4

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, ZZ3R, MX3R, MY3, FV3, FS3, OFFSET3,
            ZZ4R, MY4
        ) = X
        # Joint 4
        F14 = -MY4*WP34
        F24 = -MY4*DV334
        N34 = ZZ4R*WP34 - MY4*VP14
        FDI24 = S4*F14 + C4*F24
        # Joint 3
        N33 = ZZ3R*QDP3 + MX3R*VP23 - MY3*VP13
        NE33 = N34 + L3*FDI24 + N33
        # Joint 2
        F12 = -MX2R*DV332 - MY2*WP32
        F22 = MX2R*WP32 - MY2*DV332
        N32 = ZZ2R*WP32 + MX2R*VP22 - MY2*VP12
        FDI22 = S2*F12 + C2*F22
        # Joint 1
        N31 = ZZ1R*QDP1 + MX1R*VP21 - MY1*VP11
        NE31 = N32 + L1*FDI22 + N31
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1 + G21*N32 + G41*N34
        GAM[1] = OFFSET3 + NE33 + FV3*QP3 + FS3*signQP3 + G23*N32 + G43*N34

    return _regressor, _torques


def _inertia_matrix_block(xp, q, qd, qdd, G, A, X, L1, L3):
    """Fill A, shape (2, 2, N), from q, qd, qdd (4, N) and G (4, N)."""
    # Inputs
    q2, q4 = q[2:]
    G21, G23, G41, G43 = G
    ZZ1R = X[0]
    ZZ2R = X[6]
    MX2R = X[7]
    MY2 = X[8]
    ZZ3R = X[9]
    ZZ4R = X[15]
    MY4 = X[16]
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    S4 = xp.sin(q4)
    # Composite link 4
    AS14 = -MY4*S4
    L3AS14 = L3*AS14
    JP333 = ZZ3R + ZZ4R + 2*L3AS14
    # Composite link 2
    AS12 = MX2R*C2 - MY2*S2
    L1AS12 = L1*AS12
    JP331 = ZZ1R + ZZ2R + 2*L1AS12
    # Unit acceleration of joint 2
    NE312 = ZZ2R + L1AS12
    # Unit acceleration of joint 4
    NE334 = ZZ4R + L3AS14
    # Unit acceleration of joint 5
    A11a = NE312 + ZZ2R*G21
    ZZ4RG41 = ZZ4R*G41
    # Inertia matrix
    A[0, 0] = JP331 + G21*NE312 + G21*A11a + G41*ZZ4RG41
    A[0, 1] = A[1, 0] = G41*NE334 + G23*A11a + G43*ZZ4RG41
    A[1, 1] = JP333 + G43*NE334 + G23*ZZ2R*G23 + G43*(NE334 + ZZ4R*G43)


def _gravity_block(xp, q, qd, qdd, G, GAM, X, g):
    """Fill GAM, shape (2, N), from q, qd, qdd (4, N) and G (4, N)."""
    # Inputs
    q1, q3, q2, q4 = q
    G21, G23, G41, G43 = G
    _, MX1R, MY1, _, _, OFFSET1, _, MX2R, MY2, _, MX3R, MY3, _, _, OFFSET3, _, MY4 = X
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    # Link 1
    VP11 = g*S1
    VP21 = g*C1
    # Link 2
    VP12 = C2*VP11 + S2*VP21
    VP22 = C2*VP21 - S2*VP11
    # Link 3
    VP13 = g*S3
    VP23 = g*C3
    # Link 4
    VP14 = C4*VP13 + S4*VP23
    # Joint 4
    N34 = -MY4*VP14
    # Joint 3
    N33 = MX3R*VP23 - MY3*VP13
    NE33 = N34 + N33
    # Joint 2
    N32 = MX2R*VP22 - MY2*VP12
    # Joint 1
    N31 = MX1R*VP21 - MY1*VP11
    NE31 = N32 + N31
    # Torques
    GAM[0] = OFFSET1 + NE31 + N32*G21 + N34*G41
    GAM[1] = OFFSET3 + NE33 + N32*G23 + N34*G43


def _frame_poses_block(xp, q, qd, qdd, G, T, L0, L1, L2, L3, L4):
    """Fill T, shape (6, 4, 4, N), from q, qd, qdd (4, N) and G (4, N)."""
    # Inputs
    q1, q3, q2, q4 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    th12 = q1 + q2
    C12 = xp.cos(th12)
    S12 = xp.sin(th12)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    th34 = q3 + q4
    C34 = xp.cos(th34)
    S34 = xp.sin(th34)
    # Frame 2
    P12 = L1*C1
    P22 = L1*S1
    # Frame 4
    P14 = L0 + L3*C3
    P24 = L3*S3
    # Frame 5
    P15 = P12 + L2*C12
    P25 = P22 + L2*S12
    # Frame 6
    P16 = P14 + L4*C34
    P26 = P24 + L4*S34
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
    T[2, 0, 0] = C3
    T[2, 0, 1] = -S3
    T[2, 0, 3] = L0
    T[2, 1, 0] = S3
    T[2, 1, 1] = C3
    T[3, 0, 0] = C34
    T[3, 0, 1] = -S34
    T[3, 0, 3] = P14
    T[3, 1, 0] = S34
    T[3, 1, 1] = C34
    T[3, 1, 3] = P24
    T[4, 0, 0] = C34
    T[4, 0, 1] = -S34
    T[4, 0, 3] = P15
    T[4, 1, 0] = S34
    T[4, 1, 1] = C34
    T[4, 1, 3] = P25
    T[5, 0, 0] = C34
    T[5, 0, 1] = -S34
    T[5, 0, 3] = P16
    T[5, 1, 0] = S34
    T[5, 1, 1] = C34
    T[5, 1, 3] = P26
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 2, 2] = T[1, 3, 3] = T[2, 2, 2] = T[2, 3, 3] = T[3, 2, 2] = 1.0
    T[3, 3, 3] = T[4, 2, 2] = T[4, 3, 3] = T[5, 2, 2] = T[5, 3, 3] = 1.0


def _linearised_closure_block(xp, q, R, L0, L1, L2, L3, L4):
    """Fill R, shape (2, 5, N), from q (4, N)."""
    # Inputs
    q1, q3, q2, q4 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    th12 = q1 + q2
    C12 = xp.cos(th12)
    S12 = xp.sin(th12)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    th34 = q3 + q4
    C34 = xp.cos(th34)
    S34 = xp.sin(th34)
    # Frame 2
    P12 = L1*C1
    P22 = L1*S1
    # Frame 4
    C3L3 = L3*C3
    P14 = L0 + C3L3
    P24 = L3*S3
    # Frame 5
    C12L2 = L2*C12
    P15 = P12 + C12L2
    S12L2 = L2*S12
    P25 = P22 + S12L2
    # Frame 6
    C34L4 = L4*C34
    P16 = P14 + C34L4
    S34L4 = L4*S34
    P26 = P24 + S34L4
    # Residuals and their derivatives by the joints
    R[0, 0] = P15 - P16
    R[0, 1] = -P25
    R[0, 2] = P26
    R[0, 3] = -S12L2
    R[0, 4] = S34L4
    R[1, 0] = P25 - P26
    R[1, 1] = P15
    R[1, 2] = -C3L3 - C34L4
    R[1, 3] = C12L2
    R[1, 4] = -C34L4


def _curvature_block(xp, q, qd, B, L1, L2, L3, L4):
    """Fill B, shape (2, N), from q, qd (4, N)."""
    # Inputs
    q1, q3, q2, q4 = q
    QP1, QP3, QP2, QP4 = qd
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    th12 = q1 + q2
    C12 = xp.cos(th12)
    S12 = xp.sin(th12)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    th34 = q3 + q4
    C34 = xp.cos(th34)
    S34 = xp.sin(th34)
    # Link 2
    W32 = QP1 + QP2
    # Link 4
    W34 = QP3 + QP4
    # Second derivatives at constant rates
    B[0] = L3*QP3*C3*QP3 + L4*W34*C34*W34 - L1*QP1*C1*QP1 - L2*W32*C12*W32
    B[1] = L3*QP3*S3*QP3 + L4*W34*S34*W34 - L1*QP1*S1*QP1 - L2*W32*S12*W32


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4)
DRIVES = None
LIMITS = {}
VALUES = {}
