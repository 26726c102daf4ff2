"""The closure of all loops in floats: residuals, Newton's method, rates and mobility at a configuration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgen.derive.closure import open_tree
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.kinematics import frame_poses
from symgen.description.expression import ZERO, Expression
from symgen.description.forms import row_of
from symgen.description.robot import Loop, Robot
from symgen.errors import DescriptionError

Array = np.ndarray
STEPS, TOLERANCE = 60, 1e-11
STALLED = 12  # Newton steps without progress before a start is given up
Relations = Mapping[int, tuple[Mapping[int, Expression], Expression]]  # {joint: (row, constant)}
INDEPENDENT_MOTIONS = 1e-7  # singular values below, relative to the largest and to 1, are no constraint (differences are good to 1e-9)


def declared_relations(robot: Robot) -> dict[int, tuple[dict[int, Expression], Expression]]:
    """{j: (row, constant)} of the constraints of the file, in the joints that have none."""
    free = [i for i in robot.moving if i not in robot.constraints]
    relations = {}
    for j, e in robot.constraints.items():
        for _ in robot.constraints:
            e = e.substitute({f"q{i}": robot.constraints[i] for i in robot.constraints})
        if any(f"q{i}" in e.symbols for i in robot.constraints):
            raise DescriptionError(f"constraint on q{j} refers to itself: q{j} = {robot.constraints[j]}", path=("constraints", f"q{j}"))
        constant = e.substitute({f"q{i}": ZERO for i in free})
        try:
            relations[j] = (row_of(e - constant, tuple(free)), constant)
        except ValueError as error:
            raise DescriptionError(f"constraint q{j}: {error}", path=("constraints", f"q{j}")) from error
    return relations


class LoopEquations:
    """Closure of all loops in the moving joints that no constraint gives, by numbers."""

    def __init__(self, robot: Robot, relations: Relations) -> None:
        self.robot = robot
        self.free = tuple(j for j in robot.moving if j not in relations)
        self.active = tuple(j for j in self.free if j in robot.joints)
        self.unknown = tuple(j for j in self.free if j not in robot.joints)
        values = robot.constants
        self.rows = {j: ({i: g.value(values) for i, g in row.items()}, c.value(values)) for j, (row, c) in relations.items()}
        self.length = max([abs(e.value(values)) for f in robot.frames for e in (f.b, f.d, f.r0)] + [1e-3])

    def all(self, q: Mapping[int, Array]) -> dict[int, Array]:
        """All moving joints from the free ones."""
        return dict(q) | {j: sum((g * q[i] for i, g in row.items()), start=np.asarray(c)) for j, (row, c) in self.rows.items()}

    def configuration(self, q: Mapping[int, float]) -> dict[int, float]:
        """All moving joints of one solution."""
        return {j: float(x) for j, x in self.all({i: np.asarray(x) for i, x in q.items()}).items()}

    def closest(self) -> tuple[Loop, float, dict[int, float]]:
        """Over several descents in all joints: the loop that stays open widest, its residual, and where."""
        rng = np.random.default_rng(4)
        best, at = np.inf, dict.fromkeys(self.free, 0.0)
        for _ in range(8):
            q = {j: float(rng.uniform(-np.pi, np.pi)) for j in self.free}
            for _ in range(STEPS):
                r, J = self.linearised(q)
                step = np.linalg.lstsq(J, -r, rcond=1e-6)[0]
                q = {j: x + float(np.clip(dx, -0.5, 0.5)) for (j, x), dx in zip(q.items(), step, strict=True)}
            if self.gap(q) < best:
                best, at = self.gap(q), q
        loop = max(self.robot.loops, key=lambda loop: self.gap(at, loop))
        return loop, self.gap(at, loop), at

    def gap(self, q: Mapping[int, float], loop: Loop | None = None) -> float:
        """Largest element of the residual at one configuration."""
        return float(np.abs(self.residual({j: np.array([x]) for j, x in q.items()}, loop)).max(initial=0.0))

    def residual(self, q: Mapping[int, Array], loop: Loop | None = None) -> Array:
        """Difference of cut and twin frames, positions in units of the longest link, shape (equations, samples)."""
        pose = frame_poses(Geometry(self.robot, FloatAlgebra(self.robot, self.all(q)), open_tree(self.robot)))
        shape = np.shape(next(iter(q.values())))
        rows = []
        for loop_k in self.robot.loops if loop is None else (loop,):
            (A, P), (B, Q) = pose[loop_k.cut], pose[loop_k.twin]
            rows += [(P[k] - Q[k]) / self.length for k in range(3)]
            rows += [A[k][m] - B[k][m] for k in range(3) for m in range(3)]
        return np.array([np.broadcast_to(np.asarray(x, dtype=float), shape) for x in rows]).reshape(len(rows), *shape)

    def linearised(self, q: Mapping[int, float]) -> tuple[Array, Array]:
        """residual (equations,) and, by central differences, d residual / d free joints (equations, free)."""
        n, h = len(self.free), 1e-6
        steps = np.concatenate([np.zeros((1, n)), np.eye(n), -np.eye(n)]) * h
        r = self.residual({j: q[j] + steps[:, k] for k, j in enumerate(self.free)})
        return r[:, 0], (r[:, 1 : n + 1] - r[:, n + 1 :]) / (2 * h)

    def jacobian(self, q: Mapping[int, float]) -> Array:
        return self.linearised(q)[1]

    def solve(self, q: Mapping[int, float]) -> dict[int, float] | None:
        """Newton for the unknown joints from `q`; None where it does not close."""
        q = dict(q)
        columns = [self.free.index(j) for j in self.unknown]
        best, stalled = np.inf, 0
        for _ in range(STEPS):
            r, J = self.linearised(q)
            gap = float(np.abs(r).max(initial=0.0))
            if gap < TOLERANCE:
                return q
            best, stalled = (gap, 0) if gap < 0.95 * best else (best, stalled + 1)
            if stalled > STALLED:
                return None
            step = np.linalg.lstsq(J[:, columns], -r, rcond=1e-9)[0]
            scale = min(1.0, 0.5 / max(np.abs(step).max(initial=0.0), 1e-12))
            for j, dx in zip(self.unknown, step, strict=True):
                q[j] += scale * dx
        return q if self.gap(q) < 10 * TOLERANCE else None

    def rates(self, q: Mapping[int, float]) -> Array:
        """G, shape (unknown, active): rates of the unknown joints."""
        J = self.jacobian(q)
        a, u = [self.free.index(j) for j in self.active], [self.free.index(j) for j in self.unknown]
        return np.asarray(-np.linalg.lstsq(J[:, u], J[:, a], rcond=INDEPENDENT_MOTIONS)[0])

    def mobility(self, q: Mapping[int, float]) -> tuple[int, int]:
        """(freedoms of the mechanism, freedoms left with the actuators held)."""
        J = self.jacobian(q)
        u = [self.free.index(j) for j in self.unknown]
        return len(self.free) - _rank(J), len(u) - _rank(J[:, u])


def _rank(J: Array) -> int:
    if J.size == 0:
        return 0
    s = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(s > INDEPENDENT_MOTIONS * max(float(s[0]), 1.0)))
