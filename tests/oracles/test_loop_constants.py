"""Emitted models of general loops at constants that differ from those of the robot file, passed by
keyword: against Lagrange multipliers, and against the model emitted from a file with them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp
from types import ModuleType

import numpy as np
import pytest

from oracles.multipliers import Multipliers
from oracles.random_loops import random_loop
from oracles.random_robots import random_parameters
from oracles.test_loops_agree import whole
from oracles.test_random_loops import module_of
from symgen.description import Robot, load_robot
from symgen.emit.numpy_target import render
from symgen.emit.spec import module_spec
from symgen.regroup.regrouping import regroup

KIND = "offset slider-crank, driven by the slide"


def robot_of(name: str) -> Robot:
    return random_loop(name, 0) if name == KIND else load_robot(name)


def emitted(robot: Robot, folder: Path) -> ModuleType:
    return module_of(render(module_spec(regroup(robot))), Path(mkdtemp(dir=folder)))


@pytest.mark.parametrize("name", ["four_bar", "five_bar", KIND])
def test_constants_by_keyword(name: str, tmp_path: Path) -> None:
    """Lengths changed by 10 %, up or down."""
    robot, rng = robot_of(name), np.random.default_rng(8)
    module = emitted(robot, tmp_path)
    start = np.array(module._START[: len(robot.joints)])
    for signs in (1, -1):
        constants = {
            c: x * (1 + 0.1 * signs * (-1) ** k if c != "g" else 1)
            for k, (c, x) in enumerate(robot.constants.items())
        }
        other = replace(robot, constants=constants)
        q = start + 0.05 * rng.uniform(-1, 1, (8, len(start)))
        qd, qdd = rng.standard_normal((2, *q.shape))
        passive = module.passive_joints(q, qd, qdd, **constants)
        assert passive[0] == pytest.approx(emitted(other, tmp_path).passive_joints(q), abs=1e-10)
        beside = whole(robot, q, passive[0] + 1e-3 * rng.uniform(-1, 1, passive[0].shape))
        oracle = Multipliers(other, beside, qd, qdd)
        moving = (whole(robot, a, p) for a, p in zip((q, qd, qdd), passive, strict=True))
        for values, expected in zip(moving, (oracle.q, oracle.qd, oracle.qdd), strict=True):
            assert np.abs(values - expected).max() < 1e-10 * max(1.0, np.abs(expected).max())
        chi = random_parameters(robot, seed=7)
        X = module.base_parameters(chi, **constants)
        tau, torque = module.inverse_dynamics(q, qd, qdd, X, **constants), oracle.torque(chi)
        assert np.abs(tau - torque).max() < 1e-10 * np.abs(torque).max()


def test_constants_at_which_the_loop_does_not_close(tmp_path: Path) -> None:
    module = emitted(load_robot("four_bar"), tmp_path)
    with pytest.raises(
        ValueError, match=r"do not close .* L0, L1, L2, L3 = \[1\.5 .*emit the model"
    ):
        module.passive_joints(np.array([[1.0]]), L0=1.5)
