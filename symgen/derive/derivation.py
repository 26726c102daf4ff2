"""Derivation of a robot: torques, regressor, inertia matrix and poses as nodes of one graph.

Every recursion runs once, in standard parameters:

    Gamma(q, qd, qdd, g, chi)        torques of the actuated joints, linear in chi
    D_k(q, qd, qdd, g)               columns of the torques, Gamma = sum_k D_k chi_k
    A_0j, P_0j                       poses of the frames
    r(q), dr/dq, Jd qd               closure equations of general loops

Regrouping, code generators, symbols and pages use this graph. A model is one of these values with
some inputs replaced (`derive.rewrite`); the table of models (`derive.models`) defines which inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

from symgen.derive.algebra import GraphAlgebra, Matrix, Scalar, Vector
from symgen.derive.closure import Closure
from symgen.derive.composite import CompositeLinks
from symgen.derive.constants import numbered
from symgen.derive.geometry import Geometry, frame_poses
from symgen.derive.loops import close
from symgen.derive.newton_euler import Motion, joint_torques
from symgen.derive.regressor import columns, element_column, element_names
from symgen.description.robot import Robot

ABSORBED = ("YY", "MZ", "M")
"""Inertial parameters that base parameters take in: derived last, so they name no shared step."""


class Derivation(NamedTuple):
    """The formulas of a robot (torques, regressor, inertia matrix, poses) as nodes of one graph.

    Models may later add nodes to this graph, but change none.

    Attributes
    ----------
    robot : Robot
        The robot.
    closure : Closure
        The moving joints as functions of the independent joints.
    algebra : GraphAlgebra
        The graph, its angles, its headings.
    geometry : Geometry
        Rotations and positions of the frames.
    motion : Motion
        Velocities and accelerations of the links.
    chi : mapping
        Scalar of each standard parameter.
    torque : mapping
        Gamma by actuated joint, N m or N, after the six rows of a free base (`Robot.rows`).
    inertia : mapping
        {(i, k): A_ik} of these rows.
    columns : mapping
        {standard parameter: {row: D}}.
    poses : mapping
        {frame: (A_0j, P_0j)}.
    """

    robot: Robot
    closure: Closure
    algebra: GraphAlgebra
    geometry: Geometry
    motion: Motion
    chi: Mapping[str, Scalar]
    torque: Mapping[int, Scalar]
    inertia: Mapping[tuple[int, int], Scalar]
    columns: Mapping[str, Mapping[int, Scalar]]
    poses: Mapping[int, tuple[Matrix, Vector]]

    def actuated(self, torque: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """Convert torques of all moving joints to torques of the actuated joints, by virtual work.

        The result is G' Gamma, with G = dq/dq_a and the torques Gamma of the moving joints. Every
        actuated joint has an entry, even if its torque is zero.
        """
        projected = self.geometry.closure.project(self.algebra, torque)
        return {i: projected.get(i, 0) for i in self.robot.joints}


@lru_cache(maxsize=8)
def derive(robot: Robot) -> Derivation:
    """Derive torques, regressor, inertia matrix and poses of a robot as nodes of one graph.

    A second call returns the stored result. Raises DescriptionError if the loops cannot close.
    """
    return derived(robot, close)


def derived(robot: Robot, closing: Callable[[Robot], Closure]) -> Derivation:
    """Derive the formulas of a robot, with the joint relations that the function `closing` returns.

    These relations (a `Closure`) define the independent joints. Decimal numbers of the robot file
    stay inputs of the graph, so that formulas show them as written.
    """
    written = numbered(robot)
    closure, algebra = closing(written), GraphAlgebra(written)
    geometry = Geometry(written, algebra, closure)
    motion = Motion(geometry)
    chi = {name: algebra.parameter(name) for name in robot.parameters}
    torque = joint_torques(motion, chi)
    algebra.section("Friction, actuators")
    for name, (e, key) in element_names(written).items():
        for i, x in element_column(motion, e, key).items():
            torque[i] = torque[i] + chi[name] * x
    actuated = closure.project(algebra, torque)
    last = [name for name in robot.parameters if name.rstrip("0123456789") in ABSORBED]
    D = columns(motion, [*(name for name in robot.parameters if name not in last), *last])
    poses = frame_poses(geometry)
    inertia = closure.project_twice(algebra, CompositeLinks(geometry, chi).matrix())
    algebra.graph.seal()
    rows = {i: actuated.get(i, 0) for i in robot.rows}
    return Derivation(
        robot, closing(robot), algebra, geometry, motion, chi, rows, inertia, D, poses
    )
