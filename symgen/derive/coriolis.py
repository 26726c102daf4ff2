"""Coriolis matrix C(q, qd) by composite links, from the Christoffel symbols of inertia matrix A.

With these, Ad - 2C is skew symmetric. A mass point at r in frame j has the velocity rd = w_j x r
relative to the origin of the frame. For each composite link (a link with all links mounted on it),
the recursion of `derive.composite` also computes

    HP  = sum m rd         rate of the first moments
    BP  = sum m r rd'      3x3; of one link by rows, BP_a = w_j x K_a,
                           K = sum m r r' = tr(J)/2 E - J

from the tips to the base. With PP the velocity of O_j relative to O_i, all in frame i:

    BP_i <- BP_i + iRj BP_j jRi + P (iRj HP_j)' + (AS + MP_j P) PP'
    HP_i <- HP_i + iRj HP_j + MP_j PP
    PP    = w_i x P + qd_j z_j (prismatic)

Per unit rate of joint k, a point moves with z x r (revolute) or z (prismatic). The rate of change
of this velocity is zd x r + z x rd, or zd, with zd = w_k x z. The wrench of composite link k at
these rates, propagated to the base, is column k of C above the diagonal:

    E = zd x MSP + z x HP ,   NE = JP zd + tr(BP) z - BP' z       revolute
    E = MP zd ,               NE = MSP x zd                       prismatic

Below the diagonal, C_ki = x_k . (zd_i x r + z_i x rd) summed over the same points, x_k = z_k x r or
z_k. With F = sum m x_k, N = sum m r x x_k of the unit acceleration, and ND = sum m rd x x_k,
propagated to the base by ND_i = iRj ND_j + PP x F_i,

    C_ki = zd_i . N + z_i . ND (revolute) ,   zd_i . F (prismatic)

S. Echeandia, P. M. Wensing, J. Dyn. Sys. Meas. Control 143, 2021.
"""

from __future__ import annotations

from fractions import Fraction

from symgen.derive.algebra import (
    E3,
    Matrix,
    Scalar,
    Vector,
    array,
    cross,
    dot,
)
from symgen.derive.composite import CompositeLinks
from symgen.derive.derivation import Derivation, projected_twice
from symgen.derive.geometry import Rotation
from symgen.description.expression import Expression
from symgen.description.robot import FIXED, PRISMATIC

HALF = Expression.number(Fraction(1, 2))


class CompositeRates(CompositeLinks):
    """Sums HP of m rd and BP of m r rd' over the mass points of each link and of all links after
    it; m, r and rd are mass, position and velocity of a point.

    A composite link is a link with all links mounted on it. r is in the frame of the link, rd is
    relative to the origin of the frame.

    Parameters
    ----------
    d : Derivation
        The derivation, with the motion of its links.
    """

    def __init__(self, d: Derivation) -> None:
        super().__init__(d.geometry, d.chi)
        self.motion = d.motion
        self.HP: dict[int, Vector] = {}
        self.BP: dict[int, Matrix] = {}
        self.PP: dict[int, Vector] = {}
        for f in self.robot.frames:
            self._link(d, f.j)
            PP = cross(self.motion.link[f.ant].w, self.geometry.P[f.j])
            if f.sigma == PRISMATIC:
                PP = PP + self.geometry.rotation[f.j].up(E3) * self.motion.qd(f.j)
            self.PP[f.j] = self.algebra.vector("PP", PP, f.j)
        for f in reversed(self.robot.frames):
            self.algebra.section(f"Rates of composite link {f.j}")
            self.algebra.vector("HP", self.HP[f.j], f.j)
            for a, row in enumerate(self.BP[f.j], start=1):
                for b, x in enumerate(row, start=1):
                    self.algebra.name(x, self.named("BP", a, b, f.j))
            if f.ant:
                self._take_rates(f.j, f.ant)

    def _link(self, d: Derivation, j: int) -> None:
        """Compute the sums HP = sum m rd and BP = sum m r rd' over the points of link j alone; m, r
        and rd are the mass, position and velocity of a point.
        """
        w, half = self.motion.link[j].w, self.algebra.constant(HALF)
        XX, XY, XZ, YY, YZ, ZZ = self.own[j][:6]
        K = array(
            (
                (half * (YY + ZZ - XX), -XY, -XZ),
                (-XY, half * (XX + ZZ - YY), -YZ),
                (-XZ, -YZ, half * (XX + YY - ZZ)),
            )
        )
        self.HP[j] = cross(w, array(self.own[j][6:9]))
        self.BP[j] = array([cross(w, row) for row in K])

    def _take_rates(self, j: int, i: int) -> None:
        """Add the sums HP and BP of link j and all links after it to those of its antecedent i."""
        R, P, PP = self.geometry.rotation[j], self.geometry.P[j], self.PP[j]
        ABA, AH = turned(R, self.BP[j]), R.up(self.HP[j])
        moved = R.up(self.MSP[j]) + P * self.MP[j]
        rows = [self.BP[i][a] + (ABA[a] + (AH * P[a] + PP * moved[a])) for a in range(3)]
        self.BP[i] = array(rows)
        self.HP[i] = self.HP[i] + (AH + PP * self.MP[j])

    def coriolis(self) -> dict[tuple[int, int], Scalar]:
        """Return the Coriolis matrix {(i, k): C_ik} of all moving joints of the open tree."""
        moving = self.robot.moving
        C: dict[tuple[int, int], Scalar] = {(i, k): 0 for i in moving for k in moving}
        for k in moving:
            C |= self._joint(k)
        return C

    def _joint(self, k: int) -> dict[tuple[int, int], Scalar]:
        """Return the Coriolis entries C_ik and C_ki for all joints i from the base to joint k."""
        self.algebra.section(f"Unit rate of joint {k}")
        x, y, _ = self.MSP[k]
        B, H = self.BP[k], self.HP[k]
        zd = self._axis_rate(k)
        if self.robot.frame(k).sigma == PRISMATIC:
            E, NE = zd * self.MP[k], cross(self.MSP[k], zd)
            F, N = array((0, 0, self.MP[k])), array((y, -x, 0))
            ND = array((H[1], -H[0], 0))
        else:
            XX, XY, XZ, YY, YZ, ZZ = self.JP[k]
            across = B[0][0] + B[1][1]
            E = cross(zd, self.MSP[k]) + array((-H[1], H[0], 0))
            J = array(((XX, XY, XZ), (XY, YY, YZ), (XZ, YZ, ZZ)))
            NE = J @ zd + array((-B[2][0], -B[2][1], across))
            F, N = array((-y, x, 0)), array((XZ, YZ, ZZ))
            ND = array((-B[0][2], -B[1][2], across))
        C: dict[tuple[int, int], Scalar] = {}
        for i in reversed(self.robot.path(k)):
            frame, R, P = self.robot.frame(i), self.geometry.rotation[i], self.geometry.P[i]
            if frame.sigma != FIXED:
                slides = frame.sigma == PRISMATIC
                C[i, k] = E[2] if slides else NE[2]
                if i != k:
                    below = dot(self._axis_rate(i), F if slides else N)
                    C[k, i] = below if slides else below + ND[2]
            E, F = self.algebra.vector("E", R.up(E), i, k), R.up(F)
            NE, N = R.up(NE) + cross(P, E), R.up(N) + cross(P, F)
            ND = R.up(ND) + cross(self.PP[i], F)
        return C

    def _axis_rate(self, k: int) -> Vector:
        """Return the rate of change of joint axis k, zd_k = w_k x z_k, in frame k."""
        w = self.motion.link[k].w
        return array((w[1], -w[0], 0))


def turned(R: Rotation, B: Matrix) -> Matrix:
    """Rotate a 3x3 matrix B from frame j to frame i: return iRj B jRi."""
    cc, cs = R.c * R.c, R.c * R.s
    difference, sum_ = B[0][0] - B[1][1], B[0][1] + B[1][0]
    x = cc * difference - cs * sum_
    xy = cc * sum_ + cs * difference
    rows = (
        (B[1][1] + x, xy - B[1][0], R.c * B[0][2] - R.s * B[1][2]),
        (xy - B[0][1], B[0][0] - x, R.s * B[0][2] + R.c * B[1][2]),
        (
            R.c * B[2][0] - R.s * B[2][1],
            R.s * B[2][0] + R.c * B[2][1],
            B[2][2],
        ),
    )
    return array(rows) if R.A is None else R.A @ array(rows) @ R.A.T


def coriolis(d: Derivation) -> dict[tuple[int, int], Scalar]:
    """Return the Coriolis matrix {(i, k): C_ik} of the actuated joints.

    It is G' C G with the matrix C of all moving joints and a constant G.
    """
    return projected_twice(d.geometry.closure, d.algebra, CompositeRates(d).coriolis())
