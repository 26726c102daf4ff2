"""Inertia matrix by composite links: a link and all links mounted on it, as one rigid body.

The method is that of Walker and Orin (1982). From the tips to the base, the parameters of each
composite link, about the origin of its frame, are added to those of its antecedent:

    JP_i  <- JP_i + iRj JP_j jRi + 2 (P . AS) E - P AS' - AS P' + MP_j ((P . P) E - P P')
    MSP_i <- MSP_i + AS + MP_j P ,   MP_i <- MP_i + MP_j ,   AS = iRj MSP_j ,   P = P_ij

Column k of A is the wrench by which composite link k resists a unit acceleration of joint k,

    E = (-MSP_2, MSP_1, 0) ,   NE = (JP_13, JP_23, JP_33)      revolute
    E = (0, 0, MP) ,           NE = (MSP_2, -MSP_1, 0)         prismatic

propagated to every joint before joint k. With base parameters, YY = MZ = M = 0 for most links, and
the terms in MP vanish.

M. W. Walker, D. E. Orin, J. Dyn. Sys. Meas. Control 104, 1982; Khalil and Dombre, Modeling,
Identification and Control of Robots, 2002, ch. 9.
"""

from __future__ import annotations

from collections.abc import Mapping

from symgen.derive.algebra import Scalar, Vector, array, cross, dot
from symgen.derive.geometry import Geometry, Rotation
from symgen.derive.regressor import element_names
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, parameter

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
        for f in self.robot.frames:
            link = [chi[parameter(p, f.j)] if f.j in self.robot.links else 0 for p in INERTIAL]
            self.own[f.j] = link
            XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = link
            self.JP[f.j] = (XX, XY, XZ, YY, YZ, ZZ)
            self.MSP[f.j] = array((MX, MY, MZ))
            self.MP[f.j] = M
        for f in reversed(self.robot.frames):
            self.algebra.section(f"Composite link {f.j}")
            self._name(f.j)
            if f.ant:
                self._take(f.j, f.ant)

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

        Inertias on the joints (elements) are included.
        """
        moving = self.robot.moving
        A: dict[Place, Scalar] = {(i, k): 0 for i in moving for k in moving}
        for k in moving:
            for i, x in self._column(k).items():
                A[i, k] = x
                A[k, i] = x
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
        return column


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

    They are (P . AS + P . moved) E - P moved' - AS P', with moved = AS + MP P.
    """
    trace = dot(P, AS) + dot(P, moved)
    outer = {(k, m): P[k - 1] * moved[m - 1] + AS[k - 1] * P[m - 1] for k, m in PLACES}
    return tuple((trace if k == m else 0) - x for (k, m), x in outer.items())
