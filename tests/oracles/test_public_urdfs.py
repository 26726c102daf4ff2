"""URDF files as their makers publish them, wherever a Python package that carries some is
installed: torques, kept frames, round trip.

`airo-models` (MIT; Universal Robots, Robotiq, Schunk) belongs to the test extra;
`example-robot-data` (131 MB; some sixty robots) is read too where
it is installed. None of their text is in this repository.
"""

from pathlib import Path

import pytest

from oracles.test_urdf_agrees import kept_frames, legend, pose_difference
from oracles.urdf_table import FOUND, difference, snapped_text
from symgen.certify.modules import certify
from symgen.description.angles import SNAPPED
from symgen.description.tree_robot import read_tree
from symgen.description.urdf import parse_urdf, write_urdf
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import regroup

REFUSED = {"alex_psyonic_hands": "no moving joint 'index_q1' to follow"}
POSE = (
    5e-12  # angles within 1e-12 of a multiple of pi/12 are taken as that: files say 1.570796326795
)


def test_there_are_several_makers() -> None:
    assert len({p.parent.name for p in FOUND}) >= 4


@pytest.mark.parametrize("path", FOUND, ids=lambda p: p.stem)
def test_torques_frames_and_round_trip(path: Path) -> None:
    content = path.read_bytes()
    if path.stem in REFUSED:
        with pytest.raises(DescriptionError, match=REFUSED[path.stem]):
            read_tree(content, path.name, exact=True)
        return
    robot, notes = read_tree(content, path.name, exact=True)
    kept, said = read_tree(content, path.name, exact=True, keep_fixed=True)
    assert kept.joints == robot.joints and pose_difference(content.decode(), kept, said, 1) < POSE
    assert len(kept_frames(said)) == sum(
        joint.kind == "fixed" for joint in parse_urdf(content, path.name, exact=True).joints
    )
    if not robot.values:
        return
    for found, names in ((robot, legend(notes)), (kept, legend(said))):
        assert difference(content.decode(), found, names) < 1e-10
        again = write_urdf(found)[0]
        assert difference(again, found, {j: f"q{j}" for j in found.moving}) < 1e-10
        back, of = read_tree(again.encode(), "again.urdf", exact=True)
        assert difference(again, back, legend(of)) < 1e-10


@pytest.mark.parametrize("path", FOUND, ids=lambda p: p.stem)
def test_torques_with_snapped_angles(path: Path) -> None:
    """The default: angles within SNAP of a multiple of pi/12 are that; the same text with such
    angles moves alike. Changes that are not told change no torque by more than rounding.
    """
    if path.stem in REFUSED:
        pytest.skip(REFUSED[path.stem])
    text = path.read_text("utf-8")
    robot, notes = read_tree(text.encode(), path.name)
    told = any(note.startswith(SNAPPED) for note in notes)
    assert told or not robot.values or difference(text, robot, legend(notes)) < 1e-7
    assert not robot.values or difference(snapped_text(text), robot, legend(notes)) < 1e-9


def certified(path: Path) -> None:
    certificate = certify(regroup(read_tree(path.read_bytes(), path.name)[0]))
    assert certificate.valid, str(certificate)


@pytest.mark.parametrize(
    "path",
    [p for p in FOUND if len(p.read_text("utf-8")) < 40_000 and p.stem not in REFUSED],
    ids=lambda p: p.stem,
)
def test_small_robots_are_certified(path: Path) -> None:
    certified(path)


@pytest.mark.campaign
@pytest.mark.parametrize("path", [p for p in FOUND if p.stem not in REFUSED], ids=lambda p: p.stem)
def test_every_robot_is_certified(path: Path) -> None:
    certified(path)
