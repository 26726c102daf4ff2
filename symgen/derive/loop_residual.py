"""The residual of closed loops as nodes of a graph, and Newton's method for it.

A loop closes where its cut frame and its twin coincide, rT_cut = rT_twin, r its root: the last
frame on the paths of both. `coincidence` says so by twelve differences; `residuals` by six, of
which the three of the orientation vanish half a turn away too: an equation for each freedom that a
loop takes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symgen.derive.closure import Closure
from symgen.derive.geometry import Geometry
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.kinematics import frame_poses
from symgen.derive.scalar import Matrix, Scalar, Vector, dot, sub
from symgen.description.robot import Robot

Array = np.ndarray
Pose = tuple[Matrix, Vector]
STEP, STALLED = 0.5, 12  # largest step, rad or m; steps without progress before Newton gives up
DIFFERENCE = 1e-6  # of central differences, rad or m
ALL = slice(None)


def loop_ends(robot: Robot, algebra: GraphAlgebra, closure: Closure) -> list[tuple[Pose, Pose]]:
    """Orientation and origin of the cut frame and of its twin in the root of their loop, which no
    joint before it turns, loop by loop.
    """
    roots = [robot.root(loop) for loop in robot.loops]
    pose = {root: frame_poses(Geometry(robot, algebra, closure, root)) for root in {*roots}}
    loops = zip(robot.loops, roots, strict=True)
    return [(pose[root][loop.cut], pose[root][loop.twin]) for loop, root in loops]


def coincidence(ends: list[tuple[Pose, Pose]]) -> list[Scalar]:
    """P_cut - P_twin and A_cut - A_twin, twelve entries a loop; zero where the frames coincide."""
    return [
        sub(x, y)
        for (A, P), (B, Q) in ends
        for u, v in zip((P, *A), (Q, *B), strict=True)
        for x, y in zip(u, v, strict=True)
    ]


def residuals(robot: Robot, algebra: GraphAlgebra, closure: Closure) -> list[Scalar]:
    """P_cut - P_twin and the axial vector of A_cut' A_twin, six entries a loop.

    Where the cut joint is no independent one, its angle is a sum of others and the orientations
    agree: zero without being looked at.
    """
    rows: list[Scalar] = []
    ends = loop_ends(robot, algebra, closure)
    for loop, ((A, P), (B, Q)) in zip(robot.loops, ends, strict=True):
        algebra.section(f"Loop: frame {loop.twin} on frame {loop.cut}")
        rows += [sub(P[k], Q[k]) for k in range(3)]
        if loop.cut in closure.independent:
            C = [[dot(u, v) for v in zip(*B, strict=True)] for u in zip(*A, strict=True)]
            rows += [sub(C[2][1], C[1][2]), sub(C[0][2], C[2][0]), sub(C[1][0], C[0][1])]
        else:
            rows += [0, 0, 0]
    return rows


def differences(
    residual: Callable[[Array], Array], q: Array, columns: slice | list[int] = ALL
) -> tuple[Array, Array]:
    """r (..., m) at q (..., n), and its derivatives by `columns` of q, (..., m, columns)."""
    units = DIFFERENCE * np.eye(q.shape[-1])[columns]
    n = len(units)
    r = residual(q[..., None, :] + np.concatenate([np.zeros((1, q.shape[-1])), units, -units]))
    J = (r[..., 1 : n + 1, :] - r[..., n + 1 :, :]) / (2 * DIFFERENCE)
    return r[..., 0, :], np.swapaxes(J, -1, -2)


def inertia_of(torque: Callable[[Array], Array], q: Array) -> Array:
    """A (..., n, n) of torques that are A qdd + b in qdd (..., n); q gives their shape."""
    rest = torque(0 * q)
    return np.stack([torque(0 * q + e) - rest for e in np.eye(q.shape[-1])], axis=-1)


def newton(
    residual: Callable[[Array], Array],
    q: Array,
    columns: slice | list[int] = ALL,
    *,
    steps: int,
    tolerance: float,
    rcond: float = 1e-9,
) -> Array:
    """Where r(q) = 0, from q (..., n), by steps of least squares of at most STEP in `columns`.

    A state ends early below the tolerance, or where STALLED steps make no progress, whatever states
    stand beside it. The caller looks at the residual where it ends.
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
