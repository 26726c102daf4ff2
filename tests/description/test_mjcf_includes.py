"""<include> of an MJCF: read from the folder of the file alone, each file once, as MuJoCo does; a
free base that is asked to rest.
"""

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import load_robot
from symgen.description.files import read_robot
from symgen.errors import DescriptionError

ARM = """\
<mujoco model="arm">
<include file="common/defaults.xml"/>
<worldbody>
<body name="a"><joint name="s" axis="0 1 0"/><inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/>
<include
  file='./common/hand.xml'></include>
</body>
</worldbody>
</mujoco>
"""
FILES = {
    "arm.xml": ARM,
    "common/defaults.xml": '<?xml version="1.0"?><mujocoinclude><!-- of all -->\n'
    '<default><joint damping="0.3"/></default>\n<option gravity="0 0 -3"/></mujocoinclude>',
    "common/hand.xml": '<mujoco>\n<body name="h" pos="0.3 0 0"><joint name="w" axis="0 0 1"/>'
    '<geom size="0.1" mass="1"/>\n<include file="common/finger.xml"/></body></mujoco>\n',
    "common/finger.xml": '<mujoco><body pos="0 0 0.1"><joint name="f" type="slide"/>'
    '<geom size="0.02" mass="0.1"/></body></mujoco>',
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path_factory, monkeypatch):
    """MuJoCo writes its warnings into the folder of the process."""
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))


def written(folder, **changed):
    for name, text in (FILES | changed).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder / "arm.xml"


def test_included_files_are_read_as_mujoco_does(tmp_path):
    file = written(tmp_path)
    robot, notes = read_robot(file)
    assert dict(robot.labels) == {1: "s", 2: "w", 3: "f"} and robot.constants["g"] == 3
    model = mujoco.MjModel.from_xml_path(str(file))
    assert [robot.values[f"FV{j}"] for j in (1, 2, 3)] == list(model.dof_damping) == [0.3] * 3
    assert sum(robot.values[f"M{j}"] for j in (1, 2, 3)) == pytest.approx(model.body_mass.sum())
    # the hash is that of all files: an edit of an included one is another robot
    (tmp_path / "common/finger.xml").write_text(FILES["common/finger.xml"].replace("0.1", "0.2"))
    assert load_robot(file).sha256 != robot.sha256
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0 and "certificate valid" in result.stdout, notes


def test_lines_are_those_of_the_file_that_is_wrong(tmp_path):
    wrong = FILES["common/hand.xml"].replace("</mujoco>", "</mujoc>")
    with pytest.raises(DescriptionError, match="mismatched tag") as caught:
        read_robot(written(tmp_path, **{"common/hand.xml": wrong}))
    assert (caught.value.file, caught.value.line) == ("./common/hand.xml", 3)
    ball = FILES["common/finger.xml"].replace("slide", "ball")
    with pytest.raises(DescriptionError, match="ball joint 'f'") as caught:
        read_robot(written(tmp_path, **{"common/finger.xml": ball}))
    assert (caught.value.file, caught.value.line) == ("arm.xml", 5)
    after = ARM.replace(
        "</worldbody>", '<body>\n<joint name="b" type="ball"/><geom size="1"/></body></worldbody>'
    )
    with pytest.raises(DescriptionError, match="ball joint 'b'") as caught:
        read_robot(written(tmp_path, **{"arm.xml": after}))
    assert (caught.value.file, caught.value.line) == ("arm.xml", 9)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("/etc/passwd", "outside the folder of the MJCF file"),
        ("../secret.xml", "outside the folder of the MJCF file"),
        ("common/../../secret.xml", "outside the folder of the MJCF file"),
        ("link.xml", "outside the folder of the MJCF file"),
        ("arm.xml", "never by itself"),
        ("./common/../arm.xml", "never by itself"),
        ("common/defaults.xml", "once"),
        ("nothing.xml", "no such file"),
        ("common", "no such file"),
        ("x" * 5000, "no such file"),
    ],
)
def test_what_is_refused(tmp_path, name, words):
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "secret.xml").write_text(FILES["common/hand.xml"])
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    file = written(folder, **{"arm.xml": ARM.replace("./common/hand.xml", name)})
    with pytest.raises(DescriptionError, match=words) as caught:
        read_robot(file)
    assert (caught.value.file, caught.value.line) == ("arm.xml", 5)
    assert "passwd" in name or "root:" not in str(caught.value)
    result = CliRunner().invoke(app, ["show", str(file)])
    assert result.exit_code == 2 and "Traceback" not in result.output


def test_a_cycle_of_files_ends(tmp_path):
    hand = FILES["common/hand.xml"].replace("common/finger.xml", "common/hand.xml")
    with pytest.raises(DescriptionError, match="never by itself") as caught:
        read_robot(written(tmp_path, **{"common/hand.xml": hand}))
    assert (caught.value.file, caught.value.line) == ("./common/hand.xml", 3)


def test_files_that_grow_each_other_are_refused(tmp_path):
    deep = {
        f"common/d{k}.xml": "<mujoco>" + "<frame>" * 100 + f'<include file="common/d{k + 1}.xml"/>'
        + "</frame>" * 100 + "</mujoco>"
        for k in range(20)
    } | {"common/d20.xml": "<mujoco/>"}  # fmt: skip
    file = written(tmp_path, **deep, **{"arm.xml": ARM.replace("hand", "d0")})
    with pytest.raises(DescriptionError, match="nested more than"):
        read_robot(file)


FREE = ARM.replace('<joint name="s" axis="0 1 0"/>', '<freejoint name="root"/>').replace(
    'name="a"', 'name="a" pos="0 0 1" quat="0.8 0.6 0 0"'
)


def test_a_free_base_rests_on_request(tmp_path):
    file = written(tmp_path, **{"arm.xml": FREE})
    free, notes = read_robot(file)
    assert free.base == "free" and any("--lock root=0 fixes it" in note for note in notes)
    with pytest.raises(DescriptionError, match="can only be locked at its pose in the file"):
        read_robot(file, lock={"root": 0.3})
    robot, notes = read_robot(file, lock={"root": 0.0})
    assert dict(robot.labels) == {1: "w", 2: "f"} and "held: root at 0" in notes
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    data.qpos[7:], data.qvel[6:], data.qacc[6:] = [0.4, 0.1], [0.5, -0.3], [1.0, 2.0]
    mujoco.mj_inverse(model, data)
    module = __import__("symgen").model(robot)
    X = module.base_parameters([robot.values[p] for p in robot.parameters])
    ours = module.inverse_dynamics(*(np.array(x) for x in ([0.4, 0.1], [0.5, -0.3], [1.0, 2.0])), X)
    assert np.allclose(ours, data.qfrc_inverse[6:], rtol=1e-9, atol=1e-9)


def test_the_total_mass_is_that_of_the_file(tmp_path):
    text = ARM.replace("<worldbody>", '<compiler settotalmass="10"/><worldbody>').replace(
        "</worldbody>",
        '<body name="stand"><geom size="0.3" mass="4"/></body></worldbody>',
    )
    file = written(tmp_path, **{"arm.xml": text})
    robot = load_robot(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    moving = model.body_mass.sum() - model.body("stand").mass[0]
    assert sum(robot.values[f"M{j}"] for j in (1, 2, 3)) == pytest.approx(moving)
    assert moving < 10 == pytest.approx(model.body_mass.sum())
    seen = text.replace('size="0.3" mass="4"', 'type="mesh" mesh="stand"')
    with pytest.raises(DescriptionError, match="would come from a mesh"):
        load_robot(written(tmp_path, **{"arm.xml": seen}))
