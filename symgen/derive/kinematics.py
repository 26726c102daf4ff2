"""Frames in frame 0, or in another root: orientation A_0j and origin P_0j of every declared frame.

Row k of A_0j is the axis e_k of the root in components of frame j: it only rotates, so it is taken
from the carrier in one step.
"""

from __future__ import annotations

from symgen.derive.geometry import Geometry
from symgen.derive.names import Names
from symgen.derive.scalar import ZERO3, Matrix, Vector, add, dot

IDENTITY: Matrix = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def frame_poses(geometry: Geometry) -> dict[int, tuple[Matrix, Vector]]:
    """{j: (A_0j, P_0j)} in the root of `geometry`, its own included unless it is the base."""
    algebra, named = geometry.algebra, Names(len(geometry.robot.frames))
    root = geometry.root
    own = (root,) if root else ()
    pose: dict[int, tuple[Matrix, Vector]] = {root: (IDENTITY, ZERO3)}
    for f in (geometry.robot.frame(j) for j in geometry.carrier):
        algebra.section(f"Frame {f.j}")
        carrier, (A_0i, P_0i) = pose[geometry.carrier[f.j].m][0], pose[f.ant]
        rows = (geometry.carrier[f.j].rotation.down(row) for row in carrier)
        A = tuple(
            tuple(algebra.name(x, named("R", k, m, f.j, *own)) for m, x in enumerate(row, 1))
            for k, row in enumerate(rows, 1)
        )
        P = tuple(
            algebra.name(add(P_0i[k], dot(A_0i[k], geometry.P[f.j])), named("P", k + 1, f.j, *own))
            for k in range(3)
        )
        pose[f.j] = (A, P)  # type: ignore[assignment]
    pose.pop(0, None)
    return pose
