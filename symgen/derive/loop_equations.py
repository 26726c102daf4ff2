"""The closure equations of general loops: as many as there are tied joints, with Jacobian and
curvature, over any algebra.

`equations` are the rows of `loop_residual.residuals` that determine the tied joints best at the
start configuration. Then

    r(q) = 0 ,    J qd = 0 ,    J qdd + Jd qd = 0 .
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from symgen.derive.closure import Closure
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.jets import Jet, JetAlgebra, jet
from symgen.derive.loop_residual import Array, differences, loop_ends, newton, residuals
from symgen.derive.loops import close
from symgen.derive.scalar import Algebra, Scalar, dot
from symgen.description.robot import REVOLUTE, Robot

PACE = 0.2, 0.25  # rad, or of the longest length: steps of actuated and of tied joints
TURN_STEPS, TURN_CLOSED = 72, 1e-4  # of a full turn of the crank, and residual after each


@dataclass(frozen=True)
class LoopSystem:
    """The closure equations of a robot with tied joints.

    Arrays q hold the independent joints in the last axis: n actuated, then m tied.

    Attributes
    ----------
    robot : Robot
        The mechanism.
    closure : Closure
        Its joints in the independent ones.
    equations : tuple of int
        Rows of `residuals` that are used, as many as there are tied joints.
    """

    robot: Robot
    closure: Closure
    equations: tuple[int, ...]

    @property
    def start(self) -> Array:
        """The independent joints at the start configuration."""
        return np.array([self.closure.start[j] for j in self.closure.independent])

    @property
    def tied(self) -> slice:
        """Places of the tied joints among the independent ones."""
        return slice(len(self.robot.joints), len(self.closure.independent))

    def residual(self, algebra: Algebra) -> list[Scalar]:
        """r(q)."""
        rows = residuals(self.robot, algebra, self.closure)
        return [rows[k] for k in self.equations]

    def alignment(self, algebra: Algebra) -> list[Scalar]:
        """Trace of A_cut' A_twin: 3 where a loop closes, -1 half a turn from there, where the axial
        vector is zero too.

        Of the loops alone whose cut joint is tied: where it is a sum of angles, the orientations
        agree by construction.
        """
        ends = loop_ends(self.robot, algebra, self.closure)
        return [
            dot([x for row in A for x in row], [x for row in B for x in row])
            for loop, ((A, _), (B, _)) in zip(self.robot.loops, ends, strict=True)
            if loop.cut in self.closure.tied
        ]

    def jacobian(self, algebra: Algebra) -> list[list[Scalar]]:
        """[equation][independent joint]."""
        columns = [self._jets(algebra, {i: 1}) for i in self.closure.independent]
        return [[row.xd for row in rows] for rows in zip(*columns, strict=True)]

    def curvature(self, algebra: Algebra) -> list[Scalar]:
        """Jd qd."""
        rates = {i: algebra.qd(i) for i in self.closure.independent}
        return [row.xdd for row in self._jets(algebra, rates)]

    def _jets(self, algebra: Algebra, rates: Mapping[int, Scalar]) -> list[Jet]:
        """r(q) with its derivatives along the rates."""
        along: Any = JetAlgebra(algebra, rates)
        rows = residuals(self.robot, along, self.closure)
        return [jet(rows[k]) for k in self.equations]

    def floats(self, q: Array) -> FloatAlgebra:
        """The algebra of floats at q."""
        joints = zip(self.closure.independent, np.moveaxis(q, -1, 0), strict=True)
        return FloatAlgebra(self.robot, dict(joints))

    def residual_floats(self, q: Array) -> Array:
        """r (..., m)."""
        rows = self.residual(self.floats(q))
        return np.stack([np.broadcast_to(x, q.shape[:-1]) for x in rows], axis=-1)

    def jacobian_floats(self, q: Array) -> Array:
        """J (..., m, n + m)."""
        rows = self.jacobian(self.floats(q))
        J = np.array([[np.broadcast_to(x, q.shape[:-1]) for x in row] for row in rows])
        return np.moveaxis(J, (0, 1), (-2, -1))

    def closed(self, q: Array, *, steps: int, tolerance: float) -> Array:
        """q with tied joints near those given that close the loops, if Newton finds them."""
        return newton(self.residual_floats, q, self.tied, steps=steps, tolerance=tolerance)

    def mode(self) -> float:
        """Sign of det J_u at the start: it stays as long as the mechanism passes no dead point,
        hence in one assembly mode.
        """
        return float(np.sign(np.linalg.det(self.jacobian_floats(self.start)[:, self.tied])))

    def pace(self) -> float:
        """A step of the actuated joints in which no tied one moves far, as fast as at the start
        (PACE); in rad, and in the longest length for slides.
        """
        J = self.jacobian_floats(self.start)
        n, frames = self.tied.start, map(self.robot.frame, self.closure.independent)
        units = np.array([1.0 if f.sigma == REVOLUTE else self.robot.longest for f in frames])
        G = np.linalg.solve(J[:, n:], J[:, :n]) * units[:n] / units[n:, None]
        return float(min(PACE[0], PACE[1] / np.abs(G).max()))

    def turn(self) -> tuple[int, ...] | None:
        """Whole turns of the tied joints per turn of the actuated one; None where it cannot turn
        fully or is not the only one.
        """
        if [self.robot.frame(j).sigma for j in self.robot.joints] != [REVOLUTE]:
            return None
        q, mode = self.start, self.mode()
        for _ in range(TURN_STEPS):
            q[0] += 2 * np.pi / TURN_STEPS
            q = self.closed(q, steps=5, tolerance=TURN_CLOSED)
            r, J = differences(self.residual_floats, q, self.tied)
            if np.abs(r).max() > TURN_CLOSED or np.linalg.det(J) * mode <= 0:
                return None
        gained = (q - self.start)[self.tied]
        slides = [self.robot.frame(u).sigma != REVOLUTE for u in self.closure.tied]
        if (np.abs(gained[slides]) > 1e-6).any():
            return None
        return tuple(np.round(gained / (2 * np.pi)).astype(int).tolist())


@lru_cache(maxsize=64)
def loop_system(robot: Robot) -> LoopSystem:
    """Choose the equations: pivoted elimination of their Jacobian in the tied joints at the start
    configuration.
    """
    closure = close(robot)
    rows = LoopSystem(robot, closure, tuple(range(6 * len(robot.loops))))
    J = rows.jacobian_floats(rows.start)[:, rows.tied]
    equations: list[int] = []
    for _ in closure.tied:
        row = int(np.argmax(np.linalg.norm(J, axis=1)))
        equations.append(row)
        direction = J[row] / np.linalg.norm(J[row])
        J = J - np.outer(J @ direction, direction)
    return LoopSystem(robot, closure, tuple(sorted(equations)))
