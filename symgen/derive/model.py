"""One model of a robot: its name, arguments, shape and unit, and the formulas of its entries.

The formulas come from a derivation. They are given in cases; each case has its own values for
inputs of the recursion, such as qdd = 0. `Model.values` writes the formulas into a new graph. The
table of all models is `derive.models`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from symgen.derive.algebra import GraphAlgebra
from symgen.derive.derivation import Derivation
from symgen.derive.graph import Scalar, Symbol
from symgen.derive.loop_equations import loop_system
from symgen.derive.rewrite import Input, Inputs, Rewrite
from symgen.description.expression import ZERO

Place = tuple[int, ...]
LOOP_RESIDUALS = 6  # of a loop: three of position, three of orientation

TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")  # of an origin, and the angular velocity


class Request(NamedTuple):
    """The choices of a user for one model: its parameters, its frames, and values of inputs.

    Attributes
    ----------
    parameters : mapping
        {standard parameter: symbol} of the parameters that take part, in the order of the columns.
    of, frame : int
        Number of the frame that the model describes; number of the frame of the components.
    inputs : mapping
        {input: value that replaces it}.
    """

    parameters: Mapping[str, str]
    of: int = 0
    frame: int = 0
    inputs: Inputs = MappingProxyType({})


class Entry(NamedTuple):
    """One entry of a model array, such as A or Gamma: its index, value, heading and comment."""

    place: Place
    value: Scalar | int
    heading: str = "Result"
    comment: str = ""


class Case(NamedTuple):
    """Entries of a model that are derived with the same values of some inputs, for instance qdd =
    0.

    `tag` ends the names of the intermediate variables that these replaced inputs change.
    """

    entries: Sequence[Entry]
    inputs: Inputs = MappingProxyType({})
    tag: str = ""


class Values(NamedTuple):
    """The entries of one model, as nodes of a graph made for this model."""

    entries: tuple[Entry, ...]
    algebra: GraphAlgebra

    @property
    def outputs(self) -> list[Scalar | int]:
        return [entry.value for entry in self.entries]


class Model(NamedTuple):
    """One model of a robot, such as the inertia matrix: its name, arguments, shape and formulas.

    Attributes
    ----------
    name : str
        Name of its function in all generated languages.
    letter : str
        Letter of its entries in formulas.
    arguments : tuple of str
        Its arguments, such as q, qd, qdd, tau and X.
    axes : tuple of str
        Meaning of its rows and columns, see `labels`; () for a scalar.
    unit : str
        Unit of its entries, for revolute | prismatic joints, SI.
    meaning : str
        Description of the model, without a full stop.
    cases : callable or None
        Function that returns its entries from a derivation; None if other models compose it.
    closed : callable or None
        Function that returns the same entries in a form that multiplies out to fewer terms.
    composed : str
        How its closed form is composed of other models: "formulas", "determinant" or "quotient".
    instead : str
        Advice for the user if the model has no recursion: another model or form that works.
    denominator : str
        Common divisor of its entries, if the closed form gives it apart: "det A".
    result : str
        Name of the array in generated code; empty if no generated code has the function.
    symbolic : bool
        Whether the model is available in symbols.
    of_frames : bool
        Whether it describes one chosen frame, in components of another chosen frame.
    symmetric : bool
        Whether the matrix is symmetric, so that entries below the diagonal are left out.
    by_columns : bool
        Whether generated code stores it column by column in an array that is reused.
    of_loops : bool
        Whether it only serves to close general loops.
    up_to_a_constant : bool
        Whether a constant may be added to it.
    page : int
        Its position on the page of a robot, from 1; 0 if it is not shown there.
    case_of : str
        Model that equals it if the arguments missing here are zero: Python modules call that model.
    option : str
        Option of `symgen generate --with` that adds it; empty if it is always generated.
    latex : str
        The letter in LaTeX; default: `letter` in bold.
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
        """Description of the model as one sentence; a symbol at its start keeps its case."""
        word = self.meaning.partition(" ")[0]
        first = (
            self.meaning[0] if word in self.arguments + (self.result,) else self.meaning[0].upper()
        )
        return f"{first}{self.meaning[1:]}."

    @property
    def printed(self) -> bool:
        """Whether generated code computes the entries of the model by formulas from the expression
        graph.

        A model of a chosen frame, such as the Jacobian, is computed in generated code from other
        models.
        """
        return bool(self.result) and self.cases is not None and not self.of_frames

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the arguments that vary from sample to sample: all except the parameters X."""
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
        """Return the entries of the model for the parameters, frames and inputs of a request.

        rewrite : graph to write the entries into, if several models of the same request share one.
        closed : whether to use the form that is meant to be multiplied out. Of a symmetric matrix,
        only entries on and above the diagonal are returned.
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


AXES: Mapping[str, Callable[[Derivation, Sequence[str]], Iterable[object]]] = {
    "joints": lambda d, parameters: d.robot.joints,
    "parameters": lambda d, parameters: parameters,
    "standard parameters": lambda d, parameters: d.robot.parameters,
    "frames": lambda d, parameters: [f.j for f in d.robot.frames],
    "pose": lambda d, parameters: range(1, 5),
    "twist": lambda d, parameters: TWIST,
    "wrench": lambda d, parameters: ("fx", "fy", "fz", "nx", "ny", "nz"),
    "energies": lambda d, parameters: ("kinetic", "potential"),
    "equations": lambda d, parameters: range(1, len(equations(d)) + 1),
    "residual, derivatives": lambda d, parameters: ("r", *d.closure.independent),
    "curvatures, traces": lambda d, parameters: [
        *d.closure.tied,
        *(loop.cut for loop in d.robot.loops if loop.cut in d.closure.tied),
    ],
}
"""Labels of the rows or columns of a model, by the name of the axis."""


def labels(d: Derivation, axis: str, parameters: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of the rows or columns of a model, such as joint or parameter names."""
    return tuple(map(str, AXES[axis](d, parameters)))


def equations(d: Derivation) -> tuple[int, ...]:
    """Return the indices of the loop residuals that serve as closure equations.

    There is one equation for each tied joint, a passive joint that only these equations relate to
    the actuated joints. If every passive joint stays a symbol instead, all six residuals of each
    loop are used.
    """
    if d.closure.tied and d.closure == loop_system(d.robot).closure:
        return loop_system(d.robot).equations
    return tuple(range(LOOP_RESIDUALS * len(d.robot.loops)))


def rewriting(d: Derivation, request: Request) -> Rewrite:
    """Return a new graph to which formulas are copied with parameters, gravity and inputs replaced
    as in `request`.

    Standard parameters become the symbols of the request or zero, gravity becomes that of the
    robot, and the inputs of the request become their values.
    """
    inputs: dict[Symbol, Input] = {}
    for name in d.robot.parameters:
        symbol = request.parameters.get(name)
        inputs[Symbol("parameter", name)] = Symbol("parameter", symbol) if symbol else ZERO
    inputs |= {Symbol("gravity", str(k)): -e for k, e in enumerate(d.robot.gravity) if e}
    return Rewrite(d.algebra, {**inputs, **request.inputs})
