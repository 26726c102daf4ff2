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
from campaign import some

from oracles.loop_robots import LIFT
from oracles.multipliers import Multipliers
from oracles.random_loops import random_loop
from oracles.random_robots import random_parameters
from oracles.test_loops_agree import whole
from oracles.test_random_loops import module_of
from symgen.certify.modules import certify
from symgen.description import Robot, load_robot, parse_robot
from symgen.emit.python_target import render
from symgen.emit.spec import module_spec
from symgen.regroup.regrouping import EXACT, regroup

KIND = "offset slider-crank, driven by the slide"


def robot_of(name: str) -> Robot:
    return random_loop(name, 0) if name == KIND else load_robot(name)


def emitted(robot: Robot, folder: Path) -> ModuleType:
    return module_of(render(module_spec(regroup(robot))), Path(mkdtemp(dir=folder)))


@pytest.mark.parametrize("name", ["four_bar", "five_bar", KIND])
@some(1)
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
        ValueError, match=r"do not close .* L0, L1, L2, L3 = \[1\.5 .*generate the model"
    ):
        module.passive_joints(np.array([[1.0]]), L0=1.5)


ISOSCELES = """symgen: 1
name: isosceles
gravity: [0, -g, 0]
constants: {L: 0.4, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L, theta: q2, r: 0}
  3: {ant: 0, sigma: 1, gamma: pi/2, alpha: pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L, theta: q4, r: 0}
  5: {ant: 3, sigma: 2, alpha: -pi/2, d: 0, theta: 0, r: 0}
loops: [{cut: 4, twin: 5, start: {q1: 0.6, q2: -1.2, q3: 0.66}}]
elements: {OFFSET: {kind: offset, along: all}}
"""
SCISSORS = ISOSCELES.replace(
    "loops:", "  6: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: 2*L, theta: q6, r: 0}\nloops:"
).replace("elements: {", "constraints: {q6: -q1}\nelements: {FV: {kind: viscous, along: all}, ")


@pytest.mark.parametrize("text", [ISOSCELES, LIFT, SCISSORS])
@some(1)
def test_planar_loops_of_strangers_are_exact_at_all_lengths(text: str, tmp_path: Path) -> None:
    """Torques of a module at lengths by keyword are those of the base parameters of a file with
    them, which Lagrange multipliers give.
    """
    robot = parse_robot(text.encode(), "stranger.yaml")
    found = regroup(robot)
    assert found.method == EXACT and certify(found).valid
    module = emitted(robot, tmp_path)
    constants = {c: 1.05 * x if c != "g" else 9.0 for c, x in robot.constants.items()}
    other, rng = replace(robot, constants=constants), np.random.default_rng(8)
    q = np.array(module._START[: len(robot.joints)]) + 0.02 * rng.uniform(
        -1, 1, (6, len(robot.joints))
    )
    qd, qdd = rng.standard_normal((2, *q.shape))
    oracle = Multipliers(other, whole(robot, q, module.passive_joints(q, **constants)), qd, qdd)
    chi = random_parameters(robot, seed=7)
    X, torque = module.base_parameters(chi, **constants), oracle.torque(chi)
    tau = module.regressor(q, qd, qdd, **constants) @ X
    assert np.abs(tau - torque).max() < 1e-10 * np.abs(torque).max()


def test_isosceles_slider_crank() -> None:
    """OFFSET3 takes g/(2 L) MY1: 9.81 N at L = 0.5 m and 12.2625 N at 0.4 m for 1 kg m."""
    found = regroup(parse_robot(ISOSCELES.encode(), "isosceles.yaml"))
    (offset,) = (b for b in found.base if b.own == "OFFSET3")
    c = offset.combination["MY1"]
    assert str(c) == "g/2/L"
    for L, force in ((0.5, 9.81), (0.4, 12.2625)):
        assert c.value({"L": L, "g": 9.81}) == pytest.approx(force, abs=1e-12)
