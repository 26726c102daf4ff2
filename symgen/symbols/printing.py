"""Models as text, LaTeX, MathML, lines of SymPy, and plain values for JSON; in closed form or as recursion."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

from symgen.derive.names import Names
from symgen.description.expression import ONE, Expression
from symgen.emit.header import frame_table, wrapped
from symgen.emit.spec import WIDTH
from symgen.errors import SymgenError
from symgen.regroup.formula import Plain, Printer, Signed
from symgen.symbols import breaking, latex
from symgen.symbols.closed import ClosedForm, Group
from symgen.symbols.symbolic_model import SymbolicModel

T = TypeVar("T")
FORMS = ("closed", "recursive")
FORMATS = ("text", "latex", "latex-fragment", "sympy", "json")
PLAIN = Plain()


def printed(model: SymbolicModel, form: str, language: str) -> str:
    """A model as text, latex, sympy or json, in closed or recursive form. Raises SymgenError where the form has too many terms or is none."""
    for what, given, known in (("form", form, FORMS), ("format", language, FORMATS)):
        if given not in known:
            raise SymgenError(f"{what} {given!r}; expected one of {', '.join(known)}")
    if language == "json":
        return json.dumps(mapping(model, form), indent=2, ensure_ascii=False)
    if language == "sympy":
        return sympy_lines(model, form)
    return {"text": text, "latex": latex_document, "latex-fragment": latex_fragment}[language](model, form)


@dataclass(frozen=True)
class Formulas:
    """A model as formulas: text where it is printed, typeset in a notebook."""

    model: SymbolicModel
    form: str

    def __str__(self) -> str:
        return text(self.model, self.form)

    def _repr_latex_(self) -> str:
        lines = latex_lines(self.model, self.form)
        return f"$${latex.aligned([line for title, found in lines if title != 'Angles' for line in found], 'aligned')}$$"


# --- closed forms in any language ---


def terms(printer: Printer[T], form: ClosedForm) -> list[Signed[T]]:
    """The terms of an entry: coefficients before their parameters, parameters with coefficient 1 one by one."""
    written: list[Signed[T]] = []
    for group in form:
        members = [(c > 0, printer.expression(_one(m))) for m, c in group.parameters.terms.items()]
        bare = group.parameters == ONE
        added = min(group.common.terms.values()) > 0
        common = group.common if added else -group.common
        if group.inner or group.inside != ONE or common != ONE:
            pieces = _coefficient(printer, group, common)
            if not bare:
                pieces.append(members[0][1] if len(members) == 1 and members[0][0] else printer.bracketed(printer.sum(members)))
            elif common == ONE and not group.inner:
                written += [(added == (c > 0), printer.expression(Expression({m: abs(c)}))) for m, c in group.inside.ordered]
                continue
            elif common == ONE and group.inside == ONE:
                written += [(added == plus, term) for plus, term in terms(printer, group.inner)]
                continue
            written.append((added, pieces[0] if len(pieces) == 1 else printer.product(pieces)))
        else:
            written += [(added == plus, piece) for plus, piece in members]
    return written


def _coefficient(printer: Printer[T], group: Group, common: Expression) -> list[T]:
    pieces: list[T] = []
    if common != ONE:
        pieces.append(printer.expression(common))
    if group.inside != ONE:
        pieces.append(printer.bracketed(printer.expression(group.inside)))
    if group.inner:
        pieces.append(printer.bracketed(printer.sum(terms(printer, group.inner))))
    return pieces


def _one(m: Any) -> Expression:
    return Expression({m: Fraction(1)})


def entry(printer: Printer[T], form: ClosedForm) -> T:
    """A whole entry."""
    return printer.sum(terms(printer, form)) if form else printer.number("0")


def entries(model: SymbolicModel, printer: Printer[T]) -> list[tuple[str, T]]:
    """(label, value) of the entries that are not zero; the numerators where the model has a denominator."""
    closed = model.closed
    return [(model.label(place), entry(printer, closed.entries[place])) for place in model.places if place in closed.entries]


# --- what stands beside a model ---


def notes(model: SymbolicModel) -> list[str]:
    """Sentences without which a model cannot be read: its parameters, what is left out, its passive joints."""
    source = model.source
    lines = []
    if source.parameters and model.model.name not in (
        "pose",
        "jacobian",
        "determinant",
        "jacobian_rate",
        "velocity",
        "acceleration",
        "closure",
    ):
        lines.append(f"In {len(source.parameters)} {source.kind} parameters.")
    if source.given:
        lines.append("With " + ", ".join(f"{name} = {e}" for name, e in source.given.items()) + ".")
    if model.model.axes:
        symmetric = ", those below the diagonal are those above it" if model.model.symmetric else ""
        lines.append(f"Entries that are not shown are zero{symmetric}.")
    if model.model.name == "forward_dynamics":
        lines.append("Each entry is to be divided by det A, the last line.")
    return [*lines, *passive_notes(model)]


def passive_notes(model: SymbolicModel) -> list[str]:
    """Which passive joints are functions, which are symbols and where their equations are."""
    source = model.source
    robot, closure, relations = source.robot, source.closure, source.relations
    lines = []
    for j in robot.passive:
        if j in relations.tied:
            continue
        lines.append(f"Passive joint: q{j} = {relations.formula(j)}" + (", kept as a symbol." if j in closure.tied else "."))
    if relations.tied:
        named = Names(len(robot.frames))
        u, i = relations.tied[0], robot.joints[0]
        tied = ", ".join(f"q{u}" for u in relations.tied)
        lines.append(
            f"Passive joints {tied} are symbols: the closure equations (model closure) give them, their derivatives the rates, {named('G', u, i)} = dq{u}/dq{i}."
        )
    return lines


def angle_lines(angles: Mapping[str, Expression]) -> list[str]:
    """C23 = cos(q2 + q3), S23 = sin(q2 + q3), ..."""
    told = ", ".join(f"{name} = {'cos' if name[0] == 'C' else 'sin'}({e})".replace(" ", "\0") for name, e in angles.items())
    return [line.replace("\0", " ") for line in wrapped(told, "", "")]


# --- text ---


def text(model: SymbolicModel, form: str) -> str:
    """Title, conventions, then a line per entry, or per equation of the recursion."""
    return "\n".join([model.title, model.summary, *notes(model), "", *text_lines(model, form)])


def text_lines(model: SymbolicModel, form: str) -> list[str]:
    """The angles and the entries of a closed form, or the equations of the recursion under their headings."""
    if form == "closed":
        closed = model.closed
        found = entries(model, PLAIN)
        if closed.denominator is not None:
            found.append(("det A", entry(PLAIN, closed.denominator)))
        width = max((len(label) for label, _ in found), default=0)
        body = [line for label, value in found for line in breaking.lines(f"{label:<{width}} = ", value, WIDTH, " " * (width + 3))]
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


def latex_lines(model: SymbolicModel, form: str) -> list[tuple[str, list[str]]]:
    """(heading, lines `left &= right`)."""
    printer = latex.LATEX
    if form == "closed":
        closed = model.closed
        trig = [rf"{printer.symbol(n)} &= \{'cos' if n[0] == 'C' else 'sin'}({printer.expression(e)})" for n, e in closed.angles.items()]
        lines = [
            f"{latex_label(model, place)} &= {entry(printer, closed.entries[place])}" for place in model.places if place in closed.entries
        ]
        if closed.denominator is not None:
            lines.append(rf"\det \mathbf{{A}} &= {entry(printer, closed.denominator)}")
        return [(heading, found) for heading, found in (("Angles", trig), ("Model", lines)) if found]
    listing = model.listing
    steps = listing.written(latex.LatexText)
    sections = [(section.title, list(section.lines)) for section in steps.sections]
    results = [
        f"{latex_label(model, place)} &= {x if isinstance(x, int) else steps.expression(x)}"
        for place, x in zip(listing.places, listing.outputs.values(), strict=True)
        if not (isinstance(x, int) and x == 0)
    ]
    return [(title, lines) for title, lines in [*sections, ("Result", results)] if lines]


def latex_label(model: SymbolicModel, place: Sequence[int]) -> str:
    """The name of an entry."""
    if model.model.name == "base_parameters":
        return latex.LATEX.parameter(model.source.parameters[place[0]])
    letter = {
        "GAM": r"\Gamma",
        "QDP": r"\det \mathbf{A} \; \ddot{q}",
        "det J": r"\det \mathbf{J}",
        "JPQP": r"\dot{\mathbf{J}} \dot{q}",
        "VP": r"\dot{\mathbf{V}}",
    }.get(model.model.letter, rf"\mathbf{{{model.model.letter}}}")
    inside = ",".join(
        latex.LATEX.parameter(labels[k]) if axis == "parameters" else labels[k].replace("v", "v_").replace("w", r"\omega_")
        for axis, labels, k in zip(model.model.axes, model.axes, place, strict=True)
    )
    return f"{letter}_{{{inside}}}" if place else letter


def latex_fragment(model: SymbolicModel, form: str) -> str:
    """The formulas alone, for a document of one's own that has amsmath."""
    return "\n".join(latex.aligned(lines) for _, lines in latex_lines(model, form))


def latex_document(model: SymbolicModel, form: str) -> str:
    """A document that compiles: frame table, conventions, formulas."""
    parts = latex_lines(model, form)
    body = (
        "\n".join(rf"\subsection*{{{latex.escaped(title)}}}" + "\n" + latex.aligned(lines) for title, lines in parts)
        or "All entries are zero."
    )
    return latex.document(model.title, model.summary, model.source.robot, notes(model), body)


# --- lines of SymPy ---


def sympy_lines(model: SymbolicModel, form: str) -> str:
    """Python that makes the model with `from sympy import *`; symbols are real, numbers exact."""
    from symgen.symbols.sympy_objects import of_listing, of_model, source_text

    if form == "closed":
        steps: list[tuple[Any, Any]] = []
        value = of_model(model)
    else:
        steps, value = of_listing(model)
    return source_text(model.model.letter.replace(" ", "_"), steps, value)


# --- JSON ---


def mapping(model: SymbolicModel, form: str) -> dict[str, Any]:
    """Plain values: labels of the axes, entries or equations as text, what C and S stand for, what is to be known of the passive joints."""
    robot = model.source.robot
    values: dict[str, Any] = {
        "name": robot.name,
        "model": model.model.name,
        "summary": model.model.summary,
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
        values["entries"] = dict(entries(model, PLAIN))
        if closed.denominator is not None:
            values["denominator"] = entry(PLAIN, closed.denominator)
        values["terms"] = closed.size
        return values
    values["equations"] = [{"section": e.section, "name": e.name, "expression": e.expression} for e in model.listing.lines]
    return values
