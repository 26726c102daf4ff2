"""Formulas in every language: sympy reads the text as what `symbols.expressions` makes of it; Python, LaTeX and
MathML say the same terms.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
import sympy

from oracles.random_robots import random_robot
from symgen.description import load_robot
from symgen.description.expression import call, with_known_cosines
from symgen.description.grammar import parse
from symgen.emit.printers import PYTHON
from symgen.regroup.regrouping import Formula, regroup
from symgen.symbols import expressions
from symgen.symbols.printers import latex, math_terms

ROBOTS = [
    load_robot("tx40"),
    load_robot("two_branch"),
    *(random_robot(seed) for seed in (4, 7, 9, 13, 43, 113)),
]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_export_equals_text(robot) -> None:
    names = {name: sympy.Symbol(name, real=True) for name in (*robot.parameters, *robot.constants)}
    for b in regroup(robot).base:
        read = sympy.sympify(
            str(b.formula), locals=names, rational=True
        )  # our own text, not a user's
        assert (
            sympy.expand(read - expressions.evaluated(expressions.formula(b.formula), {})) == 0
        ), b.name


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_sympy_text_is_read_back(robot) -> None:
    """To SymPy and back: the grammar of robot files reads what SymPy writes as the same formula."""
    known = {*robot.parameters, *robot.constants}
    for b in regroup(robot).base:
        assert with_known_cosines(
            parse(str(expressions.evaluated(expressions.formula(b.formula), {})), known)
        ) == with_known_cosines(parse(str(b.formula), known)), b.name


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_python_evaluates_to_the_expressions(robot) -> None:
    values = dict(
        zip(
            robot.parameters,
            np.random.default_rng(0).standard_normal(len(robot.parameters)),
            strict=True,
        )
    ) | dict(robot.constants)
    for b in regroup(robot).base:
        found = eval(b.formula.text(PYTHON.expression), {"xp": np}, values)  # noqa: S307 (our own output)
        assert found == pytest.approx(
            sum(c.value(robot.constants) * values[name] for name, c in b.combination.items()),
            rel=1e-13,
        )


def test_every_printer_writes_every_piece() -> None:
    a = parse("a", {"a", "b"})
    angle = parse("pi/3 + b", {"a", "b"})
    c = call("cos", angle) ** 2 * parse("2/3", set()) - call("sqrt", a) * call(
        "inv", parse("a + b", {"a", "b"})
    )
    f = Formula(
        {
            "ZZ1": parse("1", set()),
            "YY2": parse("1", set()),
            "XX2": -parse("1", set()),
            "M3": c,
            "M4": -parse("0.25*a**2/b", {"a", "b"}),
        }
    )
    cos = "cos(b + pi/3)" if "cos(b" in str(c) else "cos(pi/3 + b)"
    assert str(f) == f"ZZ1 + YY2 - XX2 + ({c!s})*M3 - a**2/(4*b)*M4".replace(
        "a**2/(4*b)", str(parse("0.25*a**2/b", {"a", "b"}))
    )
    assert f"2*{cos}**2/3" in str(c)
    text = f.text(PYTHON.expression)
    assert "xp.cos(" in text and "xp.pi" in text
    typeset = latex(expressions.formula(f))
    assert (
        r"\cos^{2}{\left(" in typeset
        and r"\sqrt{a}" in typeset
        and r"\frac{2" in typeset
        and typeset.startswith("ZZ_{1} + YY_{2} - XX_{2} + ")
    )
    terms = math_terms(expressions.formula(f))
    assert len(terms) == 5 and all(ElementTree.fromstring(term).tag == "math" for term in terms)
