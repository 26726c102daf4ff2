"""Rotations, displacements and poses of the frames of a robot.

    iRj = A_j Rot(z, theta_j),   A_j = Rot(z, gamma_j) Rot(x, alpha_j),
            P_ij = b e3 + d A_j e1 + r A_j e3

Consecutive parallel axes (alpha = 0) are one rotation by the sum of their angles. The *carrier* of
frame j is the last frame m before j whose z axis is not parallel to z_j, and mRj = A Rot(z, sum of
angles). Angular velocities, joint axes and the axes of the root in a pose, which only rotate, are
transformed from the carrier in one step, which gives factors such as C23 and S23. Any other vector
is transformed from carrier to carrier too, and by one rotation about z between frames with parallel
z axes. So the formulas have cosines of sums and differences of angles instead of products of
cosines.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from symgen.derive.algebra import (
    E3,
    IDENTITY,
    ZERO3,
    GraphAlgebra,
    Matrix,
    Scalar,
    Vector,
    array,
    cross,
    dot,
    is_zero,
)
from symgen.derive.closure import Closure
from symgen.derive.graph import Turn
from symgen.description.expression import Expression, call
from symgen.description.robot import PRISMATIC, REVOLUTE, Frame, Robot


class Rotation(NamedTuple):
    """The rotation iRj = A Rot(z, theta) of frame j in frame i, with a constant matrix A.

    Attributes
    ----------
    A : Matrix or None
        Rot(z, gamma) Rot(x, alpha); None for the identity.
    c, s : Scalar
        cos theta and sin theta.
    """

    A: Matrix | None
    c: Scalar
    s: Scalar

    def up(self, v: Vector) -> Vector:
        """Transform a vector v from outer frame j to inner frame i: A Rot(z, theta) v."""
        u = array((self.c * v[0] - self.s * v[1], self.s * v[0] + self.c * v[1], v[2]))
        return u if self.A is None else self.A @ u

    def down(self, v: Vector) -> Vector:
        """Transform a vector v from inner frame i to outer frame j: (A Rot(z, theta))' v."""
        u = v if self.A is None else self.A.T @ v
        return array((self.c * u[0] + self.s * u[1], self.c * u[1] - self.s * u[0], u[2]))


class Carrier(NamedTuple):
    """Frame m before a series of parallel joint axes up to frame j, and the rotation from m to j.

    All joint axes after frame m, up to joint j, are parallel, so that their angles add up.

    Attributes
    ----------
    m : int
        Number of frame m.
    rotation : Rotation
        mRj.
    turn : Turn
        The angle about z_j: pairs (independent joint, multiple).
    """

    m: int
    rotation: Rotation
    turn: Turn


def axis_rotation(cg: Scalar, sg: Scalar, ca: Scalar, sa: Scalar) -> Matrix:
    """Return A = Rot(z, gamma) Rot(x, alpha) from cosines and sines of gamma and alpha."""
    return array(((cg, -(sg * ca), sg * sa), (sg, cg * ca, -(cg * sa)), (0, sa, ca)))


def displacement(A: Matrix, b: Scalar, d: Scalar, r: Scalar) -> Vector:
    """Return the origin of frame j in frame i, P_ij = b e3 + d A e1 + r A e3."""
    return array((d * A[0][0] + r * A[0][2], d * A[1][0] + r * A[1][2], b + r * A[2][2]))


class Geometry:
    """Rotations and positions of the frames of a robot, as nodes of the expression graph.

    If `root` is not the base, only the frames mounted on frame `root` are included.
    """

    def __init__(
        self, robot: Robot, algebra: GraphAlgebra, closure: Closure, root: int = 0
    ) -> None:
        self.robot, self.algebra, self.closure, self.root = robot, algebra, closure, root
        self.rotation: dict[int, Rotation] = {}
        self.P: dict[int, Vector] = {}  # P_ij, origin of frame j in frame i = ant(j)
        self.carrier: dict[int, Carrier] = {}
        self.turn: dict[int, tuple[Turn, Expression]] = {}  # angle from the carrier to frame j
        for f in robot.frames:
            if root in (0, *robot.path(f.ant)):
                self._frame(f)

    def _frame(self, f: Frame) -> None:
        algebra, j = self.algebra, f.j
        ca, sa = (
            algebra.name(algebra.constant(call(trig, f.alpha)), f"{trig[0].upper()}A{j}")
            for trig in ("cos", "sin")
        )
        cg, sg = (
            algebra.name(algebra.constant(call(trig, f.gamma)), f"{trig[0].upper()}G{j}")
            for trig in ("cos", "sin")
        )
        A = axis_rotation(cg, sg, ca, sa)
        turn: Turn = ()
        offset = f.theta0
        if f.sigma == REVOLUTE:
            turn, constant = self.closure.turn(j)
            offset = offset + constant
        parallel = not f.alpha
        if parallel:
            offset = offset + f.gamma
        self.rotation[j] = self._rotation(None if parallel else A, turn, offset)
        b, d, r = algebra.constant(f.b), algebra.constant(f.d), algebra.constant(f.r0)
        if f.sigma == PRISMATIC:
            r = algebra.name(r + self.position(j), f"r{j}")
        self.P[j] = displacement(A, b, d, r)
        if parallel and f.ant != self.root:
            inner = self.carrier[f.ant]
            turn, offset = summed(self.turn[f.ant][0] + turn), self.turn[f.ant][1] + offset
            self.carrier[j] = Carrier(inner.m, self._rotation(inner.rotation.A, turn, offset), turn)
        else:
            self.carrier[j] = Carrier(f.ant, self.rotation[j], turn)
        self.turn[j] = (turn, offset)

    def _rotation(self, A: Matrix | None, turn: Turn, offset: Expression) -> Rotation:
        c, s = self.algebra.cos_sin(turn, offset)
        return Rotation(A, c, s)

    def position(self, j: int) -> Scalar:
        """Return the position q_j of any moving joint as a function of the independent joints."""
        q = {i: self.algebra.q(i) for i in self.closure.row[j]}
        return self.algebra.linear(self.closure.row[j], q) + self.algebra.constant(
            self.closure.offset[j]
        )

    def from_carrier(self, j: int, v: Vector) -> Vector:
        """Transform a vector from frame m of `Carrier` (before the parallel axes) to frame j."""
        return v if is_zero(v) else self.carrier[j].rotation.down(v)


def summed(turn: Turn) -> Turn:
    """Add up the multiples of each joint in pairs (joint, multiple); sort, and drop zero sums."""
    total: dict[int, int | Fraction] = {}
    for j, n in turn:
        total[j] = total.get(j, 0) + n
    return tuple((j, n) for j, n in sorted(total.items()) if n)


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
        """Return the vector from the origin of frame i to the origin of frame j, in frame
        `seen_from`.
        """
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
