"""Polynomials in cosines and sines: tidying and differentiating keep the function; determinants are those of numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from symgen.description.expression import PI, ZERO, Expression
from symgen.errors import SymgenError
from symgen.symbols.polynomial import Polynomial, Ring, TooManyTermsError

C = Expression.symbol("c")
Q = {"q2": 0.37, "q3": -0.81, "c": 0.23}


def ring() -> tuple[Ring, list[int]]:
    """q2, q3, q2 + q3, q3 - q2 + c as angles, D and the slide q5 as symbols."""
    made = Ring(10_000)
    units = [made.atom("D", (1,)), made.atom("q5", (2,))]
    for label, turn, rest in (
        ("2", ((2, 1),), ZERO),
        ("3", ((3, 1),), ZERO),
        ("23", ((2, 1), (3, 1)), ZERO),
        ("2m3", ((2, 1), (3, -1)), -C),
    ):
        angle = made.angle(turn, rest, label)
        units += [angle.cos, angle.sin]
    return made, units


def value(made: Ring, a: Polynomial, q: dict[str, float]) -> float:
    x = {"D": 0.7, "q5": q.get("q5", 1.3)}
    for (turn, rest), angle in made.angles.items():
        t = sum(n * q[f"q{j}"] for j, n in turn) + rest.value(q)
        for unit, f in ((angle.cos, math.cos(t)), (angle.sin, math.sin(t))):
            ((k, _),) = made.powers(unit).items()
            x[str(made.atoms[k].base)] = f
    return sum(float(c) * math.prod(x[str(made.atoms[k].base)] ** n for k, n in made.powers(m).items()) for m, c in a.items())


def drawn(made: Ring, units: list[int], rng: np.random.Generator) -> Polynomial:
    a: Polynomial = {}
    for _ in range(6):
        term: Polynomial = {0: int(rng.integers(-2, 3)) or 1}
        for unit in rng.choice(len(units), 4):
            term = made.mul(term, {units[int(unit)]: 1})
        a = made.add(a, term)
    return a


@pytest.mark.parametrize("seed", range(40))
def test_tidy_and_derivative(seed: int) -> None:
    made, units = ring()
    rng = np.random.default_rng(seed)
    a = drawn(made, units, rng)
    product = made.mul(a, drawn(made, units, rng))
    for polynomial in (a, product):
        short = made.tidy(polynomial)
        assert len(short) <= len(polynomial)
        assert value(made, short, Q) == pytest.approx(value(made, polynomial, Q), rel=1e-12, abs=1e-12)
    h = 1e-6
    for name, j in (("q2", 2), ("q3", 3), ("q5", 5)):
        at = {**Q, "q5": 1.3}
        slope = (value(made, a, at | {name: at[name] + h}) - value(made, a, at | {name: at[name] - h})) / (2 * h)
        assert value(made, made.derivative(a, name, j), at) == pytest.approx(slope, rel=1e-6, abs=1e-7)


def test_textbook_identities() -> None:
    made, (_, _, c2, s2, c3, s3, c23, s23, *_) = ring()
    assert made.tidy(made.add({c2 + c3: 1}, {s2 + s3: 1}, -1)) == {c23: 1}
    assert made.tidy(made.add({s2 + c3: 5}, {c2 + s3: 5})) == {s23: 5}
    assert made.tidy(made.add({c2 + c23: 1}, {s2 + s23: 1})) == {c3: 1}
    assert made.tidy({0: 3, 2 * c2: -3}) == {2 * s2: 3}
    assert made.mul({s2: 1}, {s2: 1}) == {0: 1, 2 * c2: -1}


def test_quarter_turns_in_a_sum() -> None:
    """cos(q2 + pi/4) cos(q3 + pi/4) - sin sin = cos(q2 + q3 + pi/2) = -sin(q2 + q3)."""
    made = Ring(100)
    quarter = PI * Expression.number("0.25")
    a, b, total = made.angle(((2, 1),), quarter, "2"), made.angle(((3, 1),), quarter, "3"), made.angle(((2, 1), (3, 1)), ZERO, "23")
    assert made.tidy({a.cos + b.cos: 1, a.sin + b.sin: -1}) == {total.sin: -1}


def test_determinant() -> None:
    made, units = ring()
    rng = np.random.default_rng(2)
    rows = [[drawn(made, units[2:6], rng) if rng.random() < 0.7 else {} for _ in range(4)] for _ in range(4)]
    numbers = np.array([[value(made, a, Q) for a in row] for row in rows])
    assert value(made, made.determinant(rows), Q) == pytest.approx(np.linalg.det(numbers), rel=1e-10)


def test_limits() -> None:
    made, units = ring()
    made.limit = 3
    with pytest.raises(TooManyTermsError):
        made.mul({units[0]: 1, 0: 1, units[1]: 1}, {units[2]: 1, units[4]: 1})
    made.limit = 10_000
    a: Polynomial = {units[0]: 1}
    with pytest.raises(SymgenError, match="a power above 127"):
        for _ in range(8):
            a = made.mul(a, a)
