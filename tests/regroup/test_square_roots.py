"""Square roots beside angles of the same field: sqrt(3)/2 is cos(pi/6), never -cos(pi/6), in proofs
and in emitted code.
"""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy
from campaign import some

from runtime import load_model
from symgen import Robot, generate_module, parse_robot, regrouping
from symgen.certify.lagrange import sampled
from symgen.certify.modules import certified_files, certify
from symgen.derive.exact import Draw, Fp
from symgen.description.expression import Expression, call
from symgen.errors import CertificateError

ROBOT = """
symgen: 1
name: same
gravity: [0, 0, -g]
constants: {{g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: {alpha}, d: 0.4, theta: q2, r: {r}}}
  3: {{ant: 2, sigma: 0, alpha: {alpha}, d: 0.3, theta: q3, r: {r}}}
"""


def robot(alpha: str, r: str) -> Robot:
    return parse_robot(ROBOT.format(alpha=alpha, r=r).encode(), "same.yaml")


def residue(draw: Draw, e: Expression) -> int:
    value = draw.constant(e)
    return int(value.x[0]) if isinstance(value, Fp) else value % draw.p


@pytest.mark.parametrize("seed", range(8))
def test_roots_of_one_field_obey_its_relations(seed: int) -> None:
    draw = Draw(
        robot(
            "pi/30", "sqrt(3)/2 + sqrt(2)*sqrt(5) + sqrt(6/49) + sqrt(15) + sqrt(10) + sqrt(1/2)"
        ),
        seed,
        1,
    )

    def sqrt(c: int | Fraction) -> Expression:
        return call("sqrt", Expression.of(c))

    def cos(numerator: int, denominator: int) -> Expression:
        return call("cos", Expression.symbol("pi") * Fraction(numerator, denominator))

    same = [
        (sqrt(3) * Fraction(1, 2), cos(1, 6)),
        (sqrt(5), cos(1, 5) * 4 - 1),
        (sqrt(6), sqrt(2) * sqrt(3)),
        (sqrt(Fraction(6, 49)) * 7, sqrt(6)),
        (sqrt(15), sqrt(5) * cos(1, 6) * 2),
        (sqrt(10), sqrt(2) * sqrt(5)),
        (sqrt(Fraction(1, 2)) * 2, sqrt(2)),
    ]
    for left, right in same:
        assert abs(float(left) - float(right)) < 1e-12
        assert residue(draw, left) == residue(draw, right), (left, right)


@pytest.mark.parametrize(
    ("alpha", "r"),
    [("pi/6", "sqrt(3)/2"), ("pi/4", "sqrt(2)/2"), ("pi/5", "sqrt(5)"), ("pi/3", "sqrt(12)")],
)
def test_the_emitted_regressor_is_that_of_lagrange(alpha: str, r: str, tmp_path: Path) -> None:
    described = robot(alpha, r)
    base = regrouping(described)
    assert certify(base).valid
    path = tmp_path / "same.py"
    path.write_text(generate_module(described))
    model = load_model(path, trust=True)
    W, names = sampled(described, 40, seed=5).W, described.parameters
    chi = np.random.default_rng(6).standard_normal(len(names))
    value = dict(zip(names, chi, strict=True))
    X = np.array(
        [
            sum(c.value(described.constants) * value[p] for p, c in b.combination.items())
            for b in base.base
        ]
    )
    own = W[:, [names.index(name) for name in base.own]]
    assert np.abs(own @ X - W @ chi).max() < 1e-10 * np.abs(W @ chi).max()
    q, qd, qdd = np.random.default_rng(1).uniform(-1, 1, (3, 50, 3))
    by_regressor = model.regressor(q, qd, qdd) @ X
    by_recursion = model.inverse_dynamics(q, qd, qdd, X)
    assert np.abs(by_regressor - by_recursion).max() < 1e-10 * np.abs(by_recursion).max()


ROOTS = """
symgen: 1
name: roots
gravity: [0, 0, -g]
constants: {{L: {L}, M: 0.7, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 2, alpha: 0, d: {d}, theta: 0, r: 0}}
  3: {{ant: 2, sigma: 0, alpha: 0, d: {back}, theta: q3, r: {r}}}
  4: {{ant: 3, sigma: 0, alpha: {alpha}, d: 0.3, theta: q4, r: 0}}
"""


def of_roots(d: str, back: str, r: str = "0", alpha: str = "pi/2", L: float = 0.3) -> Robot:
    text = ROOTS.format(d=d, back=back, r=r, alpha=alpha, L=L)
    return parse_robot(text.encode(), "roots.yaml")


@pytest.mark.parametrize(
    ("d", "back"),
    [
        ("sqrt(2 + sqrt(3))", "-(sqrt(6) + sqrt(2))/2"),
        ("sqrt(3 + 2*sqrt(2))", "-1 - sqrt(2)"),
        ("sqrt(5 - 2*sqrt(6))", "sqrt(2) - sqrt(3)"),
        ("sqrt(2)*sqrt(L)", "-sqrt(2*L)"),
        ("sqrt(2*L/25)", "-sqrt(2)*sqrt(L)/5"),
        ("sqrt(2)*sqrt(L + M)", "-sqrt(2)*sqrt(L + M)"),
    ],
)
def test_a_root_has_one_value_however_it_is_written(d: str, back: str) -> None:
    """The second frame goes back to the first axis: its base parameters are those of d = 0."""
    found, plain = regrouping(of_roots(d, back)), regrouping(of_roots("0", "0"))
    assert found.names == plain.names and certify(found).valid
    values = {"L": sympy.Rational(3, 10), "M": sympy.Rational(7, 10)}
    there, here = (sympy.sympify(text, locals=values).evalf(60) for text in (d, back))
    assert abs(there + here) < sympy.Float(10, 60) ** -55


@pytest.mark.parametrize(
    ("d", "back", "r", "alpha"),
    [
        ("sqrt(2 + sqrt(2))", "-2*cos(pi/8)", "0", "pi/2"),
        ("2*cos(pi/8)", "-sqrt(2 + sqrt(2))", "2*sin(pi/8)", "pi/8"),
        ("sqrt(2 + sqrt(2))", "0.1", "sqrt(2 - sqrt(2))", "pi/4"),
        ("sqrt(L**2)", "-L", "0", "pi/2"),
        ("sqrt(L**2)", "L", "0", "pi/2"),
        ("sqrt(L**2 + 2*L*M + M**2)", "-L - M", "0", "pi/2"),
        ("sqrt(L**2*M)", "L*sqrt(M)", "0", "pi/2"),
        ("sqrt(L)*sqrt(M)", "-sqrt(L*M)", "0", "pi/2"),
    ],
)
@some(4)
def test_a_root_that_others_make_up_is_right_or_named(
    d: str, back: str, r: str, alpha: str
) -> None:
    """Of either sign of L; never a certificate that does not hold without a word."""
    for L in (0.3, -0.3)[: 2 - ("sqrt(L)" in d)]:
        certificate = certify(regrouping(of_roots(d, back, r, alpha, L)))
        assert certificate.valid or re.match(
            r"sqrt\(.*\) counts? as any number", certificate.failures[0]
        )


def test_the_root_is_named() -> None:
    """What fails a10 and a07: |L| with L below zero, and two ways to write one length."""
    a10 = certify(regrouping(of_roots("sqrt(L**2)", "L", L=-0.3)))
    assert a10.failures[0].startswith("sqrt(L**2) counts as any number")
    a07 = of_roots("2*cos(pi/8)", "-sqrt(2 + sqrt(2))", "2*sin(pi/8)", "pi/8")
    assert certify(regrouping(a07)).failures[0].startswith("sqrt(sqrt(2) + 2) counts as any")
    with pytest.raises(CertificateError, match=r"sqrt\(L\*\*2\) counts as any number"):
        certified_files(of_roots("sqrt(L**2)", "L", L=-0.3))


@pytest.mark.parametrize(
    ("d", "alpha"),
    [
        ("sqrt(1 + sqrt(2))", "pi/2"),
        ("sqrt(2 + sqrt(2))", "pi/3"),
        ("sqrt(L**2 + M**2)", "pi/8"),
        ("sqrt(L) + sqrt(M) + sqrt(1 + L)", "pi/4"),
        ("sqrt(1 + sqrt(1 + sqrt(2)))", "pi/2"),
        ("sqrt(sqrt(2))", "pi/2"),
    ],
)
def test_other_roots_stand_by_themselves(d: str, alpha: str) -> None:
    found = regrouping(of_roots(d, "0.1", alpha=alpha))
    assert certify(found).valid
