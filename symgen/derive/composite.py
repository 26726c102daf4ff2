"""Inertia and Coriolis matrices by composite links: a link and all links on it, as one rigid body.

Inertia matrix A. The method is that of Walker and Orin (1982). From the tips to the base, the
parameters of each composite link, about the origin of its frame, are added to those of its
antecedent:

    JP_i  <- JP_i + iRj JP_j jRi + 2 (P . AS) E - P AS' - AS P' + MP_j ((P . P) E - P P')
    MSP_i <- MSP_i + AS + MP_j P ,   MP_i <- MP_i + MP_j ,   AS = iRj MSP_j ,   P = P_ij

Column k of A is the wrench by which composite link k resists a unit acceleration of joint k,

    E = (-MSP_2, MSP_1, 0) ,   NE = (JP_13, JP_23, JP_33)      revolute
    E = (0, 0, MP) ,           NE = (MSP_2, -MSP_1, 0)         prismatic

propagated to every joint before joint k, and to the rows of a free base. There the composite link 0
resists the accelerations a_0 and wd_0 of the base with

    E = MP a_0 - MSP x wd_0 ,   NE = MSP x a_0 + JP wd_0 .

With base parameters, YY = MZ = M = 0 for most links, so that the terms in MP vanish.

Coriolis matrix C(q, qd), from the Christoffel symbols of A, so that Ad - 2C is skew symmetric. A
mass point at r in frame j has the velocity rd = w_j x r relative to the origin of the frame. The
recursion also computes

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

M. W. Walker, D. E. Orin, J. Dyn. Sys. Meas. Control 104, 1982; S. Echeandia, P. M. Wensing, J. Dyn.
Sys. Meas. Control 143, 2021; Khalil and Dombre, Modeling, Identification and Control of Robots,
2002, ch. 9.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from symgen.derive.algebra import E3, IDENTITY, Matrix, Scalar, Vector, array, cross, dot
from symgen.derive.geometry import Geometry, Rotation
from symgen.derive.newton_euler import Motion
from symgen.derive.regressor import element_names
from symgen.description.expression import Expression
from symgen.description.robot import BASE_ROWS, FIXED, INERTIAL, PRISMATIC, parameter

Tensor = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]  # 11, 12, 13, 22, 23, 33
PLACES = ((1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3))
Place = tuple[int, int]


class CompositeLinks:
    """Inertia JP, first moments MSP and mass MP of each link together with all links after it.

    A composite link is a link with all links mounted on it, as one rigid body.

    Parameters
    ----------
    geometry : Geometry
        Rotations and positions of the frames.
    chi : mapping
        Scalar of each standard parameter.
    """

    def __init__(self, geometry: Geometry, chi: Mapping[str, Scalar]) -> None:
        self.geometry = geometry
        self.robot = geometry.robot
        self.algebra = geometry.algebra
        self.named = self.algebra.named
        self.chi = chi
        self.JP: dict[int, Tensor] = {}
        self.MSP: dict[int, Vector] = {}
        self.MP: dict[int, Scalar] = {}
        self.own: dict[int, list[Scalar]] = {}  # XX .. M of the link alone
        base = (0,) if self.robot.base_is_free else ()
        for j in (*base, *(f.j for f in self.robot.frames)):
            link = [chi[parameter(p, j)] if j in self.robot.links else 0 for p in INERTIAL]
            self.own[j] = link
            XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = link
            self.JP[j] = (XX, XY, XZ, YY, YZ, ZZ)
            self.MSP[j] = array((MX, MY, MZ))
            self.MP[j] = M
        for f in reversed(self.robot.frames):
            self.algebra.section(f"Composite link {f.j}")
            self._name(f.j)
            if f.ant in self.own:
                self._take(f.j, f.ant)
        if base:
            self.algebra.section("Composite link 0")
            self._name(0)

    def _name(self, j: int) -> None:
        """Give names to inertia, first moments and mass of link j with all links after it: JP332,
        MSP32, MP2 for j = 2.
        """
        for (k, m), x in zip(PLACES, self.JP[j], strict=True):
            self.algebra.name(x, self.named("JP", k, m, j))
        self.algebra.vector("MSP", self.MSP[j], j)
        self.algebra.name(self.MP[j], self.named("MP", j))

    def _take(self, j: int, i: int) -> None:
        """Add the inertia of link j and all links after it to the inertia of its antecedent i."""
        R = self.geometry.rotation[j]
        P = self.geometry.P[j]
        AS = self.algebra.vector("AS", R.up(self.MSP[j]), j)
        moved = AS + P * self.MP[j]
        AJA = turned(R, self.JP[j])
        for (k, m), x in zip(PLACES, AJA, strict=True):
            self.algebra.hint(x, self.named("AJA", k, m, j))
        shifted = parallel(P, AS, moved)
        JP = (a + (b + c) for a, b, c in zip(self.JP[i], AJA, shifted, strict=True))
        self.JP[i] = tuple(JP)
        self.MSP[i] = self.MSP[i] + moved
        self.MP[i] = self.MP[i] + self.MP[j]

    def matrix(self) -> dict[Place, Scalar]:
        """Return the inertia matrix {(i, k): A_ik} of all moving joints of the open tree.

        Inertias on the joints (elements) are included. A free base has six rows and columns more.
        """
        base = tuple(BASE_ROWS) if self.robot.base_is_free else ()
        moving = (*base, *self.robot.moving)
        A: dict[Place, Scalar] = {(i, k): 0 for i in moving for k in moving}
        for k in self.robot.moving:
            for i, x in self._column(k).items():
                A[i, k] = x
                A[k, i] = x
        A |= self._of_base() if base else {}
        for name, (e, j) in element_names(self.robot).items():
            if e.kind == "inertia":
                row = e.along.get(j, {})
                form = e.form.get(j) or {
                    (i, k): a * b for i, a in row.items() for k, b in row.items()
                }
                for place, b in form.items():
                    A[place] = A[place] + self.algebra.constant(b) * self.chi[name]
        return A

    def _column(self, k: int) -> dict[int, Scalar]:
        """Return the entries {i: A_ik} of column k of the inertia matrix without actuator inertias.

        The joints i are those between the base and joint k.
        """
        x, y, _ = self.MSP[k]
        E, NE = array((-y, x, 0)), array((self.JP[k][2], self.JP[k][4], self.JP[k][5]))
        if self.robot.frame(k).sigma == PRISMATIC:
            E, NE = array((0, 0, self.MP[k])), array((y, -x, 0))
        self.algebra.section(f"Unit acceleration of joint {k}")
        column: dict[int, Scalar] = {}
        for i in reversed(self.robot.path(k)):
            frame = self.robot.frame(i)
            self.algebra.vector("E", E, i, k)
            self.algebra.vector("NE", NE, i, k)
            if frame.sigma != FIXED:
                column[i] = E[2] if frame.sigma == PRISMATIC else NE[2]
            rotation = self.geometry.rotation[i]
            E = rotation.up(E)
            NE = rotation.up(NE) + cross(self.geometry.P[i], E)
        if self.robot.base_is_free:
            column |= dict(zip(BASE_ROWS, (*E, *NE), strict=True))
        return column

    def _of_base(self) -> dict[Place, Scalar]:
        """Return the entries of the inertia matrix in rows and columns of a free base alone."""
        XX, XY, XZ, YY, YZ, ZZ = self.JP[0]
        J = ((XX, XY, XZ), (XY, YY, YZ), (XZ, YZ, ZZ))
        wrenches = [(e * self.MP[0], cross(self.MSP[0], e)) for e in IDENTITY]
        wrenches += [
            (cross(e, self.MSP[0]), row) for e, row in zip(IDENTITY, array(J), strict=True)
        ]
        return {
            (i, k): x
            for k, (E, NE) in zip(BASE_ROWS, wrenches, strict=True)
            for i, x in zip(BASE_ROWS, (*E, *NE), strict=True)
        }


def turned(R: Rotation, J: Tensor) -> Tensor:
    """Rotate an inertia tensor J from frame j to frame i: return iRj J jRi."""
    XX, XY, XZ, YY, YZ, ZZ = J
    cc, cs = R.c * R.c, R.c * R.s
    x = cc * (XX - YY) - (cs + cs) * XY
    xy = cs * (XX - YY) + ((cc + cc) * XY - XY)
    xz, yz = R.c * XZ - R.s * YZ, R.s * XZ + R.c * YZ
    rows = array([(YY + x, xy, xz), (xy, XX - x, yz), (xz, yz, ZZ)])
    if R.A is not None:
        rows = R.A @ rows @ R.A.T
    return rows[0][0], rows[0][1], rows[0][2], rows[1][1], rows[1][2], rows[2][2]


def parallel(P: Vector, AS: Vector, moved: Vector) -> Tensor:
    """Return the parallel-axis terms of an inertia tensor that is shifted by the vector P.

    With the mass MP and the first moments AS of the composite link, the terms are (P . AS + P .
    moved) E - P moved' - AS P', moved = AS + MP P.
    """
    trace = dot(P, AS) + dot(P, moved)
    outer = {(k, m): P[k - 1] * moved[m - 1] + AS[k - 1] * P[m - 1] for k, m in PLACES}
    return tuple((trace if k == m else 0) - x for (k, m), x in outer.items())


HALF = Expression.number(Fraction(1, 2))


class CompositeRates(CompositeLinks):
    """Sums HP of m rd and BP of m r rd' over the mass points of each link and of all links after
    it; m, r and rd are mass, position and velocity of a point.

    A composite link is a link with all links mounted on it. r is in the frame of the link, rd is
    relative to the origin of the frame.

    Parameters
    ----------
    motion : Motion
        The links with their velocities.
    chi : mapping
        Scalar of each standard parameter.
    """

    def __init__(self, motion: Motion, chi: Mapping[str, Scalar]) -> None:
        super().__init__(motion.geometry, chi)
        self.motion = motion
        self.HP: dict[int, Vector] = {}
        self.BP: dict[int, Matrix] = {}
        self.PP: dict[int, Vector] = {}
        for f in self.robot.frames:
            self._link(f.j)
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

    def _link(self, j: int) -> None:
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
        ABA, AH = turned_matrix(R, self.BP[j]), R.up(self.HP[j])
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


def turned_matrix(R: Rotation, B: Matrix) -> Matrix:
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
