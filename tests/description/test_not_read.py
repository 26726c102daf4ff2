"""Parts of a file that change the torques and are not read: the robot carries them, and every
command names them after its answer.
"""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli.main import app
from symgen.description import load_robot
from symgen.description.angles import InertiaWarning, NotReadWarning
from symgen.pages.page import robot_page

BODY = '<inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.008"/></inertial>'
URDF = f"""<robot name="two"><link name="base"/>
<link name="a">{BODY}<visual><geometry/></visual><collision/></link><link name="b">{BODY}</link>
<joint name="ja" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="jb" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/><calibration rising="0"/></joint>
<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="jb"/><actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>
<gazebo><plugin name="control" filename="x.so"><joint>ja</joint></plugin></gazebo><gazebo reference="a"><gravity>true</gravity><mu1>0.2</mu1></gazebo>
EXTRA</robot>"""
LOOPS = (
    (
        '<constraint name="loop" type="revolute"><parent link="a"/><child link="b"/></constraint>',
        "<constraint> 'loop' (line 7)",
    ),
    (
        '<loop_joint name="l" type="revolute"><link1 link="a"/></loop_joint>',
        "<loop_joint> 'l' (line 7)",
    ),
    (
        '<gazebo><joint name="g" type="screw"><parent>a</parent><child>b</child></joint></gazebo>',
        "<joint> 'g' in <gazebo> (line 7)",
    ),
    (
        '<gazebo reference="b"><turnGravityOff>true</turnGravityOff></gazebo>',
        "<turnGravityOff> in <gazebo reference='b'> (line 7)",
    ),
    (
        '<gazebo reference="jb"><springStiffness>3</springStiffness></gazebo>',
        "<springStiffness> in <gazebo reference='jb'> (line 7)",
    ),
)
MJCF = """<mujoco model="two">OPTION<worldbody><body name="a" pos="0 0 .3" GRAVCOMP>
<joint name="ja" axis="0 1 0" damping=".5"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
<body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body>
</body></worldbody><actuator><motor joint="ja" gear="50"/></actuator></mujoco>"""
FORCES = (
    ("", 'gravcomp="1"', "gravcomp of 'a'"),
    (
        '<option density="1000" viscosity="0.1"/>',
        "",
        "forces of a fluid (density, viscosity)",
    ),
    ('<option><flag damper="disable"/></option>', "", "flag damper"),
)


@pytest.mark.parametrize(("extra", "told"), LOOPS)
def test_loops_and_switches_of_a_urdf_are_told(tmp_path, extra, told):
    file = tmp_path / "two.urdf"
    file.write_text(URDF.replace("EXTRA", extra))
    with pytest.warns(NotReadWarning, match="two.urdf: not read, hence not in the equations") as w:
        robot = load_robot(file)
    assert robot.not_read == (told,) and str(w[0].message).endswith(told)


def test_what_changes_no_torque_is_not_told(tmp_path):
    file = tmp_path / "two.urdf"
    file.write_text(URDF.replace("EXTRA", ""))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_robot(file).not_read == ()


@pytest.mark.parametrize(("option", "gravcomp", "told"), FORCES)
def test_forces_of_an_mjcf_are_told(tmp_path, option, gravcomp, told):
    text = MJCF.replace("OPTION", option).replace("GRAVCOMP", gravcomp)
    (tmp_path / "two.xml").write_text(text)
    with pytest.warns(NotReadWarning):
        robot = load_robot(tmp_path / "two.xml")
    assert robot.not_read == (told,)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = (0.4, -0.7), (1.0, -2.0)
    mujoco.mj_inverse(model, data)
    module = symgen.model(robot)
    X = module.base_parameters(robot.values)
    ours = module.inverse_dynamics(data.qpos, data.qvel, np.zeros(2), X)
    assert np.abs(ours - data.qfrc_inverse).max() > 0.01


@pytest.mark.parametrize("verb", ["show", "check", "generate", "convert", "page", "json"])
def test_every_command_tells_it_after_its_answer(tmp_path, verb):
    file, out = tmp_path / "two.urdf", tmp_path / "out"
    file.write_text(URDF.replace("EXTRA", LOOPS[0][0]))
    words = {
        "generate": ["generate", str(file), "-o", str(out)],
        "convert": ["convert", str(file), str(tmp_path / "two.yaml")],
        "page": ["show", str(file), "--html", "-o", str(tmp_path / "two.html")],
        "json": ["show", str(file), "--json"],
    }.get(verb, [verb, str(file)])
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    *answer, last = result.output.split("note: ")
    assert len(answer) == 1 and answer[0] and last.startswith("two.urdf: not read")
    assert "<constraint> 'loop' (line 7)" in " ".join(last.split())
    assert all(len(line) <= 80 for line in last.splitlines())
    if verb == "page":
        assert "&lt;constraint&gt; &#39;loop&#39; (line 7)" in (tmp_path / "two.html").read_text()
    if verb == "json":
        assert '"not_read": [' in result.stdout


def test_the_page_of_a_robot_read_whole_says_nothing(tmp_path):
    (tmp_path / "two.urdf").write_text(URDF.replace("EXTRA", ""))
    page = robot_page(symgen.regrouping(load_robot(tmp_path / "two.urdf")))
    assert "not in the equations" not in page


ROTOR = """<transmission type="pr2_mechanism_model/SimpleTransmission" name="r"><actuator name="m"/>
<joint name="JOINT"/><mechanicalReduction>-60.5</mechanicalReduction><motorInertia>2e-4</motorInertia></transmission>"""
IN_ACTUATOR = """<transmission name="r"><joint name="JOINT"/><actuator name="m">
<mechanicalReduction> -60.5 </mechanicalReduction><motorInertia value="2e-4"/></actuator></transmission>"""


@pytest.mark.parametrize("text", [ROTOR, IN_ACTUATOR])
def test_motor_inertia_of_a_transmission_is_read(tmp_path, text):
    """Ia = N^2 J, on the side of the joint."""
    (tmp_path / "two.urdf").write_text(URDF.replace("EXTRA", text.replace("JOINT", "ja")))
    robot = load_robot(tmp_path / "two.urdf")
    assert robot.values["Ia1"] == pytest.approx(60.5**2 * 2e-4) and robot.values["Ia2"] == 0
    assert robot.not_read == ()


def test_motor_inertia_of_several_joints_is_told(tmp_path):
    extra = ROTOR.replace("JOINT", "ja").replace("<mech", '<joint name="jb"/><mech')
    (tmp_path / "two.urdf").write_text(URDF.replace("EXTRA", extra))
    with pytest.warns(NotReadWarning, match="of several joints or motors"):
        assert load_robot(tmp_path / "two.urdf").values["Ia1"] == 0


YAML = """symgen: 1
name: imp
gravity: [0, 0, -g]
constants: {{g: 9.81, L: 0.3}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: L, theta: q2, r: 0}}
values: {{{}}}
"""
FULL = "XX2: .001, YY2: {}, ZZ2: .02, XY2: 0, XZ2: 0, YZ2: 0, MX2: 0.05, MY2: 0, MZ2: 0, M2: {}"
IMPOSSIBLE = (
    (FULL.format(".001", 1), "yy -0.0015 below zero"),
    (FULL.format(".0195", 0), "mass 0 with first moments"),
    (FULL.format(".0195", -1), "mass -1 below zero"),
    ("ZZ2: .02, MX2: 0.2, M2: 1", "zz -0.02 below zero"),
    ("ZZ2: -.02", "zz -0.02 below zero"),
    ("XX2: .02, YY2: .002, ZZ2: .002, XY2: 0, XZ2: 0, YZ2: 0, MX2: 0, MY2: 0, MZ2: 0, M2: 1",
     "xx 0.02 > yy + zz 0.004"),
)  # fmt: skip


@pytest.mark.parametrize(("values", "wrong"), IMPOSSIBLE)
def test_impossible_values_are_told_as_of_a_urdf(values, wrong):
    robot = symgen.parse_robot(YAML.format(values).encode(), "imp.yaml")
    with pytest.warns(InertiaWarning) as notes:
        symgen.regrouping(robot)
    (note,) = notes
    assert str(note.message).startswith("link 2 (imp.yaml): ") and wrong in str(note.message)
    assert "; this inertia enters ZZ1R, XX2R" in str(note.message)


@pytest.mark.parametrize(
    "values",
    [
        FULL.format(".0205", 1),
        "ZZ2: .02, MX2: 0.05, M2: 1",
        "M2: 1",
        "",
        "ZZ2: .04000000001, MX2: 0.2, M2: 1",
        "ZZ2: .0399999999, MX2: 0.2, M2: 1",  # a point mass, rounded
    ],
)
def test_possible_values_are_not_told(values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        symgen.regrouping(symgen.parse_robot(YAML.format(values).encode(), "imp.yaml"))
