"""What `symgen show` prints is read back and compared: every model, form and format."""

from __future__ import annotations

import re

import pytest
from campaign import sampled, some
from typer.testing import CliRunner

from symgen.certify.shown import certified_model
from symgen.certify.tables import certified_formulas
from symgen.certify.witness import ungrouped
from symgen.cli.main import app
from symgen.derive.models import SYMBOLIC
from symgen.description import load_robot
from symgen.errors import CertificateError, SymgenError
from symgen.regroup.regrouping import regroup
from symgen.symbols.symbolic import SymbolicRobot, symbolic

ROBOTS = ("planar_2r", "scara", "emps", "emps_asymmetric", "haptic", "four_bar", "five_bar")
CASES = [
    (robot, parameters, model)
    for robot in ROBOTS
    for parameters in ("base", "standard")
    for model in SYMBOLIC
]


@pytest.mark.parametrize("case", sampled(CASES, 9, more=110), ids=lambda case: "-".join(case))
@some(2)
def test_every_model_holds_in_every_form_and_format(case) -> None:
    name, parameters, model = case
    robot = load_robot(name)
    models = symbolic(robot, parameters=parameters)
    regrouping = regroup(robot) if parameters == "base" else ungrouped(robot)
    for form in ("closed", "recursive"):
        for format in ("text", "json", "sympy", "latex"):
            try:
                text, note = certified_model(models, regrouping, model, form, format)
            except CertificateError:
                raise
            except SymgenError:
                continue  # there is no such form
            assert note == "" and text == models.show(model, form=form, format=format)


@pytest.mark.parametrize("values", [{"q2": "pi/2"}, {"D2": 0, "QP1": 0}, {"MX2": "1/2", "g": 0}])
def test_given_values_are_kept(values) -> None:
    robot = load_robot("planar_2r")
    models = symbolic(robot, values=values)
    for model in ("inverse_dynamics", "inertia_matrix", "pose"):
        assert certified_model(models, regroup(robot), model)[1] == ""


def test_values_of_passive_joints_are_said_not_to_be_certified() -> None:
    robot = load_robot("sr400")
    models = symbolic(robot, passive="symbols", values={"q3": 0})
    assert "is not certified" in certified_model(models, regroup(robot), "gravity")[1]


@pytest.mark.parametrize("format", ["text", "json", "sympy"])
@pytest.mark.parametrize("form", ["closed", "recursive"])
def test_one_wrong_sign_is_refused(monkeypatch, form: str, format: str) -> None:
    right = SymbolicRobot.show

    def wrong(self, name, **asked):
        text = right(self, name, **asked)
        return re.sub(r"\bsin\(q2\)|\bS2(?=\*)", r"(-\g<0>)", text, count=1)

    monkeypatch.setattr(SymbolicRobot, "show", wrong)
    robot = load_robot("planar_2r")
    with pytest.raises(CertificateError, match=r"inverse_dynamics as printed is off by .*nothing"):
        certified_model(symbolic(robot), regroup(robot), "inverse_dynamics", form, format)


def test_a_wrong_formula_is_refused() -> None:
    regrouping = regroup(load_robot("tx40"))
    assert certified_formulas(regrouping, "MX2R = MX2 + D3*(M3 + M4 + M5 + M6)")
    with pytest.raises(CertificateError):  # both are 0.225 in the file
        certified_formulas(regrouping, "MX2R = MX2 + RL4*(M3 + M4 + M5 + M6)")


def test_nothing_is_printed_where_it_is_wrong(monkeypatch) -> None:
    from symgen.report import formulas

    right = formulas.printed
    monkeypatch.setattr(formulas, "printed", lambda *a: right(*a).replace("D2**2", "D2"))
    result = CliRunner().invoke(app, ["show", "planar_2r"])
    assert result.exit_code == 1 and result.stdout == ""
    assert result.stderr.count("\n") == 1 and "a formula as printed is false" in result.stderr
