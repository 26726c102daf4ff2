"""Angles a hair off round ones: what the certificate says, with the frame and the angle, and a
remedy that does not lead to the same sentence.
"""

from __future__ import annotations

from fractions import Fraction

import pytest

from symgen.certify.modules import certify
from symgen.description import parse_robot
from symgen.description.at_values import at_values
from symgen.description.expression import PI
from symgen.regroup.regrouping import regroup

OBLIQUE = """symgen: 1
name: ob
gravity: [0, 0, -9.81]
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: {alpha}, d: 0.3, theta: {theta}, r: 0}}
"""


@pytest.mark.parametrize("alpha", ["1e-9", "1e-7", "1.57079632679"])
def test_the_angle_is_named_and_at_values_takes_it_as_meant(alpha: str) -> None:
    """Not: the constants of the file () are special; two axes of 1e-7 rad have base parameters that
    no float sees.
    """
    text = OBLIQUE.format(alpha=alpha, theta="q2")
    robot = parse_robot(text.encode(), "ob.yaml")
    certificate = certify(regroup(robot))
    assert not certificate.valid
    (sentence,) = certificate.failures
    assert "a hair off a special geometry" in sentence and "frame 2: alpha has" in sentence
    assert "constants" not in sentence and "--at-values takes" in sentence
    rounded = regroup(at_values(robot))
    assert certify(rounded).valid
    meant = OBLIQUE.format(alpha="pi/2" if alpha.startswith("1.5") else "0", theta="q2")
    assert rounded.names == regroup(parse_robot(meant.encode(), "ob.yaml")).names


def test_angles_beside_joints_too_and_others_stay() -> None:
    text = OBLIQUE.format(alpha="0.7", theta="q2 + 1.5707963")
    frame = at_values(parse_robot(text.encode(), "ob.yaml")).frame(2)
    assert str(frame.alpha) == "0.7" and frame.theta0 == PI * Fraction(1, 2)
