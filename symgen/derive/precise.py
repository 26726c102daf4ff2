"""The algebra of high precision: one state of a robot with rational constants, in as many digits as mpmath is set to."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import mpmath

from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import Expression
from symgen.description.robot import Robot

Real = Any  # mpmath.mpf


class PreciseAlgebra:
    """Scalars are mpmath reals; `direction` gives sign(sd) of the rows that friction acts along."""

    def __init__(
        self,
        robot: Robot,
        constants: Mapping[str, Fraction],
        q: Mapping[int, Real],
        qd: Mapping[int, Real] | None = None,
        qdd: Mapping[int, Real] | None = None,
        rate: Mapping[tuple[int, int], Real] | None = None,
    ) -> None:
        self.robot, self.constants = robot, {name: _real(c) for name, c in constants.items()}
        self._q, self._qd, self._qdd, self._rate = q, qd or {}, qdd or {}, rate or {}

    def constant(self, e: Expression) -> Scalar:
        c = e.constant
        if c is not None and c in (0, 1, -1):
            return int(c)
        return e.evaluate({**self.constants, "pi": mpmath.pi}.__getitem__, self._call, _real)

    def _call(self, function: str, argument: Expression) -> Real:
        x = mpmath.mpf(self.constant(argument))
        return 1 / x if function == "inv" else getattr(mpmath, function)(x)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        angle = mpmath.mpf(self.constant(offset))
        for j, n in turn:
            angle += n * self._q[j]
        return mpmath.cos(angle), mpmath.sin(angle)

    def q(self, j: int) -> Real:
        return self._q[j]

    def qd(self, j: int) -> Real:
        return self._qd[j]

    def qdd(self, j: int) -> Real:
        return self._qdd[j]

    def rate(self, u: int, i: int) -> Real:
        return self._rate[u, i]

    def sign(self, rate: Scalar, row: object) -> Scalar:
        return mpmath.sign(rate)

    def one_sided(self, rate: Scalar, row: object, when: str) -> tuple[Scalar, Scalar]:
        inside = rate > 0 if when == "positive" else rate < 0
        return (mpmath.sign(rate), rate) if inside else (mpmath.mpf(0), mpmath.mpf(0))

    def name(self, value: Scalar, name: str) -> Scalar:
        return value

    hint = name

    def section(self, title: str) -> None:
        pass


def _real(c: Fraction) -> Real:
    return mpmath.mpf(c.numerator) / c.denominator
