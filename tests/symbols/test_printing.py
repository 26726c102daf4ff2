"""Text, LaTeX, SymPy lines and JSON of models say the same; LaTeX is balanced and uses commands of
amsmath alone.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy
from campaign import campaign

import runtime
import symgen
from oracles.exact_zero import are_zero
from symgen.derive.names import families_of
from symgen.symbols.documents import broken_lines as lines
from symgen.symbols.printers import latex_symbol, letter
from symgen.symbols.symbolic import symbolic
from symgen.symbols.symbolic_model import SymbolicModel

NAMES = """
documentclass usepackage setlength oddsidemargin textwidth topmargin textheight parindent allowdisplaybreaks begin end section subsection par medskip hline
Gamma sigma alpha theta vartheta gamma mu omega pi cos sin exp sqrt frac dot ddot operatorname mathbf mathit left right quad det max min
"""
COMMANDS = {*NAMES.split(), ",", "_", ";", " ", "\\"} | {
    *[
        "sbox",
        "ifdim",
        "wd",
        "textwidth",
        "resizebox",
        "usebox",
        "else",
        "fi",
    ]  # of the table of frames
}
EXAMPLES = [
    ("planar_2r", "inverse_dynamics"),
    ("emps_asymmetric", "bias"),
    ("four_bar", "inertia_matrix"),
    ("scara", "jacobian"),
]
ALL = [
    "pose", "jacobian", "jacobian_rate", "velocity", "acceleration", "inverse_dynamics", "inertia_matrix", "coriolis", "bias", "gravity", "friction",
    "kinetic_energy", "potential_energy", "forward_dynamics", "regressor", "base_parameters",
]  # fmt: skip


def test_textbook_lines() -> None:
    """What a lecturer prints: parallel joints collected, factored by parameter, the order of terms
    is ours.
    """
    text = symbolic("planar_2r").show("inertia_matrix")
    assert "C2 = cos(q2), S2 = sin(q2)" in text
    assert text.splitlines()[-3:] == [
        "A(1,1) = ZZ1R + ZZ2 + 2*D2*C2*MX2 - 2*D2*S2*MY2",
        "A(1,2) = ZZ2 + D2*C2*MX2 - D2*S2*MY2",
        "A(2,2) = ZZ2 + Ia2",
    ]
    assert "det J = D3*RL4*C3*S5*(D3*C2 + RL4*S23)" in symbolic("tx40").show("determinant")
    assert "T(1,4) = D2*C1 + D3*C12" in symbolic("scara").show("pose")
    standard = symbolic("tx40", parameters="standard").show("inertia_matrix")
    assert "(2*D3*RL4*S3 + D3**2 + RL4**2)*(M4 + M5 + M6)" in standard


def latex_is_sound(text: str) -> None:
    depth = 0
    for c in re.sub(r"\\[{}]", "", text):
        depth += (c == "{") - (c == "}")
        assert depth >= 0
    assert depth == 0
    assert re.findall(r"\\begin\{(.*?)\}", text) and sorted(
        re.findall(r"\\begin\{(.*?)\}", text)
    ) == sorted(re.findall(r"\\end\{(.*?)\}", text))
    body = text.partition(r"\begin{document}")[2]  # the preamble is compiled elsewhere
    assert set(re.findall(r"\\([A-Za-z]+|.)", body)) <= COMMANDS, (
        set(re.findall(r"\\([A-Za-z]+|.)", body)) - COMMANDS
    )
    for block in re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL):
        for row in re.split(r"\\\\", block):
            assert row.count("&") == 1 and row.count(r"\left") == row.count(r"\right")


@pytest.mark.parametrize(("name", "model"), EXAMPLES)
@pytest.mark.parametrize("form", ["closed", "recursive"])
def test_latex(name: str, model: str, form: str) -> None:
    latex_is_sound(symbolic(name).show(model, form=form, format="latex"))


@campaign
@pytest.mark.parametrize("name", symgen.packaged_robots())
def test_latex_of_every_model(name: str) -> None:
    """Every model of every robot in either form, or a sentence that says which form works."""
    models = symbolic(name, limit=300)
    for model in ALL:
        for form in ("closed", "recursive"):
            try:
                text = models.show(model, form=form, format="latex")
            except symgen.SymgenError as e:
                assert re.search("form recursive|form closed|inertia_matrix|bias", str(e)), e
                continue
            latex_is_sound(text)
            assert max(map(len, models.show(model, form=form).splitlines())) < 2000


@pytest.mark.parametrize(("name", "model"), EXAMPLES)
@pytest.mark.parametrize("form", ["closed", "recursive"])
def test_sympy_lines_are_python_that_makes_the_model(name: str, model: str, form: str) -> None:
    models = symbolic(name)
    text = models.show(model, form=form, format="sympy")
    space: dict[str, object] = {}
    exec(text, space)  # noqa: S102 (our own output)
    letter = (
        text.splitlines()[-1].partition(" ")[0]
        if form == "recursive"
        else next(
            x
            for x in ("GAM", "H", "A", "J")
            if x in space and isinstance(space[x], sympy.MatrixBase)
        )
    )
    made = (
        next(x for x in space.values() if isinstance(x, sympy.MatrixBase))
        if letter not in space
        else space[letter]
    )
    closed = models._sympy(model)
    if name == "emps_asymmetric":
        return  # Max and Abs: compared as numbers in test_emitted_agree
    assert are_zero(sympy.Matrix(made) - closed)
    assert not made.atoms(sympy.Float)


def test_json() -> None:
    document = json.loads(symbolic("planar_2r").show("jacobian", format="json", of=2, frame=1))
    assert (document["model"], document["of"], document["frame"], document["form"]) == (
        "jacobian",
        2,
        1,
        "closed",
    )
    assert document["entries"] == {"J(vy,1)": "D2", "J(wz,1)": "1", "J(wz,2)": "1"} and document[
        "axes"
    ][0][:3] == ["vx", "vy", "vz"]
    listed = json.loads(
        symbolic("planar_2r").show("inverse_dynamics", form="recursive", format="json")
    )["equations"]
    assert (
        listed[0] == {"section": "Trigonometry", "name": "C1", "expression": "cos(q1)"}
        and listed[-1]["name"] == "GAM(2)"
    )


def test_text_of_a_recursion_evaluates() -> None:
    """The lines in their order are a program: its result is that of the emitted module."""
    module = runtime.load_model("tx40", folder=Path(__file__).parents[2] / "generated")
    rng = np.random.default_rng(3)
    q, qd, qdd = rng.standard_normal((3, 6))
    X = rng.standard_normal(60)
    space: dict[str, object] = {
        "cos": np.cos,
        "sin": np.sin,
        "sign": np.sign,
        **module.CONSTANTS,
        **dict(zip(module.BASE_PARAMETERS, X, strict=True)),
    }
    space |= {
        f"{s}{j + 1}": x[j] for s, x in (("q", q), ("QP", qd), ("QDP", qdd)) for j in range(6)
    }
    equations = json.loads(
        symbolic("tx40").show("inverse_dynamics", form="recursive", format="json")
    )["equations"]
    torque = []
    for e in equations:
        value = eval(e["expression"], {}, space)  # noqa: S307 (our own output)
        space[e["name"]] = value
        if e["section"] == "Result":
            torque.append(value)
    assert np.allclose(torque, module.inverse_dynamics(q, qd, qdd, X), rtol=1e-12, atol=0)


def test_lines_break_before_signs() -> None:
    formula = "a*(b + c) - d*(e + f - g) + h"
    for width in (8, 14, 20, 100):
        broken = lines("A = ", formula, width, "    ")
        assert " ".join(line[4:] for line in broken) == formula
        assert all(line[4] in "+-" for line in broken[1:])
        assert width < 14 or max(map(len, broken)) <= max(width, 18)


BAD = [
    (
        {"robot": "tx40", "name": "jacobian", "of": 9},
        "frame 9 does not exist; tx40 has frames 0 to 6",
    ),
    ({"robot": "tx40", "name": "inertia"}, "expected one of regressor, inverse_dynamics"),
    (
        {"robot": "tx40", "name": "forward_dynamics"},
        "solve A qdd = Gamma - H with inertia_matrix and bias",
    ),
    ({"robot": "four_bar", "name": "coriolis"}, "use the model bias"),
    ({"robot": "four_bar", "name": "coriolis", "form": "recursive"}, "use the model bias"),
    ({"robot": "panda", "name": "bias"}, "form recursive"),
    ({"robot": "tx40", "name": "determinant", "form": "recursive"}, "form closed"),
    ({"robot": "planar_2r", "name": "determinant"}, "rows=(1, 2)"),
    ({"robot": "planar_2r", "name": "determinant", "rows": (1, 9)}, "expected 2 different rows"),
    ({"robot": "planar_2r", "name": "pose", "form": "open"}, "expected one of closed, recursive"),
    ({"robot": "planar_2r", "name": "pose", "format": "word"}, "expected one of text, latex"),
    ({"robot": "sr400", "name": "closure"}, "use passive=symbols to keep the passive joints"),
    ({"robot": "panda", "name": "determinant"}, "det(J*J.T) in SymPy"),
    ({"robot": "tx40", "name": "gravity", "of": 3}, "leave out `of` and `frame`"),
    (
        {"robot": "tx40", "name": "gravity", "rows": (1,)},
        "only the model `determinant` has `rows`",
    ),
]


@pytest.mark.parametrize(("asked", "told"), BAD, ids=lambda case: str(case)[:60])
def test_bad_input_is_one_sentence_with_what_works(asked: dict, told: str) -> None:
    asked = dict(asked)
    models = symbolic(asked.pop("robot"))
    with pytest.raises(symgen.SymgenError) as e:
        models.show(asked.pop("name"), **asked)
    assert told in str(e.value) and "\n" not in str(e.value)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"values": {"D9": 1}}, "similar names: "),
        ({"values": {"D2": float("nan")}}, "expected a finite number"),
        ({"values": {"D2": "1 +"}}, "in '1 +'"),
        ({"values": {"D2": "__import__('os')"}}, "__import__"),
        ({"parameters": "minimal"}, "expected one of base, standard"),
        ({"passive": "none"}, "expected one of functions, symbols"),
    ],
)
def test_bad_arguments(asked: dict, told: str) -> None:
    with pytest.raises(symgen.SymgenError, match=re.escape(told)):
        symbolic("planar_2r", **asked)


def test_loops_say_which_joints_are_functions() -> None:
    with pytest.raises(symgen.SymgenError, match="leave the argument `passive` out"):
        symbolic("four_bar", passive="functions")
    assert "Passive joints q2, q3 are symbols" in symbolic("four_bar").show("bias")
    text = symbolic("sr400", passive="symbols").show("closure")
    assert "q3 = pi/2 - q2 + q7, kept as a symbol." in text
    functions, kept = symbolic("haptic"), symbolic("haptic", passive="symbols")
    relations = {kept.symbols[f"{s}{j}"]: 0 for s in ("q", "QP", "QDP") for j in (3, 4, 6, 7)}
    q2, q5, c = (kept.symbols[x] for x in ("q2", "q5", "c"))
    relations |= {
        kept.symbols["q3"]: q5 - q2 + sympy.pi,
        kept.symbols["q4"]: c - q5,
        kept.symbols["q6"]: q2 - q5,
        kept.symbols["q7"]: q5 - q2 + sympy.pi,
    }
    assert are_zero(kept.gravity().subs(relations, simultaneous=True) - functions.gravity())
    assert are_zero(kept.closure().subs(relations, simultaneous=True))


@pytest.mark.parametrize(
    ("constant", "model"), [("C2", "inertia_matrix"), ("S12", "gravity"), ("VP221", "gravity")]
)
@pytest.mark.parametrize("form", ["closed", "recursive"])
def test_steps_give_way_to_constants(constant: str, model: str, form: str) -> None:
    """The text is that of a robot whose constant has another name, but for what gives way."""

    def shown(name: str) -> str:
        text = (
            f"symgen: 1\nname: a\ngravity: [0, -g, 0]\nconstants: {{{name}: 0.5, g: "
            f"9.81}}\nframes:\n  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}\n"
            f"  2: {{ant: 1, sigma: 0, alpha: 0, d: {name}, theta: q2, r: 0}}\n"
        )
        return symbolic(symgen.parse_robot(text.encode(), "a.yaml")).show(model, form=form)

    text = re.sub(rf"\b{constant}(?=\b|AS12)", "L", shown(constant))  # C2AS12 = C2*AS12
    assert constant != "C2" or "C2_ = cos(q2)" in text
    assert re.sub(r"\b([A-Z]+\d+)_", r"\1", text) == shown("L")


def test_gravity_as_number() -> None:
    g = sympy.Symbol("g", real=True)
    models = symbolic("planar_2r"), symbolic("planar_2r", values={"g": 9.81})
    by_symbol, by_number = (m.gravity()[0] for m in models)
    assert g in by_symbol.free_symbols and g not in by_number.free_symbols
    assert sympy.expand(by_symbol.subs(g, sympy.Rational("9.81")) - by_number) == 0


def test_formulas_as_text_are_the_base_parameters() -> None:
    for name in ("tx40", "haptic"):
        robot = symgen.load_robot(name)
        names = {n: sympy.Symbol(n, real=True) for n in (*robot.parameters, *robot.constants)}
        made_of = symbolic(name).base_parameters()
        for b in symgen.regrouping(robot).base:
            read = sympy.sympify(str(b.formula), locals=names, rational=True)
            assert sympy.expand(made_of[sympy.Symbol(b.name, real=True)] - read) == 0


def test_help_and_formulas_as_text_need_no_sympy() -> None:
    """What does not ask for symbols starts without SymPy."""
    code = (
        "import sys; from symgen.cli.main import app; from typer.testing import CliRunner; "
        "run = [CliRunner().invoke(app, x) for x in (['--help'], ['show', 'scara'])]; "
        "print([x.exit_code for x in run], 'sympy' in sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "[0, 0] False"


def test_a_second_form_is_no_second_computation(monkeypatch) -> None:
    made = []
    closed = SymbolicModel._closed
    monkeypatch.setattr(SymbolicModel, "_closed", lambda self: made.append(self) or closed(self))
    models = symbolic("planar_2r")
    for format in ("text", "latex", "latex-fragment", "sympy", "json"):
        models.show("inertia_matrix", format=format)
    models.inertia_matrix()
    assert len(made) == 1


def test_letters_of_angles_with_ratios() -> None:
    assert letter("C2o5x2") == ("C", "2/5·2") and letter("th5m2b") == ("vartheta'", "5-2")
    assert latex_symbol("S2o5x2") == r"S_{2/5 \cdot 2}"
    assert {"th", "C"} <= {*families_of(["th2o5x2", "C2o5x2"])}
