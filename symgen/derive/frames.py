"""Poses of all frames of a robot in a root frame, and vectors between any two frames.

Row k of A_0j is the axis e_k of the root in components of frame j. It only rotates, so it is
transformed from the carrier in one step (see `derive.geometry`). Any other vector is transformed
from carrier to carrier too, and by one rotation about z between frames with parallel z axes. So the
formulas have cosines of sums and differences of angles instead of products of cosines.
"""

from __future__ import annotations

from symgen.derive.algebra import (
    E3,
    IDENTITY,
    ZERO3,
    GraphAlgebra,
    Matrix,
    Vector,
    array,
    cross,
    dot,
)
from symgen.derive.geometry import Geometry, Rotation, summed
from symgen.derive.graph import Turn
from symgen.description.expression import Expression
from symgen.description.robot import REVOLUTE


def frame_poses(geometry: Geometry) -> dict[int, tuple[Matrix, Vector]]:
    """Return {j: (A_0j, P_0j)}: orientation and origin of every frame j in the root frame.

    The root frame itself is included, unless it is the base.
    """
    algebra = geometry.algebra
    root = geometry.root
    own = (root,) if root else ()
    pose: dict[int, tuple[Matrix, Vector]] = {root: (IDENTITY, ZERO3)}
    for f in (geometry.robot.frame(j) for j in geometry.carrier):
        algebra.section(f"Frame {f.j}")
        carrier, (A_0i, P_0i) = pose[geometry.carrier[f.j].m][0], pose[f.ant]
        rows = (geometry.carrier[f.j].rotation.down(row) for row in carrier)
        A = [
            [algebra.name(x, algebra.named("R", k, m, f.j, *own)) for m, x in enumerate(row, 1)]
            for k, row in enumerate(rows, 1)
        ]
        P = [P_0i[k] + dot(A_0i[k], geometry.P[f.j]) for k in range(3)]
        pose[f.j] = (array(A), algebra.vector("P", P, f.j, *own))
    pose.pop(0, None)
    return pose


Group = tuple[
    int, Expression, Expression
]  # carrier, and alpha and gamma of the first frame on it: frames with one z axis direction


class Frames:
    """Positions, directions and poses of the frames of a robot relative to any other frame."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry, self.robot = geometry, geometry.robot

    def rotated(self, v: Vector, j: int, i: int) -> Vector:
        """Transform the components v of a vector from frame j to frame i."""
        down: list[int] = []
        carrier, at, to = self.geometry.carrier, j, i
        while not self._parallel(at, to):
            if self._depth(at) >= self._depth(to):
                v, at = carrier[at].rotation.up(v), carrier[at].m
            else:
                down.append(to)
                to = carrier[to].m
        if at != to:
            v = self._about_z(at, to).up(v)
        for f in reversed(down):
            v = self.geometry.from_carrier(f, v)
        return v

    def position(self, j: int, i: int, seen_from: int) -> Vector:
        """Return the vector from the origin of frame i to that of frame j, in frame `seen_from`."""
        to, start = self.robot.path(j), self.robot.path(i)
        total = ZERO3
        for f in to:
            if f not in start:
                P = self.rotated(self.geometry.P[f], self.robot.frame(f).ant, seen_from)
                total = total + P
        for f in start:
            if f not in to:
                P = self.rotated(self.geometry.P[f], self.robot.frame(f).ant, seen_from)
                total = total - P
        return total

    def pose(self, j: int, i: int) -> tuple[Matrix, Vector]:
        """Return the orientation A_ij and the origin P_ij of frame j in frame i."""
        axes = array([self.rotated(e, j, i) for e in IDENTITY])
        return axes.T, self.position(j, i, i)

    def columns(self, j: int, i: int) -> dict[int, tuple[Vector, Vector]]:
        """Return the Jacobian of frame j in frame i: a column per moving joint from base to j.

        Column k is the pair (velocity of O_j, angular velocity of frame j) per unit rate of joint
        k.
        """
        result: dict[int, tuple[Vector, Vector]] = {}
        for k in self.robot.path(j):
            if k in self.robot.moving:
                z = self.rotated(E3, k, i)
                turns = self.robot.frame(k).sigma == REVOLUTE
                result[k] = (cross(z, self.position(j, k, i)), z) if turns else (z, ZERO3)
        return result

    def _depth(self, j: int) -> int:
        """Return the number of rotations from the base to frame j; parallel axes count as one."""
        depth = 0
        while j:
            j, depth = self.geometry.carrier[j].m, depth + 1
        return depth

    def _parallel(self, j: int, i: int) -> bool:
        return j == i or (bool(j) and bool(i) and self._group(j) == self._group(i))

    def _group(self, j: int) -> Group:
        m, f = self.geometry.carrier[j].m, self.robot.frame(j)
        while f.ant != m:
            f = self.robot.frame(f.ant)
        return (m, f.alpha, f.gamma if f.alpha else Expression())

    def _about_z(self, j: int, i: int) -> Rotation:
        """Return the rotation about z from frame i to frame j, whose z axes are parallel."""
        return Rotation(None, *self.geometry.algebra.cos_sin(*self._between(j, i)))

    def _between(self, j: int, i: int) -> tuple[Turn, Expression]:
        """Return pairs (k, n_k) and the constant c of the angle sum_k n_k q_k + c about z from
        frame i to j.
        """
        (turn, offset), (other, other_offset) = self.geometry.turn[j], self.geometry.turn[i]
        return summed((*turn, *((k, -n) for k, n in other))), offset - other_offset

    def register_angles(self, algebra: GraphAlgebra) -> None:
        """Add to the graph `algebra` the angles between all pairs of frames with parallel z axes.

        Each such angle, for instance q2 + q3, then has a cosine and a sine with a name.
        """
        for f in self.robot.frames:
            for g in self.robot.frames:
                if f.j < g.j and self._parallel(f.j, g.j):
                    algebra.cos_sin(*self._between(g.j, f.j))
