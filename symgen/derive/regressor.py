"""The regressor in axis form: Gamma_i = sum_k D_ik chi_k, column by column, without propagating a
wrench.

Joint i feels the unit wrench (F, N) of a parameter of link j through its own axis seen from frame
j,

    D_ik = z_ij . N_k + v_ij . F_k

z_ij the axis of joint i in frame j, v_ij the velocity of O_j per unit rate of joint i; both are
carried outward:
z <- jRi' z, v <- jRi' (v + z x P). A prismatic joint has z = 0 and v = its direction.
"""

from __future__ import annotations

from symgen.derive.newton_euler import LinkMotion, Motion, force, moment
from symgen.derive.scalar import E3, ZERO3, Scalar, Vector, add, cross, dot, vadd
from symgen.description.robot import FIXED, INERTIAL, REVOLUTE


def unit_wrench(m: LinkMotion, parameter: str) -> tuple[Vector, Vector]:
    """(F, N) of a link whose only inertial parameter is `parameter` = 1."""
    K = dict.fromkeys(INERTIAL, 0) | {parameter: 1}
    return force(m, K), moment(m, K)


class Axes:
    """z_ij and v_ij of every joint i on the path to link j."""

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.z: dict[tuple[int, int], Vector] = {}
        self.v: dict[tuple[int, int], Vector] = {}
        for f in motion.robot.frames:
            self._carry(f.j)

    def _carry(self, j: int) -> None:
        motion, geometry, robot = self.motion, self.motion.geometry, self.motion.robot
        frame = robot.frame(j)
        m = geometry.carrier[j].m
        motion.algebra.section(f"Joint axes Z and velocities V seen from link {j}")
        for i in robot.path(j)[:-1]:
            sigma = robot.frame(i).sigma
            if sigma == FIXED:
                continue
            inside = i in robot.path(m)  # it turns the carrier, or else about z_j itself
            if sigma == REVOLUTE:
                z = geometry.from_carrier(j, self.z[i, m]) if inside else E3
                lever = vadd(self.v[i, frame.ant], cross(self.z[i, frame.ant], geometry.P[j]))
                v = geometry.rotation[j].down(motion.hinted("VS", lever, j, i))
            else:
                z = ZERO3
                v = geometry.from_carrier(j, self.v[i, m]) if inside else E3
            self.z[i, j] = motion.vector("Z", z, j, i)
            self.v[i, j] = motion.vector("V", v, j, i)
        if frame.sigma != FIXED:
            self.z[j, j], self.v[j, j] = (E3, ZERO3) if frame.sigma == REVOLUTE else (ZERO3, E3)

    def column(self, parameter: str, j: int) -> dict[int, Scalar]:
        """{i: D_ik} of an inertial parameter of link j, i over the moving joints that carry it."""
        F, N = unit_wrench(self.motion.link[j], parameter)
        motion = self.motion
        entries: dict[int, Scalar] = {}
        for i in motion.robot.path(j):
            if motion.robot.frame(i).sigma != FIXED:
                turning = motion.algebra.hint(
                    dot(self.z[i, j], N), f"{motion.named('DN', i)}{parameter}{j}"
                )
                pushing = motion.algebra.hint(
                    dot(self.v[i, j], F), f"{motion.named('DF', i)}{parameter}{j}"
                )
                entries[i] = motion.algebra.hint(
                    add(turning, pushing), f"{motion.named('DG', i)}{parameter}{j}"
                )
        return entries
