"""`symgen show`: text, LaTeX and JSON say the same formulas; operation counts are those of a text."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest
from campaign import sampled, some
from typer.testing import CliRunner

import symgen
from symgen.cli.main import app
from symgen.description import load_robot, packaged_robots, parse
from symgen.description.naming import Namespace
from symgen.emit.printers import Text
from symgen.emit.spec import function, is_inertial, is_inertial_or_actuator
from symgen.regroup.regrouping import regroup

GENERATED = Path(__file__).resolve().parents[2] / "generated"
CLOSED = {"haptic", "five_bar", "four_bar"}  # general loops take longer; tests/regroup covers them


def counted(source):
    """(multiplications, additions) by syntax tree; a square is one multiplication, a sign is free."""
    operators = [node.op for node in ast.walk(ast.parse(source)) if isinstance(node, ast.BinOp)]
    return sum(isinstance(op, ast.Mult | ast.Pow) for op in operators), sum(
        isinstance(op, ast.Add | ast.Sub) for op in operators
    )


def run(*arguments):
    return CliRunner().invoke(app, ["show", *map(str, arguments)])


def test_text_is_equation_27():
    """Chapter, eq. (27), with Ia written Ia."""
    out = run("tx40").stdout
    assert "60 base parameters of 86" in out
    for line in (
        "ZZ1R    = ZZ1 + Ia1 + YY2 + YY3 + D3**2*(M3 + M4 + M5 + M6)",
        "XX2R    = XX2 - YY2 - D3**2*(M3 + M4 + M5 + M6)",
        "MY3R    = MY3 - MZ4 - RL4*(M4 + M5 + M6)",
        "XX6R    = XX6 - YY6",
        "no effect: XX1 XY1 XZ1 YY1 YZ1 MX1 MY1 MZ1 M1 MZ2 M2",
    ):
        assert line in out.splitlines()


@pytest.mark.parametrize(
    "name", sampled([n for n in packaged_robots() if n not in CLOSED], 4, always=("tx40",))
)
@some(2)
def test_formulas_are_those_of_the_module(name):
    document = json.loads(run(name, "--json").stdout)
    module = symgen.model(name)
    assert {b["name"]: b["formula"] for b in document["base_parameters"]} == {
        name: module.FORMULAS.get(name, name) for name in module.BASE_PARAMETERS
    }
    assert document["no_effect"] == list(module.NO_EFFECT)
    text = re.sub(r"\n {4,}", " ", run(name).stdout)
    for b in document["base_parameters"]:
        if b["name"] != b["formula"]:
            assert re.search(rf"^{b['name']} += {re.escape(b['formula'])}$", text, re.MULTILINE), b[
                "name"
            ]


def test_json_contract():
    document = json.loads(run("tx40", "--format", "json").stdout)
    assert {
        "name",
        "count",
        "standard_count",
        "base_parameters",
        "no_effect",
        "operations",
        "not_read",
    } == {*document} - {"method"}
    assert (document["name"], document["count"], document["standard_count"]) == ("tx40", 60, 86)
    assert set(document["operations"]) == {
        "regressor",
        "regressor_inertial",
        "inverse_dynamics",
        "inverse_dynamics_inertial",
    }
    for b in document[
        "base_parameters"
    ]:  # a formula is the sum of its terms, in the grammar of robot files
        names = {t["parameter"] for t in b["terms"]} | {"D3", "RL4", "g"}
        total = " + ".join(f"({t['coefficient']})*{t['parameter']}" for t in b["terms"])
        assert parse(b["formula"], names) == parse(total, names)


def test_operations_are_those_of_the_text():
    regrouping = regroup(load_robot("tx40"))
    robot = regrouping.robot
    operations = json.loads(run("tx40", "--json").stdout)["operations"]
    texts, of_constants = {}, {}
    for name, model, only in (
        ("regressor", "regressor", lambda own: True),
        ("regressor_inertial", "regressor", is_inertial_or_actuator(robot)),
        ("inverse_dynamics", "inverse_dynamics", lambda own: True),
        ("inverse_dynamics_inertial", "inverse_dynamics", is_inertial(robot)),
    ):
        made = function(regrouping, model, only)
        values = made.values
        of_constants[name] = tuple(
            sum(node.op == op and bool(node.fixed) for node in made.nodes) for op in ("mul", "add")
        )
        text = Text(values.outputs, values.algebra.sections, Namespace(()))
        texts[name] = [line for s in text.sections for line in s.lines]
        texts[name] += map(text.expression, values.outputs)
    for name, lines in texts.items():
        mul, add = counted("\n".join(lines))
        once_mul, once_add = of_constants[name]  # which are computed once a call
        assert (mul - once_mul, add - once_add) == tuple(operations[name].values()), name
    header = (GENERATED / "tx40.py").read_text()
    for name in ("regressor", "inverse_dynamics"):
        assert re.search(
            (
                rf"{name} +{operations[name]['mul']} multiplications, {operations[name]['add']} "
                r"additions"
            ),
            header,
        )


def test_only_one():
    assert run("tx40", "--only", "XX2R").stdout == "XX2R = XX2 - YY2 - D3**2*(M3 + M4 + M5 + M6)\n"
    assert [
        b["name"]
        for b in json.loads(run("emps", "--only", "M1R", "--json").stdout)["base_parameters"]
    ] == ["M1R"]
    result = run("tx40", "--only", "XX2")
    assert result.exit_code == 2 and "XX2R" in result.stderr and result.stdout == ""


def test_latex():
    out = run("tx40", "--format", "latex").stdout
    assert (
        r"ZZ_{1R} &= ZZ_{1} + I_{a1} + YY_{2} + YY_{3} + D_{3}^{2}\,\left(M_{3} + M_{4} + M_{5} + "
        r"M_{6}\right) \\"
    ) in out
    assert "XX_{6R} &= XX_{6} - YY_{6}\n" in out
    assert out.startswith("\\begin{aligned}") and out.count("{") == out.count("}")


def test_recursive_form_expands_to_the_flat_one():
    """Substituting YYR_j, MZR_j, MR_j link by link gives the formulas of eq. (27)."""
    lines = dict(line.split(" = ") for line in run("tx40", "--recursive").stdout.splitlines())
    assert lines["YY2R"] == "YY2 + YY3 + D3**2*M3R" and lines["M5R"] == "M5 + M6"
    regrouping = regroup(load_robot("tx40"))
    names = {*regrouping.robot.parameters, *lines, "D3", "RL4", "g"}

    def expanded(text):
        while found := [n for n in re.findall(r"\w+R\b", text) if n in lines]:
            text = re.sub(rf"\b{found[0]}\b", f"({lines[found[0]]})", text)
        return parse(text, names)

    for b in regrouping.base:
        if b.name != b.own:
            assert expanded(b.name) == parse(str(b.formula), names), b.name


@pytest.mark.parametrize(("arguments", "words"), [
    (["tx41"], "tx40"),
    (["tx40", "--format", "html"], "html"),
    (["tx40", "--recursive", "--json"], "--recursive"),
    (["nowhere/arm.yaml"], "arm.yaml"),
])  # fmt: skip
def test_bad_input_is_exit_2(arguments, words):
    result = run(*arguments)
    assert (
        result.exit_code == 2
        and words in result.stderr
        and "Traceback" not in result.output
        and result.stdout == ""
    )


def test_show_emits_and_certifies_nothing(monkeypatch):
    """What is printed is made of the formulas alone; operations are counted for JSON."""
    import sys

    for name in [n for n in sys.modules if n.startswith("symgen.certify")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr("symgen.pages.formulas.operations", None)
    assert run("tx40").exit_code == 0 and run("tx40", "--format", "latex").exit_code == 0
    model = run("planar_2r", "--model", "inertia_matrix", "--format", "latex")
    assert model.exit_code == 0
    assert not [n for n in sys.modules if n.startswith("symgen.certify")]


DECIMAL_ANGLES = """\
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {g: 9.81, D3: 0.4, R3: 0.12, A1: 0.02, A2: 1.571, A3: -1.5712}
frames:
  1: {ant: 0, sigma: 0, alpha: A1, d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: A2, d: 0.1,  theta: q2, r: 0}
  3: {ant: 2, sigma: 0, alpha: A3, d: D3, theta: q3, r: R3}
"""


@pytest.mark.parametrize("form", [[], ["--recursive"], ["--format", "latex"], ["--json"]], ids=str)
def test_at_values_prints_coefficients_as_decimals(tmp_path, form):
    (tmp_path / "arm.yaml").write_text(DECIMAL_ANGLES)
    out = run(tmp_path / "arm.yaml", "--at-values", *form).stdout
    words = out.replace("singly", "")
    assert "cos" not in words and "sin" not in words
    assert max(len(digits) for digits in re.findall(r"\.0*([1-9]\d*)", out)) == 15


def test_decimals_are_the_values_of_the_exact_coefficients(tmp_path):
    (tmp_path / "arm.yaml").write_text(DECIMAL_ANGLES)
    robot = load_robot(tmp_path / "arm.yaml")
    shown = json.loads(run(tmp_path / "arm.yaml", "--at-values", "--json").stdout)
    exact = regroup(robot).base
    for parameter, printed in zip(exact, shown["base_parameters"], strict=True):
        values = {t["parameter"]: parse(t["coefficient"], ()) for t in printed["terms"]}
        assert values.keys() == parameter.combination.keys()
        for name, c in parameter.combination.items():
            assert float(values[name]) == pytest.approx(
                c.value(robot.constants), rel=1e-11
            )  # cos(1.571) of floats has 12 digits


def test_the_packaged_robots_are_listed():
    result = CliRunner().invoke(app, ["show", "--packaged"])
    lines = result.stdout.splitlines()
    assert result.exit_code == 0
    assert [line.split()[0] for line in lines] == list(packaged_robots())
    assert any(line.startswith("tx40 ") and "TX40" in line for line in lines)


def test_signs_are_those_of_point_masses(tmp_path):
    """Three point masses on a turning link: XY = -sum m x y, the sign of ixy of the URDF, whose
    torques are those of pinocchio and of the masses themselves.
    """
    import pinocchio

    m, r = (
        np.array([1.0, 2.0, 3.0]),
        np.array([[0.3, 0.2, 0.1], [0.1, 0.5, -0.2], [0.4, -0.1, 0.3]]),
    )
    c = m @ r / m.sum()
    J = sum(a * (d @ d * np.eye(3) - np.outer(d, d)) for a, d in zip(m, r - c, strict=True))
    tensor = " ".join(
        f'i{a}{b}="{J["xyz".index(a), "xyz".index(b)]!r}"'
        for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    urdf = (
        (
            '<robot name="one"><link name="b"/><link name="l"><inertial><origin xyz="'
            + " ".join(map(repr, map(float, c)))
            + f'"/><mass value="{m.sum()!r}"/><inertia {tensor}/></inertial></link>'
            '<joint name="j" type="revolute"><parent link="b"/><child link="l"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" velocity="3" effort="9"/></joint></robot>'
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )
    (tmp_path / "one.urdf").write_text(urdf)
    values = symgen.model(tmp_path / "one.urdf").VALUES
    assert values["XY1"] == pytest.approx(-np.sum(m * r[:, 0] * r[:, 1]))
    assert values["MX1"] == pytest.approx(np.sum(m * r[:, 0]))
    ixy = -np.sum(m * (r - c)[:, 0] * (r - c)[:, 1])
    assert f'ixy="{ixy:.6f}'[:12] in urdf and ixy * J[0, 1] > 0
    body = pinocchio.buildModelFromUrdf(str(tmp_path / "one.urdf")).inertias[1]
    assert body.toDynamicParameters()[5] == pytest.approx(values["XY1"])
    (line,) = [x for x in run("tx40").stdout.splitlines() if x.startswith("signs:")]
    assert "XY = -sum m x y" in line and "as ixy of a URDF" in run("tx40").stdout.replace("\n", " ")
