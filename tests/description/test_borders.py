"""Values and names at the borders: one sentence that says what, where and what to do, no traceback;
names that YAML reads as something else come back.
"""

from dataclasses import replace

import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli.main import app
from symgen.description import load_robot, parse_robot, write_yaml
from symgen.errors import DescriptionError

ARM = """\
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {K: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: K, theta: q2, r: 0}
elements:
  FV: {kind: viscous, along: all}
"""


@pytest.mark.parametrize(
    ("K", "change", "place", "line"),
    [
        ("0", ("d: K", "d: 1/K"), "frames.2.d: 1/K", 7),
        ("-2", ("d: K", "d: sqrt(K)"), "frames.2.d: sqrt(K)", 7),
        ("0.3", ("d: K", "d: sqrt(K - 1)"), "frames.2.d: sqrt(K - 1)", 7),
        ("1", ("d: K", "d: 1/(K - 1)"), "frames.2.d: 1/(K - 1)", 7),
        ("0", ("-g", "-g/K"), "gravity.1: -g/K", 3),
        ("0", ("along: all", "along: {1: q1/K}"), "elements.FV.along.1: 1/K", 9),
    ],
)
def test_a_geometry_without_value_is_refused_at_its_line(K, change, place, line):
    text = ARM.replace("K: 0.5", f"K: {K}").replace(*change)
    with pytest.raises(DescriptionError) as caught:
        parse_robot(text.encode(), "arm.yaml")
    assert str(caught.value).startswith(f"{place} has no finite real value at ")
    assert f"K = {K}" in str(caught.value) and caught.value.line == line
    assert "change the constant or the expression" in str(caught.value)


def test_a_constraint_without_value_is_refused():
    robot = load_robot("haptic")
    j = next(iter(robot.constraints))
    with pytest.raises(DescriptionError, match=f"constraints.q{j}: .* at .* = 0"):
        constants = dict.fromkeys(robot.constants, 0.0)
        relations = {**robot.constraints, j: robot.constraints[j] + _inverse(robot)}
        replace(robot, constants=constants, constraints=relations)


def _inverse(robot):
    from symgen.description.grammar import parse

    return parse(f"1/{next(iter(robot.constants))}")


def test_massless_links_alone_are_refused():
    text = ARM.replace("elements:\n  FV: {kind: viscous, along: all}", "massless: [1, 2]")
    with pytest.raises(DescriptionError, match="no parameters: every link is massless"):
        parse_robot(text.encode(), "arm.yaml")
    assert symgen.regrouping(parse_robot(f"{ARM}massless: [1, 2]".encode(), "arm.yaml")).base


def test_a_value_that_divides_by_zero_is_one_sentence(tmp_path):
    file = tmp_path / "arm.yaml"
    file.write_text(ARM.replace("d: K", "d: 1/K"))
    for model in ("gravity", "base_parameters", "inertia_matrix", "pose"):
        result = CliRunner().invoke(app, ["show", str(file), "--model", model, "--value", "K=0"])
        assert result.exit_code == 2 and "no finite real value at K = 0" in result.stderr
        assert len(result.stderr.splitlines()) == 1
    file.write_text(ARM.replace("d: K", "d: sqrt(K)"))
    result = CliRunner().invoke(app, ["show", str(file), "--model", "gravity", "--value", "K=-2"])
    assert result.exit_code == 2 and "sqrt(K) has no finite real value at K = -2" in result.stderr


@pytest.mark.parametrize(
    "word", ["null", "true", "false", "yes", "no", "on", "off", "Null", "TRUE"]
)
def test_names_that_are_words_of_yaml_come_back(word):
    text = ARM.replace("K", f'"{word}"').replace("FV:", f'"{word}F":').replace("arm", f'"{word}"')
    robot = parse_robot(text.encode(), "arm.yaml")
    assert parse_robot(write_yaml(robot).encode(), "arm.yaml").frames == robot.frames
    other = replace(robot, elements=(replace(robot.elements[0], family=word),))
    again = parse_robot(write_yaml(other).encode(), "arm.yaml")
    assert (again.name, again.constants, again.elements) == (word, robot.constants, other.elements)


@pytest.mark.parametrize("label", ["null", "true", "~", "1e3", "0x10", "- a", "# b", "a: b", " c "])
def test_labels_and_titles_of_any_text_come_back(label):
    robot = replace(parse_robot(ARM.encode(), "arm.yaml"), labels={1: label}, title=label)
    again = parse_robot(write_yaml(robot).encode(), "arm.yaml")
    assert dict(again.labels) == {1: label} and again.title == label


COLUMN = 'columns: {{CAB: {{along: 2, torque: "{}", unit: {}}}}}\n'


@pytest.mark.parametrize("unit", ['"N m"', '"N*m\\n"', "\"N*m' + '\"", '"N*m\\"\\"\\""', '"N\\tm"'])
def test_a_unit_is_one_word(unit):
    with pytest.raises(DescriptionError, match=r"unit .*expected up to 40 letters.*line 10"):
        parse_robot((ARM + COLUMN.format("sin(q)", unit)).encode(), "arm.yaml")


def test_units_of_columns_stay_with_their_parameters():
    text = ARM + COLUMN.format("sin(q)", "N*m/rad^2")
    assert symgen.model(parse_robot(text.encode(), "arm.yaml")).UNITS["CAB2"] == "N*m/rad^2"


@pytest.mark.parametrize(
    ("law", "place"),
    [
        ("sqrt(q)", "sqrt(q) is not finite at q = -0.4"),
        ("q**q", "is not finite at q = -0.4"),
        ("exp(1000*q)", "column CAB2 is not finite at q1 = "),
        ("sqrt(1 - q)", "column CAB2 is not finite at q1 = "),
        ("exp(exp(exp(q)))", "column CAB2 is not finite at q1 = "),
        ("sqrt(4 - qd)", "column CAB2 is not finite at q1 = "),
    ],
)
def test_a_law_that_is_no_number_somewhere_is_named_with_the_place(law, place):
    with pytest.raises(DescriptionError) as caught:
        symgen.model(parse_robot((ARM + COLUMN.format(law, "N*m")).encode(), "arm.yaml"))
    assert place in str(caught.value) and "\n" not in str(caught.value)
