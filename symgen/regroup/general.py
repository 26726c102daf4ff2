"""Base parameters of robots with general loops: high-precision sampling, coefficients recognised where they are rational functions.

The tied joints are algebraic, not rational, functions of the actuated ones, so F_p cannot be sampled. Instead: rational lengths near
those of the robot file, random states closed by Newton in the declared assembly mode (never the other one), echelon form in 60 digits with
tolerance 1e-30. At each geometry a coefficient is a rational number, read off by continued fraction; from then on it is recognised as over F_p
(solve.py). Where that fails the coefficient stays a number, valid for the lengths of the file, and the regrouping says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

from symgen.derive.closure import Closure
from symgen.derive.columns import columns
from symgen.derive.exact import Array, Fp, primes_for
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.loop_equations import LoopSystem, loop_system
from symgen.derive.newton_euler import Motion
from symgen.derive.precise import PreciseAlgebra
from symgen.description.expression import Call, Expression
from symgen.description.robot import Robot
from symgen.errors import SymgenError
from symgen.regroup.solve import Recognition, Supports, Variable, states_for

DIGITS = 60
TOLERANCE = mpmath.mpf(10) ** -30
ROUNDING = mpmath.mpf(10) ** -20  # of the largest entry: a column below it is zero, since right angles are not exact in 60 digits
Matrix = list[list[Any]]


class States:
    """Random closed states of `robot` with constants `geometry`, in the assembly mode of the start configuration."""

    def __init__(self, robot: Robot, geometry: dict[str, Fraction], seed: int) -> None:
        self.robot, self.geometry = robot, geometry
        self.system: LoopSystem = loop_system(robot)
        self.closure: Closure = self.system.closure
        self.rng = np.random.default_rng(seed)

    def sample(self, names: Sequence[str], count: int) -> Matrix:
        """Rows of the regressor columns `names` at `count` states."""
        rows: Matrix = []
        while len(rows) < count * len(self.robot.joints):
            for q, J in self._closed(count):
                algebra = self._moving(self._polished(q, np.linalg.inv(J)))
                D = columns(Motion(Geometry(self.robot, algebra, self.closure)), names)
                rows += [[mpmath.mpf(D[name].get(j, 0)) for name in names] for j in self.robot.joints]
        return rows

    def _polished(self, q: dict[int, float], inverse: Array) -> dict[int, Any]:
        """A state closed in floats, closed in all digits: each chord step with the inverse Jacobian of the floats gains fifteen."""
        precise = {j: mpmath.mpf(x) for j, x in q.items()}
        for _ in range(6):
            r = [mpmath.mpf(x) for x in self.system.residual(PreciseAlgebra(self.robot, self.geometry, precise))]
            if max(map(abs, r)) < mpmath.mpf(10) ** (5 - DIGITS):
                break
            for u, row in zip(self.closure.tied, inverse, strict=True):
                precise[u] -= sum(mpmath.mpf(x) * y for x, y in zip(row, r, strict=True))
        return precise

    def geometry_floats(self, s: float) -> dict[str, float]:
        """Constants on the way from those of the file (s = 0) to those wanted (s = 1)."""
        return {name: (1 - s) * self.robot.constants[name] + s * float(c) for name, c in self.geometry.items()}

    def _linearised(self, q: Mapping[int, Any], constants: dict[str, float]) -> tuple[Array, Array]:
        """Residuals (..., m) and their derivatives by the tied joints (..., m, m)."""
        n, shape = len(self.robot.joints), np.shape(next(iter(q.values())))
        algebra = FloatAlgebra(self.robot, {j: np.asarray(x) for j, x in q.items()}, constants=constants)
        r = np.stack([np.broadcast_to(x, shape) for x in self.system.residual(algebra)], axis=-1)
        J = [[np.broadcast_to(x, shape) for x in row[n:]] for row in self.system.jacobian(algebra)]
        return r, np.moveaxis(np.array(J, dtype=float), (0, 1), (-2, -1))

    def _closed(self, count: int) -> list[tuple[dict[int, float], Array]]:
        """Random states and their Jacobians in the tied joints, closed by Newton in floats on the way from the start configuration and its lengths."""
        start, joints = self.closure.start, self.robot.joints
        wanted = {j: start[j] + self.rng.uniform(-0.4, 0.4, count) for j in joints}
        tied = {u: np.full(count, start[u]) for u in self.closure.tied}
        for s in (0.25, 0.5, 0.75, 1.0):
            active = {j: (1 - s) * start[j] + s * x for j, x in wanted.items()}
            for _ in range(8):
                r, J = self._linearised(active | tied, self.geometry_floats(s))
                if np.abs(r).max() < 1e-12:
                    break
                step = np.linalg.solve(J + 1e-14 * np.eye(len(tied)), r[..., None])[..., 0]
                tied = {u: x - np.clip(step[:, k], -0.5, 0.5) for k, (u, x) in enumerate(tied.items())}
        good = (np.abs(r).max(axis=1) < 1e-9) & (np.linalg.cond(J) < 1e6)
        return [({j: float(x[t]) for j, x in (wanted | tied).items()}, J[t]) for t in np.flatnonzero(good)]

    def _moving(self, q: dict[int, Any]) -> PreciseAlgebra:
        """Random rates and accelerations of the actuated joints, those of the tied ones by the closure equations."""
        joints, closure = self.robot.joints, self.closure
        n = len(joints)

        def draw() -> dict[int, Any]:
            return {j: mpmath.mpf(int(self.rng.integers(-1000, 1000))) / 256 for j in joints}

        J = self.system.jacobian(PreciseAlgebra(self.robot, self.geometry, q))
        J_u = [row[n:] for row in J]
        rate = {}
        for k, i in enumerate(joints):
            for u, g in zip(closure.tied, _solved(J_u, [-row[k] for row in J]), strict=True):
                rate[u, i] = g
        qd, qdd = draw(), draw()
        qd |= {u: sum(rate[u, i] * qd[i] for i in joints) for u in closure.tied}
        B = self.system.curvature(PreciseAlgebra(self.robot, self.geometry, q, qd))
        bend = _solved(J_u, [-b for b in B])
        qdd |= {u: sum(rate[u, i] * qdd[i] for i in joints) + b for u, b in zip(closure.tied, bend, strict=True)}
        return PreciseAlgebra(self.robot, self.geometry, q, qd, qdd, rate)


def _solved(A: Matrix, b: Sequence[Any]) -> list[Any]:
    return list(mpmath.lu_solve(mpmath.matrix(A), mpmath.matrix([mpmath.mpf(x) for x in b])))


def echelon(rows: Matrix) -> tuple[list[int], Matrix]:
    """Pivot columns (leftmost first) and reduced rows; entries below 1e-30 of their column are zero."""
    M = [list(row) for row in rows]
    width = len(M[0])
    size = [max(abs(row[c]) for row in M) for c in range(width)]
    least = ROUNDING * max(size)
    pivots: list[int] = []
    for c in range(width):
        rank = len(pivots)
        if rank == len(M) or size[c] <= least:
            continue
        best = max(range(rank, len(M)), key=lambda r: abs(M[r][c]))
        if abs(M[best][c]) < TOLERANCE * size[c]:
            continue
        M[rank], M[best] = M[best], M[rank]
        pivot = M[rank][c]
        M[rank] = [x / pivot for x in M[rank]]
        for r in range(len(M)):
            if r != rank and M[r][c]:
                factor = M[r][c]
                M[r] = [x - factor * y for x, y in zip(M[r], M[rank], strict=True)]
        pivots.append(c)
    return pivots, M[: len(pivots)]


def rational(x: Any) -> Fraction | None:
    """The fraction that x is to 40 digits with a denominator of less than 15, if there is one."""
    sign, x = (-1, -x) if x < 0 else (1, x)
    h, k = (1, 0), (0, 1)  # numerators and denominators of successive convergents
    rest = x
    for _ in range(60):
        whole = int(mpmath.floor(rest))
        h, k = (whole * h[0] + h[1], h[0]), (whole * k[0] + k[1], k[0])
        if abs(x - mpmath.mpf(h[0]) / k[0]) < mpmath.mpf(10) ** -40 * max(1, x):
            return Fraction(sign * h[0], k[0]) if k[0] < 10**15 else None
        fraction = rest - whole
        if fraction < mpmath.mpf(10) ** -50:
            return None
        rest = 1 / fraction
    return None


class PreciseResidues:
    """Coefficients at rational geometries, as residues: the source of recognition for general loops."""

    def __init__(self, robot: Robot, supports: Supports) -> None:
        self.robot, self.supports = robot, supports
        self.p = primes_for(2, 1)[0]
        in_angles = {name for f in robot.frames for e in (f.gamma, f.alpha, f.theta0) for name in e.symbols}
        in_calls = {
            name
            for f in robot.frames
            for e in (f.b, f.d, f.r0, *robot.gravity)
            for a in e.atoms
            if isinstance(a, Call)
            for name in a.argument.symbols
        }
        self.variables: tuple[Variable, ...] = tuple(name for name in robot.constants if name not in in_angles | in_calls)
        self.rng = np.random.default_rng(2)
        self.fraction: dict[tuple[Variable, int], Fraction] = {}

    def random(self, count: int) -> dict[Variable, Array]:
        return {v: np.array([self._length(v) for _ in range(count)], dtype=np.int64).reshape(count, 1) for v in self.variables}

    def _length(self, v: Variable) -> int:
        default = self.robot.constants[str(v)] or 1.0
        c = Fraction(round(default * float(self.rng.uniform(0.9, 1.1)) * 997), 997)
        residue = c.numerator * pow(c.denominator, -1, self.p) % self.p
        self.fraction[v, residue] = c
        return residue

    def beta(self, geometry: dict[Variable, Array], count: int) -> dict[str, Array | None]:
        names = tuple(dict.fromkeys(name for d, support in self.supports.items() for name in (*support, d)))
        residues: dict[str, Array | None] = {d: np.zeros((count, len(s)), dtype=np.int64) for d, s in self.supports.items()}
        for g in range(count):
            constants = default_geometry(self.robot) | {str(v): self.fraction[v, int(geometry[v][g, 0])] for v in self.variables}
            samples = -(-(max(map(len, self.supports.values())) + 3) // len(self.robot.joints)) + 1
            W = States(self.robot, constants, 50 + g).sample(names, samples)
            for d, support in self.supports.items():
                self._store(residues, g, d, [[row[names.index(name)] for name in (*support, d)] for row in W])
        return residues

    def _store(self, residues: dict[str, Array | None], g: int, d: str, rows: Matrix) -> None:
        into = residues[d]
        if into is None:
            return
        pivots, R = echelon(rows)
        fractions = [rational(row[-1]) for row in R] if pivots == list(range(into.shape[1])) else [None]
        if any(f is None for f in fractions):
            residues[d] = None
        else:
            into[g] = [f.numerator * pow(f.denominator, -1, self.p) % self.p for f in fractions if f is not None]

    def value(self, geometry: dict[Variable, Array], count: int, e: Expression) -> Array:
        def symbol(name: str) -> Fp:
            return Fp(geometry[name].reshape(-1), self.p)

        def number(c: Fraction) -> Fp:
            return Fp(np.full(count, c.numerator * pow(c.denominator, -1, self.p) % self.p), self.p)

        value = e.evaluate(symbol, lambda f, a: symbol(f), number)
        return np.asarray(value.x)


def default_geometry(robot: Robot) -> dict[str, Fraction]:
    """The constants of the robot file as exact decimals."""
    return {name: Fraction(repr(value)) for name, value in robot.constants.items()}


def nearby_geometry(robot: Robot, seed: int) -> dict[str, Fraction]:
    """Rational lengths within 10 % of the file's, without relations among them that the file does not state."""
    source = PreciseResidues(robot, {})
    source.rng = np.random.default_rng(seed)
    return default_geometry(robot) | {str(v): source.fraction[v, source._length(v)] for v in source.variables}


def base_and_relations(robot: Robot, names: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, dict[str, Expression]], bool]:
    """Base columns among `names` (in order of preference), {dependent: {base column: coefficient}}, and whether all are exact."""
    with mpmath.workdps(DIGITS):
        W = States(robot, nearby_geometry(robot, 31), 41).sample(names, states_for(robot, len(names)))
        pivots, R = echelon(W)
        base = tuple(names[c] for c in pivots)
        tiny = mpmath.mpf(10) ** -25
        dependent = [c for c in range(len(names)) if c not in pivots]
        supports = {names[c]: tuple(base[k] for k in range(len(base)) if abs(R[k][c]) > tiny) for c in dependent}
        wanted = {name: support for name, support in supports.items() if support}
        reasons: dict[str, str] = {}
        exact: dict[str, list[Expression]] = {}
        if wanted:
            exact = Recognition(robot, wanted, PreciseResidues(robot, wanted), reasons).coefficients()
        relations = {name: dict(zip(supports[name], exact.get(name, []), strict=False)) for name in supports}
        missing = [name for name in wanted if name not in exact]
        if missing:
            relations |= _numeric(robot, base, missing)
        return base, relations, not missing


def _numeric(robot: Robot, base: tuple[str, ...], missing: list[str]) -> dict[str, dict[str, Expression]]:
    """Coefficients as numbers, for the constants of the file alone."""
    W = States(robot, default_geometry(robot), 43).sample((*base, *missing), states_for(robot, len(base) + len(missing)))
    pivots, R = echelon(W)
    if pivots != list(range(len(base))):
        raise SymgenError("the lengths of the robot file are special: the base columns are dependent there; change them slightly")
    result: dict[str, dict[str, Expression]] = {}
    for k, name in enumerate(missing, start=len(base)):
        values = {b: float(row[k]) for b, row in zip(base, R, strict=True)}
        result[name] = {b: Expression.number(repr(x)) for b, x in values.items() if abs(x) > 1e-20}
    return result


def identities(
    robot: Robot, own: Sequence[str], names: Sequence[str], K: dict[str, dict[str, Expression]], seed: int, exact: bool
) -> tuple[int, list[str]]:
    """(rank of the base columns, standard columns that are not what K says) at fresh states, and fresh lengths if the formulas are exact."""
    with mpmath.workdps(DIGITS):
        geometry = nearby_geometry(robot, seed) if exact else default_geometry(robot)
        W = States(robot, geometry, seed).sample(names, states_for(robot, len(own)))
        column = {name: c for c, name in enumerate(names)}
        rank = len(echelon([[row[column[name]] for name in own] for row in W])[0])
        algebra = PreciseAlgebra(robot, geometry, {})
        wrong = []
        tolerance = TOLERANCE if exact else mpmath.mpf(10) ** -9
        least = ROUNDING * max(abs(x) for row in W for x in row)
        for name in names:
            terms = [(column[o], mpmath.mpf(algebra.constant(c))) for o, c in K.get(name, {}).items()]
            size = max(
                max(abs(row[column[name]]) for row in W), max((abs(c * row[o]) for row in W for o, c in terms), default=least), least
            )
            if any(abs(row[column[name]] - sum(c * row[o] for o, c in terms)) > tolerance * size for row in W):
                wrong.append(name)
        return rank, wrong
