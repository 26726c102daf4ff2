"""Numbers as the robot file writes them, a visible sign between two of them, and pasted SymPy."""

from __future__ import annotations

import re

import pytest
import sympy
from printed_back import error_of

import symgen
from symgen.description.grammar import parse
from symgen.pages.formulas import printed
from symgen.pages.page import robot_page
from symgen.symbols import expressions
from symgen.symbols.printers import latex, math

NUM = b"""
symgen: 1
name: num
gravity: [0, 0, -9.81]
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0.4318, theta: q2, r: 0.15}
  3: {ant: 2, sigma: 0, alpha: 0, d: 0.25, theta: q3, r: 0.5}
"""
NAMES = ("S", "sin", "sqrt", "Matrix", "symbols", "sympy", "Rational", "I", "E", "N", "C2")


@pytest.fixture(scope="module")
def base():
    return symgen.regrouping(symgen.parse_robot(NUM, "num.yaml"))


def test_formulas_in_every_language(base) -> None:
    of_text = printed(base, "text")
    assert "2*0.15*MZ2" in of_text and "0.25**2*M3" in of_text and "1/4" not in of_text
    of_latex = printed(base, "latex")
    assert r"2 \cdot 0.15\,MZ_{2}" in of_latex and r"0.25 \cdot 0.5\,M_{3}" in of_latex
    html = robot_page(base)
    assert "<mn>2</mn><mo>·</mo><mn>0.15</mn>" in html and "<mn>0.4318</mn>" in html
    for text in (of_text, of_latex, html.partition("<script")[0]):
        # no two numbers side by side, no subscript of a number, no fraction in place of a decimal
        assert not re.search(r"\d(\\,|</mn><mo>\u2062</mo><mspace[^>]*>(<m\w+>)*<mn>)\d", text)
        assert not re.search(r"0\._|>0\.<|\b1/4\b|\b1/2\b|frac\{1\}|2159", text)


@pytest.mark.parametrize("form", ["closed", "recursive"])
@pytest.mark.parametrize("format", ["text", "latex", "json"])
def test_models_hold_decimals(base, form: str, format: str) -> None:
    shown = symgen.symbolic(base.robot).show("inertia_matrix", form=form, format=format)
    assert "0.25" in shown and ("0.4318" in shown or "0.8636" in shown)
    assert not re.search(r"\b1/4\b|\b1/2\b|frac\{1\}|0\._|2159|0\.0004|\d\\,\d", shown)


def test_numbers_alone_and_in_angles() -> None:
    assert str(parse("0.25")) == "0.25" and str(parse("0.25*pi")) == "pi/4"
    assert str(parse("1/3")) == "1/3" and str(parse("1.0000000000000004")) == "1.0000000000000004"
    assert latex(expressions.expression(parse("D + 0.5"))) == "D + 0.5"
    assert "0.5" in math(expressions.expression(parse("0.5"))) and str(parse("-D/2")) == "-D/2"


def test_energies_of_symbols_keep_their_half() -> None:
    assert "1/2*QP1**2*ZZ1R" in symgen.symbolic("planar_2r").show("kinetic_energy")


@pytest.mark.parametrize(
    ("name", "form"), [*((name, "closed") for name in NAMES), ("S", "recursive")]
)
def test_pasted_sympy_with_any_constant(name: str, form: str) -> None:
    text = NUM.replace(b"gravity", f"constants: {{{name}: 0.3}}\ngravity".encode())
    text = text.replace(b"0.4318", f"sqrt({name}**2 + 3)/2".encode())
    text = text[: text.index(b"  3: {")]
    models = symgen.symbolic(symgen.parse_robot(text, "num.yaml"))
    lines = models.show("inertia_matrix", form=form, format="sympy")
    space: dict[str, object] = {}
    exec(lines, space)  # noqa: S102 (our own output)
    free = {str(x) for x in space.values() if isinstance(x, sympy.Symbol)}
    values = {sympy.Symbol(x, real=True): 0.1 + 0.07 * k for k, x in enumerate(sorted(free))}
    given = dict(values)
    for x, e in space.items():  # steps, in their order
        if isinstance(e, sympy.Expr) and not isinstance(e, sympy.Symbol):
            values[sympy.Symbol(x, real=True)] = e.subs(values)
    made = space["A"].subs(values)
    theirs = models.inertia_matrix().subs(given)
    assert name in free and abs((made - theirs).evalf(20)).norm() < 1e-12


@pytest.mark.parametrize("form", ["closed", "recursive"])
@pytest.mark.parametrize("format", ["text", "json"])
@pytest.mark.parametrize("model", ["inertia_matrix", "bias", "gravity", "pose", "base_parameters"])
def test_decimals_in_place_of_functions_of_numbers(model: str, form: str, format: str) -> None:
    """sin(1.571)**2 YY2 becomes one number times YY2, and the torques are those of the witness."""
    if form == "recursive" and model == "base_parameters":
        return
    text = NUM.replace(b"alpha: pi/2", b"alpha: 1.571").replace(b"0, d: 0.25", b"0.3, d: 0.25")
    base = symgen.regrouping(symgen.parse_robot(text, "num.yaml"))
    exact, decimal = symgen.symbolic(base.robot), symgen.symbolic(base.robot, decimals=True)
    shown = decimal.show(model, form=form, format=format)
    number_inside = re.compile(r"(sin|cos|sqrt)\(\d")
    assert number_inside.search(exact.show(model, form=form, format=format))
    assert not number_inside.search(shown)
    assert max(len(digits) for digits in re.findall(r"\.0*([1-9]\d*)", shown)) == 15
    assert error_of(shown, decimal, base, model) < 1e-13
