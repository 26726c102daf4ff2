"""Decimal angles about parallel axes: their sums are no new random angles over F_p (three of them
once broke a right certificate).
"""

from symgen.certify.modules import certify
from symgen.description import parse_robot
from symgen.regroup.regrouping import regroup

TEXT = """\
symgen: 1
name: three_parallel
gravity: [0, 0, -g]
constants: {D2: 0.3, D3: 0.25, D4: 0.2, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: D2, theta: q2 + 0.014583219975, r: 0}
  3: {ant: 2, sigma: 0, alpha: 0, d: D3, theta: q3 - 0.2823148900222, r: 0}
  4: {ant: 3, sigma: 0, alpha: 0, d: D4, theta: q4 - 0.9614720031579, r: 0}
  5: {ant: 4, sigma: 0, alpha: 0.7, d: 0, theta: q5, r: 0}
"""


def test_sums_of_decimal_angles_are_sums():
    certificate = certify(regroup(parse_robot(TEXT.encode(), "three.yaml")))
    assert certificate.valid, str(certificate)
