"""Robots read from MJCF: torques and frames equal those that MuJoCo computes from the whole text,
drawings, geoms and meshes aside.
"""

import re

import mujoco
import numpy as np
import pytest

from oracles.mjcf_robots import ARM, GRIPPER, NAMED, random_tree
from oracles.poses import poses_in_floats
from symgen.certify.lagrange import Lagrange
from symgen.description import Robot
from symgen.description.robot import PRISMATIC
from symgen.description.tree_robot import read_tree

from oracles.test_urdf_agrees import kept_frames, legend, loaded  # isort: skip

TOLERANCE = 1e-9  # of the largest torque of the sample


class MuJoCo:
    """Inverse dynamics and poses of an MJCF text without contacts, limits and relations; meshes,
    which no test has, left out.
    """

    def __init__(self, text: str) -> None:
        text = re.sub(r"<asset>.*?</asset>|<geom type=\"mesh\"[^>]*>", "", text)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = mujoco.MjData(self.model)

    def state(self, names, q, qd, qdd):
        places = [
            (joint.qposadr[0], joint.dofadr[0])
            for joint in (self.model.joint(name) for name in names)
        ]
        for (i, j), *x in zip(places, q, qd, qdd, strict=True):
            self.data.qpos[i], self.data.qvel[j], self.data.qacc[j] = x
        return [j for _, j in places]

    def torque(self, names, q, qd, qdd):
        order = self.state(names, q, qd, qdd)
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse[order].copy()

    def pose(self, names, q, frame):
        self.state(names, q, q * 0, q * 0)
        mujoco.mj_kinematics(self.model, self.data)
        try:
            there = self.data.body(frame)
        except KeyError:
            there = self.data.site(frame)
        return np.column_stack([there.xmat.reshape(3, 3), there.xpos])


def motion(robot: Robot, seed: int):
    """q, qd, qdd of all joints, (5, n), with the rows that follow, and d(moving)/d(actuated)."""
    rng, n = np.random.default_rng(seed), len(robot.moving)
    reach = np.array([0.5 if robot.frame(j).sigma == PRISMATIC else np.pi for j in robot.moving])
    active = [robot.moving.index(j) for j in robot.joints]
    follow, offset = np.eye(n)[:, active], np.zeros(n)
    for j, e in robot.constraints.items():
        follow[robot.moving.index(j)] = [e.coefficient(f"q{i}").value({}) for i in robot.joints]
        offset[robot.moving.index(j)] = e.value({f"q{i}": 0.0 for i in robot.joints})
    q = (rng.uniform(-1, 1, (5, n)) * reach)[:, active] @ follow.T + offset
    qd, qdd = (rng.standard_normal((5, len(active))) @ follow.T for _ in range(2))
    return (q, qd, qdd), follow, active


def difference(text: str, robot: Robot, notes: tuple[str, ...], seed: int) -> float:
    """Largest difference of torque over the largest torque; dry friction, a constraint in MuJoCo,
    aside.
    """
    states, follow, active = motion(robot, seed)
    names, oracle = legend(notes), MuJoCo(text)
    theirs = (
        np.array(
            [oracle.torque([names[j] for j in robot.moving], *s) for s in zip(*states, strict=True)]
        )
        @ follow
    )
    chi = np.array(
        [0.0 if name.startswith("FS") else robot.values[name] for name in robot.parameters]
    )
    if robot.constraints:
        module = loaded(robot)
        ours = module.inverse_dynamics(*(x[:, active] for x in states), module.base_parameters(chi))
    else:
        ours = Lagrange(robot).torque(*states, chi)
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def pose_difference(text: str, robot: Robot, notes: tuple[str, ...]) -> float:
    names, oracle, largest = legend(notes), MuJoCo(text), 0.0
    for q in motion(robot, 5)[0][0]:
        poses = poses_in_floats(robot, dict(zip(robot.moving, q, strict=True)))
        for j, frame in kept_frames(notes).items():
            ours = poses[j]
            largest = max(
                largest,
                float(np.abs(ours - oracle.pose([names[j] for j in robot.moving], q, frame)).max()),
            )
    return largest


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("keep_fixed", [False, True])
def test_torques(name, keep_fixed):
    robot, notes = read_tree(NAMED[name].encode(), f"{name}.xml", keep_fixed=keep_fixed)
    assert difference(NAMED[name], robot, notes, 1) < TOLERANCE
    assert pose_difference(NAMED[name], robot, notes) < 1e-11
    assert (len(kept_frames(notes)) > 0) == (keep_fixed and name == "arm")


def test_random_trees():
    several = 0
    for seed in range(25):
        text = random_tree(seed)
        robot, notes = read_tree(text.encode(), "tree.xml", keep_fixed=bool(seed % 2))
        several += "_1" in notes[0]
        assert difference(text, robot, notes, seed) < TOLERANCE, seed
        assert pose_difference(text, robot, notes) < 1e-11, seed
    assert several > 5


def test_values_and_limits_of_an_arm():
    robot, notes = read_tree(ARM.encode(), "arm.xml")
    assert (
        robot.name == "bent_arm"
        and [f.sigma for f in robot.frames] == [0, 0, 0, 1]
        and robot.massless == {2}
    )
    assert (
        robot.values["FS1"] == 0.3
        and robot.values["Ia1"] == 0.02
        and robot.values["Ia3"] == 0.001
        and robot.values["K2"] == 3
    )
    assert (
        robot.values["OFFSET2"] == pytest.approx(-3 * np.deg2rad(10))
        and dict(robot.constants)["gx"] == 0.5
    )
    assert "not read: <asset>, <sensor>, <visual>" in notes


def test_relations_of_joints_and_tendons():
    """q4 = 0.01 + 0.002 + 1.5 q3;  2 q1 - 0.5 (q2 - 0.2) = 0.1, solved for the joint that no motor
    drives: MuJoCo finds them met.
    """
    robot, _ = read_tree(GRIPPER.encode(), "gripper.xml")
    assert robot.joints == (1, 3) and {j: str(e) for j, e in robot.constraints.items()} == {
        2: "4*q1",
        4: "3*q3/2 + 0.012",
    }
    states, _, _ = motion(robot, 3)
    model = mujoco.MjModel.from_xml_string(GRIPPER)
    data = mujoco.MjData(model)
    for q in states[0]:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        assert data.ne == 2 and np.abs(data.efc_pos[:2]).max() < 1e-12
