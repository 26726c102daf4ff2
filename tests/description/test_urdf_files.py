"""URDF: faults are errors with their line, hostile files are refused before they cost anything,
mangled ones raise nothing else.
"""

import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles.urdf_robots import panda, ur5
from symgen.description import Robot, load_robot, parse
from symgen.description.tree import TreePart
from symgen.description.tree_robot import read_tree
from symgen.description.urdf import write_urdf
from symgen.description.xml_text import MAX_BYTES
from symgen.errors import DescriptionError

ARM = """\
<robot name="my arm">
<link name="base"/>
<link name="a"><inertial><mass value="2"/>\
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="package://../../../etc/passwd"/></geometry></visual></link>
<link name="b"/>
<joint name="s" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 2"/></joint>
<joint name="e" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0"/>\
<axis xyz="1 0 0"/></joint>
<gazebo/><transmission/>
</robot>
"""


def error_of(text):
    with pytest.raises(DescriptionError) as caught:
        read_tree(text if isinstance(text, bytes) else text.encode(), "arm.urdf")
    assert caught.value.file == "arm.urdf" and caught.value.line is not None
    return caught.value


def test_what_is_not_read_is_noted():
    robot, notes = read_tree(ARM.encode(), "arm.urdf")
    assert robot.name == "my_arm" and [f.sigma for f in robot.frames] == [0, 1]
    assert (
        notes[0] == "joints: q1 = 's', q2 = 'e'"
        and notes[1] == "not read: 1 <gazebo>, 1 <transmission>, 1 <visual>"
    )
    assert (
        any("values of link 2 are 0" in note for note in notes)
        and robot.values["ZZ1"] == 1
        and robot.values["M2"] == 0
    )


WRONG = [
    ("<robot", "<sdf", 9, "mismatched tag"),
    ('<link name="b"/>', '<link name="a"/>', 5, "given twice"),
    ('<link name="b"/>', '<link nome="b"/>', 5, "has no name"),
    ('<link name="b"/>', '<link name="b"/><link name="c"/>', 1, "links without parent"),
    ('type="prismatic"', 'type="floating"', 7, "free joint 'e' does not carry joint 's'"),
    ('type="revolute"', 'type="ball"', 6, "expected revolute, continuous, prismatic or fixed"),
    ('xyz="0 0 2"', 'xyz="0 0 0"', 6, "no direction"),
    ('xyz="0 0 2"', 'xyz="0 2"', 6, "expected 3 numbers"),
    ('xyz="0 0 2"', 'xyz="0 0 nan"', 6, "expected 3 numbers"),
    ('xyz="0 0 2"', 'xyz="0 0 1e999"', 6, "expected 3 numbers"),
    ('<mass value="2"/>', "", 3, "needs <mass>"),
    ('value="2"', 'value="-2"', 3, "0 or more"),
    ('<child link="b"/>', '<child link="z"/>', 7, "no link 'z'"),
    ('<child link="b"/>', '<child link="a"/>', 7, "has a parent already"),
    ('<parent link="base"/>', "", 6, "needs <parent"),
    ('<joint name="e"', '<joint name="s"', 7, "given twice"),
    ('<parent link="base"/>', '<parent link="b"/>', 1, "are not connected to 'base'"),
    ('<axis xyz="1 0 0"/>', '<mimic joint="e"/>', 7, "in a circle"),
    ('<axis xyz="1 0 0"/>', '<mimic joint="x"/>', 7, "no moving joint 'x'"),
    ("<gazebo/>", '<xacro:include filename="x"/>', 8, "xacro"),
    ("</robot>", "", 10, "no element found"),
]


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_free_base_rests_on_request(kind: str) -> None:
    """It moves; held where the file has it, it is the robot of the same file whose base is fixed."""
    free = ARM.replace(
        '<link name="base"/>',
        '<link name="base"/><link name="world"/><joint name="root" type="KIND"><parent link="world"/>'
        '<child link="base"/><origin xyz="0 0 1" rpy="0.3 0.2 0"/></joint>',
    )
    flying, notes = read_tree(free.replace("KIND", kind).encode(), "arm.urdf")
    assert flying.base == "free" and any("--lock root=0 fixes it" in note for note in notes)
    with pytest.raises(DescriptionError, match="can only be locked at its pose in the file"):
        read_tree(free.replace("KIND", kind).encode(), "arm.urdf", part=TreePart({"root": 0.3}))
    held, notes = read_tree(
        free.replace("KIND", kind).encode(), "arm.urdf", part=TreePart({"root": 0.0})
    )
    fixed, _ = read_tree(free.replace("KIND", "fixed").encode(), "arm.urdf")
    assert "held: root at 0" in notes
    assert (held.frames, held.gravity, held.values) == (fixed.frames, fixed.gravity, fixed.values)


@pytest.mark.parametrize(("old", "new", "line", "words"), WRONG)
def test_faults_are_errors_with_their_line(old, new, line, words):
    assert old in ARM
    error = error_of(ARM.replace(old, new, 1))
    assert words in error.message and error.line == line


def test_a_file_without_links_is_told():
    """What a failed xacro leaves; it was said to have joints in a circle."""
    assert "there is no <link>" in error_of('<robot name="empty"></robot>').message


def test_what_makers_leave_out():
    """Limits that mean none, an inertia not given, the axis of a fixed joint: as files of makers
    have them.
    """
    text = ARM.replace(
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>', '<origin xyz="0.5 0 0"/>'
    )
    text = text.replace(
        '<axis xyz="0 0 2"/>',
        '<axis xyz="0 0 2"/><limit lower="-1e16" upper="1e16" velocity="1" effort="1"/>',
    )
    text = text.replace('<link name="b"/>', '<link name="b"/><link name="c"/>')
    fixed = (
        '<joint name="f" type="fixed"><parent link="b"/><child link="c"/><axis xyz="0 0 '
        '0"/></joint></robot>'
    )
    robot, notes = read_tree(text.replace("</robot>", fixed).encode(), "arm.urdf")
    assert (
        robot.values["ZZ1"] == 2 * 0.5**2
        and "point masses: 'a'" in " ".join(notes)
        and "q" not in robot.limits
    )


BOMB = (
    '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "'
    + "&a;" * 50
    + '"><!ENTITY c "'
    + "&b;" * 50
    + '">]>'
)
HOSTILE = {
    "expanding entities": BOMB + ARM.replace("my arm", "&c;"),
    "external entity": '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    + ARM.replace("my arm", "&a;"),
    "external document type": '<!DOCTYPE x SYSTEM "http://localhost/x.dtd">' + ARM,
    "nesting": "<robot>" + "<a>" * 100_000,
    "many elements": "<robot>" + "<a/>" * 200_000 + "</robot>",
    "many joints": '<robot><link name="l0"/>'
    + "".join(
        (
            f'<link name="l{k}"/><joint name="j{k}" type="fixed"><parent link="l{k - 1}"/><child '
            f'link="l{k}"/></joint>'
        )
        for k in range(1, 300)
    )
    + "</robot>",
    "size": " " * (MAX_BYTES + 1),
    "encoding": b'<?xml version="1.0" encoding="no-such"?><robot/>',
    "empty": "",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused(kind):
    start = time.process_time()
    error_of(HOSTILE[kind])
    assert time.process_time() - start < 5  # the contract of issue 6: no hang above 5 s


def test_hostile_names_become_an_identifier():
    for name in ("1;import os", "class", "é'\\\"*/", "x" * 500, ""):
        text = ARM.replace("my arm", name.replace('"', "&quot;"))
        robot, notes = read_tree(text.encode(), "arm.urdf")
        assert re.fullmatch(r"[A-Za-z]\w{0,39}", robot.name, re.ASCII) and "\n" not in "".join(
            notes
        )


def test_mimic_becomes_a_relation():
    robot, _ = read_tree(panda().encode(), "panda.urdf")
    assert {j: str(e) for j, e in robot.constraints.items()} == {9: "q8"} and 9 not in robot.joints
    assert '<mimic joint="q8" multiplier="1.0" offset="0.0"/>' in write_urdf(robot)[0]


def test_serial_arms_have_no_gamma_nor_b():
    robot, _ = read_tree(ur5().encode(), "ur5.urdf")
    assert all(not f.gamma and not f.b for f in robot.frames[1:]) and robot.frames[1].alpha in (
        parse("pi/2"),
        parse("-pi/2"),
    )


def test_export_needs_masses():
    robot = load_robot("planar_2r")
    moments = dict.fromkeys(robot.parameters, 0.0) | {"MX1": 1.0}
    with pytest.raises(DescriptionError, match="M1 = 0"):
        write_urdf(robot, moments)


def test_equal_lengths_are_one_constant():
    robot: Robot = read_tree(panda().encode(), "panda.urdf")[0]
    assert str(robot.frame(4).d).lstrip("-") == str(robot.frame(5).d).lstrip("-") == "D4"


@pytest.mark.parametrize("kind", ["fixed", "continuous"])
def test_joints_that_move_are_counted(kind):
    """Frames of a skin and of sensors are fixed joints, of which a humanoid has hundreds."""
    frames = "".join(
        f'<link name="s{k}"/><joint name="f{k}" type="{kind}"><parent link="arm"/><child link="s{k}"/></joint>'
        for k in range(250)
    )
    body = '<link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    joint = '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/></joint>'
    text = f'<robot name="skin"><link name="base"/>{body}{joint}{frames}</robot>'
    if kind == "fixed":
        assert len(read_tree(text.encode(), "skin.urdf")[0].joints) == 1
    else:
        with pytest.raises(DescriptionError, match="251 joints that move; the limit is 200"):
            read_tree(text.encode(), "skin.urdf")


@pytest.mark.parametrize(
    ("xyz", "remedy"),
    [
        ("${length} 0 0", "expand it first (xacro FILE > robot.urdf)"),
        ("$(arg x) 0 0", "expand it first (xacro FILE > robot.urdf)"),
        ("0.07, 0, -0.69", "put blanks in place of commas"),
    ],
)
def test_numbers_of_another_notation_name_the_remedy(xyz, remedy):
    link = '<link name="base"/><link name="arm"/>'
    joint = f'<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="{xyz}"/></joint>'
    with pytest.raises(DescriptionError, match=re.escape(remedy)):
        read_tree(f'<robot name="r">{link}{joint}</robot>'.encode(), "r.urdf")


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_mangled_files_raise_nothing_else(data):
    text = ARM
    for _ in range(data.draw(st.integers(1, 4))):
        at, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 12))
        text = (
            text[:at]
            + data.draw(st.text(alphabet="<>/=\"' 0123456789.e-&;!x\n\x00é", max_size=8))
            + text[at + length :]
        )
    try:
        read_tree(text.encode("utf-8", "surrogatepass"), "arm.urdf")
    except DescriptionError as error:
        assert re.search(r"\(arm\.urdf, line \d+\)$", str(error))
