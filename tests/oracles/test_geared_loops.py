"""Loops whose joints are tied by relations too, and loops in a row. Lagrange multipliers are the
oracle.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import some

from oracles.random_loops import random_loop
from oracles.test_random_loops import module_of, torques_agree
from symgen.certify.modules import certify
from symgen.description import Robot, parse_robot
from symgen.description.grammar import parse
from symgen.emit.generate import generate_module
from symgen.regroup.regrouping import EXACT, regroup

GEARED = """symgen: 1
name: geared_five_bar
gravity: [0, -g, 0]
constants: {{L0: 0.45, L1: 0.2, L2: 0.5, L3: 0.4, L4: 0.21, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}}
  3: {{ant: 0, sigma: 0, mu: 0, alpha: 0, d: L0, theta: q3, r: 0}}
  4: {{ant: 3, sigma: 0, mu: 0, alpha: 0, d: L4, theta: q4, r: 0}}
  5: {{ant: 2, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q5, r: 0}}
  6: {{ant: 4, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}}
loops: [{{cut: 5, twin: 6, start: {{q1: 1}}}}]
constraints: {{q3: {ratio}*q1 + 0.5}}
elements: {{Ia: {{kind: inertia, along: all}}, FV: {{kind: viscous, along: all}}}}
"""
IN_A_ROW = """symgen: 1
name: two_four_bars
gravity: [0, -g, 0]
constants: {L0: 0.45, L1: 0.2, L2: 0.5, L3: 0.4, g: 9.81}
frames:  # frame 4, the cut of the first loop, carries the second
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: L0, theta: q3, r: 0}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q4, r: 0}
  5: {ant: 3, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}
  6: {ant: 4, sigma: 0, mu: 0, alpha: 0, d: 0.3, theta: q6, r: 0}
  7: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0.9, theta: q7, r: 0}
  8: {ant: 6, sigma: 0, mu: 0, alpha: 0, d: 0.5, theta: q8, r: 0}
  9: {ant: 7, sigma: 2, alpha: 0, d: 0.6, theta: 0, r: 0}
loops: [{cut: 4, twin: 5, start: {q1: 1}}, {cut: 8, twin: 9}]
elements: {Ia: {kind: inertia, along: all}, FV: {kind: viscous, along: all}}
"""


def geared(ratio: str) -> Robot:
    return parse_robot(GEARED.format(ratio=ratio).encode(), "geared.yaml")


@pytest.mark.parametrize("ratio", ["2", "-1", "0.5", "0.333"])
@some(2)
def test_hinges_of_a_loop_that_gears_tie(ratio: str, tmp_path: Path) -> None:
    """Angles add up through the gears: a planar loop, exact, for all lengths."""
    robot = geared(ratio)
    found = regroup(robot)
    certificate = certify(found)
    assert found.method == EXACT and certificate.valid, str(certificate)
    torques_agree(robot, module_of(generate_module(robot), tmp_path))


def test_joints_that_turn_fast_are_followed_in_small_steps(tmp_path: Path) -> None:
    """A passive joint turns 4.4 rad for each of the motor at the start; steps of 0.2 rad lost it
    at one sample in twenty.
    """
    module = module_of(generate_module(geared("2")), tmp_path)
    q = np.linspace(0.5, 1.5, 41)[:, None]
    alone = np.concatenate([module.passive_joints(x[None]) for x in q])
    assert np.abs(np.diff(alone, axis=0)).max() < 0.2


@pytest.mark.parametrize("kind", ["jack", "offset slider-crank, driven by the slide"])
def test_a_motor_before_a_loop_that_follows_a_joint_of_it(kind: str, tmp_path: Path) -> None:
    """By a fraction of a hinge that the loop alone ties: in numbers, told."""
    robot = random_loop(kind, 60, behind=2)
    relation = parse("0.333*q3", [f"q{j}" for j in robot.moving])
    frames = tuple(replace(f, mu=int(f.mu and f.j != 1)) for f in robot.frames)
    robot = replace(robot, frames=frames, constraints={**robot.constraints, 1: relation})
    found = regroup(robot)
    assert "an angle contains 333/1000 times q3" in found.method
    assert certify(found).valid
    torques_agree(robot, module_of(generate_module(robot), tmp_path))


def test_a_loop_through_the_cut_joint_of_another(tmp_path: Path) -> None:
    robot = parse_robot(IN_A_ROW.encode(), "row.yaml")
    found = regroup(robot)
    certificate = certify(found)
    assert found.method == EXACT and certificate.valid, str(certificate)
    torques_agree(robot, module_of(generate_module(robot), tmp_path))
