"""Newton-Euler recursions: link motions from base to tips, then wrenches from tips to base.

Link j, frame j, i = ant(j), a_j the acceleration of O_j minus gravity, U = skew(wd) + skew(w)**2:

    w_j  = iRj' w_i  + qd_j e3
    wd_j = iRj' wd_i + qdd_j e3 + (iRj' w_i) x (qd_j e3)      revolute
    a_j  = iRj' (a_i + U_i P_ij)  [+ 2 w_j x (qd_j e3) + qdd_j e3   prismatic],   a_0 = -gravity
    F_j  = M_j a_j + U_j MS_j ,     N_j = J_j wd_j + w_j x (J_j w_j) + MS_j x a_j
    f_j  = F_j + sum_k jRk f_k ,    n_j = N_j + sum_k (jRk n_k + P_jk x jRk f_k)

with k over the frames mounted on frame j. A moving base has measured w_0, wd_0 and a_0; of a free
base, f_0 and n_0 are six more rows. N_j is written in product form (see `moment`): with base
parameters, YY = MZ = M = 0 for most links, and many products disappear.

W. Khalil, J.-F. Kleinfinger, ICRA 1986; Khalil and Dombre, Modeling, Identification and Control of
Robots, 2002, ch. 9.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from symgen.derive.algebra import BASE, ZERO3, Matrix, Scalar, Vector, array, cross, dot, is_zero
from symgen.derive.geometry import Geometry
from symgen.description.expression import Expression
from symgen.description.robot import (
    BASE_ROWS,
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    parameter,
)

ZERO33 = array((ZERO3, ZERO3, ZERO3))
TWO = Expression.number(2)


class LinkMotion(NamedTuple):
    """Velocities and accelerations of one link, in its frame.

    Attributes
    ----------
    w, wd : Vector
        Angular velocity (rad/s) and acceleration (rad/s**2).
    DV : Matrix
        Products w_k w_l.
    DW : Vector
        (w2**2 - w3**2, w3**2 - w1**2, w1**2 - w2**2).
    U : Matrix
        skew(wd) + skew(w)**2.
    a : Vector
        Acceleration of the origin minus gravity, m/s**2.
    """

    w: Vector
    wd: Vector
    DV: Matrix
    DW: Vector
    U: Matrix
    a: Vector


REST = LinkMotion(ZERO3, ZERO3, ZERO33, ZERO3, ZERO33, ZERO3)


class Motion:
    """Velocities and accelerations of all links, by the outward Newton-Euler recursion.

    Parameters
    ----------
    geometry : Geometry
        Rotations and positions of the frames.
    tag : tuple of int
        Last indices in the names of the intermediate variables.
    qd, qdd : mapping, optional
        Rates and accelerations of the independent joints. Default: the inputs QP and QDP.
    """

    def __init__(
        self,
        geometry: Geometry,
        *,
        tag: tuple[int, ...] = (),
        qd: Mapping[int, Scalar] | None = None,
        qdd: Mapping[int, Scalar] | None = None,
    ) -> None:
        self.geometry, self.robot, self.algebra = geometry, geometry.robot, geometry.algebra
        self.tag = tag
        independent = geometry.closure.independent
        self._qd = qd or {i: self.algebra.qd(i) for i in independent}
        self._qdd = qdd or {i: self.algebra.qdd(i) for i in independent}
        self.link: dict[int, LinkMotion] = {0: self._base()}
        for f in self.robot.frames:
            self.link[f.j] = self._link(f.j)

    def _base(self) -> LinkMotion:
        """Return the motion of the base: at rest, but accelerated by minus gravity; or measured."""
        if self.robot.base_moves:
            w, wd, a = map(self.algebra.base, BASE)
            return LinkMotion(w, wd, *self._products(w, wd, 0), a)
        x, y, z = (self.algebra.gravity(axis) for axis in range(3))
        return REST if is_zero((x, y, z)) else REST._replace(a=array((x, y, z)))

    def q(self, j: int) -> Scalar:
        """Return the position of any moving joint j."""
        return self.geometry.position(j)

    def qd(self, j: int) -> Scalar:
        """Return the velocity of any moving joint j."""
        return self.algebra.linear(self.geometry.closure.row[j], self._qd)

    def qdd(self, j: int) -> Scalar:
        """Return the acceleration of any moving joint j."""
        return self.algebra.linear(self.geometry.closure.row[j], self._qdd)

    def vector(self, family: str, value: Iterable[Scalar], *indices: int) -> Vector:
        """Name the components of a vector, such as W12 (component 1, link 2); return the vector."""
        return self.algebra.vector(family, value, *indices, *self.tag)

    def _link(self, j: int) -> LinkMotion:
        f, geometry = self.robot.frame(j), self.geometry
        self.algebra.section(f"Link {j}")
        carrier = geometry.carrier[j]
        inner, i = self.link[carrier.m], self.link[f.ant]
        rate = self.algebra.turned(carrier.turn, self._qd)
        acceleration = self.algebra.turned(carrier.turn, self._qdd)
        slides = (self.qd(j), self.qdd(j)) if f.sigma == PRISMATIC else (0, 0)
        if (
            inner is REST
            and i is REST
            and is_zero((rate, acceleration, 0))
            and is_zero((*slides, 0))
        ):
            return REST
        w0, wd0 = geometry.from_carrier(j, inner.w), geometry.from_carrier(j, inner.wd)
        w = self.vector("W", (w0[0], w0[1], w0[2] + rate), j)
        wd = self.vector(
            "WP",
            (wd0[0] + w[1] * rate, wd0[1] - w[0] * rate, wd0[2] + acceleration),
            j,
        )
        DV, DW, U = self._products(w, wd, j)
        P = geometry.P[j]
        VSP = self.vector("VSP", i.a + i.U @ P, j)
        a = geometry.rotation[j].down(VSP)
        if f.sigma == PRISMATIC:
            qd2 = self.algebra.constant(TWO) * slides[0]
            a = array((a[0] + qd2 * w[1], a[1] - qd2 * w[0], a[2] + slides[1]))
        return LinkMotion(w, wd, DV, DW, U, self.vector("VP", a, j))

    def _products(self, w: Vector, wd: Vector, j: int) -> tuple[Matrix, Vector, Matrix]:
        name, named = self.algebra.name, self.algebra.named
        D = {
            (k, m): name(w[k] * w[m], named("DV", k + 1, m + 1, j, *self.tag))
            for k in range(3)
            for m in range(k, 3)
        }
        DV = array(
            (
                (D[0, 0], D[0, 1], D[0, 2]),
                (D[0, 1], D[1, 1], D[1, 2]),
                (D[0, 2], D[1, 2], D[2, 2]),
            )
        )
        DW = array(
            (
                name(DV[1][1] - DV[2][2], named("DW", 2, 3, j, *self.tag)),
                name(DV[2][2] - DV[0][0], named("DW", 3, 1, j, *self.tag)),
                name(DV[0][0] - DV[1][1], named("DW", 1, 2, j, *self.tag)),
            )
        )

        def off(k: int, m: int, value: Scalar) -> Scalar:
            return name(value, named("U", k, m, j, *self.tag))

        U = (
            (
                off(1, 1, -(DV[1][1] + DV[2][2])),
                off(1, 2, DV[0][1] - wd[2]),
                off(1, 3, DV[0][2] + wd[1]),
            ),
            (
                off(2, 1, DV[0][1] + wd[2]),
                off(2, 2, -(DV[0][0] + DV[2][2])),
                off(2, 3, DV[1][2] - wd[0]),
            ),
            (
                off(3, 1, DV[0][2] - wd[1]),
                off(3, 2, DV[1][2] + wd[0]),
                off(3, 3, -(DV[0][0] + DV[1][1])),
            ),
        )
        return DV, DW, array(U)


def force(m: LinkMotion, K: Mapping[str, Scalar]) -> Vector:
    """Return the force F = M a + U MS that moves a link."""
    F: Vector = m.a * K["M"] + m.U @ array((K["MX"], K["MY"], K["MZ"]))
    return F


def moment(m: LinkMotion, K: Mapping[str, Scalar]) -> Vector:
    """Return the moment N = J wd + w x (J w) + MS x a that moves a link, in product form.

    N1 = XX wd1 + (ZZ - YY) w2 w3 + YZ (w2**2 - w3**2) + XZ U21 - XY U31 + (MS x a)1, and
    cyclically.
    """
    (XX, XY, XZ, YY, YZ, ZZ), MS = (K[p] for p in INERTIAL[:6]), array((K["MX"], K["MY"], K["MZ"]))
    DV, DW, U, wd = m.DV, m.DW, m.U, m.wd
    N: Vector = array(
        (
            dot((XX, ZZ - YY, YZ, XZ, -XY), (wd[0], DV[1][2], DW[0], U[1][0], U[2][0])),
            dot((YY, XX - ZZ, XZ, XY, -YZ), (wd[1], DV[0][2], DW[1], U[2][1], U[0][1])),
            dot((ZZ, YY - XX, XY, YZ, -XZ), (wd[2], DV[0][1], DW[2], U[0][2], U[1][2])),
        )
    ) + cross(MS, m.a)
    return N


def joint_torques(motion: Motion, K: Mapping[str, Scalar]) -> dict[int, Scalar]:
    """Return the torques {j: Gamma_j} that move the links, by the inward recursion.

    Every moving joint of the tree has an entry; friction and other elements are not included. For a
    free base, the force and the moment that move it are six more entries, with the keys -5 ... 0. K
    maps a standard parameter's name to its scalar; a parameter that is not in K counts as 0.
    """
    robot, geometry, vector = motion.robot, motion.geometry, motion.vector
    f: dict[int, Vector] = dict.fromkeys(range(len(robot.frames) + 1), ZERO3)
    n: dict[int, Vector] = dict(f)
    torque: dict[int, Scalar] = {}
    for frame in reversed(robot.frames):
        j, i = frame.j, frame.ant
        if motion.link[j] is REST and is_zero(f[j]) and is_zero(n[j]):
            torque |= {j: 0} if frame.sigma != FIXED else {}
            continue
        motion.algebra.section(f"Joint {j}")
        link = {p: K.get(parameter(p, j), 0) for p in INERTIAL}
        f[j] = vector("E", vector("F", force(motion.link[j], link), j) + f[j], j)
        n[j] = vector("NE", vector("N", moment(motion.link[j], link), j) + n[j], j)
        if frame.sigma == REVOLUTE:
            torque[j] = n[j][2]
        elif frame.sigma == PRISMATIC:
            torque[j] = f[j][2]
        fi = vector("FDI", geometry.rotation[j].up(f[j]), j)
        f[i] = f[i] + fi
        n[i] = n[i] + (geometry.rotation[j].up(n[j]) + cross(geometry.P[j], fi))
    if robot.base_is_free:
        motion.algebra.section("Base")
        link = {p: K.get(parameter(p, 0), 0) for p in INERTIAL}
        E = vector("E", vector("F", force(motion.link[0], link), 0) + f[0], 0)
        NE = vector("NE", vector("N", moment(motion.link[0], link), 0) + n[0], 0)
        torque |= dict(zip(BASE_ROWS, (*E, *NE), strict=True))
    return torque
