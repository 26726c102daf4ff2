"""Angles near multiples of pi/12: told where they are changed, and kept by `exact`."""

import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import AngleWarning, load_robot
from symgen.description.tree_robot import read_tree
from symgen.emit.generate import generate_module

from oracles.test_mjcf_agrees import difference  # isort: skip

LINK = (
    '<link name="{0}"><inertial><mass value="1"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
    '<origin xyz="{3}" rpy="{4}"/><axis xyz="0 0 1"/>'
    '<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'
)


def arm(*angles):
    """Three links of 0.5 m, 0.4 m and 0.3 m, the frames of the joints turned by these rolls."""
    rows = [("shoulder", "base", "a", "0 0 0.5"), ("elbow", "a", "b", "0.4 0 0.1")]
    rows += [("wrist", "b", "c", "0 0.3 0")]
    joints = [JOINT.format(*row, f"{x} 0 0") for row, x in zip(rows, angles, strict=True)]
    flange = JOINT.format("flange", "c", "tool", "0.2 0 0.1", "0 0 0").replace("revolute", "fixed")
    links = ['<link name="base"/>', *map(LINK.format, "abc"), '<link name="tool"/>']
    return "\n".join(['<robot name="arm">', *links, *joints, flange, "</robot>"]).encode()


ROUNDED = arm(1.5708, -1.5707, 0.5236)


def test_load_robot_tells_how_many_and_the_farthest(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_bytes(ROUNDED)
    with pytest.warns(AngleWarning) as caught:
        robot = load_robot(file)
    (message,) = (str(warning.message) for warning in caught)
    assert "3 angles" in message and "\n" not in message
    assert "roll of joint 'elbow' (line 8) from -1.5707 to -pi/2, by -9.6e-05 rad" in message
    assert "exact=True or --exact" in message
    assert "rounded to multiples" in robot.angles and str(robot.frame(2).alpha) == "-pi/2"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exact = load_robot(file, exact=True)
    assert "are those of arm.urdf" in exact.angles and str(exact.frame(2).alpha) == "-1.5707"
    for one in (robot, exact):
        assert one.angles in " ".join(generate_module(one).split())


def test_angles_that_are_multiples_are_not_told():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot, _ = read_tree(arm(1.5707963267948966, 0.3, 0), "arm.urdf")
    assert robot.angles == ""


def test_angles_off_by_less_than_1e_9_are_taken_in_silence():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot, notes = read_tree(arm(1.57079632679, -1.5707963268, 0.523598775), "arm.urdf")
    assert robot.angles == "" and not any("snapped" in note for note in notes)
    assert str(robot.frame(2).alpha) == "-pi/2"
    with pytest.warns(AngleWarning, match="1 angle rounded"):
        read_tree(arm(1.57079632679, -1.570796, 0.523598775), "arm.urdf")


MJCF = b"""<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="a" pos="0 0 0.5" euler="-1.57079632679 0 0"><joint name="s"/>
<inertial pos="0.1 0 0.2" mass="2" diaginertia="0.1 0.2 0.15"/>
<body name="b" pos="0.4 0 0.1" quat="0.707105 0.707108 0 0"><joint name="e" pos="0 0.1 0"/>
<inertial pos="0 0.1 0.2" mass="1" fullinertia="0.1 0.2 0.15 0.01 0.02 0.03"/>
<body name="c" pos="0 0.3 0" quat="0.5 0.5 0.50001 0.49999">
<joint name="l" type="slide" axis="0 1 0" range="-3.2 3.2"/>
<inertial pos="0 0.1 0.2" mass="1" diaginertia="0.1 0.2 0.15"/>
<site name="tool" pos="0.2 0 0.1" xyaxes="0 1 0 -1 0.00001 0"/></body></body></body>
</worldbody></mujoco>"""


def test_rotations_of_an_mjcf_are_taken_alike(tmp_path):
    """However written; torques stay near MuJoCo's."""
    with pytest.warns(AngleWarning, match="3 angles rounded"):
        robot, notes = read_tree(MJCF, "arm.xml", keep_fixed=True)
    angles = [str(getattr(f, key)) for f in robot.frames for key in ("gamma", "alpha", "theta")]
    assert not any("." in angle for angle in angles) and "rounded to multiples" in robot.angles
    assert difference(MJCF.decode(), robot, notes, 1) < 1e-4
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exact, notes = read_tree(MJCF, "arm.xml", keep_fixed=True, exact=True)
    assert difference(MJCF.decode(), exact, notes, 1) < 1e-9 and "are those" in exact.angles


def test_verbs_note_it_and_keep_the_file_when_told_to(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_bytes(ROUNDED)
    for verb in (["check"], ["show"], ["generate", "-o", str(tmp_path)]):
        result = CliRunner().invoke(app, [verb[0], str(file), *verb[1:]])
        assert "note: arm.urdf: 3 angles rounded" in result.stderr, result.stderr
        result = CliRunner().invoke(app, [verb[0], str(file), *verb[1:], "--exact"])
        assert "multiples of pi" not in result.stderr
    assert "generate arm.urdf --exact" in (tmp_path / "arm.py").read_text()


def test_verbs_on_records_keep_the_file_too(tmp_path):
    file, record = tmp_path / "arm.urdf", tmp_path / "record.csv"
    file.write_bytes(ROUNDED)
    t, phase = np.arange(400) / 100, np.array([0.0, 1.0, 2.0])
    q, tau = np.sin(t[:, None] * (1 + phase) + phase), np.cos(t[:, None] * (2 + phase))
    names = ["t", *(f"{x}{j}" for x in ("q", "tau") for j in (1, 2, 3))]
    np.savetxt(record, np.c_[t, q, tau], delimiter=",", header=",".join(names), comments="")
    for options, noted in (([], True), (["--exact"], False)):
        result = CliRunner().invoke(
            app, ["identify", str(file), str(record), "--no-plausible", *options]
        )
        assert ("3 angles rounded" in result.stderr) == noted, result.stderr
