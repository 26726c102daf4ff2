"""What an emitted module says, as data: which functions over which columns, their lines, the header, the tables.

Everything is computed here; templates only lay it out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from textwrap import wrap

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
from symgen.description.robot import PRISMATIC, Robot
from symgen.emit.printers import Section, Text
from symgen.emit.values import Program
from symgen.regroup.regrouping import Regrouping

WIDTH = 120
STATES = {"q": "q", "qd": "QP", "qdd": "QDP"}
Headings = list[tuple[int, str]]  # (index of the first node, title)
LOCALS = ("D", "GAM", "A", "T", "X", "G", "R", "B", "np", "ca", "q", "qd", "qdd", "S", "out", "N")


@dataclass(frozen=True)
class Function:
    """One block function: `states` it reads, whether it takes X, its sections and what they cost."""

    states: tuple[str, ...]
    sections: tuple[Section, ...]
    mul: int
    add: int
    sin: int
    cos: int

    @property
    def cost(self) -> str:
        return f"{self.mul} multiplications, {self.add} additions, {self.sin} sin, {self.cos} cos"


@dataclass(frozen=True)
class ModuleSpec:
    """All that the templates lay out."""

    robot: Robot
    regrouping: Regrouping
    structure: tuple[tuple[bool, ...], ...]  # [k][j]: entry (base parameter, joint) not identically zero
    constant_entries: tuple[tuple[int, int, float], ...]
    regressor: Function
    inverse_dynamics: Function
    inertia_matrix: Function
    bias: Function
    gravity: Function
    frame_poses: Function
    closure: Function | None = None  # general loops: residual and Jacobian of the closure equations
    curvature: Function | None = None  # general loops: Jd qd, alignment of the frames

    @property
    def tied(self) -> tuple[int, ...]:
        """Passive joints that only the closure equations tie to the actuated ones."""
        return close(self.robot).tied


def module_spec(regrouping: Regrouping, printer: type[Text] = Text) -> ModuleSpec:
    """Derive every model of the module for the base parameters of `regrouping`, and print it in the language of `printer`."""
    robot = regrouping.robot
    structure, constants, regressor = _regressor(regrouping, printer)
    return ModuleSpec(
        robot=robot,
        regrouping=regrouping,
        structure=structure,
        constant_entries=constants,
        regressor=regressor,
        inverse_dynamics=_torques(regrouping, printer=printer),
        inertia_matrix=_inertia_matrix(regrouping, printer),
        bias=_torques(regrouping, acceleration=False, printer=printer),
        gravity=_torques(regrouping, acceleration=False, velocity=False, printer=printer),
        frame_poses=_frame_poses(robot, printer),
        closure=_closure(robot, printer) if close(robot).tied else None,
        curvature=_curvature(robot, printer) if close(robot).tied else None,
    )


def regressor_program(regrouping: Regrouping, own: Sequence[str]) -> tuple[list[tuple[int, int]], Program]:
    """The entries (k, row) that may differ from zero, and the program that computes them, for the columns `own`."""
    robot = regrouping.robot
    algebra = GraphAlgebra(robot)
    D = columns(Motion(Geometry(robot, algebra, close(robot))), own)
    rows = {j: row for row, j in enumerate(robot.joints)}
    entries = [(k, rows[j]) for k, name in enumerate(own) for j in sorted(D[name]) if j in rows]
    return entries, Program(algebra, [D[own[k]][robot.joints[row]] for k, row in entries])


def _regressor(
    regrouping: Regrouping, printer: type[Text]
) -> tuple[tuple[tuple[bool, ...], ...], tuple[tuple[int, int, float], ...], Function]:
    robot = regrouping.robot
    entries, program = regressor_program(regrouping, regrouping.own)
    structure = [[False] * len(robot.joints) for _ in regrouping.base]
    constants: list[tuple[int, int, float]] = []
    text = printer(program.outputs, program.sections, (*LOCALS, *robot.constants))
    lines: dict[int, list[str]] = {row: [] for row in range(len(robot.joints))}
    for (k, row), value in zip(entries, program.outputs, strict=True):
        if isinstance(value, int):
            structure[k][row] = value != 0
            if value:
                constants.append((k, row, float(value)))
            continue
        structure[k][row] = True
        lines[row].append(f"D[{k}, {row}] = {text.expression(value)}\tDG{robot.joints[row]}{regrouping.own[k]}")
    results = [Section(f"Joint {robot.joints[row]}", _aligned(block)) for row, block in lines.items() if block]
    return tuple(map(tuple, structure)), tuple(constants), _function(robot, text, results)


def _aligned(lines: Sequence[str]) -> tuple[str, ...]:
    """Comments behind a tab in one column, up to a limit."""
    width = min(max((len(line.partition("\t")[0]) for line in lines), default=0), 64)
    return tuple(f"{code:<{width}}  # {comment}" for code, _, comment in (line.partition("\t") for line in lines))


def _function(robot: Robot, text: Text, results: Iterable[Section], parameters: Sequence[str] = ()) -> Function:
    needed = text.inputs
    independent = close(robot).independent
    inputs: list[str] = []
    states: list[str] = []
    for state, letter in STATES.items():
        names = [f"{letter}{j}" for j in independent]
        used = [name for name in names if name in needed]
        if used:
            states.append(state)
        if used == names and len(names) > 1:
            inputs += _unpack(names, state)
        else:
            inputs += [f"{name} = {state}[{names.index(name)}]" for name in used]
    rates = [Names(len(robot.frames))("G", u, i) for u in close(robot).tied for i in robot.joints]
    inputs += [f"{name} = G[{k}]" for k, name in enumerate(rates) if name in needed]
    used = [name for name in parameters if name in needed]
    if used and used == list(parameters):
        inputs += _unpack(used, "X")
    else:
        inputs += [f"{name} = X[{list(parameters).index(name)}]" for name in used]
    sections = ([Section("Inputs", tuple(inputs))] if inputs else []) + list(text.sections) + list(results)
    return Function(tuple(states), tuple(sections), *text.operations, *text.trigonometry)


def _unpack(names: Sequence[str], source: str) -> list[str]:
    text = ", ".join(names) + ("," if len(names) == 1 else "")
    if len(text) + len(source) + 3 < WIDTH - 4:
        return [f"{text} = {source}"]
    return ["(", *(f"    {line}" for line in wrap(text, WIDTH - 8)), f") = {source}"]


class _Base:
    """The base parameters as scalars of a graph, in the place of the standard parameters they stand for."""

    def __init__(self, regrouping: Regrouping, algebra: GraphAlgebra, only: Callable[[str], bool] = lambda own: True) -> None:
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


def inverse_dynamics(regrouping: Regrouping, only: Callable[[str], bool] = lambda own: True) -> Function:
    """Gamma with the base parameters for which only(own name) holds."""
    return _torques(regrouping, only=only)


def torque_graph(
    regrouping: Regrouping, *, acceleration: bool = True, velocity: bool = True, only: Callable[[str], bool] = lambda own: True
) -> tuple[list[Scalar | int], Headings]:
    """Gamma of the actuated joints, and the headings of its steps."""
    robot = regrouping.robot
    algebra = GraphAlgebra(robot)
    base = _Base(regrouping, algebra, only)
    motion = Motion(Geometry(robot, algebra, close(robot)), acceleration=acceleration, velocity=velocity)
    torque = base.torques(motion, friction=velocity)
    return [torque[j] for j in robot.joints], algebra.sections


def _torques(
    regrouping: Regrouping,
    *,
    acceleration: bool = True,
    velocity: bool = True,
    only: Callable[[str], bool] = lambda own: True,
    printer: type[Text] = Text,
) -> Function:
    robot = regrouping.robot
    outputs, headings = torque_graph(regrouping, acceleration=acceleration, velocity=velocity, only=only)
    text = printer(outputs, headings, (*LOCALS, *robot.constants))
    results = [Section("Torques", tuple(f"GAM[{row}] = {text.expression(value)}" for row, value in enumerate(outputs)))]
    return _function(robot, text, results, regrouping.names)


def inertia_graph(regrouping: Regrouping) -> tuple[dict[tuple[int, int], Scalar | int], Headings]:
    """The lower triangle of A by (row, column), and the headings of its steps."""
    robot = regrouping.robot
    algebra = GraphAlgebra(robot)
    base, geometry = _Base(regrouping, algebra), Geometry(robot, algebra, close(robot))
    entries: dict[tuple[int, int], Scalar | int] = {}
    rows = {j: row for row, j in enumerate(robot.joints)}
    for i in robot.joints:
        torque = base.torques(Motion(geometry, unit=i))
        entries |= {(rows[j], rows[i]): torque[j] for j in robot.joints if j >= i}
    return entries, algebra.sections


def _inertia_matrix(regrouping: Regrouping, printer: type[Text]) -> Function:
    robot = regrouping.robot
    entries, headings = inertia_graph(regrouping)
    text = printer(list(entries.values()), headings, (*LOCALS, *robot.constants))
    lines = []
    for (j, i), value in entries.items():
        targets = f"A[{j}, {i}]" + (f" = A[{i}, {j}]" if i != j else "")
        lines.append(f"{targets} = {text.expression(value)}")
    return _function(robot, text, [Section("Inertia matrix", tuple(lines))], regrouping.names)


def _frame_poses(robot: Robot, printer: type[Text]) -> Function:
    algebra = GraphAlgebra(robot)
    pose = frame_poses(Geometry(robot, algebra, close(robot)))
    entries: list[tuple[str, Scalar | int]] = []
    for row, f in enumerate(robot.frames):
        A, P = pose[f.j]
        entries += [(f"T[{row}, {k}, {m}]", A[k][m]) for k in range(3) for m in range(3)]
        entries += [(f"T[{row}, {k}, 3]", P[k]) for k in range(3)]
    return _assignments(robot, algebra, entries, "Poses", printer)


def _closure(robot: Robot, printer: type[Text]) -> Function:
    algebra, system = GraphAlgebra(robot), loop_system(robot)
    entries = [(f"R[{k}, 0]", x) for k, x in enumerate(system.residual(algebra))]
    for k, row in enumerate(system.jacobian(algebra)):
        entries += [(f"R[{k}, {column}]", x) for column, x in enumerate(row, start=1)]
    return _assignments(robot, algebra, entries, "Residuals and their derivatives by the joints", printer)


def _curvature(robot: Robot, printer: type[Text]) -> Function:
    algebra, system = GraphAlgebra(robot), loop_system(robot)
    values = [*system.curvature(algebra), *system.alignment(algebra)]
    return _assignments(robot, algebra, [(f"B[{k}]", x) for k, x in enumerate(values)], "Second derivatives at constant rates", printer)


def _assignments(
    robot: Robot, algebra: GraphAlgebra, entries: Sequence[tuple[str, Scalar | int]], title: str, printer: type[Text]
) -> Function:
    text = printer([value for _, value in entries], algebra.sections, (*LOCALS, *robot.constants))
    return _function(robot, text, [Section(title, tuple(f"{target} = {text.expression(value)}" for target, value in entries))])


def unit(robot: Robot, name: str) -> str:
    """Unit of a standard parameter, by family and by what its joint does."""
    inertial = inertial_names(robot)
    if name in inertial:
        family = inertial[name][0]
        return "kg" if family == "M" else "kg*m" if family.startswith("M") else "kg*m**2"
    e, j = element_names(robot)[name]
    slides = robot.frame(j).sigma == PRISMATIC
    table = {
        "inertia": ("kg*m**2", "kg"),
        "viscous": ("N*m*s/rad", "N*s/m"),
        "coulomb": ("N*m", "N"),
        "offset": ("N*m", "N"),
        "stiffness": ("N*m/rad", "N/m"),
    }
    return table[e.kind][slides]


def is_inertial(robot: Robot) -> Callable[[str], bool]:
    """Whether a standard parameter is one of the ten of a link."""
    names = inertial_names(robot)
    return lambda own: own in names


def is_inertial_or_actuator(robot: Robot) -> Callable[[str], bool]:
    """Whether a standard parameter is inertial or the inertia of an actuator."""
    inertial, elements = inertial_names(robot), element_names(robot)
    return lambda own: own in inertial or elements[own][0].kind == "inertia"
