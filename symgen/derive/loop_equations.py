"""The closure equations of general loops: as many as there are tied joints, with Jacobian and curvature.

`equations` are the rows of `assembly.residuals` that determine the tied joints best at the start configuration. Then

    r(q) = 0 ,    J qd = 0 ,    J qdd + Jd qd = 0 .

J and Jd qd are the first and second time derivatives of the nodes of r: along the unit rate of each joint, and along qd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from symgen.derive.assembly import Array, differences, loop_ends, newton, residuals
from symgen.derive.closure import Closure
from symgen.derive.derivation import Derivation, derive
from symgen.derive.floats import Floats, states_of
from symgen.derive.graph import Symbol, interpret, rates
from symgen.derive.scalar import Scalar, dot
from symgen.description.robot import REVOLUTE, Robot

IN_METRES = 0.01  # m: mechanisms in which no length is above are closed to 1e-16 m
PACE = 0.2, 0.25  # rad, or of the longest length: steps of actuated and of tied joints
TURN_STEPS, TURN_CLOSED = 72, 1e-4  # of a full turn of the crank, and residual after each


@dataclass(frozen=True)
class LoopSystem:
    """The closure equations of a robot with tied joints.

    Arrays q hold the independent joints in the last axis: n actuated, then m tied.

    Attributes
    ----------
    derivation : Derivation
        Of the mechanism; the equations are nodes of its graph.
    equations : tuple of int
        Rows of `residuals` that are used, as many as there are tied joints.
    """

    derivation: Derivation
    equations: tuple[int, ...]

    @property
    def robot(self) -> Robot:
        return self.derivation.robot

    @property
    def closure(self) -> Closure:
        """Each joint as a function of the independent joints."""
        return self.derivation.closure

    @property
    def start(self) -> Array:
        """The independent joints at the start configuration."""
        return np.array([self.closure.start[j] for j in self.closure.independent])

    @property
    def tied(self) -> slice:
        """Places of the tied joints among the independent ones."""
        return slice(len(self.robot.joints), len(self.closure.independent))

    @cached_property
    def rows(self) -> list[Scalar]:
        """All rows of `residuals`."""
        geometry = self.derivation.geometry
        return residuals(geometry.robot, geometry.algebra, geometry.closure)

    @cached_property
    def residual(self) -> list[Scalar]:
        """r(q)."""
        return [self.rows[k] for k in self.equations]

    @cached_property
    def jacobian(self) -> list[list[Scalar]]:
        """[equation][independent joint]."""
        columns = [rates(self.rows, {Symbol("q", f"q{i}"): 1}) for i in self.closure.independent]
        return [[column[k] for column in columns] for k in self.equations]

    @cached_property
    def curvature(self) -> list[Scalar]:
        """Jd qd."""
        qd = self.derivation.algebra.qd
        along = {Symbol("q", f"q{i}"): qd(i) for i in self.closure.independent}
        return rates(rates(self.residual, along), along)

    @cached_property
    def alignment(self) -> list[Scalar]:
        """Trace of A_cut' A_twin: 3 where a loop closes, -1 half a turn from there, where the axial vector is zero too.

        Of the loops alone whose cut joint is tied: where it is a sum of angles, the orientations
        agree by construction.
        """
        geometry = self.derivation.geometry
        ends = loop_ends(geometry.robot, geometry.algebra, geometry.closure)
        return [
            dot([x for row in A for x in row], [x for row in B for x in row])
            for loop, ((A, _), (B, _)) in zip(self.robot.loops, ends, strict=True)
            if loop.cut in self.closure.tied
        ]

    def floats(self, outputs: Sequence[Scalar], q: Array, qd: Array | None = None) -> Array:
        """Values at states q (..., independent) of nodes, (..., outputs)."""
        states = {"q": q} | ({} if qd is None else {"qd": qd})
        by_joint = {
            kind: dict(zip(self.closure.independent, np.moveaxis(x, -1, 0), strict=True))
            for kind, x in states.items()
        }
        values = interpret(outputs, Floats(self.robot, states_of(**by_joint)))
        return np.stack([np.broadcast_to(x, q.shape[:-1]) for x in values], axis=-1)

    def residual_floats(self, q: Array) -> Array:
        """r (..., m)."""
        return self.floats(self.residual, q)

    def jacobian_floats(self, q: Array) -> Array:
        """J (..., m, n + m)."""
        J = self.floats([x for row in self.jacobian for x in row], q)
        return J.reshape(*q.shape[:-1], len(self.equations), -1)

    def closed(self, q: Array, *, steps: int, tolerance: float) -> Array:
        """q with tied joints near those given that close the loops, if Newton finds them."""
        return newton(self.residual_floats, q, self.tied, steps=steps, tolerance=tolerance)

    def mode(self) -> float:
        """Sign of det J_u at the start: it stays as long as the mechanism passes no dead point, hence in one assembly mode."""
        return float(np.sign(np.linalg.det(self.jacobian_floats(self.start)[:, self.tied])))

    @property
    def units(self) -> tuple[float, ...]:
        """Size of a motion of each independent joint: 1 rad, or the longest length for slides."""
        frames = map(self.robot.frame, self.closure.independent)
        return tuple(1.0 if f.sigma == REVOLUTE else self.robot.longest for f in frames)

    @property
    def tolerance(self) -> float:
        """Largest residual, m or rad, at which emitted code calls the loops closed."""
        return 1e-13 if self.robot.longest > IN_METRES else 1e-16

    def pace(self) -> float:
        """A step of the actuated joints in which no tied one moves far, as fast as at the start (PACE); in rad, and in the longest length for slides."""
        J = self.jacobian_floats(self.start)
        n = self.tied.start
        units = np.array(self.units)
        G = np.linalg.solve(J[:, n:], J[:, :n]) * units[:n] / units[n:, None]
        return float(min(PACE[0], PACE[1] / np.abs(G).max()))

    def turn(self) -> tuple[int, ...] | None:
        """Whole turns of the tied joints per turn of the actuated one.

        None if it cannot turn fully or is not the only one.
        """
        if [self.robot.frame(j).sigma for j in self.robot.joints] != [REVOLUTE]:
            return None
        q = self.start
        mode = self.mode()
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
    """Choose the equations: pivoted elimination of their Jacobian in the tied joints at the start configuration."""
    d = derive(robot)
    closure = d.closure
    rows = LoopSystem(d, tuple(range(6 * len(robot.loops))))
    J = rows.jacobian_floats(rows.start)[:, rows.tied]
    equations: list[int] = []
    for _ in closure.tied:
        row = int(np.argmax(np.linalg.norm(J, axis=1)))
        equations.append(row)
        direction = J[row] / np.linalg.norm(J[row])
        J = J - np.outer(J @ direction, direction)
    return LoopSystem(d, tuple(sorted(equations)))
