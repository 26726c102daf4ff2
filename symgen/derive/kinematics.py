"""Frames in frame 0: orientation A_0j and origin P_0j of every declared frame.

Row k of A_0j is the base axis e_k in components of frame j: it only rotates, so it is taken from
the carrier in one step.
"""

from __future__ import annotations

from symgen.derive.geometry import Geometry
from symgen.derive.names import Names
from symgen.derive.scalar import ZERO3, Matrix, Vector, add, dot

IDENTITY: Matrix = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def frame_poses(geometry: Geometry) -> dict[int, tuple[Matrix, Vector]]:
    """{j: (A_0j, P_0j)}."""
    algebra, named = geometry.algebra, Names(len(geometry.robot.frames))
    pose: dict[int, tuple[Matrix, Vector]] = {0: (IDENTITY, ZERO3)}
    for f in geometry.robot.frames:
        algebra.section(f"Frame {f.j}")
        carrier, (A_0i, P_0i) = pose[geometry.carrier[f.j].m][0], pose[f.ant]
        rows = (geometry.carrier[f.j].rotation.down(row) for row in carrier)
        A = tuple(
            tuple(algebra.name(x, named("R", k, m, f.j)) for m, x in enumerate(row, 1))
            for k, row in enumerate(rows, 1)
        )
        P = tuple(
            algebra.name(add(P_0i[k], dot(A_0i[k], geometry.P[f.j])), named("P", k + 1, f.j))
            for k in range(3)
        )
        pose[f.j] = (A, P)  # type: ignore[assignment]
    del pose[0]
    return pose
