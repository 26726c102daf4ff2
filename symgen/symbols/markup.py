"""Models in MathML: the section of models of a robot's page."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.derive.models import SYMBOLIC
from symgen.errors import SymgenError
from symgen.regroup.regrouping import Regrouping
from symgen.symbols import mathml, trees
from symgen.symbols.derivation import source_of
from symgen.symbols.mathml import MathML
from symgen.symbols.printing import passive_notes, text_lines
from symgen.symbols.symbolic_model import SymbolicModel

READABLE = 150  # terms of a closed form on a page; longer ones are shown as recursion
EXPANDED = 2000  # terms that are multiplied out to see


@dataclass(frozen=True)
class ShownModel:
    """A model on a page: in closed form `entries` (label, terms), else the text of its recursion in
    `lines`.
    """

    title: str
    summary: str
    size: str
    entries: list[tuple[MathML, list[MathML]]]
    angles: list[MathML]
    lines: str


def shown_models(regrouping: Regrouping) -> tuple[list[ShownModel], list[str]]:
    """The models of a robot's page, each in the form that can be read, and what is to be known of
    its passive joints.
    """
    robot = regrouping.robot
    source = source_of(robot, regrouping=regrouping)
    request = source.request(robot.frames[-1].j, 0)
    models = [
        SymbolicModel(model, source, request, None, EXPANDED)
        for model in sorted(SYMBOLIC.values(), key=lambda model: model.page)
        if model.page
    ]
    return [*filter(None, map(_shown, models))], passive_notes(models[0])


def _shown(model: SymbolicModel) -> ShownModel | None:
    """None where the robot has neither form of the model."""
    title = model.model.name.replace("_", " ")
    try:
        closed = model.closed
    except SymgenError:
        closed = None
    if closed is None or closed.size > READABLE:
        try:
            listing = model.listing
        except SymgenError:
            return None
        return ShownModel(
            title,
            model.summary,
            f"{len(listing.lines)} equations",
            [],
            [],
            "\n".join(text_lines(model, "recursive")),
        )
    entries = [
        (mathml.math(trees.symbol(model.label(place))), mathml.terms(closed.entries[place]))
        for place in model.places
        if place in closed.entries
    ]
    angles = [
        mathml.math(trees.equation(trees.symbol(name), trees.angle(name[0], e)))
        for name, e in closed.angles.items()
    ]
    size = f"{closed.size} term{'s' * (closed.size != 1)}"
    return ShownModel(title, model.summary, size, entries, angles, "")
