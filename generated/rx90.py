"""Stäubli RX-90, 6 revolute joints: base parameters, regressor, dynamics.

GENERATED from rx90.yaml, sha256 7e24e40e8e70, by symgen 0.5.0.
Do not edit; symgen generate rx90

Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS
    j  ant  sigma  alpha   d  theta    r
    1    0      0      0   0     q1    0
    2    1      0   pi/2   0     q2    0
    3    2      0      0  D3     q3    0
    4    3      0  -pi/2   0     q4  RL4
    5    4      0   pi/2   0     q5    0
    6    5      0  -pi/2   0     q6    0
Gravity     acceleration (0, 0, -g) in frame 0, m/s**2
Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd +
            FS*sign(qd) + OFFSET
Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY
            MZ first moments
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q3, q4, q5, q6
    FV      viscous: along q1, q2, q3, q4, q5, q6
    FS      coulomb: along q1, q2, q3, q4, q5, q6
    OFFSET  offset: along q1, q2, q3, q4, q5, q6

Base parameters, 58 of 84; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 MZ2 M2

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
    DN   the part of DG that turns: axis times moment
    R    orientation of a frame in frame 0
    P    origin of a frame in frame 0

Cost per sample
    regressor          355 multiplications, 261 additions, 6 sin, 6 cos
    inverse_dynamics   257 multiplications, 243 additions, 6 sin, 6 cos
    inertia_matrix     134 multiplications, 110 additions, 5 sin, 5 cos
    gravity            42 multiplications, 29 additions, 5 sin, 5 cos
    frame_poses        48 multiplications, 20 additions, 6 sin, 6 cos

Arguments   q, qd, qdd, tau of shape (N, 6), or (6,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (58,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 8e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: f9c4d6972f110908b41331b6224261759336938b6b45c968d6ef291c70f956e1
"""

import numpy as np

SCHEMA = 1
NAME = 'rx90'
SOURCE_SHA256 = '7e24e40e8e70118c2d7338d6ebf43fb6238e22293b4ae2f080cef4a01313666b'
JOINTS = (1, 2, 3, 4, 5, 6)
CONSTANTS = {'D3': 0.45, 'RL4': 0.45, 'g': 9.81}
BASE_PARAMETERS = tuple("""
ZZ1R FV1 FS1 OFFSET1 XX2R XY2 XZ2R YZ2 ZZ2R MX2R MY2 FV2 FS2 OFFSET2 XX3R XY3 XZ3 YZ3 ZZ3R MX3 MY3R
Ia3 FV3 FS3 OFFSET3 XX4R XY4 XZ4 YZ4 ZZ4R MX4 MY4R Ia4 FV4 FS4 OFFSET4 XX5R XY5 XZ5 YZ5 ZZ5R MX5
MY5R Ia5 FV5 FS5 OFFSET5 XX6R XY6 XZ6 YZ6 ZZ6 MX6 MY6 Ia6 FV6 FS6 OFFSET6
""".split())
STANDARD_PARAMETERS = tuple("""
XX1 XY1 XZ1 YY1 YZ1 ZZ1 MX1 MY1 MZ1 M1 Ia1 FV1 FS1 OFFSET1 XX2 XY2 XZ2 YY2 YZ2 ZZ2 MX2 MY2 MZ2 M2
Ia2 FV2 FS2 OFFSET2 XX3 XY3 XZ3 YY3 YZ3 ZZ3 MX3 MY3 MZ3 M3 Ia3 FV3 FS3 OFFSET3 XX4 XY4 XZ4 YY4 YZ4
ZZ4 MX4 MY4 MZ4 M4 Ia4 FV4 FS4 OFFSET4 XX5 XY5 XZ5 YY5 YZ5 ZZ5 MX5 MY5 MZ5 M5 Ia5 FV5 FS5 OFFSET5
XX6 XY6 XZ6 YY6 YZ6 ZZ6 MX6 MY6 MZ6 M6 Ia6 FV6 FS6 OFFSET6
""".split())
NO_EFFECT = ('XX1', 'XY1', 'XZ1', 'YY1', 'YZ1', 'MX1', 'MY1', 'MZ1', 'M1', 'MZ2', 'M2')
FORMULAS = {
    'ZZ1R': 'ZZ1 + Ia1 + YY2 + YY3 + D3**2*(M3 + M4 + M5 + M6)',
    'XX2R': 'XX2 - YY2 - D3**2*(M3 + M4 + M5 + M6)',
    'XZ2R': 'XZ2 - D3*MZ3',
    'ZZ2R': 'ZZ2 + Ia2 + D3**2*(M3 + M4 + M5 + M6)',
    'MX2R': 'MX2 + D3*(M3 + M4 + M5 + M6)',
    'XX3R': 'XX3 - YY3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4 + M5 + M6)',
    'ZZ3R': 'ZZ3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4 + M5 + M6)',
    'MY3R': 'MY3 + MZ4 + RL4*(M4 + M5 + M6)',
    'XX4R': 'XX4 - YY4 + YY5',
    'ZZ4R': 'ZZ4 + YY5',
    'MY4R': 'MY4 - MZ5',
    'XX5R': 'XX5 - YY5 + YY6',
    'ZZ5R': 'ZZ5 + YY6',
    'MY5R': 'MY5 + MZ6',
    'XX6R': 'XX6 - YY6',
}
UNITS = dict(zip(BASE_PARAMETERS, tuple("""
kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m N*m*s/rad N*m N*m
kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2
kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m
kg*m kg*m**2 N*m*s/rad N*m N*m kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m**2 kg*m kg*m kg*m**2 N*m*s/rad
N*m N*m
""".split())))
# STRUCTURE[k, j]: whether base parameter k acts on joint j
STRUCTURE = np.array([[mark == "x" for mark in row] for row in (
    "x.....", "x.....", "x.....", "x.....", "xx....", "xx....", "xx....", "xx....", ".x....",
    ".x....", ".x....", ".x....", ".x....", ".x....", "xxx...", "xxx...", "xxx...", "xxx...",
    ".xx...", "xxx...", "xxx...", "..x...", "..x...", "..x...", "..x...", "xxxx..", "xxxx..",
    "xxxx..", "xxxx..", "xxxx..", "xxxx..", "xxxx..", "...x..", "...x..", "...x..", "...x..",
    "xxxxx.", "xxxxx.", "xxxxx.", "xxxxx.", "xxxxx.", "xxxxx.", "xxxxx.", "....x.", "....x.",
    "....x.", "....x.", "xxxxxx", "xxxxxx", "xxxxxx", "xxxxxx", "xxxxxx", "xxxxxx", "xxxxxx",
    ".....x", ".....x", ".....x", ".....x",
)])


class Store(np.ndarray):
    """Room for a regressor, made by `store`; views and copies of one are no stores."""

    ready = False

    def __array_finalize__(self, parent):
        self.ready = False


def store(N: int) -> Store:
    """Room for N samples, shape (58, 6, N): zeros and constants are written here, once.
    Reuse it: a fresh one costs page faults.
    """
    room = _constant(np.zeros((58, 6, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[3, 0] = D[13, 1] = D[24, 2] = D[35, 3] = D[46, 4] = D[57, 5] = 1.0
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
    if tuple(X.shape) != (58,):
        raise ValueError(f"X of shape {X.shape}; expected (58,) in the order of BASE_PARAMETERS")
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
        return [X[k] for k in range(58)]

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

    def rows(self, x, count=6):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 58)

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

    Inputs are columns q, qd, qdd, tau (6,), X (58,), standard (84,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (6, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 58, "standard": 84}
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
    'frame_poses': ('q', 'T1 T2 T3 T4 T5 T6'),
    'jacobian': ('q', 'J'),
}


def elements(*, D3: float = 0.45, RL4: float = 0.45, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D3, RL4, g))
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
    }


ELEMENTS = elements()


def base_parameters(
    standard: "Array", *, D3: float = 0.45, RL4: float = 0.45, g: float = 9.81
) -> "Array":
    """X, shape (58,), from the 84 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (84,):
            raise ValueError(
                f"standard of shape {shape}; expected (84,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(84)]
    if xp is np:
        _numbers((D3, RL4, g))
    (
        _, _, _, _, _, ZZ1, _, _, _, _, Ia1, FV1, FS1, OFFSET1, XX2, XY2, XZ2, YY2, YZ2, ZZ2,
        MX2, MY2, _, _, Ia2, FV2, FS2, OFFSET2, XX3, XY3, XZ3, YY3, YZ3, ZZ3, MX3, MY3, MZ3, M3,
        Ia3, FV3, FS3, OFFSET3, XX4, XY4, XZ4, YY4, YZ4, ZZ4, MX4, MY4, MZ4, M4, Ia4, FV4, FS4,
        OFFSET4, XX5, XY5, XZ5, YY5, YZ5, ZZ5, MX5, MY5, MZ5, M5, Ia5, FV5, FS5, OFFSET5, XX6,
        XY6, XZ6, YY6, YZ6, ZZ6, MX6, MY6, MZ6, M6, Ia6, FV6, FS6, OFFSET6
    ) = standard
    ZZ1R = ZZ1 + Ia1 + YY2 + YY3 + D3**2*(M3 + M4 + M5 + M6)
    XX2R = XX2 - YY2 - D3**2*(M3 + M4 + M5 + M6)
    XZ2R = XZ2 - D3*MZ3
    ZZ2R = ZZ2 + Ia2 + D3**2*(M3 + M4 + M5 + M6)
    MX2R = MX2 + D3*(M3 + M4 + M5 + M6)
    XX3R = XX3 - YY3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4 + M5 + M6)
    ZZ3R = ZZ3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4 + M5 + M6)
    MY3R = MY3 + MZ4 + RL4*(M4 + M5 + M6)
    XX4R = XX4 - YY4 + YY5
    ZZ4R = ZZ4 + YY5
    MY4R = MY4 - MZ5
    XX5R = XX5 - YY5 + YY6
    ZZ5R = ZZ5 + YY6
    MY5R = MY5 + MZ6
    XX6R = XX6 - YY6
    return (np.array if xp is np else xp.stack)([
        ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2, XZ2R, YZ2, ZZ2R, MX2R, MY2, FV2, FS2, OFFSET2, XX3R,
        XY3, XZ3, YZ3, ZZ3R, MX3, MY3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4,
        MY4R, Ia4, FV4, FS4, OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5, OFFSET5,
        XX6R, XY6, XZ6, YZ6, ZZ6, MX6, MY6, Ia6, FV6, FS6, OFFSET6,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D3: float = 0.45,
    RL4: float = 0.45, g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 6, 58).

    A view on one store of shape (58, 6, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D3, RL4, g))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D3: float = 0.45,
    RL4: float = 0.45, g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (6*N, 58), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D3, RL4, g))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 58))
    return filled.reshape(58, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 6, 58)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (58, 6), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (58, 6, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(58, 6, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D3: float = 0.45, RL4: float = 0.45,
    g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 6).
    """
    return _evaluated(_inverse_dynamics_block, (6,), (q, qd, qdd), (X,), (D3, RL4, g))


def inertia_matrix(
    q: "Array", X: "Array", *, D3: float = 0.45, RL4: float = 0.45, g: float = 9.81
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 6, 6).
    """
    return _evaluated(_inertia_matrix_block, (6, 6), (q,), (X,), (D3, RL4))


def bias(
    q: "Array", qd: "Array", X: "Array", *, D3: float = 0.45, RL4: float = 0.45,
    g: float = 9.81
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 6).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D3=D3, RL4=RL4, g=g)


def gravity(
    q: "Array", X: "Array", *, D3: float = 0.45, RL4: float = 0.45, g: float = 9.81
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 6).
    """
    return _evaluated(_gravity_block, (6,), (q,), (X,), (g,))


def frame_poses(q: "Array", *, D3: float = 0.45, RL4: float = 0.45, g: float = 9.81) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 6, 4, 4).
    """
    return _evaluated(_frame_poses_block, (6, 4, 4), (q,), (), (D3, RL4))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D3: float = 0.45, RL4: float = 0.45,
    g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 6)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D3=D3, RL4=RL4, g=g)
    inertia = inertia_matrix(q, X, D3=D3, RL4=RL4, g=g)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, D3: float = 0.45, RL4: float = 0.45,
    g: float = 9.81
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 6).
    """
    frame = 6 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 6:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 6")
    return _evaluated(_jacobian_block, (6, 6), (q,), (), (frame, D3, RL4))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 6, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(6, 4, 4), 0.0)
    _frame_poses_block(xp, q, T, *constants[:2])
    joints, columns, j = _moving(xp, *constants[2:]), {}, frame
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
    }


def _regressor_block(xp, q, qd, qdd, D, D3, RL4, g):
    """Fill D, shape (58, 6, N), where it is not constant, from q, qd, qdd (6, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D3, RL4, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D3, RL4, g):
    """Fill GAM, shape (6, N), from q, qd, qdd (6, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D3, RL4, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D3, RL4, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q2, q3, q4, q5, q6 = q[1:]
    QP1, QP2, QP3, QP4, QP5, QP6 = qd
    QDP1, QDP2, QDP3, QDP4, QDP5, QDP6 = qdd
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
    th23 = q2 + q3
    C23 = xp.cos(th23)
    S23 = xp.sin(th23)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Link 2
    W12 = S2*QP1
    W22 = C2*QP1
    S2QDP1 = S2*QDP1
    C2QDP1 = C2*QDP1
    DV232 = QP2*W22
    WP12 = S2QDP1 + DV232
    DV132 = QP2*W12
    WP22 = C2QDP1 - DV132
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
    U312 = DV132 - WP22
    U322 = DV232 + WP12
    VP12 = g*S2
    VP22 = g*C2
    # Link 3
    W33 = QP2 + QP3
    WP33 = QDP2 + QDP3
    W13 = S23*QP1
    W23 = C23*QP1
    S23QDP1 = S23*QDP1
    C23QDP1 = C23*QDP1
    DV233 = W33*W23
    WP13 = S23QDP1 + DV233
    DV133 = W33*W13
    WP23 = C23QDP1 - DV133
    DV113 = W13**2
    DV123 = W13*W23
    DV223 = W23**2
    DV333 = W33**2
    DW233 = DV223 - DV333
    DW313 = DV333 - DV113
    DW123 = DV113 - DV223
    U113 = -DV223 - DV333
    U123 = DV123 - WP33
    U213 = WP33 + DV123
    U223 = -DV113 - DV333
    U313 = DV133 - WP23
    U323 = DV233 + WP13
    VSP33 = D3*U312
    VSP13 = VP12 + D3*U112
    VSP23 = VP22 + D3*U212
    VP13 = C3*VSP13 + S3*VSP23
    VP23 = C3*VSP23 - S3*VSP13
    # Link 4
    W14 = C4*W13 - S4*W33
    W24 = -C4*W33 - S4*W13
    W34 = QP4 + W23
    WP14 = C4*WP13 + QP4*W24 - S4*WP33
    WP24 = -C4*WP33 - S4*WP13 - QP4*W14
    WP34 = QDP4 + WP23
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
    VSP14 = VP13 + RL4*U123
    VSP24 = VP23 + RL4*U223
    VSP34 = VSP33 + RL4*U323
    VP14 = C4*VSP14 - S4*VSP34
    VP24 = -C4*VSP34 - S4*VSP14
    # Link 5
    W15 = C5*W14 + S5*W34
    W25 = C5*W34 - S5*W14
    W35 = QP5 - W24
    WP15 = C5*WP14 + S5*WP34 + QP5*W25
    WP25 = C5*WP34 - S5*WP14 - QP5*W15
    WP35 = QDP5 - WP24
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
    VP15 = C5*VP14 + S5*VSP24
    VP25 = C5*VSP24 - S5*VP14
    # Link 6
    W16 = C6*W15 - S6*W35
    W26 = -C6*W35 - S6*W15
    W36 = QP6 + W25
    WP16 = C6*WP15 + QP6*W26 - S6*WP35
    WP26 = -C6*WP35 - S6*WP15 - QP6*W16
    WP36 = QDP6 + WP25
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
    VP16 = C6*VP15 + S6*VP24
    VP26 = C6*VP24 - S6*VP15
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP3 = xp.sign(QP3)
    signQP4 = xp.sign(QP4)
    signQP5 = xp.sign(QP5)
    signQP6 = xp.sign(QP6)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 3
        V331 = -D3*C2
        V132 = D3*S3
        V232 = D3*C3
        # Joint axes Z and velocities V seen from link 4
        Z141 = S23*C4
        Z241 = -S23*S4
        VS341 = V331 + RL4*S23
        V141 = -S4*VS341
        V241 = -C4*VS341
        VS142 = V132 - RL4
        V142 = C4*VS142
        V242 = -S4*VS142
        V143 = -RL4*C4
        V243 = RL4*S4
        # Joint axes Z and velocities V seen from link 5
        Z151 = C5*Z141 + C23*S5
        Z251 = C23*C5 - S5*Z141
        V151 = C5*V141
        V251 = -S5*V141
        Z152 = -S4*C5
        Z252 = S4*S5
        V152 = C5*V142 + S5*V232
        V252 = C5*V232 - S5*V142
        V153 = C5*V143
        V253 = -S5*V143
        # Joint axes Z and velocities V seen from link 6
        Z161 = C6*Z151 + S6*Z241
        Z261 = C6*Z241 - S6*Z151
        V161 = C6*V151 + S6*V241
        V261 = C6*V241 - S6*V151
        Z162 = C6*Z152 - C4*S6
        Z262 = -C4*C6 - S6*Z152
        V162 = C6*V152 + S6*V242
        V262 = C6*V242 - S6*V152
        V163 = C6*V153 + S6*V243
        V263 = C6*V243 - S6*V153
        Z164 = S5*C6
        Z264 = -S5*S6
        # Contributions that several joints share
        DV134Z241 = DV134*Z241
        C4DV134 = C4*DV134
        DN2XX4 = -S4*WP14 - C4DV134
        DN2XY4 = S4*U314 - C4*U324
        DN2XZ4 = -S4*U214 - C4*DW314
        DN2YZ4 = C4*U124 - S4*DW234
        DN2ZZ4 = C4DV134 - S4*DV234
        DN2MX4 = C4*VSP24
        DN2MY4 = -S4*VSP24
        DV135Z251 = DV135*Z251
        DV135Z252 = DV135*Z252
        DN2XX5 = WP15*Z152 + DV135Z252 - C4*DV125
        C5DV135 = C5*DV135
        DN2XY5 = U325*Z252 + C4*DW125 - U315*Z152
        DN2XZ5 = U215*Z152 + DW315*Z252 - C4*U235
        DN2YZ5 = DW235*Z152 + C4*U135 - U125*Z252
        DN2ZZ5 = DV235*Z152 + C4*WP35 - DV135Z252
        DN2MX5 = VP24*Z252 + C4*VP25
        DN2MY5 = -VP24*Z152 - C4*VP15
        DV136Z261 = DV136*Z261
        DV136Z262 = DV136*Z262
        DN2XX6 = WP16*Z162 + DV136Z262 - DV126*Z252
        DV136Z264 = DV136*Z264
        C6DV136 = C6*DV136
        DN2XY6 = U326*Z262 + DW126*Z252 - U316*Z162
        DN2XZ6 = U216*Z162 + DW316*Z262 - U236*Z252
        DN2YZ6 = DW236*Z162 + U136*Z252 - U126*Z262
        DN2ZZ6 = DV236*Z162 + WP36*Z252 - DV136Z262
        DN2MX6 = VP26*Z252 - VP25*Z262
        DN2MY6 = VP25*Z162 - VP16*Z252
        # Joint 1
        D[0, 0] = QDP1                                                    # DG1ZZ1
        D[1, 0] = QP1                                                     # DG1FV1
        D[2, 0] = signQP1                                                 # DG1FS1
        D[4, 0] = S2*WP12 + C2*DV132                                      # DG1XX2
        D[5, 0] = C2*U322 - S2*U312                                       # DG1XY2
        D[6, 0] = S2*U212 + C2*DW312                                      # DG1XZ2
        D[7, 0] = S2*DW232 - C2*U122                                      # DG1YZ2
        D[14, 0] = S23*WP13 + C23*DV133                                   # DG1XX3
        D[15, 0] = C23*U323 - S23*U313                                    # DG1XY3
        D[16, 0] = S23*U213 + C23*DW313                                   # DG1XZ3
        D[17, 0] = S23*DW233 - C23*U123                                   # DG1YZ3
        D[19, 0] = U313*V331 - C23*VSP33                                  # DG1MX3
        D[20, 0] = S23*VSP33 + U323*V331                                  # DG1MY3
        D[25, 0] = WP14*Z141 + DV134Z241 - C23*DV124                      # DG1XX4
        D[26, 0] = U324*Z241 + C23*DW124 - U314*Z141                      # DG1XY4
        D[27, 0] = U214*Z141 + DW314*Z241 - C23*U234                      # DG1XZ4
        D[28, 0] = DW234*Z141 + C23*U134 - U124*Z241                      # DG1YZ4
        D[29, 0] = DV234*Z141 + C23*WP34 - DV134Z241                      # DG1ZZ4
        D[30, 0] = C23*VP24 + U114*V141 + U214*V241 - VSP24*Z241          # DG1MX4
        D[31, 0] = VSP24*Z141 + U124*V141 + U224*V241 - C23*VP14          # DG1MY4
        D[36, 0] = WP15*Z151 + DV135Z251 + DV125*Z241                     # DG1XX5
        D[37, 0] = U325*Z251 - U315*Z151 - DW125*Z241                     # DG1XY5
        D[38, 0] = U215*Z151 + DW315*Z251 + U235*Z241                     # DG1XZ5
        D[39, 0] = DW235*Z151 - U125*Z251 - U135*Z241                     # DG1YZ5
        D[40, 0] = DV235*Z151 - DV135Z251 - WP35*Z241                     # DG1ZZ5
        D[41, 0] = VP24*Z251 + U115*V151 + U215*V251 - VP25*Z241 - U315*V241  # DG1MX5
        D[42, 0] = VP15*Z241 + U125*V151 + U225*V251 - VP24*Z151 - U325*V241  # DG1MY5
        D[47, 0] = WP16*Z161 + DV136Z261 - DV126*Z251                     # DG1XX6
        D[48, 0] = U326*Z261 + DW126*Z251 - U316*Z161                     # DG1XY6
        D[49, 0] = U216*Z161 + DW316*Z261 - U236*Z251                     # DG1XZ6
        D[50, 0] = DW236*Z161 + U136*Z251 - U126*Z261                     # DG1YZ6
        D[51, 0] = DV236*Z161 + WP36*Z251 - DV136Z261                     # DG1ZZ6
        D[52, 0] = VP26*Z251 + U116*V161 + U216*V261 + U316*V251 - VP25*Z261  # DG1MX6
        D[53, 0] = VP25*Z161 + U126*V161 + U226*V261 + U326*V251 - VP16*Z251  # DG1MY6
        # Joint 2
        D[4, 1] = -DV122                                       # DG2XX2
        D[5, 1] = DW122                                        # DG2XY2
        D[6, 1] = S2QDP1                                       # DG2XZ2
        D[7, 1] = C2QDP1                                       # DG2YZ2
        D[8, 1] = QDP2                                         # DG2ZZ2
        D[9, 1] = VP22                                         # DG2MX2
        D[10, 1] = -VP12                                       # DG2MY2
        D[11, 1] = QP2                                         # DG2FV2
        D[12, 1] = signQP2                                     # DG2FS2
        D[14, 1] = -DV123                                      # DG2XX3
        D[15, 1] = DW123                                       # DG2XY3
        D[16, 1] = S23QDP1                                     # DG2XZ3
        D[17, 1] = C23QDP1                                     # DG2YZ3
        D[18, 1] = WP33                                        # DG2ZZ3
        D[19, 1] = VP23 + U113*V132 + U213*V232                # DG2MX3
        D[20, 1] = U123*V132 + U223*V232 - VP13                # DG2MY3
        D[25, 1] = DN2XX4                                      # DG2XX4
        D[26, 1] = DN2XY4                                      # DG2XY4
        D[27, 1] = DN2XZ4                                      # DG2XZ4
        D[28, 1] = DN2YZ4                                      # DG2YZ4
        D[29, 1] = DN2ZZ4                                      # DG2ZZ4
        D[30, 1] = DN2MX4 + U114*V142 + U214*V242 + U314*V232  # DG2MX4
        D[31, 1] = DN2MY4 + U124*V142 + U224*V242 + U324*V232  # DG2MY4
        D[36, 1] = DN2XX5                                      # DG2XX5
        D[37, 1] = DN2XY5                                      # DG2XY5
        D[38, 1] = DN2XZ5                                      # DG2XZ5
        D[39, 1] = DN2YZ5                                      # DG2YZ5
        D[40, 1] = DN2ZZ5                                      # DG2ZZ5
        D[41, 1] = DN2MX5 + U115*V152 + U215*V252 - U315*V242  # DG2MX5
        D[42, 1] = DN2MY5 + U125*V152 + U225*V252 - U325*V242  # DG2MY5
        D[47, 1] = DN2XX6                                      # DG2XX6
        D[48, 1] = DN2XY6                                      # DG2XY6
        D[49, 1] = DN2XZ6                                      # DG2XZ6
        D[50, 1] = DN2YZ6                                      # DG2YZ6
        D[51, 1] = DN2ZZ6                                      # DG2ZZ6
        D[52, 1] = DN2MX6 + U116*V162 + U216*V262 + U316*V252  # DG2MX6
        D[53, 1] = DN2MY6 + U126*V162 + U226*V262 + U326*V252  # DG2MY6
        # Joint 3
        D[14, 2] = -DV123                                      # DG3XX3
        D[15, 2] = DW123                                       # DG3XY3
        D[16, 2] = S23QDP1                                     # DG3XZ3
        D[17, 2] = C23QDP1                                     # DG3YZ3
        D[18, 2] = WP33                                        # DG3ZZ3
        D[19, 2] = VP23                                        # DG3MX3
        D[20, 2] = -VP13                                       # DG3MY3
        D[21, 2] = QDP3                                        # DG3Ia3
        D[22, 2] = QP3                                         # DG3FV3
        D[23, 2] = signQP3                                     # DG3FS3
        D[25, 2] = DN2XX4                                      # DG3XX4
        D[26, 2] = DN2XY4                                      # DG3XY4
        D[27, 2] = DN2XZ4                                      # DG3XZ4
        D[28, 2] = DN2YZ4                                      # DG3YZ4
        D[29, 2] = DN2ZZ4                                      # DG3ZZ4
        D[30, 2] = DN2MX4 + U114*V143 + U214*V243              # DG3MX4
        D[31, 2] = DN2MY4 + U124*V143 + U224*V243              # DG3MY4
        D[36, 2] = DN2XX5                                      # DG3XX5
        D[37, 2] = DN2XY5                                      # DG3XY5
        D[38, 2] = DN2XZ5                                      # DG3XZ5
        D[39, 2] = DN2YZ5                                      # DG3YZ5
        D[40, 2] = DN2ZZ5                                      # DG3ZZ5
        D[41, 2] = DN2MX5 + U115*V153 + U215*V253 - U315*V243  # DG3MX5
        D[42, 2] = DN2MY5 + U125*V153 + U225*V253 - U325*V243  # DG3MY5
        D[47, 2] = DN2XX6                                      # DG3XX6
        D[48, 2] = DN2XY6                                      # DG3XY6
        D[49, 2] = DN2XZ6                                      # DG3XZ6
        D[50, 2] = DN2YZ6                                      # DG3YZ6
        D[51, 2] = DN2ZZ6                                      # DG3ZZ6
        D[52, 2] = DN2MX6 + U116*V163 + U216*V263 + U316*V253  # DG3MX6
        D[53, 2] = DN2MY6 + U126*V163 + U226*V263 + U326*V253  # DG3MY6
        # Joint 4
        D[25, 3] = -DV124                            # DG4XX4
        D[26, 3] = DW124                             # DG4XY4
        D[27, 3] = -U234                             # DG4XZ4
        D[28, 3] = U134                              # DG4YZ4
        D[29, 3] = WP34                              # DG4ZZ4
        D[30, 3] = VP24                              # DG4MX4
        D[31, 3] = -VP14                             # DG4MY4
        D[32, 3] = QDP4                              # DG4Ia4
        D[33, 3] = QP4                               # DG4FV4
        D[34, 3] = signQP4                           # DG4FS4
        D[36, 3] = S5*WP15 + C5DV135                 # DG4XX5
        D[37, 3] = C5*U325 - S5*U315                 # DG4XY5
        D[38, 3] = S5*U215 + C5*DW315                # DG4XZ5
        D[39, 3] = S5*DW235 - C5*U125                # DG4YZ5
        D[40, 3] = S5*DV235 - C5DV135                # DG4ZZ5
        D[41, 3] = C5*VP24                           # DG4MX5
        D[42, 3] = -S5*VP24                          # DG4MY5
        D[47, 3] = WP16*Z164 + DV136Z264 - C5*DV126  # DG4XX6
        D[48, 3] = U326*Z264 + C5*DW126 - U316*Z164  # DG4XY6
        D[49, 3] = U216*Z164 + DW316*Z264 - C5*U236  # DG4XZ6
        D[50, 3] = DW236*Z164 + C5*U136 - U126*Z264  # DG4YZ6
        D[51, 3] = DV236*Z164 + C5*WP36 - DV136Z264  # DG4ZZ6
        D[52, 3] = C5*VP26 - VP25*Z264               # DG4MX6
        D[53, 3] = VP25*Z164 - C5*VP16               # DG4MY6
        # Joint 5
        D[36, 4] = -DV125               # DG5XX5
        D[37, 4] = DW125                # DG5XY5
        D[38, 4] = -U235                # DG5XZ5
        D[39, 4] = U135                 # DG5YZ5
        D[40, 4] = WP35                 # DG5ZZ5
        D[41, 4] = VP25                 # DG5MX5
        D[42, 4] = -VP15                # DG5MY5
        D[43, 4] = QDP5                 # DG5Ia5
        D[44, 4] = QP5                  # DG5FV5
        D[45, 4] = signQP5              # DG5FS5
        D[47, 4] = -S6*WP16 - C6DV136   # DG5XX6
        D[48, 4] = S6*U316 - C6*U326    # DG5XY6
        D[49, 4] = -S6*U216 - C6*DW316  # DG5XZ6
        D[50, 4] = C6*U126 - S6*DW236   # DG5YZ6
        D[51, 4] = C6DV136 - S6*DV236   # DG5ZZ6
        D[52, 4] = C6*VP25              # DG5MX6
        D[53, 4] = -S6*VP25             # DG5MY6
        # Joint 6
        D[47, 5] = -DV126   # DG6XX6
        D[48, 5] = DW126    # DG6XY6
        D[49, 5] = -U236    # DG6XZ6
        D[50, 5] = U136     # DG6YZ6
        D[51, 5] = WP36     # DG6ZZ6
        D[52, 5] = VP26     # DG6MX6
        D[53, 5] = -VP16    # DG6MY6
        D[54, 5] = QDP6     # DG6Ia6
        D[55, 5] = QP6      # DG6FV6
        D[56, 5] = signQP6  # DG6FS6

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, FV1, FS1, OFFSET1, XX2R, XY2, XZ2R, YZ2, ZZ2R, MX2R, MY2, FV2, FS2, OFFSET2, XX3R,
            XY3, XZ3, YZ3, ZZ3R, MX3, MY3R, Ia3, FV3, FS3, OFFSET3, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4,
            MY4R, Ia4, FV4, FS4, OFFSET4, XX5R, XY5, XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, FV5, FS5,
            OFFSET5, XX6R, XY6, XZ6, YZ6, ZZ6, MX6, MY6, Ia6, FV6, FS6, OFFSET6
        ) = X
        # Joint 6
        F16 = MX6*U116 + MY6*U126
        F26 = MX6*U216 + MY6*U226
        F36 = MX6*U316 + MY6*U326
        N16 = XX6R*WP16 + ZZ6*DV236 + YZ6*DW236 + XZ6*U216 + MY6*VP25 - XY6*U316
        N26 = (XX6R - ZZ6)*DV136 + XZ6*DW316 + XY6*U326 - YZ6*U126 - MX6*VP25
        N36 = ZZ6*WP36 + XY6*DW126 + YZ6*U136 + MX6*VP26 - XX6R*DV126 - XZ6*U236 - MY6*VP16
        FDI16 = C6*F16 - S6*F26
        FDI36 = -S6*F16 - C6*F26
        # Joint 5
        F15 = MX5*U115 + MY5R*U125
        F25 = MX5*U215 + MY5R*U225
        F35 = MX5*U315 + MY5R*U325
        E15 = FDI16 + F15
        E25 = F36 + F25
        E35 = FDI36 + F35
        N15 = XX5R*WP15 + ZZ5R*DV235 + YZ5*DW235 + XZ5*U215 - XY5*U315 - MY5R*VP24
        N25 = (XX5R - ZZ5R)*DV135 + XZ5*DW315 + XY5*U325 + MX5*VP24 - YZ5*U125
        N35 = ZZ5R*WP35 + XY5*DW125 + YZ5*U135 + MX5*VP25 - XX5R*DV125 - XZ5*U235 - MY5R*VP15
        NE15 = C6*N16 + N15 - S6*N26
        NE25 = N36 + N25
        NE35 = N35 - S6*N16 - C6*N26
        FDI15 = C5*E15 - S5*E25
        FDI35 = S5*E15 + C5*E25
        # Joint 4
        F14 = MX4*U114 + MY4R*U124
        F24 = MX4*U214 + MY4R*U224
        F34 = MX4*U314 + MY4R*U324
        E14 = FDI15 + F14
        E24 = F24 - E35
        E34 = FDI35 + F34
        N14 = XX4R*WP14 + ZZ4R*DV234 + YZ4*DW234 + XZ4*U214 + MY4R*VSP24 - XY4*U314
        N24 = (XX4R - ZZ4R)*DV134 + XZ4*DW314 + XY4*U324 - YZ4*U124 - MX4*VSP24
        N34 = ZZ4R*WP34 + XY4*DW124 + YZ4*U134 + MX4*VP24 - XX4R*DV124 - XZ4*U234 - MY4R*VP14
        NE14 = C5*NE15 + N14 - S5*NE25
        NE24 = N24 - NE35
        NE34 = S5*NE15 + C5*NE25 + N34
        FDI14 = C4*E14 - S4*E24
        FDI34 = -S4*E14 - C4*E24
        # Joint 3
        F13 = MX3*U113 + MY3R*U123
        F23 = MX3*U213 + MY3R*U223
        F33 = MX3*U313 + MY3R*U323
        E13 = FDI14 + F13
        E23 = E34 + F23
        E33 = FDI34 + F33
        N13 = XX3R*WP13 + ZZ3R*DV233 + YZ3*DW233 + XZ3*U213 + MY3R*VSP33 - XY3*U313
        N23 = (XX3R - ZZ3R)*DV133 + XZ3*DW313 + XY3*U323 - YZ3*U123 - MX3*VSP33
        N33 = ZZ3R*WP33 + XY3*DW123 + YZ3*C23QDP1 + XZ3*S23QDP1 + MX3*VP23 - XX3R*DV123 - MY3R*VP13
        NE13 = C4*NE14 + RL4*FDI34 + N13 - S4*NE24
        NE23 = NE34 + N23
        NE33 = N33 - S4*NE14 - C4*NE24 - RL4*FDI14
        FDI23 = S3*E13 + C3*E23
        # Joint 2
        N12 = XX2R*WP12 + ZZ2R*DV232 + YZ2*DW232 + XZ2R*U212 - XY2*U312
        N22 = (XX2R - ZZ2R)*DV132 + XZ2R*DW312 + XY2*U322 - YZ2*U122
        N32 = ZZ2R*QDP2 + XY2*DW122 + YZ2*C2QDP1 + XZ2R*S2QDP1 + MX2R*VP22 - XX2R*DV122 - MY2*VP12
        NE12 = C3*NE13 + N12 - S3*NE23
        NE22 = S3*NE13 + C3*NE23 + N22 - D3*E33
        NE32 = NE33 + D3*FDI23 + N32
        # Joint 1
        N31 = ZZ1R*QDP1
        NE31 = S2*NE12 + C2*NE22 + N31
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE32 + FV2*QP2 + FS2*signQP2
        GAM[2] = OFFSET3 + NE33 + Ia3*QDP3 + FV3*QP3 + FS3*signQP3
        GAM[3] = OFFSET4 + NE34 + Ia4*QDP4 + FV4*QP4 + FS4*signQP4
        GAM[4] = OFFSET5 + NE35 + Ia5*QDP5 + FV5*QP5 + FS5*signQP5
        GAM[5] = OFFSET6 + N36 + Ia6*QDP6 + FV6*QP6 + FS6*signQP6

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D3, RL4):
    """Fill A, shape (6, 6, N), from q (6, N)."""
    # Inputs
    q2, q3, q4, q5, q6 = q[1:]
    (
        ZZ1R, _, _, _, XX2R, XY2, XZ2R, YZ2, ZZ2R, _, _, _, _, _, XX3R, XY3, XZ3, YZ3, ZZ3R,
        MX3, MY3R, Ia3, _, _, _, XX4R, XY4, XZ4, YZ4, ZZ4R, MX4, MY4R, Ia4, _, _, _, XX5R, XY5,
        XZ5, YZ5, ZZ5R, MX5, MY5R, Ia5, _, _, _, XX6R, XY6, XZ6, YZ6, ZZ6, MX6, MY6, Ia6, _, _,
        _
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
    # Composite link 6
    AS16 = MX6*C6 - MY6*S6
    AS36 = -MX6*S6 - MY6*C6
    C6C6 = C6**2
    C6S6 = C6*S6
    AJA116 = XX6R*C6C6 - XY6*2*C6S6
    NE156 = XZ6*C6 - YZ6*S6
    NE356 = -XZ6*S6 - YZ6*C6
    JP115 = XX5R + AJA116
    JP125 = XY5 + NE156
    JP135 = XZ5 + XY6 - XX6R*C6S6 - XY6*2*C6C6
    JP235 = YZ5 + NE356
    JP335 = ZZ5R + XX6R - AJA116
    MSP15 = MX5 + AS16
    # Composite link 5
    AS15 = C5*MSP15 - MY5R*S5
    AS35 = S5*MSP15 + MY5R*C5
    C5C5 = C5**2
    C5S5 = C5*S5
    JP114a = ZZ6 - JP115
    JP114b = C5C5*JP114a + JP125*2*C5S5
    NE145 = C5*JP135 - S5*JP235
    NE345 = S5*JP135 + C5*JP235
    JP114 = XX4R + ZZ6 - JP114b
    JP124 = XY4 - NE145
    JP134 = XZ4 + JP125*2*C5C5 - C5S5*JP114a - JP125
    JP234 = YZ4 - NE345
    JP334 = ZZ4R + JP115 + JP114b
    MSP14 = MX4 + AS15
    MSP24 = MY4R - AS36
    # Composite link 4
    AS14 = C4*MSP14 - S4*MSP24
    AS34 = -S4*MSP14 - C4*MSP24
    C4C4 = C4**2
    C4S4 = C4*S4
    JP113a = JP335 - JP114
    JP113b = C4C4*JP113a + JP124*2*C4S4
    JP113c = 2*RL4*AS35
    JP113 = XX3R + JP335 + JP113c - JP113b
    NE134 = C4*JP134 - S4*JP234 - RL4*AS14
    JP123 = XY3 + NE134
    JP133 = XZ3 + C4S4*JP113a + JP124 - JP124*2*C4C4
    NE334 = -S4*JP134 - C4*JP234 - RL4*AS34
    JP233 = YZ3 + NE334
    JP333 = ZZ3R + JP114 + JP113b + JP113c
    MSP13 = MX3 + AS14
    MSP23 = MY3R + AS35
    # Composite link 3
    AS13 = C3*MSP13 - S3*MSP23
    AS23 = S3*MSP13 + C3*MSP23
    C3C3 = C3**2
    C3S3 = C3*S3
    JP112a = JP334 - JP113
    JP112b = C3C3*JP112a + JP123*2*C3S3
    NE123 = C3*JP133 - S3*JP233
    NE223 = S3*JP133 + C3*JP233
    D3AS13 = D3*AS13
    JP222a = 2*D3AS13
    JP112 = XX2R + JP334 - JP112b
    JP122 = XY2 + JP123*2*C3C3 - C3S3*JP112a - JP123 - D3*AS23
    JP132 = XZ2R + NE123 - D3*AS34
    JP222 = JP113 + JP112b + JP222a
    JP232 = YZ2 + NE223
    JP332 = ZZ2R + JP333 + JP222a
    # Composite link 2
    NE312 = S2*JP132 + C2*JP232
    JP331 = ZZ1R + JP112 + JP122*2*C2*S2 - C2**2*(JP112 - JP222)
    # Unit acceleration of joint 3
    NE323 = JP333 + D3AS13
    NE313 = S2*NE123 + C2*NE223
    # Unit acceleration of joint 4
    E224 = S3*AS34
    NE124 = C3*NE134 - S3*JP334
    NE224 = S3*NE134 + C3*JP334 + D3*AS14
    NE324 = NE334 + D3*E224
    NE314 = S2*NE124 + C2*NE224
    # Unit acceleration of joint 5
    E135 = -C4*AS35
    E335 = S4*AS35
    NE135 = C4*NE145 + S4*JP335 + RL4*E335
    NE335 = C4*JP335 - S4*NE145 - RL4*E135
    E225 = S3*E135 + C3*AS15
    NE125 = C3*NE135 - S3*NE345
    NE225 = S3*NE135 + C3*NE345 - D3*E335
    NE325 = NE335 + D3*E225
    NE315 = S2*NE125 + C2*NE225
    # Unit acceleration of joint 6
    E146 = C5*AS36
    E346 = S5*AS36
    NE146 = C5*NE156 - ZZ6*S5
    NE346 = S5*NE156 + ZZ6*C5
    E136 = C4*E146 - S4*AS16
    E336 = -S4*E146 - C4*AS16
    NE136 = C4*NE146 + S4*NE356 + RL4*E336
    NE336 = C4*NE356 - S4*NE146 - RL4*E136
    E226 = S3*E136 + C3*E346
    NE126 = C3*NE136 - S3*NE346
    NE226 = S3*NE136 + C3*NE346 - D3*E336
    NE326 = NE336 + D3*E226
    NE316 = S2*NE126 + C2*NE226
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
    A[5, 5] = ZZ6 + Ia6


def _gravity_block(xp, q, GAM, X, g):
    """Fill GAM, shape (6, N), from q (6, N)."""
    # Inputs
    q2, q3, q4, q5, q6 = q[1:]
    (
        _, _, _, OFFSET1, _, _, _, _, _, MX2R, MY2, _, _, OFFSET2, _, _, _, _, _, MX3, MY3R, _,
        _, _, OFFSET3, _, _, _, _, _, MX4, MY4R, _, _, _, OFFSET4, _, _, _, _, _, MX5, MY5R, _,
        _, _, OFFSET5, _, _, _, _, _, MX6, MY6, _, _, _, OFFSET6
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
    # Link 2
    VP12 = g*S2
    VP22 = g*C2
    # Link 3
    VP13 = C3*VP12 + S3*VP22
    VP23 = C3*VP22 - S3*VP12
    # Link 4
    C4VP13 = C4*VP13
    S4VP13 = S4*VP13
    # Link 5
    VP15 = C5*C4VP13 + S5*VP23
    VP25 = C5*VP23 - S5*C4VP13
    # Link 6
    VP16 = C6*VP15 - S6*S4VP13
    VP26 = -C6*S4VP13 - S6*VP15
    # Joint 6
    N16 = MY6*VP25
    N26 = -MX6*VP25
    N36 = MX6*VP26 - MY6*VP16
    # Joint 5
    N15 = MY5R*S4VP13
    N25 = -MX5*S4VP13
    N35 = MX5*VP25 - MY5R*VP15
    NE15 = C6*N16 + N15 - S6*N26
    NE25 = N36 + N25
    NE35 = N35 - S6*N16 - C6*N26
    # Joint 4
    N14 = MY4R*VP23
    N24 = -MX4*VP23
    N34 = -MX4*S4VP13 - MY4R*C4VP13
    NE14 = C5*NE15 + N14 - S5*NE25
    NE24 = N24 - NE35
    NE34 = S5*NE15 + C5*NE25 + N34
    # Joint 3
    N33 = MX3*VP23 - MY3R*VP13
    NE33 = N33 - S4*NE14 - C4*NE24
    # Joint 2
    N32 = MX2R*VP22 - MY2*VP12
    NE32 = NE33 + N32
    # Torques
    GAM[0] = OFFSET1
    GAM[1] = OFFSET2 + NE32
    GAM[2] = OFFSET3 + NE33
    GAM[3] = OFFSET4 + NE34
    GAM[4] = OFFSET5 + NE35
    GAM[5] = OFFSET6 + N36


def _frame_poses_block(xp, q, T, D3, RL4):
    """Fill T, shape (6, 4, 4, N), from q (6, N)."""
    # Inputs
    q1, q2, q3, q4, q5, q6 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    th23 = q2 + q3
    C23 = xp.cos(th23)
    S23 = xp.sin(th23)
    C4 = xp.cos(q4)
    S4 = xp.sin(q4)
    C5 = xp.cos(q5)
    S5 = xp.sin(q5)
    C6 = xp.cos(q6)
    S6 = xp.sin(q6)
    # Joint axes Z and velocities V seen from link 4
    Z141 = S23*C4
    Z241 = -S23*S4
    # Joint axes Z and velocities V seen from link 5
    Z151 = C5*Z141 + C23*S5
    Z251 = C23*C5 - S5*Z141
    # Joint axes Z and velocities V seen from link 6
    Z161 = C6*Z151 + S6*Z241
    Z261 = C6*Z241 - S6*Z151
    # Frame 2
    R112 = C1*C2
    R122 = -C1*S2
    R212 = S1*C2
    R222 = -S1*S2
    # Frame 3
    R113 = C1*C23
    R123 = -C1*S23
    R213 = S1*C23
    R223 = -S1*S23
    P13 = D3*R112
    P23 = D3*R212
    P33 = D3*S2
    # Frame 4
    R114 = C4*R113 - S1*S4
    R124 = -S1*C4 - S4*R113
    R214 = C4*R213 + C1*S4
    R224 = C1*C4 - S4*R213
    P14 = P13 + RL4*R123
    P24 = P23 + RL4*R223
    P34 = P33 + RL4*C23
    # Frame 5
    R115 = C5*R114 + S5*R123
    R125 = C5*R123 - S5*R114
    R215 = C5*R214 + S5*R223
    R225 = C5*R223 - S5*R214
    # Frame 6
    R116 = C6*R115 + S6*R124
    R126 = C6*R124 - S6*R115
    R216 = C6*R215 + S6*R224
    R226 = C6*R224 - S6*R215
    # Poses
    T[0, 0, 0] = C1
    T[0, 0, 1] = -S1
    T[0, 1, 0] = S1
    T[0, 1, 1] = C1
    T[1, 0, 0] = R112
    T[1, 0, 1] = R122
    T[1, 0, 2] = S1
    T[1, 1, 0] = R212
    T[1, 1, 1] = R222
    T[1, 1, 2] = -C1
    T[1, 2, 0] = S2
    T[1, 2, 1] = C2
    T[2, 0, 0] = R113
    T[2, 0, 1] = R123
    T[2, 0, 2] = S1
    T[2, 0, 3] = P13
    T[2, 1, 0] = R213
    T[2, 1, 1] = R223
    T[2, 1, 2] = -C1
    T[2, 1, 3] = P23
    T[2, 2, 0] = S23
    T[2, 2, 1] = C23
    T[2, 2, 3] = P33
    T[3, 0, 0] = R114
    T[3, 0, 1] = R124
    T[3, 0, 2] = R123
    T[3, 0, 3] = P14
    T[3, 1, 0] = R214
    T[3, 1, 1] = R224
    T[3, 1, 2] = R223
    T[3, 1, 3] = P24
    T[3, 2, 0] = Z141
    T[3, 2, 1] = Z241
    T[3, 2, 2] = C23
    T[3, 2, 3] = P34
    T[4, 0, 0] = R115
    T[4, 0, 1] = R125
    T[4, 0, 2] = -R124
    T[4, 0, 3] = P14
    T[4, 1, 0] = R215
    T[4, 1, 1] = R225
    T[4, 1, 2] = -R224
    T[4, 1, 3] = P24
    T[4, 2, 0] = Z151
    T[4, 2, 1] = Z251
    T[4, 2, 2] = -Z241
    T[4, 2, 3] = P34
    T[5, 0, 0] = R116
    T[5, 0, 1] = R126
    T[5, 0, 2] = R125
    T[5, 0, 3] = P14
    T[5, 1, 0] = R216
    T[5, 1, 1] = R226
    T[5, 1, 2] = R225
    T[5, 1, 3] = P24
    T[5, 2, 0] = Z161
    T[5, 2, 1] = Z261
    T[5, 2, 2] = Z251
    T[5, 2, 3] = P34
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 3, 3] = T[2, 3, 3] = T[3, 3, 3] = T[4, 3, 3] = T[5, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4, 5, 6)
DRIVES = None
LIMITS = {}
VALUES = {}
