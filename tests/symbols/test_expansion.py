"""Polynomials in cosines and sines: tidying and differentiating keep the function; determinants are
those of numbers.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import symgen
from symgen.derive.algebra import GraphAlgebra
from symgen.description.expression import PI, ZERO, Expression
from symgen.symbols.expansion import Expansion, TooManyTermsError

ROBOT = symgen.parse_robot(
    b"symgen: 1\nname: a\ngravity: [0, 0, 0]\nconstants: {c: 0.23, L: 0.7}\nframes:\n"
    b"  1: {ant: 0, sigma: 0, alpha: 0, d: c, theta: q1, r: L}\n",
    "a.yaml",
)
Q = {"q2": 0.37, "q3": -0.81, "q5": 1.3, "c": 0.23, "L": 0.7}
ANGLES = (  # q2, q3, q2 + q3, q2 - q3 - c
    (((2, 1),), ZERO),
    (((3, 1),), ZERO),
    (((2, 1), (3, 1)), ZERO),
    (((2, 1), (3, -1)), -Expression.symbol("c")),
)


def made(angles, limit: int = 10_000) -> tuple[Expansion, list[Any]]:
    """An expansion with the polynomials of L, q5, and the cosine and sine of each angle."""
    algebra = GraphAlgebra(ROBOT)
    nodes = [algebra.graph.symbol("L"), algebra.q(5)]
    for turn, rest in angles:
        nodes += algebra.cos_sin(turn, rest)
    expansion = Expansion(algebra, (), nodes, limit)
    return expansion, [expansion.of(node) for node in nodes]


@cache
def ring() -> tuple[Expansion, list[Any]]:
    return made(ANGLES)


def value(expansion: Expansion, a: Any, q: dict[str, float]) -> float:
    x = dict(q)
    for (turn, rest), names in expansion.names.items():
        for name, f in zip(names, (math.cos, math.sin), strict=True):
            x[str(name)] = f(sum(n * q[f"q{j}"] for j, n in turn) + rest.value(q))
    at = [x[str(name)] for name in expansion.shown]
    return sum(
        float(c) * math.prod(v**n for v, n in zip(at, m, strict=True))
        for coefficient in a.values()
        for m, c in coefficient.items()
    )


def drawn(expansion: Expansion, units: list[Any], rng: np.random.Generator) -> Any:
    a = expansion.ring(0)
    for _ in range(6):
        term = expansion.ring(int(rng.integers(-2, 3)) or 1)
        for unit in rng.choice(len(units), 4):
            term = expansion.mul(term, units[int(unit)])
        a += term
    return a


@pytest.mark.parametrize("seed", range(40))
def test_tidy(seed: int) -> None:
    expansion, units = ring()
    rng = np.random.default_rng(seed)
    a = drawn(expansion, units, rng)
    for polynomial in (a, expansion.mul(a, drawn(expansion, units, rng))):
        short = expansion.tidied(polynomial)
        assert sum(map(len, short.values())) <= sum(map(len, polynomial.values()))
        assert value(expansion, short, Q) == pytest.approx(
            value(expansion, polynomial, Q), rel=1e-12, abs=1e-12
        )


def test_textbook_identities() -> None:
    expansion, (_, _, c2, s2, c3, s3, c23, s23, *_) = ring()
    tidied = expansion.tidied
    assert tidied(c2 * c3 - s2 * s3) == c23
    assert tidied(5 * s2 * c3 + 5 * c2 * s3) == 5 * s23
    assert tidied(c2 * c23 + s2 * s23) == c3
    assert tidied(3 - 3 * c2**2) == 3 * s2**2
    assert expansion.mul(s2, s2) == 1 - c2**2


def test_quarter_turns_in_a_sum() -> None:
    """cos(q2 + pi/4) cos(q3 + pi/4) - sin sin = cos(q2 + q3 + pi/2) = -sin(q2 + q3)."""
    quarter = PI * Expression.number("0.25")
    expansion, (_, _, ca, sa, cb, sb, _, s) = made(
        [(((2, 1),), quarter), (((3, 1),), quarter), (((2, 1), (3, 1)), ZERO)]
    )
    assert expansion.tidied(ca * cb - sa * sb) == -s


def test_determinant() -> None:
    expansion, units = ring()
    rng = np.random.default_rng(2)
    rows = [
        [
            drawn(expansion, units[2:6], rng) if rng.random() < 0.7 else expansion.ring(0)
            for _ in range(4)
        ]
        for _ in range(4)
    ]
    numbers = np.array([[value(expansion, a, Q) for a in row] for row in rows])
    assert value(expansion, expansion.determinant(rows), Q) == pytest.approx(
        np.linalg.det(numbers), rel=1e-10
    )


def test_limits() -> None:
    expansion, (L, q5, c2, _, c3, *_) = made(ANGLES, limit=3)
    with pytest.raises(TooManyTermsError):
        expansion.mul(L + 1 + q5, c2 + c3)
