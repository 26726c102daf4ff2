"""Exact coefficients of dependent regressor columns: D_dependent = sum_k beta_k D_base,k.

Over F_p, each beta is a residue that depends on the geometry: on lengths, gravity, and (cos, sin)
of fixed angles. The program changes one of these variables at a time to find which of them matter.
The rest is linear algebra: beta = P/Q with P, Q polynomials of rising degree in these variables,

    sum_m P_m m(g) - beta(g) sum_m Q_m m(g) = 0

at more random geometries g than there are unknowns. The solution is a nullspace over F_p, whose
entries are converted to rational numbers, with as many primes as needed.

The search starts with many variables and ends with few. First, numbers of the robot file, square
roots and all fixed angles are variables; then fractions of pi have their values; at last the
numbers have their values too, for a relation that holds for these numbers alone. Nothing is assumed
about the result, because the certificate checks it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product, takewhile
from math import comb, isqrt

import numpy as np

from symgen.derive.constants import (
    PI,
    Variable,
    fixed_angles,
    numbered,
    numbers_of,
    roots_of,
    units_of,
)
from symgen.derive.exact import Array, Draw, primes_for
from symgen.description.expression import Call, Expression, Number
from symgen.description.robot import Robot
from symgen.regroup.finite_field import rref, small_rational, solve_each
from symgen.regroup.states import draw_states, sample, states_for
from symgen.time_limit import require_time

MAX_UNKNOWNS = 500
MAX_PRIMES = 24  # of 31 bits each: numerators and denominators of some 110 digits
# multiplications: of one recognition, some seconds; of each coefficient beyond it
MAX_WORK, FEW_WORK = 4e8, 1e7
FREEDOMS = (
    ("numbers", "pi"),
    ("numbers",),
    (),
)  # what is an indeterminate beside constants and transcendental angles
FEWEST_GEOMETRIES = 16  # geometries of a pool
MANY = 2  # variables beyond which those that are mere factors are set apart
SCALES, POWERS = (2, 3), (1, -1, 2, -2, 3, -3, 4, -4)
DEGREES = (
    (0, 0),
    (1, 0),
    (1, 1),
    (2, 0),
    (2, 1),
    (2, 2),
    (3, 0),
    (3, 2),
    (3, 3),
    (4, 0),
    (4, 4),
    (6, 0),
    (6, 6),
)

Products = Sequence[tuple[Expression, ...]]
Supports = Mapping[
    str, tuple[str, ...]
]  # {dependent column: the base columns it is a combination of}


def coefficients(
    robot: Robot, supports: Supports
) -> tuple[dict[str, list[Expression]], dict[str, str]]:
    """Find the exact coefficients that express dependent regressor columns by base columns.

        D_dependent = sum_k beta_k D_support,k

    Return the coefficients of each dependent column, and for columns without a fraction P/Q of
    moderate degree the reason.
    """
    supports = {name: support for name, support in supports.items() if support}
    result: dict[str, list[Expression]] = {}
    reasons: dict[str, str] = {}
    for free in FREEDOMS:
        left = {name: support for name, support in supports.items() if name not in result}
        if left:
            result |= Recognition(robot, left, free, reasons).coefficients()
    return result, {name: reasons[name] for name in supports if name not in result}


class Pool:
    """Coefficients of dependent regressor columns, modulo a prime, at a set of random geometries.

    `k` is the number of the prime. `free` names the quantities that may vary besides the constants:
    "numbers" of the robot file, "pi" (fractions of pi), or both.
    """

    def __init__(self, robot: Robot, supports: Supports, free: Sequence[str], k: int) -> None:
        self.robot, self.supports = robot, supports
        self.samples = max(states_for(robot, (*s, d), spare=0) for d, s in supports.items())
        self.names = tuple(
            dict.fromkeys(name for d, support in supports.items() for name in (*support, d))
        )
        written = numbered(robot)
        whole = (PI, Fraction(1, units_of(written).D))
        turns = "pi" in free and fixed_angles(written)
        units = [u for u in units_of(written).all if u != whole or turns]
        numbers: list[Variable] = [*numbers_of(written)] if "numbers" in free else []
        numbers += [
            root
            for root in roots_of(written)
            if "numbers" in free or root.argument.constant is None
        ]
        self.variables: tuple[Variable, ...] = (*robot.constants, "pi", *units, *numbers)
        self.p = primes_for(robot, k + 1)[k]
        self.rng = np.random.default_rng(len(supports) + 1000 * k)
        self.count, self.geometry = 0, self.random(0)
        self.beta: dict[str, Array | None] = {
            name: np.zeros((0, len(support)), dtype=np.int64) for name, support in supports.items()
        }
        self.values: dict[Expression, Array] = {}

    def random(self, count: int) -> dict[Variable, Array]:
        """Draw `count` random geometries: per variable, integers modulo p, shape (count, 1)."""
        return {v: self.rng.integers(2, self.p, (count, 1)) for v in self.variables}

    def solved(self, geometry: Mapping[Variable, Array], count: int) -> dict[str, Array | None]:
        """Compute the coefficients of each dependent column at the given geometries, modulo p.

        The shape is (count, support); the value is None if the column does not depend on its
        support at every geometry.
        """
        draw = draw_states(self.robot, 11, self.samples, p=self.p, geometry=geometry, count=count)
        W = sample(draw, self.names)
        index = {name: k for k, name in enumerate(self.names)}
        return {
            d: solve_each(W[:, :, [index[name] for name in (*s, d)]], self.p, self.rng)
            for d, s in self.supports.items()
        }

    def grow(self, count: int) -> None:
        """Draw more random geometries until there are at least `count`."""
        if count <= self.count:
            return
        more = max(count - self.count, self.count, FEWEST_GEOMETRIES)
        geometry = self.random(more)
        beta = self.solved(geometry, more)
        self.geometry = {v: np.concatenate([self.geometry[v], x]) for v, x in geometry.items()}
        self.count += more
        for name, b in beta.items():
            old = self.beta[name]
            self.beta[name] = None if b is None or old is None else np.concatenate([old, b])
        self.values.clear()

    def value(self, m: tuple[Expression, ...]) -> Array:
        """Compute a product of expressions modulo p, for each randomly drawn set of lengths and angles."""
        total = np.ones(self.count, dtype=np.int64)
        for e in m:
            if e not in self.values:
                draw = Draw(self.robot, 11, 1, p=self.p, geometry=self.geometry, count=self.count)
                self.values[e] = draw.spread(draw.constant(e)).reshape(-1)
            total = total * self.values[e] % self.p
        return total

    def vector(self, name: str, k: int, P: Products, Q: Products) -> dict[int, int] | None:
        """Find a coefficient beta = P/Q modulo p, in which P and Q are sums of the given products.

        Return {index in [*Q, *P]: residue} of the first relation with a denominator (a product of
        Q), or None. There can be several relations, since cos(a) and cos(3 a) are related.
        """
        count = len(P) + len(Q) + 4
        self.grow(count)
        beta = self.beta[name]
        if beta is None:
            return None
        columns = [-beta[:count, k] * self.value(m)[:count] % self.p for m in Q] + [
            self.value(m)[:count] for m in P
        ]
        pivots, R = rref(np.stack(columns, axis=1), self.p)
        for free in (c for c in range(len(Q), len(columns)) if c not in pivots):
            entries = {
                c: -int(R[i, free]) % self.p
                for i, c in enumerate(pivots)
                if c < free and R[i, free]
            }
            if min(entries, default=free) < len(Q):
                return entries | {free: 1}
        return None


@dataclass(frozen=True)
class Dependence:
    """The variables, such as lengths, on which a regrouping coefficient depends.

    The coefficient depends on `free` in an unknown way; the variables in `powers` are mere factors
    with the given power.
    """

    free: tuple[Variable, ...]
    powers: Mapping[str | Number | Call, int]

    def __len__(self) -> int:
        return len(self.free)


class Recognition:
    """Search for exact expressions of regrouping coefficients, from their values modulo primes.

    `free` names the variables besides the constants, see `Pool`.
    """

    def __init__(
        self, robot: Robot, supports: Supports, free: Sequence[str], reasons: dict[str, str]
    ) -> None:
        self.robot, self.supports, self.free, self.reasons = robot, supports, free, reasons
        self.pools = [Pool(robot, supports, free, 0)]
        self.work = 0  # multiplications, roughly

    def coefficients(self) -> dict[str, list[Expression]]:
        """Return the exact coefficients of all dependent columns for which the search succeeds.

        The form is {dependent column: coefficients}.
        """
        result: dict[str, list[Expression]] = {}
        for name, matters in self._what_matters().items():
            each = (self._recognise(name, k, depends) for k, depends in enumerate(matters))
            recognised = [e for e in takewhile(lambda e: e is not None, each) if e is not None]
            if len(recognised) == len(matters):
                result[name] = recognised
        return result

    def _what_matters(self) -> dict[str, list[Dependence]]:
        pool = self.pools[0]
        variables = pool.variables
        reference, changed = pool.random(1), pool.random(1)

        def at(cases: list[dict[Variable, Array]]) -> dict[str, Array | None]:
            geometry = {v: np.concatenate([case[v] for case in cases]) for v in variables}
            return pool.solved(geometry, len(cases))

        result: dict[str, list[Dependence]] = {}
        for name, b in at([reference] + [reference | {v: changed[v]} for v in variables]).items():
            if b is None:
                self.reasons[name] = "the relation does not hold for every geometry"
            else:
                moved = [
                    [v for i, v in enumerate(variables, start=1) if b[i, k] != b[0, k]]
                    for k in range(b.shape[1])
                ]
                result[name] = [Dependence(tuple(vs), {}) for vs in moved]
        many = [
            v
            for v in variables
            if not isinstance(v, tuple)
            and any(len(d) > MANY and v in d.free for ds in result.values() for d in ds)
        ]
        scaled = (
            at(
                [reference]
                + [reference | {v: reference[v] * n % pool.p} for v in many for n in SCALES]
            )
            if many
            else {}
        )
        for name, b in scaled.items():
            for k, d in enumerate(result.get(name, [])):
                if len(d) > MANY and b is not None:
                    powers = {
                        v: self._power(
                            b[0, k], [b[1 + len(SCALES) * i + j, k] for j in range(len(SCALES))]
                        )
                        for i, v in enumerate(many)
                    }
                    factors = {v: n for v, n in powers.items() if n and v in d.free}
                    result[name][k] = Dependence(
                        tuple(v for v in d.free if v not in factors), factors
                    )
        return result

    def _power(self, reference: int, scaled: Sequence[int]) -> int:
        """Find the power n with which a coefficient scales with one variable; 0 if there is none.

        `scaled` holds the coefficient modulo p with the variable multiplied by each factor in
        `SCALES`.
        """
        p = self.pools[0].p
        ratios = [int(x) * pow(int(reference), -1, p) % p for x in scaled] if reference else []
        return next((n for n in POWERS if ratios == [pow(c, n, p) for c in SCALES]), 0)

    def _recognise(self, name: str, k: int, depends: Dependence) -> Expression | None:
        matters, before = depends.free, self.work
        above, below = (
            tuple(_atom(v) for v, n in depends.powers.items() for _ in range(sign * n))
            for sign in (1, -1)
        )
        for (numerator, denominator), angles in product(DEGREES, self._choices(matters)):
            require_time()
            if (
                comb(
                    len(matters)
                    - sum(isinstance(v, tuple) for v in matters)
                    + len(angles)
                    + numerator,
                    numerator,
                )
                > MAX_UNKNOWNS
            ):
                continue  # more products without a sine than may be looked for
            P = [(*m, *above) for m in self._monomials(matters, angles, numerator)]
            Q = [(*m, *below) for m in self._monomials(matters, angles, denominator)]
            if len(P) + len(Q) + 4 > MAX_UNKNOWNS or (numerator and len(P) == 1):
                continue
            self.work += (len(P) + len(Q)) ** 3
            if self.work > MAX_WORK and self.work - before > FEW_WORK:
                self.reasons[name] = "the search took long; fewer symbols in the table shorten it"
                return None
            vector = self.pools[0].vector(name, k, P, Q)
            if self.pools[0].beta[name] is None:
                self.reasons[name] = "the relation does not hold for every geometry"
                return None
            if vector is not None:
                entries = self._rationals(vector, name, k, P, Q)
                if entries is None:
                    self.reasons[name] = "a coefficient is not rational in what may vary"
                    return None
                # unless it does not
                self.reasons[name] = "a denominator vanishes at the fixed angles"
                return _fraction(entries, P, Q)
        self.reasons[name] = (
            f"no fraction of at most {MAX_UNKNOWNS} terms and degree {DEGREES[-1][0]} in "
            f"{_texts((*matters, *depends.powers)) or 'rational numbers'}"
        )
        return None

    def _rationals(
        self, vector: dict[int, int], name: str, k: int, P: Products, Q: Products
    ) -> dict[int, Fraction] | None:
        """Convert integers modulo p to the rational numbers they represent; None if this fails.

        One prime is enough for small numerators and denominators. Otherwise primes are combined by
        the Chinese remainder theorem until one more prime agrees.
        """
        small = {c: small_rational(x, self.pools[0].p) for c, x in vector.items()}
        if all(x is not None for x in small.values()):
            return {c: x for c, x in small.items() if x is not None}
        residue, modulus = dict(vector), self.pools[0].p
        for m in range(1, MAX_PRIMES):
            if m == len(self.pools):
                self.pools.append(Pool(self.robot, self.supports, self.free, m))
            p, other = self.pools[m].p, self.pools[m].vector(name, k, P, Q)
            if other is None or set(other) != set(vector):
                return None
            bound = isqrt(modulus // 2)
            entries = {c: small_rational(x, modulus, bound) for c, x in residue.items()}
            rationals = {c: x for c, x in entries.items() if x is not None and x.denominator % p}
            if len(rationals) == len(entries) and all(
                (x.numerator - other[c] * x.denominator) % p == 0 for c, x in rationals.items()
            ):
                return rationals
            inverse = pow(modulus, -1, p)
            residue = {c: x + modulus * ((other[c] - x) * inverse % p) for c, x in residue.items()}
            modulus *= p
        return None

    def _choices(self, matters: Sequence[Variable]) -> list[tuple[Expression, ...]]:
        """List the sets of fixed angles whose cosines and sines may occur in a coefficient.

        A set has one angle, two angles, or all angles. It must contain every unit angle that
        matters; a fixed angle is a sum of multiples of unit angles. Without such angles, the only
        set is empty.
        """
        units, written = {v for v in matters if isinstance(v, tuple)}, numbered(self.robot)
        every = units_of(written)
        held = {e: units & {unit for unit, _ in every.of(e)} for e in fixed_angles(written)}
        angles = [e for e in held if held[e]]
        choices = [
            c
            for n in (1, 2)
            for c in combinations(angles, n)
            if set().union(*(held[e] for e in c)) == units
        ]
        return [*choices, *([tuple(angles)] if len(angles) > 2 else [])] if angles else [()]

    def _monomials(
        self, matters: Sequence[Variable], angles: Sequence[Expression], degree: int
    ) -> Products:
        """List the products of at most `degree` factors: constants, cosines and sines.

        A sine occurs at most once in a product, because sin**2 = 1 - cos**2.
        """
        sines = [_atom(Call("sin", e)) for e in angles]
        atoms = (
            [_atom(v) for v in matters if not isinstance(v, tuple)]
            + [_atom(Call("cos", e)) for e in angles]
            + sines
        )
        once = range(len(atoms) - len(sines), len(atoms))
        places = [
            m
            for d in range(degree + 1)
            for m in combinations_with_replacement(range(len(atoms)), d)
        ]
        return [tuple(atoms[k] for k in m) for m in places if all(m.count(s) < 2 for s in once)]


def _fraction(entries: Mapping[int, Fraction], P: Products, Q: Products) -> Expression | None:
    """Build the expression P/Q from the coefficients of its terms; return None if Q is zero.

    The products are [*Q, *P]. Cosines and roots that have simple values are replaced by these
    values.
    """
    products = [*Q, *P]
    sides = [Expression(), Expression()]
    for c, value in entries.items():
        term = Expression.number(value)
        for e in products[c]:
            term = term * e
        sides[c >= len(Q)] += term
    denominator, numerator = (side.substitute({}) for side in sides)
    if not denominator:
        return None
    lead = denominator.terms[next(iter(denominator.terms))]
    return numerator * (1 / lead) * (denominator * (1 / lead)).inverse()


def _atom(a: str | Number | Call) -> Expression:
    """Return one variable as an expression; cos(pi/6) is not replaced by its value."""
    return Expression({((a, 1),): Fraction(1)})


def _texts(matters: Sequence[Variable]) -> str:
    return ", ".join(
        str(v) if not isinstance(v, tuple) else str(Expression({v[0]: v[1]})) for v in matters
    )
