"""The algebra of high precision: one state of a robot with rational constants, in as many digits as mpmath is set to."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import mpmath

from symgen.derive.float_algebra import NumberAlgebra
from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import Expression
from symgen.description.robot import Robot

Real = Any  # mpmath.mpf


class PreciseAlgebra(NumberAlgebra):
    """Scalars are mpmath reals."""

    def __init__(self, robot: Robot, constants: Mapping[str, Fraction], *states: Mapping[Any, Real] | None) -> None:
        super().__init__(robot, *states)  # type: ignore[arg-type]
        self.constants = {name: _real(c) for name, c in constants.items()}

    def value(self, e: Expression) -> Real:
        return mpmath.mpf(e.evaluate({**self.constants, "pi": mpmath.pi}.__getitem__, self._call, _real))

    def _call(self, function: str, argument: Expression) -> Real:
        x = self.value(argument)
        return 1 / x if function == "inv" else getattr(mpmath, function)(x)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        angle = self.angle(turn, offset)
        return mpmath.cos(angle), mpmath.sin(angle)

    def sign(self, rate: Scalar, row: object) -> Scalar:
        return mpmath.sign(rate)

    def one_sided(self, rate: Scalar, row: object, when: str) -> tuple[Scalar, Scalar]:
        inside = rate > 0 if when == "positive" else rate < 0
        return (mpmath.sign(rate), rate) if inside else (mpmath.mpf(0), mpmath.mpf(0))


def _real(c: Fraction) -> Real:
    return mpmath.mpf(c.numerator) / c.denominator
