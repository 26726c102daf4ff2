"""The models of an emitted module, one table that every target reads, and their values as nodes of a graph.

A model with `values` is a graph: each target prints it as a block. One without is composed of others in the template of the target.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from symgen.derive.columns import columns, element_names, inertial_names
from symgen.derive.elements import element_column
from symgen.derive.geometry import Geometry
from symgen.derive.graph import Scalar
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.kinematics import frame_poses
from symgen.derive.loop_equations import loop_system
from symgen.derive.loops import close
from symgen.derive.names import Names
from symgen.derive.newton_euler import Motion, joint_torques
from symgen.derive.scalar import add, mul
from symgen.description.robot import Robot
from symgen.emit.values import Program
from symgen.regroup.regrouping import Regrouping

STATES = {"q": "q", "qd": "QP", "qdd": "QDP"}  # argument: family of its components
LOCALS = ("D", "GAM", "A", "T", "X", "G", "R", "B", "np", "ca", "q", "qd", "qdd", "S", "out", "N", "states")
HOMOGENEOUS = (0, 0, 0, 1)  # last row of a pose

Headings = Sequence[tuple[int, str]]  # (index of the first node, title)
Only = Callable[[str], bool]  # whether a base parameter takes part, by the standard parameter it is called after


@dataclass(frozen=True)
class Entry:
    """A value of a result: where it stands (twice in a symmetric matrix), the heading and the comment of its line."""

    places: tuple[tuple[int, ...], ...]
    value: Scalar | int
    heading: str
    comment: str = ""


@dataclass(frozen=True)
class Values:
    """All entries of a model and the headings of the steps that lead to them."""

    entries: tuple[Entry, ...]
    headings: Headings

    @property
    def outputs(self) -> list[Scalar | int]:
        return [entry.value for entry in self.entries]

    @property
    def by_place(self) -> list[tuple[tuple[int, ...], Entry]]:
        """Every place with its entry, in the order of the places."""
        return sorted(((place, entry) for entry in self.entries for place in entry.places), key=lambda pair: pair[0])


@dataclass(frozen=True)
class Model:
    """One function of an emitted module.

    Attributes
    ----------
    name : str
        The function, in every target.
    arguments : tuple of str
        Among q, qd, qdd, tau and X.
    result : str
        What the array is called that the function returns.
    axes : tuple of str or int
        Its shape without samples: numbers, or keys of `sizes`.
    summary : str
        What is returned.
    values : callable or None
        The entries from a regrouping.
    """

    name: str
    arguments: tuple[str, ...]
    result: str
    axes: tuple[str | int, ...]
    summary: str
    values: Callable[[Regrouping], Values] | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """Arguments that have samples."""
        return tuple(a for a in self.arguments if a != "X")

    @property
    def reads_X(self) -> bool:
        return "X" in self.arguments

    def shape(self, robot: Robot, b: int) -> tuple[int, ...]:
        """The shape without samples, of a robot with b base parameters."""
        return tuple(a if isinstance(a, int) else sizes(robot, b)[a] for a in self.axes)


def sizes(robot: Robot, b: int) -> dict[str, int]:
    """Actuated, tied, independent joints n, m, k; base and standard parameters b, p; frames; `rows` of R, `traces` of loops behind those of B."""
    closure = close(robot)
    m, k = len(closure.tied), len(closure.independent)
    traces = sum(loop.cut in closure.tied for loop in robot.loops)
    return {"n": len(robot.joints), "m": m, "k": k, "b": b, "p": len(robot.parameters), "frames": len(robot.frames)} | {
        "R columns": 1 + k,
        "B rows": m + traces,
    }


def regressor_program(regrouping: Regrouping, own: Sequence[str]) -> tuple[list[tuple[int, int]], Program]:
    """The entries (k, row) that may differ from zero, and the program that computes them, for the columns `own`."""
    robot = regrouping.robot
    algebra = GraphAlgebra(robot)
    D = columns(Motion(Geometry(robot, algebra, close(robot))), own)
    entries = [(k, row) for k, name in enumerate(own) for row, j in enumerate(robot.joints) if j in D[name]]
    return entries, Program(algebra, [D[own[k]][robot.joints[row]] for k, row in entries])


def _regressor(regrouping: Regrouping) -> Values:
    joints, own = regrouping.robot.joints, regrouping.own
    places, program = regressor_program(regrouping, own)
    entries = [
        Entry(((k, row),), value, f"Joint {joints[row]}", f"DG{joints[row]}{own[k]}")
        for (k, row), value in zip(places, program.outputs, strict=True)
    ]
    return Values(tuple(sorted(entries, key=lambda entry: entry.places[0][::-1])), program.sections)


class _Base:
    """The base parameters as scalars of a graph, in the place of the standard parameters they are called after."""

    def __init__(self, regrouping: Regrouping, algebra: GraphAlgebra, only: Only) -> None:
        self.K = {b.own: algebra.graph.symbol(b.name, fixed=True) for b in regrouping.base if only(b.own)}
        self.elements = {name: e for name, e in element_names(regrouping.robot).items() if name in self.K}

    def torques(self, motion: Motion, *, friction: bool = True) -> dict[int, Scalar | int]:
        total = joint_torques(motion, self.K)
        motion.algebra.section("Friction, actuators")
        for name, (e, key) in self.elements.items():
            if friction or e.kind not in ("viscous", "coulomb"):
                for i, value in element_column(motion, e, key).items():
                    total[i] = add(total[i], mul(self.K[name], value))
        return motion.geometry.closure.project(motion.algebra, total)


def torques(regrouping: Regrouping, *, acceleration: bool = True, velocity: bool = True, only: Only = lambda own: True) -> Values:
    """Gamma of the actuated joints; without `velocity` at rest and without friction."""
    robot = regrouping.robot
    algebra = GraphAlgebra(robot)
    motion = Motion(Geometry(robot, algebra, close(robot)), acceleration=acceleration, velocity=velocity)
    torque = _Base(regrouping, algebra, only).torques(motion, friction=velocity)
    return Values(tuple(Entry(((row,),), torque[j], "Torques") for row, j in enumerate(robot.joints)), algebra.sections)


def _inertia_matrix(regrouping: Regrouping) -> Values:
    """A; entries beside the diagonal stand at two places."""
    robot, joints = regrouping.robot, list(enumerate(regrouping.robot.joints))
    algebra = GraphAlgebra(robot)
    base, geometry = _Base(regrouping, algebra, lambda own: True), Geometry(robot, algebra, close(robot))
    entries = []
    for column, i in joints:
        torque = base.torques(Motion(geometry, unit=i))
        for row, j in joints[column:]:
            entries.append(Entry(tuple(dict.fromkeys(((row, column), (column, row)))), torque[j], "Inertia matrix"))
    return Values(tuple(entries), algebra.sections)


def _frame_poses(regrouping: Regrouping) -> Values:
    algebra = GraphAlgebra(regrouping.robot)
    poses = frame_poses(Geometry(regrouping.robot, algebra, close(regrouping.robot)))
    entries = []
    for j, (A, P) in poses.items():
        rows = (*((*A[k], P[k]) for k in range(3)), HOMOGENEOUS)
        entries += [Entry(((j - 1, k, m),), value, "Poses") for k, row in enumerate(rows) for m, value in enumerate(row)]
    return Values(tuple(entries), algebra.sections)


def _closure(regrouping: Regrouping) -> Values:
    algebra, system = GraphAlgebra(regrouping.robot), loop_system(regrouping.robot)
    rows = [[x] for x in system.residual(algebra)]
    for row, derivatives in zip(rows, system.jacobian(algebra), strict=True):
        row += derivatives
    title = "Residuals and their derivatives by the joints"
    return Values(tuple(Entry(((k, column),), x, title) for k, row in enumerate(rows) for column, x in enumerate(row)), algebra.sections)


def _curvature(regrouping: Regrouping) -> Values:
    algebra, system = GraphAlgebra(regrouping.robot), loop_system(regrouping.robot)
    values = [*system.curvature(algebra), *system.alignment(algebra)]
    return Values(tuple(Entry(((k,),), x, "Second derivatives at constant rates") for k, x in enumerate(values)), algebra.sections)


POSES = "Homogeneous transform of every frame j in frame 0, at index j - 1"
MODELS = {
    model.name: model
    for model in (
        Model("regressor", ("q", "qd", "qdd"), "D", ("b", "n"), "D of Gamma = D X", _regressor),
        Model("inverse_dynamics", ("q", "qd", "qdd", "X"), "GAM", ("n",), "Joint torques Gamma", torques),
        Model("inertia_matrix", ("q", "X"), "A", ("n", "n"), "A(q), actuators included: column i is Gamma for a unit acceleration of joint i from rest", _inertia_matrix),
        Model("bias", ("q", "qd", "X"), "GAM", ("n",), "Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset", lambda r: torques(r, acceleration=False)),
        Model("gravity", ("q", "X"), "GAM", ("n",), "Gamma at rest without friction: gravity, offset and springs (a base parameter may mix them)", lambda r: torques(r, acceleration=False, velocity=False)),
        Model("forward_dynamics", ("q", "qd", "tau", "X"), "qdd", ("n",), "qdd = A(q)**-1 (tau - bias)"),
        Model("frame_poses", ("q",), "T", ("frames", 4, 4), POSES, _frame_poses),
        Model("jacobian", ("q",), "J", (6, "n"), "J: velocity of the origin of `frame` (default: the last), then its angular velocity, in frame 0"),
    )
}  # fmt: skip
LOOP_MODELS = {  # of joints that only the closure equations tie to the actuated ones
    model.name: model
    for model in (
        Model("closure", ("q",), "R", ("m", "R columns"), "Closure residuals, then their derivatives by the joints", _closure),
        Model("curvature", ("q", "qd"), "B", ("B rows",), "Second derivatives of the residuals at constant rates, then traces of A_cut' A_twin", _curvature),
    )
}  # fmt: skip


def rates_of_tied_joints(robot: Robot) -> dict[str, int]:
    """{name: row of G}: the rate of each tied joint per unit rate of each actuated one."""
    named = Names(len(robot.frames))
    return {named("G", u, i): k for k, (u, i) in enumerate((u, i) for u in close(robot).tied for i in robot.joints)}


def is_inertial(robot: Robot) -> Only:
    """Whether a standard parameter is one of the ten of a link."""
    return inertial_names(robot).__contains__


def is_inertial_or_actuator(robot: Robot) -> Only:
    """Whether a standard parameter is inertial or the inertia of an actuator."""
    inertial, elements = inertial_names(robot), element_names(robot)
    return lambda own: own in inertial or elements[own][0].kind == "inertia"


def tables_of(robot: Robot) -> Mapping[str, Model]:
    """The models with a graph, those of general loops included where joints are tied."""
    graphs = {name: model for name, model in MODELS.items() if model.values}
    return graphs | LOOP_MODELS if close(robot).tied else graphs
