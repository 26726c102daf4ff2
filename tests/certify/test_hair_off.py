"""Angles a hair off round ones: what the certificate says, with the frame and the angle, and a
remedy that does not lead to the same sentence.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import mpmath
import numpy as np
import pytest
import sympy

from symgen.certify.certificate import certify_formulas
from symgen.certify.modules import certify
from symgen.derive.doubts import doubts
from symgen.description import load_robot, parse_robot
from symgen.description.expression import PI
from symgen.description.values import at_values
from symgen.regroup.regrouping import regroup

G = sympy.Rational(981, 100)
OBLIQUE = """symgen: 1
name: ob
gravity: [0, 0, -9.81]
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: {alpha}, d: 0.3, theta: {theta}, r: 0}}
"""


@pytest.mark.parametrize("alpha", ["1e-9", "1e-7"])
def test_the_angle_is_named_and_at_values_takes_it_as_meant(alpha: str) -> None:
    """Not: the constants of the file () are special; two axes of 1e-7 rad have base parameters that
    no float sees.
    """
    text = OBLIQUE.format(alpha=alpha, theta="q2")
    robot = parse_robot(text.encode(), "ob.yaml")
    certificate = certify(regroup(robot))
    assert not certificate.valid
    (sentence,) = certificate.failures
    assert "almost a special one" in sentence and "frame 2: alpha has" in sentence
    assert "constants" not in sentence and "--at-values replaces" in sentence
    rounded = regroup(at_values(robot))
    assert certify(rounded).valid
    meant = OBLIQUE.format(alpha="0", theta="q2")
    assert rounded.names == regroup(parse_robot(meant.encode(), "ob.yaml")).names


def test_a_right_angle_of_eleven_digits_has_all_base_parameters() -> None:
    """No direction of theirs is small (60 digits, below): what is small are entries of STRUCTURE."""
    robot = parse_robot(OBLIQUE.format(alpha="1.57079632679", theta="q2").encode(), "ob.yaml")
    assert certify(regroup(robot)).valid and "not pi/2" in doubts(robot)[0]


def test_angles_beside_joints_too_and_others_stay() -> None:
    text = OBLIQUE.format(alpha="0.7", theta="q2 + 1.5707963")
    frame = at_values(parse_robot(text.encode(), "ob.yaml")).frame(2)
    assert str(frame.alpha) == "0.7" and frame.theta0 == PI * Fraction(1, 2)


def regressor_in_60_digits(alpha: str, names: list[str]) -> mpmath.matrix:
    """Columns `names` of two hinges a fixed angle apart, links by their energies, at 10 random
    states; SymPy differentiates, mpmath evaluates. Nothing of it is the library's.
    """
    t, a = sympy.Symbol("t"), sympy.Symbol("a")
    q1, q2 = (sympy.Function(f"q{j}")(t) for j in (1, 2))

    def about_z(x: sympy.Expr) -> sympy.Matrix:
        return sympy.Matrix([[sympy.cos(x), -sympy.sin(x), 0], [sympy.sin(x), sympy.cos(x), 0],
                             [0, 0, 1]])  # fmt: skip

    tilt = sympy.Matrix(
        [[1, 0, 0], [0, sympy.cos(a), -sympy.sin(a)], [0, sympy.sin(a), sympy.cos(a)]]
    )
    d1, d2 = q1.diff(t), q2.diff(t)
    to_2 = (tilt * about_z(q2)).T
    w1 = sympy.Matrix([0, 0, d1])
    w2 = to_2 * w1 + sympy.Matrix([0, 0, d2])
    origin = sympy.Matrix([sympy.Rational(3, 10), 0, 0])
    v2 = to_2 * w1.cross(origin)
    up = {1: about_z(q1).T[:, 2], 2: (about_z(q1) * tilt * about_z(q2)).T[:, 2]}
    energies = {}
    for j, w, v, height in ((1, w1, w1 * 0, 0), (2, w2, v2, 0)):
        for (x, i), (y, k) in product(zip("XYZ", range(3), strict=True), repeat=2):
            if i <= k:
                energies[f"{x}{y}{j}"] = w[i] * w[k] / (2 if i == k else 1), 0
        turned = v.cross(w)
        for i, x in enumerate("XYZ"):
            energies[f"M{x}{j}"] = turned[i], G * up[j][i]
        energies[f"M{j}"] = v.dot(v) / 2, height
    state = sympy.symbols("x1:7")
    motion = [(q.diff(t, k), state[3 * j + k]) for k in (2, 1, 0) for j, q in enumerate((q1, q2))]
    rows = []
    for q, d in ((q1, d1), (q2, d2)):
        column = [
            (E.diff(d).diff(t) - E.diff(q) + sympy.sympify(U).diff(q)).subs(motion)
            for E, U in (energies[name] for name in names)
        ]
        rows.append(sympy.lambdify((a, *state), column, "mpmath"))
    rng = np.random.default_rng(4)
    states = [[mpmath.mpf(float(x)) for x in rng.uniform(-2, 2, 6)] for _ in range(10)]
    return mpmath.matrix([row(mpmath.mpf(alpha), *x) for x in states for row in rows])


@pytest.mark.parametrize("alpha", ["1e-9", "1e-7", "1e-5", "1.57079632679", "1.570796"])
def test_what_the_certificate_says_is_so_in_60_digits(alpha: str) -> None:
    """The base columns are independent, as proved, and as many directions of theirs as are told act
    by less than 1e-9 of the largest: 4, the count beyond that of parallel axes.
    """
    found = regroup(parse_robot(OBLIQUE.format(alpha=alpha, theta="q2").encode(), "ob.yaml"))
    certificate = certify(found)
    with mpmath.workdps(60):
        W = regressor_in_60_digits(alpha, list(found.own))
        s = list(mpmath.svd_r(W, compute_uv=False))
        assert len(s) == len(found) == 8 and s[-1] > mpmath.mpf(10) ** -40 * s[0]
        small = sum(x < s[0] * mpmath.mpf("1e-9") for x in s)
    assert certificate.valid == (alpha not in ("1e-9", "1e-7")), str(certificate)
    if not certificate.valid:
        assert (
            f"almost a special one: {small} combinations of base param" in certificate.failures[0]
        )


def test_coefficients_beyond_double_precision_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Offsets of 4e-5 m that divide along a spine gave coefficients of 1e25: torques were off by
    3e4 of the largest, and nothing said why.
    """
    found = regroup(load_robot("scara"))
    monkeypatch.setattr(
        "symgen.certify.certificate.base_values", lambda found, *_: np.full(len(found), 1e20)
    )
    (told,) = certify_formulas(found).failures
    assert "gives 1e+20 where" in told and "write 0 where nothing is meant" in told
