"""URDF files with loops, in each form that is read: torques are those of MuJoCo for the same
mechanism, projected on its constraints.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from campaign import FULL, sampled
from support.loop_files import KINDS, ClosedMuJoCo, random_file
from support.loop_urdfs import FORMS, MOTORS, bare, urdf_of

from oracles.test_urdf_agrees import legend, loaded
from symgen.description import load_robot
from symgen.description.files import read_robot

TOLERANCE = 1e-9  # of the largest torque of the states; angles in the text are rounded to 1e-16
PLANAR = ("four-bar", "five-bar", "slider-crank", "jack", "four-bar on a turret", "parallelogram")
CASES = [
    (form, kind)
    for form in FORMS
    for kind in KINDS
    if "points" not in kind
    and kind != "welded hand"
    and (form not in ("closures", "pin_loops") or "welded" not in kind)
    and (form not in ("closures", "second parent") or kind in PLANAR or "welded" in kind)
]


def difference(folder: Path, form: str, kind: str, seed: int, states: int = 3) -> float:
    text, driven = random_file(kind, seed)
    text, motors = bare(text), MOTORS[seed % 3]
    for name, content in urdf_of(text, driven, form, motors, seed).items():
        (folder / name).write_text(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot, notes = read_robot(folder / "robot.urdf")
        assert load_robot(folder / "robot.urdf") == robot
    names = legend(notes)
    ours = [names[j] for j in robot.joints]
    assert sorted(ours) == sorted(driven) and robot.not_read == ()
    oracle, module = ClosedMuJoCo(text, ours), loaded(robot)
    rng, start = np.random.default_rng([seed, 4]), oracle.start
    X = module.base_parameters(np.array([robot.values[name] for name in robot.parameters]))
    theirs, samples = [], []
    for _ in range(6 * states):
        q_a = rng.uniform(-0.1, 0.1, len(ours)) * (0.1 if kind == "jack" else 1)
        q = oracle.closed(start[oracle.driven] + q_a, start)
        if len(theirs) < states and q is not None:
            qd, qdd = rng.standard_normal((2, len(ours)))
            theirs.append(oracle.torque(q, qd, qdd))
            samples.append((q_a, qd, qdd))
    assert len(theirs) == states
    q, qd, qdd = np.array(samples).transpose(1, 0, 2)
    tau = module.inverse_dynamics(q, qd, qdd, X)
    return float(np.abs(tau - theirs).max() / np.abs(theirs).max())


@pytest.mark.parametrize("case", sampled(CASES, 12, more=20), ids="-".join)
def test_torques_are_those_of_mujoco(case, tmp_path):
    form, kind = case
    for seed in range(3 if FULL else 1):
        assert difference(tmp_path, form, kind, seed + len(form) + len(kind)) < TOLERANCE, seed
