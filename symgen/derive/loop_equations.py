"""The closure equations of general loops: as many as there are tied joints, with Jacobian and curvature, over any algebra.

Loop: 0T_cut = 0T_twin. Residuals are the three components of P_cut - P_twin in frame 0 and of the axial vector of A_cut' A_twin (zero where the
orientations agree); `equations` are the rows of these that determine the tied joints best at the start configuration. Then

    r(q) = 0 ,    J qd = 0 ,    J qdd + Jd qd = 0 .
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symgen.derive.closure import Closure
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.jets import JetAlgebra, jet
from symgen.derive.kinematics import frame_poses
from symgen.derive.loops import close
from symgen.derive.scalar import Algebra, Scalar, dot, sub
from symgen.description.robot import REVOLUTE, Robot

Array = np.ndarray
TURN_STEPS = 72  # of a full turn of the crank


def residuals(robot: Robot, algebra: Algebra, closure: Closure) -> list[Scalar]:
    """All residuals of all loops, six each."""
    pose = frame_poses(Geometry(robot, algebra, closure))
    rows: list[Scalar] = []
    for loop in robot.loops:
        algebra.section(f"Loop: frame {loop.twin} on frame {loop.cut}")
        (A, P), (B, Q) = pose[loop.cut], pose[loop.twin]
        rows += [sub(P[k], Q[k]) for k in range(3)]
        C = [[dot([A[k][m] for k in range(3)], [B[k][n] for k in range(3)]) for n in range(3)] for m in range(3)]
        rows += [sub(C[2][1], C[1][2]), sub(C[0][2], C[2][0]), sub(C[1][0], C[0][1])]
    return rows


@dataclass(frozen=True)
class LoopSystem:
    """The closure equations of a robot with tied joints.

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

    def residual(self, algebra: Algebra) -> list[Scalar]:
        """r(q)."""
        rows = residuals(self.robot, algebra, self.closure)
        return [rows[k] for k in self.equations]

    def alignment(self, algebra: Algebra) -> list[Scalar]:
        """Trace of A_cut' A_twin: 3 where a loop closes, -1 half a turn from there, where the axial vector is zero too.

        Of the loops alone whose cut joint is tied: where it is a sum of angles, the orientations agree by construction.
        """
        pose = frame_poses(Geometry(self.robot, algebra, self.closure))
        rotations = [(pose[loop.cut][0], pose[loop.twin][0]) for loop in self.robot.loops if loop.cut in self.closure.tied]
        return [dot([x for row in A for x in row], [x for row in B for x in row]) for A, B in rotations]

    def jacobian(self, algebra: Algebra) -> list[list[Scalar]]:
        """[equation][independent joint]."""
        columns = []
        for i in self.closure.independent:
            rows = residuals(self.robot, JetAlgebra(algebra, {i: 1}), self.closure)
            columns.append([jet(rows[k]).xd for k in self.equations])
        return [list(row) for row in zip(*columns, strict=True)]

    def curvature(self, algebra: Algebra) -> list[Scalar]:
        """Jd qd."""
        rows = residuals(self.robot, JetAlgebra(algebra, {i: algebra.qd(i) for i in self.closure.independent}), self.closure)
        return [jet(rows[k]).xdd for k in self.equations]

    def linearised(self, q: Mapping[int, float]) -> tuple[Array, Array]:
        """Residuals (m,) and their derivatives by the tied joints (m, m), in floats."""
        algebra, joints = FloatAlgebra(self.robot, {j: np.asarray(x) for j, x in q.items()}), self.closure.independent
        rows = residuals(
            self.robot, JetAlgebra(algebra, dict(zip(joints, np.eye(len(joints)), strict=True))), self.closure
        )  # all columns at once
        used = [jet(rows[k]) for k in self.equations]
        J = np.array([np.broadcast_to(row.xd, len(joints)) for row in used], dtype=float)
        return np.array([float(row.x) for row in used]), J[:, len(self.robot.joints) :]

    def mode(self) -> float:
        """Sign of det J_u at the start: it stays as long as the mechanism passes no dead point, hence in one assembly mode."""
        return float(np.sign(np.linalg.det(self.linearised(self.closure.start)[1])))

    def turn(self) -> tuple[int, ...] | None:
        """Whole turns of the tied joints per turn of the actuated one; None where it cannot turn fully or is not the only one."""
        (j, *more), tied = self.robot.joints, self.closure.tied
        if more or self.robot.frame(j).sigma != REVOLUTE:
            return None
        q, mode = {i: self.closure.start[i] for i in self.closure.independent}, self.mode()
        for _ in range(TURN_STEPS):
            q[j] += 2 * np.pi / TURN_STEPS
            for _ in range(5):
                r, J = self.linearised(q)
                q |= {u: q[u] - dx for u, dx in zip(tied, np.linalg.solve(J + 1e-14 * np.eye(len(tied)), r), strict=True)}
                if np.abs(r).max() < 1e-4:  # the next turn goes on from here
                    break
            if np.abs(r).max() > 1e-4 or np.linalg.det(J) * mode <= 0:
                return None
        gained = {u: q[u] - self.closure.start[u] for u in tied}
        if any(self.robot.frame(u).sigma != REVOLUTE and abs(x) > 1e-6 for u, x in gained.items()):
            return None
        return tuple(round(x / (2 * np.pi)) for x in gained.values())


@lru_cache(maxsize=64)
def loop_system(robot: Robot) -> LoopSystem:
    """Choose the equations: pivoted elimination of their Jacobian in the tied joints at the start configuration."""
    closure = close(robot)
    J = LoopSystem(robot, closure, tuple(range(6 * len(robot.loops)))).linearised(closure.start)[1]
    equations: list[int] = []
    for _ in closure.tied:
        row = int(np.argmax(np.linalg.norm(J, axis=1)))
        equations.append(row)
        direction = J[row] / np.linalg.norm(J[row])
        J = J - np.outer(J @ direction, direction)
    return LoopSystem(robot, closure, tuple(sorted(equations)))
