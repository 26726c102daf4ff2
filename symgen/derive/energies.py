"""Energies, link velocities, and regressors of momentum, base wrench and Slotine-Li torques.

Energies of link j, with its velocities v_j of the origin and w_j in its frame, gravity g and its
origin P_0j in frame 0:

    E_j = 1/2 (w_j' J_j w_j + M_j v_j' v_j) + MS_j . (v_j x w_j)
    U_j = -g . (M_j P_0j + A_0j MS_j)

Both are linear in the parameters. Elements add E = 1/2 c sd**2 (inertia), U = 1/2 c s**2
(stiffness), U = c s (offset), U = c energy (elements with an energy of the user).

Accelerations at reference rates. Per unit rate of joint k, a point r of link j has the velocity v_k
+ z_k x r. Its rate of change in space is

    a_k + U_k r ,     U_k = skew(zd_k) + skew(z_k) skew(w_j) ,

and C_ik is the torque at joint i that moves the links with these accelerations: C_ik is the sum of
dx/dq_i . d/dt(dx/dq_k) over the mass points. Its part per qd_l is the Christoffel symbol
sum dx/dq_i . d2x/dq_k dq_l of the inertia matrix. Hence Ad = C + C', and Ad - 2C is skew symmetric.

Columns of other dynamics, all linear in the parameters:

    A qddr + C qdr + Q + friction    torques of the accelerations qddr and, by C, of the rates qdr
    p = A qd                         torques of the accelerations qd from rest, without gravity
    dp/dt - Gamma = C' qd - Q - friction ,    (C' qd)_i = sum_j v_j . F_ij + w_j . N_ij ,

with the wrench (F_ij, N_ij) that moves link j with the accelerations a_i + U_i r of a unit rate of
joint i.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from fractions import Fraction

from symgen.derive.algebra import E3, ZERO3, Scalar, Vector, array, cross, dot
from symgen.derive.derivation import Derivation
from symgen.derive.geometry import Frames
from symgen.derive.graph import Symbol
from symgen.derive.newton_euler import LinkMotion, Motion
from symgen.derive.regressor import Law, columns, element_names, inertial_names, unit_wrench
from symgen.description.expression import Expression
from symgen.description.robot import INERTIAL, PRISMATIC, Element, parameter

HALF = Expression.number(Fraction(1, 2))


def origin_velocities(motion: Motion) -> dict[int, Vector]:
    """Return {j: v_j}, the velocity of the origin of frame j, in frame j.

        v_j = jRi (v_i + w_i x P_ij)  [+ qd_j e3   prismatic]

    The base is at rest.
    """
    v: dict[int, Vector] = {0: ZERO3}
    for f in motion.robot.frames:
        x, y, z = motion.geometry.rotation[f.j].down(
            v[f.ant] + cross(motion.link[f.ant].w, motion.geometry.P[f.j])
        )
        v[f.j] = motion.vector("VO", (x, y, z + motion.qd(f.j) if f.sigma == PRISMATIC else z), f.j)
    return v


def kinetic_energy(d: Derivation) -> Scalar:
    """Return the kinetic energy E of all links and of the inertias on the joints."""
    motion = d.motion
    v, half = origin_velocities(motion), d.algebra.constant(HALF)
    total: Scalar = 0
    for j in d.robot.links:
        w, K = motion.link[j].w, {p: d.chi[parameter(p, j)] for p in INERTIAL}
        XX, XY, XZ, YY, YZ, ZZ = (K[p] for p in INERTIAL[:6])
        Jw = array(((XX, XY, XZ), (XY, YY, YZ), (XZ, YZ, ZZ))) @ w
        total = total + half * (dot(w, Jw) + K["M"] * dot(v[j], v[j]))
        total = total + dot((K["MX"], K["MY"], K["MZ"]), cross(v[j], w))
    for name, (e, j) in element_names(d.robot).items():
        if e.kind == "inertia":
            rates = {i: motion.qd(i) for i in d.robot.moving}
            total = total + d.chi[name] * (half * _square(d, e, j, rates))
    return total


def potential_energy(d: Derivation) -> Scalar:
    """Return the potential energy U of gravity, springs and constant torques.

    Gravity energy is zero at the origin of frame 0, spring energy at q = 0.
    """
    frames, half = Frames(d.geometry), d.algebra.constant(HALF)
    x, y, z = (d.algebra.gravity(axis) for axis in range(3))
    total: Scalar = 0
    for j in d.robot.links:
        height = dot((x, y, z), frames.position(j, 0, 0))
        total = total + d.chi[parameter("M", j)] * height
        first = [d.chi[parameter(p, j)] for p in ("MX", "MY", "MZ")]
        total = total + dot(frames.rotated(array((x, y, z)), 0, j), first)
    positions = {i: d.geometry.position(i) for i in d.robot.moving}
    for name, (e, j) in element_names(d.robot).items():
        if e.kind == "stiffness":
            total = total + d.chi[name] * (half * _square(d, e, j, positions))
        elif e.kind == "offset":
            total = total + d.chi[name] * d.algebra.linear(e.along[j], positions)
        elif e.energy is not None:
            total = total + d.chi[name] * Law(d.motion, e, j).of(e.potential(j))
    return total


def _square(d: Derivation, e: Element, j: int, x: Mapping[int, Scalar]) -> Scalar:
    """Return twice the energy of an inertia or spring whose parameter is 1.

    The result is (G x)**2 for an element with a row G of coefficients, and x' B x for an element
    with a matrix B. Here x are the joint velocities (inertia) or the joint positions (spring).
    """
    if j in e.along:
        s = d.algebra.linear(e.along[j], x)
        return s * s
    return d.algebra.linear(e.form[j], {(i, m): x[i] * x[m] for i, m in e.form[j]})


class AtRates(Motion):
    """Link accelerations from which the Newton-Euler recursion computes C qdr, with the Coriolis
    matrix C and reference velocities qdr.

    These accelerations are sum_k qdr_k (a_k + U_k r), see the head of this module; `joint_torques`
    turns them into C qdr. With qdr_k = 1 as the only rate, the result is column k of C.

    Parameters
    ----------
    motion : Motion
        The links with their velocities.
    rates : mapping
        qdr of the independent joints; a joint left out has rate 0.
    tag : int
        Last index in the names of the intermediate variables.
    """

    def __init__(self, motion: Motion, rates: Mapping[int, Scalar], tag: int) -> None:
        self.geometry, self.robot, self.algebra, self.tag = (
            motion.geometry,
            motion.robot,
            motion.algebra,
            (tag,),
        )
        every = dict.fromkeys(self.geometry.closure.independent, 0) | dict(rates)
        half = self.algebra.constant(HALF)
        z: dict[int, Vector] = {0: ZERO3}
        zd: dict[int, Vector] = {0: ZERO3}
        self.link: dict[int, LinkMotion] = {0: _link(ZERO3, ZERO3, ZERO3, ZERO3, half)}
        for f in self.robot.frames:
            j, w = f.j, motion.link[f.j].w
            of = f"unit rate of joint {tag}" if tag else "reference rates"
            self.algebra.section(f"Link {j}, {of}")
            m = self.geometry.carrier[j].m
            axis_rate = array((w[1], -w[0], 0))  # w x e3
            n = self.algebra.turned(self.geometry.carrier[j].turn, every)
            z[j] = self.vector("Z", self.geometry.from_carrier(j, z[m]) + E3 * n, j)
            zd[j] = self.vector("ZP", self.geometry.from_carrier(j, zd[m]) + axis_rate * n, j)
            a = self.geometry.rotation[j].down(
                self.link[f.ant].a + self.link[f.ant].U @ self.geometry.P[j]
            )
            if f.sigma == PRISMATIC:
                n = self.algebra.linear(self.geometry.closure.row[j], every)
                a = a + axis_rate * n + cross(z[j], E3 * motion.qd(j))
            self.link[j] = _link(z[j], zd[j], w, self.vector("VP", a, j), half)


def _link(z: Vector, zd: Vector, w: Vector, a: Vector, half: Scalar) -> LinkMotion:
    """Return the accelerations a + U r of the points r of a link, as a `LinkMotion`.

    U = skew(zd) + skew(z) skew(w). The antisymmetric part of U replaces wd, the symmetric part
    replaces w w', and the differences of the diagonal of U replace DW.
    """
    across = dot(z, w)
    skew = ((0, -zd[2], zd[1]), (zd[2], 0, -zd[0]), (-zd[1], zd[0], 0))
    rows = []
    for k in range(3):
        x, y, t = (skew[k][m] + w[k] * z[m] for m in range(3))
        rows.append([e - across if m == k else e for m, e in enumerate((x, y, t))])
    U = array(rows)
    turning = array((U[2][1] - U[1][2], U[0][2] - U[2][0], U[1][0] - U[0][1])) * half
    DV = array([[half * (U[k][m] + U[m][k]) for m in range(3)] for k in range(3)])
    DW = array((U[1][1] - U[2][2], U[2][2] - U[0][0], U[0][0] - U[1][1]))
    return LinkMotion(w, turning, DV, DW, U, a)


Columns = Mapping[str, Mapping[int, Scalar]]


def _accelerated(d: Derivation, qdd: Mapping[int, Scalar]) -> Motion:
    """Compute the motion of links at rest with joint accelerations qdd, gravity included.

    Friction still acts with the actual joint velocities.
    """
    zero = dict.fromkeys(d.closure.independent, 0)
    motion = copy(d.motion)
    motion.link = Motion(d.geometry, tag=(0,), qd=zero, qdd={**zero, **qdd}).link
    motion._qdd = {**zero, **qdd}
    return motion


def slotine_li(d: Derivation) -> Columns:
    """Return the Slotine-Li regressor, by parameter: columns of A qddr + C qdr + Q + friction(qd).

    The reference rates qdr and accelerations qddr are inputs.
    """
    qdr, qddr = (
        {i: d.algebra.graph.symbol(Symbol(kind, f"{family}{i}")) for i in d.robot.joints}
        for kind, family in (("qdr", "QPR"), ("qddr", "QDPR"))
    )
    motion, turning = _accelerated(d, qddr), AtRates(d.motion, qdr, 0).link
    motion.link = {j: _together(a, turning[j]) for j, a in motion.link.items()}
    return columns(motion, d.robot.parameters)


def _together(a: LinkMotion, b: LinkMotion) -> LinkMotion:
    """Add the accelerations of one link in two motions a and b."""
    return LinkMotion(b.w, a.wd + b.wd, a.DV + b.DV, a.DW + b.DW, a.U + b.U, a.a + b.a)


def momentum_rate(d: Derivation) -> Columns:
    """Return the regressor columns, by parameter, of dp/dt - Gamma, with the momentum p = A qd.

    dp/dt - Gamma = C' qd - Q - friction.
    """
    at_rest = columns(_accelerated(d, {}), d.robot.parameters)
    found = {name: {i: -x for i, x in D.items()} for name, D in at_rest.items()}
    v, inertial = origin_velocities(d.motion), inertial_names(d.robot)
    for i in d.robot.joints:
        unit = AtRates(d.motion, {i: 1}, i).link
        for name, (p, j) in inertial.items():
            F, N = unit_wrench(unit[j], p)
            power = dot(v[j], F) + dot(d.motion.link[j].w, N)
            found[name][i] = found[name].get(i, 0) + power
    return found


def base_wrench(d: Derivation) -> dict[str, tuple[Scalar, ...]]:
    """Return the regressor of the wrench that the base exerts on the robot, in frame 0.

    For each inertial parameter, the column has the force, then the moment about the origin of frame
    0.
    """
    found = {}
    for name, (p, j) in inertial_names(d.robot).items():
        F, N = (d.poses[j][0] @ x for x in unit_wrench(d.motion.link[j], p))
        found[name] = (*F, *(N + cross(d.poses[j][1], F)))
    return found
