"""What a model is: its name, arguments, shape and unit, and its entries from a derivation.

Entries come in cases, each with the inputs of the recursion that it replaces: `Model.values` writes
them over a graph of their own. The table of models is `derive.models`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from symgen.derive.derivation import Derivation
from symgen.derive.graph import Scalar, Symbol
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.loop_equations import loop_system
from symgen.derive.rewrite import Input, Inputs, Rewrite
from symgen.description.expression import ZERO

Place = tuple[int, ...]
LOOP_RESIDUALS = 6  # of a loop: three of position, three of orientation

TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")  # of an origin, and the angular velocity


@dataclass(frozen=True)
class Request:
    """Parameters, frames and substitutions for a model.

    Attributes
    ----------
    parameters : mapping
        {standard parameter: symbol} of the parameters that take part, in the order of the columns.
    of, frame : int
        Which frame's model, in components of which frame.
    inputs : mapping
        Values that replace inputs.
    """

    parameters: Mapping[str, str]
    of: int = 0
    frame: int = 0
    inputs: Inputs = field(default_factory=dict)


@dataclass(frozen=True)
class Entry:
    """A value of a result: its place, the heading and the comment of its line."""

    place: Place
    value: Scalar | int
    heading: str = "Result"
    comment: str = ""


@dataclass(frozen=True)
class Case:
    """Entries that replace the same inputs; `tag` ends the names of the steps that this changes."""

    entries: Sequence[Entry]
    inputs: Inputs = field(default_factory=dict)
    tag: str = ""


@dataclass(frozen=True)
class Values:
    """The entries of a model over a graph of their own, with its angles and headings."""

    entries: tuple[Entry, ...]
    algebra: GraphAlgebra

    @property
    def outputs(self) -> list[Scalar | int]:
        return [entry.value for entry in self.entries]


@dataclass(frozen=True)
class Model:
    """One model, in symbols and as a function of emitted modules.

    Attributes
    ----------
    name : str
        The function, in every target.
    letter : str
        What its entries are called in formulas.
    arguments : tuple of str
        Among q, qd, qdd, tau and X.
    axes : tuple of str
        What its rows and columns are, see `labels`; () for a scalar.
    unit : str
        Of its entries, revolute | prismatic joints, SI.
    meaning : str
        What it is.
    cases : callable or None
        Its entries from a derivation; None for what is composed of others.
    closed : callable or None
        The same entries where they multiply out to fewer terms than those of `cases`.
    composed : str
        How its closed form is composed of others: "formulas", "determinant" or "quotient".
    instead : str
        What works in the place of a recursion that it does not have.
    denominator : str
        What its entries are still to be divided by, where the closed form says that apart.
    result : str
        What emitted text calls the array; empty if no target has the function.
    symbolic : bool
        Whether it can be had as symbols.
    of_frames : bool
        Whether it is that of a frame, in components of a frame.
    symmetric : bool
        Whether entries below the diagonal are those above it, and left out.
    by_columns : bool
        Whether it is stored column by column in a store that is reused.
    of_loops : bool
        Whether it serves the closing of general loops alone.
    up_to_a_constant : bool
        Whether a constant may be added to it.
    page : int
        Its place on the page of a robot, from 1; 0 if it is not shown there.
    case_of : str
        The model that it is where the arguments that it has not are zero: Python modules call that.
    option : str
        What asks targets for it (`symgen generate --with`); empty if they always have it.
    latex : str
        The letter in LaTeX; where left out, `letter` in bold.
    """

    name: str
    letter: str
    arguments: tuple[str, ...]
    axes: tuple[str, ...]
    unit: str
    meaning: str
    cases: Callable[[Derivation, Request], Iterable[Case]] | None
    closed: Callable[[Derivation, Request], Iterable[Case]] | None = None
    result: str = ""
    symbolic: bool = True
    of_frames: bool = False
    symmetric: bool = False
    by_columns: bool = False
    of_loops: bool = False
    composed: str = ""
    instead: str = ""
    denominator: str = ""
    up_to_a_constant: bool = False
    page: int = 0
    case_of: str = ""
    option: str = ""
    latex: str = ""

    @property
    def summary(self) -> str:
        """Description of the model in one sentence; a symbol at its start keeps its case."""
        word = self.meaning.partition(" ")[0]
        first = (
            self.meaning[0] if word in self.arguments + (self.result,) else self.meaning[0].upper()
        )
        return f"{first}{self.meaning[1:]}."

    @property
    def printed(self) -> bool:
        """Whether targets print its entries; what is of any frame they compose of others."""
        return bool(self.result) and self.cases is not None and not self.of_frames

    @property
    def states(self) -> tuple[str, ...]:
        """Arguments that have samples."""
        return tuple(a for a in self.arguments if a != "X")

    @property
    def reads_X(self) -> bool:
        return "X" in self.arguments

    def values(
        self,
        d: Derivation,
        request: Request,
        rewrite: Rewrite | None = None,
        *,
        closed: bool = False,
    ) -> Values:
        """The entries that may differ from zero, rewritten with what the request gives.

        Over the graph of `rewrite`, of the same request, where several models share one. closed :
        to be multiplied out.
        """
        cases = (closed and self.closed) or self.cases
        assert cases is not None
        rewrite = rewrite or rewriting(d, request)
        entries = []
        for case in cases(d, request):
            values = rewrite.copied([e.value for e in case.entries], case.inputs, case.tag)
            entries += [
                Entry(e.place, value, e.heading, e.comment)
                for e, value in zip(case.entries, values, strict=True)
                if not self.symmetric or e.place[0] <= e.place[1]
            ]
        return Values(tuple(entries), rewrite.algebra)


def labels(d: Derivation, axis: str, parameters: Sequence[str]) -> tuple[str, ...]:
    """The rows or columns of a model: joints, tied joints, frames, parameters, components."""
    closure, robot = d.closure, d.robot
    match axis:
        case "joints":
            return tuple(map(str, robot.joints))
        case "parameters":
            return tuple(parameters)
        case "frames":
            return tuple(str(f.j) for f in robot.frames)
        case "pose":
            return ("1", "2", "3", "4")
        case "twist":
            return TWIST
        case "wrench":
            return ("fx", "fy", "fz", "nx", "ny", "nz")
        case "energies":
            return ("kinetic", "potential")
        case "standard parameters":
            return robot.parameters
        case "equations":
            return tuple(str(k + 1) for k in range(len(equations(d))))
        case "residual, derivatives":
            return ("r", *map(str, closure.independent))
        case "curvatures, traces":
            traces = (str(p.cut) for p in robot.loops if p.cut in closure.tied)
            return (*map(str, closure.tied), *traces)
    raise KeyError(axis)


def equations(d: Derivation) -> tuple[int, ...]:
    """The residuals of the loops that close them: all, where no joint is taken as a function."""
    if d.closure.tied and d.closure == loop_system(d.robot).closure:
        return loop_system(d.robot).equations
    return tuple(range(LOOP_RESIDUALS * len(d.robot.loops)))


def rewriting(d: Derivation, request: Request) -> Rewrite:
    """The substitutions that all models share.

    Parameters become those of the request, gravity that of the robot, and inputs their values.
    """
    inputs: dict[Symbol, Input] = {}
    for name in d.robot.parameters:
        symbol = request.parameters.get(name)
        inputs[Symbol("parameter", name)] = Symbol("parameter", symbol) if symbol else ZERO
    inputs |= {Symbol("gravity", str(k)): -e for k, e in enumerate(d.robot.gravity) if e}
    return Rewrite(d.algebra, {**inputs, **request.inputs})
