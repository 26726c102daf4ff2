"""The assembly mode of a general loop is the one nearest to its `start`: passive joints, torques and
drawing are those of the mechanism that the file means.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import some

from oracles.loop_robots import JACKS
from symgen.certify.modules import certify
from symgen.derive.doubts import doubts
from symgen.derive.loops import close
from symgen.description import Robot, parse_robot
from symgen.regroup.regrouping import regroup

HEAD = "symgen: 1\nname: strange\ngravity: [0, -g, 0]\n"
JACK = """constants: {a: 0.5, d1: 0.35, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: d1, theta: q2, r: 0}
  3: {ant: 2, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 3, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q4, r: 0}
  5: {ant: 1, sigma: 2, alpha: 0, d: a, theta: 0, r: 0}
loops: [{cut: 4, twin: 5, start: {%s}}]
"""
SLIDER = """constants: {Rc: 0.2, L: 0.6, g: 9.81}
frames:
  1: {ant: 0, sigma: 1, gamma: pi/2, alpha: pi/2, d: 0, theta: 0, r: q1}
  2: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: Rc, theta: q3, r: 0}
  4: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L, theta: q4, r: 0}
  5: {ant: 1, sigma: 2, alpha: -pi/2, d: 0, theta: 0, r: 0}
loops: [{cut: 4, twin: 5, start: {%s}}]
"""
EXCAVATOR = JACKS.partition("gravity: [0, -g, 0]\n")[2]
BOOM = 1.213225  # of the jack at q3 = 0.5, by the law of cosines


def robot(body: str, start: str = "") -> Robot:
    text = HEAD + (body % start if start else body)
    return parse_robot(text.encode(), "strange.yaml")


def test_law_of_cosines() -> None:
    a, d, stroke = 0.5, 0.35, 0.5
    assert np.arccos((a * a + d * d - stroke**2) / (2 * a * d)) == pytest.approx(BOOM, abs=1e-6)


@pytest.mark.parametrize(
    ("body", "start", "expected"),
    [
        (JACK, "q1: 1.2, q3: 0.5", {1: BOOM, 3: 0.5}),
        (JACK, "q1: -1.2, q3: 0.5", {1: -BOOM, 3: 0.5}),
        (JACK, f"q1: {1.2 + 2 * np.pi}, q3: 0.5", {1: BOOM + 2 * np.pi}),
        (SLIDER, "q1: 0.65, q2: 2.0", {1: 0.65, 2: 1.16560}),
        (SLIDER, "q1: 0.65, q2: -2.0", {1: 0.65, 2: -1.16560}),
        (EXCAVATOR, "", {1: 1.213225 - 0.5, 3: 0.5, 6: 1.5252, 8: 0.9}),
    ],
)
@some(3)
def test_nearest_mode(body: str, start: str, expected: dict[int, float]) -> None:
    """The other mode, mirrored, closes too."""
    found = close(robot(body, start)).start
    assert {j: found[j] for j in expected} == pytest.approx(expected, abs=1e-4)


def test_joints_that_are_not_named_are_free() -> None:
    """The passive joint alone: the motor is where it is so, be it far from zero."""
    found = close(robot(JACK, "q1: 2.5")).start
    assert found[1] == pytest.approx(2.5, abs=0.02)
    stroke = np.sqrt(0.5**2 + 0.35**2 - 2 * 0.5 * 0.35 * np.cos(found[1]))
    assert abs(found[3]) == pytest.approx(stroke, abs=1e-9)


def test_a_start_that_closes_nowhere_near_is_told() -> None:
    """q2 = 2 at 0.65 m closes at 1.166; a start drawn to a degree says nothing."""
    (note,) = doubts(robot(SLIDER, "q1: 0.65, q2: 2.0"))
    assert "nowhere near q2 = 2; nearest, and derived, is q2 = 1.166" in note
    assert doubts(robot(SLIDER, "q1: 0.65, q2: 1.15")) == []
    (note,) = doubts(robot(SLIDER, "q1: 1.65, q2: 1.15"))
    assert "nowhere near q1 = 1.65" in note  # beyond its reach of 0.8 m


THREE_LEGS = """constants: {L: 0.377, Lp: 0.146, W0: 0.548, g: 9.81}
frames:   # planar 3-RRR near its reach
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L, theta: q3, r: 0}
  4: {ant: 0, sigma: 0, alpha: 0, d: W0, theta: q4, r: 0}
  5: {ant: 4, sigma: 0, mu: 0, alpha: 0, d: L, theta: q5, r: 0}
  6: {ant: 5, sigma: 0, mu: 0, alpha: 0, d: L, theta: q6, r: 0}
  7: {ant: 3, sigma: 2, alpha: 0, d: Lp, theta: 0, r: 0}
  8: {ant: 0, sigma: 0, gamma: pi/3, alpha: 0, d: W0, theta: q8, r: 0}
  9: {ant: 8, sigma: 0, mu: 0, alpha: 0, d: L, theta: q9, r: 0}
  10: {ant: 9, sigma: 0, mu: 0, alpha: 0, d: L, theta: q10, r: 0}
  11: {ant: 3, sigma: 2, gamma: pi/3, alpha: 0, d: Lp, theta: 0, r: 0}
loops:
  - {cut: 6, twin: 7, start: {q1: 1.4, q2: -1.6, q3: 0.2, q4: 2.0, q5: -1.2}}
  - {cut: 10, twin: 11, start: {q8: -0.4, q9: 1.0}}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
  OFFSET: {kind: offset, along: all}
"""


@pytest.mark.campaign
def test_what_closes_does_not_hang_on_the_states_beside_it() -> None:
    """States out of reach, in which Newton stalls, end no other one; before, states that closed
    when drawn did not when looked at again, and a traceback ended the certificate.
    """
    assert certify(regroup(robot(THREE_LEGS))).valid


RHOMBUS = """constants: {L1: 0.4, L3: 0.4, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q2, r: 0}
  3: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q3, r: 0}
  4: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L3, theta: q4, r: 0}
  5: {ant: 3, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}
loops: [{cut: 4, twin: 5}]
elements: {Ia: {kind: inertia, along: all}}
"""


def test_what_a_function_raises_is_told() -> None:
    """Equal sides under two names fold flat: the regressor was off by "inf of the largest"."""
    text = str(certify(regroup(robot(RHOMBUS))))
    assert "inf of" not in text and "special: the rank is 3 there" in text
    assert "regressor of strange.py ends in an error: the mechanism does not close" in text


@pytest.mark.campaign
def test_states_beyond_a_dead_point_are_no_witness() -> None:
    """The oracle's Newton stepped over one: its states were those of another branch."""
    larger = THREE_LEGS.replace("0.377", "0.4").replace("0.146", "0.15").replace("0.548", "0.6")
    assert certify(regroup(robot(larger))).valid
