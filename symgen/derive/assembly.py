"""Closed kinematic loops: closure residuals, configurations that close the loops, mobility.

A loop closes where its cut frame and its twin coincide, rT_cut = rT_twin. Frame r is the root of
the loop: the last frame on the paths of both. `coincidence` has twelve differences between the two
frames. `residuals` has six, one for each freedom that a loop removes; the three of the orientation
are also zero at half a turn.

The free joints are the moving joints that no relation of the file gives. All moving joints are
q = N q_free + c.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from symgen.derive.algebra import GraphAlgebra, Matrix, Scalar, Vector, dot
from symgen.derive.closure import Closure, open_tree
from symgen.derive.geometry import Geometry, frame_poses
from symgen.derive.graph import Floats, interpret, states_of
from symgen.description.expression import ZERO, Expression
from symgen.description.parts import row_of
from symgen.description.robot import Loop, Robot
from symgen.errors import DescriptionError

Array = np.ndarray
Pose = tuple[Matrix, Vector]
STEP, STALLED = 0.5, 12  # largest step, rad or m; steps without progress before Newton gives up
DIFFERENCE = 1e-6  # of central differences, rad or m
ALL = slice(None)


def loop_ends(robot: Robot, algebra: GraphAlgebra, closure: Closure) -> list[tuple[Pose, Pose]]:
    """Return, for each loop, the poses of the two frames that must coincide at its cut joint.

    The first pose is that of the cut frame, the second that of its twin. Each pose is an
    orientation and an origin in the root frame of the loop. Joints before the root do not change
    these poses.
    """
    roots = [robot.root(loop) for loop in robot.loops]
    pose = {root: frame_poses(Geometry(robot, algebra, closure, root)) for root in {*roots}}
    loops = zip(robot.loops, roots, strict=True)
    return [(pose[root][loop.cut], pose[root][loop.twin]) for loop, root in loops]


def coincidence(ends: list[tuple[Pose, Pose]]) -> list[Scalar]:
    """Return twelve differences per loop between the poses of the two frames at its cut joint:
    three of position, nine of orientation.

    The differences are P_cut - P_twin and A_cut - A_twin.
    """
    return [
        x - y
        for (A, P), (B, Q) in ends
        for u, v in zip((P, *A), (Q, *B), strict=True)
        for x, y in zip(u, v, strict=True)
    ]


def residuals(robot: Robot, algebra: GraphAlgebra, closure: Closure) -> list[Scalar]:
    """Return six closure residuals for each loop: three of position and three of orientation.

    The residuals are P_cut - P_twin, and the axial vector of A_cut' A_twin. If the cut joint is not
    independent, its angle is a sum of other angles, and the orientations agree in all
    configurations: the last three entries are then 0.
    """
    rows: list[Scalar] = []
    ends = loop_ends(robot, algebra, closure)
    for loop, ((A, P), (B, Q)) in zip(robot.loops, ends, strict=True):
        algebra.section(f"Loop: frame {loop.twin} on frame {loop.cut}")
        rows += [P[k] - Q[k] for k in range(3)]
        if loop.cut in closure.independent:
            C = [[dot(u, v) for v in zip(*B, strict=True)] for u in zip(*A, strict=True)]
            rows += [C[2][1] - C[1][2], C[0][2] - C[2][0], C[1][0] - C[0][1]]
        else:
            rows += [0, 0, 0]
    return rows


def differences(
    residual: Callable[[Array], Array], q: Array, columns: slice | list[int] = ALL
) -> tuple[Array, Array]:
    """Return a residual r(q) and its derivatives dr/dq, computed by central differences.

    q has shape (..., n), r has shape (..., m). The derivatives by the `columns` of q have shape
    (..., m, columns).
    """
    units = DIFFERENCE * np.eye(q.shape[-1])[columns]
    n = len(units)
    r = residual(q[..., None, :] + np.concatenate([np.zeros((1, q.shape[-1])), units, -units]))
    J = (r[..., 1 : n + 1, :] - r[..., n + 1 :, :]) / (2 * DIFFERENCE)
    return r[..., 0, :], np.swapaxes(J, -1, -2)


def inertia_of(torque: Callable[[Array], Array], q: Array) -> Array:
    """Compute the inertia matrix A, shape (..., n, n), from a function that returns A qdd + b.

    Column i is torque(e_i) - torque(0) for the unit acceleration e_i; q only gives the shape of
    qdd.
    """
    n, samples = q.shape[-1], tuple(range(1, q.ndim))
    units = np.eye(n + 1, n, -1)  # zero, then the unit accelerations
    tau = torque(0 * q + np.expand_dims(units, samples))
    return np.moveaxis(tau[1:] - tau[0], 0, -1)


def newton(
    residual: Callable[[Array], Array],
    q: Array,
    columns: slice | list[int] = ALL,
    *,
    steps: int,
    tolerance: float,
    rcond: float = 1e-9,
) -> Array:
    """Solve r(q) = 0 by Newton's method with least-squares steps, from a start q (..., n).

    Only the `columns` of q change, by a limited step in each iteration. A state stops below the
    tolerance, or after some iterations without progress (`STALLED`), independently of the other
    states. The caller must check the residual at the end.
    """
    q, best, stalled = q.copy(), np.full(q.shape[:-1], np.inf), np.zeros(q.shape[:-1])
    going = np.ones(q.shape[:-1], dtype=bool)
    for _ in range(steps):
        r, J = differences(residual, q, columns)
        gap = np.abs(r).max(axis=-1, initial=0.0)
        best, stalled = (
            np.where(gap < 0.95 * best, gap, best),
            np.where(gap < 0.95 * best, 0, stalled + 1),
        )
        going &= (gap >= tolerance) & (stalled <= STALLED)
        if not going.any():
            break
        step = (np.linalg.pinv(J, rcond) @ r[..., None])[..., 0]
        longest = np.abs(step).max(axis=-1, initial=STEP, keepdims=True)
        q[..., columns] -= step * (STEP / longest) * going[..., None]
    return q


Relations = Mapping[int, tuple[Mapping[int, Expression], Expression]]  # {joint: (row, constant)}
STEPS, TOLERANCE = 60, 1e-11
DESCENTS = 8  # to the closest approach of loops that do not close
# singular values below, relative to the largest and to 1, are no constraint: differences are good
# to 1e-9
INDEPENDENT_MOTIONS = 1e-7


def declared_relations(robot: Robot) -> dict[int, tuple[dict[int, Expression], Expression]]:
    """Return the joint constraints of a robot file as linear relations q_j = sum_i n_ji q_i + c_j.

    The result is {j: (row, constant)}; the rows contain only joints without a constraint.
    """
    free = [i for i in robot.moving if i not in robot.constraints]
    relations = {}
    for j, e in robot.constraints.items():
        for _ in robot.constraints:
            e = e.substitute({f"q{i}": robot.constraints[i] for i in robot.constraints})
        if any(f"q{i}" in e.symbols for i in robot.constraints):
            raise DescriptionError(
                f"constraint on q{j} refers to itself: q{j} = {robot.constraints[j]}; write q{j} in joints without a constraint",
                path=("constraints", f"q{j}"),
            )
        constant = e.substitute({f"q{i}": ZERO for i in free})
        try:
            relations[j] = (row_of(e - constant, tuple(free)), constant)
        except ValueError as error:
            raise DescriptionError(
                f"constraint q{j}: {error}", path=("constraints", f"q{j}")
            ) from error
    return relations


@lru_cache(maxsize=16)
def open_loops(robot: Robot) -> list[Scalar]:
    """Return the pose differences of the two frames at the cut joint of each loop, as graph nodes.

    The differences are functions of all moving joints, each of which is independent here.
    """
    return coincidence(loop_ends(robot, GraphAlgebra(robot), open_tree(robot)))


class Assembly:
    """Numerical model of a mechanism with closed loops, which finds configurations that close the
    loops.

    A configuration q has shape (..., free joints), in the order of `free`: the moving joints
    without a relation.

    Parameters
    ----------
    robot : Robot
        The mechanism.
    relations : mapping
        {joint: (row, constant)} in the free joints.
    constants : mapping
        Values that replace constants of the robot file.
    """

    def __init__(
        self, robot: Robot, relations: Relations, constants: Mapping[str, float] | None = None
    ) -> None:
        self.robot, self.relations = robot, relations
        self.constants = {**robot.constants, **(constants or {})}
        self.free = tuple(j for j in robot.moving if j not in relations)
        self.active = [k for k, j in enumerate(self.free) if j in robot.joints]
        self.passive = [k for k, j in enumerate(self.free) if j not in robot.joints]
        self.N, self.c = np.zeros((len(robot.moving), len(self.free))), np.zeros(len(robot.moving))
        for k, j in enumerate(robot.moving):
            row, constant = relations.get(j, ({j: Expression.number(1)}, ZERO))
            self.c[k] = constant.value(self.constants)
            for i, g in row.items():
                self.N[k, self.free.index(i)] = g.value(self.constants)
        self.scale = np.array([1 / max(robot.longest, 1e-3)] * 3 + [1.0] * 9)

    @property
    def unknown(self) -> tuple[int, ...]:
        """Numbers of the passive joints for which the robot file declares no relation."""
        return tuple(self.free[k] for k in self.passive)

    def guess(self, start: Mapping[int, float], rng: np.random.Generator | None) -> Array:
        """Return start positions for the search for a configuration that closes the loops.

        Joints named in `start` have that position. All others have a random position, or a fixed
        one if there is no random generator.
        """
        drawn = (
            rng.uniform(-np.pi, np.pi, len(self.free))
            if rng
            else [0.3 + 0.1 * j for j in self.free]
        )
        return np.array([start.get(j, x) for j, x in zip(self.free, drawn, strict=True)])

    def configuration(self, q: Array) -> dict[int, float]:
        """Return {joint: position} of all moving joints; q are the positions of the joints without
        a relation.
        """
        return dict(zip(self.robot.moving, (self.N @ q + self.c).tolist(), strict=True))

    def residual(self, q: Array) -> Array:
        """Return, for each loop, twelve differences between the poses of the two frames at its cut
        joint, shape (..., loops, 12).

        Positions are divided by the longest length.
        """
        joints = dict(
            zip(self.robot.moving, np.moveaxis(q @ self.N.T + self.c, -1, 0), strict=True)
        )
        floats = Floats(self.robot, states_of(q=joints), self.constants)
        rows = interpret(open_loops(self.robot), floats)
        shape = (len(self.robot.loops), 12, *q.shape[:-1])
        r = np.array([np.broadcast_to(x, shape[2:]) for x in rows], dtype=float).reshape(shape)
        return np.asarray(np.moveaxis(r, (0, 1), (-2, -1)) * self.scale)

    def rows(self, q: Array) -> Array:
        """Return the pose differences of all loops as one vector, shape (..., 12 * loops)."""
        return self.residual(q).reshape(*q.shape[:-1], 12 * len(self.robot.loops))

    def gap(self, q: Array) -> float:
        """Return the largest absolute closure error of the loops at configuration q.

        Positions are divided by the longest length.
        """
        return float(np.abs(self.rows(q)).max(initial=0.0))

    def widest(self, q: Array) -> tuple[Loop, float]:
        """Return the loop with the largest closure error at configuration q, and this error."""
        gaps = np.abs(self.residual(q)).max(axis=-1)
        return self.robot.loops[int(gaps.argmax())], float(gaps.max())

    def closest(self) -> Array:
        """Find the configuration with the smallest closure error, for loops that may not close.

        The result is the best of several descents, in all free joints, from random configurations.
        """
        rng = np.random.default_rng(4)
        starts = rng.uniform(-np.pi, np.pi, (DESCENTS, len(self.free)))
        ends = [newton(self.rows, q, steps=STEPS, tolerance=0.0, rcond=1e-6) for q in starts]
        return min(ends, key=self.gap)

    def solve(self, q: Array) -> Array | None:
        """Return q with the passive joints moved so that the loops close; None if this fails."""
        closed = newton(self.rows, q, self.passive, steps=STEPS, tolerance=TOLERANCE)
        return closed if self.gap(closed) < 10 * TOLERANCE else None

    def rates(self, q: Array) -> Array:
        """Return dq_passive/dq_actuated at configuration q, shape (passive joints, actuated
        joints).
        """
        J = differences(self.rows, q)[1]
        return np.asarray(
            -np.linalg.lstsq(J[:, self.passive], J[:, self.active], rcond=INDEPENDENT_MOTIONS)[0]
        )

    def mobility(self, q: Array) -> tuple[int, int]:
        """Return two numbers of degrees of freedom at configuration q: with free actuators, and
        with blocked actuators.
        """
        J = differences(self.rows, q)[1]
        return len(self.free) - _rank(J), len(self.passive) - _rank(J[:, self.passive])


def _rank(J: Array) -> int:
    s = np.linalg.svd(J, compute_uv=False)
    return int(np.sum(s > INDEPENDENT_MOTIONS * s.max(initial=1.0)))
