"""SCARA with joints RRRP: base parameters, regressor, dynamics.

GENERATED from scara.yaml, sha256 de085ba960d7, by symgen 0.5.0.
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
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2, q3, q4
    FV      viscous: along q1, q2, q3, q4
    FS      coulomb: along q1, q2, q3, q4
    OFFSET  offset: along q1, q2, q3, q4

Base parameters, 22 of 56; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2 XX3 XY3 XZ3 YY3 YZ3 MZ3
        XX4 XY4 XZ4 YY4 YZ4 MZ4

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
    VSP  acceleration of the origin of a frame minus gravity, in the antecedent's frame
    VP   the same, in the frame itself
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
    P    origin of a frame in frame 0

Cost per sample
    regressor          39 multiplications, 28 additions, 2 sin, 2 cos
    inverse_dynamics   51 multiplications, 44 additions, 2 sin, 2 cos
    inertia_matrix     13 multiplications, 18 additions, 2 sin, 2 cos
    gravity            0 multiplications, 0 additions, 0 sin, 0 cos
    frame_poses        4 multiplications, 4 additions, 3 sin, 3 cos

Arguments   q, qd, qdd, tau of shape (N, 4), or (4,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (22,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 4e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: 43e15a0f2f150c747a7e4c65ad8801a38781e16d37abe380f1c8ee2103808616
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
    room = _constant(np.zeros((22, 4, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[3, 0] = D[10, 1] = D[17, 2] = D[21, 3] = 1.0
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
    """The states as rows of samples, shape (N, 4) each; ValueError unless all have shape
    (N, 4), or all (4,).
    """
    states = [_real(x, "states") for x in arrays]
    shapes = [x.shape for x in states]
    if shapes[0][-1:] != (4,) or len(shapes[0]) > 2 or shapes != [shapes[0]] * len(shapes):
        raise ValueError(f"states of shape {shapes}; expected (N, 4) each, or (4,) each")
    return tuple([x.reshape(-1, 4) for x in states])


def _parameters(X):
    """X; ValueError unless it has a value for each base parameter."""
    if tuple(X.shape) != (22,):
        raise ValueError(f"X of shape {X.shape}; expected (22,) in the order of BASE_PARAMETERS")
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
        if x.shape[-1:] != (4,):
            raise ValueError(f"state of shape {x.shape}; expected (..., 4)")
        return [x[..., k] for k in range(4)]

    def parameters(self, X):
        """X[k], one by one; NumPy's as plain numbers."""
        if self.package is not np and isinstance(X, np.ndarray | list | tuple):
            return _parameters(_real(X, "X")).tolist()
        _parameters(X)
        return [X[k] for k in range(22)]

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

    def rows(self, x, count=4):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 22)

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

    Inputs are columns q, qd, qdd, tau (4,), X (22,), standard (56,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (4, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 22, "standard": 56}
    columns = {x: ca.SX.sym(x, sizes.get(x, 4)) for x in columns}
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
    'frame_poses': ('q', 'T1 T2 T3 T4'),
    'jacobian': ('q', 'J'),
}


def elements(*, D2: float = 0.425, D3: float = 0.375, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D2, D3, g))
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
    standard: "Array", *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> "Array":
    """X, shape (22,), from the 56 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (56,):
            raise ValueError(
                f"standard of shape {shape}; expected (56,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(56)]
    if xp is np:
        _numbers((D2, D3, g))
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
    return (np.array if xp is np else xp.stack)([
        ZZ1R, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, Ia2, FV2, FS2, OFFSET2, ZZ3R, MX3R, MY3R, Ia3,
        FV3, FS3, OFFSET3, M4R, FV4, FS4, OFFSET4R,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.425,
    D3: float = 0.375, g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 4, 22).

    A view on one store of shape (22, 4, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, D3, g))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.425,
    D3: float = 0.375, g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (4*N, 22), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, D3, g))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 22))
    return filled.reshape(22, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 4, 22)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (22, 4), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (22, 4, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(22, 4, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 4).
    """
    return _evaluated(_inverse_dynamics_block, (4,), (q, qd, qdd), (X,), (D2, D3, g))


def inertia_matrix(
    q: "Array", X: "Array", *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 4, 4).
    """
    return _evaluated(_inertia_matrix_block, (4, 4), (q,), (X,), (D2, D3))


def bias(
    q: "Array", qd: "Array", X: "Array", *, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 4).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D2=D2, D3=D3, g=g)


def gravity(
    q: "Array", X: "Array", *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81
) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 4).
    """
    return _evaluated(_gravity_block, (4,), (q,), (X,), (g,))


def frame_poses(q: "Array", *, D2: float = 0.425, D3: float = 0.375, g: float = 9.81) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 4, 4, 4).
    """
    return _evaluated(_frame_poses_block, (4, 4, 4), (q,), (), (D2, D3))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 4)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D2=D2, D3=D3, g=g)
    inertia = inertia_matrix(q, X, D2=D2, D3=D3, g=g)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(
    q: "Array", *, frame: int | None = None, D2: float = 0.425, D3: float = 0.375,
    g: float = 9.81
) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 4).
    """
    frame = 4 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 4:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 4")
    return _evaluated(_jacobian_block, (6, 4), (q,), (), (frame, D2, D3))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 4, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(4, 4, 4), 0.0)
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
        4: (3, 1, ((3, 1.0),)),
    }


def _regressor_block(xp, q, qd, qdd, D, D2, D3, g):
    """Fill D, shape (22, 4, N), where it is not constant, from q, qd, qdd (4, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D2, D3, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D2, D3, g):
    """Fill GAM, shape (4, N), from q, qd, qdd (4, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D2, D3, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D2, D3, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q2, q3 = q[1:3]
    QP1, QP2, QP3, QP4 = qd
    QDP1, QDP2, QDP3, QDP4 = qdd
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
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
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)
    signQP3 = xp.sign(QP3)
    signQP4 = xp.sign(QP4)

    def _regressor(D):
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
        D[2, 0] = signQP1                          # DG1FS1
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
        D[9, 1] = signQP2                          # DG2FS2
        D[11, 1] = WP33                            # DG2ZZ3
        D[12, 1] = VP23 + WP33*V232 - DV333*V132   # DG2MX3
        D[13, 1] = -VP13 - WP33*V132 - DV333*V232  # DG2MY3
        D[18, 1] = VP13*V132 + VP23*V232           # DG2M4
        # Joint 3
        D[11, 2] = WP33     # DG3ZZ3
        D[12, 2] = VP23     # DG3MX3
        D[13, 2] = -VP13    # DG3MY3
        D[14, 2] = QDP3     # DG3Ia3
        D[15, 2] = QP3      # DG3FV3
        D[16, 2] = signQP3  # DG3FS3
        # Joint 4
        D[18, 3] = VP34     # DG4M4
        D[19, 3] = QP4      # DG4FV4
        D[20, 3] = signQP4  # DG4FS4

    def _torques(GAM, X):
        # Inputs
        (
            ZZ1R, FV1, FS1, OFFSET1, ZZ2R, MX2R, MY2, Ia2, FV2, FS2, OFFSET2, ZZ3R, MX3R, MY3R, Ia3,
            FV3, FS3, OFFSET3, M4R, FV4, FS4, OFFSET4R
        ) = X
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
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + NE32 + Ia2*QDP2 + FV2*QP2 + FS2*signQP2
        GAM[2] = OFFSET3 + N33 + Ia3*QDP3 + FV3*QP3 + FS3*signQP3
        GAM[3] = OFFSET4R + F34 + FV4*QP4 + FS4*signQP4

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D2, D3):
    """Fill A, shape (4, 4, N), from q (4, N)."""
    # Inputs
    q2, q3 = q[1:3]
    ZZ1R, _, _, _, ZZ2R, MX2R, MY2, Ia2, _, _, _, ZZ3R, MX3R, MY3R, Ia3, _, _, _, M4R, _, _, _ = X
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
    C3 = xp.cos(q3)
    S3 = xp.sin(q3)
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


def _gravity_block(xp, q, GAM, X, g):
    """Fill GAM, shape (4, N), from q (4, N)."""
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


def _frame_poses_block(xp, q, T, D2, D3):
    """Fill T, shape (4, 4, 4, N), from q (4, N)."""
    # Inputs
    q1, q2, q3, q4 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    th12 = q1 + q2
    C12 = xp.cos(th12)
    S12 = xp.sin(th12)
    th123 = th12 + q3
    C123 = xp.cos(th123)
    S123 = xp.sin(th123)
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
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 2, 2] = T[1, 3, 3] = T[2, 2, 2] = T[2, 3, 3] = T[3, 2, 2] = 1.0
    T[3, 3, 3] = 1.0


# Of the robot file: drives, limits and values, which no function above reads
LINKS = (1, 2, 3, 4)
DRIVES = None
LIMITS = {}
VALUES = {}
