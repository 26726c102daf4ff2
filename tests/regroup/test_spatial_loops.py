"""Spatial loops: base parameters by floats near the start, in one assembly mode, for mechanisms
without lengths, with seven hinges, of two circles; planar ones that no pair of joints closes.
"""

from __future__ import annotations

import pytest

from symgen.certify.modules import certify
from symgen.description import Robot, parse_robot
from symgen.regroup.regrouping import NUMERIC, regroup

SPHERICAL = """
frames:   # four axes that meet: no length at all
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: pi/6, d: 0, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: pi/3, d: 0, theta: q3, r: 0}
  4: {ant: 0, sigma: 0, mu: 0, alpha: pi/3, d: 0, theta: q4, r: 0}
  5: {ant: 4, sigma: 2, alpha: pi/4, d: 0, theta: 0, r: 0}
loops: [{cut: 3, twin: 5, start: {q1: 1.0, q2: -0.408, q3: 1.034, q4: 1.025}}]
"""
WEDGE = """
frames:   # three slides, no length at all
  1: {ant: 0, sigma: 1, gamma: pi/2, alpha: pi/2, d: 0, theta: pi/2, r: q1}
  2: {ant: 1, sigma: 1, mu: 0, alpha: 0.5, d: 0, theta: 0, r: q2}
  3: {ant: 0, sigma: 1, mu: 0, alpha: -pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 3, sigma: 2, gamma: -pi/2, alpha: 0.5 - pi/2, d: 0, theta: 0, r: 0}
loops: [{cut: 2, twin: 4}]
"""
RSSR = """
frames:   # crank 1, universal 2 and 3, rod 3, spherical 4, 5 and the cut 7, rocker 6
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: 0.15, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: 0.6, theta: q4, r: 0}
  5: {ant: 4, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q5, r: 0}
  6: {ant: 0, sigma: 0, mu: 0, b: 0.1, alpha: pi/2, d: 0.5, theta: q6, r: 0}
  7: {ant: 5, sigma: 0, mu: 0, alpha: pi/2, d: 0, theta: q7, r: 0}
  8: {ant: 6, sigma: 2, alpha: 0, d: 0.3, theta: 0, r: 0}
loops:
  - {cut: 7, twin: 8, start: {q1: 0.5, q2: -0.658, q3: 0.704, q4: -0.704, q5: 2.984, q6: 1.289, q7: -1.853}}
"""
PEAUCELLIER = """
frames:   # a rhombus between two bars and a crank: a point on a straight line
  1: {ant: 0, sigma: 0, alpha: 0, d: 0.22, theta: q1, r: 0}
  2: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q3, r: 0}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: 0.5, theta: q4, r: 0}
  5: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: 0.5, theta: q5, r: 0}
  6: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: 0.5, theta: q6, r: 0}
  7: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: 0.5, theta: q7, r: 0}
  8: {ant: 4, sigma: 0, mu: 0, alpha: 0, d: 0.2, theta: q8, r: 0}
  9: {ant: 1, sigma: 2, alpha: 0, d: 0.22, theta: 0, r: 0}
  10: {ant: 5, sigma: 0, mu: 0, alpha: 0, d: 0.2, theta: q10, r: 0}
  11: {ant: 1, sigma: 2, alpha: 0, d: 0.22, theta: 0, r: 0}
  12: {ant: 6, sigma: 0, mu: 0, alpha: 0, d: 0.2, theta: q12, r: 0}
  13: {ant: 7, sigma: 2, alpha: 0, d: 0.2, theta: 0, r: 0}
loops:
  - {cut: 8, twin: 9, start: {q1: 0.3, q2: 0.558, q4: 4.18}}
  - {cut: 10, twin: 11, start: {q3: -0.258, q5: -4.18}}
  - {cut: 12, twin: 13, start: {q6: -2.1, q7: 2.1}}
"""


def robot(body: str, gravity: str = "0, 0, -9.81") -> Robot:
    text = f"symgen: 1\nname: spatial\ngravity: [{gravity}]{body}"
    return parse_robot(text.encode(), "spatial.yaml")


@pytest.mark.parametrize(
    ("body", "gravity", "count"),
    [
        (SPHERICAL, "0, 0, -9.81", 9),
        (WEDGE, "0, -9.81, 0", 2),
        pytest.param(RSSR, "0, 0, -9.81", 14, marks=pytest.mark.campaign),
        pytest.param(PEAUCELLIER, "0, -9.81, 0", 12, marks=pytest.mark.campaign),
    ],
)
def test_base_parameters_and_module(body: str, gravity: str, count: int) -> None:
    """Refused before, though the mechanism is valid: rank and torques of the independent dynamics,
    every function of the module.
    """
    found = regroup(robot(body, gravity))
    assert found.method.startswith(NUMERIC) and len(found) == count
    certificate = certify(found)
    assert certificate.valid, str(certificate)
