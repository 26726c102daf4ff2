"""MJCF files with <connect> and <weld>: torques are those of MuJoCo, projected on its constraints."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import FULL
from support.loop_files import KINDS, ClosedMuJoCo, random_file

from oracles.test_urdf_agrees import legend, loaded
from symgen.description.robot import PRISMATIC
from symgen.description.tree_robot import read_tree

TOLERANCE = 1e-10  # of the largest torque of the states


def difference(text: str, driven: list[str], seed: int, states: int = 4) -> float:
    """Largest difference from MuJoCo's torques, over the largest torque; dry friction aside."""
    robot, notes = read_tree(text.encode(), "loop.xml")
    names = legend(notes)
    ours = [names[j] for j in robot.joints]
    assert sorted(ours) == sorted(driven), (ours, driven)
    oracle, module = ClosedMuJoCo(text, ours), loaded(robot)
    rng, start = np.random.default_rng([seed, 3]), oracle.start
    chi = [0.0 if name.startswith("FS") else robot.values[name] for name in robot.parameters]
    X = module.base_parameters(np.array(chi))
    reach = np.array([0.02 if robot.frame(j).sigma == PRISMATIC else 0.2 for j in robot.joints])
    theirs, samples = [], []
    for _ in range(6 * states):
        q_a = start[oracle.driven] + reach * rng.uniform(-1, 1, len(reach))
        if len(theirs) < states and (q := oracle.closed(q_a, start)) is not None:
            qd, qdd = rng.standard_normal((2, len(reach)))
            theirs.append(oracle.torque(q, qd, qdd))
            samples.append((q_a, qd, qdd))
    assert len(theirs) == states
    q, qd, qdd = np.array(samples).transpose(1, 0, 2)
    tau = module.inverse_dynamics(q, qd, qdd, X)
    return float(np.abs(tau - theirs).max() / np.abs(theirs).max())


@pytest.mark.parametrize("kind", KINDS)
def test_torques_are_those_of_mujoco(kind):
    for seed in range(6 if FULL else 1):
        assert difference(*random_file(kind, seed), seed) < TOLERANCE, seed
