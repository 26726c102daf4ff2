"""Closure equations of loops whose joint relations are not linear, with Jacobian and curvature.

A tied joint is a passive joint that only these equations relate to the actuated joints. The
equations are the entries of `assembly.residuals` that determine the tied joints best at the start
configuration. Then

    r(q) = 0 ,    J qd = 0 ,    J qdd + Jd qd = 0 .

J and Jd qd are the first and second time derivatives of the nodes of r: J along the unit rate of
each joint, Jd qd along qd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from symgen.derive.algebra import Scalar, dot
from symgen.derive.assembly import Array, differences, loop_ends, newton, residuals
from symgen.derive.closure import Closure
from symgen.derive.derivation import Derivation, derive
from symgen.derive.graph import Floats, Symbol, interpret, rates, states_of
from symgen.description.robot import REVOLUTE, Robot

IN_METRES = 0.01  # m: mechanisms in which no length is above are closed to 1e-16 m
PACE = 0.2, 0.25  # rad, or of the longest length: steps of actuated and of tied joints
TURN_STEPS, TURN_CLOSED = 72, 1e-4  # of a full turn of the crank, and residual after each


@dataclass(frozen=True)
class LoopSystem:
    """The closure equations of a robot whose joint relations are not linear, and their derivatives.

    A tied joint is a passive joint that only the closure equations relate to the actuated joints.
    Arrays q hold the independent joints in the last axis: n actuated, then m tied.

    Attributes
    ----------
    derivation : Derivation
        Derivation of the mechanism; the equations are nodes of its graph.
    equations : tuple of int
        Indices of the `residuals` that are used, as many as there are tied joints.
    """

    derivation: Derivation
    equations: tuple[int, ...]

    @property
    def robot(self) -> Robot:
        return self.derivation.robot

    @property
    def closure(self) -> Closure:
        """Every moving joint as a linear function of the independent joints."""
        return self.derivation.closure

    @property
    def start(self) -> Array:
        """Positions of the independent joints in the start configuration, rad or m."""
        return np.array([self.closure.start[j] for j in self.closure.independent])

    @property
    def tied(self) -> slice:
        """Slice that selects, in arrays q, the passive joints that only the closure equations
        determine.
        """
        return slice(len(self.robot.joints), len(self.closure.independent))

    @cached_property
    def rows(self) -> list[Scalar]:
        """All closure residuals, six for each loop, as nodes of the graph."""
        geometry = self.derivation.geometry
        return residuals(geometry.robot, geometry.algebra, geometry.closure)

    @cached_property
    def residual(self) -> list[Scalar]:
        """The closure residuals r(q), one for each tied joint, as graph nodes."""
        return [self.rows[k] for k in self.equations]

    @cached_property
    def jacobian(self) -> list[list[Scalar]]:
        """Jacobian dr/dq of the closure residuals r as nodes: a column per independent joint."""
        columns = [rates(self.rows, {Symbol("q", f"q{i}"): 1}) for i in self.closure.independent]
        return [[column[k] for column in columns] for k in self.equations]

    @cached_property
    def curvature(self) -> list[Scalar]:
        """Term Jd qd in the second derivative J qdd + Jd qd of the closure residuals, as nodes."""
        qd = self.derivation.algebra.qd
        along = {Symbol("q", f"q{i}"): qd(i) for i in self.closure.independent}
        return rates(rates(self.residual, along), along)

    @cached_property
    def alignment(self) -> list[Scalar]:
        """Trace of A_cut' A_twin per loop: 3 if the loop closes, -1 if half a turn from closing.

        A_cut and A_twin are the orientations of the two frames at the cut joint. The axial vector
        of A_cut' A_twin is zero in both cases. A loop whose cut joint is not tied is left out: at
        this joint, the angle is a sum of other angles, and the orientations always agree.
        """
        geometry = self.derivation.geometry
        ends = loop_ends(geometry.robot, geometry.algebra, geometry.closure)
        return [
            dot([x for row in A for x in row], [x for row in B for x in row])
            for loop, ((A, _), (B, _)) in zip(self.robot.loops, ends, strict=True)
            if loop.cut in self.closure.tied
        ]

    def floats(self, outputs: Sequence[Scalar], q: Array, qd: Array | None = None) -> Array:
        """Return the values of graph nodes at given q and qd, shape (..., outputs)."""
        states = {"q": q} | ({} if qd is None else {"qd": qd})
        by_joint = {
            kind: dict(zip(self.closure.independent, np.moveaxis(x, -1, 0), strict=True))
            for kind, x in states.items()
        }
        values = interpret(outputs, Floats(self.robot, states_of(**by_joint)))
        return np.stack([np.broadcast_to(x, q.shape[:-1]) for x in values], axis=-1)

    def residual_floats(self, q: Array) -> Array:
        """Compute the m closure residuals r at positions q in floating point, shape (..., m)."""
        return self.floats(self.residual, q)

    def jacobian_floats(self, q: Array) -> Array:
        """Compute the Jacobian dr/dq of the m closure residuals at q, shape (..., m, n + m)."""
        J = self.floats([x for row in self.jacobian for x in row], q)
        return J.reshape(*q.shape[:-1], len(self.equations), -1)

    def closed(self, q: Array, *, steps: int, tolerance: float) -> Array:
        """Return q with the dependent joints moved so that the loops close, by Newton's method.

        The tied joints start from their positions in q. The loops may stay open if the method
        fails.
        """
        return newton(self.residual_floats, q, self.tied, steps=steps, tolerance=tolerance)

    def mode(self) -> float:
        """Return the sign of det(dr/dq_tied) at the start, which identifies the assembly mode.

        r are the closure residuals, and q_tied are the joints that these equations determine. The
        sign stays the same until the mechanism passes a dead point, hence within one assembly mode.
        """
        return float(np.sign(np.linalg.det(self.jacobian_floats(self.start)[:, self.tied])))

    @property
    def units(self) -> tuple[float, ...]:
        """Scale of motion of each independent joint: 1 rad, or the longest link length if prismatic."""
        frames = map(self.robot.frame, self.closure.independent)
        return tuple(1.0 if f.sigma == REVOLUTE else self.robot.longest for f in frames)

    @property
    def tolerance(self) -> float:
        """Largest residual, m or rad, at which generated code accepts the loops as closed."""
        return 1e-13 if self.robot.longest > IN_METRES else 1e-16

    def pace(self) -> float:
        """Return a step of the actuated joints so small that no passive joint moves far.

        The step is computed from the rates at the start configuration and the limits in `PACE`, in
        rad or, for a prismatic joint, as a fraction of the longest length.
        """
        J = self.jacobian_floats(self.start)
        n = self.tied.start
        units = np.array(self.units)
        G = np.linalg.solve(J[:, n:], J[:, :n]) * units[:n] / units[n:, None]
        return float(min(PACE[0], PACE[1] / np.abs(G).max()))

    def turn(self) -> tuple[int, ...] | None:
        """Return the number of turns of each tied (dependent) joint per turn of the actuated joint.

        The result is None if the actuated joint cannot turn fully, is prismatic, or is not the only
        actuated joint.
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
    """Choose the closure equations that determine the dependent joints best at the start.

    The method is a pivoted elimination of the Jacobian of the tied joints: one equation per joint.
    """
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
