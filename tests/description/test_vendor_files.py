"""Files of vendors as they are: inertias that no body can have, templates, names of SYMORO's users."""

from __future__ import annotations

import numpy as np
import pytest

from symgen.description import load_robot
from symgen.description.bodies import no_body
from symgen.description.par import read_par
from symgen.errors import DescriptionError

URDF = """<robot name="m"><link name="base"/>
<link name="a"><inertial><mass value="{M}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("moments", "wrong"),
    [
        ({"xx": 0.02, "yy": 0.006, "zz": 0.006}, "ixx 0.02 > iyy + izz 0.012"),
        ({"xx": 0.006, "yy": 0.006, "zz": 0.02}, "izz 0.02 > ixx + iyy 0.012"),
        ({"xx": 0.02, "yy": 0.02, "zz": 0.01, "xy": 0.019}, "principal moments"),
        ({"M": 0, "xx": 1e-3, "yy": 1e-3, "zz": 1e-3}, "mass 0 with an inertia"),
        ({"xx": -0.01, "yy": 0.02, "zz": 0.02}, "ixx -0.01 below zero"),
    ],
)
def test_an_inertia_that_no_body_can_have_is_found(tmp_path, moments, wrong) -> None:
    (tmp_path / "m.urdf").write_text(URDF.format(**({"M": 1, "xy": 0} | moments)))
    ((frame, sentence),) = load_robot(tmp_path / "m.urdf").impossible
    assert frame == 1 and sentence.startswith("link 'a' (line 3): ") and wrong in sentence


def test_inertias_of_bodies_are_left_alone() -> None:
    """Points on a rod, a plate, a ball: on and within the bounds of the triangle inequality."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        x = rng.standard_normal((rng.integers(2, 9), 3)) * rng.uniform(0, 1, 3)
        x -= x.mean(axis=0)
        tensor = np.sum([(p @ p) * np.eye(3) - np.outer(p, p) for p in x], axis=0)
        assert no_body(1.0, tensor) == ""
    assert no_body(0.0, np.zeros((3, 3))) == ""
    rounding = 1.35525e-20 * np.ones((3, 3))
    assert no_body(0.2675, rounding) == no_body(0.0, rounding) == ""


@pytest.mark.parametrize(
    ("name", "told"), [("m.urdf.xacro", "expand it first"), ("m.sdf", "SDF is not read")]
)
def test_files_that_are_not_read_say_what_to_do(tmp_path, name, told) -> None:
    (tmp_path / name).write_text("<robot/>")
    with pytest.raises(DescriptionError, match=told):
        load_robot(tmp_path / name)


@pytest.mark.parametrize("form", ["theta({})", "t({})", "th({})", "t{}"])
def test_joint_variables_of_a_par_file(form) -> None:
    theta = ",".join(form.format(j) for j in (1, 2))
    text = f"""(* Robotname = 'arm' *)
NL = 2
NJ = 2
NF = 2
Type = 0
(* Geometric parameters *)
ant = {{0,1}}
sigma = {{0,0}}
b = {{0,0}}
d = {{0,D2}}
r = {{0,0}}
gamma = {{0,0}}
alpha = {{0,0}}
mu = {{1,1}}
theta = {{{theta}}}
(* constants: D2 = 0.5 *)
gravity = {{0,0,0}}
"""
    robot, _ = read_par(text.encode(), "arm.par", {})
    assert [str(f.theta) for f in robot.frames] == ["q1", "q2"]
