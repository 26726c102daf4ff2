"""Every printed equation has the value of the graph, in every form; wrong ones are refused.

`benchmarks/printed_forms.py` runs every robot, model and form, and 200 mutants of each printer.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest
import sympy
from campaign import FULL, campaign, sampled
from forms import graph
from forms.mutants import of_files, of_forms
from forms.printed import Form, by_latex, by_mathml, forms, formula_forms
from forms.reader import ReadError, of_latex, of_mathml, of_text

import symgen
from symgen.derive.models import SYMBOLIC
from symgen.description import load_robot, packaged_robots
from symgen.regroup.regrouping import Regrouping, regroup
from symgen.symbols import expressions, printers
from symgen.symbols.symbolic import SymbolicRobot

FOLDER = Path(__file__).parent / "robots"
OTHERS = tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))
ROBOTS = (*packaged_robots(), *OTHERS)
LIMIT = 1000  # terms of a closed form
CASES = [(robot, model) for robot in ROBOTS for model in SYMBOLIC]
LANGUAGES = ("text", "JSON", "LaTeX", "MathML", "SymPy")


@cache
def regrouping_of(name: str) -> Regrouping:
    return regroup(load_robot(FOLDER / f"{name}.yaml" if name in OTHERS else name))


@cache
def models_of(name: str) -> SymbolicRobot:
    return symgen.symbolic(regrouping_of(name).robot, limit=LIMIT)


def forms_of(robot: str, model: str) -> list[Form]:
    asked = models_of(robot).model(model)
    return [form for shape in ("closed", "recursive") for form in forms(asked, shape)]


def wrong(found: list[Form]) -> dict[str, list[str]]:
    return {form.name: labels for form in found if (labels := form.wrong())}


@pytest.mark.parametrize("case", sampled(CASES, 5, more=14), ids="-".join)
def test_every_equation_of_a_model_has_its_value(case: tuple[str, str]) -> None:
    assert not wrong(forms_of(*case))


@pytest.mark.parametrize("name", sampled(ROBOTS, 1, more=2))
def test_every_formula_of_base_parameters_has_its_value(name: str) -> None:
    assert not wrong([*formula_forms(regrouping_of(name))])


@pytest.mark.parametrize("language", LANGUAGES)
def test_wrong_equations_are_refused(language: str) -> None:
    some_forms = [
        form
        for case in (("scara", "inverse_dynamics"), ("geared", "inertia_matrix"))
        for form in forms_of(*case)
        if form.name.startswith(f"{language},")
    ]
    missed = [m for m in of_forms(some_forms, 30, 1) if not m.refused]
    assert not missed


@campaign
@pytest.mark.parametrize("ending", [".py", ".c"])
def test_wrong_lines_of_emitted_files_are_refused(ending: str) -> None:
    missed = [m for m in of_files(ending, 40 if FULL else 3, 2) if not m.refused]
    assert not missed


# --- the reader ---


@pytest.mark.parametrize(
    "text", ["A_{1} B_{2}", "A_{1}B_{2}", "2 A_{1}", r"A_{1}\,-B_{2}", "A_{1}(B_{2} + 1)", "ABC_{1}", r"\frac{1}{2"]
)  # fmt: skip
def test_latex_without_a_separator_is_no_formula(text: str) -> None:
    known = {name: graph.number(name) for name in ("A1", "B2", "ABC1")}
    with pytest.raises(ReadError):
        by_latex(text, known)


def test_mathml_with_a_product_that_nobody_sees_is_no_formula() -> None:
    known = {name: graph.number(name) for name in ("A", "B")}
    seen = '<mi>A</mi><mo>\u2062</mo><mspace width="0.14em"/><mi>B</mi>'
    assert not graph.differs(by_mathml(seen, known), known["A"] * known["B"])
    with pytest.raises(ReadError):
        by_mathml("<mi>A</mi><mo>\u2062</mo><mi>B</mi>", known)


def test_a_letter_that_two_names_have_is_refused() -> None:
    known: Mapping[str, complex] = {"FV1": 1.0, "Fv1": 2.0, "D3": 3.0, "D_3": 4.0}
    for text in ("F_{v1}", "D_{3}"):
        with pytest.raises(ReadError):
            by_latex(text, known)


def test_readers_agree_on_what_is_read() -> None:
    assert of_latex("A_{1} + 2") and of_mathml("<mi>A</mi>") and of_text("A1 + 2")


# --- trees ---

X, Y, Z = (expressions.symbol(name) for name in ("MY6", "S6", "JP135"))
SIXTH = sympy.sin(sympy.pi / 6, evaluate=False)


@pytest.mark.parametrize(
    "x",
    [
        sympy.Mul(-1, X, Y, evaluate=False),
        sympy.Mul(-1, X, Y, Z, evaluate=False),
        sympy.Mul(-1, 2, X, evaluate=False),
        sympy.Mul(-1, sympy.Mul(X, Y, evaluate=False), evaluate=False),
        expressions.negative(expressions.total([X, Y])),
        expressions.total([X, expressions.negative(expressions.total([Y, Z]))]),
        -X * Y,
        -X,
        -2 * X * Y + Z,
        sympy.Mul(X, Y, SIXTH, evaluate=False),
        sympy.Mul(X, sympy.sqrt(3), Y, evaluate=False),
        X + 8 * sympy.pi / 15,
        X - sympy.pi / 6,
        sympy.exp(-X, evaluate=False) * Y,
        sympy.exp(X) ** 2 * Y,
        abs(X) * Y,
    ],
    ids=printers.text,
)
def test_a_tree_is_typeset_with_its_value(x: expressions.Tree) -> None:
    known = {str(s): graph.number(str(s)) for s in x.free_symbols} | {"pi": graph.number("pi")}
    right = sympy.lambdify([*x.free_symbols], x)(*(known[str(s)] for s in x.free_symbols))
    for markup in (printers.math(x), "".join(printers.math_terms(x))):
        assert not graph.differs(by_mathml(markup, known), right)
    assert not graph.differs(by_latex(printers.latex(x), known), right)
    numbers = dict.fromkeys(x.free_symbols, 1.5)
    assert expressions.negative(x).subs(numbers).evalf() == pytest.approx(-x.subs(numbers).evalf())


def test_a_name_of_several_letters_is_one_word() -> None:
    assert "<mi>MSP</mi>" in printers.math(expressions.symbol("MSP15"))
