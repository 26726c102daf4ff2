"""Columns D_k of the standard regressor, by parameter name: Gamma_a = sum_k D_k chi_k.

Gamma_a are the torques of the actuated joints. The columns of inertial parameters are computed from
the joint axes, without propagating a wrench. A parameter of link j, set to 1, needs a wrench (F, N)
on link j. Joint i feels this wrench through its own axis, expressed in frame j:

    D_ik = z_ij . N_k + v_ij . F_k

z_ij is the axis of joint i in frame j, v_ij the velocity of O_j per unit rate of joint i. Both are
propagated from the base to the tips: z <- jRi' z, v <- jRi' (v + z x P). A prismatic joint has
z = 0, and v is its direction.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from symgen.derive.algebra import E3, ZERO3, Scalar, Vector, cross, dot
from symgen.derive.elements import element_column
from symgen.derive.newton_euler import LinkMotion, Motion, force, moment
from symgen.description.expression import Expression
from symgen.description.robot import (
    FIXED,
    INERTIAL,
    KINDS,
    PRISMATIC,
    REVOLUTE,
    Element,
    Robot,
    parameter,
)
from symgen.time_limit import require_time

UNITS_OF_LINKS = {"M": "kg", "MX": "kg*m", "MY": "kg*m", "MZ": "kg*m"}


@lru_cache(maxsize=16)
def inertial_names(robot: Robot) -> dict[str, tuple[str, int]]:
    """Return {name: (inertial parameter, link)}, for instance {ZZ1: (ZZ, 1)}."""
    return {parameter(p, j): (p, j) for j in robot.links for p in INERTIAL}


def element_names(robot: Robot) -> dict[str, tuple[Element, int]]:
    """Return {parameter name: (element, number)}, for instance {FV2: (element FV, 2)}."""
    return {parameter(e.family, j): (e, j) for e in robot.elements for j in e.keys}


def acting(e: Element, j: int) -> dict[Any, Expression]:
    """Return the coefficients with which an element parameter, such as FV2, acts on the joints.

    They are its row {joint: G}, or its form {(i, k): B} with i <= k.
    """
    form = {place: b for place, b in sorted(e.form.get(j, {}).items()) if place[0] <= place[1]}
    return form or dict(e.along[j])


def unit(robot: Robot, name: str) -> str:
    """Return the SI unit of a standard parameter; for friction it depends on the type of joint."""
    inertial = inertial_names(robot)
    if name in inertial:
        return UNITS_OF_LINKS.get(inertial[name][0], "kg*m**2")
    e, j = element_names(robot)[name]
    return e.unit or KINDS[e.kind].units[robot.frame(j).sigma == PRISMATIC]


def columns(motion: Motion, names: Iterable[str]) -> dict[str, dict[int, Scalar]]:
    """Return the regressor columns {parameter: {actuated joint: D}} of the given parameters."""
    robot, closure, algebra = motion.robot, motion.geometry.closure, motion.algebra
    inertial, elements = inertial_names(robot), element_names(robot)
    axes = Axes(motion)
    algebra.section("Contributions that several joints share")
    result: dict[str, dict[int, Scalar]] = {}
    for name in names:
        require_time()
        tree = (
            axes.column(*inertial[name])
            if name in inertial
            else element_column(motion, *elements[name])
        )
        result[name] = closure.project(algebra, tree)
    return result


def unit_wrench(m: LinkMotion, parameter: str) -> tuple[Vector, Vector]:
    """Return the force F and moment N that move a link whose inertial parameter `parameter` is 1
    and all others 0.
    """
    K = dict.fromkeys(INERTIAL, 0) | {parameter: 1}
    return force(m, K), moment(m, K)


class Axes:
    """Axes of joints i in frames j, and velocities of the origins O_j per unit rate of joint i.

    z_ij is the axis of joint i in frame j, v_ij the velocity of origin O_j per unit rate of joint
    i.
    """

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
                lever = self.v[i, frame.ant] + cross(self.z[i, frame.ant], geometry.P[j])
                for k, x in enumerate(lever, start=1):
                    motion.algebra.hint(x, motion.algebra.named("VS", k, j, i))
                v = geometry.rotation[j].down(lever)
            else:
                z = ZERO3
                v = geometry.from_carrier(j, self.v[i, m]) if inside else E3
            self.z[i, j] = motion.vector("Z", z, j, i)
            self.v[i, j] = motion.vector("V", v, j, i)
        if frame.sigma != FIXED:
            self.z[j, j], self.v[j, j] = (E3, ZERO3) if frame.sigma == REVOLUTE else (ZERO3, E3)

    def column(self, parameter: str, j: int) -> dict[int, Scalar]:
        """Return the joint torques {i: D_ik} of link j if its `parameter` is 1 and all others 0.

        The joints i are the moving joints between the base and link j.
        """
        F, N = unit_wrench(self.motion.link[j], parameter)
        motion = self.motion
        entries: dict[int, Scalar] = {}
        for i in motion.robot.path(j):
            if motion.robot.frame(i).sigma != FIXED:
                turning = motion.algebra.hint(
                    dot(self.z[i, j], N), f"{motion.algebra.named('DN', i)}{parameter}{j}"
                )
                pushing = motion.algebra.hint(
                    dot(self.v[i, j], F), f"{motion.algebra.named('DF', i)}{parameter}{j}"
                )
                entries[i] = motion.algebra.hint(
                    turning + pushing, f"{motion.algebra.named('DG', i)}{parameter}{j}"
                )
        return entries
