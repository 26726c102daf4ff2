"""Coefficients of the particular relations in Q(geometry): D_dependent = sum_k beta_k D_base,k.

Over F_p each beta is a residue, and a function of the geometry: lengths, gravity, (cos, sin) of fixed angles. Changing one of them at a
time shows which ones matter. The rest is linear algebra: beta = P/Q with P, Q polynomials of rising degree in what matters,

    sum_m P_m m(g) - beta(g) sum_m Q_m m(g) = 0     at more random geometries g than there are unknowns,

a nullspace over F_p whose entries are then read as small rationals. Nothing is assumed of the result: the certificate checks it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product
from typing import Protocol

import numpy as np

from symgen.derive.columns import columns
from symgen.derive.exact import PI, Array, Draw, Fp, angle_denominators, fixed_angles
from symgen.derive.geometry import Geometry
from symgen.derive.loops import close
from symgen.derive.newton_euler import Motion
from symgen.description.expression import ONE, Expression, Monomial, call
from symgen.description.robot import Robot
from symgen.errors import SymgenError
from symgen.regroup.finite_field import rref, small_rational, solve_each

MAX_UNKNOWNS = 900
DEGREES = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (3, 0), (3, 2), (3, 3), (4, 0), (4, 4), (6, 0), (6, 6))

Variable = str | Monomial  # a constant's name, or the unit of a fixed angle
Supports = Mapping[str, tuple[str, ...]]  # {dependent column: the base columns it is a combination of}


def sample(draw: Draw, names: tuple[str, ...]) -> Array:
    """The regressor columns `names` at the draw's states, shape (..., n_active * samples, len(names)), int64 residues."""
    robot = draw.robot
    D = columns(Motion(Geometry(robot, draw, close(robot))), names)
    W = np.zeros((len(names), len(robot.joints), *draw.shape), dtype=np.int64)
    for k, name in enumerate(names):
        for row, j in enumerate(robot.joints):
            value = D[name].get(j, 0)
            W[k, row] = value.x if isinstance(value, Fp) else value % draw.p
    W = np.moveaxis(W, -1, 2)  # names, joints, samples, geometries
    return np.moveaxis(W.reshape(len(names), -1, *draw.shape[:-1]), (0, 1), (-1, -2))


def states_for(robot: Robot, n_columns: int) -> int:
    """Number of random states at which the sampled rank of `n_columns` columns is their rank."""
    return -(-(n_columns + 10) // len(robot.joints)) + 4


def coefficients(robot: Robot, supports: Supports) -> dict[str, list[Expression]]:
    """beta of D_dependent = sum_k beta_k D_support,k, exact. Raises SymgenError if no P/Q of moderate degree fits."""
    supports = {name: support for name, support in supports.items() if support}
    result: dict[str, list[Expression]] = {}
    reasons: dict[str, str] = {}
    for free_pi in (True, False):  # fractions of pi as any angle, if the relation holds for any; else at their exact values
        left = {name: support for name, support in supports.items() if name not in result}
        if left:
            recognition = Recognition(robot, left, Residues(robot, left, free_pi), reasons)
            result |= recognition.coefficients()
    for name in supports:
        if name not in result:
            raise SymgenError(
                f"robot {robot.name}: {name} depends on {', '.join(supports[name])}, but the coefficients were not recognised: {reasons[name]}"
            )
    return {name: result.get(name, []) for name in supports}


class Source(Protocol):
    """Where the residues come from: F_p itself, or high precision where the loops cannot be closed over F_p."""

    p: int
    variables: tuple[Variable, ...]

    def random(self, count: int) -> dict[Variable, Array]:
        """`count` random geometries: residues, shape (count, 1)."""

    def beta(self, geometry: dict[Variable, Array], count: int) -> dict[str, Array | None]:
        """{dependent: residues of its coefficients, shape (count, support), or None if it does not depend at every geometry}."""

    def value(self, geometry: dict[Variable, Array], count: int, e: Expression) -> Array:
        """Residues of a constant expression at the geometries."""


class Residues:
    """Coefficients over F_p, for serial robots, trees and parallelograms."""

    def __init__(self, robot: Robot, supports: Supports, free_pi: bool) -> None:
        self.robot, self.supports = robot, supports
        self.samples = -(-(max(map(len, supports.values())) + 7) // len(robot.joints)) + 2
        self.names = tuple(dict.fromkeys(name for d, support in supports.items() for name in (*support, d)))
        denominators = angle_denominators(robot)
        units = [m for m in denominators if m != PI or (free_pi and denominators[PI] > 2)]
        self.variables: tuple[Variable, ...] = (*robot.constants, *units)
        self.p = Draw(robot, 0, 1).p
        self.rng = np.random.default_rng(len(supports))

    def random(self, count: int) -> dict[Variable, Array]:
        return {v: self.rng.integers(2, self.p, (count, 1)) for v in self.variables}

    def beta(self, geometry: dict[Variable, Array], count: int) -> dict[str, Array | None]:
        draw = Draw(self.robot, 11, self.samples, geometry=geometry, count=count)
        W = np.broadcast_to(sample(draw, self.names), (count, len(self.robot.joints) * self.samples, len(self.names)))
        index = {name: k for k, name in enumerate(self.names)}
        return {d: solve_each(W[:, :, [index[name] for name in (*s, d)]], self.p, self.rng) for d, s in self.supports.items()}

    def value(self, geometry: dict[Variable, Array], count: int, e: Expression) -> Array:
        value = Draw(self.robot, 11, 1, geometry=geometry, count=count).constant(e)
        return value.x.reshape(-1) if isinstance(value, Fp) else np.full(1, value % self.p)


class Recognition:
    """Expressions from residues at a growing pool of random geometries."""

    def __init__(self, robot: Robot, supports: Supports, source: Source, reasons: dict[str, str]) -> None:
        self.robot, self.supports, self.source, self.p = robot, supports, source, source.p
        self.reasons = reasons
        self.geometry = source.random(0)
        self.count = 0
        self.pool: dict[str, Array | None] = {name: np.zeros((0, len(support)), dtype=np.int64) for name, support in supports.items()}
        self.values: dict[Expression, Array] = {}

    def coefficients(self) -> dict[str, list[Expression]]:
        """{dependent: coefficients} of those that were recognised."""
        matters = self._what_matters()
        result: dict[str, list[Expression]] = {}
        for name, support in self.supports.items():
            if name in matters:
                betas = [self._recognise(name, k, matters[name][k]) for k in range(len(support))]
                if all(e is not None for e in betas):
                    result[name] = [e for e in betas if e is not None]
        return result

    def _what_matters(self) -> dict[str, list[list[Variable]]]:
        variables = self.source.variables
        reference, changed = self.source.random(1), self.source.random(1)
        cases = [reference] + [reference | {v: changed[v]} for v in variables]
        beta = self.source.beta({v: np.concatenate([case[v] for case in cases]) for v in variables}, len(cases))
        result: dict[str, list[list[Variable]]] = {}
        for name, b in beta.items():
            if b is None:
                self.reasons[name] = "the relation does not hold for every geometry"
            else:
                result[name] = [[v for i, v in enumerate(variables, start=1) if b[i, k] != b[0, k]] for k in range(b.shape[1])]
        return result

    def _grow(self, count: int) -> None:
        if count <= self.count:
            return
        more = max(count - self.count, self.count, 12)
        geometry = self.source.random(more)
        beta = self.source.beta(geometry, more)
        self.geometry = {v: np.concatenate([self.geometry[v], geometry[v]]) for v in geometry} if self.count else geometry
        self.count += more
        for name, b in beta.items():
            old = self.pool[name]
            self.pool[name] = None if b is None or old is None else np.concatenate([old, b])
        self.values.clear()

    def _recognise(self, name: str, k: int, matters: Sequence[Variable]) -> Expression | None:
        for (numerator, denominator), angles in product(DEGREES, self._choices(matters)):
            P, Q = self._monomials(matters, angles, numerator), self._monomials(matters, angles, denominator)
            count = len(P) + len(Q) + 4
            if count > MAX_UNKNOWNS or (numerator and len(P) == 1):
                continue
            self._grow(count)
            pool = self.pool[name]
            if pool is None:
                self.reasons[name] = "the relation does not hold for every geometry"
                return None
            p_columns = [self._value(m)[:count] for m in P]
            q_columns = [-pool[:count, k] * self._value(m)[:count] % self.p for m in Q]
            beta = self._fraction(np.stack([*q_columns, *p_columns], axis=1), Q, P)
            if beta is not None:
                return beta
        self.reasons[name] = f"no fraction of degree up to {DEGREES[-1]} in {', '.join(map(str, matters)) or 'rational numbers'}"
        return None

    def _choices(self, matters: Sequence[Variable]) -> list[tuple[Expression, ...]]:
        """Fixed angles of the robot whose cos and sin may enter: none, one of them, two, all."""
        units = {v for v in matters if not isinstance(v, str)}
        angles = [e for e in fixed_angles(self.robot) if units & set(e.terms)]
        choices = [tuple(c) for n in (1, 2) for c in combinations(angles, n)]
        return [*choices, *([tuple(angles)] if len(angles) > 2 else [])] if angles else [()]

    def _monomials(self, matters: Sequence[Variable], angles: Sequence[Expression], degree: int) -> list[tuple[Expression, ...]]:
        """Products of at most `degree` constants, cosines and sines; sin to the first power only, as sin**2 = 1 - cos**2."""
        sines = [call("sin", e) for e in angles]
        atoms = [Expression.symbol(v) for v in matters if isinstance(v, str)] + [call("cos", e) for e in angles] + sines
        products: list[tuple[Expression, ...]] = []
        for d in range(degree + 1):
            products += [m for m in combinations_with_replacement(atoms, d) if all(m.count(s) < 2 for s in sines)]
        return products

    def _value(self, m: tuple[Expression, ...]) -> Array:
        total = np.ones(self.count, dtype=np.int64)
        for e in m:
            if e not in self.values:
                self.values[e] = self.source.value(self.geometry, self.count, e)
            total = total * self.values[e] % self.p
        return total

    def _fraction(self, M: Array, Q: Sequence[tuple[Expression, ...]], P: Sequence[tuple[Expression, ...]]) -> Expression | None:
        pivots, R = rref(M, self.p)
        free = next((c for c in range(M.shape[1]) if c not in pivots), None)
        if free is None:
            return None
        vector = {c: -int(R[i, free]) % self.p for i, c in enumerate(pivots) if c < free} | {free: 1}
        entries = {c: small_rational(x, self.p) for c, x in vector.items() if x}
        if any(c is None for c in entries.values()):
            return None
        products = [*Q, *P]
        sides = [Expression(), Expression()]
        for c, value in entries.items():
            term = ONE
            for e in products[c]:
                term = term * e
            sides[c >= len(Q)] += term * (value or Fraction(0))
        denominator, numerator = sides
        if not denominator:
            return None
        lead = denominator.terms[next(iter(denominator.terms))]
        return numerator * (1 / lead) * (denominator * (1 / lead)).inverse()
