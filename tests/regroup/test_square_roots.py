"""Square roots beside angles of the same field: sqrt(3)/2 is cos(pi/6), never -cos(pi/6), in proofs
and in emitted code.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from runtime import load_model
from symgen import Robot, generate_module, parse_robot, regrouping
from symgen.certify.modules import certify
from symgen.derive.exact import Draw, Fp
from symgen.derive.lagrange import sampled
from symgen.description.expression import Expression, call

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
