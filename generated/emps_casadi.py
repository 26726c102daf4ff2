# Certificate by symgen 0.2.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
# with probability below 1e-16; base_parameters, regressor, inverse_dynamics, inertia_matrix,
# bias, gravity, forward_dynamics, frame_poses, jacobian, inverse_dynamics_derivatives,
# forward_dynamics_derivatives at random states, parameters and random constants agree with
# Lagrange's equations and products of frames to 1e-09; SCHEMA, NAME, SOURCE_SHA256, JOINTS,
# CONSTANTS, BASE_PARAMETERS, STANDARD_PARAMETERS, NO_EFFECT, FORMULAS, UNITS, STRUCTURE, DRIVES,
# LIMITS, VALUES, HEADER, DEFAULTS with the robot file.
# sha256 of what follows: 3824a500009f26920bf119294d6b29157c654c111375e72cbda6cc0e2c42e4f9
"""EMPS, one prismatic axis: base parameters, regressor, dynamics as CasADi functions.

GENERATED from emps.yaml, sha256 819142f28b57, by symgen 0.2.0.
Do not edit; symgen generate emps --target casadi

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha  d  theta   r
    1    0      1      0  0      0  q1
Gravity     acceleration (-g, 0, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Element     Ia      inertia: along q1
Element     FV      viscous: along q1
Element     FS      coulomb: along q1
Element     OFFSET  offset: along q1

Base parameters, 4 of 14; Gautier and Khalil (1990)
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
    inverse_dynamics   3 multiplications, 3 additions, 0 sin, 0 cos
    inertia_matrix     0 multiplications, 0 additions, 0 sin, 0 cos
    bias               2 multiplications, 2 additions, 0 sin, 0 cos
    gravity            0 multiplications, 0 additions, 0 sin, 0 cos
    frame_poses        0 multiplications, 0 additions, 0 sin, 0 cos

Functions   ca.Function objects of columns q, qd, qdd, tau (1,) and X (4,), then of the constants.
            By name, constants that are not given have their values in CONSTANTS, anything else that
            is not given is nan:
                inverse_dynamics(q=q, qd=qd, qdd=qdd, X=X)["GAM"]
                regressor(q=q, qd=qd, qdd=qdd, g=9.81)["D"]
            By position all of them are given. Samples stand side by side, q (1, N); the results
            then do so too.
Derivatives inverse_dynamics_derivatives, forward_dynamics_derivatives; others by CasADi. Those of
            sign(qd) are zero.
"""

import casadi as ca

SCHEMA = 1
NAME = 'emps'
SOURCE_SHA256 = '819142f28b57b4229603a127b0d6c9480c4d33b0409fb6506f5a20314e54f5c4'
JOINTS = (1,)
CONSTANTS = {'g': 9.81}
BASE_PARAMETERS = ('M1R', 'FV1', 'FS1', 'OFFSET1')
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'ZZ1', 'MX1', 'MY1', 'MZ1')
FORMULAS = {
    'M1R': 'M1 + Ia1',
}
UNITS = dict(zip(BASE_PARAMETERS, ('kg', 'N*s/m', 'N', 'N')))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = tuple(tuple(mark == "x" for mark in row) for row in (
    "x", "x", "x", "x",
))

_COLUMNS = {"q": 1, "qd": 1, "qdd": 1, "tau": 1, "X": 4, "standard": 14}


def _inputs(reads):
    """Symbols of the columns `reads`, then of the constants."""
    columns = [ca.SX.sym(name, _COLUMNS[name]) for name in reads]
    return columns + [ca.SX.sym(name) for name in CONSTANTS]


def _function(name, reads, inputs, results):
    """ca.Function of `inputs`, called `reads` and as the constants; results: {label:
    expression}."""
    default = {"default_in": [*(float("nan") for _ in reads), *CONSTANTS.values()]}
    return ca.Function(
        name, inputs, [*results.values()], [*reads, *CONSTANTS], [*results], default
    )


def _modelled(name, reads, model, takes, *labels):
    """ca.Function of a model below, which takes columns as lists of scalars, and constants, and
    returns a matrix, or a list of matrices.
    """
    inputs = _inputs(reads)
    scalars = [*(ca.vertsplit(x) for x in inputs[:len(reads)]), *inputs[len(reads):]]
    argument = dict(zip([*reads, *CONSTANTS], scalars))
    value = model(*[argument[x] for x in takes])
    values = value if isinstance(value, list) else [value]
    return _function(name, reads, inputs, dict(zip(labels, values)))


def _derivatives(name, reads, function, result):
    """ca.Function of the Jacobians of the result of `function` by each column it reads,
    d<result>_d<column>.
    """
    inputs = _inputs(reads)
    value = function(*inputs)
    slopes = {f"d{result}_d{x}": ca.jacobian(value, inputs[k]) for k, x in enumerate(reads)}
    return _function(name, reads, inputs, slopes)


def _base_parameters(standard):
    """X from the standard parameters."""
    _, _, _, _, _, _, _, _, _, M1, Ia1, FV1, FS1, OFFSET1 = standard
    M1R = M1 + Ia1
    return ca.vertcat(
        M1R, FV1, FS1, OFFSET1,
    )


def _regressor(qd, qdd):
    """D of Gamma = D X.

    Shape (1, 4).
    """
    D = ca.SX(4, 1)
    D[3, 0] = 1.0
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    # Joint 1
    D[0, 0] = QDP1          # DG1M1
    D[1, 0] = QP1           # DG1FV1
    D[2, 0] = ca.sign(QP1)  # DG1FS1
    return D.T


def _inverse_dynamics(qd, qdd, X):
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (1, 1).
    """
    GAM = ca.SX(1, 1)
    # Inputs
    QP1 = qd[0]
    QDP1 = qdd[0]
    M1R, FV1, FS1, OFFSET1 = X
    # Joint 1
    F31 = M1R*QDP1
    # Torques
    GAM[0, 0] = OFFSET1 + F31 + FV1*QP1 + FS1*ca.sign(QP1)
    return GAM


def _inertia_matrix(X):
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (1, 1).
    """
    A = ca.SX(1, 1)
    # Inputs
    M1R = X[0]
    # Inertia matrix
    A[0, 0] = M1R
    return A


def _bias(qd, X):
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (1, 1).
    """
    GAM = ca.SX(1, 1)
    # Inputs
    QP1 = qd[0]
    FV1, FS1, OFFSET1 = X[1:]
    # Torques
    GAM[0, 0] = OFFSET1 + FV1*QP1 + FS1*ca.sign(QP1)
    return GAM


def _gravity(X):
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (1, 1).
    """
    GAM = ca.SX(1, 1)
    # Inputs
    OFFSET1 = X[3]
    # Torques
    GAM[0, 0] = OFFSET1
    return GAM


def _frame_poses(q):
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (1, 4, 4).
    """
    T = [ca.SX(4, 4) for _ in range(1)]
    T[0][0, 0] = 1.0
    T[0][1, 1] = 1.0
    T[0][2, 2] = 1.0
    T[0][3, 3] = 1.0
    # Inputs
    q1 = q[0]
    # Poses
    T[0][2, 3] = q1
    return T


def _forward_dynamics(qd, tau, X):
    """Qdd = A(q)**-1 (tau - bias)."""
    inertia = _inertia_matrix(X)
    return _solved(inertia, ca.vertcat(*tau) - _bias(qd, X))


def _solved(A, b):
    """A**-1 b with A = L diag(d) L', L unit lower triangular; A symmetric positive definite."""
    n = len(JOINTS)
    L, d, x = ca.SX.eye(n), [A[j, j] for j in range(n)], [b[j] for j in range(n)]
    for j in range(n):
        for k in range(j):
            d[j] -= L[j, k]**2*d[k]
            x[j] -= L[j, k]*x[k]
        for i in range(j + 1, n):
            L[i, j] = (A[i, j] - sum(L[i, k]*L[j, k]*d[k] for k in range(j)))/d[j]
    x = [x[j]/d[j] for j in range(n)]
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            x[j] -= L[i, j]*x[i]
    return ca.vertcat(*x)


def _jacobian(frame, q):
    """Velocity of the origin of `frame`, then its angular velocity, in frame 0, per joint rate."""
    poses = _frame_poses(q)
    return _columns(_paths()[frame], poses, frame)


def _columns(path, T, frame):
    """Columns of the joints on `path`, shape (6, 1), from the poses T of all frames."""
    J, P = ca.SX(6, 1), T[frame - 1][:3, 3]
    for j, sigma, rates in path:
        z = T[j - 1][:3, 2]
        v, w = (z, ca.SX(3, 1)) if sigma else (ca.cross(z, P - T[j - 1][:3, 3]), z)
        for k, rate in rates:
            J[:3, k] += rate*v
            J[3:, k] += rate*w
    return J


def _paths():
    """{frame: ((joint, sigma, ((column, rate), ...)), ...)}: the moving joints below each frame and
    how the joints in the columns move them.
    """
    return {
        1: ((1, 1, ((0, 1.0),)),),
    }


def jacobian_of(frame: int) -> ca.Function:
    """ca.Function J (6, 1) of any frame: velocity of its origin, then angular velocity, in
    frame 0.
    """
    return _modelled(
        f"jacobian_{frame}", ["q"], lambda *given: _jacobian(frame, *given),
        ['q'], "J"
    )


base_parameters = _modelled(
    "base_parameters", ["standard"], _base_parameters,
    ['standard'], "X"
)
regressor = _modelled(
    "regressor", ['q', 'qd', 'qdd'], _regressor,
    ['qd', 'qdd'], *['D']
)
inverse_dynamics = _modelled(
    "inverse_dynamics", ['q', 'qd', 'qdd', 'X'], _inverse_dynamics,
    ['qd', 'qdd', 'X'], *['GAM']
)
inertia_matrix = _modelled(
    "inertia_matrix", ['q', 'X'], _inertia_matrix,
    ['X'], *['A']
)
bias = _modelled(
    "bias", ['q', 'qd', 'X'], _bias,
    ['qd', 'X'], *['GAM']
)
gravity = _modelled(
    "gravity", ['q', 'X'], _gravity,
    ['X'], *['GAM']
)
forward_dynamics = _modelled(
    "forward_dynamics", ['q', 'qd', 'tau', 'X'], _forward_dynamics,
    ['qd', 'tau', 'X'], *['qdd']
)
frame_poses = _modelled(
    "frame_poses", ['q'], _frame_poses,
    ['q'], *['T1']
)
jacobian = jacobian_of(1)
inverse_dynamics_derivatives = _derivatives(
    "inverse_dynamics_derivatives", ["q", "qd", "qdd", "X"], inverse_dynamics, "GAM"
)
forward_dynamics_derivatives = _derivatives(
    "forward_dynamics_derivatives", ["q", "qd", "tau", "X"], forward_dynamics, "qdd"
)


# Of the robot file: drives, limits and values, which no function above reads
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
    'MY1': 0.0, 'MZ1': 0.0, 'M1': 95.1089, 'Ia1': 0.0, 'FV1': 203.5034, 'FS1': 20.3935,
    'OFFSET1': -3.1648,
}
