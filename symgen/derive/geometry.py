"""Rotations and displacements between the frames of a robot.

    iRj = A_j Rot(z, theta_j),   A_j = Rot(z, gamma_j) Rot(x, alpha_j),
            P_ij = b e3 + d A_j e1 + r A_j e3

Consecutive parallel axes (alpha = 0) are one rotation by the sum of their angles. The *carrier* of
frame j is the last frame m before j whose z axis is not parallel to z_j, and
mRj = A Rot(z, sum of angles). Angular velocities and joint axes, which only rotate, are transformed
from the carrier in one step: from there are C23 and S23.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from symgen.derive.algebra import (
    GraphAlgebra,
    Matrix,
    Scalar,
    Vector,
    array,
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
