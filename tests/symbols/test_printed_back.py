"""What `symgen show` prints is read back and compared with other dynamics: every model, form and
format.
"""

from __future__ import annotations

import re

import pytest
from campaign import sampled, some
from certify.printed import equations
from certify.tables import formulas_hold
from printed_back import error_of

from symgen.certify.texts import TOLERANCE
from symgen.certify.witness import Witness, ungrouped
from symgen.derive.models import SYMBOLIC
from symgen.description import load_robot, packaged_robots
from symgen.errors import SymgenError
from symgen.pages.formulas import printed
from symgen.regroup.regrouping import regroup
from symgen.symbols.symbolic import symbolic

ROBOTS = ("planar_2r", "scara", "emps", "emps_asymmetric", "haptic", "four_bar", "five_bar")
CASES = [
    (robot, parameters, model)
    for robot in ROBOTS
    for parameters in ("base", "standard")
    for model in SYMBOLIC
]


@pytest.mark.parametrize("case", sampled(CASES, 9, more=20), ids=lambda case: "-".join(case))
@some(2)
def test_every_model_holds_in_every_form_and_format(case) -> None:
    name, parameters, model = case
    robot = load_robot(name)
    models = symbolic(robot, parameters=parameters)
    regrouping = regroup(robot) if parameters == "base" else ungrouped(robot)
    for form in ("closed", "recursive"):
        for format in ("text", "json", "sympy"):
            try:
                text = models.show(model, form=form, format=format)
            except SymgenError:
                continue  # there is no such form
            assert error_of(text, models, regrouping, model) < TOLERANCE, (form, format)


@pytest.mark.parametrize("values", [{"q2": "pi/2"}, {"D2": 0, "QP1": 0}, {"MX2": "1/2", "g": 0}])
def test_given_values_are_kept(values) -> None:
    robot = load_robot("planar_2r")
    models = symbolic(robot, values=values)
    for model in ("inverse_dynamics", "inertia_matrix", "pose"):
        assert error_of(models.show(model), models, regroup(robot), model) < TOLERANCE


@pytest.mark.parametrize("format", ["text", "json", "sympy"])
@pytest.mark.parametrize("form", ["closed", "recursive"])
def test_one_wrong_sign_is_seen(form: str, format: str) -> None:
    robot = load_robot("planar_2r")
    models = symbolic(robot)
    right = models.show("inverse_dynamics", form=form, format=format)
    wrong = re.sub(r"\bsin\(q2\)|\bS2(?=\*)", r"(-\g<0>)", right, count=1)
    assert wrong != right
    assert not error_of(wrong, models, regroup(robot), "inverse_dynamics") < TOLERANCE


@pytest.mark.parametrize("name", sampled(packaged_robots(), 3, always=("tx40",)))
@pytest.mark.parametrize("form", ["text", "json"])
@some(2)
def test_formulas_hold_as_printed(name, form) -> None:
    regrouping = regroup(load_robot(name))
    formulas = [x for x in equations(printed(regrouping, form)) if x[0].isidentifier()]
    assert {x for x, _ in formulas} >= {b.name for b in regrouping.base if b.name != b.own}
    assert formulas_hold(formulas, Witness(regrouping))


def test_a_wrong_formula_is_seen() -> None:
    witness = Witness(regroup(load_robot("tx40")))
    assert formulas_hold([("MX2R", "MX2 + D3*(M3 + M4 + M5 + M6)")], witness)
    # both are 0.225 in the file
    assert not formulas_hold([("MX2R", "MX2 + RL4*(M3 + M4 + M5 + M6)")], witness)
