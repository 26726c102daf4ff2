"""Base parameters of robots with general loops, exact: points of the closed mechanism over F_p.

The tied joints are algebraic functions of the actuated ones, so states cannot be drawn at one geometry over F_p. But where the orientations of
every loop agree by construction (sums of angles), the closure equations r = 0 are positions: linear in the lengths and in the strokes of slides.
Angles are therefore drawn at random, all of them, and as many lengths or strokes as there are equations are solved for. Each sample is a robot of its own
in a state of its own, a random point of

    V = {(lengths, configuration) : r = 0} ,

a bundle of linear spaces over the torus of the angles, hence irreducible: an identity that holds at random points of V holds on all of V, for
every geometry and in every assembly mode. Rates and accelerations of the tied joints follow from J qd = 0, J qdd + Jd qd = 0, by linear equations.

Relations are found the same way. Which columns depend on which shows in floats, at states closed by Newton near the start; the
coefficients beta_k = P_k/Q, polynomials in the lengths, are the nullspace over F_p of

    Q D_dependent - sum_k P_k D_k = 0      at more points of V than there are unknowns,

homogeneous, since a coefficient has the unit of a power of a length. What is found is checked at fresh points by `certify`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from symgen.derive.angles import Variable, primes_for
from symgen.derive.columns import columns, element_names, inertial_names
from symgen.derive.exact import Array, Draw, Fp, power
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.loop_equations import loop_system, residuals
from symgen.derive.newton_euler import Motion
from symgen.description.expression import Call, Expression, Number
from symgen.description.robot import PRISMATIC, Robot
from symgen.errors import SymgenError
from symgen.regroup.finite_field import rref, small_rational

INDEPENDENT = 1e-7  # of a unit column: what the columns before it leave of an independent one
SPREAD, MOST_STATES = 0.4, 4000  # rad about the start, and of half the longest length for slides
DEGREES = range(4)  # of Q; units then fix the degree of every P
MAX_UNKNOWNS = 1200

Length = str | Number | Call


class ClosedDraw(Draw):
    """Random points of V: every sample has its own lengths and its own configuration, closed; raises ArithmeticError where that is no linear matter."""

    def __init__(self, robot: Robot, seed: int, samples: int, *, p: int | None = None) -> None:
        p = p if p is not None else primes_for(robot, 1)[0]
        rng = np.random.default_rng([seed, 1])
        self.lengths = lengths_of(robot)
        self.drawn: dict[Variable, Array] = {v: rng.integers(1, p, samples) for v in self.lengths}
        super().__init__(robot, seed, samples, p=p, geometry=self.drawn)
        self.system = loop_system(robot)
        self.tied = self.system.closure.tied
        if any(loop.cut in self.tied for loop in robot.loops):
            raise ArithmeticError("the orientations of a loop do not agree by construction")
        self._close()
        self._move()

    def _residual(self) -> Array:
        """(equations, samples)."""
        return np.stack([self._array(x) for x in self.system.residual(self)])

    def _array(self, x: Any) -> Array:
        return np.broadcast_to(x.x if isinstance(x, Fp) else np.array([x % self.p]), (self.samples,))

    def _close(self) -> None:
        """Solve r = r0 + M u = 0 for lengths or strokes u, as many as equations; strokes of tied slides first, then the last lengths."""
        strokes = [j for j in self.tied if self.robot.frame(j).sigma == PRISMATIC]
        candidates: list[int | Length] = [*strokes, *reversed(self.lengths)]
        for u in candidates:
            self._put(u, np.zeros(self.samples, dtype=np.int64))
        r0, columns_of = self._residual(), []
        for u in candidates:
            self._put(u, np.ones(self.samples, dtype=np.int64))
            columns_of.append((self._residual() - r0) % self.p)
            self._put(u, np.zeros(self.samples, dtype=np.int64))
        m = len(r0)
        M = np.stack(columns_of, axis=1)  # (m, candidates, samples)
        pivots = rref(M[:, :, 0].copy(), self.p)[0]
        if len(pivots) < m:
            raise ArithmeticError("fewer lengths than closure equations")
        rest = r0
        for k, u in enumerate(candidates):
            if k not in pivots:
                value = self._random(self.samples)
                self._put(u, value)
                rest = (rest + M[:, k] * value) % self.p
        for k, value in zip(pivots, self._solved(M[:, pivots], -rest % self.p), strict=True):
            self._put(candidates[k], value)
        whole = np.stack([self._array(x) for x in residuals(self.robot, self, self.system.closure)])
        if whole.any():
            raise ArithmeticError("the closure equations are not linear in the lengths, or the orientations do not agree")

    def _put(self, u: int | Length, value: Array) -> None:
        if isinstance(u, int):
            self._q[u] = value
        else:
            self.drawn[u] = value
            if isinstance(u, str):
                self._constants[u] = value

    def _move(self) -> None:
        """Rates and accelerations of the tied joints."""
        joints, n = self.robot.joints, len(self.robot.joints)
        J = np.stack([np.stack([self._array(x) for x in row]) for row in self.system.jacobian(self)])
        J_u = J[:, n:]
        rates = np.stack([self._solved(J_u, -J[:, k] % self.p) for k in range(n)], axis=1)  # (tied, n, samples)
        for a, u in enumerate(self.tied):
            for k, i in enumerate(joints):
                self._rate[u, i] = rates[a, k]
            self._qd[u] = sum((rates[a, k] * self._qd[i] for k, i in enumerate(joints)), start=np.int64(0)) % self.p  # type: ignore[assignment]
        B = np.stack([self._array(x) for x in self.system.curvature(self)])
        bend = self._solved(J_u, -B % self.p)
        for a, u in enumerate(self.tied):
            total = bend[a]
            for k, i in enumerate(joints):
                total = (total + rates[a, k] * self._qdd[i]) % self.p
            self._qdd[u] = total

    def _solved(self, A: Array, b: Array) -> Array:
        """x with A x = b sample by sample, A of shape (m, m, samples), by Gauss elimination; singular samples give ArithmeticError."""
        p, m = self.p, len(b)
        M = np.concatenate([A, b[:, None]], axis=1) % p
        for c in range(m):
            below = (M[c:, c] != 0).argmax(axis=0) + c
            samples = np.arange(M.shape[2])
            swap = M[below, :, samples].copy()
            M[below, :, samples] = M[c, :, samples]
            M[c, :, samples] = swap
            if not M[c, c].all():
                raise ArithmeticError("a singular draw")
            M[c] = M[c] * power(M[c, c], p - 2, p) % p
            for r in range(m):
                if r != c:
                    M[r] = (M[r] - M[r, c] * M[c]) % p
        return M[:, m]

    def regressor(self, names: Sequence[str]) -> Array:
        """Columns `names`, shape (joints, samples, len(names))."""
        D = columns(Motion(Geometry(self.robot, self, self.system.closure)), names)
        return np.stack([np.stack([self._array(D[name].get(j, 0)) for name in names], axis=-1) for j in self.robot.joints])


def closed_draw(robot: Robot, seed: int, samples: int, *, p: int | None = None) -> ClosedDraw:
    """A ClosedDraw; a draw that happens to be singular is made again."""
    for k in range(4):
        try:
            return ClosedDraw(robot, seed + 1000 * k, samples, p=p)
        except ArithmeticError as error:
            if str(error) != "a singular draw":
                raise
    raise ArithmeticError("only singular draws")


def lengths_of(robot: Robot) -> tuple[Length, ...]:
    """Constants, numbers and roots in b, d and r of the frames, in their order."""
    found: dict[Length, None] = {}
    for f in robot.frames:
        for e in (f.b, f.d, f.r0):
            for a in sorted(e.atoms, key=str):
                if a != "pi":
                    found[a] = None
    return tuple(found)


class FloatStates:
    """States of a robot with general loops in floats, closed by Newton's method on the way from its start configuration."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self.robot, self.system, self.rng = robot, loop_system(robot), np.random.default_rng(seed)
        self.size = max(abs(e.value(robot.constants)) for f in robot.frames for e in (f.b, f.d, f.r0))
        self.spread = {j: SPREAD * (self.size / 2 if robot.frame(j).sigma == PRISMATIC else 1.0) for j in robot.joints}

    def regressor(self, names: Sequence[str], count: int) -> Array:
        """Columns `names` at `count` closed states, shape (joints * count, len(names))."""
        rows: list[Array] = []
        found = tried = 0
        while found < count:
            tried += count
            if tried > MOST_STATES + 10 * count:
                raise SymgenError(
                    f"robot {self.robot.name}: the loops close in {found} of {tried} states near the start; give each loop a `start` that closes it"
                )
            block = self._block(names, count)
            rows.append(block)
            found += block.shape[1]
        return np.concatenate(rows, axis=1)[:, :count].reshape(-1, len(names))

    def _block(self, names: Sequence[str], count: int) -> Array:
        closure, joints, n = self.system.closure, self.robot.joints, len(self.robot.joints)
        q = {j: closure.start[j] + self.spread[j] * self.rng.uniform(-1, 1, count) for j in joints}
        wanted = dict(q)
        tied = {u: np.full(count, closure.start[u]) for u in closure.tied}
        for s in (0.25, 0.5, 0.75, 1.0):
            q = {j: (1 - s) * closure.start[j] + s * x for j, x in wanted.items()}
            for _ in range(8):
                r, J = self._linearised(q | tied)
                if np.abs(r).max() < 1e-14 * self.size:
                    break
                step = np.linalg.solve(J[..., n:] + 1e-14 * np.eye(len(tied)), r[..., None])[..., 0]
                tied = {u: x - np.clip(step[:, k], -0.5, 0.5) for k, (u, x) in enumerate(tied.items())}
        r, J = self._linearised(q | tied)
        good = (np.abs(r).max(axis=1) < 1e-11 * self.size) & (np.linalg.cond(J[..., n:]) < 1e6)
        q = {j: x[good] for j, x in (q | tied).items()}
        J, size = J[good], int(good.sum())
        rates = -np.linalg.solve(J[..., n:], J[..., :n])  # (samples, tied, n)
        qd, qdd = ({j: self.rng.standard_normal(size) for j in joints} for _ in range(2))
        qd |= {u: sum((rates[:, a, k] * qd[i] for k, i in enumerate(joints)), start=np.zeros(size)) for a, u in enumerate(closure.tied)}
        B = np.stack([np.broadcast_to(x, (size,)) for x in self.system.curvature(FloatAlgebra(self.robot, q, qd))], axis=-1)
        bend = np.linalg.solve(J[..., n:], -B[..., None])[..., 0]
        qdd |= {u: sum((rates[:, a, k] * qdd[i] for k, i in enumerate(joints)), start=bend[:, a]) for a, u in enumerate(closure.tied)}
        rate = {(u, i): rates[:, a, k] for a, u in enumerate(closure.tied) for k, i in enumerate(joints)}
        D = columns(Motion(Geometry(self.robot, FloatAlgebra(self.robot, q, qd, qdd, rate), closure)), names)
        return np.stack(
            [np.stack([np.broadcast_to(np.asarray(D[name].get(j, 0), dtype=float), (size,)) for name in names], axis=-1) for j in joints]
        )

    def _linearised(self, q: Mapping[int, Array]) -> tuple[Array, Array]:
        """Residuals (samples, m) and their derivatives by the independent joints (samples, m, n + m)."""
        shape = np.shape(next(iter(q.values())))
        algebra = FloatAlgebra(self.robot, q)
        r = np.stack([np.broadcast_to(x, shape) for x in self.system.residual(algebra)], axis=-1)
        J = [[np.broadcast_to(x, shape) for x in row] for row in self.system.jacobian(algebra)]
        return r, np.moveaxis(np.array(J, dtype=float), (0, 1), (-2, -1))


def float_base(W: Array) -> tuple[list[int], Array]:
    """Independent columns of W, leftmost first, and the coefficients of every column in them, shape (rank, columns)."""
    norms = np.linalg.norm(W, axis=0)
    norms[norms <= 1e-10 * norms.max(initial=0.0)] = np.inf
    U = W / norms
    Q = np.zeros((W.shape[0], 0))
    pivots: list[int] = []
    for c in range(W.shape[1]):
        u = U[:, c] - Q @ (Q.T @ U[:, c])
        u = u - Q @ (Q.T @ u)
        if (size := float(np.linalg.norm(u))) > INDEPENDENT:
            pivots.append(c)
            Q = np.column_stack([Q, u / size])
    K = np.linalg.lstsq(U[:, pivots], U, rcond=None)[0]
    return pivots, np.where(np.abs(K) > 1e-6, K, 0.0) * np.where(np.isinf(norms), 0.0, norms) / norms[pivots][:, None]


def float_states(robot: Robot, names: Sequence[str]) -> int:
    """Enough random states for the rank of `names`."""
    return 3 * len(names) // len(robot.joints) + 10


def base_and_relations(robot: Robot, names: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, dict[str, Expression]], bool]:
    """Base columns among `names` (in order of preference), {dependent: {base column: coefficient}}, and whether all are exact."""
    pivots, K = float_base(FloatStates(robot, 41).regressor(names, float_states(robot, names)))
    base = tuple(names[c] for c in pivots)
    relations: dict[str, dict[str, Expression]] = {}
    exact = True
    for c, name in enumerate(names):
        if c in pivots:
            continue
        support = {base[k]: float(K[k, c]) for k in np.flatnonzero(K[:, c])}
        found = relation(robot, name, tuple(support)) if support else {}
        exact &= found is not None
        relations[name] = {b: Expression.number(repr(x)) for b, x in support.items()} if found is None else found
    return base, relations, exact


def length_degree(robot: Robot, name: str) -> int:
    """Power of a length in the unit of a parameter, mass and time aside: XX 2, MX 1, M 0."""
    inertial = inertial_names(robot)
    if name in inertial:
        family = inertial[name][0]
        return 0 if family == "M" else 1 if family.startswith("M") else 2
    e, j = element_names(robot)[name]
    slides = robot.frame(j).sigma == PRISMATIC
    return {"inertia": 2, "viscous": 2, "stiffness": 2}.get(e.kind, 1) * (not slides)


def relation(robot: Robot, name: str, support: tuple[str, ...]) -> dict[str, Expression] | None:
    """D_name = sum_k beta_k D_k with beta_k in Q(lengths), or None where none of moderate degree is found."""
    try:
        draw = closed_draw(robot, 11, 8)
    except ArithmeticError:
        return None
    own = length_degree(robot, name)
    for degree in DEGREES:
        products = {k: _products(draw.lengths, degree + length_degree(robot, k) - own) for k in support}
        Q = _products(draw.lengths, degree)
        width = len(Q) + sum(map(len, products.values()))
        if width > MAX_UNKNOWNS:
            return None
        found = _nullspace(robot, name, support, Q, products, width)
        if found is not None:
            return found
    return None


def _products(lengths: Sequence[Length], degree: int) -> list[tuple[Length, ...]]:
    return list(combinations_with_replacement(lengths, degree)) if degree >= 0 else []


def _nullspace(
    robot: Robot,
    name: str,
    support: tuple[str, ...],
    Q: list[tuple[Length, ...]],
    products: Mapping[str, list[tuple[Length, ...]]],
    width: int,
) -> dict[str, Expression] | None:
    n = len(robot.joints)
    draw = closed_draw(robot, 13, -(-(width + 8) // n) + 2)
    D = draw.regressor((*support, name)).reshape(-1, len(support) + 1)

    def scaled(column: Array, product: tuple[Length, ...]) -> Array:
        total = np.ones(draw.samples, dtype=np.int64)
        for v in product:
            total = total * draw.drawn[v] % draw.p
        return column * np.tile(total, n) % draw.p

    terms: list[tuple[str, tuple[Length, ...]]] = [(name, m) for m in Q] + [(k, m) for k in support for m in products[k]]
    place = {k: c for c, k in enumerate((*support, name))}
    M = np.stack([scaled(D[:, place[k]] if k == name else -D[:, place[k]] % draw.p, m) for k, m in terms], axis=1)
    pivots, R = rref(M, draw.p)
    free = next((c for c in range(len(terms)) if c not in pivots), None)
    if free is None:
        return None
    sides: dict[str, Expression] = {k: Expression() for k in (*support, name)}
    for c, residue in [*((c, -int(R[i, free]) % draw.p) for i, c in enumerate(pivots) if c < free), (free, 1)]:
        value = small_rational(residue, draw.p)
        if value is None:
            return None
        k, m = terms[c]
        monomial = Expression.number(value)
        for v in m:
            monomial = monomial * Expression({((v, 1),): value * 0 + 1})
        sides[k] = sides[k] + monomial
    denominator = sides.pop(name)
    if not denominator:
        return None
    return {k: e * denominator.inverse() for k, e in sides.items() if e}
