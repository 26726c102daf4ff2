"""Upper branch of the CEA LIST haptic interface, 3 actuated joints, parallelogram and double
    parallelogram: base parameters, regressor, dynamics.

GENERATED from haptic.yaml, sha256 905194db7b3b, by symgen 0.5.0.
Do not edit; symgen generate haptic

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  mu  sigma  alpha    d  theta  r
    1    0   1      0      0    0     q1  0
    2    1   1      0  -pi/2    0     q2  0
    3    2   0      0      0   D3     q3  0
    4    3   0      0      0   D4     q4  0
    5    1   1      0  -pi/2    0     q5  0
    6    5   0      0      0   D6     q6  0
    7    6   0      0      0   D3     q7  0
    8    3   0      2      0  -D6      0  0
Gravity     acceleration (gx, gy, 0) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q5
    FV      viscous: along q1, q2, q4, q5
    FS      coulomb: along q1, q2, q4, q5
    OFFSET  offset: along q1, q2, q5
    FVP     viscous: along q2, q5
    FSP     coulomb: along q2, q5
Loop        frame 8 coincides with cut frame 7
Loop        q3 = pi - q2 + q5
Loop        q4 = c - q5 (declared)
Loop        q6 = q2 - q5
Loop        q7 = pi - q2 + q5

Base parameters, 30 of 78; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 M2 XZ4 YZ4 ZZ4 M5

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
    AS   the first moments MSP in the antecedent's frame
    GAM  joint torque or force
    DG   contribution of a base parameter to a joint torque
    DF   the part of DG that pushes: velocity times force
    R    orientation of a frame in frame 0
    P    origin of a frame in frame 0

Cost per sample
    regressor          97 multiplications, 58 additions, 5 sin, 5 cos
    inverse_dynamics   141 multiplications, 117 additions, 5 sin, 5 cos
    inertia_matrix     46 multiplications, 33 additions, 4 sin, 4 cos
    gravity            42 multiplications, 33 additions, 5 sin, 5 cos
    frame_poses        21 multiplications, 6 additions, 3 sin, 3 cos

Arguments   q, qd, qdd, tau of shape (N, 3), or (3,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (30,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 8e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian, passive_joints,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: 41a4135e8a58328bc5bcecc859494b61997d7ccc8fd198fa30fe5455bd670b27
"""

import numpy as np

SCHEMA = 1
NAME = 'haptic'
SOURCE_SHA256 = '905194db7b3b75bf540a196cd93f3044c531cdf74245c6c84322acf1f75f4827'
JOINTS = (1, 2, 5)
PASSIVE = (3, 4, 6, 7)
CONSTANTS = {'D3': 0.2, 'D4': 0.22, 'D6': 0.1, 'c': 0.0, 'gx': -9.81, 'gy': 0.0}
BASE_PARAMETERS = tuple("""
ZZ1R MX1 MY1R FV1 FS1 OFFSET1 XX2R XY2R XZ2R YZ2R ZZ2R MX2R MY2 FV2R FS2R OFFSET2 XX3R XY3R XZ3R
YZ3R ZZ3R MX3R MY3 MX4R MX5R MY5 FV5R FS5R OFFSET5 MY6
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 XX4 XY4 XZ4 YY4 YZ4 ZZ4 MX4 MY4 MZ4 M4
FV4 FS4 XX5 XY5 XZ5 YY5 YZ5 ZZ5 MX5 MY5 MZ5 M5 Ia5 FV5 FS5 OFFSET5 XX6 XY6 XZ6 YY6 YZ6 ZZ6 MX6 MY6
MZ6 M6 FVP2 FVP5 FSP2 FSP5
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'MZ1', 'M1', 'M2', 'XZ4', 'YZ4', 'ZZ4', 'M5')
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + YY2 + YY3 + YY5 + YY6 + D3**2*M3 + sin(c)**2*XX4 +'
        ' 2*cos(c)*sin(c)*XY4 + cos(c)**2*YY4 + (D3**2 + D4**2)*M4 + D6**2*M6',
    'MY1R': 'MY1 + MZ2 + MZ3 + MZ4 + MZ5 + MZ6',
    'XX2R': 'XX2 - YY2 + XX6 - YY6 - D3**2*(M3 + M4)',
    'XY2R': 'XY2 + XY6',
    'XZ2R': 'XZ2 + XZ6 - D3*(MZ3 + MZ4)',
    'YZ2R': 'YZ2 + YZ6',
    'ZZ2R': 'ZZ2 + Ia2 + ZZ6 + D3**2*(M3 + M4)',
    'MX2R': 'MX2 + MX6 + D3*(M3 + M4)',
    'FV2R': 'FV2 + FVP2',
    'FS2R': 'FS2 + FSP2',
    'XX3R': 'XX3 - YY3 + XX5 - YY5 - D4**2*M4 - D6**2*M6',
    'XY3R': 'XY3 + XY5',
    'XZ3R': 'XZ3 - XZ5 - D4*MZ4 + D6*MZ6',
    'YZ3R': 'YZ3 - YZ5',
    'ZZ3R': 'ZZ3 + ZZ5 + Ia5 + D4**2*M4 + D6**2*M6',
    'MX3R': 'MX3 + D4*M4 - D6/D3*MX6',
    'MX4R': 'MX4 - sin(c)/cos(c)*MY4',
    'MX5R': 'MX5 - D6/D3*MX6 + D6*M6',
    'FV5R': 'FV5 + FV4 + FVP5',
    'FS5R': 'FS5 + FS4 + FSP5',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 kg*m kg*m N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m
N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m kg*m kg*m N*m*s/rad N*m N*m kg*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x..", "x..", "x..", "x..", "x..", "x..", "xx.", "xx.", "xx.", "xx.", ".x.", "xx.", "xx.",
    ".x.", ".x.", ".x.", "x.x", "x.x", "x.x", "x.x", "..x", "xxx", "xxx", "xxx", "x.x", "x.x",
    "..x", "..x", "..x", "xxx",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (30, 3, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((30, 3, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[5, 0] = D[15, 1] = D[28, 2] = 1.0
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
    """The states as rows of samples, shape (N, 3) each; ValueError unless all have shape
    (N, 3), or all (3,).
    """
    states = [_real(x, "states") for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (3,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 3) each, or (3,) each")
    return tuple([x.reshape(-1, 3) for x in states])


def _parameters(X):
    """X; ValueError unless it has a value for each base parameter."""
    if tuple(X.shape) != (30,):
        raise ValueError(f"X of shape {X.shape}; expected (30,) in the order of BASE_PARAMETERS")
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
        if x.shape[-1:] != (3,):
            raise ValueError(f"state of shape {x.shape}; expected (..., 3)")
        return [x[..., k] for k in range(3)]

    def parameters(self, X):
        """X[k], one by one; NumPy's as plain numbers."""
        if self.package is not np and isinstance(X, np.ndarray | list | tuple):
            return _parameters(_real(X, "X")).tolist()
        _parameters(X)
        return [X[k] for k in range(30)]

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

    def rows(self, x, count=3):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 30)

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

    Inputs are columns q, qd, qdd, tau (3,), X (30,), standard (78,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (3, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 30, "standard": 78}
    columns = {x: ca.SX.sym(x, sizes.get(x, 3)) for x in columns}
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
    'passive_joints': ('q qd qdd', 'q_passive qd_passive qdd_passive'),
}


def elements(
    *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1, c: float = 0.0, gx: float = -9.81,
    gy: float = 0.0
) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D3, D4, D6, c, gx, gy))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
        'FV4': ('viscous', 'both', {4: 1.0}), 'FS4': ('coulomb', 'both', {4: 1.0}),
        'Ia5': ('inertia', 'both', {5: 1.0}), 'FV5': ('viscous', 'both', {5: 1.0}),
        'FS5': ('coulomb', 'both', {5: 1.0}), 'OFFSET5': ('offset', 'both', {5: 1.0}),
        'FVP2': ('viscous', 'both', {2: 1.0}), 'FVP5': ('viscous', 'both', {5: 1.0}),
        'FSP2': ('coulomb', 'both', {2: 1.0}), 'FSP5': ('coulomb', 'both', {5: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(
    standard: "Array", *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1, c: float = 0.0,
    gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """X, shape (30,), from the 78 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (78,):
            raise ValueError(
                f"standard of shape {shape}; expected (78,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(78)]
    if xp is np:
        _numbers((D3, D4, D6, c, gx, gy))
    (
        _, _, _, _, _, ZZ1, MX1, MY1, _, _, Ia1, FV1, FS1, OFFSET1, XX2, XY2, XZ2, YY2, YZ2,
        ZZ2, MX2, MY2, MZ2, _, Ia2, FV2, FS2, OFFSET2, XX3, XY3, XZ3, YY3, YZ3, ZZ3, MX3, MY3,
        MZ3, M3, XX4, XY4, _, YY4, _, _, MX4, MY4, MZ4, M4, FV4, FS4, XX5, XY5, XZ5, YY5, YZ5,
        ZZ5, MX5, MY5, MZ5, _, Ia5, FV5, FS5, OFFSET5, XX6, XY6, XZ6, YY6, YZ6, ZZ6, MX6, MY6,
        MZ6, M6, FVP2, FVP5, FSP2, FSP5
    ) = standard
    ZZ1R = (ZZ1 + Ia1 + YY2 + YY3 + YY5 + YY6 + D3**2*M3 + xp.sin(c)**2*XX4 +
        2*xp.cos(c)*xp.sin(c)*XY4 + xp.cos(c)**2*YY4 + (D3**2 + D4**2)*M4 + D6**2*M6)
    MY1R = MY1 + MZ2 + MZ3 + MZ4 + MZ5 + MZ6
    XX2R = XX2 - YY2 + XX6 - YY6 - D3**2*(M3 + M4)
    XY2R = XY2 + XY6
    XZ2R = XZ2 + XZ6 - D3*(MZ3 + MZ4)
    YZ2R = YZ2 + YZ6
    ZZ2R = ZZ2 + Ia2 + ZZ6 + D3**2*(M3 + M4)
    MX2R = MX2 + MX6 + D3*(M3 + M4)
    FV2R = FV2 + FVP2
    FS2R = FS2 + FSP2
    XX3R = XX3 - YY3 + XX5 - YY5 - D4**2*M4 - D6**2*M6
    XY3R = XY3 + XY5
    XZ3R = XZ3 - XZ5 - D4*MZ4 + D6*MZ6
    YZ3R = YZ3 - YZ5
    ZZ3R = ZZ3 + ZZ5 + Ia5 + D4**2*M4 + D6**2*M6
    MX3R = MX3 + D4*M4 - D6/D3*MX6
    MX4R = MX4 - xp.sin(c)/xp.cos(c)*MY4
    MX5R = MX5 - D6/D3*MX6 + D6*M6
    FV5R = FV5 + FV4 + FVP5
    FS5R = FS5 + FS4 + FSP5
    return (np.array if xp is np else xp.stack)([
        ZZ1R, MX1, MY1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2R, MY2, FV2R, FS2R,
        OFFSET2, XX3R, XY3R, XZ3R, YZ3R, ZZ3R, MX3R, MY3, MX4R, MX5R, MY5, FV5R, FS5R, OFFSET5, MY6,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D3: float = 0.2,
    D4: float = 0.22, D6: float = 0.1, c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """D of Gamma = D X. Shape (N, 3, 30).

    A view on one store of shape (30, 3, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D3, D4, D6, c, gx, gy))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D3: float = 0.2,
    D4: float = 0.22, D6: float = 0.1, c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """W of Y = W X + rho, shape (3*N, 30), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D3, D4, D6, c, gx, gy))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 30))
    return filled.reshape(30, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 3, 30)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (30, 3), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (30, 3, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(30, 3, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D3: float = 0.2, D4: float = 0.22,
    D6: float = 0.1, c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 3).
    """
    return _evaluated(_inverse_dynamics_block, (3,), (q, qd, qdd), (X,), (D3, D4, D6, c, gx, gy))


def inertia_matrix(
    q: "Array", X: "Array", *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1,
    c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 3, 3).
    """
    return _evaluated(_inertia_matrix_block, (3, 3), (q,), (X,), (D3, D4, D6, c))


def bias(
    q: "Array", qd: "Array", X: "Array", *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1,
    c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 3).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D3=D3, D4=D4, D6=D6, c=c, gx=gx, gy=gy)


def gravity(
    q: "Array", X: "Array", *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1,
    c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 3).
    """
    return _evaluated(_gravity_block, (3,), (q,), (X,), (c, gx, gy))


def frame_poses(
    q: "Array", *, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1, c: float = 0.0,
    gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 8, 4, 4).
    """
    return _evaluated(_frame_poses_block, (8, 4, 4), (q,), (), (D3, D4, D6, c))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D3: float = 0.2, D4: float = 0.22,
    D6: float = 0.1, c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 3)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D3=D3, D4=D4, D6=D6, c=c, gx=gx,
        gy=gy)
    inertia = inertia_matrix(q, X, D3=D3, D4=D4, D6=D6, c=c, gx=gx, gy=gy)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, D3: float = 0.2, D4: float = 0.22, D6: float = 0.1,
    c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 3).
    """
    frame = 8 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 8:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 8")
    return _evaluated(_jacobian_block, (6, 3), (q,), (), (frame, D3, D4, D6, c))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 3, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(8, 4, 4), 0.0)
    _frame_poses_block(xp, q, T, *constants[:4])
    joints, columns, j = _moving(xp, *constants[4:]), {}, frame
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
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((1, 1.0),)), 3: (2, 0, ((1, -1.0), (2, 1.0))),
        4: (3, 0, ((2, -1.0),)), 5: (1, 0, ((2, 1.0),)), 6: (5, 0, ((1, 1.0), (2, -1.0))),
        7: (6, 0, ((1, -1.0), (2, 1.0))), 8: (3, 2, ()),
    }


def passive_joints(
    q: "Array", qd: "Array | None" = None, qdd: "Array | None" = None, *, D3: float = 0.2,
    D4: float = 0.22, D6: float = 0.1, c: float = 0.0, gx: float = -9.81, gy: float = 0.0
) -> "Array | tuple":
    """Positions of the joints PASSIVE, shape (N, 4); with qd also their velocities, with qdd
    also their accelerations.
    """
    given = [state for state in (q, qd, qdd) if state is not None]
    xp = _package(*given)
    rows = _passive(xp, c)
    if xp is not np:
        results = [xp.combined(rows, x, k == 0) for k, x in enumerate(given)]
        return results[0] if len(results) == 1 else tuple(results)
    given = _states(*given)
    origin, rates = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    shape = (*np.shape(q)[:-1], 4)
    results = [(x @ rates.T).reshape(shape) for x in given]
    results[0] += origin
    return results[0] if len(results) == 1 else tuple(results)


def _passive(xp, c):
    """(origin, rates) of the joints PASSIVE over the joints of the columns."""
    return (
        (xp.pi, (0.0, -1.0, 1.0)),
        (c, (0.0, 0.0, -1.0)),
        (0.0, (0.0, 1.0, -1.0)),
        (xp.pi, (0.0, -1.0, 1.0)),
    )


def _regressor_block(xp, q, qd, qdd, D, D3, D4, D6, c, gx, gy):
    """Fill D, shape (30, 3, N), where it is not constant, from q, qd, qdd (3, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D3, D4, D6, c, gx, gy)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D3, D4, D6, c, gx, gy):
    """Fill GAM, shape (3, N), from q, qd, qdd (3, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D3, D4, D6, c, gx, gy)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D3, D4, D6, c, gx, gy):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q1, q2, q5 = q
    QP1, QP2, QP5 = qd
    QDP1, QDP2, QDP5 = qdd
    # Constants
    Z241 = xp.cos(c)
    Z141 = xp.sin(c)
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m5 = q2 - q5
    C2m5 = xp.cos(th2m5)
    S2m5 = xp.sin(th2m5)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    th5b = q5 - c
    C5b = xp.cos(th5b)
    S5b = xp.sin(th5b)
    # Link 1
    VP11 = -gx*C1 - gy*S1
    VP21 = gx*S1 - gy*C1
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
    VP12 = C2*VP11
    VP22 = -S2*VP11
    # Link 3
    W13 = S5*QP1
    W23 = C5*QP1
    S5QDP1 = S5*QDP1
    C5QDP1 = C5*QDP1
    DV233 = QP5*W23
    WP13 = S5QDP1 + DV233
    DV133 = QP5*W13
    WP23 = C5QDP1 - DV133
    DV113 = W13**2
    DV123 = W13*W23
    DV223 = W23**2
    DV333 = QP5**2
    DW233 = DV223 - DV333
    DW313 = DV333 - DV113
    DW123 = DV113 - DV223
    U113 = -DV223 - DV333
    U123 = DV123 - QDP5
    U213 = QDP5 + DV123
    U223 = -DV113 - DV333
    U313 = DV133 - WP23
    U323 = DV233 + WP13
    VSP13 = VP12 + D3*U112
    VSP23 = VP22 + D3*U212
    VSP33 = VP21 + D3*U312
    VP13 = S2m5*VSP23 - C2m5*VSP13
    VP23 = -C2m5*VSP23 - S2m5*VSP13
    # Link 4
    W14 = Z141*QP1
    W24 = Z241*QP1
    WP24 = Z241*QDP1
    DV124 = W14*W24
    DV224 = W24**2
    VSP34 = VSP33 + D4*U313
    # Link 5
    VP15 = C5*VP11
    VP25 = -S5*VP11
    # Link 6
    VSP16 = VP15 + D6*U113
    VSP26 = VP25 + D6*U213
    VSP36 = VP21 - D6*U313
    VP16 = C2m5*VSP16 + S2m5*VSP26
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP5 = xp.sign(QP5)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 3
        V331 = D3*C2
        V132 = D3*S2m5
        V232 = -D3*C2m5
        # Joint axes Z and velocities V seen from link 4
        V341 = V331 - D4*C5
        VS242 = D4 + V232
        V142 = C5b*V132 - S5b*VS242
        V242 = C5b*VS242 + S5b*V132
        V143 = -D4*S5b
        V243 = D4*C5b
        # Joint axes Z and velocities V seen from link 6
        V361 = D6*C5
        V165 = D6*S2m5
        V265 = D6*C2m5
        # Contributions that several joints share
        DF3MX4 = DV124*V243 - DV224*V143
        # Joint 1
        D[0, 0] = QDP1                      # DG1ZZ1
        D[1, 0] = VP21                      # DG1MX1
        D[2, 0] = -VP11                     # DG1MY1
        D[3, 0] = QP1                       # DG1FV1
        D[4, 0] = signQP1                   # DG1FS1
        D[6, 0] = -S2*WP12 - C2*DV132       # DG1XX2
        D[7, 0] = S2*U312 - C2*U322         # DG1XY2
        D[8, 0] = -S2*U212 - C2*DW312       # DG1XZ2
        D[9, 0] = C2*U122 - S2*DW232        # DG1YZ2
        D[11, 0] = C2*VP21                  # DG1MX2
        D[12, 0] = -S2*VP21                 # DG1MY2
        D[16, 0] = S5*WP13 + C5*DV133       # DG1XX3
        D[17, 0] = C5*U323 - S5*U313        # DG1XY3
        D[18, 0] = S5*U213 + C5*DW313       # DG1XZ3
        D[19, 0] = S5*DW233 - C5*U123       # DG1YZ3
        D[21, 0] = U313*V331 - C5*VSP33     # DG1MX3
        D[22, 0] = S5*VSP33 + U323*V331     # DG1MY3
        D[23, 0] = -Z241*VSP34 - WP24*V341  # DG1MX4
        D[24, 0] = C5*VP21                  # DG1MX5
        D[25, 0] = -S5*VP21                 # DG1MY5
        D[29, 0] = U322*V361 - S2*VSP36     # DG1MY6
        # Joint 2
        D[6, 1] = -DV122                             # DG2XX2
        D[7, 1] = DW122                              # DG2XY2
        D[8, 1] = -S2QDP1                            # DG2XZ2
        D[9, 1] = -C2QDP1                            # DG2YZ2
        D[10, 1] = QDP2                              # DG2ZZ2
        D[11, 1] = VP22                              # DG2MX2
        D[12, 1] = -VP12                             # DG2MY2
        D[13, 1] = QP2                               # DG2FV2
        D[14, 1] = signQP2                           # DG2FS2
        D[21, 1] = U113*V132 + U213*V232             # DG2MX3
        D[22, 1] = U123*V132 + U223*V232             # DG2MY3
        D[23, 1] = DV124*V242 - DV224*V142 - DF3MX4  # DG2MX4
        D[29, 1] = -VP16                             # DG2MY6
        # Joint 5
        D[16, 2] = -DV123                 # DG5XX3
        D[17, 2] = DW123                  # DG5XY3
        D[18, 2] = S5QDP1                 # DG5XZ3
        D[19, 2] = C5QDP1                 # DG5YZ3
        D[20, 2] = QDP5                   # DG5ZZ3
        D[21, 2] = VP23                   # DG5MX3
        D[22, 2] = -VP13                  # DG5MY3
        D[23, 2] = DF3MX4                 # DG5MX4
        D[24, 2] = VP25                   # DG5MX5
        D[25, 2] = -VP15                  # DG5MY5
        D[26, 2] = QP5                    # DG5FV5
        D[27, 2] = signQP5                # DG5FS5
        D[29, 2] = U122*V165 + U222*V265  # DG5MY6

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, MX1, MY1R, FV1, FS1, OFFSET1, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, MX2R, MY2, FV2R, FS2R,
            OFFSET2, XX3R, XY3R, XZ3R, YZ3R, ZZ3R, MX3R, MY3, MX4R, MX5R, MY5, FV5R, FS5R, OFFSET5,
            MY6
        ) = X
        # Link 4
        VSP14 = VP13 + D4*U113
        VSP24 = VP23 + D4*U213
        VP24 = C5b*VSP24 + S5b*VSP14
        # Joint 6
        F16 = MY6*U122
        F26 = MY6*U222
        F36 = MY6*U322
        N16 = MY6*VSP36
        N36 = -MY6*VP16
        FDI26 = S2m5*F16 + C2m5*F26
        # Joint 5
        N15 = MY5*VP21
        N25 = -MX5R*VP21
        N35 = MX5R*VP25 - MY5*VP15
        NE15 = C2m5*N16 + N15
        NE25 = S2m5*N16 + N25 - D6*F36
        NE35 = N36 + D6*FDI26 + N35
        # Joint 4
        F14 = -MX4R*DV224
        F24 = MX4R*DV124
        F34 = -MX4R*WP24
        N24 = -MX4R*VSP34
        N34 = MX4R*VP24
        FDI14 = C5b*F14 + S5b*F24
        FDI24 = C5b*F24 - S5b*F14
        # Joint 3
        F13 = MX3R*U113 + MY3*U123
        F23 = MX3R*U213 + MY3*U223
        F33 = MX3R*U313 + MY3*U323
        E13 = FDI14 + F13
        E23 = FDI24 + F23
        E33 = F34 + F33
        N13 = XX3R*WP13 + ZZ3R*DV233 + YZ3R*DW233 + XZ3R*U213 + MY3*VSP33 - XY3R*U313
        N23 = (XX3R - ZZ3R)*DV133 + XZ3R*DW313 + XY3R*U323 - YZ3R*U123 - MX3R*VSP33
        N33 = ZZ3R*QDP5 + XY3R*DW123 + YZ3R*C5QDP1 + XZ3R*S5QDP1 + MX3R*VP23 - XX3R*DV123 - MY3*VP13
        NE13 = S5b*N24 + N13
        NE23 = C5b*N24 + N23 - D4*F34
        NE33 = N34 + D4*FDI24 + N33
        FDI23 = S2m5*E13 - C2m5*E23
        # Joint 2
        N12 = XX2R*WP12 + ZZ2R*DV232 + YZ2R*DW232 + XZ2R*U212 + MY2*VP21 - XY2R*U312
        N22 = (XX2R - ZZ2R)*DV132 + XZ2R*DW312 + XY2R*U322 - YZ2R*U122 - MX2R*VP21
        N32 = ZZ2R*QDP2 + XY2R*DW122 + MX2R*VP22 - XX2R*DV122 - YZ2R*C2QDP1 - XZ2R*S2QDP1 - MY2*VP12
        NE12 = N12 - C2m5*NE13 - S2m5*NE23
        NE22 = S2m5*NE13 + N22 - C2m5*NE23 - D3*E33
        NE32 = NE33 + D3*FDI23 + N32
        # Joint 1
        N31 = ZZ1R*QDP1 + MX1*VP21 - MY1R*VP11
        NE31 = N31 - S5*NE15 - C5*NE25 - S2*NE12 - C2*NE22
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE32 + FV2R*QP2 + FS2R*signQP2 + N36 - NE33
        GAM[2] = NE33 + OFFSET5 + NE35 + FV5R*QP5 + FS5R*signQP5 - N34 - N36

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D3, D4, D6, c):
    """Fill A, shape (3, 3, N), from q (3, N)."""
    # Inputs
    q2, q5 = q[1:]
    (
        ZZ1R, _, _, _, _, _, XX2R, XY2R, XZ2R, YZ2R, ZZ2R, _, _, _, _, _, XX3R, XY3R, XZ3R,
        YZ3R, ZZ3R, MX3R, MY3, MX4R, _, _, _, _, _, MY6
    ) = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m5 = q2 - q5
    C2m5 = xp.cos(th2m5)
    S2m5 = xp.sin(th2m5)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    th5b = q5 - c
    C5b = xp.cos(th5b)
    S5b = xp.sin(th5b)
    # Composite link 7
    C2m5C2m5 = C2m5**2
    C2m5S2m5 = C2m5*S2m5
    # Composite link 6
    AS16 = -MY6*S2m5
    AS26 = MY6*C2m5
    NE356 = D6*AS16
    JP225 = 2*NE356
    JP125 = -D6*AS26
    # Composite link 4
    AS14 = MX4R*C5b
    AS24 = -MX4R*S5b
    NE334 = D4*AS14
    JP223 = 2*NE334
    JP123 = XY3R - D4*AS24
    MSP13 = MX3R + AS14
    MSP23 = MY3 + AS24
    # Composite link 3
    AS13 = -C2m5*MSP13 - S2m5*MSP23
    AS23 = S2m5*MSP13 - C2m5*MSP23
    JP112a = XX3R - JP223
    JP112b = C2m5C2m5*JP112a + 2*C2m5S2m5*JP123
    NE123 = -XZ3R*C2m5 - YZ3R*S2m5
    NE223 = XZ3R*S2m5 - YZ3R*C2m5
    D3AS13 = D3*AS13
    JP112 = XX2R + JP223 + JP112b
    JP122 = XY2R + 2*C2m5C2m5*JP123 - C2m5S2m5*JP112a - JP123 - D3*AS23
    JP132 = XZ2R + NE123
    JP222 = XX3R + 2*D3AS13 - JP112b
    JP232 = YZ2R + NE223
    # Composite link 2
    NE312 = -S2*JP132 - C2*JP232
    JP331 = ZZ1R + JP225*C5**2 + JP125*2*C5*S5 + JP112 + JP122*2*C2*S2 - C2**2*(JP112 - JP222)
    # Unit acceleration of joint 3
    NE313 = -S2*NE123 - C2*NE223
    # Unit acceleration of joint 4
    E224 = -S2m5*AS24 - C2m5*AS14
    # Inertia matrix
    A[0, 0] = JP331
    A[0, 1] = A[1, 0] = NE312 - NE313
    A[1, 1] = ZZ2R
    A[0, 2] = A[2, 0] = NE313
    A[1, 2] = A[2, 1] = NE356 + D3AS13 - D3*E224
    A[2, 2] = ZZ3R


def _gravity_block(xp, q, GAM, X, c, gx, gy):
    """Fill GAM, shape (3, N), from q (3, N)."""
    # Inputs
    q1, q2, q5 = q
    (
        _, MX1, MY1R, _, _, OFFSET1, _, _, _, _, _, MX2R, MY2, _, _, OFFSET2, _, _, _, _, _,
        MX3R, MY3, MX4R, MX5R, MY5, _, _, OFFSET5, MY6
    ) = X
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th2m5 = q2 - q5
    C2m5 = xp.cos(th2m5)
    S2m5 = xp.sin(th2m5)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    th5b = q5 - c
    C5b = xp.cos(th5b)
    S5b = xp.sin(th5b)
    # Link 1
    VP11 = -gx*C1 - gy*S1
    VP21 = gx*S1 - gy*C1
    # Link 2
    VP12 = C2*VP11
    VP22 = -S2*VP11
    # Link 3
    VP13 = S2m5*VP22 - C2m5*VP12
    VP23 = -C2m5*VP22 - S2m5*VP12
    # Link 4
    VP24 = C5b*VP23 + S5b*VP13
    # Joint 6
    N16 = MY6*VP21
    N36 = -MY6*VP12
    # Joint 5
    N15 = MY5*VP21
    N25 = -MX5R*VP21
    N35 = MY5*VP13 - MX5R*VP23
    NE15 = C2m5*N16 + N15
    NE25 = S2m5*N16 + N25
    NE35 = N36 + N35
    # Joint 4
    N24 = -MX4R*VP21
    N34 = MX4R*VP24
    # Joint 3
    N13 = MY3*VP21
    N23 = -MX3R*VP21
    N33 = MX3R*VP23 - MY3*VP13
    NE13 = S5b*N24 + N13
    NE23 = C5b*N24 + N23
    NE33 = N34 + N33
    # Joint 2
    N12 = MY2*VP21
    N22 = -MX2R*VP21
    N32 = MX2R*VP22 - MY2*VP12
    NE12 = N12 - C2m5*NE13 - S2m5*NE23
    NE22 = S2m5*NE13 + N22 - C2m5*NE23
    NE32 = NE33 + N32
    # Joint 1
    N31 = MX1*VP21 - MY1R*VP11
    NE31 = N31 - S5*NE15 - C5*NE25 - S2*NE12 - C2*NE22
    # Torques
    GAM[0] = OFFSET1 + NE31
    GAM[1] = OFFSET2 + NE32 + N36 - NE33
    GAM[2] = N33 + OFFSET5 + NE35 - N36


def _frame_poses_block(xp, q, T, D3, D4, D6, c):
    """Fill T, shape (8, 4, 4, N), from q (3, N)."""
    # Inputs
    q1, q2, q5 = q
    # Constants
    Z241 = xp.cos(c)
    Z141 = xp.sin(c)
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    # Frame 2
    R112 = C1*C2
    R122 = -C1*S2
    R212 = S1*C2
    R222 = -S1*S2
    # Frame 3
    R113 = -C1*C5
    R123 = C1*S5
    R213 = -S1*C5
    R223 = S1*S5
    P13 = D3*R112
    P23 = D3*R212
    P33 = -D3*S2
    # Frame 4
    R114 = -Z241*C1
    R124 = Z141*C1
    R214 = -Z241*S1
    R224 = Z141*S1
    P14 = P13 + D4*R113
    P24 = P23 + D4*R213
    P34 = P33 + D4*S5
    # Frame 6
    P16 = -D6*R113
    P26 = -D6*R213
    P36 = -D6*S5
    # Frame 7
    P17 = P13 + P16
    P27 = P23 + P26
    P37 = P33 + P36
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[1, 0, 0] = R112
    T[1, 0, 1] = R122
    T[1, 0, 2] = -S1
    T[1, 1, 0] = R212
    T[1, 1, 1] = R222
    T[1, 1, 2] = C1
    T[1, 2, 0] = -S2
    T[1, 2, 1] = -C2
    T[2, 0, 0] = R113
    T[2, 0, 1] = R123
    T[2, 0, 2] = -S1
    T[2, 0, 3] = P13
    T[2, 1, 0] = R213
    T[2, 1, 1] = R223
    T[2, 1, 2] = C1
    T[2, 1, 3] = P23
    T[2, 2, 0] = S5
    T[2, 2, 1] = C5
    T[2, 2, 3] = P33
    T[3, 0, 0] = R114
    T[3, 0, 1] = R124
    T[3, 0, 2] = -S1
    T[3, 0, 3] = P14
    T[3, 1, 0] = R214
    T[3, 1, 1] = R224
    T[3, 1, 2] = C1
    T[3, 1, 3] = P24
    T[3, 2, 0] = Z141
    T[3, 2, 1] = Z241
    T[3, 2, 3] = P34
    T[4, 0, 0] = -R113
    T[4, 0, 1] = -R123
    T[4, 0, 2] = -S1
    T[4, 1, 0] = -R213
    T[4, 1, 1] = -R223
    T[4, 1, 2] = C1
    T[4, 2, 0] = -S5
    T[4, 2, 1] = -C5
    T[5, 0, 0] = R112
    T[5, 0, 1] = R122
    T[5, 0, 2] = -S1
    T[5, 0, 3] = P16
    T[5, 1, 0] = R212
    T[5, 1, 1] = R222
    T[5, 1, 2] = C1
    T[5, 1, 3] = P26
    T[5, 2, 0] = -S2
    T[5, 2, 1] = -C2
    T[5, 2, 3] = P36
    T[6, 0, 0] = R113
    T[6, 0, 1] = R123
    T[6, 0, 2] = -S1
    T[6, 0, 3] = P17
    T[6, 1, 0] = R213
    T[6, 1, 1] = R223
    T[6, 1, 2] = C1
    T[6, 1, 3] = P27
    T[6, 2, 0] = S5
    T[6, 2, 1] = C5
    T[6, 2, 3] = P37
    T[7, 0, 0] = R113
    T[7, 0, 1] = R123
    T[7, 0, 2] = -S1
    T[7, 0, 3] = P17
    T[7, 1, 0] = R213
    T[7, 1, 1] = R223
    T[7, 1, 2] = C1
    T[7, 1, 3] = P27
    T[7, 2, 0] = S5
    T[7, 2, 1] = C5
    T[7, 2, 3] = P37
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 3, 3] = T[2, 3, 3] = T[3, 3, 3] = T[4, 3, 3] = T[5, 3, 3] = 1.0
    T[6, 3, 3] = T[7, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4, 5, 6)
DRIVES = {  # qm = ratio (q - offset), tau = ratio' (torque_constant * u)
    'ratio': (
        (10.0, 0.0, 0.0),
        (0.0, 10.0, 0.0),
        (0.0, 0.0, 10.0),
    ),
    'offset': (0.0, 0.0, 0.0),
    'torque_constant': (1.0, 1.0, 1.0),
}
LIMITS = {
    'q': ((-1.0, 1.0), (-1.7, 0.1), (-3.2, -1.5)),
    'qd': (6.0, 6.0, 6.0),
    'qdd': (60.0, 60.0, 60.0),
}
VALUES = {
    'XX1': 0.0060936, 'XY1': -2e-07, 'XZ1': 2e-07, 'YY1': 0.007194, 'YZ1': 0.0004387,
    'ZZ1': 0.00731594, 'MX1': 1e-05, 'MY1': 0.0219355, 'MZ1': -0.026865, 'M1': 1.3432,
    'Ia1': 0.0086827, 'FV1': 0.0002, 'FS1': 0.12, 'OFFSET1': 0.0002, 'XX2': 0.0005008,
    'XY2': 7e-07, 'XZ2': 9.88e-05, 'YY2': 0.009455, 'YZ2': 0.0, 'ZZ2': 0.0094661,
    'MX2': -0.0895382, 'MY2': 1e-05, 'MZ2': 0.0012839, 'M2': 1.1377, 'Ia2': 0.0054814,
    'FV2': 0.0001, 'FS2': 0.09, 'OFFSET2': 0.02, 'XX3': 3.156e-05, 'XY3': -1e-06,
    'XZ3': -4.23e-05, 'YY3': 0.0034816, 'YZ3': 0.0, 'ZZ3': 0.00348384, 'MX3': 0.0279611,
    'MY3': 1e-05, 'MZ3': 0.0004654, 'M3': 0.281, 'XX4': 2.74e-05, 'XY4': 0.0, 'XZ4': 0.0,
    'YY4': 2.74e-05, 'YZ4': 0.0, 'ZZ4': 3.35e-05, 'MX4': -1e-05, 'MY4': 5.69e-05,
    'MZ4': 1.08e-05, 'M4': 0.0569, 'FV4': 1e-05, 'FS4': 0.005, 'XX5': 0.0004348, 'XY5': 6e-07,
    'XZ5': -4.19e-05, 'YY5': 0.0048428, 'YZ5': 0.0, 'ZZ5': 0.0048887, 'MX5': 0.0655991,
    'MY5': -1e-05, 'MZ5': 0.0003762, 'M5': 0.9757, 'Ia5': 0.0024855, 'FV5': 0.0001,
    'FS5': 0.085, 'OFFSET5': 0.03, 'XX6': 6.8e-06, 'XY6': -7e-07, 'XZ6': 5.3e-06,
    'YY6': 0.0005366, 'YZ6': 0.0, 'ZZ6': 0.0005365, 'MX6': 0.0029582, 'MY6': 1e-05,
    'MZ6': -7.18e-05, 'M6': 0.0388, 'FVP2': 2e-05, 'FVP5': 2e-05, 'FSP2': 0.02, 'FSP5': 0.02,
}
BASE_VALUES = base_parameters(VALUES)  # X of the robot file
