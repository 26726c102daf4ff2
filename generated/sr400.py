"""SR400, 6 actuated joints, one parallelogram: base parameters, regressor, dynamics.

GENERATED from sr400.yaml, sha256 52f8fa1fb7bc, by symgen 0.5.0.
Do not edit; symgen generate sr400

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
     j  ant  mu  sigma  gamma  alpha    d  theta    r
     1    0   1      0      0      0    0     q1    0
     2    1   1      0      0  -pi/2   D2     q2    0
     3    2   0      0      0      0   D3     q3    0
     4    3   1      0      0  -pi/2   D4     q4  RL4
     5    4   1      0      0   pi/2    0     q5    0
     6    5   1      0      0  -pi/2    0     q6    0
     7    1   1      0      0  -pi/2   D2     q7    0
     8    7   0      0      0      0   D8     q8    0
     9    8   0      0      0      0   D3     q9    0
    10    3   0      2   pi/2      0  -D8      0    0
Gravity     acceleration (0, 0, -g) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q4, q5, q6, q7
    FV      viscous: along q1, q2, q4, q5, q6, q7
    FS      coulomb: along q1, q2, q4, q5, q6, q7
    OFFSET  offset: along q1, q2, q4, q5, q6, q7
Loop        frame 10 coincides with cut frame 9
Loop        q3 = pi/2 - q2 + q7
Loop        q8 = q2 - q7
Loop        q9 = pi - q2 + q7

Base parameters, 60 of 104; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 MZ2 MZ7

Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3
            column 1, Z132 component 1 in frame 3 of the axis of joint 2; what several share is
            named by its factors, C4DV134, by its function, signQP1, or by a letter, N16a in N16
    th   joint angle with its constant, rad
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
    regressor          392 multiplications, 284 additions, 6 sin, 6 cos
    inverse_dynamics   300 multiplications, 276 additions, 6 sin, 6 cos
    inertia_matrix     164 multiplications, 129 additions, 6 sin, 6 cos
    gravity            45 multiplications, 36 additions, 5 sin, 5 cos
    frame_poses        56 multiplications, 29 additions, 6 sin, 6 cos

Arguments   q, qd, qdd, tau of shape (N, 6), or (6,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (60,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 1e-14; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian, passive_joints,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: 93df930753992d17fdde9b491e1f8342799bf7a26b7c0d7e758fecdaf041d5ed
"""

import numpy as np

SCHEMA = 1
NAME = 'sr400'
SOURCE_SHA256 = '52f8fa1fb7bcb34e02e1d13b0386d4ccebf82b01028f393f42dd79d54ad69a8a'
JOINTS = (1, 2, 4, 5, 6, 7)
PASSIVE = (3, 8, 9)
CONSTANTS = {'D2': 0.25, 'D3': 0.6, 'D4': 0.15, 'RL4': 0.7, 'D8': 0.3, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R FV1 FS1 OFFSET1 XX2R XY2R XZ2R YZ2R ZZ2R MX2R MY2 FV2 FS2 OFFSET2 XX3R XY3R XZ3R YZ3R ZZ3R MX3R
MY3R XX4R XY4 XZ4 YZ4 ZZ4R MX4 MY4R Ia4 FV4 FS4 OFFSET4 XX5R XY5 XZ5 YZ5 ZZ5R MX5 MY5R Ia5 FV5 FS5
OFFSET5 XX6R XY6 XZ6 YZ6 ZZ6 MX6 MY6 Ia6 FV6 FS6 OFFSET6 MX7R MY7 FV7 FS7 OFFSET7 MY8
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 XX4 XY4 XZ4 YY4 YZ4 ZZ4 MX4 MY4 MZ4 M4
Ia4 FV4 FS4 OFFSET4 XX5 XY5 XZ5 YY5 YZ5 ZZ5 MX5 MY5 MZ5 M5 Ia5 FV5 FS5 OFFSET5 XX6 XY6 XZ6 YY6 YZ6
ZZ6 MX6 MY6 MZ6 M6 Ia6 FV6 FS6 OFFSET6 XX7 XY7 XZ7 YY7 YZ7 ZZ7 MX7 MY7 MZ7 M7 Ia7 FV7 FS7 OFFSET7
XX8 XY8 XZ8 YY8 YZ8 ZZ8 MX8 MY8 MZ8 M8
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'MX1', 'MY1', 'MZ1', 'M1', 'MZ2', 'MZ7')
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + YY2 + YY3 + XX7 + YY8 + D2**2*(M2 + M7 + M8) + (D2**2 + D3**2)*M3 +'
        ' (D2**2 + D3**2 + D4**2)*(M4 + M5 + M6)',
    'XX2R': 'XX2 - YY2 + XX8 - YY8 - D3**2*(M3 + M4 + M5 + M6)',
    'XY2R': 'XY2 + XY8',
    'XZ2R': 'XZ2 + XZ8 - D3*MZ3',
    'YZ2R': 'YZ2 + YZ8',
    'ZZ2R': 'ZZ2 + Ia2 + ZZ8 + D3**2*(M3 + M4 + M5 + M6)',
    'MX2R': 'MX2 + MX8 + D3*(M3 + M4 + M5 + M6)',
    'XX3R': 'XX3 - YY3 + YY4 - XX7 + YY7 + 2*RL4*MZ4 + (-D4**2 + RL4**2)*(M4 + M5 + M6) +'
        ' D8**2*M8',
    'XY3R': 'XY3 - XY7 - D4*MZ4 - D4*RL4*(M4 + M5 + M6)',
    'XZ3R': 'XZ3 + YZ7',
    'YZ3R': 'YZ3 - XZ7 + D8*MZ8',
    'ZZ3R': 'ZZ3 + YY4 + ZZ7 + Ia7 + 2*RL4*MZ4 + (D4**2 + RL4**2)*(M4 + M5 + M6) + D8**2*M8',
    'MX3R': 'MX3 + D4*(M4 + M5 + M6)',
    'MY3R': 'MY3 + MZ4 + RL4*(M4 + M5 + M6) - D8/D3*MX8',
    'XX4R': 'XX4 - YY4 + YY5',
    'ZZ4R': 'ZZ4 + YY5',
    'MY4R': 'MY4 - MZ5',
    'XX5R': 'XX5 - YY5 + YY6',
    'ZZ5R': 'ZZ5 + YY6',
    'MY5R': 'MY5 + MZ6',
    'XX6R': 'XX6 - YY6',
    'MX7R': 'MX7 - D8/D3*MX8 + D8*M8',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m N*m
kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m
kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m
N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m kg*m N*m*s/rad
N*m N*m kg*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x.....", "x.....", "x.....", "x.....", "xx....", "xx....", "xx....", "xx....", ".x....",
    "xx....", "xx....", ".x....", ".x....", ".x....", "x....x", "x....x", "x....x", "x....x",
    ".....x", "xx...x", "xx...x", "x.x..x", "x.x..x", "x.x..x", "x.x..x", "x.x..x", "xxx..x",
    "xxx..x", "..x...", "..x...", "..x...", "..x...", "x.xx.x", "x.xx.x", "x.xx.x", "x.xx.x",
    "x.xx.x", "xxxx.x", "xxxx.x", "...x..", "...x..", "...x..", "...x..", "x.xxxx", "x.xxxx",
    "x.xxxx", "x.xxxx", "x.xxxx", "xxxxxx", "xxxxxx", "....x.", "....x.", "....x.", "....x.",
    "x....x", "x....x", ".....x", ".....x", ".....x", "xx...x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (60, 6, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((60, 6, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[3, 0] = D[13, 1] = D[31, 2] = D[42, 3] = D[53, 4] = D[58, 5] = 1.0
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
    """The states as rows of samples, shape (N, 6) each; ValueError unless all have shape
    (N, 6), or all (6,).
    """
    states = [_real(x, "states") for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (6,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 6) each, or (6,) each")
    return tuple([x.reshape(-1, 6) for x in states])


def _parameters(X):
    """X; ValueError unless it has a value for each base parameter."""
    if tuple(X.shape) != (60,):
        raise ValueError(f"X of shape {X.shape}; expected (60,) in the order of BASE_PARAMETERS")
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
        if x.shape[-1:] != (6,):
            raise ValueError(f"state of shape {x.shape}; expected (..., 6)")
        return [x[..., k] for k in range(6)]

    def parameters(self, X):
        """X[k], one by one; NumPy's as plain numbers."""
        if self.package is not np and isinstance(X, np.ndarray | list | tuple):
            return _parameters(_real(X, "X")).tolist()
        _parameters(X)
        return [X[k] for k in range(60)]

    def gathered(self, table, shape, like):
        """Entries by index as an array, samples first; zero where there is none."""
        zero = self.package.zeros_like(like[..., 0])
        entries = [table.get(k[0] if len(k) == 1 else k, 0.0) for k in np.ndindex(*shape)]
        entries = [x if getattr(x, "shape", None) == zero.shape else zero + x for x in entries]
        return self.package.reshape(self.package.stack(entries, axis=-1), (*zero.shape, *shape))

    def combined(self, rows, x, origin):
        """Linear combinations of the columns of x, (origin, rates) each; without the origin for
        rates."""
        columns, table = self.rows(x), {}
        for k, (start, rates) in enumerate(rows):
            table[k] = start*origin + sum(g*y for g, y in zip(rates, columns))
        return self.gathered(table, (len(rows),), x)

    def solve(self, A, b):
        return self.package.linalg.solve(A, b[..., None])[..., 0]


class _Symbols:
    """Functions of CasADi under NumPy's names, on columns."""

    def __init__(self):
        import casadi as ca

        self.package, self.maximum, self.minimum = ca, ca.fmax, ca.fmin

    def rows(self, x, count=6):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 60)

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

    combined = _Arrays.combined

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

    Inputs are columns q, qd, qdd, tau (6,), X (60,), standard (104,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (6, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 60, "standard": 104}
    columns = {x: ca.SX.sym(x, sizes.get(x, 6)) for x in columns}
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
    'frame_poses': ('q', 'T1 T2 T3 T4 T5 T6 T7 T8 T9 T10'),
    'jacobian': ('q', 'J'),
    'passive_joints': ('q qd qdd', 'q_passive qd_passive qdd_passive'),
}


def elements(
    *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3,
    g: float = 9.81
) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D2, D3, D4, RL4, D8, g))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
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
    standard: "Array", *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7,
    D8: float = 0.3, g: float = 9.81
) -> "Array":
    """X, shape (60,), from the 104 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (104,):
            raise ValueError(
                f"standard of shape {shape}; expected (104,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(104)]
    if xp is np:
        _numbers((D2, D3, D4, RL4, D8, g))
    (
        _, _, _, _, _, ZZ1, _, _, _, _, Ia1, FV1, FS1, OFFSET1, XX2, XY2, XZ2, YY2, YZ2, ZZ2,
        MX2, MY2, _, M2, Ia2, FV2, FS2, OFFSET2, XX3, XY3, XZ3, YY3, YZ3, ZZ3, MX3, MY3, MZ3,
        M3, XX4, XY4, XZ4, YY4, YZ4, ZZ4, MX4, MY4, MZ4, M4, Ia4, FV4, FS4, OFFSET4, XX5, XY5,
        XZ5, YY5, YZ5, ZZ5, MX5, MY5, MZ5, M5, Ia5, FV5, FS5, OFFSET5, XX6, XY6, XZ6, YY6, YZ6,
        ZZ6, MX6, MY6, MZ6, M6, Ia6, FV6, FS6, OFFSET6, XX7, XY7, XZ7, YY7, YZ7, ZZ7, MX7, MY7,
        _, M7, Ia7, FV7, FS7, OFFSET7, XX8, XY8, XZ8, YY8, YZ8, ZZ8, MX8, MY8, MZ8, M8
    ) = standard
    ZZ1R = (ZZ1 + Ia1 + YY2 + YY3 + XX7 + YY8 + D2**2*(M2 + M7 + M8) + (D2**2 + D3**2)*M3 +
        (D2**2 + D3**2 + D4**2)*(M4 + M5 + M6))
    XX2R = XX2 - YY2 + XX8 - YY8 - D3**2*(M3 + M4 + M5 + M6)
    XY2R = XY2 + XY8
    XZ2R = XZ2 + XZ8 - D3*MZ3
    YZ2R = YZ2 + YZ8
    ZZ2R = ZZ2 + Ia2 + ZZ8 + D3**2*(M3 + M4 + M5 + M6)
    MX2R = MX2 + MX8 + D3*(M3 + M4 + M5 + M6)
    XX3R = XX3 - YY3 + YY4 - XX7 + YY7 + 2*RL4*MZ4 + (-D4**2 + RL4**2)*(M4 + M5 + M6) + D8**2*M8
    XY3R = XY3 - XY7 - D4*MZ4 - D4*RL4*(M4 + M5 + M6)
    XZ3R = XZ3 + YZ7
    YZ3R = YZ3 - XZ7 + D8*MZ8
    ZZ3R = ZZ3 + YY4 + ZZ7 + Ia7 + 2*RL4*MZ4 + (D4**2 + RL4**2)*(M4 + M5 + M6) + D8**2*M8
    MX3R = MX3 + D4*(M4 + M5 + M6)
    MY3R = MY3 + MZ4 + RL4*(M4 + M5 + M6) - D8/D3*MX8
    XX4R = XX4 - YY4 + YY5
    ZZ4R = ZZ4 + YY5
    MY4R = MY4 - MZ5
    XX5R = XX5 - YY5 + YY6
    ZZ5R = ZZ5 + YY6
    MY5R = MY5 + MZ6
    XX6R = XX6 - YY6
    MX7R = MX7 - D8/D3*MX8 + D8*M8
    return (np.array if xp is np else xp.stack)([
        ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2R, MY2, FV2, FS2, OFFSET2, XX3R,
        XY3R, XZ3R, YZ3R, ZZ3R, MX3R, MY3R, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4, MY4R, Ia4, FV4, FS4,
        OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5, OFFSET5, XX6R, XY6, XZ6, YZ6,
        ZZ6, MX6, MY6, Ia6, FV6, FS6, OFFSET6, MX7R, MY7, FV7, FS7, OFFSET7, MY8,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.25,
    D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 6, 60).

    A view on one store of shape (60, 6, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, D3, D4, RL4, D8, g))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.25,
    D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (6*N, 60), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, D3, D4, RL4, D8, g))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 60))
    return filled.reshape(60, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 6, 60)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (60, 6), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (60, 6, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(60, 6, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D2: float = 0.25, D3: float = 0.6,
    D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 6).
    """
    return _evaluated(_inverse_dynamics_block, (6,), (q, qd, qdd), (X,), (D2, D3, D4, RL4, D8, g))


def inertia_matrix(
    q: "Array", X: "Array", *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15,
    RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 6, 6).
    """
    return _evaluated(_inertia_matrix_block, (6, 6), (q,), (X,), (D2, D3, D4, RL4, D8))


def bias(
    q: "Array", qd: "Array", X: "Array", *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15,
    RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 6).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D2=D2, D3=D3, D4=D4, RL4=RL4, D8=D8, g=g)


def gravity(
    q: "Array", X: "Array", *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15,
    RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 6).
    """
    return _evaluated(_gravity_block, (6,), (q,), (X,), (g,))


def frame_poses(
    q: "Array", *, D2: float = 0.25, D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7,
    D8: float = 0.3, g: float = 9.81
) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 10, 4, 4).
    """
    return _evaluated(_frame_poses_block, (10, 4, 4), (q,), (), (D2, D3, D4, RL4, D8))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D2: float = 0.25, D3: float = 0.6,
    D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 6)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D2=D2, D3=D3, D4=D4, RL4=RL4, D8=D8,
        g=g)
    inertia = inertia_matrix(q, X, D2=D2, D3=D3, D4=D4, RL4=RL4, D8=D8, g=g)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, D2: float = 0.25, D3: float = 0.6,
    D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 6).
    """
    frame = 10 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 10:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 10")
    return _evaluated(_jacobian_block, (6, 6), (q,), (), (frame, D2, D3, D4, RL4, D8))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 6, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(10, 4, 4), 0.0)
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
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((1, 1.0),)), 3: (2, 0, ((1, -1.0), (5, 1.0))),
        4: (3, 0, ((2, 1.0),)), 5: (4, 0, ((3, 1.0),)), 6: (5, 0, ((4, 1.0),)),
        7: (1, 0, ((5, 1.0),)), 8: (7, 0, ((1, 1.0), (5, -1.0))), 9: (8, 0, ((1, -1.0), (5, 1.0))),
        10: (3, 2, ()),
    }


def passive_joints(
    q: "Array", qd: "Array | None" = None, qdd: "Array | None" = None, *, D2: float = 0.25,
    D3: float = 0.6, D4: float = 0.15, RL4: float = 0.7, D8: float = 0.3, g: float = 9.81
) -> "Array | tuple":
    """Positions of the joints PASSIVE, shape (N, 3); with qd also their velocities, with qdd
    also their accelerations.
    """
    given = [state for state in (q, qd, qdd) if state is not None]
    xp = _package(*given)
    rows = _passive(xp)
    if xp is not np:
        results = [xp.combined(rows, x, k == 0) for k, x in enumerate(given)]
        return results[0] if len(results) == 1 else tuple(results)
    given = _states(*given)
    origin, rates = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    shape = (*np.shape(q)[:-1], 3)
    results = [(x @ rates.T).reshape(shape) for x in given]
    results[0] += origin
    return results[0] if len(results) == 1 else tuple(results)


def _passive(xp):
    """(origin, rates) of the joints PASSIVE over the joints of the columns."""
    return (
        (xp.pi/2, (0.0, -1.0, 0.0, 0.0, 0.0, 1.0)),
        (0.0, (0.0, 1.0, 0.0, 0.0, 0.0, -1.0)),
        (xp.pi, (0.0, -1.0, 0.0, 0.0, 0.0, 1.0)),
    )


def _regressor_block(xp, q, qd, qdd, D, D2, D3, D4, RL4, D8, g):
    """Fill D, shape (60, 6, N), where it is not constant, from q, qd, qdd (6, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D2, D3, D4, RL4, D8, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D2, D3, D4, RL4, D8, g):
    """Fill GAM, shape (6, N), from q, qd, qdd (6, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D2, D3, D4, RL4, D8, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D2, D3, D4, RL4, D8, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q2, q4, q5, q6, q7 = q[1:]
    QP1, QP2, QP4, QP5, QP6, QP7 = qd
    QDP1, QDP2, QDP4, QDP5, QDP6, QDP7 = qdd
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m7 = q2 - q7
    C2m7 = xp.cos(th2m7)
    S2m7 = xp.sin(th2m7)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Link 1
    DV3_3_1 = QP1**2
    # Link 2
    W1_2 = -S2*QP1
    W2_2 = -C2*QP1
    S2QDP1 = S2*QDP1
    C2QDP1 = C2*QDP1
    DV2_3_2 = QP2*W2_2
    WP1_2 = DV2_3_2 - S2QDP1
    DV1_3_2 = QP2*W1_2
    WP2_2 = -C2QDP1 - DV1_3_2
    DV1_1_2 = W1_2**2
    DV1_2_2 = W1_2*W2_2
    DV2_2_2 = W2_2**2
    DV3_3_2 = QP2**2
    DW2_3_2 = DV2_2_2 - DV3_3_2
    DW3_1_2 = DV3_3_2 - DV1_1_2
    DW1_2_2 = DV1_1_2 - DV2_2_2
    U1_1_2 = -DV2_2_2 - DV3_3_2
    U1_2_2 = DV1_2_2 - QDP2
    U2_1_2 = QDP2 + DV1_2_2
    U2_2_2 = -DV1_1_2 - DV3_3_2
    U3_1_2 = DV1_3_2 - WP2_2
    U3_2_2 = DV2_3_2 + WP1_2
    VSP1_2 = -D2*DV3_3_1
    VSP2_2 = D2*QDP1
    VP1_2 = C2*VSP1_2 - g*S2
    VP2_2 = -g*C2 - S2*VSP1_2
    # Link 3
    W1_3 = -C7*QP1
    W2_3 = S7*QP1
    C7QDP1 = C7*QDP1
    S7QDP1 = S7*QDP1
    DV2_3_3 = QP7*W2_3
    WP1_3 = DV2_3_3 - C7QDP1
    DV1_3_3 = QP7*W1_3
    WP2_3 = S7QDP1 - DV1_3_3
    DV1_1_3 = W1_3**2
    DV1_2_3 = W1_3*W2_3
    DV2_2_3 = W2_3**2
    DV3_3_3 = QP7**2
    DW2_3_3 = DV2_2_3 - DV3_3_3
    DW3_1_3 = DV3_3_3 - DV1_1_3
    DW1_2_3 = DV1_1_3 - DV2_2_3
    U1_1_3 = -DV2_2_3 - DV3_3_3
    U1_2_3 = DV1_2_3 - QDP7
    U2_1_3 = QDP7 + DV1_2_3
    U2_2_3 = -DV1_1_3 - DV3_3_3
    U3_1_3 = DV1_3_3 - WP2_3
    U3_2_3 = DV2_3_3 + WP1_3
    VSP1_3 = VP1_2 + D3*U1_1_2
    VSP2_3 = VP2_2 + D3*U2_1_2
    VSP3_3 = VSP2_2 + D3*U3_1_2
    VP1_3 = S2m7*VSP1_3 + C2m7*VSP2_3
    VP2_3 = S2m7*VSP2_3 - C2m7*VSP1_3
    # Link 4
    W1_4 = C4*W1_3 - S4*QP7
    W2_4 = -C4*QP7 - S4*W1_3
    W3_4 = QP4 + W2_3
    WP1_4 = C4*WP1_3 + QP4*W2_4 - S4*QDP7
    WP2_4 = -C4*QDP7 - S4*WP1_3 - QP4*W1_4
    WP3_4 = QDP4 + WP2_3
    DV1_1_4 = W1_4**2
    DV1_2_4 = W1_4*W2_4
    DV1_3_4 = W1_4*W3_4
    DV2_2_4 = W2_4**2
    DV2_3_4 = W2_4*W3_4
    DV3_3_4 = W3_4**2
    DW2_3_4 = DV2_2_4 - DV3_3_4
    DW3_1_4 = DV3_3_4 - DV1_1_4
    DW1_2_4 = DV1_1_4 - DV2_2_4
    U1_1_4 = -DV2_2_4 - DV3_3_4
    U1_2_4 = DV1_2_4 - WP3_4
    U1_3_4 = WP2_4 + DV1_3_4
    U2_1_4 = WP3_4 + DV1_2_4
    U2_2_4 = -DV1_1_4 - DV3_3_4
    U2_3_4 = DV2_3_4 - WP1_4
    U3_1_4 = DV1_3_4 - WP2_4
    U3_2_4 = WP1_4 + DV2_3_4
    VSP1_4 = VP1_3 + D4*U1_1_3 + RL4*U1_2_3
    VSP2_4 = VP2_3 + D4*U2_1_3 + RL4*U2_2_3
    VSP3_4 = VSP3_3 + D4*U3_1_3 + RL4*U3_2_3
    VP1_4 = C4*VSP1_4 - S4*VSP3_4
    VP2_4 = -C4*VSP3_4 - S4*VSP1_4
    # Link 5
    W1_5 = C5*W1_4 + S5*W3_4
    W2_5 = C5*W3_4 - S5*W1_4
    W3_5 = QP5 - W2_4
    WP1_5 = C5*WP1_4 + S5*WP3_4 + QP5*W2_5
    WP2_5 = C5*WP3_4 - S5*WP1_4 - QP5*W1_5
    WP3_5 = QDP5 - WP2_4
    DV1_1_5 = W1_5**2
    DV1_2_5 = W1_5*W2_5
    DV1_3_5 = W1_5*W3_5
    DV2_2_5 = W2_5**2
    DV2_3_5 = W2_5*W3_5
    DV3_3_5 = W3_5**2
    DW2_3_5 = DV2_2_5 - DV3_3_5
    DW3_1_5 = DV3_3_5 - DV1_1_5
    DW1_2_5 = DV1_1_5 - DV2_2_5
    U1_1_5 = -DV2_2_5 - DV3_3_5
    U1_2_5 = DV1_2_5 - WP3_5
    U1_3_5 = WP2_5 + DV1_3_5
    U2_1_5 = WP3_5 + DV1_2_5
    U2_2_5 = -DV1_1_5 - DV3_3_5
    U2_3_5 = DV2_3_5 - WP1_5
    U3_1_5 = DV1_3_5 - WP2_5
    U3_2_5 = WP1_5 + DV2_3_5
    VP1_5 = C5*VP1_4 + S5*VSP2_4
    VP2_5 = C5*VSP2_4 - S5*VP1_4
    # Link 6
    W1_6 = C6*W1_5 - S6*W3_5
    W2_6 = -C6*W3_5 - S6*W1_5
    W3_6 = QP6 + W2_5
    WP1_6 = C6*WP1_5 + QP6*W2_6 - S6*WP3_5
    WP2_6 = -C6*WP3_5 - S6*WP1_5 - QP6*W1_6
    WP3_6 = QDP6 + WP2_5
    DV1_1_6 = W1_6**2
    DV1_2_6 = W1_6*W2_6
    DV1_3_6 = W1_6*W3_6
    DV2_2_6 = W2_6**2
    DV2_3_6 = W2_6*W3_6
    DV3_3_6 = W3_6**2
    DW2_3_6 = DV2_2_6 - DV3_3_6
    DW3_1_6 = DV3_3_6 - DV1_1_6
    DW1_2_6 = DV1_1_6 - DV2_2_6
    U1_1_6 = -DV2_2_6 - DV3_3_6
    U1_2_6 = DV1_2_6 - WP3_6
    U1_3_6 = WP2_6 + DV1_3_6
    U2_1_6 = WP3_6 + DV1_2_6
    U2_2_6 = -DV1_1_6 - DV3_3_6
    U2_3_6 = DV2_3_6 - WP1_6
    U3_1_6 = DV1_3_6 - WP2_6
    U3_2_6 = WP1_6 + DV2_3_6
    VP1_6 = C6*VP1_5 + S6*VP2_4
    VP2_6 = C6*VP2_4 - S6*VP1_5
    # Link 7
    VP1_7 = C7*VSP1_2 - g*S7
    VP2_7 = -g*C7 - S7*VSP1_2
    # Link 8
    VSP1_8 = VP1_7 + D8*U2_2_3
    VSP2_8 = VP2_7 - D8*U1_2_3
    VSP3_8 = VSP2_2 - D8*U3_2_3
    VP1_8 = C2m7*VSP1_8 + S2m7*VSP2_8
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP4 = xp.sign(QP4)
    signQP5 = xp.sign(QP5)
    signQP6 = xp.sign(QP6)
    signQP7 = xp.sign(QP7)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 3
        V3_3_1 = D2 + D3*C2
        V1_3_2 = D3*C2m7
        V2_3_2 = D3*S2m7
        # Joint axes Z and velocities V seen from link 4
        Z1_4_1 = -C7*C4
        Z2_4_1 = C7*S4
        VS3_4_1 = V3_3_1 - RL4*C7 - D4*S7
        V1_4_1 = -S4*VS3_4_1
        V2_4_1 = -C4*VS3_4_1
        VS1_4_2 = V1_3_2 - RL4
        V3_4_2 = D4 + V2_3_2
        V1_4_2 = C4*VS1_4_2
        V2_4_2 = -S4*VS1_4_2
        V1_4_3 = -RL4*C4
        V2_4_3 = RL4*S4
        # Joint axes Z and velocities V seen from link 5
        Z1_5_1 = C5*Z1_4_1 + S7*S5
        Z2_5_1 = S7*C5 - S5*Z1_4_1
        V1_5_1 = C5*V1_4_1
        V2_5_1 = -S5*V1_4_1
        Z1_5_2 = -S4*C5
        Z2_5_2 = S4*S5
        V1_5_2 = C5*V1_4_2 + S5*V3_4_2
        V2_5_2 = C5*V3_4_2 - S5*V1_4_2
        V1_5_3 = C5*V1_4_3 + D4*S5
        V2_5_3 = D4*C5 - S5*V1_4_3
        # Joint axes Z and velocities V seen from link 6
        Z1_6_1 = C6*Z1_5_1 + S6*Z2_4_1
        Z2_6_1 = C6*Z2_4_1 - S6*Z1_5_1
        V1_6_1 = C6*V1_5_1 + S6*V2_4_1
        V2_6_1 = C6*V2_4_1 - S6*V1_5_1
        Z1_6_2 = C6*Z1_5_2 - C4*S6
        Z2_6_2 = -C4*C6 - S6*Z1_5_2
        V1_6_2 = C6*V1_5_2 + S6*V2_4_2
        V2_6_2 = C6*V2_4_2 - S6*V1_5_2
        V1_6_3 = C6*V1_5_3 + S6*V2_4_3
        V2_6_3 = C6*V2_4_3 - S6*V1_5_3
        Z1_6_4 = S5*C6
        Z2_6_4 = -S5*S6
        # Joint axes Z and velocities V seen from link 8
        V3_8_1 = D2 + D8*C7
        V1_8_7 = D8*S2m7
        V2_8_7 = D8*C2m7
        # Contributions that several joints share
        DV1_3_4Z2_4_1 = DV1_3_4*Z2_4_1
        C4DV1_3_4 = C4*DV1_3_4
        DF3MX4 = U1_1_4*V1_4_3 + U2_1_4*V2_4_3 + D4*U3_1_4
        DF3MY4 = U1_2_4*V1_4_3 + U2_2_4*V2_4_3 + D4*U3_2_4
        DV1_3_5Z2_5_1 = DV1_3_5*Z2_5_1
        DV1_3_5Z2_5_2 = DV1_3_5*Z2_5_2
        C5DV1_3_5 = C5*DV1_3_5
        DF3MX5 = U1_1_5*V1_5_3 + U2_1_5*V2_5_3 - U3_1_5*V2_4_3
        DF3MY5 = U1_2_5*V1_5_3 + U2_2_5*V2_5_3 - U3_2_5*V2_4_3
        DV1_3_6Z2_6_1 = DV1_3_6*Z2_6_1
        DV1_3_6Z2_6_2 = DV1_3_6*Z2_6_2
        DV1_3_6Z2_6_4 = DV1_3_6*Z2_6_4
        C6DV1_3_6 = C6*DV1_3_6
        DF3MX6 = U1_1_6*V1_6_3 + U2_1_6*V2_6_3 + U3_1_6*V2_5_3
        DF3MY6 = U1_2_6*V1_6_3 + U2_2_6*V2_6_3 + U3_2_6*V2_5_3
        # Joint 1
        D[0, 0] = QDP1                                                    # DG1ZZ1
        D[1, 0] = QP1                                                     # DG1FV1
        D[2, 0] = signQP1                                                 # DG1FS1
        D[4, 0] = -S2*WP1_2 - C2*DV1_3_2                                  # DG1XX2
        D[5, 0] = S2*U3_1_2 - C2*U3_2_2                                   # DG1XY2
        D[6, 0] = -S2*U2_1_2 - C2*DW3_1_2                                 # DG1XZ2
        D[7, 0] = C2*U1_2_2 - S2*DW2_3_2                                  # DG1YZ2
        D[9, 0] = C2*VSP2_2 + D2*U3_1_2                                   # DG1MX2
        D[10, 0] = D2*U3_2_2 - S2*VSP2_2                                  # DG1MY2
        D[14, 0] = S7*DV1_3_3 - C7*WP1_3                                  # DG1XX3
        D[15, 0] = C7*U3_1_3 + S7*U3_2_3                                  # DG1XY3
        D[16, 0] = S7*DW3_1_3 - C7*U2_1_3                                 # DG1XZ3
        D[17, 0] = -C7*DW2_3_3 - S7*U1_2_3                                # DG1YZ3
        D[19, 0] = U3_1_3*V3_3_1 - S7*VSP3_3                              # DG1MX3
        D[20, 0] = U3_2_3*V3_3_1 - C7*VSP3_3                              # DG1MY3
        D[21, 0] = WP1_4*Z1_4_1 + DV1_3_4Z2_4_1 - S7*DV1_2_4              # DG1XX4
        D[22, 0] = U3_2_4*Z2_4_1 + S7*DW1_2_4 - U3_1_4*Z1_4_1             # DG1XY4
        D[23, 0] = U2_1_4*Z1_4_1 + DW3_1_4*Z2_4_1 - S7*U2_3_4             # DG1XZ4
        D[24, 0] = DW2_3_4*Z1_4_1 + S7*U1_3_4 - U1_2_4*Z2_4_1             # DG1YZ4
        D[25, 0] = DV2_3_4*Z1_4_1 + S7*WP3_4 - DV1_3_4Z2_4_1              # DG1ZZ4
        D[26, 0] = S7*VP2_4 + U1_1_4*V1_4_1 + U2_1_4*V2_4_1 - VSP2_4*Z2_4_1  # DG1MX4
        D[27, 0] = VSP2_4*Z1_4_1 + U1_2_4*V1_4_1 + U2_2_4*V2_4_1 - S7*VP1_4  # DG1MY4
        D[32, 0] = WP1_5*Z1_5_1 + DV1_3_5Z2_5_1 + DV1_2_5*Z2_4_1          # DG1XX5
        D[33, 0] = U3_2_5*Z2_5_1 - U3_1_5*Z1_5_1 - DW1_2_5*Z2_4_1         # DG1XY5
        D[34, 0] = U2_1_5*Z1_5_1 + DW3_1_5*Z2_5_1 + U2_3_5*Z2_4_1         # DG1XZ5
        D[35, 0] = DW2_3_5*Z1_5_1 - U1_2_5*Z2_5_1 - U1_3_5*Z2_4_1         # DG1YZ5
        D[36, 0] = DV2_3_5*Z1_5_1 - DV1_3_5Z2_5_1 - WP3_5*Z2_4_1          # DG1ZZ5
        # DG1MX5
        D[37, 0] = (VP2_4*Z2_5_1 + U1_1_5*V1_5_1 + U2_1_5*V2_5_1 - VP2_5*Z2_4_1 - U3_1_5*V2_4_1)
        # DG1MY5
        D[38, 0] = (VP1_5*Z2_4_1 + U1_2_5*V1_5_1 + U2_2_5*V2_5_1 - VP2_4*Z1_5_1 - U3_2_5*V2_4_1)
        D[43, 0] = WP1_6*Z1_6_1 + DV1_3_6Z2_6_1 - DV1_2_6*Z2_5_1          # DG1XX6
        D[44, 0] = U3_2_6*Z2_6_1 + DW1_2_6*Z2_5_1 - U3_1_6*Z1_6_1         # DG1XY6
        D[45, 0] = U2_1_6*Z1_6_1 + DW3_1_6*Z2_6_1 - U2_3_6*Z2_5_1         # DG1XZ6
        D[46, 0] = DW2_3_6*Z1_6_1 + U1_3_6*Z2_5_1 - U1_2_6*Z2_6_1         # DG1YZ6
        D[47, 0] = DV2_3_6*Z1_6_1 + WP3_6*Z2_5_1 - DV1_3_6Z2_6_1          # DG1ZZ6
        # DG1MX6
        D[48, 0] = (VP2_6*Z2_5_1 + U1_1_6*V1_6_1 + U2_1_6*V2_6_1 + U3_1_6*V2_5_1 - VP2_5*Z2_6_1)
        # DG1MY6
        D[49, 0] = (VP2_5*Z1_6_1 + U1_2_6*V1_6_1 + U2_2_6*V2_6_1 + U3_2_6*V2_5_1 - VP1_6*Z2_5_1)
        D[54, 0] = C7*VSP2_2 - D2*U3_2_3                                  # DG1MX7
        D[55, 0] = D2*U3_1_3 - S7*VSP2_2                                  # DG1MY7
        D[59, 0] = U3_2_2*V3_8_1 - S2*VSP3_8                              # DG1MY8
        # Joint 2
        D[4, 1] = -DV1_2_2                                                # DG2XX2
        D[5, 1] = DW1_2_2                                                 # DG2XY2
        D[6, 1] = -S2QDP1                                                 # DG2XZ2
        D[7, 1] = -C2QDP1                                                 # DG2YZ2
        D[8, 1] = QDP2                                                    # DG2ZZ2
        D[9, 1] = VP2_2                                                   # DG2MX2
        D[10, 1] = -VP1_2                                                 # DG2MY2
        D[11, 1] = QP2                                                    # DG2FV2
        D[12, 1] = signQP2                                                # DG2FS2
        D[19, 1] = U1_1_3*V1_3_2 + U2_1_3*V2_3_2                          # DG2MX3
        D[20, 1] = U1_2_3*V1_3_2 + U2_2_3*V2_3_2                          # DG2MY3
        D[26, 1] = U1_1_4*V1_4_2 + U2_1_4*V2_4_2 + U3_1_4*V3_4_2 - DF3MX4  # DG2MX4
        D[27, 1] = U1_2_4*V1_4_2 + U2_2_4*V2_4_2 + U3_2_4*V3_4_2 - DF3MY4  # DG2MY4
        D[37, 1] = U1_1_5*V1_5_2 + U2_1_5*V2_5_2 - U3_1_5*V2_4_2 - DF3MX5  # DG2MX5
        D[38, 1] = U1_2_5*V1_5_2 + U2_2_5*V2_5_2 - U3_2_5*V2_4_2 - DF3MY5  # DG2MY5
        D[48, 1] = U1_1_6*V1_6_2 + U2_1_6*V2_6_2 + U3_1_6*V2_5_2 - DF3MX6  # DG2MX6
        D[49, 1] = U1_2_6*V1_6_2 + U2_2_6*V2_6_2 + U3_2_6*V2_5_2 - DF3MY6  # DG2MY6
        D[59, 1] = -VP1_8                                                 # DG2MY8
        # Joint 4
        D[21, 2] = -DV1_2_4                                    # DG4XX4
        D[22, 2] = DW1_2_4                                     # DG4XY4
        D[23, 2] = -U2_3_4                                     # DG4XZ4
        D[24, 2] = U1_3_4                                      # DG4YZ4
        D[25, 2] = WP3_4                                       # DG4ZZ4
        D[26, 2] = VP2_4                                       # DG4MX4
        D[27, 2] = -VP1_4                                      # DG4MY4
        D[28, 2] = QDP4                                        # DG4Ia4
        D[29, 2] = QP4                                         # DG4FV4
        D[30, 2] = signQP4                                     # DG4FS4
        D[32, 2] = S5*WP1_5 + C5DV1_3_5                        # DG4XX5
        D[33, 2] = C5*U3_2_5 - S5*U3_1_5                       # DG4XY5
        D[34, 2] = S5*U2_1_5 + C5*DW3_1_5                      # DG4XZ5
        D[35, 2] = S5*DW2_3_5 - C5*U1_2_5                      # DG4YZ5
        D[36, 2] = S5*DV2_3_5 - C5DV1_3_5                      # DG4ZZ5
        D[37, 2] = C5*VP2_4                                    # DG4MX5
        D[38, 2] = -S5*VP2_4                                   # DG4MY5
        D[43, 2] = WP1_6*Z1_6_4 + DV1_3_6Z2_6_4 - C5*DV1_2_6   # DG4XX6
        D[44, 2] = U3_2_6*Z2_6_4 + C5*DW1_2_6 - U3_1_6*Z1_6_4  # DG4XY6
        D[45, 2] = U2_1_6*Z1_6_4 + DW3_1_6*Z2_6_4 - C5*U2_3_6  # DG4XZ6
        D[46, 2] = DW2_3_6*Z1_6_4 + C5*U1_3_6 - U1_2_6*Z2_6_4  # DG4YZ6
        D[47, 2] = DV2_3_6*Z1_6_4 + C5*WP3_6 - DV1_3_6Z2_6_4   # DG4ZZ6
        D[48, 2] = C5*VP2_6 - VP2_5*Z2_6_4                     # DG4MX6
        D[49, 2] = VP2_5*Z1_6_4 - C5*VP1_6                     # DG4MY6
        # Joint 5
        D[32, 3] = -DV1_2_5                 # DG5XX5
        D[33, 3] = DW1_2_5                  # DG5XY5
        D[34, 3] = -U2_3_5                  # DG5XZ5
        D[35, 3] = U1_3_5                   # DG5YZ5
        D[36, 3] = WP3_5                    # DG5ZZ5
        D[37, 3] = VP2_5                    # DG5MX5
        D[38, 3] = -VP1_5                   # DG5MY5
        D[39, 3] = QDP5                     # DG5Ia5
        D[40, 3] = QP5                      # DG5FV5
        D[41, 3] = signQP5                  # DG5FS5
        D[43, 3] = -S6*WP1_6 - C6DV1_3_6    # DG5XX6
        D[44, 3] = S6*U3_1_6 - C6*U3_2_6    # DG5XY6
        D[45, 3] = -S6*U2_1_6 - C6*DW3_1_6  # DG5XZ6
        D[46, 3] = C6*U1_2_6 - S6*DW2_3_6   # DG5YZ6
        D[47, 3] = C6DV1_3_6 - S6*DV2_3_6   # DG5ZZ6
        D[48, 3] = C6*VP2_5                 # DG5MX6
        D[49, 3] = -S6*VP2_5                # DG5MY6
        # Joint 6
        D[43, 4] = -DV1_2_6  # DG6XX6
        D[44, 4] = DW1_2_6   # DG6XY6
        D[45, 4] = -U2_3_6   # DG6XZ6
        D[46, 4] = U1_3_6    # DG6YZ6
        D[47, 4] = WP3_6     # DG6ZZ6
        D[48, 4] = VP2_6     # DG6MX6
        D[49, 4] = -VP1_6    # DG6MY6
        D[50, 4] = QDP6      # DG6Ia6
        D[51, 4] = QP6       # DG6FV6
        D[52, 4] = signQP6   # DG6FS6
        # Joint 7
        D[14, 5] = -DV1_2_3                                        # DG7XX3
        D[15, 5] = DW1_2_3                                         # DG7XY3
        D[16, 5] = -C7QDP1                                         # DG7XZ3
        D[17, 5] = S7QDP1                                          # DG7YZ3
        D[18, 5] = QDP7                                            # DG7ZZ3
        D[19, 5] = VP2_3                                           # DG7MX3
        D[20, 5] = -VP1_3                                          # DG7MY3
        D[21, 5] = -S4*WP1_4 - C4DV1_3_4                           # DG7XX4
        D[22, 5] = S4*U3_1_4 - C4*U3_2_4                           # DG7XY4
        D[23, 5] = -S4*U2_1_4 - C4*DW3_1_4                         # DG7XZ4
        D[24, 5] = C4*U1_2_4 - S4*DW2_3_4                          # DG7YZ4
        D[25, 5] = C4DV1_3_4 - S4*DV2_3_4                          # DG7ZZ4
        D[26, 5] = C4*VSP2_4 + DF3MX4                              # DG7MX4
        D[27, 5] = DF3MY4 - S4*VSP2_4                              # DG7MY4
        D[32, 5] = WP1_5*Z1_5_2 + DV1_3_5Z2_5_2 - C4*DV1_2_5       # DG7XX5
        D[33, 5] = U3_2_5*Z2_5_2 + C4*DW1_2_5 - U3_1_5*Z1_5_2      # DG7XY5
        D[34, 5] = U2_1_5*Z1_5_2 + DW3_1_5*Z2_5_2 - C4*U2_3_5      # DG7XZ5
        D[35, 5] = DW2_3_5*Z1_5_2 + C4*U1_3_5 - U1_2_5*Z2_5_2      # DG7YZ5
        D[36, 5] = DV2_3_5*Z1_5_2 + C4*WP3_5 - DV1_3_5Z2_5_2       # DG7ZZ5
        D[37, 5] = VP2_4*Z2_5_2 + C4*VP2_5 + DF3MX5                # DG7MX5
        D[38, 5] = DF3MY5 - VP2_4*Z1_5_2 - C4*VP1_5                # DG7MY5
        D[43, 5] = WP1_6*Z1_6_2 + DV1_3_6Z2_6_2 - DV1_2_6*Z2_5_2   # DG7XX6
        D[44, 5] = U3_2_6*Z2_6_2 + DW1_2_6*Z2_5_2 - U3_1_6*Z1_6_2  # DG7XY6
        D[45, 5] = U2_1_6*Z1_6_2 + DW3_1_6*Z2_6_2 - U2_3_6*Z2_5_2  # DG7XZ6
        D[46, 5] = DW2_3_6*Z1_6_2 + U1_3_6*Z2_5_2 - U1_2_6*Z2_6_2  # DG7YZ6
        D[47, 5] = DV2_3_6*Z1_6_2 + WP3_6*Z2_5_2 - DV1_3_6Z2_6_2   # DG7ZZ6
        D[48, 5] = VP2_6*Z2_5_2 + DF3MX6 - VP2_5*Z2_6_2            # DG7MX6
        D[49, 5] = VP2_5*Z1_6_2 + DF3MY6 - VP1_6*Z2_5_2            # DG7MY6
        D[54, 5] = VP2_7                                           # DG7MX7
        D[55, 5] = -VP1_7                                          # DG7MY7
        D[56, 5] = QP7                                             # DG7FV7
        D[57, 5] = signQP7                                         # DG7FS7
        D[59, 5] = U1_2_2*V1_8_7 + U2_2_2*V2_8_7                   # DG7MY8

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2R, MY2, FV2, FS2, OFFSET2,
            XX3R, XY3R, XZ3R, YZ3R, ZZ3R, MX3R, MY3R, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4, MY4R, Ia4,
            FV4, FS4, OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5, OFFSET5, XX6R,
            XY6, XZ6, YZ6, ZZ6, MX6, MY6, Ia6, FV6, FS6, OFFSET6, MX7R, MY7, FV7, FS7, OFFSET7, MY8
        ) = X
        # Joint 8
        F1_8 = MY8*U1_2_2
        F2_8 = MY8*U2_2_2
        F3_8 = MY8*U3_2_2
        N1_8 = MY8*VSP3_8
        N3_8 = -MY8*VP1_8
        FDI2_8 = S2m7*F1_8 + C2m7*F2_8
        # Joint 7
        F3_7 = MY7*U3_1_3 - MX7R*U3_2_3
        E3_7 = F3_8 + F3_7
        N1_7 = MY7*VSP2_2
        N2_7 = -MX7R*VSP2_2
        N3_7 = MX7R*VP2_7 - MY7*VP1_7
        NE1_7 = C2m7*N1_8 + N1_7
        NE2_7 = S2m7*N1_8 + N2_7 - D8*F3_8
        NE3_7 = N3_8 + D8*FDI2_8 + N3_7
        # Joint 6
        F1_6 = MX6*U1_1_6 + MY6*U1_2_6
        F2_6 = MX6*U2_1_6 + MY6*U2_2_6
        F3_6 = MX6*U3_1_6 + MY6*U3_2_6
        N1_6 = XX6R*WP1_6 + ZZ6*DV2_3_6 + YZ6*DW2_3_6 + XZ6*U2_1_6 + MY6*VP2_5 - XY6*U3_1_6
        N2_6 = (XX6R - ZZ6)*DV1_3_6 + XZ6*DW3_1_6 + XY6*U3_2_6 - YZ6*U1_2_6 - MX6*VP2_5
        N3_6 = (ZZ6*WP3_6 + XY6*DW1_2_6 + YZ6*U1_3_6 + MX6*VP2_6 - XX6R*DV1_2_6 - XZ6*U2_3_6 -
            MY6*VP1_6)
        FDI1_6 = C6*F1_6 - S6*F2_6
        FDI3_6 = -S6*F1_6 - C6*F2_6
        # Joint 5
        F1_5 = MX5*U1_1_5 + MY5R*U1_2_5
        F2_5 = MX5*U2_1_5 + MY5R*U2_2_5
        F3_5 = MX5*U3_1_5 + MY5R*U3_2_5
        E1_5 = FDI1_6 + F1_5
        E2_5 = F3_6 + F2_5
        E3_5 = FDI3_6 + F3_5
        N1_5 = XX5R*WP1_5 + ZZ5R*DV2_3_5 + YZ5*DW2_3_5 + XZ5*U2_1_5 - XY5*U3_1_5 - MY5R*VP2_4
        N2_5 = (XX5R - ZZ5R)*DV1_3_5 + XZ5*DW3_1_5 + XY5*U3_2_5 + MX5*VP2_4 - YZ5*U1_2_5
        N3_5 = (ZZ5R*WP3_5 + XY5*DW1_2_5 + YZ5*U1_3_5 + MX5*VP2_5 - XX5R*DV1_2_5 - XZ5*U2_3_5 -
            MY5R*VP1_5)
        NE1_5 = C6*N1_6 + N1_5 - S6*N2_6
        NE2_5 = N3_6 + N2_5
        NE3_5 = N3_5 - S6*N1_6 - C6*N2_6
        FDI1_5 = C5*E1_5 - S5*E2_5
        FDI3_5 = S5*E1_5 + C5*E2_5
        # Joint 4
        F1_4 = MX4*U1_1_4 + MY4R*U1_2_4
        F2_4 = MX4*U2_1_4 + MY4R*U2_2_4
        F3_4 = MX4*U3_1_4 + MY4R*U3_2_4
        E1_4 = FDI1_5 + F1_4
        E2_4 = F2_4 - E3_5
        E3_4 = FDI3_5 + F3_4
        N1_4 = XX4R*WP1_4 + ZZ4R*DV2_3_4 + YZ4*DW2_3_4 + XZ4*U2_1_4 + MY4R*VSP2_4 - XY4*U3_1_4
        N2_4 = (XX4R - ZZ4R)*DV1_3_4 + XZ4*DW3_1_4 + XY4*U3_2_4 - YZ4*U1_2_4 - MX4*VSP2_4
        N3_4 = (ZZ4R*WP3_4 + XY4*DW1_2_4 + YZ4*U1_3_4 + MX4*VP2_4 - XX4R*DV1_2_4 - XZ4*U2_3_4 -
            MY4R*VP1_4)
        NE1_4 = C5*NE1_5 + N1_4 - S5*NE2_5
        NE2_4 = N2_4 - NE3_5
        NE3_4 = S5*NE1_5 + C5*NE2_5 + N3_4
        FDI1_4 = C4*E1_4 - S4*E2_4
        FDI3_4 = -S4*E1_4 - C4*E2_4
        # Joint 3
        F1_3 = MX3R*U1_1_3 + MY3R*U1_2_3
        F2_3 = MX3R*U2_1_3 + MY3R*U2_2_3
        F3_3 = MX3R*U3_1_3 + MY3R*U3_2_3
        E1_3 = FDI1_4 + F1_3
        E2_3 = E3_4 + F2_3
        E3_3 = FDI3_4 + F3_3
        N1_3 = XX3R*WP1_3 + ZZ3R*DV2_3_3 + YZ3R*DW2_3_3 + XZ3R*U2_1_3 + MY3R*VSP3_3 - XY3R*U3_1_3
        N2_3 = (XX3R - ZZ3R)*DV1_3_3 + XZ3R*DW3_1_3 + XY3R*U3_2_3 - YZ3R*U1_2_3 - MX3R*VSP3_3
        N3_3 = (ZZ3R*QDP7 + XY3R*DW1_2_3 + YZ3R*S7QDP1 + MX3R*VP2_3 - XX3R*DV1_2_3 - XZ3R*C7QDP1 -
            MY3R*VP1_3)
        NE1_3 = C4*NE1_4 + RL4*FDI3_4 + N1_3 - S4*NE2_4
        NE2_3 = NE3_4 + N2_3 - D4*FDI3_4
        NE3_3 = D4*E3_4 + N3_3 - S4*NE1_4 - C4*NE2_4 - RL4*FDI1_4
        FDI2_3 = C2m7*E1_3 + S2m7*E2_3
        # Joint 2
        F3_2 = MX2R*U3_1_2 + MY2*U3_2_2
        E3_2 = E3_3 + F3_2
        N1_2 = XX2R*WP1_2 + ZZ2R*DV2_3_2 + YZ2R*DW2_3_2 + XZ2R*U2_1_2 + MY2*VSP2_2 - XY2R*U3_1_2
        N2_2 = (XX2R - ZZ2R)*DV1_3_2 + XZ2R*DW3_1_2 + XY2R*U3_2_2 - YZ2R*U1_2_2 - MX2R*VSP2_2
        N3_2 = (ZZ2R*QDP2 + XY2R*DW1_2_2 + MX2R*VP2_2 - XX2R*DV1_2_2 - YZ2R*C2QDP1 - XZ2R*S2QDP1 -
            MY2*VP1_2)
        NE1_2 = S2m7*NE1_3 + N1_2 - C2m7*NE2_3
        NE2_2 = C2m7*NE1_3 + S2m7*NE2_3 + N2_2 - D3*E3_3
        NE3_2 = NE3_3 + D3*FDI2_3 + N3_2
        # Joint 1
        N3_1 = ZZ1R*QDP1
        NE3_1 = D2*E3_7 + D2*E3_2 + N3_1 - S7*NE1_7 - C7*NE2_7 - S2*NE1_2 - C2*NE2_2
        # Torques
        GAM[0] = OFFSET1 + NE3_1 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE3_2 + FV2*QP2 + FS2*signQP2 + N3_8 - NE3_3
        GAM[2] = OFFSET4 + NE3_4 + Ia4*QDP4 + FV4*QP4 + FS4*signQP4
        GAM[3] = OFFSET5 + NE3_5 + Ia5*QDP5 + FV5*QP5 + FS5*signQP5
        GAM[4] = OFFSET6 + N3_6 + Ia6*QDP6 + FV6*QP6 + FS6*signQP6
        GAM[5] = NE3_3 + OFFSET7 + NE3_7 + FV7*QP7 + FS7*signQP7 - N3_8

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D2, D3, D4, RL4, D8):
    """Fill A, shape (6, 6, N), from q (6, N)."""
    # Inputs
    q2, q4, q5, q6, q7 = q[1:]
    (
        ZZ1R, _, _, _, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2R, MY2, _, _, _, XX3R, XY3R, XZ3R, YZ3R,
        ZZ3R, MX3R, MY3R, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4, MY4R, Ia4, _, _, _, XX5R, XY5, XZ5,
        YZ5, ZZ5R, MX5, MY5R, Ia5, _, _, _, XX6R, XY6, XZ6, YZ6, ZZ6, MX6, MY6, Ia6, _, _, _,
        MX7R, MY7, _, _, _, MY8
    ) = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m7 = q2 - q7
    C2m7 = xp.cos(th2m7)
    S2m7 = xp.sin(th2m7)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Composite link 9
    C2m7S2m7 = C2m7*S2m7
    # Composite link 8
    AS1_8 = -MY8*S2m7
    AS2_8 = MY8*C2m7
    NE3_7_8 = D8*AS1_8
    JP2_2_7 = 2*NE3_7_8
    JP1_2_7 = -D8*AS2_8
    MSP1_7 = MX7R + AS1_8
    MSP2_7 = MY7 + AS2_8
    # Composite link 7
    AS1_7 = C7*MSP1_7 - S7*MSP2_7
    # Composite link 6
    AS1_6 = MX6*C6 - MY6*S6
    AS3_6 = -MX6*S6 - MY6*C6
    C6C6 = C6**2
    C6S6 = C6*S6
    AJA1_1_6 = XX6R*C6C6 - XY6*2*C6S6
    NE1_5_6 = XZ6*C6 - YZ6*S6
    NE3_5_6 = -XZ6*S6 - YZ6*C6
    JP1_1_5 = XX5R + AJA1_1_6
    JP1_2_5 = XY5 + NE1_5_6
    JP1_3_5 = XZ5 + XY6 - XX6R*C6S6 - XY6*2*C6C6
    JP2_3_5 = YZ5 + NE3_5_6
    JP3_3_5 = ZZ5R + XX6R - AJA1_1_6
    MSP1_5 = MX5 + AS1_6
    # Composite link 5
    AS1_5 = C5*MSP1_5 - MY5R*S5
    AS3_5 = S5*MSP1_5 + MY5R*C5
    C5C5 = C5**2
    C5S5 = C5*S5
    JP1_1_4a = ZZ6 - JP1_1_5
    JP1_1_4b = C5C5*JP1_1_4a + JP1_2_5*2*C5S5
    NE1_4_5 = C5*JP1_3_5 - S5*JP2_3_5
    NE3_4_5 = S5*JP1_3_5 + C5*JP2_3_5
    JP1_1_4 = XX4R + ZZ6 - JP1_1_4b
    JP1_2_4 = XY4 - NE1_4_5
    JP1_3_4 = XZ4 + JP1_2_5*2*C5C5 - C5S5*JP1_1_4a - JP1_2_5
    JP2_3_4 = YZ4 - NE3_4_5
    JP3_3_4 = ZZ4R + JP1_1_5 + JP1_1_4b
    MSP1_4 = MX4 + AS1_5
    MSP2_4 = MY4R - AS3_6
    # Composite link 4
    AS1_4 = C4*MSP1_4 - S4*MSP2_4
    AS3_4 = -S4*MSP1_4 - C4*MSP2_4
    C4C4 = C4**2
    C4S4 = C4*S4
    JP1_1_3a = JP3_3_5 - JP1_1_4
    JP1_1_3b = C4C4*JP1_1_3a + JP1_2_4*2*C4S4
    AJA1_2_4 = C4*JP1_3_4 - S4*JP2_3_4
    D4AS1_4 = D4*AS1_4
    RL4AS3_5 = RL4*AS3_5
    RL4AS1_4 = RL4*AS1_4
    JP1_1_3 = XX3R + JP3_3_5 + 2*RL4AS3_5 - JP1_1_3b
    JP1_2_3 = XY3R + AJA1_2_4 - D4*AS3_5 - RL4AS1_4
    JP1_3_3 = XZ3R + C4S4*JP1_1_3a + JP1_2_4 - JP1_2_4*2*C4C4 - D4*AS3_4
    JP2_2_3 = JP3_3_4 + 2*D4AS1_4
    NE3_3_4 = -S4*JP1_3_4 - C4*JP2_3_4 - RL4*AS3_4
    JP2_3_3 = YZ3R + NE3_3_4
    JP3_3_3 = ZZ3R + JP1_1_4 + JP1_1_3b + 2*(D4AS1_4 + RL4AS3_5)
    MSP1_3 = MX3R + AS1_4
    MSP2_3 = MY3R + AS3_5
    # Composite link 3
    AS1_3 = S2m7*MSP1_3 - C2m7*MSP2_3
    AS2_3 = C2m7*MSP1_3 + S2m7*MSP2_3
    S2m7S2m7 = S2m7**2
    JP1_1_2a = JP1_1_3 - JP2_2_3
    JP1_1_2b = S2m7S2m7*JP1_1_2a - 2*C2m7S2m7*JP1_2_3
    NE1_2_3 = S2m7*JP1_3_3 - C2m7*JP2_3_3
    NE2_2_3 = C2m7*JP1_3_3 + S2m7*JP2_3_3
    D3AS1_3 = D3*AS1_3
    JP1_1_2 = XX2R + JP2_2_3 + JP1_1_2b
    JP1_2_2 = XY2R + C2m7S2m7*JP1_1_2a + JP1_2_3*2*S2m7S2m7 - JP1_2_3 - D3*AS2_3
    JP1_3_2 = XZ2R + NE1_2_3 - D3*AS3_4
    JP2_2_2 = JP1_1_3 + 2*D3AS1_3 - JP1_1_2b
    JP2_3_2 = YZ2R + NE2_2_3
    MSP1_2 = MX2R + AS1_3
    MSP2_2 = MY2 + AS2_3
    # Composite link 2
    AS1_2 = C2*MSP1_2 - S2*MSP2_2
    NE3_1_2 = -S2*JP1_3_2 - C2*JP2_3_2
    JP3_3_1 = (ZZ1R + JP2_2_7*C7**2 + JP1_2_7*2*C7*S7 + 2*D2*AS1_7 + JP1_1_2 + JP1_2_2*2*C2*S2 +
        2*D2*AS1_2 - C2**2*(JP1_1_2 - JP2_2_2))
    # Unit acceleration of joint 3
    NE3_1_3 = -S2*NE1_2_3 - C2*NE2_2_3
    # Unit acceleration of joint 4
    NE1_3_4 = AJA1_2_4 - RL4AS1_4
    NE2_3_4 = JP3_3_4 + D4AS1_4
    E2_2_4 = C2m7*AS3_4
    NE1_2_4 = S2m7*NE1_3_4 - C2m7*NE2_3_4
    NE2_2_4 = C2m7*NE1_3_4 + S2m7*NE2_3_4 + D3*AS1_4
    NE3_1_4 = -S2*NE1_2_4 - C2*NE2_2_4 - D2*AS1_4
    # Unit acceleration of joint 5
    E1_3_5 = -C4*AS3_5
    E3_3_5 = S4*AS3_5
    NE1_3_5 = C4*NE1_4_5 + S4*JP3_3_5 + RL4*E3_3_5
    NE2_3_5 = NE3_4_5 - D4*E3_3_5
    NE3_3_5 = C4*JP3_3_5 + D4*AS1_5 - S4*NE1_4_5 - RL4*E1_3_5
    E2_2_5 = C2m7*E1_3_5 + S2m7*AS1_5
    NE1_2_5 = S2m7*NE1_3_5 - C2m7*NE2_3_5
    NE2_2_5 = C2m7*NE1_3_5 + S2m7*NE2_3_5 - D3*E3_3_5
    NE3_1_5 = D2*E3_3_5 - S2*NE1_2_5 - C2*NE2_2_5
    # Unit acceleration of joint 6
    E1_4_6 = C5*AS3_6
    E3_4_6 = S5*AS3_6
    NE1_4_6 = C5*NE1_5_6 - ZZ6*S5
    NE3_4_6 = S5*NE1_5_6 + ZZ6*C5
    E1_3_6 = C4*E1_4_6 - S4*AS1_6
    E3_3_6 = -S4*E1_4_6 - C4*AS1_6
    NE1_3_6 = C4*NE1_4_6 + S4*NE3_5_6 + RL4*E3_3_6
    NE2_3_6 = NE3_4_6 - D4*E3_3_6
    NE3_3_6 = C4*NE3_5_6 + D4*E3_4_6 - S4*NE1_4_6 - RL4*E1_3_6
    E2_2_6 = C2m7*E1_3_6 + S2m7*E3_4_6
    NE1_2_6 = S2m7*NE1_3_6 - C2m7*NE2_3_6
    NE2_2_6 = C2m7*NE1_3_6 + S2m7*NE2_3_6 - D3*E3_3_6
    NE3_1_6 = D2*E3_3_6 - S2*NE1_2_6 - C2*NE2_2_6
    # Inertia matrix
    A[0, 0] = JP3_3_1
    A[0, 1] = A[1, 0] = NE3_1_2 - NE3_1_3
    A[1, 1] = ZZ2R
    A[0, 2] = A[2, 0] = NE3_1_4
    A[1, 2] = A[2, 1] = D3*E2_2_4
    A[2, 2] = Ia4 + JP3_3_4
    A[0, 3] = A[3, 0] = NE3_1_5
    A[1, 3] = A[3, 1] = D3*E2_2_5
    A[2, 3] = A[3, 2] = NE3_4_5
    A[3, 3] = Ia5 + JP3_3_5
    A[0, 4] = A[4, 0] = NE3_1_6
    A[1, 4] = A[4, 1] = D3*E2_2_6
    A[2, 4] = A[4, 2] = NE3_4_6
    A[3, 4] = A[4, 3] = NE3_5_6
    A[4, 4] = ZZ6 + Ia6
    A[0, 5] = A[5, 0] = NE3_1_3
    A[1, 5] = A[5, 1] = NE3_7_8 + D3AS1_3
    A[2, 5] = A[5, 2] = NE3_3_4
    A[3, 5] = A[5, 3] = NE3_3_5
    A[4, 5] = A[5, 4] = NE3_3_6
    A[5, 5] = JP3_3_3


def _gravity_block(xp, q, GAM, X, g):
    """Fill GAM, shape (6, N), from q (6, N)."""
    # Inputs
    q2, q4, q5, q6, q7 = q[1:]
    (
        _, _, _, OFFSET1, _, _, _, _, _, MX2R, MY2, _, _, OFFSET2, _, _, _, _, _, MX3R, MY3R, _,
        _, _, _, _, MX4, MY4R, _, _, _, OFFSET4, _, _, _, _, _, MX5, MY5R, _, _, _, OFFSET5, _,
        _, _, _, _, MX6, MY6, _, _, _, OFFSET6, MX7R, MY7, _, _, OFFSET7, MY8
    ) = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m7 = q2 - q7
    C2m7 = xp.cos(th2m7)
    S2m7 = xp.sin(th2m7)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Link 2
    S2g = g*S2
    C2g = g*C2
    # Link 3
    VP1_3 = -S2m7*S2g - C2m7*C2g
    VP2_3 = C2m7*S2g - S2m7*C2g
    # Link 4
    C4VP1_3 = C4*VP1_3
    S4VP1_3 = S4*VP1_3
    # Link 5
    VP1_5 = C5*C4VP1_3 + S5*VP2_3
    VP2_5 = C5*VP2_3 - S5*C4VP1_3
    # Link 6
    VP1_6 = C6*VP1_5 - S6*S4VP1_3
    VP2_6 = -C6*S4VP1_3 - S6*VP1_5
    # Joint 8
    N3_8 = MY8*S2g
    # Joint 7
    N3_7 = MX7R*VP1_3 + MY7*VP2_3
    NE3_7 = N3_8 + N3_7
    # Joint 6
    N1_6 = MY6*VP2_5
    N2_6 = -MX6*VP2_5
    N3_6 = MX6*VP2_6 - MY6*VP1_6
    # Joint 5
    N1_5 = MY5R*S4VP1_3
    N2_5 = -MX5*S4VP1_3
    N3_5 = MX5*VP2_5 - MY5R*VP1_5
    NE1_5 = C6*N1_6 + N1_5 - S6*N2_6
    NE2_5 = N3_6 + N2_5
    NE3_5 = N3_5 - S6*N1_6 - C6*N2_6
    # Joint 4
    N1_4 = MY4R*VP2_3
    N2_4 = -MX4*VP2_3
    N3_4 = -MX4*S4VP1_3 - MY4R*C4VP1_3
    NE1_4 = C5*NE1_5 + N1_4 - S5*NE2_5
    NE2_4 = N2_4 - NE3_5
    NE3_4 = S5*NE1_5 + C5*NE2_5 + N3_4
    # Joint 3
    N3_3 = MX3R*VP2_3 - MY3R*VP1_3
    NE3_3 = N3_3 - S4*NE1_4 - C4*NE2_4
    # Joint 2
    N3_2 = MY2*S2g - MX2R*C2g
    NE3_2 = NE3_3 + N3_2
    # Torques
    GAM[0] = OFFSET1
    GAM[1] = OFFSET2 + NE3_2 + N3_8 - NE3_3
    GAM[2] = OFFSET4 + NE3_4
    GAM[3] = OFFSET5 + NE3_5
    GAM[4] = OFFSET6 + N3_6
    GAM[5] = NE3_3 + OFFSET7 + NE3_7 - N3_8


def _frame_poses_block(xp, q, T, D2, D3, D4, RL4, D8):
    """Fill T, shape (10, 4, 4, N), from q (6, N)."""
    # Inputs
    q1, q2, q4, q5, q6, q7 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C7 = xp.cos(q7)
    S7 = xp.sin(q7)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Joint axes Z and velocities V seen from link 4
    Z1_4_1 = -C7*C4
    Z2_4_1 = C7*S4
    # Joint axes Z and velocities V seen from link 5
    Z1_5_1 = C5*Z1_4_1 + S7*S5
    Z2_5_1 = S7*C5 - S5*Z1_4_1
    # Joint axes Z and velocities V seen from link 6
    Z1_6_1 = C6*Z1_5_1 + S6*Z2_4_1
    Z2_6_1 = C6*Z2_4_1 - S6*Z1_5_1
    # Frame 2
    R1_1_2 = C1*C2
    R1_2_2 = -C1*S2
    R2_1_2 = S1*C2
    R2_2_2 = -S1*S2
    P1_2 = D2*C1
    P2_2 = D2*S1
    # Frame 3
    R1_1_3 = -C1*S7
    R1_2_3 = -C1*C7
    R2_1_3 = -S1*S7
    R2_2_3 = -S1*C7
    D3R1_1_2 = D3*R1_1_2
    P1_3 = P1_2 + D3R1_1_2
    D3R2_1_2 = D3*R2_1_2
    P2_3 = P2_2 + D3R2_1_2
    P3_3 = -D3*S2
    # Frame 4
    R1_1_4 = C4*R1_1_3 + S1*S4
    R1_2_4 = S1*C4 - S4*R1_1_3
    R2_1_4 = C4*R2_1_3 - C1*S4
    R2_2_4 = -C1*C4 - S4*R2_1_3
    P1_4 = P1_3 + D4*R1_1_3 + RL4*R1_2_3
    P2_4 = P2_3 + D4*R2_1_3 + RL4*R2_2_3
    P3_4 = P3_3 + RL4*S7 - D4*C7
    # Frame 5
    R1_1_5 = C5*R1_1_4 + S5*R1_2_3
    R1_2_5 = C5*R1_2_3 - S5*R1_1_4
    R2_1_5 = C5*R2_1_4 + S5*R2_2_3
    R2_2_5 = C5*R2_2_3 - S5*R2_1_4
    # Frame 6
    R1_1_6 = C6*R1_1_5 + S6*R1_2_4
    R1_2_6 = C6*R1_2_4 - S6*R1_1_5
    R2_1_6 = C6*R2_1_5 + S6*R2_2_4
    R2_2_6 = C6*R2_2_4 - S6*R2_1_5
    # Frame 8
    P1_8 = P1_2 - D8*R1_2_3
    P2_8 = P2_2 - D8*R2_2_3
    P3_8 = -D8*S7
    # Frame 9
    P1_9 = D3R1_1_2 + P1_8
    P2_9 = D3R2_1_2 + P2_8
    P3_9 = P3_3 + P3_8
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[1, 0, 0] = R1_1_2
    T[1, 0, 1] = R1_2_2
    T[1, 0, 2] = -S1
    T[1, 0, 3] = P1_2
    T[1, 1, 0] = R2_1_2
    T[1, 1, 1] = R2_2_2
    T[1, 1, 2] = C1
    T[1, 1, 3] = P2_2
    T[1, 2, 0] = -S2
    T[1, 2, 1] = -C2
    T[2, 0, 0] = R1_1_3
    T[2, 0, 1] = R1_2_3
    T[2, 0, 2] = -S1
    T[2, 0, 3] = P1_3
    T[2, 1, 0] = R2_1_3
    T[2, 1, 1] = R2_2_3
    T[2, 1, 2] = C1
    T[2, 1, 3] = P2_3
    T[2, 2, 0] = -C7
    T[2, 2, 1] = S7
    T[2, 2, 3] = P3_3
    T[3, 0, 0] = R1_1_4
    T[3, 0, 1] = R1_2_4
    T[3, 0, 2] = R1_2_3
    T[3, 0, 3] = P1_4
    T[3, 1, 0] = R2_1_4
    T[3, 1, 1] = R2_2_4
    T[3, 1, 2] = R2_2_3
    T[3, 1, 3] = P2_4
    T[3, 2, 0] = Z1_4_1
    T[3, 2, 1] = Z2_4_1
    T[3, 2, 2] = S7
    T[3, 2, 3] = P3_4
    T[4, 0, 0] = R1_1_5
    T[4, 0, 1] = R1_2_5
    T[4, 0, 2] = -R1_2_4
    T[4, 0, 3] = P1_4
    T[4, 1, 0] = R2_1_5
    T[4, 1, 1] = R2_2_5
    T[4, 1, 2] = -R2_2_4
    T[4, 1, 3] = P2_4
    T[4, 2, 0] = Z1_5_1
    T[4, 2, 1] = Z2_5_1
    T[4, 2, 2] = -Z2_4_1
    T[4, 2, 3] = P3_4
    T[5, 0, 0] = R1_1_6
    T[5, 0, 1] = R1_2_6
    T[5, 0, 2] = R1_2_5
    T[5, 0, 3] = P1_4
    T[5, 1, 0] = R2_1_6
    T[5, 1, 1] = R2_2_6
    T[5, 1, 2] = R2_2_5
    T[5, 1, 3] = P2_4
    T[5, 2, 0] = Z1_6_1
    T[5, 2, 1] = Z2_6_1
    T[5, 2, 2] = Z2_5_1
    T[5, 2, 3] = P3_4
    T[6, 0, 0] = -R1_2_3
    T[6, 0, 1] = R1_1_3
    T[6, 0, 2] = -S1
    T[6, 0, 3] = P1_2
    T[6, 1, 0] = -R2_2_3
    T[6, 1, 1] = R2_1_3
    T[6, 1, 2] = C1
    T[6, 1, 3] = P2_2
    T[6, 2, 0] = -S7
    T[6, 2, 1] = -C7
    T[7, 0, 0] = R1_1_2
    T[7, 0, 1] = R1_2_2
    T[7, 0, 2] = -S1
    T[7, 0, 3] = P1_8
    T[7, 1, 0] = R2_1_2
    T[7, 1, 1] = R2_2_2
    T[7, 1, 2] = C1
    T[7, 1, 3] = P2_8
    T[7, 2, 0] = -S2
    T[7, 2, 1] = -C2
    T[7, 2, 3] = P3_8
    T[8, 0, 0] = R1_2_3
    T[8, 0, 1] = -R1_1_3
    T[8, 0, 2] = -S1
    T[8, 0, 3] = P1_9
    T[8, 1, 0] = R2_2_3
    T[8, 1, 1] = -R2_1_3
    T[8, 1, 2] = C1
    T[8, 1, 3] = P2_9
    T[8, 2, 0] = S7
    T[8, 2, 1] = C7
    T[8, 2, 3] = P3_9
    T[9, 0, 0] = R1_2_3
    T[9, 0, 1] = -R1_1_3
    T[9, 0, 2] = -S1
    T[9, 0, 3] = P1_9
    T[9, 1, 0] = R2_2_3
    T[9, 1, 1] = -R2_1_3
    T[9, 1, 2] = C1
    T[9, 1, 3] = P2_9
    T[9, 2, 0] = S7
    T[9, 2, 1] = C7
    T[9, 2, 3] = P3_9
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 3, 3] = T[2, 3, 3] = T[3, 3, 3] = T[4, 3, 3] = T[5, 3, 3] = 1.0
    T[6, 3, 3] = T[7, 3, 3] = T[8, 3, 3] = T[9, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4, 5, 6, 7, 8)
DRIVES = None
LIMITS = {}
VALUES = {}
