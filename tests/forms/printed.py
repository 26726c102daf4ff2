"""Equations of one robot as they are printed in every form, (label, text of the right side)."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy
from certify.printed import definitions
from certify.printed import equations as printed_equations
from forms import graph
from forms.reader import (
    FUNCTIONS,
    Item,
    ReadError,
    evaluated,
    meant,
    of_latex,
    of_mathml,
    of_text,
    values_of,
)

from symgen.description.grammar import LAWS, parse
from symgen.emit.generate import generate_files
from symgen.errors import ExpressionError, SymgenError
from symgen.pages.formulas import printed as printed_formulas
from symgen.pages.page import robot_page
from symgen.regroup.regrouping import Regrouping
from symgen.symbols import expressions
from symgen.symbols.documents import printed, shown_model
from symgen.symbols.symbolic_model import SymbolicModel, of_listing, of_model

Equations = list[tuple[str, str]]


@dataclass(frozen=True)
class Form:
    """One printed form of a model, or of the formulas of base parameters.

    Attributes
    ----------
    name : str
        Language and shape.
    equations : list of (label, right side)
    known : mapping
        Numbers of all names that may be read.
    right : mapping
        Values of the graph, by label.
    values : callable
        Values of several right sides at these numbers; None for one that cannot be read.
    """

    name: str
    equations: Equations
    known: Mapping[str, Any]
    right: Mapping[str, Any]
    values: Callable[[Sequence[Any], Mapping[str, Any]], list[Any]]

    def wrong(self) -> list[str]:
        """Labels of equations that are missing, wrong, or cannot be read."""
        labels, texts = zip(*self.equations, strict=True) if self.equations else ((), ())
        found = self.values(texts, self.known)
        missing = [label for label in self.right if label not in labels]
        return [label for label in missing if graph.differs(0, self.right[label])] + [
            label for label, x in zip(labels, found, strict=True) if self.is_wrong(label, x)
        ]

    def is_wrong(self, label: str, value: Any) -> bool:
        return value is None or label not in self.right or graph.differs(value, self.right[label])

    def refuses(self, k: int, text: str) -> bool:
        """Whether another text of one equation is seen to be wrong."""
        (value,) = self.values([text], self.known)
        return self.is_wrong(self.equations[k][0], value)


def one_by_one(
    read: Callable[[str, Mapping[str, Any]], Any],
) -> Callable[[Sequence[str], Mapping[str, Any]], list[Any]]:
    def values(texts: Sequence[str], known: Mapping[str, Any]) -> list[Any]:
        found = []
        for text in texts:
            try:
                found.append(read(text, known))
            except UNREADABLE:
                found.append(None)
        return found

    return values


UNREADABLE = (ReadError, SymgenError, KeyError, SyntaxError, TypeError, ZeroDivisionError)


# --- readers of one right side ---


def by_grammar(text: str, known: Mapping[str, Any]) -> Any:
    """Value of a text by the grammar of robot files; a text beyond its limits is read anew."""
    value = evaluated(of_text(text), lambda name, _: known[name])
    if len(text) < SHORT:
        try:
            return graph.expression(parse(text, None, LAWS), known)
        except ExpressionError as error:
            if "limit" not in str(error) and "more than" not in str(error):
                raise
    return value


SHORT = 400  # characters of a formula that `parse` multiplies out soon


def by_latex(text: str, known: Mapping[str, Any]) -> Any:
    return evaluated(of_latex(text), values_of(known))


def by_mathml(text: str, known: Mapping[str, Any]) -> Any:
    return evaluated(of_mathml(text), values_of(known))


# --- labels ---

IN_LATEX = {r"\Gamma": "GAM", r"\det \mathbf{A} \; \ddot{q}": "QDP", r"\det \mathbf{J}": "det J"}
IN_LATEX |= {r"\dot{\mathbf{J}} \dot{q}": "JPQP", r"\dot{\mathbf{V}}": "VP"}
IN_LATEX |= {r"\det \mathbf{A}": "det A"}
IN_MATHML = {"Gamma": "GAM", "q..": "QDP"}
COMMA = re.compile(r",(?![^{]*\})")


def latex_label(text: str, model: SymbolicModel, known: Collection[str]) -> str:
    """The label of an entry or a variable, from the left side of an equation in LaTeX."""
    letter, _, inside = text.partition("_{")
    bold = re.fullmatch(r"\\mathbf\{(\w+)\}", letter)
    name = IN_LATEX.get(letter, bold[1] if bold else "")
    if not name or name not in (model.model.letter, model.model.denominator):
        (item,) = of_latex(text)
        return _name(item, known)
    parts = (latex_index(part, known) for part in COMMA.split(inside.removesuffix("}")) if inside)
    return _entry(name, ",".join(parts))


def latex_index(text: str, known: Collection[str]) -> str:
    """An index of an entry: a number, a component of a twist, or a parameter."""
    if twist := re.fullmatch(r"(v|\\omega)_([xyz])", text):
        return twist[1].replace(r"\omega", "w") + twist[2]
    if text.isdigit():
        return text
    (item,) = of_latex(text)
    return _name(item, known)


def mathml_label(text: str, model: SymbolicModel, known: Collection[str]) -> str:
    (item,) = of_mathml(text)
    inside = "".join(x.text for x in item.rows[0]) if item.rows else ""
    letter = item.text.removesuffix("*")
    scalar = {model.model.denominator} if model.model.axes else {model.model.letter}
    if item.text.endswith("*") or letter in scalar or IN_MATHML.get(letter) == model.model.letter:
        return _entry(IN_MATHML.get(letter, letter), inside)
    return _name(item, known)


def _entry(letter: str, inside: str) -> str:
    return f"{letter}({inside})" if inside else letter


def _name(item: Item, known: Collection[str]) -> str:
    return meant(item.text, "".join(x.text for x in item.rows[0]) if item.rows else "", known)


# --- forms of a model ---


def forms(model: SymbolicModel, shape: str) -> Iterator[Form]:
    """A model in closed or recursive form, in every format that it has."""
    try:
        known, right = (graph.of_closed if shape == "closed" else graph.of_recursion)(model)
        text = model_text(model, shape, "text")
    except SymgenError:
        return  # there is no such form
    names = {*known, *right, *model.source.parameters}

    def form(name: str, equations: Equations, read: Callable[..., Any]) -> Form:
        return Form(f"{name}, {shape}", equations, known, right, one_by_one(read))

    yield form("text", printed_equations(text), by_grammar)
    yield form("JSON", printed_equations(model_text(model, shape, "json")), by_grammar)
    yield form(
        "LaTeX",
        [
            (latex_label(label, model, names), e)
            for label, e in latex_equations(model_text(model, shape, "latex"))
        ],
        by_latex,
    )
    found = mathml_equations(model, shape)
    if found is not None:
        yield form(
            "MathML", [(mathml_label(label, model, names), e) for label, e in found], by_mathml
        )
    divided = right
    if (below := right.get(model.model.denominator)) is not None:
        own = {label: x for label, x in right.items() if label != model.model.denominator}
        divided = {label: x / below for label, x in own.items()}
    if shape == "closed":
        divided = {label: x for label, x in divided.items() if label not in model.closed.angles}
    source = sympy_equations(model_text(model, shape, "sympy"), model)
    yield Form(f"SymPy, {shape}", source, known, divided, lambdified)
    yield Form(f"SymPy objects, {shape}", sympy_objects(model, shape), known, divided, lambdified)


def model_text(model: SymbolicModel, shape: str, format: str) -> str:
    return printed(model, shape, format)


def latex_equations(document: str) -> Equations:
    """Equations of all environments of a document, continued lines joined."""
    found = []
    for body in re.findall(r"\\begin\{align(?:\*|ed)\}\n(.*?)\n\\end\{align", document, re.DOTALL):
        for row in body.replace("\\\\\n&\\quad", " ").split(" \\\\\n"):
            label, equals, e = row.partition(" &= ")
            if not equals or "&" in e or r"\quad" in e:
                raise ReadError(f"no equation: {row[:80]}")
            found.append((label, e))
    return found


def mathml_equations(model: SymbolicModel, shape: str) -> Equations | None:
    """Equations of a model on a page; None where the page shows the other form."""
    shown = shown_model(model, shape)
    if shown is None or bool(shown.steps) != (shape == "recursive"):
        return None
    found = []
    for angle in shown.angles:
        label, _, e = angle.removesuffix("</math>").partition("<mo>=</mo>")
        found.append((f"{label}</mrow></math>", f"<math><mrow>{e}</math>"))
    steps = [equation for _, equations in shown.steps for equation in equations]
    return found + [(label, "".join(terms)) for label, terms in (*shown.entries, *steps)]


# --- SymPy ---

IN_NUMPY = {"sign": FUNCTIONS["sign"], "Abs": FUNCTIONS["abs"], "sqrt": FUNCTIONS["sqrt"]}
IN_NUMPY |= {"Max": FUNCTIONS["max"], "Min": FUNCTIONS["min"]}


def sympy_equations(source: str, model: SymbolicModel) -> Equations:
    """Assignments of Python source with SymPy, a matrix entry by entry; zeros are left out."""
    exec(compile(source, "<printed>", "exec"), {})  # noqa: S102 it runs
    *steps, last = [s for s in ast.parse(source).body if isinstance(s, ast.Assign)]
    assigned = [s for s in steps if isinstance(s.targets[0], ast.Name) and not _of_symbols(s)]

    def text(e: ast.expr) -> str:
        return str(ast.get_source_segment(source, e))

    found = [(s.targets[0].id, text(s.value)) for s in assigned]
    rows = [[last.value]]
    if isinstance(last.value, ast.Call) and ast.unparse(last.value.func).endswith(".Matrix"):
        rows = [row.elts for row in last.value.args[0].elts]
    entries = ((i, k, text(e)) for i, row in enumerate(rows) for k, e in enumerate(row))
    return found + [(_place(model, i, k), e) for i, k, e in entries if e != "0"]


def _of_symbols(s: ast.Assign) -> bool:
    return isinstance(s.value, ast.Call) and ast.unparse(s.value.func).endswith(".symbols")


def sympy_objects(model: SymbolicModel, shape: str) -> list[tuple[str, Any]]:
    """The same as SymPy objects, as `symgen.symbolic` gives them."""
    steps, value = of_listing(model) if shape == "recursive" else ([], of_model(model))
    rows = value.tolist() if isinstance(value, sympy.MatrixBase) else [[value]]
    entries = ((i, k, e) for i, row in enumerate(rows) for k, e in enumerate(row))
    return [(str(x), e) for x, e in steps] + [
        (_place(model, i, k), e) for i, k, e in entries if e != 0
    ]


def _place(model: SymbolicModel, *place: int) -> str:
    place = place[: len(model.axes)]
    return model.label(tuple(sorted(place)) if model.model.symmetric else place)


def lambdified(texts: Sequence[Any], known: Mapping[str, Any]) -> list[Any]:
    """Values of SymPy objects, or of their Python source, by one function of NumPy."""
    symbols = {name: expressions.symbol(name) for name in known}
    space = {"sympy": sympy, "sympy_": sympy, **symbols}
    objects = []
    for text in texts:
        try:
            objects.append(eval(text, space) if isinstance(text, str) else text)  # noqa: S307
        except (ArithmeticError, NameError, SyntaxError, TypeError, ValueError):
            objects.append(None)
    free = [x for x in symbols.values() if x.is_Symbol]
    numbers = [known[x.name] for x in free]
    made = [sympy.sympify(0 if e is None else e) for e in objects]
    if any(e.free_symbols - {*free} for e in made):
        return [None] * len(objects)
    found = sympy.lambdify(free, made, modules=[IN_NUMPY, "numpy"])(*numbers)
    return [None if e is None else x for e, x in zip(objects, found, strict=True)]


# --- formulas of base parameters ---


def formula_forms(regrouping: Regrouping) -> Iterator[Form]:
    """Formulas of base parameters in every form, those of the heads of emitted files too."""
    known, right = graph.of_formulas(regrouping)
    absorbing = {b.name for b in regrouping.base if b.name != b.own}

    def form(
        name: str, equations: Equations, read: Callable[..., Any], every: bool = False
    ) -> Form:
        kept = right if every else {label: right[label] for label in absorbing}
        own = [(label, e) for label, e in equations if label in right]
        return Form(name, own, known, kept, one_by_one(read))

    yield form("text", definitions(printed_formulas(regrouping, "text").splitlines()), by_grammar)
    yield recursive_form(regrouping, known)
    document = json.loads(printed_formulas(regrouping, "json"))["base_parameters"]
    yield form("JSON", [(b["name"], b["formula"]) for b in document], by_grammar, every=True)
    terms = [
        (b["name"], " + ".join(f"({t['coefficient']})*{t['parameter']}" for t in b["terms"]))
        for b in document
    ]
    yield form("JSON, terms", terms, by_grammar, every=True)
    names = {*known, *right}
    latex = latex_equations(printed_formulas(regrouping, "latex")) if absorbing else []
    yield form("LaTeX", [(_name(of_latex(label)[0], names), e) for label, e in latex], by_latex)
    page = re.findall(
        r'<li data-p="(\w+)">.*?<span class="formula">= (.*?) </span>',
        robot_page(regrouping),
        re.DOTALL,
    )
    yield form("MathML", page, by_mathml)
    files = generate_files(regrouping.robot, targets=("numpy", "c"), regrouping=regrouping)
    name = regrouping.robot.name
    yield form("Python, FORMULAS", [*constant(files[f"{name}.py"], "FORMULAS").items()], by_grammar)
    comment = files[f"{name}.c"].partition("*/")[0]
    head = [(n, e) for n, e in definitions(comment.splitlines()) if n in absorbing]
    yield form("C, its head", head, by_grammar)


def constant(text: str, name: str) -> Any:
    """A constant of a module, from its text."""
    assigned = [s for s in ast.parse(text).body if isinstance(s, ast.Assign)]
    return next(ast.literal_eval(s.value) for s in assigned if ast.unparse(s.targets[0]) == name)


def recursive_form(regrouping: Regrouping, known: Mapping[str, Any]) -> Form:
    """Link by link: each formula by itself, with random numbers for what stands in it."""
    formulas = definitions(printed_formulas(regrouping, "recursive").splitlines())
    chain = {name: graph.number(name) for name, _ in formulas}
    received: dict[str, dict[str, Any]] = {}
    for source, target, c in regrouping.steps:
        if target not in regrouping.no_effect:
            received.setdefault(target, {})[source] = c
    right = {}
    for target, terms in received.items():
        values = {**known, **chain}
        inside = [
            graph.expression(c, values) * values[f"{p}R" if p in received else p]
            for p, c in terms.items()
            if c
        ]
        right[f"{target}R"] = known[target] + sum(inside)
    return Form("text, link by link", formulas, {**known, **chain}, right, one_by_one(by_grammar))
