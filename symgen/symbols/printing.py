"""Models as text, LaTeX, MathML, lines of SymPy, and plain values for JSON; in closed form or as
recursion.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from symgen.derive.names import Names
from symgen.description.expression import Expression
from symgen.emit.header import frame_table, wrapped
from symgen.emit.render import WIDTH
from symgen.errors import SymgenError
from symgen.symbols import breaking, latex, trees
from symgen.symbols.symbolic_model import SymbolicModel
from symgen.symbols.sympy_objects import of_listing, of_model, operated, source_text
from symgen.symbols.text import text as plain

FORMS = ("closed", "recursive")
FORMATS = ("text", "latex", "latex-fragment", "sympy", "json")


def printed(model: SymbolicModel, form: str, language: str) -> str:
    """A model as text, latex, sympy or json, in closed or recursive form. Raises SymgenError where
    the form has too many terms or is none.
    """
    for what, given, known in (("form", form, FORMS), ("format", language, FORMATS)):
        if given not in known:
            raise SymgenError(f"{what} {given!r}; expected one of {', '.join(known)}")
    writers = (text, latex_document, latex_fragment, sympy_lines, json_text)
    return dict(zip(FORMATS, writers, strict=True))[language](model, form)


@dataclass(frozen=True)
class Formulas:
    """A model as formulas: text where it is printed, typeset in a notebook."""

    model: SymbolicModel
    form: str

    def __str__(self) -> str:
        return text(self.model, self.form)

    def _repr_latex_(self) -> str:
        sections = latex_lines(self.model, self.form)
        lines = [x for title, lines in sections.items() if title != "Angles" for x in lines]
        return f"$${latex.aligned(lines, 'aligned')}$$"


def closed_texts(model: SymbolicModel) -> dict[str, str]:
    """{label: value} of the entries that are not zero; the numerators where the model has a
    denominator.
    """
    entries = model.closed.entries
    return {model.label(p): plain(entries[p]) for p in model.places if p in entries}


# --- what stands beside a model ---


def notes(model: SymbolicModel) -> list[str]:
    """Sentences without which a model cannot be read: its parameters, what is left out, its passive
    joints.
    """
    source = model.source
    lines = []
    if model.model.reads_X or "parameters" in model.model.axes:
        lines.append(f"In {len(source.parameters)} {source.kind} parameters.")
    if source.given:
        lines.append("With " + ", ".join(f"{name} = {e}" for name, e in source.given.items()) + ".")
    if model.model.axes:
        symmetric = ", those below the diagonal are those above it" if model.model.symmetric else ""
        lines.append(f"Entries that are not shown are zero{symmetric}.")
    if model.model.denominator:
        lines.append(f"Each entry is to be divided by {model.model.denominator}, the last line.")
    return [*lines, *passive_notes(model)]


def passive_notes(model: SymbolicModel) -> list[str]:
    """Which passive joints are functions, which are symbols and where their equations are."""
    source = model.source
    robot, closure, relations = source.robot, source.closure, source.relations
    lines = []
    for j in robot.passive:
        if j in relations.tied:
            continue
        lines.append(
            f"Passive joint: q{j} = {relations.formula(j)}"
            + (", kept as a symbol." if j in closure.tied else ".")
        )
    if relations.tied:
        named = Names(len(robot.frames))
        u, i = relations.tied[0], robot.joints[0]
        tied = ", ".join(f"q{u}" for u in relations.tied)
        lines.append(
            f"Passive joints {tied} are symbols: the closure equations (model closure) give them, "
            f"their derivatives the rates, {named('G', u, i)} = dq{u}/dq{i}."
        )
    return lines


def angle_lines(angles: Mapping[str, Expression]) -> list[str]:
    """C23 = cos(q2 + q3), S23 = sin(q2 + q3), ..."""
    told = ", ".join(
        f"{name} = {'cos' if name[0] == 'C' else 'sin'}({e})".replace(" ", "\0")
        for name, e in angles.items()
    )
    return [line.replace("\0", " ") for line in wrapped(told, "", "")]


# --- text ---


def text(model: SymbolicModel, form: str) -> str:
    """Title, conventions, then a line per entry, or per equation of the recursion."""
    return "\n".join([model.title, model.summary, *notes(model), "", *text_lines(model, form)])


def text_lines(model: SymbolicModel, form: str) -> list[str]:
    """The angles and the entries of a closed form, or the equations of the recursion under their
    headings.
    """
    if form == "closed":
        closed = model.closed
        texts = closed_texts(model)
        if closed.denominator is not None:
            texts[model.model.denominator] = plain(closed.denominator)
        width = max(map(len, texts), default=0)
        body = [
            line
            for label, value in texts.items()
            for line in breaking.lines(f"{label:<{width}} = ", value, WIDTH, " " * (width + 3))
        ]
        angles = angle_lines(closed.angles)
        return [*angles, *([""] if angles else []), *(body or ["all entries are zero"])]
    lines: list[str] = []
    section = None
    for equation in model.listing.lines:
        if equation.section != section:
            section = equation.section
            lines += ["", section] if lines else [section]
        lines += breaking.lines(f"  {equation.name} = ", equation.expression, WIDTH, "      ")
    return lines


# --- LaTeX ---


def latex_lines(model: SymbolicModel, form: str) -> dict[str, list[str]]:
    """{heading: lines `left &= right`}."""
    if form == "closed":
        closed = model.closed
        values, listing = closed.entries, None
        angles = [
            rf"{latex.symbol(n)} &= {latex.latex(trees.angle(n[0], e))}"
            for n, e in closed.angles.items()
        ]
        sections = {"Angles": angles} if angles else {}
    else:
        listing = model.listing
        operate = partial(operated, number=partial(trees.product, factors=()))
        steps, outputs = listing.steps(operate, trees.symbol)
        values = dict(zip(listing.places, outputs, strict=True))
        sections = {}
        for equation in listing.lines:
            if value := steps.get(equation.name):
                line = f"{latex.symbol(equation.name)} &= {latex.latex(value)}"
                sections.setdefault(equation.section, []).append(line)
    results = [
        f"{latex_label(model, p)} &= {latex.latex(values[p])}"
        for p in model.places
        if values.get(p)
    ]
    if listing is None and model.closed.denominator is not None:
        results.append(rf"\det \mathbf{{A}} &= {latex.latex(model.closed.denominator)}")
    return sections | ({"Model" if listing is None else "Result": results} if results else {})


def latex_label(model: SymbolicModel, place: Sequence[int]) -> str:
    """The name of an entry."""
    if model.model.axes == ("parameters",):
        return latex.symbol(model.source.parameters[place[0]])
    letter = {
        "GAM": r"\Gamma",
        "QDP": r"\det \mathbf{A} \; \ddot{q}",
        "det J": r"\det \mathbf{J}",
        "JPQP": r"\dot{\mathbf{J}} \dot{q}",
        "VP": r"\dot{\mathbf{V}}",
    }.get(model.model.letter, rf"\mathbf{{{model.model.letter}}}")
    inside = ",".join(
        latex.symbol(labels[k])
        if axis == "parameters"
        else labels[k].replace("v", "v_").replace("w", r"\omega_")
        for axis, labels, k in zip(model.model.axes, model.axes, place, strict=True)
    )
    return f"{letter}_{{{inside}}}" if place else letter


def latex_fragment(model: SymbolicModel, form: str) -> str:
    """The formulas alone, for a document of one's own that has amsmath."""
    return "\n".join(map(latex.aligned, latex_lines(model, form).values()))


def latex_document(model: SymbolicModel, form: str) -> str:
    """A document that compiles: frame table, conventions, formulas."""
    body = "\n".join(
        rf"\subsection*{{{latex.escaped(title)}}}" + "\n" + latex.aligned(lines)
        for title, lines in latex_lines(model, form).items()
    )
    return latex.document(
        model.title,
        model.summary,
        model.source.robot,
        notes(model),
        body or "All entries are zero.",
    )


# --- lines of SymPy ---


def sympy_lines(model: SymbolicModel, form: str) -> str:
    """Python that makes the model with SymPy; symbols are real, numbers exact."""
    if form == "closed":
        steps: list[tuple[Any, Any]] = []
        value = of_model(model)
    else:
        steps, value = of_listing(model)
    return source_text(model.model.letter.replace(" ", "_"), steps, value)


# --- JSON ---


def json_text(model: SymbolicModel, form: str) -> str:
    """Plain values: labels of the axes, entries or equations as text, what C and S stand for, what
    is to be known of the passive joints.
    """
    robot = model.source.robot
    values: dict[str, Any] = {
        "name": robot.name,
        "model": model.model.name,
        "summary": model.model.meaning,
        "form": form,
        "parameters": model.source.kind,
        **({"of": model.request.of, "frame": model.request.frame} if model.model.of_frames else {}),
        "axes": [list(labels) for labels in model.axes],
        "symmetric": model.model.symmetric,
        "notes": notes(model),
        "frames": frame_table(robot),
    }
    if form == "closed":
        closed = model.closed
        values["angles"] = {name: str(e) for name, e in closed.angles.items()}
        values["entries"] = closed_texts(model)
        if closed.denominator is not None:
            values["denominator"] = plain(closed.denominator)
        values["terms"] = closed.size
    else:
        values["equations"] = [vars(equation) for equation in model.listing.lines]
    return json.dumps(values, indent=2, ensure_ascii=False)
