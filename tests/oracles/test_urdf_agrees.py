"""Torques of robots read from URDF equal pinocchio's from the same text; URDF to Khalil to URDF
likewise.
"""

import re
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest

from oracles.poses import poses_in_floats
from oracles.urdf_robots import NAMED, random_tree
from symgen.certify.lagrange import Lagrange
from symgen.description import Robot
from symgen.description.robot import FIXED, PRISMATIC
from symgen.description.tree_robot import read_tree
from symgen.description.urdf import write_urdf
from symgen.emit.generate import generate_module

TOLERANCE = 1e-10  # of the largest torque of the sample


def legend(notes: tuple[str, ...]) -> dict[int, str]:
    """Joint names of the URDF by number."""
    return {int(j): name for j, name in re.findall(r"q(\d+) = '([^']*)'", notes[0])}


def kept_frames(notes: tuple[str, ...]) -> dict[int, str]:
    """Names of the links that are kept frames, by number."""
    return {
        int(j): name
        for note in notes
        if note.startswith("fixed frames")
        for j, name in re.findall(r"frame (\d+) = '([^']*)'", note)
    }


def loaded(robot: Robot) -> ModuleType:
    module = ModuleType(robot.name)
    exec(compile(generate_module(robot), robot.name, "exec"), module.__dict__)  # noqa: S102 (our own output)
    return module


class Pinocchio:
    """RNEA of a URDF text; joints by name, mimic joints as free ones."""

    def __init__(self, text: str) -> None:
        self.model = pin.buildModelFromXML(text)
        self.data = self.model.createData()

    def poses(self, names: list[str], q: np.ndarray, links: list[str]) -> np.ndarray:
        """(4, 4) of each link in the root link's frame."""
        pin.framesForwardKinematics(self.model, self.data, self.configuration(names, q))
        return np.array(
            [
                self.data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)].homogeneous
                for link in links
            ]
        )

    def configuration(self, names: list[str], q: np.ndarray) -> np.ndarray:
        x = np.array(pin.neutral(self.model))
        for k, name in enumerate(names):
            joint = self.model.joints[self.model.getJointId(name)]
            x[joint.idx_q : joint.idx_q + joint.nq] = (
                [q[k]] if joint.nq == 1 else [np.cos(q[k]), np.sin(q[k])]
            )
        return x

    def torque(
        self, names: list[str], q: np.ndarray, qd: np.ndarray, qdd: np.ndarray
    ) -> np.ndarray:
        model = self.model
        x, v, a = self.configuration(names, q), np.zeros(model.nv), np.zeros(model.nv)
        for k, name in enumerate(names):
            joint = model.joints[model.getJointId(name)]
            v[joint.idx_v], a[joint.idx_v] = qd[k], qdd[k]
        tau = pin.rnea(model, self.data, x, v, a)
        return np.array([tau[model.joints[model.getJointId(name)].idx_v] for name in names])


def difference(text: str, robot: Robot, names: dict[int, str], seed: int) -> float:
    """Largest difference of torque over the largest torque, links alone: friction is none of
    pinocchio's.
    """
    rng = np.random.default_rng(seed)
    n, samples = len(robot.moving), 5
    reach = [1.0 if robot.frame(j).sigma == PRISMATIC else np.pi for j in robot.moving]
    q, qd, qdd = rng.uniform(-1, 1, (samples, n)) * reach, *rng.standard_normal((2, samples, n))
    follow = np.eye(n)
    for j, e in robot.constraints.items():  # q_j = c q_i + q0
        k = robot.moving.index(j)
        follow[k] = [e.coefficient(f"q{i}").value({}) for i in robot.moving]
        q[:, k] = e.value({f"q{i}": 0.0 for i in robot.moving})
        q[:, k] += q @ (follow[k] * (np.arange(n) != k))
        qd[:, k], qdd[:, k] = qd @ follow[k], qdd @ follow[k]
    oracle = Pinocchio(text)
    theirs = np.array(
        [oracle.torque([names[j] for j in robot.moving], *s) for s in zip(q, qd, qdd, strict=True)]
    )
    active = [robot.moving.index(j) for j in robot.joints]
    chi = [
        value if name[:2] not in ("FV", "FS") else 0.0
        for name in robot.parameters
        for value in (robot.values[name],)
    ]
    if robot.constraints:  # torques of the tree do no work beyond those of the joints that lead
        theirs = theirs @ follow[:, active]
        model = loaded(robot)
        X = model.base_parameters(dict(zip(robot.parameters, chi, strict=True)))
        ours = model.inverse_dynamics(*(x[:, active] for x in (q, qd, qdd)), X)
    else:
        ours = Lagrange(robot).torque(q, qd, qdd, np.array(chi))
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


@pytest.mark.parametrize("make", NAMED, ids=lambda make: make.__name__)
def test_torques_of_published_robots(make) -> None:
    text = make()
    robot, notes = read_tree(text.encode(), f"{make.__name__}.urdf", exact=True)
    assert difference(text, robot, legend(notes), 1) < TOLERANCE
    again, said = write_urdf(robot)
    assert any("formulas" in note for note in said)
    names = {j: f"q{j}" for j in robot.moving}
    assert difference(again, robot, names, 2) < TOLERANCE
    back, notes = read_tree(again.encode(), "again.urdf", exact=True)
    assert difference(again, back, legend(notes), 3) < TOLERANCE and len(back.frames) == len(
        robot.frames
    )


def test_random_trees() -> None:
    aside = 0
    for seed in range(20):
        text = random_tree(seed)
        robot, notes = read_tree(text.encode(), "tree.urdf", exact=True)
        aside += any(f.sigma == FIXED for f in robot.frames)
        assert difference(text, robot, legend(notes), seed) < TOLERANCE, seed
        again, _ = write_urdf(robot)
        back, notes = read_tree(again.encode(), "again.urdf", exact=True)
        assert difference(again, back, legend(notes), seed) < TOLERANCE, seed
        assert difference(again, robot, {j: f"q{j}" for j in robot.moving}, seed) < TOLERANCE, seed
    assert aside > 3  # nearly parallel axes took part


def pose_difference(text: str, robot: Robot, notes: tuple[str, ...], seed: int) -> float:
    """Largest difference (m, or of an entry of a rotation) of the poses of the kept frames; joints
    that follow others included.
    """
    names, kept = legend(notes), kept_frames(notes)
    oracle = Pinocchio(text)
    largest = 0.0
    for q in np.random.default_rng(seed).uniform(-1, 1, (3, len(robot.joints))) if kept else ():
        position = {f"q{j}": x for j, x in zip(robot.joints, q, strict=True)}
        position |= {f"q{j}": e.value(position) for j, e in robot.constraints.items()}
        theirs = oracle.poses(
            [names[j] for j in robot.moving],
            np.array([position[f"q{j}"] for j in robot.moving]),
            list(kept.values()),
        )
        poses = poses_in_floats(robot, {j: position[f"q{j}"] for j in robot.moving})
        ours = [poses[j] for j in kept]
        largest = max(largest, float(np.abs(np.array(ours) - theirs[:, :3]).max()))
    return largest


@pytest.mark.parametrize("make", NAMED, ids=lambda make: make.__name__)
def test_kept_frames_of_published_robots(make) -> None:
    """tool0, hand, base mounts ...: poses equal pinocchio's, torques do not care, and the frames
    that move are the same.
    """
    text = make()
    merged, _ = read_tree(text.encode(), "arm.urdf")
    robot, notes = read_tree(text.encode(), "arm.urdf", keep_fixed=True)
    assert (
        robot.frames[: len(merged.frames)] == merged.frames
        and robot.parameters == merged.parameters
        and robot.values == merged.values
    )
    assert (
        len(kept_frames(notes))
        == text.count('type="fixed"')
        == len(robot.frames) - len(merged.frames)
    )
    assert pose_difference(text, robot, notes, 4) < 1e-12
    assert difference(text, robot, legend(notes), 1) < TOLERANCE
    again, _ = write_urdf(robot)
    assert difference(again, robot, {j: f"q{j}" for j in robot.moving}, 2) < TOLERANCE


def test_kept_frames_of_random_trees() -> None:
    kept = 0
    for seed in range(40):
        text = random_tree(seed)
        if 'type="fixed"' in text:
            robot, notes = read_tree(text.encode(), "tree.urdf", exact=True, keep_fixed=True)
            kept += len(kept_frames(notes))
            assert pose_difference(text, robot, notes, seed) < 1e-12, seed
            assert difference(text, robot, legend(notes), seed) < TOLERANCE, seed
    assert kept > 20
