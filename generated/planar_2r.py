"""Planar arm, 2 revolute joints, vertical plane: base parameters, regressor, dynamics.

GENERATED from planar_2r.yaml, sha256 42ca3cd332bb, by symgen 0.5.0.
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
Elements    along s = G q: Gamma gets G' times the force along s
    Ia      inertia: along q1, q2
    FV      viscous: along q1, q2
    FS      coulomb: along q1, q2
    OFFSET  offset: along q1, q2

Base parameters, 13 of 28; Gautier and Khalil (1990)
    exact, proved modulo primes
    FORMULAS has those that combine several; the others are standard parameters
    No effect: XX1 XY1 XZ1 YY1 YZ1 MZ1 M1 XX2 XY2 XZ2 YY2 YZ2 MZ2

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
    regressor          16 multiplications, 10 additions, 2 sin, 2 cos
    inverse_dynamics   28 multiplications, 22 additions, 2 sin, 2 cos
    inertia_matrix     4 multiplications, 4 additions, 1 sin, 1 cos
    gravity            10 multiplications, 7 additions, 2 sin, 2 cos
    frame_poses        2 multiplications, 1 additions, 2 sin, 2 cos

Arguments   q, qd, qdd, tau of shape (N, 2), or (2,) for one state: results then have no axis
            of samples; rad or m and seconds
            X of shape (13,) in the order of BASE_PARAMETERS; constants of the robot by keyword
Arrays      NumPy's and lists, float64; or those of one other package (CuPy, JAX, PyTorch, ...;
            pip install array-api-compat), all float64 or all float32, with any axes before the
            last: these functions are pure, so that jax.jit, vmap, grad and torch.func take them
CasADi      casadi("inverse_dynamics") is a casadi.Function of columns

Certificate by symgen 0.5.0: formulas exact modulo 1406887367 and 1406887351, a false one passes
with probability below 1e-15; base_parameters, regressor, observation_matrix, inverse_dynamics,
inertia_matrix, bias, gravity, forward_dynamics, frame_poses, jacobian,
inverse_dynamics_derivatives, elements at random states, parameters and random constants agree
with Lagrange's equations and products of frames to 1e-09, on NumPy's arrays, stacked as for other
packages, by CasADi.
sha256 of all but these lines: 7992120d664f5dd3d0ba85d77a6579594ae8b54320dde94893a5a2c14617fea9
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
    room = _constant(np.zeros((13, 2, N))).view(Store)
    room.ready = True
    return room


def _constant(D):
    """D with its constant entries."""
    D[5, 0] = D[12, 1] = 1.0
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
    if tuple(X.shape) != (13,):
        raise ValueError(f"X of shape {X.shape}; expected (13,) in the order of BASE_PARAMETERS")
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
        if x.shape[-1:] != (2,):
            raise ValueError(f"state of shape {x.shape}; expected (..., 2)")
        return [x[..., k] for k in range(2)]

    def parameters(self, X):
        """X[k], one by one; NumPy's as plain numbers."""
        if self.package is not np and isinstance(X, np.ndarray | list | tuple):
            return _parameters(_real(X, "X")).tolist()
        _parameters(X)
        return [X[k] for k in range(13)]

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

    def rows(self, x, count=2):
        rows = self.package.vertsplit(x)
        if len(rows) != count:
            raise ValueError(f"a column of {len(rows)} rows; expected {count}")
        return rows

    def parameters(self, X):
        return self.rows(X, 13)

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

    Inputs are columns q, qd, qdd, tau (2,), X (13,), standard (28,), then the constants. By name,
    a constant that is not given has its value in CONSTANTS, another input is nan. Samples stand
    side by side, q (2, N); the results then do so too. The derivative of sign(qd) is zero.
    """
    import casadi as ca

    of = str(name).removesuffix("_derivatives")
    if of not in _OUTPUTS:
        raise ValueError(f"casadi({of[:40]!r}); there is {', '.join(_OUTPUTS)}, and NAME_derivatives")
    columns, names = [text.split() for text in _OUTPUTS[of]]
    sizes = {"X": 13, "standard": 28}
    columns = {x: ca.SX.sym(x, sizes.get(x, 2)) for x in columns}
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
    'frame_poses': ('q', 'T1 T2'),
    'jacobian': ('q', 'J'),
}


def elements(*, D2: float = 0.5, g: float = 9.81) -> dict:
    """{parameter: (kind, direction of motion, row or form)} of the elements: row G of s = G q as
    {j: G_j}, form q'Bq as {(i, j): B_ij}, i <= j.
    """
    _numbers((D2, g))
    return {
        'Ia1': ('inertia', 'both', {1: 1.0}), 'FV1': ('viscous', 'both', {1: 1.0}),
        'FS1': ('coulomb', 'both', {1: 1.0}), 'OFFSET1': ('offset', 'both', {1: 1.0}),
        'Ia2': ('inertia', 'both', {2: 1.0}), 'FV2': ('viscous', 'both', {2: 1.0}),
        'FS2': ('coulomb', 'both', {2: 1.0}), 'OFFSET2': ('offset', 'both', {2: 1.0}),
    }


ELEMENTS = elements()


def base_parameters(standard: "Array", *, D2: float = 0.5, g: float = 9.81) -> "Array":
    """X, shape (13,), from the 28 standard parameters: a mapping by name, or a vector in the
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
        if shape[:1] != (28,):
            raise ValueError(
                f"standard of shape {shape}; expected (28,) in the order of "
                "STANDARD_PARAMETERS, or a mapping by name"
            )
        xp = _package(standard)
        standard = standard if xp is np else [standard[k] for k in range(28)]
    if xp is np:
        _numbers((D2, g))
    (
        _, _, _, _, _, ZZ1, MX1, MY1, _, _, Ia1, FV1, FS1, OFFSET1, _, _, _, _, _, ZZ2, MX2,
        MY2, _, M2, Ia2, FV2, FS2, OFFSET2
    ) = standard
    ZZ1R = ZZ1 + Ia1 + D2**2*M2
    MX1R = MX1 + D2*M2
    return (np.array if xp is np else xp.stack)([
        ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2, MX2, MY2, Ia2, FV2, FS2, OFFSET2,
    ])


def regressor(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.5,
    g: float = 9.81
) -> "Array":
    """D of Gamma = D X. Shape (N, 2, 13).

    A view on one store of shape (13, 2, N). `out` is such a store, made by `store(N)` and
    reused: a fresh one costs page faults, up to several times the arithmetic for large N.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, g))
    if xp is not np:
        return filled
    return filled[..., 0].T if np.ndim(q) == 1 else filled.transpose(2, 1, 0)


def observation_matrix(
    q: "Array", qd: "Array", qdd: "Array", *, out: Store | None = None, D2: float = 0.5,
    g: float = 9.81
) -> "Array":
    """W of Y = W X + rho, shape (2*N, 13), Fortran order, rows joint-major: the same
    store, no copy.
    """
    xp, filled = _stored(q, qd, qdd, out, (D2, g))
    if xp is not np:
        return xp.reshape(xp.moveaxis(filled, -2, 0), (-1, 13))
    return filled.reshape(13, -1).T


def _stored(q, qd, qdd, out, constants):
    """The package, and D: of NumPy `out`, or a new store, filled; of others (..., 2, 13)."""
    states = (q, qd, qdd)
    xp = _package(*states)
    if xp is not np:
        if out is not None:
            raise ValueError("out: only NumPy arrays can be written into a store")
        D = _gathered(xp, _constant({}), _regressor_block, (13, 2), states, (), constants)
        return xp, xp.matrix_transpose(D)
    states = _states(*states)
    N = len(states[0])
    out = store(N) if out is None else out
    if not (isinstance(out, Store) and out.ready and out.shape == (13, 2, N)):
        kind = f"{type(out).__name__} of shape {getattr(out, 'shape', ())}"
        raise ValueError(f"out: expected store({N}) of shape {(13, 2, N)}, found {kind}")
    D = out.view(np.ndarray)
    return xp, _filled(_regressor_block, D, states, _numbers(constants))


def inverse_dynamics(
    q: "Array", qd: "Array", qdd: "Array", X: "Array", *, D2: float = 0.5, g: float = 9.81
) -> "Array":
    """Joint torques Gamma = A qdd + C qd + Q + friction.

    Shape (N, 2).
    """
    return _evaluated(_inverse_dynamics_block, (2,), (q, qd, qdd), (X,), (D2, g))


def inertia_matrix(q: "Array", X: "Array", *, D2: float = 0.5, g: float = 9.81) -> "Array":
    """A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest.

    Shape (N, 2, 2).
    """
    return _evaluated(_inertia_matrix_block, (2, 2), (q,), (X,), (D2,))


def bias(q: "Array", qd: "Array", X: "Array", *, D2: float = 0.5, g: float = 9.81) -> "Array":
    """Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset.

    Shape (N, 2).
    """
    xp = _package(qd)
    rest = xp.zeros_like(_real(qd, "qd") if xp is np else qd)
    return inverse_dynamics(q, qd, rest, X, D2=D2, g=g)


def gravity(q: "Array", X: "Array", *, D2: float = 0.5, g: float = 9.81) -> "Array":
    """Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them).

    Shape (N, 2).
    """
    return _evaluated(_gravity_block, (2,), (q,), (X,), (g,))


def frame_poses(q: "Array", *, D2: float = 0.5, g: float = 9.81) -> "Array":
    """Homogeneous transform of every frame j in frame 0, at index j - 1.

    Shape (N, 2, 4, 4).
    """
    return _evaluated(_frame_poses_block, (2, 4, 4), (q,), (), (D2,))


def forward_dynamics(
    q: "Array", qd: "Array", tau: "Array", X: "Array", *, D2: float = 0.5, g: float = 9.81
) -> "Array":
    """qdd = A(q)**-1 (tau - bias). Shape (N, 2)."""
    xp = _package(q, qd, tau, X)
    if xp is np:
        _states(q, qd, tau)
        tau = _real(tau, "tau")
    elif tau.shape != q.shape:
        raise ValueError(f"tau of shape {tau.shape}; expected that of q, {q.shape}")
    rest = tau - inverse_dynamics(q, qd, xp.zeros_like(qd), X, D2=D2, g=g)
    inertia = inertia_matrix(q, X, D2=D2, g=g)
    if xp is not np:
        return xp.solve(inertia, rest)
    return np.linalg.solve(inertia, rest[..., None])[..., 0]


def jacobian(q: "Array", *, frame: int | None = None, D2: float = 0.5, g: float = 9.81) -> "Array":
    """J: velocity of the origin of `frame` (default: the last), then its angular velocity, in
    frame 0, per joint rate. Shape (N, 6, 2).
    """
    frame = 2 if frame is None else frame
    if type(frame) is bool or not isinstance(frame, int | np.integer) or not 0 < frame <= 2:
        raise ValueError(f"frame {repr(frame).split(chr(10))[0]:.40}; expected 1 to 2")
    return _evaluated(_jacobian_block, (6, 2), (q,), (), (frame, D2))


def _jacobian_block(xp, q, J, frame, *constants):
    """Fill J, shape (6, 2, N): z x (P_frame - P_j) and z of the joints below the frame."""
    T = dict.fromkeys(np.ndindex(2, 4, 4), 0.0)
    _frame_poses_block(xp, q, T, *constants[:1])
    joints, columns, j = _moving(xp, *constants[1:]), {}, frame
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
        1: (0, 0, ((0, 1.0),)), 2: (1, 0, ((1, 1.0),)),
    }


def _regressor_block(xp, q, qd, qdd, D, D2, g):
    """Fill D, shape (13, 2, N), where it is not constant, from q, qd, qdd (2, N)."""
    _regressor, _ = _motion(xp, q, qd, qdd, D2, g)
    _regressor(D)


def _inverse_dynamics_block(xp, q, qd, qdd, GAM, X, D2, g):
    """Fill GAM, shape (2, N), from q, qd, qdd (2, N)."""
    _, _torques = _motion(xp, q, qd, qdd, D2, g)
    _torques(GAM, X)


def _motion(xp, q, qd, qdd, D2, g):
    """Motion of the links. Returns two functions that go on from it: to D, and with X to GAM."""
    # Inputs
    q1, q2 = q
    QP1, QP2 = qd
    QDP1, QDP2 = qdd
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
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
    # Friction, actuators
    signQP1 = xp.sign(QP1)
    signQP2 = xp.sign(QP2)

    def _regressor(D):
        # Joint axes Z and velocities V seen from link 2
        V121 = D2*S2
        V221 = D2*C2
        # Joint 1
        D[0, 0] = QDP1                            # DG1ZZ1
        D[1, 0] = VP21                            # DG1MX1
        D[2, 0] = -VP11                           # DG1MY1
        D[3, 0] = QP1                             # DG1FV1
        D[4, 0] = signQP1                         # DG1FS1
        D[6, 0] = WP32                            # DG1ZZ2
        D[7, 0] = VP22 + WP32*V221 - DV332*V121   # DG1MX2
        D[8, 0] = -VP12 - WP32*V121 - DV332*V221  # DG1MY2
        # Joint 2
        D[6, 1] = WP32      # DG2ZZ2
        D[7, 1] = VP22      # DG2MX2
        D[8, 1] = -VP12     # DG2MY2
        D[9, 1] = QDP2      # DG2Ia2
        D[10, 1] = QP2      # DG2FV2
        D[11, 1] = signQP2  # DG2FS2

    def _torques(GAM, X):
        # Inputs
        ZZ1R, MX1R, MY1, FV1, FS1, OFFSET1, ZZ2, MX2, MY2, Ia2, FV2, FS2, OFFSET2 = X
        # Joint 2
        F12 = -MX2*DV332 - MY2*WP32
        F22 = MX2*WP32 - MY2*DV332
        N32 = ZZ2*WP32 + MX2*VP22 - MY2*VP12
        FDI22 = S2*F12 + C2*F22
        # Joint 1
        N31 = ZZ1R*QDP1 + MX1R*VP21 - MY1*VP11
        NE31 = N32 + D2*FDI22 + N31
        # Torques
        GAM[0] = OFFSET1 + NE31 + FV1*QP1 + FS1*signQP1
        GAM[1] = OFFSET2 + N32 + Ia2*QDP2 + FV2*QP2 + FS2*signQP2

    return _regressor, _torques


def _inertia_matrix_block(xp, q, A, X, D2):
    """Fill A, shape (2, 2, N), from q (2, N)."""
    # Inputs
    q2 = q[1]
    ZZ1R = X[0]
    ZZ2 = X[6]
    MX2 = X[7]
    MY2 = X[8]
    Ia2 = X[9]
    # Trigonometry
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
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


def _gravity_block(xp, q, GAM, X, g):
    """Fill GAM, shape (2, N), from q (2, N)."""
    # Inputs
    q1, q2 = q
    MX1R = X[1]
    MY1 = X[2]
    OFFSET1 = X[5]
    MX2 = X[7]
    MY2 = X[8]
    OFFSET2 = X[12]
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    C2 = xp.cos(q2)
    S2 = xp.sin(q2)
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


def _frame_poses_block(xp, q, T, D2):
    """Fill T, shape (2, 4, 4, N), from q (2, N)."""
    # Inputs
    q1, q2 = q
    # Trigonometry
    C1 = xp.cos(q1)
    S1 = xp.sin(q1)
    th12 = q1 + q2
    C12 = xp.cos(th12)
    S12 = xp.sin(th12)
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
    # Constants
    T[0, 2, 2] = T[0, 3, 3] = T[1, 2, 2] = T[1, 3, 3] = 1.0


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
BASE_VALUES = base_parameters(VALUES)  # X of the robot file
