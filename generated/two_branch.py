"""Tree of two branches, 7 joints, one of them prismatic, and a fixed tool: base parameters,
    regressor, dynamics.

GENERATED from two_branch.yaml, sha256 22ecb3e74d7c, by symgen 0.5.0.
Do not edit; symgen generate two_branch

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  gamma   b  alpha   d       theta         r
    1    0      0      0   0      0   0          q1         0
    2    1      0      0   0  -pi/2  D2          q2       RL2
    3    2      1      0   0   pi/2   0        pi/2  q3 + 0.1
    4    3      0      0   0  -pi/2  D4  -pi/2 + q4         0
    5    4      2      0   0   pi/2  D5           0       RL5
    6    1      0   pi/2  B6  -pi/2  D6          q6         0
    7    6      0      0   0      0  D7          q7         0
    8    7      0      0   0   pi/2   0          q8       RL8
Gravity     acceleration (GX, 0, GZ) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q3, q4, q6, q7, q8
    FV      viscous: along q1, q2, q3, q4, q6, q7, q8
    FS      coulomb: along q1, q2, q3, q4, q6, q7, q8
    OFFSET  offset: along q1, q2, q3, q4, q6, q7, q8

Base parameters, 67 of 108; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MZ1 M1

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; what several share is
            named by its factors, C4DV134, by its function, signQP1, or by a letter, N16a in N16
    th   joint angle with its constant, rad
    C    cosine of a joint angle or of a sum of angles
    S    sine of a joint angle or of a sum of angles
    r    position of a prismatic joint with its constant, m
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
    DN   the part of DG that turns: axis times moment
    DF   the part of DG that pushes: velocity times force
    R    orientation of a frame in frame 0
    P    origin of a frame in frame 0

Cost per sample
    regressor          270 multiplications, 211 additions, 7 sin, 7 cos
    inverse_dynamics   300 multiplications, 281 additions, 7 sin, 7 cos
    inertia_matrix     114 multiplications, 102 additions, 5 sin, 5 cos
    gravity            75 multiplications, 54 additions, 6 sin, 6 cos
    frame_poses        55 multiplications, 28 additions, 6 sin, 6 cos

Arguments   q, qd, qdd, tau of shape (N, 7), or (7,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (67,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 5e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: d5867a6a79b4a648e757075b18335a9c96ed93df44d2671db6abdf8152a429bc
"""

import numpy as np

SCHEMA = 1
NAME = 'two_branch'
SOURCE_SHA256 = '22ecb3e74d7cea543a89cfc7b8adb5a89961030eaeb428ac7c877cf91576ed1c'
JOINTS = (1, 2, 3, 4, 6, 7, 8)
CONSTANTS = {
    'D2': 0.21, 'RL2': 0.13, 'D4': 0.17, 'D5': 0.06, 'RL5': 0.11, 'B6': 0.4, 'D6': -0.19,
    'D7': 0.23, 'RL8': 0.29, 'GX': -4.905, 'GZ': -8.496,
}
BASE_PARAMETERS = tuple("""
ZZ1R MX1R MY1R FV1 FS1 OFFSET1 XX2R XY2R XZ2R YZ2R ZZ2R MX2 MY2 FV2 FS2 OFFSET2 MX3R MY3R MZ3 M3R
Ia3 FV3 FS3 OFFSET3 XX4R XY4R XZ4R YZ4R ZZ4R MX4R MY4R Ia4 FV4 FS4 OFFSET4 XX6R XY6 XZ6R YZ6 ZZ6R
MX6R MY6 FV6 FS6 OFFSET6 XX7R XY7 XZ7 YZ7 ZZ7R MX7 MY7R Ia7 FV7 FS7 OFFSET7 XX8R XY8 XZ8 YZ8 ZZ8 MX8
MY8 Ia8 FV8 FS8 OFFSET8
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 Ia3 FV3 FS3 OFFSET3 XX4 XY4 XZ4 YY4 YZ4
ZZ4 MX4 MY4 MZ4 M4 Ia4 FV4 FS4 OFFSET4 XX5 XY5 XZ5 YY5 YZ5 ZZ5 MX5 MY5 MZ5 M5 XX6 XY6 XZ6 YY6 YZ6
ZZ6 MX6 MY6 MZ6 M6 Ia6 FV6 FS6 OFFSET6 XX7 XY7 XZ7 YY7 YZ7 ZZ7 MX7 MY7 MZ7 M7 Ia7 FV7 FS7 OFFSET7
XX8 XY8 XZ8 YY8 YZ8 ZZ8 MX8 MY8 MZ8 M8 Ia8 FV8 FS8 OFFSET8
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'MZ1', 'M1')
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + YY2 + ZZ3 + YY4 + ZZ5 + YY6 + YY7 + 2*RL2*MZ2 + (D2**2 + RL2**2)*M2'
        ' + D4**2*M4 + 2*D5*MX5 + (D4**2 + D5**2)*M5 + D6**2*M6 + (D6**2 + D7**2)*(M7 +'
        ' M8)',
    'MX1R': 'MX1 - MZ6 - MZ7 + D2*M2',
    'MY1R': 'MY1 + MZ2 + RL2*M2 + D6*(M6 + M7 + M8)',
    'XX2R': 'XX2 - YY2 + YY3 - ZZ3 - YY4 - ZZ5 - 2*D5*MX5 - D5**2*M5',
    'XY2R': 'XY2 + YZ3',
    'XZ2R': 'XZ2 - XY3 + D4*(MZ4 + MY5)',
    'YZ2R': 'YZ2 - XZ3',
    'ZZ2R': 'ZZ2 + Ia2 + XX3 + YY4 + ZZ5 + 2*D5*MX5 + D5**2*M5',
    'MX3R': 'MX3 + D4*(M4 + M5)',
    'MY3R': 'MY3 + MZ4 + MY5',
    'M3R': 'M3 + M4 + M5',
    'XX4R': 'XX4 - YY4 + XX5 - ZZ5 - 2*D5*MX5 + 2*RL5*MZ5 + (-D5**2 + RL5**2)*M5',
    'XY4R': 'XY4 - XZ5 + RL5*MX5 + D5*MZ5 + D5*RL5*M5',
    'XZ4R': 'XZ4 + XY5 - D5*MY5',
    'YZ4R': 'YZ4 - YZ5 + RL5*MY5',
    'ZZ4R': 'ZZ4 + YY5 + 2*D5*MX5 + 2*RL5*MZ5 + (D5**2 + RL5**2)*M5',
    'MX4R': 'MX4 + MX5 + D5*M5',
    'MY4R': 'MY4 - MZ5 - RL5*M5',
    'XX6R': 'XX6 - YY6 - D7**2*(M7 + M8)',
    'XZ6R': 'XZ6 - D7*MZ7',
    'ZZ6R': 'ZZ6 + Ia6 + D7**2*(M7 + M8)',
    'MX6R': 'MX6 + D7*(M7 + M8)',
    'XX7R': 'XX7 - YY7 + YY8 + 2*RL8*MZ8 + RL8**2*M8',
    'ZZ7R': 'ZZ7 + YY8 + 2*RL8*MZ8 + RL8**2*M8',
    'MY7R': 'MY7 - MZ8 - RL8*M8',
    'XX8R': 'XX8 - YY8',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m
N*m kg*m kg*m kg*m kg kg N*s/m N N kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2
N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2
kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2
kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x......", "x......", "x......", "x......", "x......", "x......", "xx.....", "xx.....",
    "xx.....", "xx.....", ".x.....", "xx.....", "xx.....", ".x.....", ".x.....", ".x.....",
    "xxx....", "xxx....", "xxx....", "xxx....", "..x....", "..x....", "..x....", "..x....",
    "xx.x...", "xx.x...", "xx.x...", "xx.x...", "xx.x...", "xxxx...", "xxxx...", "...x...",
    "...x...", "...x...", "...x...", "x...x..", "x...x..", "x...x..", "x...x..", "....x..",
    "x...x..", "x...x..", "....x..", "....x..", "....x..", "x...xx.", "x...xx.", "x...xx.",
    "x...xx.", "....xx.", "x...xx.", "x...xx.", ".....x.", ".....x.", ".....x.", ".....x.",
    "x...xxx", "x...xxx", "x...xxx", "x...xxx", "x...xxx", "x...xxx", "x...xxx", "......x",
    "......x", "......x", "......x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (67, 7, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((67, 7, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[5, 0] = D[15, 1] = D[23, 2] = D[34, 3] = D[44, 4] = D[55, 5] = D[66, 6] = 1.0
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
    if tuple(X.shape) != (67,):
        raise ValueError(f"X of shape {X.shape}; expected (67,) in the order of BASE_PARAMETERS")
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
        return [X[k] for k in range(67)]

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
        return self.rows(X, 67)

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

    Inputs are columns q, qd, qdd, tau (7,), X (67,), standard (108,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (7, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 67, "standard": 108}
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
    'frame_poses': ('q', 'T1 T2 T3 T4 T5 T6 T7 T8'),
    'jacobian': ('q', 'J'),
}


def elements(
    *, D2: float = 0.21, RL2: float = 0.13, D4: float = 0.17, D5: float = 0.06,
    RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19, D7: float = 0.23, RL8: float = 0.29,
    GX: float = -4.905, GZ: float = -8.496
) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D2, RL2, D4, D6, D7, RL8, GX, GZ))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
        'Ia3': ('inertia', 'both', {3: 1.0}), 'FV3': ('viscous', 'both', {3: 1.0}),
        'FS3': ('coulomb', 'both', {3: 1.0}), 'OFFSET3': ('offset', 'both', {3: 1.0}),
        'Ia4': ('inertia', 'both', {4: 1.0}), 'FV4': ('viscous', 'both', {4: 1.0}),
        'FS4': ('coulomb', 'both', {4: 1.0}), 'OFFSET4': ('offset', 'both', {4: 1.0}),
        'Ia6': ('inertia', 'both', {6: 1.0}), 'FV6': ('viscous', 'both', {6: 1.0}),
        'FS6': ('coulomb', 'both', {6: 1.0}), 'OFFSET6': ('offset', 'both', {6: 1.0}),
        'Ia7': ('inertia', 'both', {7: 1.0}), 'FV7': ('viscous', 'both', {7: 1.0}),
        'FS7': ('coulomb', 'both', {7: 1.0}), 'OFFSET7': ('offset', 'both', {7: 1.0}),
        'Ia8': ('inertia', 'both', {8: 1.0}), 'FV8': ('viscous', 'both', {8: 1.0}),
        'FS8': ('coulomb', 'both', {8: 1.0}), 'OFFSET8': ('offset', 'both', {8: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(
    standard: "Array", *, D2: float = 0.21, RL2: float = 0.13, D4: float = 0.17,
    D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19, D7: float = 0.23,
    RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """X, shape (67,), from the 108 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (108,):
            raise ValueError(
                f"standard of shape {shape}; expected (108,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(108)]
    if xp is np:
        _numbers((D2, RL2, D4, D6, D7, RL8, GX, GZ))
    (
        _, _, _, _, _, ZZ1, MX1, MY1, _, _, Ia1, FV1, FS1, OFFSET1, XX2, XY2, XZ2, YY2, YZ2,
        ZZ2, MX2, MY2, MZ2, M2, Ia2, FV2, FS2, OFFSET2, XX3, XY3, XZ3, YY3, YZ3, ZZ3, MX3, MY3,
        MZ3, M3, Ia3, FV3, FS3, OFFSET3, XX4, XY4, XZ4, YY4, YZ4, ZZ4, MX4, MY4, MZ4, M4, Ia4,
        FV4, FS4, OFFSET4, XX5, XY5, XZ5, YY5, YZ5, ZZ5, MX5, MY5, MZ5, M5, XX6, XY6, XZ6, YY6,
        YZ6, ZZ6, MX6, MY6, MZ6, M6, Ia6, FV6, FS6, OFFSET6, XX7, XY7, XZ7, YY7, YZ7, ZZ7, MX7,
        MY7, MZ7, M7, Ia7, FV7, FS7, OFFSET7, XX8, XY8, XZ8, YY8, YZ8, ZZ8, MX8, MY8, MZ8, M8,
        Ia8, FV8, FS8, OFFSET8
    ) = standard
    ZZ1R = (ZZ1 + Ia1 + YY2 + ZZ3 + YY4 + ZZ5 + YY6 + YY7 + 2*RL2*MZ2 + (D2**2 + RL2**2)*M2 +
        D4**2*M4 + 2*D5*MX5 + (D4**2 + D5**2)*M5 + D6**2*M6 + (D6**2 + D7**2)*(M7 + M8))
    MX1R = MX1 - MZ6 - MZ7 + D2*M2
    MY1R = MY1 + MZ2 + RL2*M2 + D6*(M6 + M7 + M8)
    XX2R = XX2 - YY2 + YY3 - ZZ3 - YY4 - ZZ5 - 2*D5*MX5 - D5**2*M5
    XY2R = XY2 + YZ3
    XZ2R = XZ2 - XY3 + D4*(MZ4 + MY5)
    YZ2R = YZ2 - XZ3
    ZZ2R = ZZ2 + Ia2 + XX3 + YY4 + ZZ5 + 2*D5*MX5 + D5**2*M5
    MX3R = MX3 + D4*(M4 + M5)
    MY3R = MY3 + MZ4 + MY5
    M3R = M3 + M4 + M5
    XX4R = XX4 - YY4 + XX5 - ZZ5 - 2*D5*MX5 + 2*RL5*MZ5 + (-D5**2 + RL5**2)*M5
    XY4R = XY4 - XZ5 + RL5*MX5 + D5*MZ5 + D5*RL5*M5
    XZ4R = XZ4 + XY5 - D5*MY5
    YZ4R = YZ4 - YZ5 + RL5*MY5
    ZZ4R = ZZ4 + YY5 + 2*D5*MX5 + 2*RL5*MZ5 + (D5**2 + RL5**2)*M5
    MX4R = MX4 + MX5 + D5*M5
    MY4R = MY4 - MZ5 - RL5*M5
    XX6R = XX6 - YY6 - D7**2*(M7 + M8)
    XZ6R = XZ6 - D7*MZ7
    ZZ6R = ZZ6 + Ia6 + D7**2*(M7 + M8)
    MX6R = MX6 + D7*(M7 + M8)
    XX7R = XX7 - YY7 + YY8 + 2*RL8*MZ8 + RL8**2*M8
    ZZ7R = ZZ7 + YY8 + 2*RL8*MZ8 + RL8**2*M8
    MY7R = MY7 - MZ8 - RL8*M8
    XX8R = XX8 - YY8
    return (np.array if xp is np else xp.stack)([
        ZZ1R, MX1R, MY1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2, MY2, FV2, FS2,
        OFFSET2, MX3R, MY3R, MZ3, M3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4R, XZ4R, YZ4R, ZZ4R, MX4R,
        MY4R, Ia4, FV4, FS4, OFFSET4, XX6R, XY6, XZ6R, YZ6, ZZ6R, MX6R, MY6, FV6, FS6, OFFSET6,
        XX7R, XY7, XZ7, YZ7, ZZ7R, MX7, MY7R, Ia7, FV7, FS7, OFFSET7, XX8R, XY8, XZ8, YZ8, ZZ8, MX8,
        MY8, Ia8, FV8, FS8, OFFSET8,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.21,
    RL2: float = 0.13, D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4,
    D6: float = -0.19, D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905,
    GZ: float = -8.496
) -> "Array":
    """D of Gamma = D X. Shape (N, 7, 67).

    A view on one store of shape (67, 7, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, RL2, D4, D6, D7, RL8, GX, GZ))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.21,
    RL2: float = 0.13, D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4,
    D6: float = -0.19, D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905,
    GZ: float = -8.496
) -> "Array":
    """W of Y = W X + rho, shape (7*N, 67), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, RL2, D4, D6, D7, RL8, GX, GZ))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 67))
    return filled.reshape(67, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 7, 67)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (67, 7), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (67, 7, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(67, 7, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D2: float = 0.21, RL2: float = 0.13,
    D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19,
    D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 7).
    """
    return _evaluated(_inverse_dynamics_block, (7,), (q, qd, qdd), (X,),
        (D2, RL2, D4, D6, D7, RL8, GX, GZ))


def inertia_matrix(
    q: "Array", X: "Array", *, D2: float = 0.21, RL2: float = 0.13, D4: float = 0.17,
    D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19, D7: float = 0.23,
    RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 7, 7).
    """
    return _evaluated(_inertia_matrix_block, (7, 7), (q,), (X,), (D2, RL2, D4, B6, D6, D7, RL8))


def bias(
    q: "Array", qd: "Array", X: "Array", *, D2: float = 0.21, RL2: float = 0.13,
    D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19,
    D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 7).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D2=D2, RL2=RL2, D4=D4, D5=D5, RL5=RL5, B6=B6, D6=D6,
        D7=D7, RL8=RL8, GX=GX, GZ=GZ)


def gravity(
    q: "Array", X: "Array", *, D2: float = 0.21, RL2: float = 0.13, D4: float = 0.17,
    D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19, D7: float = 0.23,
    RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 7).
    """
    return _evaluated(_gravity_block, (7,), (q,), (X,), (D2, RL2, GX, GZ))


def frame_poses(
    q: "Array", *, D2: float = 0.21, RL2: float = 0.13, D4: float = 0.17, D5: float = 0.06,
    RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19, D7: float = 0.23, RL8: float = 0.29,
    GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 8, 4, 4).
    """
    return _evaluated(_frame_poses_block, (8, 4, 4), (q,), (),
        (D2, RL2, D4, D5, RL5, B6, D6, D7, RL8))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D2: float = 0.21, RL2: float = 0.13,
    D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19,
    D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 7)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D2=D2, RL2=RL2, D4=D4, D5=D5,
        RL5=RL5, B6=B6, D6=D6, D7=D7, RL8=RL8, GX=GX, GZ=GZ)
    inertia = inertia_matrix(q, X, D2=D2, RL2=RL2, D4=D4, D5=D5, RL5=RL5, B6=B6, D6=D6, D7=D7,
        RL8=RL8, GX=GX, GZ=GZ)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, D2: float = 0.21, RL2: float = 0.13,
    D4: float = 0.17, D5: float = 0.06, RL5: float = 0.11, B6: float = 0.4, D6: float = -0.19,
    D7: float = 0.23, RL8: float = 0.29, GX: float = -4.905, GZ: float = -8.496
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 7).
    """
    frame = 8 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 8:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 8")
    return _evaluated(_jacobian_block, (6, 7), (q,), (),
        (frame, D2, RL2, D4, D5, RL5, B6, D6, D7, RL8))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 7, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(8, 4, 4), 0.0)
    _frame_poses_block(xp, q, T, *constants[:9])
    joints, columns, j = _moving(xp, *constants[9:]), {}, frame
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
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((1, 1.0),)), 3: (2, 1, ((2, 1.0),)),
        4: (3, 0, ((3, 1.0),)), 5: (4, 2, ()), 6: (1, 0, ((4, 1.0),)), 7: (6, 0, ((5, 1.0),)),
        8: (7, 0, ((6, 1.0),)),
    }


def _regressor_block(xp, q, qd, qdd, D, D2, RL2, D4, D6, D7, RL8, GX, GZ):
    """Fill D, shape (67, 7, N), where it is not constant, from q, qd, qdd (7, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D2, RL2, D4, D6, D7, RL8, GX, GZ)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D2, RL2, D4, D6, D7, RL8, GX, GZ):
    """Fill GAM, shape (7, N), from q, qd, qdd (7, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D2, RL2, D4, D6, D7, RL8, GX, GZ)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D2, RL2, D4, D6, D7, RL8, GX, GZ):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q1, q2, q3, q4, q6, q7, q8 = q
    QP1, QP2, QP3, QP4, QP6, QP7, QP8 = qd
    QDP1, QDP2, QDP3, QDP4, QDP6, QDP7, QDP8 = qdd
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    th67 = q6 + q7
    C67 = xp.cos(th67)
    S67 = xp.sin(th67)
    C8 = xp.cos(q8)
    S8 = xp.sin(q8)
    # Inputs
    r3 = 0.1 + q3
    # Link 1
    DV331 = QP1**2
    VP11 = -GX*C1
    VP21 = GX*S1
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
    U112 = -DV222 - DV332
    U122 = DV122 - QDP2
    U212 = QDP2 + DV122
    U222 = -DV112 - DV332
    U312 = DV132 - WP22
    U322 = DV232 + WP12
    VSP12 = VP11 - D2*DV331 - RL2*QDP1
    VSP22 = VP21 + D2*QDP1 - RL2*DV331
    VP12 = C2*VSP12 + GZ*S2
    VP22 = GZ*C2 - S2*VSP12
    # Link 3
    DF2MZ3 = -r3*U122
    VSP13 = VP12 + DF2MZ3
    VSP23 = VP22 - r3*U222
    VSP33 = VSP22 - r3*U322
    QP3x2 = 2*QP3
    VP13 = VSP33 - W12*QP3x2
    VP23 = -VSP13 - QP2*QP3x2
    VP33 = QDP3 - VSP23
    # Link 4
    W14 = S4*QP2 - C4*W22
    W24 = S4*W22 + C4*QP2
    W34 = QP4 - W12
    WP14 = S4*QDP2 + QP4*W24 - C4*WP22
    WP24 = S4*WP22 + C4*QDP2 - QP4*W14
    WP34 = QDP4 - WP12
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
    VSP14 = VP13 - D4*DV331
    VSP24 = VP23 + D4*C2QDP1
    VSP34 = VP33 - D4*S2QDP1
    VP14 = S4*VSP14 + C4*VSP34
    VP24 = C4*VSP14 - S4*VSP34
    # Link 6
    W16 = -S6*QP1
    W26 = -C6*QP1
    S6QDP1 = S6*QDP1
    C6QDP1 = C6*QDP1
    DV236 = QP6*W26
    WP16 = DV236 - S6QDP1
    DV136 = QP6*W16
    WP26 = -C6QDP1 - DV136
    DV116 = W16**2
    DV126 = W16*W26
    DV226 = W26**2
    DV336 = QP6**2
    DW236 = DV226 - DV336
    DW316 = DV336 - DV116
    DW126 = DV116 - DV226
    U116 = -DV226 - DV336
    U126 = DV126 - QDP6
    U216 = QDP6 + DV126
    U316 = DV136 - WP26
    U326 = DV236 + WP16
    VSP16 = VP11 - D6*QDP1
    VSP26 = VP21 - D6*DV331
    VP16 = C6*VSP26 + GZ*S6
    VP26 = GZ*C6 - S6*VSP26
    # Link 7
    W37 = QP6 + QP7
    WP37 = QDP6 + QDP7
    W17 = -S67*QP1
    W27 = -C67*QP1
    S67QDP1 = S67*QDP1
    C67QDP1 = C67*QDP1
    DV237 = W37*W27
    WP17 = DV237 - S67QDP1
    DV137 = W37*W17
    WP27 = -C67QDP1 - DV137
    DV117 = W17**2
    DV127 = W17*W27
    DV227 = W27**2
    DV337 = W37**2
    DW237 = DV227 - DV337
    DW317 = DV337 - DV117
    DW127 = DV117 - DV227
    U117 = -DV227 - DV337
    U127 = DV127 - WP37
    U217 = WP37 + DV127
    U227 = -DV117 - DV337
    U317 = DV137 - WP27
    U327 = DV237 + WP17
    VSP17 = VP16 + D7*U116
    VSP27 = VP26 + D7*U216
    VSP37 = D7*U316 - VSP16
    VP17 = C7*VSP17 + S7*VSP27
    VP27 = C7*VSP27 - S7*VSP17
    # Link 8
    W18 = C8*W17 + S8*W37
    W28 = C8*W37 - S8*W17
    W38 = QP8 - W27
    WP18 = C8*WP17 + S8*WP37 + QP8*W28
    WP28 = C8*WP37 - S8*WP17 - QP8*W18
    WP38 = QDP8 - WP27
    DV118 = W18**2
    DV128 = W18*W28
    DV138 = W18*W38
    DV228 = W28**2
    DV238 = W28*W38
    DV338 = W38**2
    DW238 = DV228 - DV338
    DW318 = DV338 - DV118
    DW128 = DV118 - DV228
    U118 = -DV228 - DV338
    U128 = DV128 - WP38
    U138 = WP28 + DV138
    U218 = WP38 + DV128
    U228 = -DV118 - DV338
    U238 = DV238 - WP18
    U318 = DV138 - WP28
    U328 = WP18 + DV238
    VSP18 = VP17 - RL8*U127
    VSP28 = VP27 - RL8*U227
    VSP38 = VSP37 - RL8*U327
    VP18 = C8*VSP18 + S8*VSP38
    VP28 = C8*VSP38 - S8*VSP18
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP3 = xp.sign(QP3)
    signQP4 = xp.sign(QP4)
    signQP6 = xp.sign(QP6)
    signQP7 = xp.sign(QP7)
    signQP8 = xp.sign(QP8)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 2
        V121 = -RL2*C2
        V221 = RL2*S2
        # Joint axes Z and velocities V seen from link 3
        V131 = D2 + S2*r3
        # Joint axes Z and velocities V seen from link 4
        Z141 = C2*C4
        Z241 = -C2*S4
        V341 = D4*C2 - V121
        VS341 = -V221 - D4*S2
        V141 = S4*V131 + C4*VS341
        V241 = C4*V131 - S4*VS341
        # Joint axes Z and velocities V seen from link 7
        V371 = D6 + D7*C6
        V176 = D7*S7
        V276 = D7*C7
        # Joint axes Z and velocities V seen from link 8
        Z181 = -S67*C8
        Z281 = S67*S8
        VS381 = V371 + RL8*S67
        V181 = S8*VS381
        V281 = C8*VS381
        VS186 = RL8 + V176
        V186 = C8*VS186
        V286 = -S8*VS186
        V187 = RL8*C8
        V287 = -RL8*S8
        # Contributions that several joints share
        U112V121 = U112*V121
        U212V221 = U212*V221
        U122V121 = U122*V121
        U222V221 = U222*V221
        DV134Z241 = DV134*Z241
        C4DV134 = C4*DV134
        S4U214 = S4*U214
        C4U124 = C4*U124
        DV138Z281 = DV138*Z281
        C8DV138 = C8*DV138
        DN6XX8 = S8*WP18 + C8DV138
        DN6XY8 = C8*U328 - S8*U318
        DN6XZ8 = S8*U218 + C8*DW318
        DN6YZ8 = S8*DW238 - C8*U128
        DN6ZZ8 = S8*DV238 - C8DV138
        DN6MX8 = C8*VSP28
        DN6MY8 = -S8*VSP28
        # Joint 1
        D[0, 0] = QDP1                                                    # DG1ZZ1
        D[1, 0] = VP21                                                    # DG1MX1
        D[2, 0] = -VP11                                                   # DG1MY1
        D[3, 0] = QP1                                                     # DG1FV1
        D[4, 0] = signQP1                                                 # DG1FS1
        D[6, 0] = -S2*WP12 - C2*DV132                                     # DG1XX2
        D[7, 0] = S2*U312 - C2*U322                                       # DG1XY2
        D[8, 0] = -S2*U212 - C2*DW312                                     # DG1XZ2
        D[9, 0] = C2*U122 - S2*DW232                                      # DG1YZ2
        D[11, 0] = C2*VSP22 + U112V121 + U212V221 + D2*U312               # DG1MX2
        D[12, 0] = U122V121 + U222V221 + D2*U322 - S2*VSP22               # DG1MY2
        D[16, 0] = C2*VP23 + S2QDP1*V221 - S2*VP33 - DV331*V131 - C2QDP1*V121  # DG1MX3
        D[17, 0] = -C2*VP13 - U212V221 - U112V121 - U312*V131             # DG1MY3
        D[18, 0] = S2*VP13 - U222V221 - U122V121 - U322*V131              # DG1MZ3
        D[19, 0] = VP13*V131 - VP23*V121 - VP33*V221                      # DG1M3
        D[24, 0] = WP14*Z141 + DV134Z241 - S2*DV124                       # DG1XX4
        D[25, 0] = U324*Z241 + S2*DW124 - U314*Z141                       # DG1XY4
        D[26, 0] = U214*Z141 + DW314*Z241 - S2*U234                       # DG1XZ4
        D[27, 0] = DW234*Z141 + S2*U134 - U124*Z241                       # DG1YZ4
        D[28, 0] = DV234*Z141 + S2*WP34 - DV134Z241                       # DG1ZZ4
        D[29, 0] = S2*VP24 + U114*V141 + U214*V241 + U314*V341 - VSP24*Z241  # DG1MX4
        D[30, 0] = VSP24*Z141 + U124*V141 + U224*V241 + U324*V341 - S2*VP14  # DG1MY4
        D[35, 0] = -S6*WP16 - C6*DV136                                    # DG1XX6
        D[36, 0] = S6*U316 - C6*U326                                      # DG1XY6
        D[37, 0] = -S6*U216 - C6*DW316                                    # DG1XZ6
        D[38, 0] = C6*U126 - S6*DW236                                     # DG1YZ6
        D[40, 0] = D6*U316 - C6*VSP16                                     # DG1MX6
        D[41, 0] = S6*VSP16 + D6*U326                                     # DG1MY6
        D[45, 0] = -S67*WP17 - C67*DV137                                  # DG1XX7
        D[46, 0] = S67*U317 - C67*U327                                    # DG1XY7
        D[47, 0] = -S67*U217 - C67*DW317                                  # DG1XZ7
        D[48, 0] = C67*U127 - S67*DW237                                   # DG1YZ7
        D[50, 0] = C67*VSP37 + U317*V371                                  # DG1MX7
        D[51, 0] = U327*V371 - S67*VSP37                                  # DG1MY7
        D[56, 0] = WP18*Z181 + DV138Z281 - C67*DV128                      # DG1XX8
        D[57, 0] = U328*Z281 + C67*DW128 - U318*Z181                      # DG1XY8
        D[58, 0] = U218*Z181 + DW318*Z281 - C67*U238                      # DG1XZ8
        D[59, 0] = DW238*Z181 + C67*U138 - U128*Z281                      # DG1YZ8
        D[60, 0] = DV238*Z181 + C67*WP38 - DV138Z281                      # DG1ZZ8
        D[61, 0] = VSP28*Z281 + C67*VP28 + U118*V181 + U218*V281          # DG1MX8
        D[62, 0] = U128*V181 + U228*V281 - VSP28*Z181 - C67*VP18          # DG1MY8
        # Joint 2
        D[6, 1] = -DV122                # DG2XX2
        D[7, 1] = DW122                 # DG2XY2
        D[8, 1] = -S2QDP1               # DG2XZ2
        D[9, 1] = -C2QDP1               # DG2YZ2
        D[10, 1] = QDP2                 # DG2ZZ2
        D[11, 1] = VP22                 # DG2MX2
        D[12, 1] = -VP12                # DG2MY2
        D[13, 1] = QP2                  # DG2FV2
        D[14, 1] = signQP2              # DG2FS2
        D[16, 1] = -r3*C2QDP1           # DG2MX3
        D[17, 1] = VP33 - r3*U112       # DG2MY3
        D[18, 1] = DF2MZ3 - VP23        # DG2MZ3
        D[19, 1] = -r3*VP23             # DG2M3
        D[24, 1] = S4*WP14 + C4DV134    # DG2XX4
        D[25, 1] = C4*U324 - S4*U314    # DG2XY4
        D[26, 1] = S4U214 + C4*DW314    # DG2XZ4
        D[27, 1] = S4*DW234 - C4U124    # DG2YZ4
        D[28, 1] = S4*DV234 - C4DV134   # DG2ZZ4
        D[29, 1] = -C4*VSP24 - r3*U314  # DG2MX4
        D[30, 1] = S4*VSP24 - r3*U324   # DG2MY4
        # Joint 3
        D[16, 2] = -S2QDP1           # DG3MX3
        D[17, 2] = U212              # DG3MY3
        D[18, 2] = U222              # DG3MZ3
        D[19, 2] = VP33              # DG3M3
        D[20, 2] = QDP3              # DG3Ia3
        D[21, 2] = QP3               # DG3FV3
        D[22, 2] = signQP3           # DG3FS3
        D[29, 2] = C4*U114 - S4U214  # DG3MX4
        D[30, 2] = C4U124 - S4*U224  # DG3MY4
        # Joint 4
        D[24, 3] = -DV124   # DG4XX4
        D[25, 3] = DW124    # DG4XY4
        D[26, 3] = -U234    # DG4XZ4
        D[27, 3] = U134     # DG4YZ4
        D[28, 3] = WP34     # DG4ZZ4
        D[29, 3] = VP24     # DG4MX4
        D[30, 3] = -VP14    # DG4MY4
        D[31, 3] = QDP4     # DG4Ia4
        D[32, 3] = QP4      # DG4FV4
        D[33, 3] = signQP4  # DG4FS4
        # Joint 6
        D[35, 4] = -DV126                                      # DG6XX6
        D[36, 4] = DW126                                       # DG6XY6
        D[37, 4] = -S6QDP1                                     # DG6XZ6
        D[38, 4] = -C6QDP1                                     # DG6YZ6
        D[39, 4] = QDP6                                        # DG6ZZ6
        D[40, 4] = VP26                                        # DG6MX6
        D[41, 4] = -VP16                                       # DG6MY6
        D[42, 4] = QP6                                         # DG6FV6
        D[43, 4] = signQP6                                     # DG6FS6
        D[45, 4] = -DV127                                      # DG6XX7
        D[46, 4] = DW127                                       # DG6XY7
        D[47, 4] = -S67QDP1                                    # DG6XZ7
        D[48, 4] = -C67QDP1                                    # DG6YZ7
        D[49, 4] = WP37                                        # DG6ZZ7
        D[50, 4] = VP27 + U117*V176 + U217*V276                # DG6MX7
        D[51, 4] = U127*V176 + U227*V276 - VP17                # DG6MY7
        D[56, 4] = DN6XX8                                      # DG6XX8
        D[57, 4] = DN6XY8                                      # DG6XY8
        D[58, 4] = DN6XZ8                                      # DG6XZ8
        D[59, 4] = DN6YZ8                                      # DG6YZ8
        D[60, 4] = DN6ZZ8                                      # DG6ZZ8
        D[61, 4] = DN6MX8 + U118*V186 + U218*V286 - U318*V276  # DG6MX8
        D[62, 4] = DN6MY8 + U128*V186 + U228*V286 - U328*V276  # DG6MY8
        # Joint 7
        D[45, 5] = -DV127                          # DG7XX7
        D[46, 5] = DW127                           # DG7XY7
        D[47, 5] = -S67QDP1                        # DG7XZ7
        D[48, 5] = -C67QDP1                        # DG7YZ7
        D[49, 5] = WP37                            # DG7ZZ7
        D[50, 5] = VP27                            # DG7MX7
        D[51, 5] = -VP17                           # DG7MY7
        D[52, 5] = QDP7                            # DG7Ia7
        D[53, 5] = QP7                             # DG7FV7
        D[54, 5] = signQP7                         # DG7FS7
        D[56, 5] = DN6XX8                          # DG7XX8
        D[57, 5] = DN6XY8                          # DG7XY8
        D[58, 5] = DN6XZ8                          # DG7XZ8
        D[59, 5] = DN6YZ8                          # DG7YZ8
        D[60, 5] = DN6ZZ8                          # DG7ZZ8
        D[61, 5] = DN6MX8 + U118*V187 + U218*V287  # DG7MX8
        D[62, 5] = DN6MY8 + U128*V187 + U228*V287  # DG7MY8
        # Joint 8
        D[56, 6] = -DV128   # DG8XX8
        D[57, 6] = DW128    # DG8XY8
        D[58, 6] = -U238    # DG8XZ8
        D[59, 6] = U138     # DG8YZ8
        D[60, 6] = WP38     # DG8ZZ8
        D[61, 6] = VP28     # DG8MX8
        D[62, 6] = -VP18    # DG8MY8
        D[63, 6] = QDP8     # DG8Ia8
        D[64, 6] = QP8      # DG8FV8
        D[65, 6] = signQP8  # DG8FS8

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, MX1R, MY1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2, MY2, FV2, FS2,
            OFFSET2, MX3R, MY3R, MZ3, M3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4R, XZ4R, YZ4R, ZZ4R,
            MX4R, MY4R, Ia4, FV4, FS4, OFFSET4, XX6R, XY6, XZ6R, YZ6, ZZ6R, MX6R, MY6, FV6, FS6,
            OFFSET6, XX7R, XY7, XZ7, YZ7, ZZ7R, MX7, MY7R, Ia7, FV7, FS7, OFFSET7, XX8R, XY8, XZ8,
            YZ8, ZZ8, MX8, MY8, Ia8, FV8, FS8, OFFSET8
        ) = X
        # Joint 8
        F18 = MX8*U118 + MY8*U128
        F28 = MX8*U218 + MY8*U228
        F38 = MX8*U318 + MY8*U328
        N18 = XX8R*WP18 + ZZ8*DV238 + YZ8*DW238 + XZ8*U218 - XY8*U318 - MY8*VSP28
        N28 = (XX8R - ZZ8)*DV138 + XZ8*DW318 + XY8*U328 + MX8*VSP28 - YZ8*U128
        N38 = ZZ8*WP38 + XY8*DW128 + YZ8*U138 + MX8*VP28 - XX8R*DV128 - XZ8*U238 - MY8*VP18
        FDI18 = C8*F18 - S8*F28
        FDI38 = S8*F18 + C8*F28
        # Joint 7
        F17 = MX7*U117 + MY7R*U127
        F27 = MX7*U217 + MY7R*U227
        F37 = MX7*U317 + MY7R*U327
        E17 = FDI18 + F17
        E27 = F27 - F38
        E37 = FDI38 + F37
        N17 = XX7R*WP17 + ZZ7R*DV237 + YZ7*DW237 + XZ7*U217 + MY7R*VSP37 - XY7*U317
        N27 = (XX7R - ZZ7R)*DV137 + XZ7*DW317 + XY7*U327 - YZ7*U127 - MX7*VSP37
        N37 = ZZ7R*WP37 + XY7*DW127 + MX7*VP27 - XX7R*DV127 - YZ7*C67QDP1 - XZ7*S67QDP1 - MY7R*VP17
        NE17 = C8*N18 + N17 - S8*N28 - RL8*FDI38
        NE27 = N27 - N38
        NE37 = S8*N18 + C8*N28 + RL8*FDI18 + N37
        FDI27 = S7*E17 + C7*E27
        # Joint 6
        F36 = MX6R*U316 + MY6*U326
        E36 = E37 + F36
        N16 = XX6R*WP16 + ZZ6R*DV236 + YZ6*DW236 + XZ6R*U216 - XY6*U316 - MY6*VSP16
        N26 = (XX6R - ZZ6R)*DV136 + XZ6R*DW316 + XY6*U326 + MX6R*VSP16 - YZ6*U126
        N36 = ZZ6R*QDP6 + XY6*DW126 + MX6R*VP26 - XX6R*DV126 - YZ6*C6QDP1 - XZ6R*S6QDP1 - MY6*VP16
        NE16 = C7*NE17 + N16 - S7*NE27
        NE26 = S7*NE17 + C7*NE27 + N26 - D7*E37
        NE36 = NE37 + D7*FDI27 + N36
        # Joint 4
        F14 = MX4R*U114 + MY4R*U124
        F24 = MX4R*U214 + MY4R*U224
        F34 = MX4R*U314 + MY4R*U324
        N14 = XX4R*WP14 + ZZ4R*DV234 + YZ4R*DW234 + XZ4R*U214 + MY4R*VSP24 - XY4R*U314
        N24 = (XX4R - ZZ4R)*DV134 + XZ4R*DW314 + XY4R*U324 - YZ4R*U124 - MX4R*VSP24
        N34 = ZZ4R*WP34 + XY4R*DW124 + YZ4R*U134 + MX4R*VP24 - XX4R*DV124 - XZ4R*U234 - MY4R*VP14
        FDI14 = S4*F14 + C4*F24
        FDI34 = C4*F14 - S4*F24
        # Joint 3
        F13 = M3R*VP13 - MX3R*DV331 - MY3R*U312 - MZ3*U322
        F23 = M3R*VP23 + MX3R*C2QDP1 + MY3R*U112 + MZ3*U122
        F33 = M3R*VP33 + MY3R*U212 + MZ3*U222 - MX3R*S2QDP1
        E13 = FDI14 + F13
        E23 = F34 + F23
        E33 = FDI34 + F33
        N13 = MY3R*VP33 - MZ3*VP23
        N23 = MZ3*VP13 - MX3R*VP33
        N33 = MX3R*VP23 - MY3R*VP13
        NE13 = S4*N14 + C4*N24 + N13
        NE23 = N34 + N23 - D4*FDI34
        NE33 = C4*N14 + D4*F34 + N33 - S4*N24
        # Joint 2
        F12 = MX2*U112 + MY2*U122
        F22 = MX2*U212 + MY2*U222
        F32 = MX2*U312 + MY2*U322
        E12 = F12 - E23
        E22 = F22 - E33
        E32 = E13 + F32
        N12 = XX2R*WP12 + ZZ2R*DV232 + YZ2R*DW232 + XZ2R*U212 + MY2*VSP22 - XY2R*U312
        N22 = (XX2R - ZZ2R)*DV132 + XZ2R*DW312 + XY2R*U322 - YZ2R*U122 - MX2*VSP22
        N32 = ZZ2R*QDP2 + XY2R*DW122 + MX2*VP22 - XX2R*DV122 - YZ2R*C2QDP1 - XZ2R*S2QDP1 - MY2*VP12
        NE12 = N12 - NE23 - r3*E13
        NE22 = N22 - NE33
        NE32 = NE13 + N32 - r3*E23
        FDI12 = C2*E12 - S2*E22
        # Joint 1
        N31 = ZZ1R*QDP1 + MX1R*VP21 - MY1R*VP11
        NE31 = D6*E36 + D2*E32 + N31 - S6*NE16 - C6*NE26 - S2*NE12 - C2*NE22 - RL2*FDI12
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE32 + FV2*QP2 + FS2*signQP2
        GAM[2] = OFFSET3 + E33 + Ia3*QDP3 + FV3*QP3 + FS3*signQP3
        GAM[3] = OFFSET4 + N34 + Ia4*QDP4 + FV4*QP4 + FS4*signQP4
        GAM[4] = OFFSET6 + NE36 + FV6*QP6 + FS6*signQP6
        GAM[5] = OFFSET7 + NE37 + Ia7*QDP7 + FV7*QP7 + FS7*signQP7
        GAM[6] = OFFSET8 + N38 + Ia8*QDP8 + FV8*QP8 + FS8*signQP8

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D2, RL2, D4, B6, D6, D7, RL8):
    """Fill A, shape (7, 7, N), from q (7, N)."""
    # Inputs
    q2, q3, q4, q6, q7, q8 = q[1:]
    (
        ZZ1R, _, _, _, _, _, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2, MY2, _, _, _, MX3R, MY3R, MZ3,
        M3R, Ia3, _, _, _, XX4R, XY4R, XZ4R, YZ4R, ZZ4R, MX4R, MY4R, Ia4, _, _, _, XX6R, XY6,
        XZ6R, YZ6, ZZ6R, MX6R, MY6, _, _, _, XX7R, XY7, XZ7, YZ7, ZZ7R, MX7, MY7R, Ia7, _, _, _,
        XX8R, XY8, XZ8, YZ8, ZZ8, MX8, MY8, Ia8, _, _, _
    ) = X
    # Constants
    MSP12 = MX2 - MY3R
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    C8 = xp.cos(q8)
    S8 = xp.sin(q8)
    # Inputs
    r3 = 0.1 + q3
    # Composite link 8
    AS18 = MX8*C8 - MY8*S8
    AS38 = MX8*S8 + MY8*C8
    C8C8 = C8**2
    C8S8 = C8*S8
    AJA118 = XX8R*C8C8 - XY8*2*C8S8
    JP117 = XX7R + AJA118
    NE178 = XZ8*C8 - YZ8*S8 - RL8*AS18
    JP127 = XY7 - NE178
    JP137 = XZ7 + XX8R*C8S8 + XY8*2*C8C8 - XY8
    NE378 = XZ8*S8 + YZ8*C8 - RL8*AS38
    JP237 = YZ7 - NE378
    JP337 = ZZ7R + XX8R - AJA118
    MSP17 = MX7 + AS18
    # Composite link 7
    AS17 = C7*MSP17 - MY7R*S7
    AS27 = S7*MSP17 + MY7R*C7
    C7C7 = C7**2
    C7S7 = C7*S7
    JP116a = ZZ8 - JP117
    JP116b = C7C7*JP116a + JP127*2*C7S7
    NE167 = C7*JP137 - S7*JP237
    NE267 = S7*JP137 + C7*JP237
    D7AS17 = D7*AS17
    JP226a = 2*D7AS17
    JP116 = XX6R + ZZ8 - JP116b
    JP126 = XY6 + JP127*2*C7C7 - C7S7*JP116a - JP127 - D7*AS27
    JP136 = XZ6R + NE167 - D7*AS38
    JP226 = JP117 + JP116b + JP226a
    JP236 = YZ6 + NE267
    JP336 = ZZ6R + JP337 + JP226a
    MSP16 = MX6R + AS17
    MSP26 = MY6 + AS27
    # Composite link 6
    AS26 = C6*MSP16 - S6*MSP26
    AS36 = -S6*MSP16 - C6*MSP26
    NE316 = -S6*JP136 - C6*JP236
    B6AS36 = B6*AS36
    # Composite link 4
    AS14 = MX4R*S4 + MY4R*C4
    AS34 = MX4R*C4 - MY4R*S4
    S4S4 = S4**2
    C4S4 = C4*S4
    JP113 = XX4R*S4S4 + XY4R*2*C4S4
    NE134 = XZ4R*S4 + YZ4R*C4
    NE334 = XZ4R*C4 - YZ4R*S4
    D4AS14 = D4*AS14
    JP223a = 2*D4AS14
    JP133 = XX4R*C4S4 + XY4R - XY4R*2*S4S4 - D4*AS34
    JP223 = ZZ4R + JP223a
    JP333 = XX4R + JP223a - JP113
    MSP13 = MX3R + AS14
    MSP33 = MZ3 + AS34
    # Composite link 3
    JP112a = MSP33 + M3R*r3
    JP112b = r3*MSP33 + r3*JP112a
    JP112 = XX2R + JP223 + JP112b
    JP122 = XY2R + NE334 - MY3R*r3
    JP132 = XZ2R - NE134
    JP232 = YZ2R + r3*MSP13 - JP133
    JP332 = ZZ2R + JP113 + JP112b
    MSP22 = MY2 - JP112a
    # Composite link 2
    AS12 = MSP12*C2 - S2*MSP22
    AS32 = -MSP12*S2 - C2*MSP22
    NE312 = -S2*JP132 - C2*JP232 - RL2*AS32
    JP331 = (ZZ1R + JP116 + JP126*2*C6*S6 + 2*(D6*AS26 + B6AS36) + JP112 + C2**2*(JP333 - JP112) +
        JP122*2*C2*S2 + D2*AS12 + RL2*MSP13 + D2*(AS12 + D2*M3R) + RL2*(MSP13 +
        RL2*M3R) - C6**2*(JP116 - JP226) - 2*B6AS36)
    # Unit acceleration of joint 3
    E113 = M3R*S2
    NE313 = -S2*MSP13 - RL2*E113
    # Unit acceleration of joint 4
    NE234 = ZZ4R + D4AS14
    NE124 = -NE234 - r3*AS34
    E114 = -S2*AS14
    NE314 = C2*NE334 + D2*AS34 - S2*NE124 - RL2*E114
    # Unit acceleration of joint 7
    NE367 = JP337 + D7AS17
    NE317 = -S6*NE167 - C6*NE267
    # Unit acceleration of joint 8
    E268 = -S7*AS38
    NE168 = C7*NE178 + ZZ8*S7
    NE268 = S7*NE178 - ZZ8*C7 - D7*AS18
    NE368 = NE378 + D7*E268
    NE318 = D6*AS18 - S6*NE168 - C6*NE268
    # Inertia matrix
    A[0, 0] = JP331
    A[0, 1] = A[1, 0] = NE312
    A[1, 1] = JP332
    A[0, 2] = A[2, 0] = NE313
    A[1, 2] = A[2, 1] = MY3R
    A[2, 2] = M3R + Ia3
    A[0, 3] = A[3, 0] = NE314
    A[1, 3] = A[3, 1] = NE134
    A[2, 3] = A[3, 2] = -AS14
    A[3, 3] = ZZ4R + Ia4
    A[0, 4] = A[4, 0] = NE316
    A[4, 4] = JP336
    A[0, 5] = A[5, 0] = NE317
    A[4, 5] = A[5, 4] = NE367
    A[5, 5] = Ia7 + JP337
    A[0, 6] = A[6, 0] = NE318
    A[4, 6] = A[6, 4] = NE368
    A[5, 6] = A[6, 5] = NE378
    A[6, 6] = ZZ8 + Ia8


def _gravity_block(xp, q, GAM, X, D2, RL2, GX, GZ):
    """Fill GAM, shape (7, N), from q (7, N)."""
    # Inputs
    q1, q2, q3, q4, q6, q7, q8 = q
    (
        _, MX1R, MY1R, _, _, OFFSET1, _, _, _, _, _, MX2, MY2, _, _, OFFSET2, MX3R, MY3R, MZ3,
        M3R, _, _, _, OFFSET3, _, _, _, _, _, MX4R, MY4R, _, _, _, OFFSET4, _, _, _, _, _, MX6R,
        MY6, _, _, OFFSET6, _, _, _, _, _, MX7, MY7R, _, _, _, OFFSET7, _, _, _, _, _, MX8, MY8,
        _, _, _, OFFSET8
    ) = X
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    C8 = xp.cos(q8)
    S8 = xp.sin(q8)
    # Inputs
    r3 = 0.1 + q3
    # Link 1
    VP11 = -GX*C1
    VP21 = GX*S1
    # Link 2
    VP12 = C2*VP11 + GZ*S2
    VP22 = GZ*C2 - S2*VP11
    # Link 4
    VP14 = S4*VP21 - C4*VP22
    VP24 = S4*VP22 + C4*VP21
    # Link 6
    VP16 = C6*VP21 + GZ*S6
    VP26 = GZ*C6 - S6*VP21
    # Link 7
    VP17 = C7*VP16 + S7*VP26
    VP27 = C7*VP26 - S7*VP16
    # Link 8
    VP18 = C8*VP17 - S8*VP11
    VP28 = -C8*VP11 - S8*VP17
    # Joint 8
    N18 = -MY8*VP27
    N28 = MX8*VP27
    N38 = MX8*VP28 - MY8*VP18
    # Joint 7
    N17 = -MY7R*VP11
    N27 = MX7*VP11
    N37 = MX7*VP27 - MY7R*VP17
    NE17 = C8*N18 + N17 - S8*N28
    NE27 = N27 - N38
    NE37 = S8*N18 + C8*N28 + N37
    # Joint 6
    N16 = -MY6*VP11
    N26 = MX6R*VP11
    N36 = MX6R*VP26 - MY6*VP16
    NE16 = C7*NE17 + N16 - S7*NE27
    NE26 = S7*NE17 + C7*NE27 + N26
    NE36 = NE37 + N36
    # Joint 4
    N14 = -MY4R*VP12
    N24 = MX4R*VP12
    N34 = MX4R*VP24 - MY4R*VP14
    # Joint 3
    F13 = M3R*VP21
    F23 = -M3R*VP12
    F33 = -M3R*VP22
    N13 = MZ3*VP12 - MY3R*VP22
    N23 = MZ3*VP21 + MX3R*VP22
    N33 = -MX3R*VP12 - MY3R*VP21
    NE13 = S4*N14 + C4*N24 + N13
    NE23 = N34 + N23
    NE33 = C4*N14 + N33 - S4*N24
    # Joint 2
    N12 = MY2*VP21
    N22 = -MX2*VP21
    N32 = MX2*VP22 - MY2*VP12
    NE12 = N12 - NE23 - r3*F13
    NE22 = N22 - NE33
    NE32 = NE13 + N32 - r3*F23
    FDI12 = S2*F33 - C2*F23
    # Joint 1
    N31 = MX1R*VP21 - MY1R*VP11
    NE31 = D2*F13 + N31 - S6*NE16 - C6*NE26 - S2*NE12 - C2*NE22 - RL2*FDI12
    # Torques
    GAM[0] = OFFSET1 + NE31
    GAM[1] = OFFSET2 + NE32
    GAM[2] = OFFSET3 + F33
    GAM[3] = OFFSET4 + N34
    GAM[4] = OFFSET6 + NE36
    GAM[5] = OFFSET7 + NE37
    GAM[6] = OFFSET8 + N38


def _frame_poses_block(xp, q, T, D2, RL2, D4, D5, RL5, B6, D6, D7, RL8):
    """Fill T, shape (8, 4, 4, N), from q (7, N)."""
    # Inputs
    q1, q2, q3, q4, q6, q7, q8 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    th67 = q6 + q7
    C67 = xp.cos(th67)
    S67 = xp.sin(th67)
    C8 = xp.cos(q8)
    S8 = xp.sin(q8)
    # Inputs
    r3 = 0.1 + q3
    # Joint axes Z and velocities V seen from link 4
    Z141 = C2*C4
    Z241 = -C2*S4
    # Joint axes Z and velocities V seen from link 8
    Z181 = -S67*C8
    Z281 = S67*S8
    # Frame 2
    R112 = C1*C2
    R122 = -C1*S2
    R212 = S1*C2
    R222 = -S1*S2
    P12 = D2*C1 - RL2*S1
    P22 = D2*S1 + RL2*C1
    # Frame 3
    P13 = P12 - r3*R122
    P23 = P22 - r3*R222
    P33 = C2*r3
    # Frame 4
    R114 = -S1*S4 - C4*R122
    R124 = S4*R122 - S1*C4
    R214 = C1*S4 - C4*R222
    R224 = S4*R222 + C1*C4
    P14 = P13 - D4*S1
    P24 = P23 + D4*C1
    # Frame 5
    P15 = P14 + D5*R114 - RL5*R124
    P25 = P24 + D5*R214 - RL5*R224
    P35 = P33 + D5*Z141 - RL5*Z241
    # Frame 6
    R116 = -S1*C6
    R126 = S1*S6
    R216 = C1*C6
    R226 = -C1*S6
    P16 = -D6*S1
    P26 = D6*C1
    # Frame 7
    R117 = -S1*C67
    R127 = S1*S67
    R217 = C1*C67
    R227 = -C1*S67
    P17 = P16 + D7*R116
    P27 = P26 + D7*R216
    P37 = B6 - D7*S6
    # Frame 8
    R118 = C8*R117 - C1*S8
    R128 = -C1*C8 - S8*R117
    R218 = C8*R217 - S1*S8
    R228 = -S1*C8 - S8*R217
    P18 = P17 - RL8*R127
    P28 = P27 - RL8*R227
    P38 = P37 + RL8*C67
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[1, 0, 0] = R112
    T[1, 0, 1] = R122
    T[1, 0, 2] = -S1
    T[1, 0, 3] = P12
    T[1, 1, 0] = R212
    T[1, 1, 1] = R222
    T[1, 1, 2] = C1
    T[1, 1, 3] = P22
    T[1, 2, 0] = -S2
    T[1, 2, 1] = -C2
    T[2, 0, 0] = -S1
    T[2, 0, 1] = -R112
    T[2, 0, 2] = -R122
    T[2, 0, 3] = P13
    T[2, 1, 0] = C1
    T[2, 1, 1] = -R212
    T[2, 1, 2] = -R222
    T[2, 1, 3] = P23
    T[2, 2, 1] = S2
    T[2, 2, 2] = C2
    T[2, 2, 3] = P33
    T[3, 0, 0] = R114
    T[3, 0, 1] = R124
    T[3, 0, 2] = -R112
    T[3, 0, 3] = P14
    T[3, 1, 0] = R214
    T[3, 1, 1] = R224
    T[3, 1, 2] = -R212
    T[3, 1, 3] = P24
    T[3, 2, 0] = Z141
    T[3, 2, 1] = Z241
    T[3, 2, 2] = S2
    T[3, 2, 3] = P33
    T[4, 0, 0] = R114
    T[4, 0, 1] = -R112
    T[4, 0, 2] = -R124
    T[4, 0, 3] = P15
    T[4, 1, 0] = R214
    T[4, 1, 1] = -R212
    T[4, 1, 2] = -R224
    T[4, 1, 3] = P25
    T[4, 2, 0] = Z141
    T[4, 2, 1] = S2
    T[4, 2, 2] = -Z241
    T[4, 2, 3] = P35
    T[5, 0, 0] = R116
    T[5, 0, 1] = R126
    T[5, 0, 2] = -C1
    T[5, 0, 3] = P16
    T[5, 1, 0] = R216
    T[5, 1, 1] = R226
    T[5, 1, 2] = -S1
    T[5, 1, 3] = P26
    T[5, 2, 0] = -S6
    T[5, 2, 1] = -C6
    T[5, 2, 3] = B6
    T[6, 0, 0] = R117
    T[6, 0, 1] = R127
    T[6, 0, 2] = -C1
    T[6, 0, 3] = P17
    T[6, 1, 0] = R217
    T[6, 1, 1] = R227
    T[6, 1, 2] = -S1
    T[6, 1, 3] = P27
    T[6, 2, 0] = -S67
    T[6, 2, 1] = -C67
    T[6, 2, 3] = P37
    T[7, 0, 0] = R118
    T[7, 0, 1] = R128
    T[7, 0, 2] = -R127
    T[7, 0, 3] = P18
    T[7, 1, 0] = R218
    T[7, 1, 1] = R228
    T[7, 1, 2] = -R227
    T[7, 1, 3] = P28
    T[7, 2, 0] = Z181
    T[7, 2, 1] = Z281
    T[7, 2, 2] = C67
    T[7, 2, 3] = P38
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 3, 3] = T[2, 3, 3] = T[3, 3, 3] = T[4, 3, 3] = T[5, 3, 3] = 1.0
    T[6, 3, 3] = T[7, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4, 5, 6, 7, 8)
DRIVES = None
LIMITS = {}
VALUES = {}
