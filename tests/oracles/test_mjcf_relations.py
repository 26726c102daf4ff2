"""Random MJCF with relations of joints and tendons, connect and weld: torques and relations are
those of MuJoCo's compiled model, or the file is refused by the name of what is not read, or because
the mechanism has another mobility in MuJoCo too.
"""

import re

import mujoco
import numpy as np
import pytest
from campaign import FULL
from support.loop_files import ClosedMuJoCo

from oracles.mjcf_robots import random_tree
from oracles.test_loop_files import difference as loop_difference
from oracles.test_mjcf_agrees import TOLERANCE, difference, motion
from oracles.test_urdf_agrees import legend
from symgen.derive.loops import close
from symgen.description import Robot
from symgen.description.tree_robot import read_tree
from symgen.errors import DescriptionError


def with_relations(seed: int) -> str:
    """A random tree with one to three relations; some between driven joints, some not linear, and
    loops between bodies in one file of four.
    """
    rng, text = np.random.default_rng([31, seed]), random_tree(seed)
    names = re.findall(r'<joint name="(\w+)"', text)
    bodies = re.findall(r'<body name="(\w+)"', text)
    slides = set(re.findall(r'<joint name="(\w+)" type="slide"', text))
    tendons, relations = "", []

    def factor(*joints: str) -> str:
        whole = not slides & set(joints)
        return repr(float(rng.choice([-2, -1, -0.5, 1, 1.5] if whole else [-1.5, 0.3, 2.25])))

    for k in range(int(rng.integers(1, 4))):
        kind = rng.choice(["joint", "constant", "tendon", "curved", "connect", "weld"],
                          p=[0.4, 0.1, 0.3, 0.05, 0.08, 0.07])  # fmt: skip
        pair = [str(x) for x in rng.choice(names, 2, replace=False)] if len(names) > 1 else []
        offset = repr(float(rng.uniform(-0.3, 0.3)))
        if kind == "constant":
            relations.append(
                f'<joint name="e{k}" joint1="{rng.choice(names)}" polycoef="{offset} 0 0 0 0"/>'
            )
        elif kind in ("joint", "curved") and pair:
            more = "0.5 0 0" if kind == "curved" else "0 0 0"
            relations.append(
                f'<joint name="e{k}" joint1="{pair[0]}" joint2="{pair[1]}" '
                f'polycoef="{offset} {factor(*pair)} {more}"/>'
            )
        elif kind == "tendon" and pair:
            other = factor(*pair)
            tendons += (
                f'<fixed name="t{k}"><joint joint="{pair[0]}" coef="2"/>'
                f'<joint joint="{pair[1]}" coef="{2 * float(other)!r}"/></fixed>'
            )
            relations.append(f'<tendon name="e{k}" tendon1="t{k}" polycoef="{offset} 0 0 0 0"/>')
        elif kind in ("connect", "weld") and len(bodies) > 1:
            ends = [str(x) for x in rng.choice(bodies, 2, replace=False)]
            anchor = ' anchor="0.1 0 0"' if kind == "connect" else ""
            relations.append(f'<{kind} name="e{k}" body1="{ends[0]}" body2="{ends[1]}"{anchor}/>')
    driven = [x for x in names if rng.random() < 0.3]
    motors = "".join(f'<motor joint="{x}"/>' for x in driven)
    body = "\n".join(relations)
    return text.replace(
        "</mujoco>",
        f"<tendon>{tendons}</tendon><equality>\n{body}\n</equality>"
        f"<actuator>{motors}</actuator></mujoco>",
    )


def outcome(seed: int) -> str:
    """read, or why not; asserts that what is read is right and what is refused is named."""
    text = with_relations(seed)
    lines = text.splitlines()
    try:
        robot, notes = read_tree(text.encode(), "tree.xml")
        if len(robot.moving) == len(robot.constraints):
            return "nothing moves"
        if "<weld" in text or "<connect" in text:
            return closed_outcome(text, robot, notes, seed)
        assert difference(text, robot, notes, seed) < TOLERANCE, seed
    except DescriptionError as error:
        message = str(error)
        if "the ratio of two angles" in message:  # of joints, by the names of the file
            assert re.search(r"the ratio of 'j\d_\d' \(q\d+\) to", message) and error.file, message
            return "turns"
        assert error.file == "tree.xml" and error.line is not None, message
        if "no joint that moves" in message:
            return "nothing moves"
        named = re.search(r"'(e\d)'", message)
        assert named and f'name="{named[1]}"' in lines[error.line - 1], message
        return next(
            w
            for w in (
                "polycoef",
                "only actuated joints",
                "does not say which",
                "no joint can be cut",
            )
            if w in message
        )
    model = mujoco.MjModel.from_xml_string(text)
    data, names = mujoco.MjData(model), legend(notes)
    for q, qd in zip(*motion(robot, seed)[0][:2], strict=True):
        for j, x, v in zip(robot.moving, q, qd, strict=True):
            data.qpos[model.joint(names[j]).qposadr[0]] = x
            data.qvel[model.joint(names[j]).dofadr[0]] = v
        mujoco.mj_forward(model, data)
        assert data.ne == model.neq and np.abs(data.efc_pos[: data.ne]).max(initial=0) < 1e-11
        assert np.abs(data.efc_vel[: data.ne]).max(initial=0) < 1e-10
    return "read"


def closed_outcome(text: str, robot: Robot, notes: tuple[str, ...], seed: int) -> str:
    """Of a file with loops: closed, or why it is no mechanism, which MuJoCo confirms."""
    names = legend(notes)
    try:
        close(robot)
    except DescriptionError as error:
        assert error.file == "tree.xml", error
        assert (told := re.search(r"mobility is (\d+), but (\d+) .* are actuated", str(error)))
        left = re.search(r"(\d+) degrees of freedom remain", str(error))
        oracle = ClosedMuJoCo(text, [names[j] for j in robot.joints])
        assert oracle.mobility() == (int(told[1]), int(left[1]) if left else 0), error
        return "mobility"
    assert loop_difference(text, [names[j] for j in robot.joints], seed, 2) < 1e-8, seed
    return "closed"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """MuJoCo writes its warnings into the folder of the process."""
    monkeypatch.chdir(tmp_path)


FEW = (1, 2, 3, 5, 6, 7)


def test_relations_are_right_or_refused_by_name():
    outcomes = [outcome(seed) for seed in FEW]
    assert outcomes.count("read") > 2 and len({*outcomes}) > 2, outcomes


@pytest.mark.campaign
def test_many_relations():
    outcomes = [outcome(seed) for seed in {*range(400 if FULL else 60)} - {*FEW}]
    assert outcomes.count("read") > len(outcomes) / 4, {x: outcomes.count(x) for x in {*outcomes}}
