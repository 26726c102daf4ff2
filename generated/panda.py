"""Franka Emika Panda, 7 revolute joints: base parameters, regressor, dynamics.

GENERATED from panda.yaml, sha256 69d8ce994a1a, by symgen 0.5.0.
Do not edit; symgen generate panda

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha    d  theta    r
    1    0      0      0    0     q1  RL1
    2    1      0  -pi/2    0     q2    0
    3    2      0   pi/2    0     q3  RL3
    4    3      0   pi/2   D4     q4    0
    5    4      0  -pi/2  -D4     q5  RL5
    6    5      0   pi/2    0     q6    0
    7    6      0   pi/2   D7     q7    0
Gravity     acceleration (0, 0, -g) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q3, q4, q5, q6, q7
    FV      viscous: along q1, q2, q3, q4, q5, q6, q7
    FS      coulomb: along q1, q2, q3, q4, q5, q6, q7
    OFFSET  offset: along q1, q2, q3, q4, q5, q6, q7

Base parameters, 69 of 98; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 MZ2 M2

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; what several share is
            named by its factors, C4DV134, by its function, signQP1, or by a letter, N16a in N16
    C    cosine of a joint angle or of a sum of angles
    S    sine of a joint angle or of a sum of angles
    QP   joint velocity; with the name of an element, QPFSM6, the velocity that it acts along
    QDP  joint acceleration
    W    angular velocity of a link, in its frame
    WP   angular acceleration of a link, in its frame
    DV   products of angular velocity components W_k W_l
    DW   differences of their squares
    U    skew(WP) + skew(W)**2
    VSP  acceleration of the origin of a frame minus gravity, in the antecedent's frame
    VP   the same, in the frame itself
    Z    axis of a joint, in the frame of a later link
    V    velocity of a frame's origin per unit rate of a joint, in that frame
    VS   the same, in the antecedent's frame
    F    force that moves a link
    N    moment that moves a link, about the origin of its frame
    E    force transmitted to a link by its antecedent, in its frame
    NE   moment transmitted to a link by its antecedent, about the origin of its frame
    FDI  the transmitted force, in the antecedent's frame
    JP   inertia tensor of a link and all links after it, about the origin of its frame
    MSP  first moments of a link and all links after it, in its frame
    AJA  the inertia tensor JP by the axes of the antecedent's frame
    AS   the first moments MSP in the antecedent's frame
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque
    DF   the part of DG that pushes: velocity times force
    R    orientation of a frame in frame 0
    P    origin of a frame in frame 0

Cost per sample
    regressor          684 multiplications, 497 additions, 6 sin, 6 cos
    inverse_dynamics   333 multiplications, 315 additions, 6 sin, 6 cos
    inertia_matrix     207 multiplications, 171 additions, 6 sin, 6 cos
    gravity            60 multiplications, 42 additions, 6 sin, 6 cos
    frame_poses        77 multiplications, 41 additions, 7 sin, 7 cos

Arguments   q, qd, qdd, tau of shape (N, 7), or (7,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (69,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 1e-14; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: 1502bc50dc5e110dfb1999eb23efc45e997ea18c907f2ef5e4519a9526705d1d
"""

import numpy as np

SCHEMA = 1
NAME = 'panda'
SOURCE_SHA256 = '69d8ce994a1a6da19a1e7c019c757c841da3b362c433aeebbc97846fc2eef261'
JOINTS = (1, 2, 3, 4, 5, 6, 7)
CONSTANTS = {'RL1': 0.333, 'RL3': 0.316, 'D4': 0.0825, 'RL5': 0.384, 'D7': 0.088, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R FV1 FS1 OFFSET1 XX2R XY2 XZ2 YZ2 ZZ2R MX2 MY2R FV2 FS2 OFFSET2 XX3R XY3R XZ3 YZ3 ZZ3R MX3R MY3R
Ia3 FV3 FS3 OFFSET3 XX4R XY4R XZ4 YZ4 ZZ4R MX4R MY4R Ia4 FV4 FS4 OFFSET4 XX5R XY5 XZ5 YZ5 ZZ5R MX5
MY5R Ia5 FV5 FS5 OFFSET5 XX6R XY6R XZ6 YZ6 ZZ6R MX6R MY6R Ia6 FV6 FS6 OFFSET6 XX7R XY7 XZ7 YZ7 ZZ7
MX7 MY7 Ia7 FV7 FS7 OFFSET7
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 Ia3 FV3 FS3 OFFSET3 XX4 XY4 XZ4 YY4 YZ4
ZZ4 MX4 MY4 MZ4 M4 Ia4 FV4 FS4 OFFSET4 XX5 XY5 XZ5 YY5 YZ5 ZZ5 MX5 MY5 MZ5 M5 Ia5 FV5 FS5 OFFSET5
XX6 XY6 XZ6 YY6 YZ6 ZZ6 MX6 MY6 MZ6 M6 Ia6 FV6 FS6 OFFSET6 XX7 XY7 XZ7 YY7 YZ7 ZZ7 MX7 MY7 MZ7 M7
Ia7 FV7 FS7 OFFSET7
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'MX1', 'MY1', 'MZ1', 'M1', 'MZ2', 'M2')
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + YY2',
    'XX2R': 'XX2 - YY2 + YY3 + 2*RL3*MZ3 + RL3**2*M3 + (D4**2 + RL3**2)*(M4 + M5 + M6 + M7)',
    'ZZ2R': 'ZZ2 + Ia2 + YY3 + 2*RL3*MZ3 + RL3**2*M3 + (D4**2 + RL3**2)*(M4 + M5 + M6 + M7)',
    'MY2R': 'MY2 - MZ3 - RL3*(M3 + M4 + M5 + M6 + M7)',
    'XX3R': 'XX3 - YY3 + YY4 - D4**2*M4',
    'XY3R': 'XY3 + D4*MZ4',
    'ZZ3R': 'ZZ3 + YY4 + D4**2*M4 + 2*D4**2*(M5 + M6 + M7)',
    'MX3R': 'MX3 + D4*(M4 + M5 + M6 + M7)',
    'MY3R': 'MY3 - MZ4',
    'XX4R': 'XX4 - YY4 + YY5 + 2*RL5*MZ5 + (-D4**2 + RL5**2)*(M5 + M6 + M7)',
    'XY4R': 'XY4 + D4*MZ5 + D4*RL5*(M5 + M6 + M7)',
    'ZZ4R': 'ZZ4 + YY5 + 2*RL5*MZ5 + (D4**2 + RL5**2)*(M5 + M6 + M7)',
    'MX4R': 'MX4 - D4*(M5 + M6 + M7)',
    'MY4R': 'MY4 + MZ5 + RL5*(M5 + M6 + M7)',
    'XX5R': 'XX5 - YY5 + YY6 + D7**2*M7',
    'ZZ5R': 'ZZ5 + YY6 + D7**2*M7',
    'MY5R': 'MY5 - MZ6',
    'XX6R': 'XX6 - YY6 + YY7 - D7**2*M7',
    'XY6R': 'XY6 + D7*MZ7',
    'ZZ6R': 'ZZ6 + YY7 + D7**2*M7',
    'MX6R': 'MX6 + D7*M7',
    'MY6R': 'MY6 - MZ7',
    'XX7R': 'XX7 - YY7',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m N*m
kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2
kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m
kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad
N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x......", "x......", "x......", "x......", "xx.....", "xx.....", "xx.....", "xx.....",
    ".x.....", ".x.....", ".x.....", ".x.....", ".x.....", ".x.....", "xxx....", "xxx....",
    "xxx....", "xxx....", "xxx....", "xxx....", "xxx....", "..x....", "..x....", "..x....",
    "..x....", "xxxx...", "xxxx...", "xxxx...", "xxxx...", "xxxx...", "xxxx...", "xxxx...",
    "...x...", "...x...", "...x...", "...x...", "xxxxx..", "xxxxx..", "xxxxx..", "xxxxx..",
    "xxxxx..", "xxxxx..", "xxxxx..", "....x..", "....x..", "....x..", "....x..", "xxxxxx.",
    "xxxxxx.", "xxxxxx.", "xxxxxx.", "xxxxxx.", "xxxxxx.", "xxxxxx.", ".....x.", ".....x.",
    ".....x.", ".....x.", "xxxxxxx", "xxxxxxx", "xxxxxxx", "xxxxxxx", "xxxxxxx", "xxxxxxx",
    "xxxxxxx", "......x", "......x", "......x", "......x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (69, 7, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((69, 7, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[3, 0] = D[13, 1] = D[24, 2] = D[35, 3] = D[46, 4] = D[57, 5] = D[68, 6] = 1.0
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
    """The states as rows of samples, shape (N, 7) each; ValueError unless all have shape
    (N, 7), or all (7,).
    """
    states = [_real(x, "states") for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (7,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 7) each, or (7,) each")
    return tuple([x.reshape(-1, 7) for x in states])


def _parameters(X):
    """X; ValueError unless it has a value for each base parameter."""
    if tuple(X.shape) != (69,):
        raise ValueError(f"X of shape {X.shape}; expected (69,) in the order of BASE_PARAMETERS")
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


def _evaluated(block, shape, states, X, constants):
    """The result of `block`, samples first: NumPy's is filled in place, that of another package
    gathered from a table. X is empty where no parameter is read.
    """
    xp = _package(*states, *X)
    if xp is not np:
        return _gathered(xp, {}, block, shape, states, X, constants)
    rows, X = _states(*states), [_parameters(_real(x, "X")) for x in X]
    result = np.zeros((*shape, len(rows[0])))
    _filled(block, result, rows, (*X, *_numbers(constants)))
    result = result.transpose(-1, *range(len(shape)))
    return result[0] if np.ndim(states[0]) == 1 else result


def _gathered(xp, table, block, shape, states, X, constants):
    """The result of `block` on a package whose arrays cannot be written to: it fills a `table`."""
    block(xp, *map(xp.rows, states), table, *map(xp.parameters, X), *constants)
    return xp.gathered(table, shape, states[0])


_IN_PLACE = True  # NumPy's arrays are written to; False treats them as those of another package


def _package(*arrays):
    """NumPy for its arrays and for lists; else the functions of the package of all arrays."""
    for x in arrays:
        if type(x) is not np.ndarray:
            break
    else:
        return np if _IN_PLACE else _Arrays(np, arrays)
    if any(type(x).__module__.startswith("casadi") for x in arrays):
        return _Symbols()
    others = [x for x in arrays if hasattr(x, "__dlpack__") or hasattr(x, "__array_namespace__")]
    others = [x for x in others if not isinstance(x, np.ndarray | np.generic)]
    if not others:
        return np if _IN_PLACE else _Arrays(np, arrays)
    try:
        from array_api_compat import array_namespace
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"arrays of {type(others[0]).__module__} need array_api_compat: "
            "pip install array-api-compat"
        ) from error
    try:
        package = array_namespace(*others)
    except TypeError as error:
        packages = " and ".join(sorted({type(x).__module__.partition(".")[0] for x in others}))
        raise TypeError(f"arrays of {packages}; expected states and X of one package") from error
    return _Arrays(package, others)


class _Arrays:
    """Functions of an array package under NumPy's names, those of plain numbers by NumPy; TypeError
    unless all `arrays` are float64, or all float32.
    """

    pi = np.pi

    def __init__(self, package, arrays):
        self.package, kinds = package, [x.dtype for x in arrays if hasattr(x, "dtype")]
        if not any(all(x == kind for x in kinds) for kind in (package.float64, package.float32)):
            kinds = ", ".join(sorted({*map(str, kinds)}))
            raise TypeError(f"arrays of {kinds}; expected all float64, or all float32")

    def __getattr__(self, name):
        function = getattr(self.package, "pow" if name == "power" else name)

        def of(x, *more, **how):
            if isinstance(x, int | float):
                return float(getattr(np, name)(x, *more))
            return function(x, *more, **how)

        return of

    def sign(self, x):
        """NaN where x is; unlike that of some packages it maps (torch.func.vmap)."""
        where = self.package.where
        return where(x > 0.0, 1.0, where(x < 0.0, -1.0, 0.0*x))

    def maximum(self, x, zero):
        return self.package.where(x < zero, zero*x, x)

    def minimum(self, x, zero):
        return self.package.where(x > zero, zero*x, x)

    def rows(self, x):
        """x[..., k], one by one."""
        if self.package is not np and isinstance(x, np.ndarray | list | tuple):
            raise TypeError(
                f"states of {type(x).__name__} beside states or X of {self.package.__name__}; "
                "make the states arrays of that package (X may be NumPy's)"
            )
        if x.shape[-1:] != (7,):
            raise ValueError(f"state of shape {x.shape}; expected (..., 7)")
        return [x[..., k] for k in range(7)]

    def parameters(self, X):
        """X[k], one by one; NumPy's as plain numbers."""
        if self.package is not np and isinstance(X, np.ndarray | list | tuple):
            return _parameters(_real(X, "X")).tolist()
        _parameters(X)
        return [X[k] for k in range(69)]

    def gathered(self, table, shape, like):
        """Entries by index as an array, samples first; zero where there is none."""
        zero = self.package.zeros_like(like[..., 0])
        entries = [table.get(k[0] if len(k) == 1 else k, 0.0) for k in np.ndindex(*shape)]
        entries = [x if getattr(x, "shape", None) == zero.shape else zero + x for x in entries]
        return self.package.reshape(self.package.stack(entries, axis=-1), (*zero.shape, *shape))

    def solve(self, A, b):
        return self.package.linalg.solve(A, b[..., None])[..., 0]


class _Symbols:
    """Functions of CasADi under NumPy's names, on columns."""

    def __init__(self):
        import casadi as ca

        self.package, self.maximum, self.minimum = ca, ca.fmax, ca.fmin

    def rows(self, x, count=7):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 69)

    def __getattr__(self, name):
        return getattr(self.package, name)

    def stack(self, entries):
        return self.package.vertcat(*entries)

    def zeros_like(self, x):
        return self.package.SX(*x.shape)

    def matrix_transpose(self, x):
        return x.T

    def gathered(self, table, shape, like):
        """Entries by index as a matrix, or as matrices; those that are zero stay structural."""
        if len(shape) == 3:
            first = [{k[1:]: x for k, x in table.items() if k[0] == i} for i in range(shape[0])]
            return [self.gathered(entries, shape[1:], like) for entries in first]
        places = [(*np.atleast_1d(place), 0, 0)[:2] for place in table]
        rows, columns = [[int(place[k]) for place in places] for k in range(2)]
        entries = self.package.densify(self.package.vertcat(*table.values()))
        return self.package.SX.triplet(rows, columns, entries, *(*shape, 1, 1)[:2])

    def solve(self, A, b):
        """A = L diag(d) L', L unit lower triangular; A symmetric positive definite."""
        n = len(JOINTS)
        L, d, x = self.package.SX.eye(n), [A[j, j] for j in range(n)], self.rows(b, n)
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
        return self.stack(x)


def casadi(name: str, *, frame: int | None = None) -> "casadi.Function":
    """casadi.Function of a function of this module, or, as NAME_derivatives, of the Jacobians of
    its results by each column that it reads, d<result>_d<column>; `frame` is that of a jacobian.

    Inputs are columns q, qd, qdd, tau (7,), X (69,), standard (98,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (7, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 69, "standard": 98}
    columns = {x: ca.SX.sym(x, sizes.get(x, 7)) for x in columns}
    inputs = columns | {x: ca.SX.sym(x) for x in CONSTANTS}
    given = {} if frame is None else {"frame": frame}
    value = globals()[of](**inputs, **given)
    results = dict(zip(names, value if isinstance(value, list | tuple) else [value]))
    if of != name:
        results = {
            f"d{y}_d{x}": ca.jacobian(results[y], columns[x]) for y in names for x in columns
        }
    default = {"default_in": [*[np.nan]*len(columns), *CONSTANTS.values()]}
    return ca.Function(
        name, [*inputs.values()], [*results.values()], [*inputs], [*results], default
    )


_OUTPUTS = {  # columns, results
    'base_parameters': ('standard', 'X'),
    'regressor': ('q qd qdd', 'D'),
    'inverse_dynamics': ('q qd qdd X', 'GAM'),
    'inertia_matrix': ('q X', 'A'),
    'bias': ('q qd X', 'GAM'),
    'gravity': ('q X', 'GAM'),
    'forward_dynamics': ('q qd tau X', 'qdd'),
    'frame_poses': ('q', 'T1 T2 T3 T4 T5 T6 T7'),
    'jacobian': ('q', 'J'),
}


def elements(
    *, RL1: float = 0.333, RL3: float = 0.316, D4: float = 0.0825, RL5: float = 0.384,
    D7: float = 0.088, g: float = 9.81
) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((RL3, D4, RL5, D7, g))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
        'Ia3': ('inertia', 'both', {3: 1.0}), 'FV3': ('viscous', 'both', {3: 1.0}),
        'FS3': ('coulomb', 'both', {3: 1.0}), 'OFFSET3': ('offset', 'both', {3: 1.0}),
        'Ia4': ('inertia', 'both', {4: 1.0}), 'FV4': ('viscous', 'both', {4: 1.0}),
        'FS4': ('coulomb', 'both', {4: 1.0}), 'OFFSET4': ('offset', 'both', {4: 1.0}),
        'Ia5': ('inertia', 'both', {5: 1.0}), 'FV5': ('viscous', 'both', {5: 1.0}),
        'FS5': ('coulomb', 'both', {5: 1.0}), 'OFFSET5': ('offset', 'both', {5: 1.0}),
        'Ia6': ('inertia', 'both', {6: 1.0}), 'FV6': ('viscous', 'both', {6: 1.0}),
        'FS6': ('coulomb', 'both', {6: 1.0}), 'OFFSET6': ('offset', 'both', {6: 1.0}),
        'Ia7': ('inertia', 'both', {7: 1.0}), 'FV7': ('viscous', 'both', {7: 1.0}),
        'FS7': ('coulomb', 'both', {7: 1.0}), 'OFFSET7': ('offset', 'both', {7: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(
    standard: "Array", *, RL1: float = 0.333, RL3: float = 0.316, D4: float = 0.0825,
    RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """X, shape (69,), from the 98 standard parameters: a mapping by name, or a vector in the
    order of STANDARD_PARAMETERS.
    """
    if hasattr(standard, "keys"):
        rest = [x for x in STANDARD_PARAMETERS if x not in standard and x not in NO_EFFECT]
        if rest:
            raise ValueError(f"standard: no value of {', '.join(rest)}")
        standard = [standard.get(name) for name in STANDARD_PARAMETERS]
        xp = _package(*standard)
    else:
        try:
            shape = tuple(standard.shape if hasattr(standard, "shape") else np.shape(standard))
        except ValueError:  # rows of several lengths
            shape = ()
        if shape[:1] != (98,):
            raise ValueError(
                f"standard of shape {shape}; expected (98,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(98)]
    if xp is np:
        _numbers((RL3, D4, RL5, D7, g))
    (
        _, _, _, _, _, ZZ1, _, _, _, _, Ia1, FV1, FS1, OFFSET1, XX2, XY2, XZ2, YY2, YZ2, ZZ2,
        MX2, MY2, _, _, Ia2, FV2, FS2, OFFSET2, XX3, XY3, XZ3, YY3, YZ3, ZZ3, MX3, MY3, MZ3, M3,
        Ia3, FV3, FS3, OFFSET3, XX4, XY4, XZ4, YY4, YZ4, ZZ4, MX4, MY4, MZ4, M4, Ia4, FV4, FS4,
        OFFSET4, XX5, XY5, XZ5, YY5, YZ5, ZZ5, MX5, MY5, MZ5, M5, Ia5, FV5, FS5, OFFSET5, XX6,
        XY6, XZ6, YY6, YZ6, ZZ6, MX6, MY6, MZ6, M6, Ia6, FV6, FS6, OFFSET6, XX7, XY7, XZ7, YY7,
        YZ7, ZZ7, MX7, MY7, MZ7, M7, Ia7, FV7, FS7, OFFSET7
    ) = standard
    ZZ1R = ZZ1 + Ia1 + YY2
    XX2R = XX2 - YY2 + YY3 + 2*RL3*MZ3 + RL3**2*M3 + (D4**2 + RL3**2)*(M4 + M5 + M6 + M7)
    ZZ2R = ZZ2 + Ia2 + YY3 + 2*RL3*MZ3 + RL3**2*M3 + (D4**2 + RL3**2)*(M4 + M5 + M6 + M7)
    MY2R = MY2 - MZ3 - RL3*(M3 + M4 + M5 + M6 + M7)
    XX3R = XX3 - YY3 + YY4 - D4**2*M4
    XY3R = XY3 + D4*MZ4
    ZZ3R = ZZ3 + YY4 + D4**2*M4 + 2*D4**2*(M5 + M6 + M7)
    MX3R = MX3 + D4*(M4 + M5 + M6 + M7)
    MY3R = MY3 - MZ4
    XX4R = XX4 - YY4 + YY5 + 2*RL5*MZ5 + (-D4**2 + RL5**2)*(M5 + M6 + M7)
    XY4R = XY4 + D4*MZ5 + D4*RL5*(M5 + M6 + M7)
    ZZ4R = ZZ4 + YY5 + 2*RL5*MZ5 + (D4**2 + RL5**2)*(M5 + M6 + M7)
    MX4R = MX4 - D4*(M5 + M6 + M7)
    MY4R = MY4 + MZ5 + RL5*(M5 + M6 + M7)
    XX5R = XX5 - YY5 + YY6 + D7**2*M7
    ZZ5R = ZZ5 + YY6 + D7**2*M7
    MY5R = MY5 - MZ6
    XX6R = XX6 - YY6 + YY7 - D7**2*M7
    XY6R = XY6 + D7*MZ7
    ZZ6R = ZZ6 + YY7 + D7**2*M7
    MX6R = MX6 + D7*M7
    MY6R = MY6 - MZ7
    XX7R = XX7 - YY7
    return (np.array if xp is np else xp.stack)([
        ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2, XZ2, YZ2, ZZ2R, MX2, MY2R, FV2, FS2, OFFSET2, XX3R,
        XY3R, XZ3, YZ3, ZZ3R, MX3R, MY3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4R, XZ4, YZ4, ZZ4R, MX4R,
        MY4R, Ia4, FV4, FS4, OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5, OFFSET5,
        XX6R, XY6R, XZ6, YZ6, ZZ6R, MX6R, MY6R, Ia6, FV6, FS6, OFFSET6, XX7R, XY7, XZ7, YZ7, ZZ7,
        MX7, MY7, Ia7, FV7, FS7, OFFSET7,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, RL1: float = 0.333,
    RL3: float = 0.316, D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088,
    g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 7, 69).

    A view on one store of shape (69, 7, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (RL3, D4, RL5, D7, g))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, RL1: float = 0.333,
    RL3: float = 0.316, D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088,
    g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (7*N, 69), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (RL3, D4, RL5, D7, g))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 69))
    return filled.reshape(69, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 7, 69)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (69, 7), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (69, 7, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(69, 7, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, RL1: float = 0.333,
    RL3: float = 0.316, D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088,
    g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 7).
    """
    return _evaluated(_inverse_dynamics_block, (7,), (q, qd, qdd), (X,), (RL3, D4, RL5, D7, g))


def inertia_matrix(
    q: "Array", X: "Array", *, RL1: float = 0.333, RL3: float = 0.316, D4: float = 0.0825,
    RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 7, 7).
    """
    return _evaluated(_inertia_matrix_block, (7, 7), (q,), (X,), (RL3, D4, RL5, D7))


def bias(
    q: "Array", qd: "Array", X: "Array", *, RL1: float = 0.333, RL3: float = 0.316,
    D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 7).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, RL1=RL1, RL3=RL3, D4=D4, RL5=RL5, D7=D7, g=g)


def gravity(
    q: "Array", X: "Array", *, RL1: float = 0.333, RL3: float = 0.316, D4: float = 0.0825,
    RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 7).
    """
    return _evaluated(_gravity_block, (7,), (q,), (X,), (g,))


def frame_poses(
    q: "Array", *, RL1: float = 0.333, RL3: float = 0.316, D4: float = 0.0825,
    RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 7, 4, 4).
    """
    return _evaluated(_frame_poses_block, (7, 4, 4), (q,), (), (RL1, RL3, D4, RL5, D7))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, RL1: float = 0.333,
    RL3: float = 0.316, D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088,
    g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 7)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, RL1=RL1, RL3=RL3, D4=D4, RL5=RL5,
        D7=D7, g=g)
    inertia = inertia_matrix(q, X, RL1=RL1, RL3=RL3, D4=D4, RL5=RL5, D7=D7, g=g)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, RL1: float = 0.333, RL3: float = 0.316,
    D4: float = 0.0825, RL5: float = 0.384, D7: float = 0.088, g: float = 9.81
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 7).
    """
    frame = 7 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 7:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 7")
    return _evaluated(_jacobian_block, (6, 7), (q,), (), (frame, RL1, RL3, D4, RL5, D7))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 7, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(7, 4, 4), 0.0)
    _frame_poses_block(xp, q, T, *constants[:5])
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
    for place, value in columns.items():
        J[place] = value


def _moving(xp):
    """{frame: (antecedent, sigma, ((column, rate), ...))}: how the joints in the columns move the
    joint of each frame.
    """
    return {
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((1, 1.0),)), 3: (2, 0, ((2, 1.0),)),
        4: (3, 0, ((3, 1.0),)), 5: (4, 0, ((4, 1.0),)), 6: (5, 0, ((5, 1.0),)),
        7: (6, 0, ((6, 1.0),)),
    }


def _regressor_block(xp, q, qd, qdd, D, RL3, D4, RL5, D7, g):
    """Fill D, shape (69, 7, N), where it is not constant, from q, qd, qdd (7, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, RL3, D4, RL5, D7, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, RL3, D4, RL5, D7, g):
    """Fill GAM, shape (7, N), from q, qd, qdd (7, N)."""
    _, _torques = _motion(xp, q, qd, qdd, RL3, D4, RL5, D7, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, RL3, D4, RL5, D7, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q2, q3, q4, q5, q6, q7 = q[1:]
    QP1, QP2, QP3, QP4, QP5, QP6, QP7 = qd
    QDP1, QDP2, QDP3, QDP4, QDP5, QDP6, QDP7 = qdd
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    # Link 2
    W12 = -S2*QP1
    W22 = -C2*QP1
    S2QDP1 = S2*QDP1
    C2QDP1 = C2*QDP1
    DV232 = QP2*W22
    WP12 = DV232 - S2QDP1
    DV132 = QP2*W12
    WP22 = -C2QDP1 - DV132
    DV112 = W12**2
    DV122 = W12*W22
    DV222 = W22**2
    DV332 = QP2**2
    DW232 = DV222 - DV332
    DW312 = DV332 - DV112
    DW122 = DV112 - DV222
    U122 = DV122 - QDP2
    U212 = QDP2 + DV122
    U222 = -DV112 - DV332
    U312 = DV132 - WP22
    U322 = DV232 + WP12
    VP12 = -g*S2
    VP22 = -g*C2
    # Link 3
    W13 = C3*W12 + S3*QP2
    W23 = C3*QP2 - S3*W12
    W33 = QP3 - W22
    WP13 = C3*WP12 + S3*QDP2 + QP3*W23
    WP23 = C3*QDP2 - S3*WP12 - QP3*W13
    WP33 = QDP3 - WP22
    DV113 = W13**2
    DV123 = W13*W23
    DV133 = W13*W33
    DV223 = W23**2
    DV233 = W23*W33
    DV333 = W33**2
    DW233 = DV223 - DV333
    DW313 = DV333 - DV113
    DW123 = DV113 - DV223
    U113 = -DV223 - DV333
    U123 = DV123 - WP33
    U133 = WP23 + DV133
    U213 = WP33 + DV123
    U223 = -DV113 - DV333
    U233 = DV233 - WP13
    U313 = DV133 - WP23
    U323 = WP13 + DV233
    VSP33 = -RL3*U322
    VSP13 = VP12 - RL3*U122
    VSP23 = VP22 - RL3*U222
    VP13 = C3*VSP13 + S3*VSP33
    VP23 = C3*VSP33 - S3*VSP13
    # Link 4
    W14 = C4*W13 + S4*W33
    W24 = C4*W33 - S4*W13
    W34 = QP4 - W23
    WP14 = C4*WP13 + S4*WP33 + QP4*W24
    WP24 = C4*WP33 - S4*WP13 - QP4*W14
    WP34 = QDP4 - WP23
    DV114 = W14**2
    DV124 = W14*W24
    DV134 = W14*W34
    DV224 = W24**2
    DV234 = W24*W34
    DV334 = W34**2
    DW234 = DV224 - DV334
    DW314 = DV334 - DV114
    DW124 = DV114 - DV224
    U114 = -DV224 - DV334
    U124 = DV124 - WP34
    U134 = WP24 + DV134
    U214 = WP34 + DV124
    U224 = -DV114 - DV334
    U234 = DV234 - WP14
    U314 = DV134 - WP24
    U324 = WP14 + DV234
    VSP14 = VP13 + D4*U113
    VSP24 = VP23 + D4*U213
    VSP34 = D4*U313 - VSP23
    VP14 = C4*VSP14 + S4*VSP34
    VP24 = C4*VSP34 - S4*VSP14
    # Link 5
    W15 = C5*W14 - S5*W34
    W25 = -C5*W34 - S5*W14
    W35 = QP5 + W24
    WP15 = C5*WP14 + QP5*W25 - S5*WP34
    WP25 = -C5*WP34 - S5*WP14 - QP5*W15
    WP35 = QDP5 + WP24
    DV115 = W15**2
    DV125 = W15*W25
    DV135 = W15*W35
    DV225 = W25**2
    DV235 = W25*W35
    DV335 = W35**2
    DW235 = DV225 - DV335
    DW315 = DV335 - DV115
    DW125 = DV115 - DV225
    U115 = -DV225 - DV335
    U125 = DV125 - WP35
    U135 = WP25 + DV135
    U215 = WP35 + DV125
    U225 = -DV115 - DV335
    U235 = DV235 - WP15
    U315 = DV135 - WP25
    U325 = WP15 + DV235
    DF3MX4 = -D4*U314
    VSP15 = VP14 + RL5*U124 - D4*U114
    VSP25 = VP24 + RL5*U224 - D4*U214
    VSP35 = DF3MX4 + RL5*U324 - VSP24
    VP15 = C5*VSP15 - S5*VSP35
    VP25 = -C5*VSP35 - S5*VSP15
    # Link 6
    W16 = C6*W15 + S6*W35
    W26 = C6*W35 - S6*W15
    W36 = QP6 - W25
    WP16 = C6*WP15 + S6*WP35 + QP6*W26
    WP26 = C6*WP35 - S6*WP15 - QP6*W16
    WP36 = QDP6 - WP25
    DV116 = W16**2
    DV126 = W16*W26
    DV136 = W16*W36
    DV226 = W26**2
    DV236 = W26*W36
    DV336 = W36**2
    DW236 = DV226 - DV336
    DW316 = DV336 - DV116
    DW126 = DV116 - DV226
    U116 = -DV226 - DV336
    U126 = DV126 - WP36
    U136 = WP26 + DV136
    U216 = WP36 + DV126
    U226 = -DV116 - DV336
    U236 = DV236 - WP16
    U316 = DV136 - WP26
    U326 = WP16 + DV236
    VP16 = C6*VP15 + S6*VSP25
    VP26 = C6*VSP25 - S6*VP15
    # Link 7
    W17 = C7*W16 + S7*W36
    W27 = C7*W36 - S7*W16
    W37 = QP7 - W26
    WP17 = C7*WP16 + S7*WP36 + QP7*W27
    WP27 = C7*WP36 - S7*WP16 - QP7*W17
    WP37 = QDP7 - WP26
    DV117 = W17**2
    DV127 = W17*W27
    DV137 = W17*W37
    DV227 = W27**2
    DV237 = W27*W37
    DV337 = W37**2
    DW237 = DV227 - DV337
    DW317 = DV337 - DV117
    DW127 = DV117 - DV227
    U117 = -DV227 - DV337
    U127 = DV127 - WP37
    U137 = WP27 + DV137
    U217 = WP37 + DV127
    U227 = -DV117 - DV337
    U237 = DV237 - WP17
    U317 = DV137 - WP27
    U327 = WP17 + DV237
    VSP17 = VP16 + D7*U116
    VSP27 = VP26 + D7*U216
    VSP37 = D7*U316 - VP25
    VP17 = C7*VSP17 + S7*VSP37
    VP27 = C7*VSP37 - S7*VSP17
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP3 = xp.sign(QP3)
    signQP4 = xp.sign(QP4)
    signQP5 = xp.sign(QP5)
    signQP6 = xp.sign(QP6)
    signQP7 = xp.sign(QP7)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 3
        Z131 = -S2*C3
        Z231 = S2*S3
        VS331 = RL3*S2
        V131 = S3*VS331
        V231 = C3*VS331
        V132 = RL3*C3
        V232 = -RL3*S3
        # Joint axes Z and velocities V seen from link 4
        Z141 = C4*Z131 + C2*S4
        Z241 = C2*C4 - S4*Z131
        VS341 = -D4*Z231
        V341 = -V231 - D4*C2
        V141 = C4*V131 + S4*VS341
        V241 = C4*VS341 - S4*V131
        Z142 = S3*C4
        Z242 = -S3*S4
        VS342 = -D4*C3
        V142 = C4*V132 + S4*VS342
        V242 = C4*VS342 - S4*V132
        # Joint axes Z and velocities V seen from link 5
        Z151 = C5*Z141 + S5*Z231
        Z251 = C5*Z231 - S5*Z141
        VS151 = V141 + RL5*Z231
        V351 = V241 - VS341
        VS351 = V341 + RL5*Z141 + D4*Z241
        V151 = C5*VS151 - S5*VS351
        V251 = -C5*VS351 - S5*VS151
        Z152 = C5*Z142 + C3*S5
        Z252 = C3*C5 - S5*Z142
        VS152 = V142 + RL5*C3
        V352 = V242 - VS342
        VS352 = RL5*Z142 + D4*Z242 - V232
        V152 = C5*VS152 - S5*VS352
        V252 = -C5*VS352 - S5*VS152
        Z153 = S4*C5
        Z253 = -S4*S5
        VS353 = RL5*S4 + D4*C4 - D4
        V153 = -S5*VS353
        V253 = -C5*VS353
        V154 = -RL5*C5
        V254 = RL5*S5
        # Joint axes Z and velocities V seen from link 6
        Z161 = C6*Z151 + S6*Z241
        Z261 = C6*Z241 - S6*Z151
        V161 = C6*V151 + S6*V351
        V261 = C6*V351 - S6*V151
        Z162 = C6*Z152 + S6*Z242
        Z262 = C6*Z242 - S6*Z152
        V162 = C6*V152 + S6*V352
        V262 = C6*V352 - S6*V152
        Z163 = C6*Z153 + C4*S6
        Z263 = C4*C6 - S6*Z153
        V163 = C6*V153
        V263 = -S6*V153
        Z164 = -S5*C6
        Z264 = S5*S6
        V164 = C6*V154 - D4*S6
        V264 = -D4*C6 - S6*V154
        # Joint axes Z and velocities V seen from link 7
        Z171 = C7*Z161 - S7*Z251
        Z271 = -C7*Z251 - S7*Z161
        V371 = D7*Z251 - V261
        VS371 = -V251 - D7*Z261
        V171 = C7*V161 + S7*VS371
        V271 = C7*VS371 - S7*V161
        Z172 = C7*Z162 - S7*Z252
        Z272 = -C7*Z252 - S7*Z162
        V372 = D7*Z252 - V262
        VS372 = -V252 - D7*Z262
        V172 = C7*V162 + S7*VS372
        V272 = C7*VS372 - S7*V162
        Z173 = C7*Z163 - S7*Z253
        Z273 = -C7*Z253 - S7*Z163
        V373 = D7*Z253 - V263
        VS373 = -V253 - D7*Z263
        V173 = C7*V163 + S7*VS373
        V273 = C7*VS373 - S7*V163
        Z174 = C7*Z164 + C5*S7
        Z274 = C5*C7 - S7*Z164
        V374 = -V264 - D7*C5
        VS374 = -V254 - D7*Z264
        V174 = C7*V164 + S7*VS374
        V274 = C7*VS374 - S7*V164
        Z175 = S6*C7
        Z275 = -S6*S7
        VS375 = -D7*C6
        V175 = S7*VS375
        V275 = C7*VS375
        # Contributions that several joints share
        DV133Z231 = DV133*Z231
        C3DV133 = C3*DV133
        DV134Z241 = DV134*Z241
        DV134Z242 = DV134*Z242
        C4DV134 = C4*DV134
        DV135Z251 = DV135*Z251
        DV135Z252 = DV135*Z252
        DV135Z253 = DV135*Z253
        C5DV135 = C5*DV135
        DV136Z261 = DV136*Z261
        DV136Z262 = DV136*Z262
        DV136Z263 = DV136*Z263
        DV136Z264 = DV136*Z264
        C6DV136 = C6*DV136
        DV137Z271 = DV137*Z271
        DV137Z272 = DV137*Z272
        DV137Z273 = DV137*Z273
        DV137Z274 = DV137*Z274
        DV137Z275 = DV137*Z275
        C7DV137 = C7*DV137
        # Joint 1
        D[0, 0] = QDP1                                                    # DG1ZZ1
        D[1, 0] = QP1                                                     # DG1FV1
        D[2, 0] = signQP1                                                 # DG1FS1
        D[4, 0] = -S2*WP12 - C2*DV132                                     # DG1XX2
        D[5, 0] = S2*U312 - C2*U322                                       # DG1XY2
        D[6, 0] = -S2*U212 - C2*DW312                                     # DG1XZ2
        D[7, 0] = C2*U122 - S2*DW232                                      # DG1YZ2
        D[14, 0] = WP13*Z131 + DV133Z231 - C2*DV123                       # DG1XX3
        D[15, 0] = U323*Z231 + C2*DW123 - U313*Z131                       # DG1XY3
        D[16, 0] = U213*Z131 + DW313*Z231 - C2*U233                       # DG1XZ3
        D[17, 0] = DW233*Z131 + C2*U133 - U123*Z231                       # DG1YZ3
        D[18, 0] = DV233*Z131 + C2*WP33 - DV133Z231                       # DG1ZZ3
        D[19, 0] = VSP23*Z231 + C2*VP23 + U113*V131 + U213*V231           # DG1MX3
        D[20, 0] = U123*V131 + U223*V231 - VSP23*Z131 - C2*VP13           # DG1MY3
        D[25, 0] = WP14*Z141 + DV134Z241 + DV124*Z231                     # DG1XX4
        D[26, 0] = U324*Z241 - U314*Z141 - DW124*Z231                     # DG1XY4
        D[27, 0] = U214*Z141 + DW314*Z241 + U234*Z231                     # DG1XZ4
        D[28, 0] = DW234*Z141 - U124*Z241 - U134*Z231                     # DG1YZ4
        D[29, 0] = DV234*Z141 - DV134Z241 - WP34*Z231                     # DG1ZZ4
        D[30, 0] = VSP24*Z241 + U114*V141 + U214*V241 + U314*V341 - VP24*Z231  # DG1MX4
        D[31, 0] = VP14*Z231 + U124*V141 + U224*V241 + U324*V341 - VSP24*Z141  # DG1MY4
        D[36, 0] = WP15*Z151 + DV135Z251 - DV125*Z241                     # DG1XX5
        D[37, 0] = U325*Z251 + DW125*Z241 - U315*Z151                     # DG1XY5
        D[38, 0] = U215*Z151 + DW315*Z251 - U235*Z241                     # DG1XZ5
        D[39, 0] = DW235*Z151 + U135*Z241 - U125*Z251                     # DG1YZ5
        D[40, 0] = DV235*Z151 + WP35*Z241 - DV135Z251                     # DG1ZZ5
        D[41, 0] = VP25*Z241 + U115*V151 + U215*V251 + U315*V351 - VSP25*Z251  # DG1MX5
        D[42, 0] = VSP25*Z151 + U125*V151 + U225*V251 + U325*V351 - VP15*Z241  # DG1MY5
        D[47, 0] = WP16*Z161 + DV136Z261 + DV126*Z251                     # DG1XX6
        D[48, 0] = U326*Z261 - U316*Z161 - DW126*Z251                     # DG1XY6
        D[49, 0] = U216*Z161 + DW316*Z261 + U236*Z251                     # DG1XZ6
        D[50, 0] = DW236*Z161 - U126*Z261 - U136*Z251                     # DG1YZ6
        D[51, 0] = DV236*Z161 - DV136Z261 - WP36*Z251                     # DG1ZZ6
        D[52, 0] = VP25*Z261 + U116*V161 + U216*V261 - VP26*Z251 - U316*V251  # DG1MX6
        D[53, 0] = VP16*Z251 + U126*V161 + U226*V261 - VP25*Z161 - U326*V251  # DG1MY6
        D[58, 0] = WP17*Z171 + DV137Z271 + DV127*Z261                     # DG1XX7
        D[59, 0] = U327*Z271 - U317*Z171 - DW127*Z261                     # DG1XY7
        D[60, 0] = U217*Z171 + DW317*Z271 + U237*Z261                     # DG1XZ7
        D[61, 0] = DW237*Z171 - U127*Z271 - U137*Z261                     # DG1YZ7
        D[62, 0] = DV237*Z171 - DV137Z271 - WP37*Z261                     # DG1ZZ7
        D[63, 0] = VSP27*Z271 + U117*V171 + U217*V271 + U317*V371 - VP27*Z261  # DG1MX7
        D[64, 0] = VP17*Z261 + U127*V171 + U227*V271 + U327*V371 - VSP27*Z171  # DG1MY7
        # Joint 2
        D[4, 1] = -DV122                                                  # DG2XX2
        D[5, 1] = DW122                                                   # DG2XY2
        D[6, 1] = -S2QDP1                                                 # DG2XZ2
        D[7, 1] = -C2QDP1                                                 # DG2YZ2
        D[8, 1] = QDP2                                                    # DG2ZZ2
        D[9, 1] = VP22                                                    # DG2MX2
        D[10, 1] = -VP12                                                  # DG2MY2
        D[11, 1] = QP2                                                    # DG2FV2
        D[12, 1] = signQP2                                                # DG2FS2
        D[14, 1] = S3*WP13 + C3DV133                                      # DG2XX3
        D[15, 1] = C3*U323 - S3*U313                                      # DG2XY3
        D[16, 1] = S3*U213 + C3*DW313                                     # DG2XZ3
        D[17, 1] = S3*DW233 - C3*U123                                     # DG2YZ3
        D[18, 1] = S3*DV233 - C3DV133                                     # DG2ZZ3
        D[19, 1] = C3*VSP23 + U113*V132 + U213*V232                       # DG2MX3
        D[20, 1] = U123*V132 + U223*V232 - S3*VSP23                       # DG2MY3
        D[25, 1] = WP14*Z142 + DV134Z242 + C3*DV124                       # DG2XX4
        D[26, 1] = U324*Z242 - U314*Z142 - C3*DW124                       # DG2XY4
        D[27, 1] = U214*Z142 + DW314*Z242 + C3*U234                       # DG2XZ4
        D[28, 1] = DW234*Z142 - U124*Z242 - C3*U134                       # DG2YZ4
        D[29, 1] = DV234*Z142 - DV134Z242 - C3*WP34                       # DG2ZZ4
        D[30, 1] = VSP24*Z242 + U114*V142 + U214*V242 - C3*VP24 - U314*V232  # DG2MX4
        D[31, 1] = C3*VP14 + U124*V142 + U224*V242 - VSP24*Z142 - U324*V232  # DG2MY4
        D[36, 1] = WP15*Z152 + DV135Z252 - DV125*Z242                     # DG2XX5
        D[37, 1] = U325*Z252 + DW125*Z242 - U315*Z152                     # DG2XY5
        D[38, 1] = U215*Z152 + DW315*Z252 - U235*Z242                     # DG2XZ5
        D[39, 1] = DW235*Z152 + U135*Z242 - U125*Z252                     # DG2YZ5
        D[40, 1] = DV235*Z152 + WP35*Z242 - DV135Z252                     # DG2ZZ5
        D[41, 1] = VP25*Z242 + U115*V152 + U215*V252 + U315*V352 - VSP25*Z252  # DG2MX5
        D[42, 1] = VSP25*Z152 + U125*V152 + U225*V252 + U325*V352 - VP15*Z242  # DG2MY5
        D[47, 1] = WP16*Z162 + DV136Z262 + DV126*Z252                     # DG2XX6
        D[48, 1] = U326*Z262 - U316*Z162 - DW126*Z252                     # DG2XY6
        D[49, 1] = U216*Z162 + DW316*Z262 + U236*Z252                     # DG2XZ6
        D[50, 1] = DW236*Z162 - U126*Z262 - U136*Z252                     # DG2YZ6
        D[51, 1] = DV236*Z162 - DV136Z262 - WP36*Z252                     # DG2ZZ6
        D[52, 1] = VP25*Z262 + U116*V162 + U216*V262 - VP26*Z252 - U316*V252  # DG2MX6
        D[53, 1] = VP16*Z252 + U126*V162 + U226*V262 - VP25*Z162 - U326*V252  # DG2MY6
        D[58, 1] = WP17*Z172 + DV137Z272 + DV127*Z262                     # DG2XX7
        D[59, 1] = U327*Z272 - U317*Z172 - DW127*Z262                     # DG2XY7
        D[60, 1] = U217*Z172 + DW317*Z272 + U237*Z262                     # DG2XZ7
        D[61, 1] = DW237*Z172 - U127*Z272 - U137*Z262                     # DG2YZ7
        D[62, 1] = DV237*Z172 - DV137Z272 - WP37*Z262                     # DG2ZZ7
        D[63, 1] = VSP27*Z272 + U117*V172 + U217*V272 + U317*V372 - VP27*Z262  # DG2MX7
        D[64, 1] = VP17*Z262 + U127*V172 + U227*V272 + U327*V372 - VSP27*Z172  # DG2MY7
        # Joint 3
        D[14, 2] = -DV123                                                 # DG3XX3
        D[15, 2] = DW123                                                  # DG3XY3
        D[16, 2] = -U233                                                  # DG3XZ3
        D[17, 2] = U133                                                   # DG3YZ3
        D[18, 2] = WP33                                                   # DG3ZZ3
        D[19, 2] = VP23                                                   # DG3MX3
        D[20, 2] = -VP13                                                  # DG3MY3
        D[21, 2] = QDP3                                                   # DG3Ia3
        D[22, 2] = QP3                                                    # DG3FV3
        D[23, 2] = signQP3                                                # DG3FS3
        D[25, 2] = S4*WP14 + C4DV134                                      # DG3XX4
        D[26, 2] = C4*U324 - S4*U314                                      # DG3XY4
        D[27, 2] = S4*U214 + C4*DW314                                     # DG3XZ4
        D[28, 2] = S4*DW234 - C4*U124                                     # DG3YZ4
        D[29, 2] = S4*DV234 - C4DV134                                     # DG3ZZ4
        D[30, 2] = DF3MX4 + C4*VSP24                                      # DG3MX4
        D[31, 2] = -S4*VSP24 - D4*U324                                    # DG3MY4
        D[36, 2] = WP15*Z153 + DV135Z253 - C4*DV125                       # DG3XX5
        D[37, 2] = U325*Z253 + C4*DW125 - U315*Z153                       # DG3XY5
        D[38, 2] = U215*Z153 + DW315*Z253 - C4*U235                       # DG3XZ5
        D[39, 2] = DW235*Z153 + C4*U135 - U125*Z253                       # DG3YZ5
        D[40, 2] = DV235*Z153 + C4*WP35 - DV135Z253                       # DG3ZZ5
        D[41, 2] = C4*VP25 + U115*V153 + U215*V253 - VSP25*Z253           # DG3MX5
        D[42, 2] = VSP25*Z153 + U125*V153 + U225*V253 - C4*VP15           # DG3MY5
        D[47, 2] = WP16*Z163 + DV136Z263 + DV126*Z253                     # DG3XX6
        D[48, 2] = U326*Z263 - U316*Z163 - DW126*Z253                     # DG3XY6
        D[49, 2] = U216*Z163 + DW316*Z263 + U236*Z253                     # DG3XZ6
        D[50, 2] = DW236*Z163 - U126*Z263 - U136*Z253                     # DG3YZ6
        D[51, 2] = DV236*Z163 - DV136Z263 - WP36*Z253                     # DG3ZZ6
        D[52, 2] = VP25*Z263 + U116*V163 + U216*V263 - VP26*Z253 - U316*V253  # DG3MX6
        D[53, 2] = VP16*Z253 + U126*V163 + U226*V263 - VP25*Z163 - U326*V253  # DG3MY6
        D[58, 2] = WP17*Z173 + DV137Z273 + DV127*Z263                     # DG3XX7
        D[59, 2] = U327*Z273 - U317*Z173 - DW127*Z263                     # DG3XY7
        D[60, 2] = U217*Z173 + DW317*Z273 + U237*Z263                     # DG3XZ7
        D[61, 2] = DW237*Z173 - U127*Z273 - U137*Z263                     # DG3YZ7
        D[62, 2] = DV237*Z173 - DV137Z273 - WP37*Z263                     # DG3ZZ7
        D[63, 2] = VSP27*Z273 + U117*V173 + U217*V273 + U317*V373 - VP27*Z263  # DG3MX7
        D[64, 2] = VP17*Z263 + U127*V173 + U227*V273 + U327*V373 - VSP27*Z173  # DG3MY7
        # Joint 4
        D[25, 3] = -DV124                                                 # DG4XX4
        D[26, 3] = DW124                                                  # DG4XY4
        D[27, 3] = -U234                                                  # DG4XZ4
        D[28, 3] = U134                                                   # DG4YZ4
        D[29, 3] = WP34                                                   # DG4ZZ4
        D[30, 3] = VP24                                                   # DG4MX4
        D[31, 3] = -VP14                                                  # DG4MY4
        D[32, 3] = QDP4                                                   # DG4Ia4
        D[33, 3] = QP4                                                    # DG4FV4
        D[34, 3] = signQP4                                                # DG4FS4
        D[36, 3] = -S5*WP15 - C5DV135                                     # DG4XX5
        D[37, 3] = S5*U315 - C5*U325                                      # DG4XY5
        D[38, 3] = -S5*U215 - C5*DW315                                    # DG4XZ5
        D[39, 3] = C5*U125 - S5*DW235                                     # DG4YZ5
        D[40, 3] = C5DV135 - S5*DV235                                     # DG4ZZ5
        D[41, 3] = C5*VSP25 + U115*V154 + U215*V254 - D4*U315             # DG4MX5
        D[42, 3] = U125*V154 + U225*V254 - S5*VSP25 - D4*U325             # DG4MY5
        D[47, 3] = WP16*Z164 + DV136Z264 - C5*DV126                       # DG4XX6
        D[48, 3] = U326*Z264 + C5*DW126 - U316*Z164                       # DG4XY6
        D[49, 3] = U216*Z164 + DW316*Z264 - C5*U236                       # DG4XZ6
        D[50, 3] = DW236*Z164 + C5*U136 - U126*Z264                       # DG4YZ6
        D[51, 3] = DV236*Z164 + C5*WP36 - DV136Z264                       # DG4ZZ6
        D[52, 3] = VP25*Z264 + C5*VP26 + U116*V164 + U216*V264 - U316*V254  # DG4MX6
        D[53, 3] = U126*V164 + U226*V264 - VP25*Z164 - C5*VP16 - U326*V254  # DG4MY6
        D[58, 3] = WP17*Z174 + DV137Z274 + DV127*Z264                     # DG4XX7
        D[59, 3] = U327*Z274 - U317*Z174 - DW127*Z264                     # DG4XY7
        D[60, 3] = U217*Z174 + DW317*Z274 + U237*Z264                     # DG4XZ7
        D[61, 3] = DW237*Z174 - U127*Z274 - U137*Z264                     # DG4YZ7
        D[62, 3] = DV237*Z174 - DV137Z274 - WP37*Z264                     # DG4ZZ7
        D[63, 3] = VSP27*Z274 + U117*V174 + U217*V274 + U317*V374 - VP27*Z264  # DG4MX7
        D[64, 3] = VP17*Z264 + U127*V174 + U227*V274 + U327*V374 - VSP27*Z174  # DG4MY7
        # Joint 5
        D[36, 4] = -DV125                                        # DG5XX5
        D[37, 4] = DW125                                         # DG5XY5
        D[38, 4] = -U235                                         # DG5XZ5
        D[39, 4] = U135                                          # DG5YZ5
        D[40, 4] = WP35                                          # DG5ZZ5
        D[41, 4] = VP25                                          # DG5MX5
        D[42, 4] = -VP15                                         # DG5MY5
        D[43, 4] = QDP5                                          # DG5Ia5
        D[44, 4] = QP5                                           # DG5FV5
        D[45, 4] = signQP5                                       # DG5FS5
        D[47, 4] = S6*WP16 + C6DV136                             # DG5XX6
        D[48, 4] = C6*U326 - S6*U316                             # DG5XY6
        D[49, 4] = S6*U216 + C6*DW316                            # DG5XZ6
        D[50, 4] = S6*DW236 - C6*U126                            # DG5YZ6
        D[51, 4] = S6*DV236 - C6DV136                            # DG5ZZ6
        D[52, 4] = C6*VP25                                       # DG5MX6
        D[53, 4] = -S6*VP25                                      # DG5MY6
        D[58, 4] = WP17*Z175 + DV137Z275 + C6*DV127              # DG5XX7
        D[59, 4] = U327*Z275 - U317*Z175 - C6*DW127              # DG5XY7
        D[60, 4] = U217*Z175 + DW317*Z275 + C6*U237              # DG5XZ7
        D[61, 4] = DW237*Z175 - U127*Z275 - C6*U137              # DG5YZ7
        D[62, 4] = DV237*Z175 - DV137Z275 - C6*WP37              # DG5ZZ7
        D[63, 4] = VSP27*Z275 + U117*V175 + U217*V275 - C6*VP27  # DG5MX7
        D[64, 4] = C6*VP17 + U127*V175 + U227*V275 - VSP27*Z175  # DG5MY7
        # Joint 6
        D[47, 5] = -DV126               # DG6XX6
        D[48, 5] = DW126                # DG6XY6
        D[49, 5] = -U236                # DG6XZ6
        D[50, 5] = U136                 # DG6YZ6
        D[51, 5] = WP36                 # DG6ZZ6
        D[52, 5] = VP26                 # DG6MX6
        D[53, 5] = -VP16                # DG6MY6
        D[54, 5] = QDP6                 # DG6Ia6
        D[55, 5] = QP6                  # DG6FV6
        D[56, 5] = signQP6              # DG6FS6
        D[58, 5] = S7*WP17 + C7DV137    # DG6XX7
        D[59, 5] = C7*U327 - S7*U317    # DG6XY7
        D[60, 5] = S7*U217 + C7*DW317   # DG6XZ7
        D[61, 5] = S7*DW237 - C7*U127   # DG6YZ7
        D[62, 5] = S7*DV237 - C7DV137   # DG6ZZ7
        D[63, 5] = C7*VSP27 - D7*U317   # DG6MX7
        D[64, 5] = -S7*VSP27 - D7*U327  # DG6MY7
        # Joint 7
        D[58, 6] = -DV127   # DG7XX7
        D[59, 6] = DW127    # DG7XY7
        D[60, 6] = -U237    # DG7XZ7
        D[61, 6] = U137     # DG7YZ7
        D[62, 6] = WP37     # DG7ZZ7
        D[63, 6] = VP27     # DG7MX7
        D[64, 6] = -VP17    # DG7MY7
        D[65, 6] = QDP7     # DG7Ia7
        D[66, 6] = QP7      # DG7FV7
        D[67, 6] = signQP7  # DG7FS7

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2, XZ2, YZ2, ZZ2R, MX2, MY2R, FV2, FS2, OFFSET2, XX3R,
            XY3R, XZ3, YZ3, ZZ3R, MX3R, MY3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4R, XZ4, YZ4, ZZ4R,
            MX4R, MY4R, Ia4, FV4, FS4, OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5,
            OFFSET5, XX6R, XY6R, XZ6, YZ6, ZZ6R, MX6R, MY6R, Ia6, FV6, FS6, OFFSET6, XX7R, XY7, XZ7,
            YZ7, ZZ7, MX7, MY7, Ia7, FV7, FS7, OFFSET7
        ) = X
        # Joint 7
        F17 = MX7*U117 + MY7*U127
        F27 = MX7*U217 + MY7*U227
        F37 = MX7*U317 + MY7*U327
        N17 = XX7R*WP17 + ZZ7*DV237 + YZ7*DW237 + XZ7*U217 - XY7*U317 - MY7*VSP27
        N27 = (XX7R - ZZ7)*DV137 + XZ7*DW317 + XY7*U327 + MX7*VSP27 - YZ7*U127
        N37 = ZZ7*WP37 + XY7*DW127 + YZ7*U137 + MX7*VP27 - XX7R*DV127 - XZ7*U237 - MY7*VP17
        FDI17 = C7*F17 - S7*F27
        FDI37 = S7*F17 + C7*F27
        # Joint 6
        F16 = MX6R*U116 + MY6R*U126
        F26 = MX6R*U216 + MY6R*U226
        F36 = MX6R*U316 + MY6R*U326
        E16 = FDI17 + F16
        E26 = F26 - F37
        E36 = FDI37 + F36
        N16 = XX6R*WP16 + ZZ6R*DV236 + YZ6*DW236 + XZ6*U216 - XY6R*U316 - MY6R*VP25
        N26 = (XX6R - ZZ6R)*DV136 + XZ6*DW316 + XY6R*U326 + MX6R*VP25 - YZ6*U126
        N36 = ZZ6R*WP36 + XY6R*DW126 + YZ6*U136 + MX6R*VP26 - XX6R*DV126 - XZ6*U236 - MY6R*VP16
        NE16 = C7*N17 + N16 - S7*N27
        NE26 = N26 - N37 - D7*FDI37
        NE36 = S7*N17 + C7*N27 + N36 - D7*F37
        FDI16 = C6*E16 - S6*E26
        FDI36 = S6*E16 + C6*E26
        # Joint 5
        F15 = MX5*U115 + MY5R*U125
        F25 = MX5*U215 + MY5R*U225
        F35 = MX5*U315 + MY5R*U325
        E15 = FDI16 + F15
        E25 = F25 - E36
        E35 = FDI36 + F35
        N15 = XX5R*WP15 + ZZ5R*DV235 + YZ5*DW235 + XZ5*U215 + MY5R*VSP25 - XY5*U315
        N25 = (XX5R - ZZ5R)*DV135 + XZ5*DW315 + XY5*U325 - YZ5*U125 - MX5*VSP25
        N35 = ZZ5R*WP35 + XY5*DW125 + YZ5*U135 + MX5*VP25 - XX5R*DV125 - XZ5*U235 - MY5R*VP15
        NE15 = C6*NE16 + N15 - S6*NE26
        NE25 = N25 - NE36
        NE35 = S6*NE16 + C6*NE26 + N35
        FDI15 = C5*E15 - S5*E25
        FDI35 = -S5*E15 - C5*E25
        # Joint 4
        F14 = MX4R*U114 + MY4R*U124
        F24 = MX4R*U214 + MY4R*U224
        F34 = MX4R*U314 + MY4R*U324
        E14 = FDI15 + F14
        E24 = E35 + F24
        E34 = FDI35 + F34
        N14 = XX4R*WP14 + ZZ4R*DV234 + YZ4*DW234 + XZ4*U214 - XY4R*U314 - MY4R*VSP24
        N24 = (XX4R - ZZ4R)*DV134 + XZ4*DW314 + XY4R*U324 + MX4R*VSP24 - YZ4*U124
        N34 = ZZ4R*WP34 + XY4R*DW124 + YZ4*U134 + MX4R*VP24 - XX4R*DV124 - XZ4*U234 - MY4R*VP14
        NE14 = C5*NE15 + RL5*FDI35 + N14 - S5*NE25
        NE24 = NE35 + D4*FDI35 + N24
        NE34 = N34 - S5*NE15 - C5*NE25 - D4*E35 - RL5*FDI15
        FDI14 = C4*E14 - S4*E24
        FDI34 = S4*E14 + C4*E24
        # Joint 3
        F13 = MX3R*U113 + MY3R*U123
        F23 = MX3R*U213 + MY3R*U223
        E13 = FDI14 + F13
        E23 = F23 - E34
        N13 = XX3R*WP13 + ZZ3R*DV233 + YZ3*DW233 + XZ3*U213 - XY3R*U313 - MY3R*VSP23
        N23 = (XX3R - ZZ3R)*DV133 + XZ3*DW313 + XY3R*U323 + MX3R*VSP23 - YZ3*U123
        N33 = ZZ3R*WP33 + XY3R*DW123 + YZ3*U133 + MX3R*VP23 - XX3R*DV123 - XZ3*U233 - MY3R*VP13
        NE13 = C4*NE14 + N13 - S4*NE24
        NE23 = N23 - NE34 - D4*FDI34
        NE33 = S4*NE14 + C4*NE24 + N33 - D4*E34
        FDI13 = C3*E13 - S3*E23
        FDI33 = S3*E13 + C3*E23
        # Joint 2
        N12 = XX2R*WP12 + ZZ2R*DV232 + YZ2*DW232 + XZ2*U212 - XY2*U312
        N22 = (XX2R - ZZ2R)*DV132 + XZ2*DW312 + XY2*U322 - YZ2*U122
        N32 = ZZ2R*QDP2 + XY2*DW122 + MX2*VP22 - XX2R*DV122 - YZ2*C2QDP1 - XZ2*S2QDP1 - MY2R*VP12
        NE12 = C3*NE13 + N12 - S3*NE23 - RL3*FDI33
        NE22 = N22 - NE33
        NE32 = S3*NE13 + C3*NE23 + RL3*FDI13 + N32
        # Joint 1
        N31 = ZZ1R*QDP1
        NE31 = N31 - S2*NE12 - C2*NE22
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE32 + FV2*QP2 + FS2*signQP2
        GAM[2] = OFFSET3 + NE33 + Ia3*QDP3 + FV3*QP3 + FS3*signQP3
        GAM[3] = OFFSET4 + NE34 + Ia4*QDP4 + FV4*QP4 + FS4*signQP4
        GAM[4] = OFFSET5 + NE35 + Ia5*QDP5 + FV5*QP5 + FS5*signQP5
        GAM[5] = OFFSET6 + NE36 + Ia6*QDP6 + FV6*QP6 + FS6*signQP6
        GAM[6] = OFFSET7 + N37 + Ia7*QDP7 + FV7*QP7 + FS7*signQP7

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, RL3, D4, RL5, D7):
    """Fill A, shape (7, 7, N), from q (7, N)."""
    # Inputs
    q2, q3, q4, q5, q6, q7 = q[1:]
    (
        ZZ1R, _, _, _, XX2R, XY2, XZ2, YZ2, ZZ2R, _, _, _, _, _, XX3R, XY3R, XZ3, YZ3, ZZ3R,
        MX3R, MY3R, Ia3, _, _, _, XX4R, XY4R, XZ4, YZ4, ZZ4R, MX4R, MY4R, Ia4, _, _, _, XX5R,
        XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, _, _, _, XX6R, XY6R, XZ6, YZ6, ZZ6R, MX6R, MY6R,
        Ia6, _, _, _, XX7R, XY7, XZ7, YZ7, ZZ7, MX7, MY7, Ia7, _, _, _
    ) = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    # Composite link 7
    AS17 = MX7*C7 - MY7*S7
    AS37 = MX7*S7 + MY7*C7
    C7C7 = C7**2
    C7S7 = C7*S7
    AJA117 = XX7R*C7C7 - XY7*2*C7S7
    NE167 = XZ7*C7 - YZ7*S7
    NE367 = XZ7*S7 + YZ7*C7
    D7AS17 = D7*AS17
    JP226a = 2*D7AS17
    JP116 = XX6R + AJA117
    JP126 = XY6R - NE167
    JP136 = XZ6 + XX7R*C7S7 + XY7*2*C7C7 - XY7 - D7*AS37
    JP226 = ZZ7 + JP226a
    JP236 = YZ6 - NE367
    JP336 = ZZ6R + XX7R + JP226a - AJA117
    MSP16 = MX6R + AS17
    # Composite link 6
    AS16 = C6*MSP16 - MY6R*S6
    AS36 = S6*MSP16 + MY6R*C6
    C6C6 = C6**2
    C6S6 = C6*S6
    JP115a = JP116 - JP226
    JP115b = C6C6*JP115a - JP126*2*C6S6
    NE156 = C6*JP136 - S6*JP236
    NE356 = S6*JP136 + C6*JP236
    JP115 = XX5R + JP226 + JP115b
    JP125 = XY5 - NE156
    JP135 = XZ5 + C6S6*JP115a + JP126*2*C6C6 - JP126
    JP235 = YZ5 - NE356
    JP335 = ZZ5R + JP116 - JP115b
    MSP15 = MX5 + AS16
    MSP25 = MY5R - AS37
    # Composite link 5
    AS15 = C5*MSP15 - S5*MSP25
    AS35 = -S5*MSP15 - C5*MSP25
    C5C5 = C5**2
    C5S5 = C5*S5
    JP114a = JP336 - JP115
    JP114b = C5C5*JP114a + JP125*2*C5S5
    AJA125 = C5*JP135 - S5*JP235
    D4AS15 = D4*AS15
    RL5AS36 = RL5*AS36
    RL5AS15 = RL5*AS15
    D4AS35 = D4*AS35
    JP114 = XX4R + JP336 + 2*RL5AS36 - JP114b
    JP124 = XY4R + AJA125 + D4*AS36 - RL5AS15
    JP134 = XZ4 + C5S5*JP114a + JP125 + D4AS35 - JP125*2*C5C5
    JP224 = JP335 - 2*D4AS15
    NE345 = -S5*JP135 - C5*JP235 - RL5*AS35
    JP234 = YZ4 + NE345
    JP334 = ZZ4R + JP115 + JP114b - 2*(D4AS15 - RL5AS36)
    MSP14 = MX4R + AS15
    MSP24 = MY4R + AS36
    # Composite link 4
    AS14 = C4*MSP14 - S4*MSP24
    AS34 = S4*MSP14 + C4*MSP24
    C4C4 = C4**2
    C4S4 = C4*S4
    JP113a = JP114 - JP224
    JP113b = C4C4*JP113a - JP124*2*C4S4
    NE134 = C4*JP134 - S4*JP234
    NE334 = S4*JP134 + C4*JP234
    D4AS14 = D4*AS14
    JP223a = 2*D4AS14
    JP113 = XX3R + JP224 + JP113b
    JP123 = XY3R + D4AS35 - NE134
    JP133 = XZ3 + C4S4*JP113a + JP124*2*C4C4 - JP124 - D4*AS34
    JP223 = JP334 + JP223a
    JP233 = YZ3 - NE334
    JP333 = ZZ3R + JP114 + JP223a - JP113b
    MSP13 = MX3R + AS14
    MSP23 = MY3R - AS35
    # Composite link 3
    AS13 = C3*MSP13 - S3*MSP23
    AS33 = S3*MSP13 + C3*MSP23
    C3C3 = C3**2
    C3S3 = C3*S3
    JP112a = JP113 - JP223
    JP112b = C3C3*JP112a - JP123*2*C3S3
    JP112c = 2*RL3*AS34
    JP112 = XX2R + JP223 + JP112b + JP112c
    NE123 = C3*JP133 - S3*JP233 - RL3*AS13
    JP122 = XY2 - NE123
    JP132 = XZ2 + C3S3*JP112a + JP123*2*C3C3 - JP123
    NE323 = S3*JP133 + C3*JP233 - RL3*AS33
    JP232 = YZ2 - NE323
    JP332 = ZZ2R + JP113 + JP112c - JP112b
    # Composite link 2
    NE312 = -S2*JP132 - C2*JP232
    JP331 = ZZ1R + JP112 + C2**2*(JP333 - JP112) + JP122*2*C2*S2
    # Unit acceleration of joint 3
    NE313 = C2*JP333 - S2*NE123
    # Unit acceleration of joint 4
    NE234 = -JP334 - D4AS14
    E124 = -C3*AS34
    E324 = -S3*AS34
    NE124 = C3*NE134 - S3*NE234 - RL3*E324
    NE324 = S3*NE134 + C3*NE234 + RL3*E124
    NE314 = C2*NE334 - S2*NE124
    # Unit acceleration of joint 5
    NE145 = AJA125 - RL5AS15
    NE245 = JP335 - D4AS15
    E135 = C4*AS35
    E335 = S4*AS35
    NE135 = C4*NE145 - S4*NE245
    NE235 = -NE345 - D4*E335
    NE335 = D4AS15 + S4*NE145 + C4*NE245
    E125 = C3*E135 - S3*AS15
    E325 = S3*E135 + C3*AS15
    NE125 = C3*NE135 - S3*NE235 - RL3*E325
    NE325 = S3*NE135 + C3*NE235 + RL3*E125
    NE315 = C2*NE335 - S2*NE125
    # Unit acceleration of joint 6
    E146 = -C5*AS36
    E346 = S5*AS36
    D4E346 = D4*E346
    NE146 = C5*NE156 + S5*JP336 + RL5*E346
    NE246 = NE356 + D4E346
    NE346 = C5*JP336 - S5*NE156 - D4*AS16 - RL5*E146
    E136 = C4*E146 - S4*AS16
    E336 = S4*E146 + C4*AS16
    NE136 = C4*NE146 - S4*NE246
    NE236 = -NE346 - D4*E336
    NE336 = S4*NE146 + C4*NE246 - D4E346
    E126 = C3*E136 + S3*E346
    E326 = S3*E136 - C3*E346
    NE126 = C3*NE136 - S3*NE236 - RL3*E326
    NE326 = S3*NE136 + C3*NE236 + RL3*E126
    NE316 = C2*NE336 - S2*NE126
    # Unit acceleration of joint 7
    NE267 = -ZZ7 - D7AS17
    E157 = -C6*AS37
    E357 = -S6*AS37
    NE157 = C6*NE167 - S6*NE267
    NE357 = S6*NE167 + C6*NE267
    E147 = C5*E157 + S5*AS17
    E347 = C5*AS17 - S5*E157
    D4E347 = D4*E347
    NE147 = C5*NE157 + S5*NE367 + RL5*E347
    NE247 = NE357 + D4E347
    NE347 = C5*NE367 - S5*NE157 - D4*E357 - RL5*E147
    E137 = C4*E147 - S4*E357
    E337 = S4*E147 + C4*E357
    NE137 = C4*NE147 - S4*NE247
    NE237 = -NE347 - D4*E337
    NE337 = S4*NE147 + C4*NE247 - D4E347
    E127 = C3*E137 + S3*E347
    E327 = S3*E137 - C3*E347
    NE127 = C3*NE137 - S3*NE237 - RL3*E327
    NE327 = S3*NE137 + C3*NE237 + RL3*E127
    NE317 = C2*NE337 - S2*NE127
    # Inertia matrix
    A[0, 0] = JP331
    A[0, 1] = A[1, 0] = NE312
    A[1, 1] = JP332
    A[0, 2] = A[2, 0] = NE313
    A[1, 2] = A[2, 1] = NE323
    A[2, 2] = Ia3 + JP333
    A[0, 3] = A[3, 0] = NE314
    A[1, 3] = A[3, 1] = NE324
    A[2, 3] = A[3, 2] = NE334
    A[3, 3] = Ia4 + JP334
    A[0, 4] = A[4, 0] = NE315
    A[1, 4] = A[4, 1] = NE325
    A[2, 4] = A[4, 2] = NE335
    A[3, 4] = A[4, 3] = NE345
    A[4, 4] = Ia5 + JP335
    A[0, 5] = A[5, 0] = NE316
    A[1, 5] = A[5, 1] = NE326
    A[2, 5] = A[5, 2] = NE336
    A[3, 5] = A[5, 3] = NE346
    A[4, 5] = A[5, 4] = NE356
    A[5, 5] = Ia6 + JP336
    A[0, 6] = A[6, 0] = NE317
    A[1, 6] = A[6, 1] = NE327
    A[2, 6] = A[6, 2] = NE337
    A[3, 6] = A[6, 3] = NE347
    A[4, 6] = A[6, 4] = NE357
    A[5, 6] = A[6, 5] = NE367
    A[6, 6] = ZZ7 + Ia7


def _gravity_block(xp, q, GAM, X, g):
    """Fill GAM, shape (7, N), from q (7, N)."""
    # Inputs
    q2, q3, q4, q5, q6, q7 = q[1:]
    (
        _, _, _, OFFSET1, _, _, _, _, _, MX2, MY2R, _, _, OFFSET2, _, _, _, _, _, MX3R, MY3R, _,
        _, _, OFFSET3, _, _, _, _, _, MX4R, MY4R, _, _, _, OFFSET4, _, _, _, _, _, MX5, MY5R, _,
        _, _, OFFSET5, _, _, _, _, _, MX6R, MY6R, _, _, _, OFFSET6, _, _, _, _, _, MX7, MY7, _,
        _, _, OFFSET7
    ) = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    # Link 2
    VP12 = -g*S2
    VP22 = -g*C2
    # Link 3
    C3VP12 = C3*VP12
    S3VP12 = S3*VP12
    # Link 4
    VP14 = C4*C3VP12 - S4*VP22
    VP24 = -C4*VP22 - S4*C3VP12
    # Link 5
    VP15 = C5*VP14 - S5*S3VP12
    VP25 = -C5*S3VP12 - S5*VP14
    # Link 6
    VP16 = C6*VP15 + S6*VP24
    VP26 = C6*VP24 - S6*VP15
    # Link 7
    VP17 = C7*VP16 - S7*VP25
    VP27 = -C7*VP25 - S7*VP16
    # Joint 7
    N17 = -MY7*VP26
    N27 = MX7*VP26
    N37 = MX7*VP27 - MY7*VP17
    # Joint 6
    N16 = -MY6R*VP25
    N26 = MX6R*VP25
    N36 = MX6R*VP26 - MY6R*VP16
    NE16 = C7*N17 + N16 - S7*N27
    NE26 = N26 - N37
    NE36 = S7*N17 + C7*N27 + N36
    # Joint 5
    N15 = MY5R*VP24
    N25 = -MX5*VP24
    N35 = MX5*VP25 - MY5R*VP15
    NE15 = C6*NE16 + N15 - S6*NE26
    NE25 = N25 - NE36
    NE35 = S6*NE16 + C6*NE26 + N35
    # Joint 4
    N14 = MY4R*S3VP12
    N24 = -MX4R*S3VP12
    N34 = MX4R*VP24 - MY4R*VP14
    NE14 = C5*NE15 + N14 - S5*NE25
    NE24 = NE35 + N24
    NE34 = N34 - S5*NE15 - C5*NE25
    # Joint 3
    N13 = -MY3R*VP22
    N23 = MX3R*VP22
    N33 = -MX3R*S3VP12 - MY3R*C3VP12
    NE13 = C4*NE14 + N13 - S4*NE24
    NE23 = N23 - NE34
    NE33 = S4*NE14 + C4*NE24 + N33
    # Joint 2
    N32 = MX2*VP22 - MY2R*VP12
    NE32 = S3*NE13 + C3*NE23 + N32
    # Torques
    GAM[0] = OFFSET1
    GAM[1] = OFFSET2 + NE32
    GAM[2] = OFFSET3 + NE33
    GAM[3] = OFFSET4 + NE34
    GAM[4] = OFFSET5 + NE35
    GAM[5] = OFFSET6 + NE36
    GAM[6] = OFFSET7 + N37


def _frame_poses_block(xp, q, T, RL1, RL3, D4, RL5, D7):
    """Fill T, shape (7, 4, 4, N), from q (7, N)."""
    # Inputs
    q1, q2, q3, q4, q5, q6, q7 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    # Joint axes Z and velocities V seen from link 3
    Z131 = -S2*C3
    Z231 = S2*S3
    # Joint axes Z and velocities V seen from link 4
    Z141 = C4*Z131 + C2*S4
    Z241 = C2*C4 - S4*Z131
    # Joint axes Z and velocities V seen from link 5
    Z151 = C5*Z141 + S5*Z231
    Z251 = C5*Z231 - S5*Z141
    # Joint axes Z and velocities V seen from link 6
    Z161 = C6*Z151 + S6*Z241
    Z261 = C6*Z241 - S6*Z151
    # Joint axes Z and velocities V seen from link 7
    Z171 = C7*Z161 - S7*Z251
    Z271 = -C7*Z251 - S7*Z161
    # Frame 2
    R112 = C1*C2
    R122 = -C1*S2
    R212 = S1*C2
    R222 = -S1*S2
    # Frame 3
    R113 = C3*R112 - S1*S3
    R123 = -S1*C3 - S3*R112
    R213 = C3*R212 + C1*S3
    R223 = C1*C3 - S3*R212
    P13 = -RL3*R122
    P23 = -RL3*R222
    P33 = RL1 + RL3*C2
    # Frame 4
    R114 = C4*R113 - S4*R122
    R124 = -C4*R122 - S4*R113
    R214 = C4*R213 - S4*R222
    R224 = -C4*R222 - S4*R213
    P14 = P13 + D4*R113
    P24 = P23 + D4*R213
    P34 = P33 + D4*Z131
    # Frame 5
    R115 = C5*R114 + S5*R123
    R125 = C5*R123 - S5*R114
    R215 = C5*R214 + S5*R223
    R225 = C5*R223 - S5*R214
    P15 = P14 + RL5*R124 - D4*R114
    P25 = P24 + RL5*R224 - D4*R214
    P35 = P34 + RL5*Z241 - D4*Z141
    # Frame 6
    R116 = C6*R115 + S6*R124
    R126 = C6*R124 - S6*R115
    R216 = C6*R215 + S6*R224
    R226 = C6*R224 - S6*R215
    # Frame 7
    R117 = C7*R116 - S7*R125
    R127 = -C7*R125 - S7*R116
    R217 = C7*R216 - S7*R225
    R227 = -C7*R225 - S7*R216
    P17 = P15 + D7*R116
    P27 = P25 + D7*R216
    P37 = P35 + D7*Z161
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[0, 2, 3] = RL1
    T[1, 0, 0] = R112
    T[1, 0, 1] = R122
    T[1, 0, 2] = -S1
    T[1, 1, 0] = R212
    T[1, 1, 1] = R222
    T[1, 1, 2] = C1
    T[1, 2, 0] = -S2
    T[1, 2, 1] = -C2
    T[1, 2, 3] = RL1
    T[2, 0, 0] = R113
    T[2, 0, 1] = R123
    T[2, 0, 2] = -R122
    T[2, 0, 3] = P13
    T[2, 1, 0] = R213
    T[2, 1, 1] = R223
    T[2, 1, 2] = -R222
    T[2, 1, 3] = P23
    T[2, 2, 0] = Z131
    T[2, 2, 1] = Z231
    T[2, 2, 2] = C2
    T[2, 2, 3] = P33
    T[3, 0, 0] = R114
    T[3, 0, 1] = R124
    T[3, 0, 2] = -R123
    T[3, 0, 3] = P14
    T[3, 1, 0] = R214
    T[3, 1, 1] = R224
    T[3, 1, 2] = -R223
    T[3, 1, 3] = P24
    T[3, 2, 0] = Z141
    T[3, 2, 1] = Z241
    T[3, 2, 2] = -Z231
    T[3, 2, 3] = P34
    T[4, 0, 0] = R115
    T[4, 0, 1] = R125
    T[4, 0, 2] = R124
    T[4, 0, 3] = P15
    T[4, 1, 0] = R215
    T[4, 1, 1] = R225
    T[4, 1, 2] = R224
    T[4, 1, 3] = P25
    T[4, 2, 0] = Z151
    T[4, 2, 1] = Z251
    T[4, 2, 2] = Z241
    T[4, 2, 3] = P35
    T[5, 0, 0] = R116
    T[5, 0, 1] = R126
    T[5, 0, 2] = -R125
    T[5, 0, 3] = P15
    T[5, 1, 0] = R216
    T[5, 1, 1] = R226
    T[5, 1, 2] = -R225
    T[5, 1, 3] = P25
    T[5, 2, 0] = Z161
    T[5, 2, 1] = Z261
    T[5, 2, 2] = -Z251
    T[5, 2, 3] = P35
    T[6, 0, 0] = R117
    T[6, 0, 1] = R127
    T[6, 0, 2] = -R126
    T[6, 0, 3] = P17
    T[6, 1, 0] = R217
    T[6, 1, 1] = R227
    T[6, 1, 2] = -R226
    T[6, 1, 3] = P27
    T[6, 2, 0] = Z171
    T[6, 2, 1] = Z271
    T[6, 2, 2] = -Z261
    T[6, 2, 3] = P37
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 3, 3] = T[2, 3, 3] = T[3, 3, 3] = T[4, 3, 3] = T[5, 3, 3] = 1.0
    T[6, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4, 5, 6, 7)
DRIVES = None
LIMITS = {
    'q': (
        (-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698),
        (-2.8973, 2.8973), (-0.0175, 3.7525), (-2.8973, 2.8973),
    ),
    'qd': (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
    'qdd': (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
    'tau': (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
}
VALUES = {}
