"""The algebra of floats: q, qd, qdd of the joints are given by joint number, arrays of any one
shape.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symgen.derive.graph import OPAQUE
from symgen.derive.scalar import Scalar, Turn, Unnamed
from symgen.description.expression import Expression
from symgen.description.robot import Robot

Array = np.ndarray[Any, Any]


ON_ARRAYS = {op: getattr(np, name) for op, name in OPAQUE.items() if op != "power"} | {
    "power": np.power,
    "inv": lambda x: 1.0 / x,
    "sign": np.sign,
}


class FloatAlgebra(Unnamed):
    """States in floats.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, qd, qdd : mapping
        Position, velocity and acceleration of each joint; rad or m and seconds.
    rate : mapping
        dq_u/dq_i of each tied joint u and actuated joint i.
    constants : mapping
        In place of those of the robot file.
    """

    def __init__(
        self,
        robot: Robot,
        q: Mapping[int, Array],
        qd: Mapping[int, Array] | None = None,
        qdd: Mapping[int, Array] | None = None,
        rate: Mapping[tuple[int, int], Array] | None = None,
        *,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        self.robot, self._q, self._qd, self._qdd, self._rate = (
            robot,
            q,
            qd or {},
            qdd or {},
            rate or {},
        )
        self.constants = {**robot.constants, **(constants or {})}

    def constant(self, e: Expression) -> Scalar:
        c = e.constant
        return int(c) if c is not None and c in (0, 1, -1) else self.value(e)

    def value(self, e: Expression) -> Scalar:
        """A constant expression as a number."""
        return e.value(self.constants)

    def angle(self, turn: Turn, offset: Expression) -> Scalar:
        """sum n_j q_j + offset."""
        total = self.value(offset)
        for j, n in turn:
            total = total + float(n) * self._q[j]
        return total

    def q(self, j: int) -> Scalar:
        return self._q[j]

    def qd(self, j: int) -> Scalar:
        return self._qd[j]

    def qdd(self, j: int) -> Scalar:
        return self._qdd[j]

    def channel(self, name: str) -> Scalar:
        return self.constants[name]

    def rate(self, u: int, i: int) -> Scalar:
        return self._rate[u, i]

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        angle = self.angle(turn, offset)
        return np.cos(angle), np.sin(angle)

    def sign(self, rate: Scalar, row: object) -> Scalar:
        return np.sign(rate)

    def function(self, op: str, *operands: Scalar) -> Scalar:
        return ON_ARRAYS[op](*operands)

    def one_sided(self, rate: Scalar, row: object, when: str) -> tuple[Scalar, Scalar]:
        limit = np.maximum if when == "positive" else np.minimum
        return limit(np.sign(rate), 0), limit(rate, 0)
