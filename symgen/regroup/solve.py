"""Coefficients of the particular relations in Q(geometry): D_dependent = sum_k beta_k D_base,k.

Over F_p each beta is a residue. It becomes an exact expression by the first of these that holds:
 (a) the same small rational in two draws of the geometry: a number;
 (b) c prod L_i**n_i: doubling one length multiplies beta by 2**n_i, and what is left is a small rational;
 (c) otherwise the (support + 1)-column system is solved over the fraction field of the lengths and half-angle tangents, from
     regressor rows at small rational states (sympy DomainMatrix).
"""

from __future__ import annotations

from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np

from symgen.derive.columns import columns
from symgen.derive.geometry import Geometry
from symgen.derive.newton_euler import Motion
from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import Expression, call, quarter_turns
from symgen.description.robot import Robot
from symgen.errors import SymgenError
from symgen.regroup.finite_field import Array, Draw, Fp, angle_denominators, rref, small_rational

MAX_POWER = 8


def sample(draw: Draw, names: tuple[str, ...]) -> Array:
    """The regressor columns `names` at the draw's states, shape (n_active * samples, len(names)), int64 residues."""
    robot = draw.robot
    D = columns(Motion(Geometry(robot, draw)), names)
    W = np.zeros((len(names), len(robot.joints), draw.samples), dtype=np.int64)
    for k, name in enumerate(names):
        for row, j in enumerate(robot.joints):
            value = D[name].get(j, 0)
            W[k, row] = value.x if isinstance(value, Fp) else value % draw.p
    return W.reshape(len(names), -1).T


def states_for(robot: Robot, n_columns: int) -> int:
    """Enough random states for the rank of `n_columns` columns to be seen."""
    return -(-(n_columns + 10) // len(robot.joints)) + 4


class Relation:
    """One dependent column and the base columns it is a combination of."""

    def __init__(self, robot: Robot, dependent: str, support: tuple[str, ...]) -> None:
        self.robot, self.dependent, self.support = robot, dependent, support

    def residues(self, draw: Draw) -> list[int]:
        names = (*self.support, self.dependent)
        pivots, R = rref(sample(draw, names), draw.p)
        if pivots != list(range(len(self.support))):
            raise SymgenError(f"the relation of {self.dependent} to {', '.join(self.support)} changes with the draw; this geometry is degenerate")
        return [int(x) for x in R[:, -1]]

    def monomials(self) -> list[Expression] | None:
        """Case (b); None where a coefficient is not a monomial in the constants."""
        robot, samples = self.robot, states_for(self.robot, len(self.support) + 1)
        names = sorted(robot.constants)
        rng = np.random.default_rng(len(names))
        lengths = {name: int(rng.integers(2, 2**30)) for name in names}
        draw = Draw(robot, 11, samples, constants=lengths)
        p = draw.p
        beta = self.residues(draw)
        powers: list[dict[str, int]] = [{} for _ in beta]
        for name in names:
            doubled = self.residues(Draw(robot, 11, samples, constants=lengths | {name: 2 * lengths[name]}))
            for k, (x, y) in enumerate(zip(beta, doubled, strict=True)):
                n = next((n for n in range(-MAX_POWER, MAX_POWER + 1) if x * pow(2, n, p) % p == y), None)
                if n is None:
                    return None
                powers[k][name] = n
        result = []
        for x, exponents in zip(beta, powers, strict=True):
            e = Expression.number(1)
            for name, n in exponents.items():
                x = x * pow(pow(lengths[name], n, p), -1, p) % p
                e = e * Expression.symbol(name) ** n
            c = small_rational(x, p)
            if c is None:
                return None
            result.append(e * c)
        return result

    def exact(self) -> list[Expression]:
        """Case (c)."""
        field = FractionField(self.robot)
        names = (*self.support, self.dependent)
        rows: list[list[Any]] = []
        wanted = len(self.support)
        for seed in count():
            field.new_state(seed)
            D = columns(Motion(Geometry(self.robot, field)), names)
            for j in self.robot.joints:
                row = [field.lift(D[name].get(j, 0)) for name in names]
                if any(row):
                    rows.append(row)
            if len(rows) >= wanted + 2:
                break
            if seed > 4 * wanted + 8:
                raise SymgenError(f"no rows for the relation of {self.dependent}")
        return field.solve(rows, wanted, self.dependent)


class FractionField:
    """Exact rational states over Q(lengths, half-angle tangents): an Algebra of the derivation."""

    def __init__(self, robot: Robot) -> None:
        from sympy import QQ, symbols

        self.robot = robot
        self.denominators = angle_denominators(robot)
        atoms: list[str] = list(robot.constants)
        self.angles = {m: f"t_{k}" for k, m in enumerate(m for m in self.denominators)}
        generators = symbols([*atoms, *self.angles.values()])
        self.K = QQ.frac_field(*generators)
        self.generator = dict(zip([*atoms, *self.angles.values()], self.K.gens, strict=True))
        self.special: dict[Expression, Any] = {}

    def new_state(self, seed: int) -> None:
        self.rng = np.random.default_rng(1000 + seed)
        self.values: dict[tuple[str, int], Any] = {}

    def _value(self, kind: str, j: int) -> Any:
        if (kind, j) not in self.values:
            self.values[kind, j] = self.K.convert(int(self.rng.integers(1, 10)))
        return self.values[kind, j]

    def _point(self, t: Any) -> tuple[Any, Any]:
        return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)

    def _multiple(self, a: tuple[Any, Any], n: int) -> tuple[Any, Any]:
        if n < 0:
            a, n = (a[0], -a[1]), -n
        result = (self.K.one, self.K.zero)
        for _ in range(n):
            result = self._turned(result, a)
        return result

    def _turned(self, a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
        return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]

    def _angle(self, e: Expression) -> tuple[Any, Any]:
        turns, rest = quarter_turns(e)
        quarter = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns % 4]
        point = (self.K.convert(quarter[0]), self.K.convert(quarter[1]))
        for m, c in rest.terms.items():
            unit = self._point(self.generator[self.angles[m]])
            point = self._turned(point, self._multiple(unit, int(c * self.denominators[m])))
        return point

    def lift(self, value: Scalar) -> Any:
        return self.K.convert(value) if type(value) is int else value

    def constant(self, e: Expression) -> Scalar:
        c = e.constant
        if c is not None and c in (0, 1, -1):
            return int(c)
        return e.evaluate(self.generator.__getitem__, self._call, self._number)

    def _number(self, c: Fraction) -> Any:
        from sympy import QQ

        return self.K.convert(QQ(c.numerator, c.denominator))

    def _call(self, function: str, argument: Expression) -> Any:
        if function in ("cos", "sin"):
            return self._angle(argument)[function == "sin"]
        if function == "inv":
            return 1 / self.lift(self.constant(argument))
        raise SymgenError(f"no exact coefficient with {function}({argument}) in the geometry; declare {function}({argument}) as a constant of its own")

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        point = self._angle(offset)
        for j, n in turn:
            point = self._turned(point, self._multiple(self._point(self._value("t", j)), n))
        return point

    def q(self, j: int) -> Any:
        return self._value("q", j)

    def qd(self, j: int) -> Any:
        return self._value("qd", j)

    def qdd(self, j: int) -> Any:
        return self._value("qdd", j)

    def sign(self, rate: Scalar, row: tuple[tuple[int, Expression], ...]) -> Any:
        return self._value(f"b{row}", 0)

    def one_sided(self, rate: Scalar, row: tuple[tuple[int, Expression], ...], when: str) -> tuple[Scalar, Scalar]:
        b = (self._value(f"b{row}", 0) + 1) / 2
        return (b, b * rate) if when == "positive" else (b - 1, (1 - b) * rate)

    def name(self, value: Scalar, name: str) -> Scalar:
        return value

    hint = name

    def section(self, title: str) -> None:
        pass

    def solve(self, rows: list[list[Any]], wanted: int, dependent: str) -> list[Expression]:
        from sympy.polys.matrices import DomainMatrix

        M = DomainMatrix(rows, (len(rows), wanted + 1), self.K)
        R, pivots = M.rref()
        if pivots != tuple(range(wanted)):
            raise SymgenError(f"the exact relation of {dependent} has no unique solution; this geometry is degenerate")
        return [self._expression(R[k, wanted].element) for k in range(wanted)]

    def _expression(self, x: Any) -> Expression:
        """A field element as an expression; a half-angle tangent t of angle a is sin(a)/(1 + cos(a))."""
        atoms: list[Expression] = []
        for name in self.robot.constants:
            atoms.append(Expression.symbol(name))
        for m in self.angles:
            half = Expression({m: Fraction(1, 2 * self.denominators[m])})
            atoms.append(call("tan", half))

        def polynomial(f: Any) -> Expression:
            total = Expression()
            for exponents, c in f.terms():
                term = Expression.number(Fraction(int(c.numerator), int(c.denominator)))
                for atom, n in zip(atoms, exponents, strict=True):
                    if n:
                        term = term * atom**n
                total = total + term
            return total

        numerator, denominator = polynomial(x.numer), polynomial(x.denom)
        return numerator * denominator.inverse()
