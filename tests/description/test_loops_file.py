"""Faults of a file with loops beside a URDF: one sentence, with its file and line."""

from __future__ import annotations

import pytest

from symgen.description import load_robot
from symgen.description.files import read_robot
from symgen.errors import DescriptionError

BODY = '<inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.008"/></inertial>'
URDF = f"""<robot name="bars"><link name="base"/><link name="crank">{BODY}</link><link name="rod">{BODY}</link>
<link name="rocker">{BODY}</link>
<joint name="j1" type="continuous"><parent link="base"/><child link="crank"/><axis xyz="0 1 0"/></joint>
<joint name="j2" type="continuous"><parent link="crank"/><child link="rod"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/></joint>
<joint name="j3" type="continuous"><parent link="base"/><child link="rocker"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/></joint>
</robot>"""
LOOP = "{links: [rod, rocker], points: [[0.3, 0, 0], [0.2, 0, 0]]}"
FAULTS = (
    (f"loops: [{LOOP}]", "which of the joints 'j1', 'j2', 'j3' have motors; write `actuated: [j1]`"),
    (f"loops: [{LOOP}]\nactuated: [j9]", "there is no moving joint 'j9'; the joints are 'j1'"),
    (f"loops: [{LOOP}]\nactuated: j1", "expected a list of joint names"),
    (f"loops: [{LOOP}]\nmotors: [j1]", "unknown key 'motors'; the keys are loops, actuated"),
    (f"loops: [{LOOP}]\nstart: {{j1: x}}", "'x': expected a number"),
    (f"loops: [{LOOP}]\nstart: [1]", "expected joint positions"),
    (f"loops: {LOOP}", "expected a list of loops"),
    ("loops: [{links: [rod, [rocker]]}]", "there is no link ['rocker']"),
    ("loops: [{links: [rod]}]", "write links: [FIRST, SECOND]"),
    ("loops: [{links: [rod, base], points: [0, 0, 0]}]", "write points: [[x, y, z], [x, y, z]]"),
    ("loops: [{links: [rod, base], axis: [0, 0, 0]}]", "the axis has no direction"),
    ("loops: [{links: [rod, base], type: screw}]", "expected spherical, revolute, prismatic, fixed"),
    ("7", "expected a table with the keys loops, actuated and start"),
    (
        "loops: [{links: [rod, rocker], points: [[0.3, 0.1, 0], [0.2, 0, 0]]}]\nactuated: [j1]",
        "its two ends are 0.1 m apart along the hinges",
    ),
)  # fmt: skip


@pytest.mark.parametrize(("text", "told"), FAULTS)
def test_faults_are_told_in_one_sentence(text, told, tmp_path):
    (tmp_path / "bars.urdf").write_text(URDF)
    (tmp_path / "bars.loops.yaml").write_text(text)
    with pytest.raises(DescriptionError) as error:
        load_robot(tmp_path / "bars.urdf")
    assert told in str(error.value) and error.value.file.startswith("bars."), error.value


def test_a_file_of_an_exporter_for_other_links_is_left_alone(tmp_path):
    (tmp_path / "bars.urdf").write_text(URDF)
    row = "{link_a: other, link_b: more, point: [0, 0, 0], axis: [0, 1, 0]}"
    (tmp_path / "loop_closures.yaml").write_text(f"closures: [{row}]\nindependent: [j1]\n")
    assert load_robot(tmp_path / "bars.urdf").loops == ()


def test_the_hash_is_that_of_both_files(tmp_path):
    (tmp_path / "bars.urdf").write_text(URDF)
    seen = set()
    for start in ("", "start: {j1: 0.1}"):
        (tmp_path / "bars.loops.yaml").write_text(f"loops: [{LOOP}]\nactuated: [j1]\n{start}")
        robot, notes = read_robot(tmp_path / "bars.urdf")
        assert len(robot.loops) == 1 and "loops of bars.loops.yaml" in notes
        seen.add(robot.sha256)
    assert len(seen) == 2


def test_a_loop_on_a_free_base_is_refused_with_what_to_do(tmp_path):
    free = '<link name="world"/><joint name="root" type="floating"><parent link="world"/><child link="base"/></joint>'
    file = tmp_path / "bars.urdf"
    file.write_text(URDF.replace('<link name="base"/>', f'<link name="base">{BODY}</link>{free}'))
    (tmp_path / "bars.loops.yaml").write_text(f"loops: [{LOOP}]\nactuated: [j1]\n")
    with pytest.raises(DescriptionError, match=r"closes on the free base.*convert --lock"):
        load_robot(file)
    assert len(read_robot(file, lock={"root": 0.0})[0].loops) == 1
