"""Coefficients of the particular relations in Q(geometry): D_dependent = sum_k beta_k D_base,k.

Over F_p each beta is a residue, and a function of the geometry: lengths, gravity, (cos, sin) of fixed angles. Changing one of them at a
time shows which ones matter. The rest is linear algebra: beta = P/Q with P, Q polynomials of rising degree in what matters,

    sum_m P_m m(g) - beta(g) sum_m Q_m m(g) = 0     at more random geometries g than there are unknowns,

a nullspace over F_p whose entries are then read as small rationals. Nothing is assumed of the result: the certificate checks it.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product

import numpy as np

from symgen.derive.columns import columns
from symgen.derive.geometry import Geometry
from symgen.derive.loops import close
from symgen.derive.newton_euler import Motion
from symgen.description.expression import ONE, Expression, Monomial, call
from symgen.description.robot import Robot
from symgen.errors import SymgenError
from symgen.derive.exact import PI, Array, Draw, Fp, angle_denominators, fixed_angles
from symgen.regroup.finite_field import rref, small_rational

MAX_UNKNOWNS = 900
DEGREES = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (3, 0), (3, 2), (3, 3), (4, 0), (4, 4), (6, 0), (6, 6))

Variable = str | Monomial  # a constant's name, or the unit of a fixed angle


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
    """Enough random states for the rank of `n_columns` columns to be seen."""
    return -(-(n_columns + 10) // len(robot.joints)) + 4


def coefficients(robot: Robot, dependent: str, support: tuple[str, ...]) -> list[Expression]:
    """beta of D_dependent = sum_k beta_k D_support,k, exact. Raises SymgenError if no P/Q of moderate degree fits."""
    for free_pi in (True, False):  # fractions of pi as any angle, if the relation holds for any; else at their exact values
        try:
            return _Relation(robot, dependent, support, free_pi).coefficients()
        except _NotRecognisedError as error:
            reason = error
    raise SymgenError(f"{dependent} depends on {', '.join(support)}, but its coefficients were not recognised: {reason}")


class _NotRecognisedError(Exception):
    """Why no fraction was found."""


class _Relation:
    def __init__(self, robot: Robot, dependent: str, support: tuple[str, ...], free_pi: bool) -> None:
        self.robot, self.names = robot, (*support, dependent)
        self.free_pi = free_pi
        self.samples = -(-(len(support) + 7) // len(robot.joints)) + 2
        self.denominators = angle_denominators(robot)
        units = [m for m in self.denominators if m != PI or (free_pi and self.denominators[PI] > 2)]
        self.variables: tuple[Variable, ...] = (*robot.constants, *units)
        self.p = Draw(robot, 0, 1).p
        self.rng = np.random.default_rng(len(support))

    def coefficients(self) -> list[Expression]:
        reference = {v: self.rng.integers(2, self.p, (1, 1)) for v in self.variables}
        changed = {v: self.rng.integers(2, self.p, (1, 1)) for v in self.variables}
        cases = [reference] + [reference | {v: changed[v]} for v in self.variables]
        beta = self.residues({v: np.concatenate([case[v] for case in cases]) for v in self.variables}, len(cases))
        result = []
        for k in range(beta.shape[1]):
            matters = [v for i, v in enumerate(self.variables, start=1) if beta[i, k] != beta[0, k]]
            result.append(self._recognise(k, matters, reference))
        return result

    def residues(self, geometry: dict[Variable, Array], count: int) -> Array:
        """beta at `count` geometries, shape (count, support)."""
        draw = Draw(self.robot, 11, self.samples, geometry=geometry, count=count)
        W = np.broadcast_to(sample(draw, self.names), (count, len(self.robot.joints) * self.samples, len(self.names)))
        beta = np.zeros((count, len(self.names) - 1), dtype=np.int64)
        for i in range(count):
            pivots, R = rref(W[i], self.p)
            if pivots != list(range(len(self.names) - 1)):
                raise _NotRecognisedError("the relation does not hold for every geometry")
            beta[i] = R[:, -1]
        return beta

    def _recognise(self, k: int, matters: Sequence[Variable], reference: dict[Variable, Array]) -> Expression:
        for (numerator, denominator), angles in product(DEGREES, self._choices(matters)):
            P, Q = self._monomials(matters, angles, numerator), self._monomials(matters, angles, denominator)
            count = len(P) + len(Q) + 4
            if count > MAX_UNKNOWNS or (numerator and not angles and not any(isinstance(v, str) for v in matters)):
                continue
            geometry = {
                v: self.rng.integers(2, self.p, (count, 1)) if v in matters else np.repeat(reference[v], count, 0) for v in self.variables
            }
            beta = self.residues(geometry, count)[:, k]
            values = Draw(self.robot, 11, 1, geometry=geometry, count=count)
            p_columns = [self._value(values, m, count) for m in P]
            q_columns = [-beta * self._value(values, m, count) % self.p for m in Q]
            found = self._fraction(np.stack([*q_columns, *p_columns], axis=1), Q, P)
            if found is not None:
                return found
        raise _NotRecognisedError(f"no fraction of degree up to {DEGREES[-1]} in {', '.join(map(str, matters))}")

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

    def _value(self, draw: Draw, m: tuple[Expression, ...], count: int) -> Array:
        total = np.ones(count, dtype=np.int64)
        for e in m:
            value = draw.constant(e)
            total = total * (value.x.reshape(-1) if isinstance(value, Fp) else value) % self.p
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
