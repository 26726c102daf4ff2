"""`symgen show ROBOT --model`: formats, frames, forms, values; bad input is one sentence and exit
code 2.
"""

import json

import pytest
from typer.testing import CliRunner

from symgen.cli.main import app


def run(*arguments):
    return CliRunner().invoke(app, ["show", *arguments])


def of_links(model, *arguments):
    """Of the smallest arm in standard parameters."""
    return run("planar_2r", "--model", model, "--parameters", "standard", *arguments).stdout


def test_model_as_text():
    result = run("planar_2r", "--model", "gravity")
    assert result.exit_code == 0 and "Q(2) = g*C12*MX2 - g*S12*MY2 + OFFSET2" in result.stdout


def test_frames_values_forms_and_formats():
    assert "J(vy,1) = D2" in of_links("jacobian", "--of", "2", "--frame", "1")
    assert "det J = D2*C1" in of_links("determinant", "--rows", "2,6")
    assert "A(1,2) = ZZ2 - 0.5*MY2" in of_links(
        "inertia_matrix", "--value", "q2=pi/2", "--value", "D2=0.5"
    )
    listed = of_links("inverse_dynamics", "--form", "recursive")
    assert "  W32 = QP1 + QP2" in listed and "28 standard parameters" in listed
    assert of_links("pose", "--format", "latex").startswith("\\documentclass")
    assert of_links("pose", "--format", "latex-fragment").startswith("\\begin{align*}")
    assert "A = sympy.Matrix([" in of_links("inertia_matrix", "--format", "sympy")
    assert (
        json.loads(of_links("friction", "--json"))["entries"]["F(1)"] == "QP1*FV1 + sign(QP1)*FS1"
    )
    assert (
        "kept as a symbol"
        in run(
            "sr400", "--model", "gravity", "--passive", "symbols", "--parameters", "standard"
        ).stdout
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("tx40", "--model", "jacobian", "--of", "9"), "tx40 has frames 0 to 6"),
        (("planar_2r", "--model", "mass_matrix"), "expected one of regressor"),
        (("four_bar", "--model", "coriolis"), "use the model bias"),
        (("panda", "--model", "bias", "--parameters", "standard"), "form recursive"),
        (("planar_2r", "--model", "gravity", "--value", "q2"), "--value q3=pi/2"),
        (("planar_2r", "--model", "gravity", "--value", "q9=1"), "is no symbol"),
        (("planar_2r", "--model", "determinant", "--rows", "a"), "--rows 1,2"),
        (
            ("planar_2r", "--model", "gravity", "--form", "open"),
            "expected one of closed, recursive",
        ),
        (("planar_2r", "--model", "gravity", "--only", "MX1R"), "--form recursive"),
        (("planar_2r", "--model", "gravity", "--html"), "--html shows everything"),
        (("tx40", "--frame", "2"), "need --model"),
        (("tx40", "--format", "sympy"), "need --model"),
        (("tx40", "--format", "latex-fragment"), "need --model"),
    ],
)
def test_bad_input(arguments, told):
    result = run(*arguments)
    assert (
        result.exit_code == 2
        and told in result.stderr
        and result.stderr.count("\n") == 1
        and not result.stdout
    )
