"""URDF files as their makers publish them, wherever a Python package that carries some is installed: torques, kept frames, round trip.

`airo-models` (MIT; Universal Robots, Robotiq, Schunk) belongs to the test extra; `example-robot-data` (131 MB; some sixty robots) is read too where
it is installed. None of their text is in this repository.
"""

import sysconfig
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from oracles.test_urdf_agrees import Pinocchio, kept_frames, legend, pose_difference
from symgen.derive.float_algebra import FloatAlgebra
from symgen.derive.geometry import Geometry
from symgen.derive.loops import close
from symgen.derive.newton_euler import Motion, joint_torques
from symgen.description import Robot
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, parameter
from symgen.description.urdf import parse_urdf, read_urdf
from symgen.description.urdf_write import write_urdf
from symgen.errors import DescriptionError

SITE = Path(sysconfig.get_paths()["purelib"])
FOLDERS = ("airo_models", "cmeel.prefix/share/example-robot-data/robots")
MOVES = ('type="revolute"', 'type="prismatic"', 'type="continuous"')
FOUND = sorted(p for folder in FOLDERS for p in (SITE / folder).rglob("*.urdf") if any(word in p.read_text("utf-8") for word in MOVES))
REFUSED = {"alex_psyonic_hands": "no moving joint 'index_q1' to follow"}
POSE = 5e-12  # angles within 1e-12 of a multiple of pi/12 are taken as that: files say 1.570796326795


def open_tree(robot: Robot) -> Robot:
    """The mechanism with every joint its own and nothing but its links."""
    values = {name: robot.values[name] for j in robot.links for p in INERTIAL if (name := parameter(p, j)) in robot.values}
    frames = tuple(replace(f, mu=int(f.sigma != FIXED)) for f in robot.frames)
    return replace(robot, frames=frames, constraints={}, elements=(), limits={}, values=values)


def difference(text: str, robot: Robot, names: dict[int, str]) -> float:
    """Largest difference of torque over the largest torque, every joint on its own, whatever follows what."""
    tree, rng = open_tree(robot), np.random.default_rng(7)
    reach = np.array([1.0 if f.sigma == PRISMATIC else np.pi for f in tree.frames if f.sigma != FIXED])
    oracle, closure, largest, error = Pinocchio(text), close(tree), 0.0, 0.0
    for _ in range(3):
        x = rng.standard_normal((3, len(reach)))
        x[0] = rng.uniform(-1, 1, len(reach)) * reach
        theirs = oracle.torque([names[j] for j in tree.joints], *x)
        states = [{j: np.array(v) for j, v in zip(tree.joints, row, strict=True)} for row in x]
        gamma = joint_torques(Motion(Geometry(tree, FloatAlgebra(tree, *states), closure)), dict(tree.values))
        ours = np.array([float(gamma[j]) for j in tree.joints])
        largest, error = max(largest, np.abs(theirs).max()), max(error, np.abs(ours - theirs).max())
    return error / largest if largest else error


@pytest.mark.skipif(not FOUND, reason="no package with URDF files: pip install symgen[test]")
def test_there_are_several_makers() -> None:
    assert len({p.parent.name for p in FOUND}) >= 4


@pytest.mark.parametrize("path", FOUND, ids=lambda p: p.stem)
def test_torques_frames_and_round_trip(path: Path) -> None:
    content = path.read_bytes()
    if path.stem in REFUSED:
        with pytest.raises(DescriptionError, match=REFUSED[path.stem]):
            read_urdf(content, path.name)
        return
    robot, notes = read_urdf(content, path.name)
    kept, said = read_urdf(content, path.name, keep_fixed=True)
    assert kept.joints == robot.joints and pose_difference(content.decode(), kept, said, 1) < POSE
    assert len(kept_frames(said)) == sum(joint.kind == "fixed" for joint in parse_urdf(content).joints)
    if not robot.values:
        return
    for found, names in ((robot, legend(notes)), (kept, legend(said))):
        assert difference(content.decode(), found, names) < 1e-10
        again = write_urdf(found)[0]
        assert difference(again, found, {j: f"q{j}" for j in found.moving}) < 1e-10
        back, of = read_urdf(again.encode(), "again.urdf")
        assert difference(again, back, legend(of)) < 1e-10
