"""What an emitted module says, as data: the lines of its blocks, what each of them reads, its constant entries, its costs.

Everything is computed here; templates only lay it out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import wrap

from symgen.derive.columns import element_names, inertial_names
from symgen.derive.graph import Scalar
from symgen.derive.loops import close
from symgen.derive.names import families_of
from symgen.description.robot import PRISMATIC, Robot
from symgen.emit.models import (
    LOCALS,
    MODELS,
    STATES,
    Entry,
    Model,
    Only,
    Values,
    is_inertial,
    is_inertial_or_actuator,
    rates_of_tied_joints,
    regressor_program,
    sizes,
    tables_of,
    torques,
)
from symgen.emit.printers import Section, Text
from symgen.regroup.regrouping import Regrouping

WIDTH = 120
KIND_UNITS = {  # revolute, prismatic
    "inertia": ("kg*m**2", "kg"),
    "viscous": ("N*m*s/rad", "N*s/m"),
    "coulomb": ("N*m", "N"),
    "offset": ("N*m", "N"),
    "stiffness": ("N*m/rad", "N/m"),
}


@dataclass(frozen=True)
class Function:
    """The block of one model in Python.

    Attributes
    ----------
    states, constants : tuple of str
        What the block reads of q, qd, qdd and G (rates of the tied joints), and of the constants of the robot.
    reads_X : bool
        Whether the block reads base parameters.
    preset : list of (place, value)
        Entries that are numbers other than zero.
    families : tuple of str
        Families of the names in its lines.
    mul, add, sin, cos : int
        Operations per sample.
    """

    model: Model
    states: tuple[str, ...]
    constants: tuple[str, ...]
    reads_X: bool
    preset: list[tuple[tuple[int, ...], float]] = field(repr=False)
    sections: tuple[Section, ...] = field(repr=False)
    families: tuple[str, ...]
    mul: int
    add: int
    sin: int
    cos: int

    @property
    def cost(self) -> str:
        return f"{self.mul} multiplications, {self.add} additions, {self.sin} sin, {self.cos} cos"


@dataclass(frozen=True)
class ModuleSpec:
    """All that the templates of a Python module lay out; structure[k][j]: entry (base parameter, joint) not identically zero."""

    robot: Robot
    regrouping: Regrouping
    structure: tuple[tuple[bool, ...], ...]
    functions: Mapping[str, Function]

    @property
    def tied(self) -> tuple[int, ...]:
        """Passive joints that only the closure equations tie to the actuated ones."""
        return close(self.robot).tied

    @property
    def sizes(self) -> dict[str, int]:
        return sizes(self.robot, len(self.regrouping))


def module_spec(regrouping: Regrouping, printer: type[Text] = Text) -> ModuleSpec:
    """Derive every model of the module for the base parameters of `regrouping`, and print it in the language of `printer`."""
    robot = regrouping.robot
    structure = [[False] * len(robot.joints) for _ in regrouping.base]
    functions = {}
    for name, model in tables_of(robot).items():
        assert model.values is not None
        values = model.values(regrouping)
        if name == "regressor":
            for (k, row), entry in values.by_place:
                structure[k][row] = entry.value != 0 if isinstance(entry.value, int) else True
        functions[name] = _function(regrouping, model, values, printer)
    return ModuleSpec(robot, regrouping, tuple(map(tuple, structure)), functions)


def inverse_dynamics(regrouping: Regrouping, only: Only = lambda own: True) -> Function:
    """Gamma with the base parameters for which only(own name) holds."""
    return _function(regrouping, MODELS["inverse_dynamics"], torques(regrouping, only=only), Text)


def _function(regrouping: Regrouping, model: Model, values: Values, printer: type[Text]) -> Function:
    robot = regrouping.robot
    text = printer(values.outputs, values.headings, (*LOCALS, *robot.constants))
    needed = text.inputs
    independent = close(robot).independent
    sources = {state: [f"{letter}{j}" for j in independent] for state, letter in STATES.items()}
    sources |= {"G": list(rates_of_tied_joints(robot)), "X": list(regrouping.names)}
    inputs = [line for source, names in sources.items() for line in _unpack(source, names, needed)]
    read = tuple(source for source, names in sources.items() if needed & {*names})
    written = [entry for entry in values.entries if isinstance(entry.value, Scalar)]
    return Function(
        model=model,
        states=tuple(source for source in read if source != "X"),
        constants=tuple(name for name in robot.constants if name in needed),
        reads_X="X" in read,
        preset=[(place, float(entry.value)) for place, entry in values.by_place if isinstance(entry.value, int) and entry.value],
        sections=tuple(s for s in (Section("Inputs", tuple(inputs)), *text.sections, *_results(text, model, written)) if s.lines),
        families=families_of(text.given),
        mul=text.operations[0],
        add=text.operations[1],
        sin=text.trigonometry[0],
        cos=text.trigonometry[1],
    )


def _results(text: Text, model: Model, entries: Iterable[Entry]) -> list[Section]:
    lines: dict[str, list[str]] = {}  # by heading
    for entry in entries:
        targets = " = ".join(text.place(model.result, place) for place in entry.places)
        lines.setdefault(entry.heading, []).append(f"{targets} = {text.expression(entry.value)}\t{entry.comment}")
    return [Section(heading, aligned(under)) for heading, under in lines.items()]


def aligned(lines: Sequence[str]) -> tuple[str, ...]:
    """Comments behind a tab in one column, up to a limit."""
    parts = [line.partition("\t") for line in lines]
    width = min(max((len(code) for code, _, _ in parts), default=0), 64)
    return tuple(f"{code:<{width}}  # {comment}" if comment else code for code, _, comment in parts)


def _unpack(source: str, names: Sequence[str], needed: set[str]) -> list[str]:
    """`q1, q2 = q`, or a slice of it where those needed stand side by side; else one by one."""
    used = [(k, name) for k, name in enumerate(names) if name in needed]
    if len(used) < 2 or used[-1][0] - used[0][0] >= len(used):
        return [f"{name} = {source}[{k}]" for k, name in used]
    start, stop = used[0][0] or "", used[-1][0] + 1
    span = "" if len(used) == len(names) else f"[{start}:{stop if stop < len(names) else ''}]"
    return unpacked([name for _, name in used], f"{source}{span}")


def unpacked(names: Sequence[str], source: str) -> list[str]:
    """`names = source` on as many lines as it needs."""
    text = ", ".join(names) + ("," if len(names) == 1 else "")
    if len(text) + len(source) + 3 < WIDTH - 4:
        return [f"{text} = {source}"]
    return ["(", *(f"    {line}" for line in wrap(text, WIDTH - 8)), f") = {source}"]


def unit(robot: Robot, name: str) -> str:
    """Unit of a standard parameter, by family and by what its joint does."""
    inertial = inertial_names(robot)
    if name in inertial:
        family = inertial[name][0]
        return "kg" if family == "M" else "kg*m" if family.startswith("M") else "kg*m**2"
    e, j = element_names(robot)[name]
    return KIND_UNITS[e.kind][robot.frame(j).sigma == PRISMATIC]


__all__ = [
    "Function",
    "ModuleSpec",
    "inverse_dynamics",
    "is_inertial",
    "is_inertial_or_actuator",
    "module_spec",
    "regressor_program",
    "unit",
]
