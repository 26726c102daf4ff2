"""Base parameters of robots with general loops, exact: relations from points of the closed mechanism over F_p (`regroup.closed_draw`).

Which columns depend on which shows at points of one geometry, by an echelon form. Coefficients are first looked for among multiples of monomials of
lengths and sums of two or three, at two geometries. Others, beta_k = P_k/Q with polynomials in the lengths, are the nullspace over F_p of

    Q D_dependent - sum_k P_k D_k = 0      at more points of V than there are unknowns,

each point a robot of its own, homogeneous, since a coefficient has the unit of a power of a length. What is found is checked at fresh points by
`certify`. Where F_p gives no points, dependencies and coefficients are those of floats, at states closed by Newton near the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, product

import numpy as np

from symgen.derive.columns import element_names, inertial_names, sampled_columns
from symgen.derive.exact import Array
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.loop_equations import loop_system
from symgen.derive.newton_euler import Motion
from symgen.description.expression import Expression
from symgen.description.robot import PRISMATIC, Robot
from symgen.errors import SymgenError
from symgen.regroup.closed_draw import ClosedDraw, Length, closed_draw
from symgen.regroup.finite_field import rref, small_rational

INDEPENDENT = 1e-7  # of a unit column: what the columns before it leave of an independent one
SPREAD, MOST_STATES = 0.4, 4000  # rad about the start, and of half the longest length for slides
DEGREES = range(4)  # of Q; units then fix the degree of every P
MAX_UNKNOWNS = 1200
LARGEST_FACTOR, LARGEST_BELOW, MOST_MONOMIALS = 12, 2, 20_000  # of a monomial, lengths in its denominator, and monomials looked at
MOST_OF_THREE = 60  # monomials of which sums of three are looked for


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
        return sampled_columns(Motion(Geometry(self.robot, FloatAlgebra(self.robot, q, qd, qdd, rate), closure)), names, size)

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


def base_and_relations(robot: Robot, names: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, dict[str, Expression]], str]:
    """Base columns among `names` (in order of preference), {dependent: {base column: coefficient}}, and why not all are exact, if so."""
    try:
        return _exact(robot, names)
    except ArithmeticError as error:
        reason = str(error)
    pivots, K = float_base(FloatStates(robot, 41).regressor(names, float_states(robot, names)))
    base = tuple(names[c] for c in pivots)
    relations = {
        name: {base[k]: Expression.number(repr(float(K[k, c]))) for k in np.flatnonzero(K[:, c])}
        for c, name in enumerate(names)
        if c not in pivots
    }
    found = {name: relation(robot, name, tuple(support)) if support else {} for name, support in relations.items()}
    relations |= {name: e for name, e in found.items() if e is not None}
    return base, relations, reason if None in found.values() else ""


def _exact(robot: Robot, names: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, dict[str, Expression]], str]:
    """By points of two geometries over F_p; raises ArithmeticError where there are none, or a coefficient is not found."""
    states = len(names) // len(robot.joints) + 10
    draws = [closed_draw(robot, seed, states, one_geometry=True) for seed in (11, 12)]
    echelons = [rref(draw.regressor(names).reshape(-1, len(names)), draw.p) for draw in draws]
    pivots = echelons[0][0]
    if echelons[1][0] != pivots:
        raise ArithmeticError("the rank differs from geometry to geometry")
    base = tuple(names[c] for c in pivots)
    monomials = Monomials(draws)
    relations: dict[str, dict[str, Expression]] = {}
    for c, name in enumerate(names):
        if c not in pivots:
            support = [k for k in range(len(base)) if any(R[k, c] for _, R in echelons)]
            degree = {k: length_degree(robot, base[k]) - length_degree(robot, name) for k in support}
            found = {base[k]: monomials.sum([int(R[k, c]) for _, R in echelons], degree[k]) for k in support}
            few = {b: e for b, e in found.items() if e is not None}
            known = few if len(few) == len(found) else relation(robot, name, tuple(found))
            if known is None:
                raise ArithmeticError(f"the coefficients of {name} are no fractions of moderate degree in the lengths")
            relations[name] = known
    return base, relations, ""


@dataclass(frozen=True)
class Monomial:
    """A quotient of products of lengths, with its residues and theirs inverted at two geometries."""

    above: Sequence[Length]
    under: Sequence[Length]
    residues: Sequence[int]
    inverse: Sequence[int]

    @property
    def expression(self) -> Expression:
        e = Expression.number(1)
        for v, n in (*((v, 1) for v in self.above), *((v, -1) for v in self.under)):
            e = e * Expression({((v, n),): Fraction(1)})
        return e


class Monomials:
    """Coefficients that are a multiple of a monomial of lengths, a sum or difference of two, or of three without lengths below, by their residues at two geometries."""

    def __init__(self, draws: Sequence[ClosedDraw]) -> None:
        self.p = draws[0].p
        self.lengths = draws[0].lengths
        self.values = [{v: int(draw.drawn[v][0]) for v in self.lengths} for draw in draws]
        self.inverse = [{v: pow(x, -1, self.p) for v, x in values.items()} for values in self.values]
        self.tables: dict[tuple[int, int], list[Monomial]] = {}

    def sum(self, residues: Sequence[int], degree: int) -> Expression | None:
        """The coefficient of that degree, or None; those with few lengths below come first."""
        known: list[Monomial] = []
        for below in range(LARGEST_BELOW + 1):
            known += (new := self._table(degree, below))
            if len(known) > MOST_MONOMIALS:
                return None
            for m in new:
                c, other = (x * i % self.p for x, i in zip(residues, m.inverse, strict=True))
                if c == other and (factor := small_rational(c, self.p, LARGEST_FACTOR)) is not None:
                    return m.expression * factor
            place = {m.residues[0]: m for m in known}
            if (two := self._two(residues, known, place)) is not None:
                return two
            if not below and len(known) <= MOST_OF_THREE:
                for m, sign in product(known, (1, -1)):
                    rest = [x - sign * y for x, y in zip(residues, m.residues, strict=True)]
                    if (two := self._two(rest, known, place)) is not None:
                        return m.expression * sign + two
        return None

    def _two(self, residues: Sequence[int], known: Sequence[Monomial], place: Mapping[int, Monomial]) -> Expression | None:
        """A sum or difference of two of the known monomials; `place` finds them by their first residue."""
        for m, sign, other in product(known, (1, -1), (1, -1)):
            n = place.get(other * (residues[0] - sign * m.residues[0]) % self.p)
            if n is not None and (sign * m.residues[1] + other * n.residues[1] - residues[1]) % self.p == 0:
                return m.expression * sign + n.expression * other
        return None

    def _table(self, degree: int, below: int) -> list[Monomial]:
        """Quotients with so many lengths below."""
        if (degree, below) not in self.tables:
            pairs = product(_products(self.lengths, degree + below), _products(self.lengths, below))
            self.tables[degree, below] = [self._monomial(above, under) for above, under in pairs if not {*above} & {*under}]
        return self.tables[degree, below]

    def _monomial(self, above: Sequence[Length], under: Sequence[Length]) -> Monomial:
        residues, inverse = [1, 1], [1, 1]
        for k in (0, 1):
            for v in above:
                residues[k], inverse[k] = residues[k] * self.values[k][v] % self.p, inverse[k] * self.inverse[k][v] % self.p
            for v in under:
                residues[k], inverse[k] = residues[k] * self.inverse[k][v] % self.p, inverse[k] * self.values[k][v] % self.p
        return Monomial(above, under, residues, inverse)


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
