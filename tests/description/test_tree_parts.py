"""Locked joints and chains of a URDF move as the whole robot does with the others at rest; labels
go from file to file.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

from oracles.test_urdf_agrees import Pinocchio, legend
from oracles.urdf_robots import joint, link, robot
from symgen.certify.lagrange import Lagrange
from symgen.description import parse_robot
from symgen.description.robot import INERTIAL
from symgen.description.tree import TreePart
from symgen.description.tree_robot import read_tree
from symgen.description.yaml import write_yaml
from symgen.emit.generate import generate_module
from symgen.errors import DescriptionError

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
from trees import TREES

TEXT = robot(
    "two_arms",
    link("world"),
    joint("lift", "prismatic", "world", "torso", "0.1 0 0.5", "0.3 -0.2 0.5"),
    link("torso", 9.0, "0.1 0 0.2"),
    joint("head", "revolute", "torso", "eye", "0 0 0.4", axis="0 1 0"),
    link("eye", 1.0, "0.1 0.1 0"),
    joint("shoulder", "revolute", "torso", "upper", "0 0.2 0.3", "0.1 0.2 0.3", axis="0 1 0"),
    link("upper", 2.0, "0.1 0.05 0.2"),
    joint("elbow", "continuous", "upper", "lower", "0.3 0 0", axis="0.6 0 0.8"),
    link("lower", 1.5, "0.1 0.02 0.03"),
    joint("finger", "prismatic", "lower", "pad", "0.2 0 0", axis="0 1 0"),
    link("pad", 0.2, "0.01 0.02 0.03"),
    joint(
        "twin",
        "prismatic",
        "lower",
        "pad2",
        "0.2 0 0.1",
        axis="0 -1 0",
        more='<mimic joint="finger" multiplier="0.7315" offset="0.01"/>',
    ),
    link("pad2", 0.3, "0.01 0.02 0.03"),
)
WHOLE = ("lift", "head", "shoulder", "elbow", "finger", "twin")


@pytest.mark.parametrize(
    ("part", "moving", "at"),
    [
        (
            TreePart({"elbow": 0.7, "lift": -0.2}),
            ["head", "shoulder", "finger", "twin"],
            {"elbow": 0.7, "lift": -0.2},
        ),
        (
            TreePart({"finger": 0.05}),
            ["lift", "head", "shoulder", "elbow"],
            {"finger": 0.05, "twin": 0.7315 * 0.05 + 0.01},
        ),
        (TreePart(chain=("torso", "lower")), ["shoulder", "elbow"], {"twin": 0.01}),
        (
            TreePart({"elbow": 1.1}, ("world", "pad")),
            ["lift", "shoulder", "finger"],
            {"elbow": 1.1, "twin": 0.01},
        ),
    ],
)
def test_the_rest_stands_still(part, moving, at):
    found, notes = read_tree(TEXT.encode(), "arms.urdf", part=part)
    names = legend(notes)
    assert list(names.values()) == moving and dict(found.labels) == names
    if found.constraints:
        return  # the relation itself is that of the whole robot, tests/oracles/test_urdf_agrees.py
    n = len(moving)
    q, qd, qdd = np.random.default_rng(4).standard_normal((3, 1, n))
    chi = np.array(
        [found.values[p] if p.rstrip("0123456789") in INERTIAL else 0.0 for p in found.parameters]
    )
    ours = Lagrange(found).torque(q, qd, qdd, chi)[0]
    rows = []
    for x, known in zip((q, qd, qdd), (at, {}, {}), strict=True):
        rows.append(
            np.array(
                [{**known, **dict(zip(moving, x[0], strict=True))}.get(name, 0.0) for name in WHOLE]
            )
        )
    theirs = Pinocchio(TEXT).torque(list(WHOLE), *rows)[[WHOLE.index(name) for name in moving]]
    np.testing.assert_allclose(ours, theirs, atol=1e-10 * np.abs(theirs).max())


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (
            TreePart({"twin": 0.0}),
            "'twin' cannot be locked, because it follows other joints; lock finger",
        ),
        (
            TreePart({"nose": 0.0}),
            "the file has no moving joint 'nose' to lock; its moving joints are lift, head",
        ),
        (TreePart(chain=("eye", "pad")), "the base link of the chain first"),
        (TreePart(chain=("torso", "nose")), "no link 'nose'"),
    ],
)
def test_what_cannot_be_held_is_refused(part, words):
    with pytest.raises(DescriptionError, match=words):
        read_tree(TEXT.encode(), "arms.urdf", part=part)


def test_labels_are_those_of_the_file():
    found, _ = read_tree(TEXT.encode(), "arms.urdf", keep_fixed=True)
    assert dict(parse_robot(write_yaml(found).encode(), "arms.yaml").labels) == dict(found.labels)
    strange = TEXT.replace('"head"', '"the &quot;head&quot;"')
    found, notes = read_tree(strange.encode(), "arms.urdf")
    assert 2 not in found.labels and any("no label" in note and "head" in note for note in notes)


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ("{9: x}", "frame 9 does not exist"),
        ("{1: a, 2: a}", "names frame 1 already"),
        ('{1: "a*/b"}', "printable"),
        ('{1: ""}', "printable"),
    ],
)
def test_labels_that_name_nothing_are_refused(labels, words):
    found, _ = read_tree(TEXT.encode(), "arms.urdf")
    text = write_yaml(found).split("labels:")[0] + f"labels: {labels}\n"
    with pytest.raises(DescriptionError, match=words):
        parse_robot(text.encode(), "arms.yaml")


def humanoid(joints) -> bytes:
    """URDF of these joints of the humanoid of 30, and of the links that they move."""
    ants = [frame.ant for frame in parse_robot(TREES["humanoid"](30), file="whole.yaml").frames]
    parts = [link("l0")]
    for j in joints:
        axis = ("0 0 1", "0 1 0", "1 0 0")[j % 3]
        parts += [
            link(f"l{j}", 1 + j / 10, "0.01 0.02 0.05"),
            joint(f"j{j}", "revolute", f"l{ants[j - 1]}", f"l{j}", "0 0.05 0.3", axis=axis),
        ]
    return robot("part", *parts).encode()


def test_locked_joints_are_not_derived():
    """The module of a humanoid with 24 locked joints is that of its leg, line by line."""
    leg = range(4, 10)
    rest = TreePart({f"j{j}": 0.1 for j in range(1, 31) if j not in leg})
    held, _ = read_tree(humanoid(range(1, 31)), "part.urdf", part=rest)
    alone, _ = read_tree(humanoid(leg), "part.urdf")
    texts = [generate_module(found).splitlines() for found in (held, alone)]
    computing, of_leg = ([x for x in text if "sha256" not in x.lower()] for text in texts)
    assert len(held.frames) == len(leg)
    assert computing == of_leg and len(computing) > 300
