"""The algebra of floats: q, qd, qdd of the joints are arrays, constants have the values of the robot file (or others)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symgen.derive.scalar import Scalar, Turn
from symgen.description.expression import Expression
from symgen.description.robot import Robot

Array = np.ndarray[Any, Any]


class FloatAlgebra:
    """Scalars are arrays of any one shape: `q`, `qd`, `qdd` give them by joint number."""

    def __init__(
        self,
        robot: Robot,
        q: Mapping[int, Array],
        qd: Mapping[int, Array] | None = None,
        qdd: Mapping[int, Array] | None = None,
        rate: Mapping[tuple[int, int], Array] | None = None,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        self.robot, self._q, self._qd, self._qdd, self._rate = robot, q, qd or {}, qdd or {}, rate or {}
        self.constants = {**robot.constants, **(constants or {})}

    def constant(self, e: Expression) -> Scalar:
        c = e.constant
        return int(c) if c is not None and c in (0, 1, -1) else e.value(self.constants)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        angle: Scalar = offset.value(self.constants)
        for j, n in turn:
            angle = angle + n * self._q[j]
        return np.cos(angle), np.sin(angle)

    def q(self, j: int) -> Array:
        return self._q[j]

    def qd(self, j: int) -> Array:
        return self._qd[j]

    def qdd(self, j: int) -> Array:
        return self._qdd[j]

    def rate(self, u: int, i: int) -> Array:
        return self._rate[u, i]

    def sign(self, rate: Scalar, row: object) -> Scalar:
        return np.sign(rate)

    def one_sided(self, rate: Scalar, row: object, when: str) -> tuple[Scalar, Scalar]:
        limit = np.maximum if when == "positive" else np.minimum
        return limit(np.sign(rate), 0), limit(rate, 0)

    def name(self, value: Scalar, name: str) -> Scalar:
        return value

    hint = name

    def section(self, title: str) -> None:
        pass
