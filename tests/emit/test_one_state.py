"""Functions of one state in C against Lagrange's equations and products of frames, in each type of
robot that a controller has: a general wrist, a slide, a branch, a parallelogram.
"""

from __future__ import annotations

import shutil

import pytest
from campaign import some

from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.description import load_robot, parse_robot
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import regroup

WRIST = b"""symgen: 1
name: wrist
gravity: [0, 0, -g]
constants: {R1: 0.4, D2: 0.18, D3: 0.6, R4: 0.62, R6: 0.115, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: R1}
  2: {ant: 1, sigma: 0, alpha: -pi/2, d: D2, theta: q2 - pi/2, r: 0}
  3: {ant: 2, sigma: 0, alpha: -pi/2, d: D3, theta: q3, r: R4}
  4: {ant: 3, sigma: 0, alpha: pi/3, d: 0, theta: q4, r: R6}
elements:
  Ia: {kind: inertia, along: all}
  FS: {kind: coulomb, along: all}
"""
SLIDE = b"""symgen: 1
name: slide
gravity: [0, 0, -9.81]
frames:
  1: {ant: 0, sigma: 1, alpha: pi/4, d: 0.1, theta: 0.3, r: q1}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0.2, theta: q2, r: 0.1}
  3: {ant: 2, sigma: 1, alpha: -pi/2, d: 0, theta: 0, r: q3 + 0.2}
"""
ONE = "regressor inverse_dynamics inertia_matrix bias gravity frame_poses jacobian forward_dynamics"


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
@pytest.mark.parametrize(
    "source",
    [WRIST, SLIDE, "two_branch", "sr400"],
    ids=("wrist", "slide", "branch", "parallelogram"),
)
@some(2)
def test_agrees_with_lagrange(source: bytes | str) -> None:
    """The certificate runs them all, for every frame; a robot without constants has its arrays."""
    robot = load_robot(source) if isinstance(source, str) else parse_robot(source, "robot.yaml")
    regrouping = regroup(robot)
    file = f"{robot.name}.c"
    text = generate_files(robot, targets=("c",), regrouping=regrouping)[file]
    found = text_check(file, text, "c", Witness(regrouping))
    assert found.valid and {f"{name}1" for name in ONE.split()} <= {*found.errors}
