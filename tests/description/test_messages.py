"""What a message names: the file, the line, the key, the joints as the file calls them, and the list
of what is reserved.
"""

from dataclasses import replace

import pytest
from campaign import some
from typer.testing import CliRunner

import symgen
from symgen.cli.main import app
from symgen.description.expression import Expression
from symgen.description.naming import LAYOUT
from symgen.description.tree_robot import read_tree
from symgen.errors import DescriptionError

TEXT = """\
symgen: 1
name: al
gravity: [0, 0, -g]
constants: {NAME: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: NAME, theta: q2, r: 0}
elements:
  FV: {kind: viscous, along: ALONG}
"""
MIMIC = """\
<robot name="hand">
<link name="palm"/>
<joint name="finger" type="revolute"><parent link="palm"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link>
<joint name="thumb" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
<mimic joint="finger" multiplier="RATIO"/></joint>
<link name="b"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>
"""


@pytest.mark.parametrize("name", ["A", "B", "D", "N", "C2", "S2", "W", "V", "U312", "E", "H", "DV"])
@some(4)
def test_letters_of_the_models_are_constants_like_others(tmp_path, name):
    file = tmp_path / "al.yaml"
    file.write_text(TEXT.replace("NAME", name).replace("ALONG", "all"))
    assert CliRunner().invoke(app, ["check", str(file)]).exit_code == 0
    command = ["show", str(file), "--model", "inverse_dynamics"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0 and f"{name}*" in result.stdout, result.output
    recursive = [*command, "--form", "recursive", "--format", "latex"]
    assert CliRunner().invoke(app, recursive).exit_code == 0


@pytest.mark.parametrize("name", sorted(LAYOUT))
def test_a_reserved_name_is_refused_with_the_list(name):
    text = TEXT.replace("NAME", name).replace("ALONG", "all")
    with pytest.raises(DescriptionError) as caught:
        symgen.parse_robot(text.encode(), "al.yaml")
    message = str(caught.value)
    assert message.endswith("(al.yaml, line 4)") and message.count(".") < 4
    if "reserved are" in message:  # others are joint variables
        assert all(f" {word}," in message or f" {word})" in message for word in LAYOUT)


@pytest.mark.parametrize("key", [0, 3, 7, -1])
def test_a_key_of_along_is_a_frame(key):
    text = TEXT.replace("NAME", "L").replace("ALONG", f"{{{key}: q1 + q2}}")
    with pytest.raises(DescriptionError, match=f"FV: frame {key} does not exist") as caught:
        symgen.parse_robot(text.encode(), "al.yaml")
    assert (caught.value.file, caught.value.line) == ("al.yaml", 9)


def test_joints_that_cannot_follow_have_the_names_of_the_file():
    robot, _ = read_tree(MIMIC.replace("RATIO", "1").encode(), "hand.urdf")
    robot = replace(robot, constraints={2: Expression.symbol("g") * Expression.symbol("q1")})
    with pytest.raises(
        DescriptionError, match=r"ratio of 'thumb' \(q2\) to 'finger' \(q1\) is g;"
    ) as e:
        symgen.regrouping(robot)
    assert e.value.file == "hand.urdf" and e.value.path == ("constraints", "q2")


def test_a_fraction_in_all_its_decimals_is_that_fraction():
    robot, _ = read_tree(MIMIC.replace("RATIO", repr(-2 / 3)).encode(), "hand.urdf")
    assert str(robot.constraints[2]).startswith("-2*q1/3")


@pytest.mark.parametrize("ratio", ["0", "0.333"])
def test_a_joint_follows_by_any_number(ratio: str):
    """By zero times it stands still."""
    robot, _ = read_tree(MIMIC.replace("RATIO", ratio).encode(), "hand.urdf")
    certificate = symgen.certificate(symgen.regrouping(robot))
    assert certificate.valid, certificate
