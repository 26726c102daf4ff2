"""Symbolic models as documents: in text, LaTeX, Python with SymPy, JSON, or MathML.

Each model is written in closed form or as a recursion. MathML is for the HTML page of a robot.
LaTeX needs amsmath alone; velocities are \\dot{q}, accelerations \\ddot{q}, torques \\Gamma;
intermediate variables of a recursion keep the names of SYMORO. Long formulas are broken before +
and -: outside of brackets first, and inside if a term is wider than a line.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import sympy

from symgen.derive.models import SYMBOLIC
from symgen.derive.names import Names
from symgen.description.expression import Expression
from symgen.description.robot import Robot
from symgen.emit.header import frame_table, informative_columns, wrap_text
from symgen.emit.render import WIDTH
from symgen.errors import SymgenError, require_name
from symgen.regroup.regrouping import Formula, Regrouping
from symgen.symbols import expressions
from symgen.symbols.expressions import Tree
from symgen.symbols.printers import MathML, latex, latex_symbol, math, math_terms
from symgen.symbols.printers import text as plain
from symgen.symbols.source import source_of
from symgen.symbols.symbolic_model import Objects, SymbolicModel, of_listing, of_model

FORMS = ("closed", "recursive")
FORMATS = ("text", "latex", "latex-fragment", "sympy", "json")


OF_SYMPY = re.compile(r"\b(?=[A-Za-z]\w*\(|pi\b)")  # before a name that is none of the robot
RATIONAL = re.compile(r"(?<![\w*).])(\d+)/(\d+)\b")
LATEX_WIDTH = 76  # characters of a line as they are printed
HEADINGS = {
    "ant": "a(j)",
    "mu": r"\mu",
    "sigma": r"\sigma",
    "gamma": r"\gamma",
    "alpha": r"\alpha",
    "theta": r"\theta",
}
# Engines and scripts: letters beyond Latin and Greek by a font that has them
PREAMBLE = (
    r"\usepackage{iftex}",
    r"\ifPDFTeX",
    r"\usepackage[utf8]{inputenc}\usepackage[T1]{fontenc}",
    r"\newcommand{\other}[2]{{\footnotesize U+#1}} % XeLaTeX and LuaLaTeX print the letter",
    r"\else",
    r"\usepackage{fontspec}",
    r"""\newcommand{\other}[2]{{\otherfont\iffontchar\font"#1 #2\else U+#1\fi}}""",
    *(
        rf"\ifdefined\otherfont\else\IfFontExistsTF{{{font}}}"
        rf"{{\newfontfamily{{\otherfont}}{{{font}}}}}{{}}\fi"
        for font in ("Noto Serif CJK SC", "Noto Sans CJK SC", "SimSun", "DejaVu Serif")
    ),
    r"\providecommand{\otherfont}{}",
    r"\fi",
)
_GREEK = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho varsigma sigma
    tau upsilon phi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega
"""
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{c: "\\" + c for c in "&%$#_{}"},
    **{
        c: rf"\ensuremath{{\{name}}}"
        for c, name in zip(
            "αβγδεζηθικλμνξπρςστυφχψωΓΔΘΛΞΠΣΦΨΩ",
            _GREEK.split(),
            strict=True,
        )
    },
}


READABLE = 150  # terms of a closed form on a page; longer ones are shown as recursion
EXPANDED = 2000  # terms that are multiplied out to see


def printed(model: SymbolicModel, form: str, language: str) -> str:
    """Write a model in a form (closed or recursive) and a format (text, latex, sympy, json, ...).

    Raises SymgenError if the form or the format is unknown, if the model does not have this form,
    or if this form has too many terms.
    """
    require_name(form, FORMS, "form")
    require_name(language, FORMATS, "format")
    writers = (text, latex_document, latex_fragment, sympy_lines, json_text)
    return dict(zip(FORMATS, writers, strict=True))[language](model, form)


@dataclass(frozen=True)
class Formulas:
    """Formulas of a model: printed as text, shown as typeset formulas in a notebook."""

    model: SymbolicModel
    form: str

    def __str__(self) -> str:
        return text(self.model, self.form)

    def _repr_latex_(self) -> str:
        sections = latex_lines(self.model, self.form)
        lines = [x for title, lines in sections.items() if title != "Angles" for x in lines]
        return f"$${aligned(lines, 'aligned')}$$"


def closed_texts(model: SymbolicModel) -> dict[str, str]:
    """Return the nonzero entries of a model in closed form as texts, by name, such as A(1,2).

    If the model has a denominator, the texts are those of the numerators.
    """
    entries = model.closed.entries
    return {model.label(p): plain(entries[p]) for p in model.places if p in entries}


# --- what stands beside a model ---


def notes(model: SymbolicModel) -> list[str]:
    """List the notes that are printed with a model, for instance which parameters it contains.

    Other notes name the values that replace symbols, the entries that are not shown, the
    denominator and the passive joints.
    """
    source = model.source
    lines = []
    if model.model.reads_X or "parameters" in model.model.axes:
        lines.append(f"In {len(source.parameters)} {source.kind} parameters.")
    if source.given:
        lines.append("With " + ", ".join(f"{name} = {e}" for name, e in source.given.items()) + ".")
    if model.model.axes:
        symmetric = (
            "; entries below the diagonal equal those above" if model.model.symmetric else ""
        )
        lines.append(f"Entries that are not shown are zero{symmetric}.")
    if model.model.denominator:
        lines.append(f"Each entry is to be divided by {model.model.denominator}, the last line.")
    return [*lines, *passive_notes(model)]


def passive_notes(model: SymbolicModel) -> list[str]:
    """Describe how each passive joint is determined: by a formula or by the closure equations.

    If only the closure equations determine the joint, its position and its rates are symbols in the
    model.
    """
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
    """Explain the short names of cosines and sines, for instance "C23 = cos(q2 + q3)"."""
    told = ", ".join(
        f"{name} = {'cos' if name[0] == 'C' else 'sin'}({e})".replace(" ", "\0")
        for name, e in angles.items()
    )
    return [line.replace("\0", " ") for line in wrap_text(told, "", "")]


# --- text ---


def text(model: SymbolicModel, form: str) -> str:
    """Write a model as plain text: title, summary, notes, then its formulas."""
    return "\n".join([model.title, model.summary, *notes(model), "", *text_lines(model, form)])


def text_lines(model: SymbolicModel, form: str) -> list[str]:
    """Write the formulas of a model as lines of text.

    A closed form is written as its angles and entries, a recursion as its equations under their
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
            for line in broken_lines(f"{label:<{width}} = ", value, WIDTH, " " * (width + 3))
        ]
        angles = angle_lines(closed.angles)
        return [*angles, *([""] if angles else []), *(body or ["all entries are zero"])]
    lines: list[str] = []
    section = None
    for equation in model.listing.lines:
        if equation.section != section:
            section = equation.section
            lines += ["", section] if lines else [section]
        lines += broken_lines(f"  {equation.name} = ", equation.expression, WIDTH, "      ")
    return lines


# --- long formulas ---


def broken_lines(
    head: str, formula: str, width: int, hanging: str, measure: Callable[[str], int] = len
) -> list[str]:
    """Break a formula before + or - into lines of at most `width` characters, if possible.

    The first line starts with `head`, every other line with `hanging`; `measure` gives the printed
    width of a text.
    """
    done: list[str] = []
    line, empty = head, True
    for piece in pieces(formula, width, measure):
        if not empty and measure(line) + 1 + measure(piece) > width:
            done.append(line)
            line, empty = hanging, True
        line += piece if empty else f" {piece}"
        empty = False
    return [*done, line]


def pieces(
    formula: str, width: int, measure: Callable[[str], int] = len, depth: int = 0
) -> Iterator[str]:
    """Cut a formula before each + or - that at most `depth` brackets enclose; yield the pieces.

    A piece that is wider than `width` is cut again, one bracket deeper.
    """
    for piece in _cut(formula, depth):
        if measure(piece) <= width or depth > 8:
            yield piece
        else:
            yield from pieces(piece, width, measure, depth + 1)


def _cut(text: str, deepest: int) -> Iterator[str]:
    brackets = braces = start = 0
    for k, c in enumerate(text):
        brackets += (c == "(") - (c == ")")
        braces += (c == "{") - (c == "}")
        if c == " " and not braces and brackets <= deepest and text[k + 1 : k + 3] in ("+ ", "- "):
            yield text[start:k]
            start = k + 1
    yield text[start:]


# --- LaTeX ---


def latex_lines(model: SymbolicModel, form: str) -> dict[str, list[str]]:
    """Write the equations of a model in LaTeX as lines `left &= right`, grouped by heading."""
    if form == "closed":
        closed = model.closed
        values, listing = closed.entries, None
        angles = [
            rf"{latex_symbol(n)} &= {latex(expressions.angle(n[0], e))}"
            for n, e in closed.angles.items()
        ]
        sections = {"Angles": angles} if angles else {}
    else:
        listing = model.listing
        steps, values = recursion(model)
        sections = {
            title: [f"{latex_symbol(name)} &= {latex(value)}" for name, value in own]
            for title, own in steps.items()
        }
    results = [
        f"{latex_label(model, p)} &= {latex(values[p])}" for p in model.places if values.get(p)
    ]
    if listing is None and model.closed.denominator is not None:
        results.append(rf"\det \mathbf{{A}} &= {latex(model.closed.denominator)}")
    return sections | ({"Model" if listing is None else "Result": results} if results else {})


def recursion(
    model: SymbolicModel,
) -> tuple[dict[str, list[tuple[str, Tree]]], dict[tuple[int, ...], Tree]]:
    """Return the recursive equations of a model in SymPy, and the entries of its result.

    The equations are pairs (name, expression), grouped by heading. The entries are SymPy
    expressions, by their indices.
    """
    listing = model.listing
    objects = Objects(partial(expressions.product, factors=()))
    steps, outputs = listing.steps(objects, expressions.symbol)
    sections: dict[str, list[tuple[str, Tree]]] = {}
    for equation in listing.lines:
        if value := steps.get(equation.name):
            sections.setdefault(equation.section, []).append((equation.name, value))
    return sections, dict(zip(listing.places, outputs, strict=True))


def latex_label(model: SymbolicModel, place: Sequence[int]) -> str:
    """Write in LaTeX the name of an entry of a matrix or vector, such as A with subscript 1,2."""
    if model.model.axes == ("parameters",):
        return latex_symbol(model.source.parameters[place[0]])
    letter = model.model.latex or rf"\mathbf{{{model.model.letter}}}"
    inside = ",".join(
        latex_symbol(labels[k])
        if axis == "parameters"
        else labels[k].replace("v", "v_").replace("w", r"\omega_")
        for axis, labels, k in zip(model.model.axes, model.axes, place, strict=True)
    )
    return f"{letter}_{{{inside}}}" if place else letter


def latex_fragment(model: SymbolicModel, form: str) -> str:
    """Write only the formulas of a model in LaTeX, for a document that loads amsmath."""
    return "\n".join(map(aligned, latex_lines(model, form).values()))


def latex_document(model: SymbolicModel, form: str) -> str:
    """Write a complete LaTeX document of a model: frame table, conventions, formulas."""
    body = "\n".join(
        rf"\subsection*{{{escaped(title)}}}" + "\n" + aligned(lines)
        for title, lines in latex_lines(model, form).items()
    )
    return document(
        model.title,
        model.summary,
        model.source.robot,
        notes(model),
        body or "All entries are zero.",
    )


def formulas(definitions: Mapping[str, Formula]) -> str:
    r"""Write the formulas of base parameters in LaTeX, in an `aligned` environment.

    For instance ZZ_{1R} &= ZZ_{1} + I_{a1} + ...
    """
    rows = (
        f"{latex_symbol(name)} &= {latex(expressions.formula(f))}"
        for name, f in definitions.items()
    )
    return aligned(rows, "aligned")


def aligned(equations: Iterable[str], environment: str = "align*") -> str:
    """Put equations `left &= right` into a LaTeX environment; long equations are broken."""
    rows = [" \\\\\n".join(broken(line)) for line in equations]
    return f"\\begin{{{environment}}}\n" + " \\\\\n".join(rows) + f"\n\\end{{{environment}}}"


def broken(line: str) -> list[str]:
    """Break a LaTeX equation `left &= right` before + or -, if it is too long for one line."""
    left, _, right = line.partition(" &= ")
    if width(line) > LATEX_WIDTH:  # brackets that grow cannot be broken
        right = re.sub(r"\\(left|right)\b", "", right)
    return broken_lines(f"{left} &= ", right, LATEX_WIDTH, r"&\quad ", width)


def width(text: str) -> int:
    """Estimate the printed width of a LaTeX text, in characters."""
    return len(
        re.sub(r"\\(mathbf|operatorname|dot|ddot|left|right|frac|quad|,)|[{}^_&\\]", "", text)
    )


def escaped(text: str) -> str:
    """Replace the special characters of plain text, so that LaTeX prints the text unchanged.

    A letter that many fonts lack is written by the command \\other, which the preamble of the
    document defines.
    """
    return "".join(_SPECIAL.get(c) or _written(c) for c in text)


def _written(c: str) -> str:
    """Write one character in LaTeX; if fonts may lack the character, add its Unicode number.

    A common character is unchanged; any other is written by the command \\other.
    """
    common = (c < "\u0180" and c not in "ĦħĸĿŀŉŦŧſ") or c in "–—‘’“”„…•€"
    return c if common else rf"\other{{{ord(c):04X}}}{{{c}}}"


def document(title: str, summary: str, robot: Robot, notes: Sequence[str], body: str) -> str:
    """Write a complete LaTeX document that contains a frame table, notes, and the text `body`.

    The direction of gravity comes after the frame table.
    """
    kept = informative_columns(robot)
    head = " & ".join(f"${HEADINGS.get(c, c)}$" for c in kept)
    rows = [" & ".join(f"${cell(getattr(f, c))}$" for c in kept) + r" \\" for f in robot.frames]
    gravity = ",\\ ".join(map(cell, robot.gravity))
    return "\n".join(
        [
            r"\documentclass[a4paper,10pt]{article}",
            *PREAMBLE,
            r"\usepackage{amsmath,graphicx}",
            r"\setlength{\oddsidemargin}{-10mm}\setlength{\textwidth}{180mm}\setlength{\topmargin}{-20mm}\setlength{\textheight}{250mm}",
            r"\setlength{\parindent}{0pt}\allowdisplaybreaks",
            r"\begin{document}",
            rf"\section*{{{escaped(title)}}}",
            rf"{escaped(summary)}\par\medskip",
            r"Modified Denavit-Hartenberg (Khalil and Kleinfinger 1986); SI and rad.\par\medskip",
            rf"\sbox0{{\begin{{tabular}}{{{'r' * len(kept)}}}",
            head + r" \\ \hline",
            *rows,
            r"\end{tabular}}",
            r"\ifdim\wd0>\textwidth\resizebox{\textwidth}{!}{\usebox0}\else\usebox0\fi\par\medskip",
            (
                rf"Acceleration of gravity in frame 0: $({gravity})$. Torques $\Gamma$ are those "
                r"of "
                r"the actuators, so friction enters with a plus.\par"
            ),
            *(rf"{escaped(note)}\par" for note in notes),
            body,
            r"\end{document}",
            "",
        ]
    )


def cell(value: object) -> str:
    """Write a value of the frame table in LaTeX."""
    return latex(expressions.expression(value)) if isinstance(value, Expression) else str(value)


# --- lines of SymPy ---


def sympy_lines(model: SymbolicModel, form: str) -> str:
    """Write Python code that builds the model with SymPy: real symbols, exact numbers."""
    if form == "closed":
        steps: list[tuple[Any, Any]] = []
        value = of_model(model)
    else:
        steps, value = of_listing(model)
    return source_text(model.model.letter.replace(" ", "_"), steps, value)


def source_text(name: str, steps: list[tuple[Any, Any]], value: Any) -> str:
    """Write Python code with SymPy that computes `value` and stores it under the name `name`.

    The code defines the symbols, then the intermediate variables in `steps`, then the value.
    Rational numbers stay exact.
    """
    made = {x for x, _ in steps}
    atoms = set().union(value.free_symbols, *(e.free_symbols for _, e in steps))
    free = sorted(str(x) for x in atoms - made)
    package = "sympy"
    while package in {*free, *map(str, made)}:
        package += "_"
    lines = ["import sympy" if package == "sympy" else f"import sympy as {package}", ""]
    if free:
        made_by = f"{package}.symbols({' '.join(free)!r}, real=True, seq=True)"
        lines.append(f"{', '.join(free)}{',' * (len(free) == 1)} = {made_by}")
    for x, e in [*steps, (name, value)]:
        exact = RATIONAL.sub(r"Rational(\1, \2)", _sympy_text(e))
        lines.append(f"{x} = {OF_SYMPY.sub(f'{package}.', exact)}")
    return "\n".join(lines)


def _sympy_text(e: Any) -> str:
    """Write a SymPy expression as text; a matrix is written row by row, without aligned columns."""
    if not isinstance(e, sympy.MatrixBase):
        return str(sympy.printing.sstr(e))
    rows = (f"[{', '.join(map(sympy.printing.sstr, row))}]" for row in e.tolist())
    return "Matrix([\n" + ",\n".join(rows) + "])"


# --- JSON ---


def json_text(model: SymbolicModel, form: str) -> str:
    """Write a model as JSON text.

    It has labels, entries or equations, the meaning of C and S, notes, and the frame table.
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


# --- MathML of a page ---


@dataclass(frozen=True)
class ShownModel:
    """A model as shown on the HTML page of a robot.

    A closed form has its `entries` (label, terms). Any other model has `steps`, the equations of
    its recursion under their headings.
    """

    title: str
    summary: str
    size: str
    entries: list[tuple[MathML, list[MathML]]]
    angles: list[MathML]
    steps: list[tuple[str, list[tuple[MathML, list[MathML]]]]]


def shown_models(regrouping: Regrouping) -> tuple[list[ShownModel], list[str]]:
    """Prepare the models of a robot for its HTML page, and the notes on its passive joints.

    If the closed form of a model is long, its recursion is shown instead.
    """
    robot = regrouping.robot
    source = source_of(robot, regrouping=regrouping)
    request = source.request(robot.frames[-1].j, 0)
    models = [
        SymbolicModel(model, source, request, None, EXPANDED)
        for model in sorted(SYMBOLIC.values(), key=lambda model: model.page)
        if model.page and model.defined_on(robot)
    ]
    return [*filter(None, map(shown_model, models))], passive_notes(models[0])


def shown_model(
    model: SymbolicModel, form: str = "closed", readable: int = READABLE
) -> ShownModel | None:
    """Prepare a model for an HTML page; None if it has no short closed form and no recursion.

    form : recursive, or closed for the closed form if it is short. readable : largest number of
      terms of a short closed form.
    """
    title = model.model.name.replace("_", " ")
    try:
        closed = model.closed if form == "closed" else None
    except SymgenError:
        closed = None
    if closed is None or closed.size > readable:
        try:
            sections, values = recursion(model)
        except SymgenError:
            return None
        steps = [
            (heading, [(math(expressions.symbol(name)), math_terms(value)) for name, value in own])
            for heading, own in sections.items()
        ]
        results = [
            (math(expressions.symbol(model.label(p))), math_terms(values[p]))
            for p in model.places
            if values.get(p)
        ]
        size = f"{len(model.listing.lines)} equations"
        return ShownModel(title, model.summary, size, [], [], [*steps, ("result", results)])
    entries = [
        (math(expressions.symbol(model.label(place))), math_terms(closed.entries[place]))
        for place in model.places
        if place in closed.entries
    ]
    if closed.denominator is not None:
        below = math(expressions.symbol(model.model.denominator))
        entries.append((below, math_terms(closed.denominator)))
    angles = [
        math(expressions.equation(expressions.symbol(name), expressions.angle(name[0], e)))
        for name, e in closed.angles.items()
    ]
    size = f"{closed.size} term{'s' * (closed.size != 1)}"
    return ShownModel(title, model.summary, size, entries, angles, [])
