"""`apply` with columns of the user's own: what has a place is written, what has none is named, and
a spring that the robot file states is not taken for mass.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from oracles.applying import exact, motion
from symgen.cli.main import app

VALUES = "  STR1: 0\n  STR2: 0\n  DMP1: 0\n  SPR2: 4.0\n"
URDF = """\
<robot name="arm"><link name="base"/>
<link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="5"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1.2"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
  <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" velocity="2" effort="60"/><dynamics damping="0.1"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/>
  <origin rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="60"/><dynamics damping="0.1"/></joint>
</robot>
"""
COLUMNS = """columns:
  STR: {kind: stribeck, along: all, fit: {vs: 0.1}}
  DMP: {along: 1, torque: qd, unit: N*m*s/rad}
  SPR: {along: 2, torque: sin(q), unit: N*m}
"""


MJCF = """\
<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j1" axis="0 0 1" damping="0.1" armature="0.02"/>
  <inertial pos="0 0 0.1" mass="5" diaginertia="1 1 1.2"/>
<body name="b" euler="1.5707963267948966 0 0"><joint name="j2" axis="0 0 1" damping="0.1"/>
  <inertial pos="0.2 0 0" mass="3" diaginertia="0.02 0.2 0.2"/></body></body>
</worldbody></mujoco>
"""


@pytest.fixture(params=["arm.urdf", "arm.xml"])
def arm(request, tmp_path: Path):
    """(file, robot file with columns, its module)"""
    path = tmp_path / request.param
    path.write_text(URDF if path.suffix == ".urdf" else MJCF)
    robot = tmp_path / "own.yaml"
    done = CliRunner().invoke(app, ["convert", str(path), str(robot)])
    assert done.exit_code == 0, done.output
    text = robot.read_text().replace("values:\n", COLUMNS + "values:\n" + VALUES, 1)
    robot.write_text(text)
    return path, robot, symgen.model(robot)


def test_each_value_goes_to_its_place_or_is_named(arm) -> None:
    """Damping takes in the column that is viscous friction too; a law with a Stribeck peak has no
    place; gravity of link b and the spring of 4 N m that the robot file states are one column, and
    the link stays as it is.
    """
    path, robot, model = arm
    true = dict(model.VALUES) | {
        "FV1": 1.5, "FV2": 1.1, "DMP1": 0.4, "FS1": 0.2, "STR1": 1.0, "STR2": 0.7,
    }  # fmt: skip
    estimate = exact(model, true)
    applied = symgen.apply(estimate, path, robot=robot)
    changes = {(row.place, row.number): row.after for row in applied.changes}
    friction = "friction" if path.suffix == ".urdf" else "frictionloss"
    assert changes == pytest.approx(
        {
            ("joint 'j1'", "damping"): 1.9,
            ("joint 'j1'", friction): 0.2,
            ("joint 'j2'", "damping"): 1.1,
        }
    )
    rotors = {"Ia1": 0.0, "Ia2": 0.0} if path.suffix == ".urdf" else {}
    assert applied.placeless == pytest.approx({"STR1": 1.0, "STR2": 0.7} | rotors)
    assert not applied.strange and "STR1 = 1.0000, sigma 0.0010" in str(applied)
    again = tmp_model(applied, path)
    states = motion(2, 5, 2.0)[1:]
    D = model.regressor(*states)
    without = [model.BASE_PARAMETERS.index(name) for name in ("STR1", "STR2")]
    X = np.where(np.isin(np.arange(len(estimate.X)), without), 0.0, estimate.X)
    rest = D @ X - np.stack([0 * states[0][:, 1], 4 * np.sin(states[0][:, 1])], axis=1)
    placed = again.inverse_dynamics(*states, again.base_parameters(again.VALUES))
    np.testing.assert_allclose(placed, rest, atol=1e-9)


def tmp_model(applied, path: Path):
    """The module of the written file."""
    return symgen.model(applied.write(path.with_stem("again")))
