"""Models in MathML: the section of models of a robot's page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from symgen.description.expression import Expression
from symgen.errors import SymgenError
from symgen.regroup import mathml
from symgen.regroup.mathml import MathML, MathMLPrinter, element
from symgen.regroup.regrouping import Regrouping
from symgen.symbols.derivation import source_of
from symgen.symbols.models import MODELS, Request
from symgen.symbols.printing import passive_notes, terms, text_lines
from symgen.symbols.symbolic_model import SymbolicModel

SHOWN = ("pose", "jacobian", "inertia_matrix", "coriolis", "gravity", "bias", "inverse_dynamics", "closure")
READABLE = 150  # terms of a closed form on a page; longer ones are shown as recursion
EXPANDED = 2000  # terms that are multiplied out to see
DOTTED = re.compile(r"(QP|QDP|GAM)(\d+(?:_\d+)*)")
ANGLE = re.compile(r"(C|S)(\d[\d_mx]*)(b*)")
DOTS = {"QP": "˙", "QDP": "¨"}


class ModelMathML(MathMLPrinter):
    """Velocities and accelerations with dots, C and S with the joints they turn with."""

    def symbol(self, name: str) -> MathML:
        if match := DOTTED.fullmatch(name):
            return element("msub", _letter(match[1]), element("mn", match[2].replace("_", ",")))
        if match := ANGLE.fullmatch(name):
            label = match[2].replace("m", mathml.MINUS).replace("_", ",")
            return element("msub", element("mi", match[1] + "\u2032" * len(match[3])), element("mn", label))
        return super().symbol(name)

    def call(self, function: str, argument: Expression, n: int) -> MathML:
        if function == "Abs":
            inside = element("mrow", element("mo", "|"), self.expression(argument), element("mo", "|"))
            return inside if n == 1 else self.raised(inside, n)
        return super().call(function, argument, n)


def _letter(name: str) -> MathML:
    """Gamma for GAM, q with its dots for QP and QDP, other letters as they are."""
    if name in DOTS:
        return element("mover", element("mi", "q"), element("mo", DOTS[name]), accent="true")
    return element("mi", "Γ" if name == "GAM" else name)


PRINTER = ModelMathML()


@dataclass(frozen=True)
class ShownModel:
    """A model on a page: in closed form `entries` (label, terms), else the text of its recursion in `lines`."""

    title: str
    summary: str
    size: str
    entries: list[tuple[MathML, list[MathML]]]
    angles: list[MathML]
    lines: str


def shown_models(regrouping: Regrouping) -> tuple[list[ShownModel], list[str]]:
    """The models of a robot's page, each in the form that can be read, and what is to be known of its passive joints."""
    robot = regrouping.robot
    source = source_of(robot, regrouping=regrouping)
    request = Request(robot.frames[-1].j, 0)
    models = [SymbolicModel(MODELS[name], source, request, None, EXPANDED) for name in SHOWN if name != "closure" or source.closure.tied]
    return [_shown(model) for model in models if model.model.name != "coriolis" or not source.closure.tied], passive_notes(models[0])


def _shown(model: SymbolicModel) -> ShownModel:
    title = model.model.name.replace("_", " ")
    try:
        closed = model.closed
    except SymgenError:
        closed = None
    if closed is None or closed.size > READABLE:
        listing = model.listing
        return ShownModel(title, model.summary, f"{len(listing.lines)} equations", [], [], "\n".join(text_lines(model, "recursive")))
    entries = [
        (mathml.math(_label(model, place)), mathml.signed_terms(terms(PRINTER, closed.entries[place])))
        for place in model.places
        if place in closed.entries
    ]
    size = f"{closed.size} term{'s' * (closed.size != 1)}"
    return ShownModel(title, model.summary, size, entries, _angles(closed.angles), "")


def _label(model: SymbolicModel, place: tuple[int, ...]) -> MathML:
    inside = ",".join(labels[k] for labels, k in zip(model.axes, place, strict=True))
    return element("msub", _letter(model.model.letter), element("mn", inside))


def _angles(angles: Mapping[str, Expression]) -> list[MathML]:
    return [
        mathml.math(mathml.row([PRINTER.symbol(name), element("mo", "="), PRINTER.call("cos" if name[0] == "C" else "sin", e, 1)]))
        for name, e in angles.items()
    ]
