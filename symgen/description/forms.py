"""Linear and quadratic forms in the joint positions q1, q2, ..., read off an Expression."""

from __future__ import annotations

import re
from fractions import Fraction

from symgen.description.expression import Expression


def row_of(e: Expression, joints: tuple[int, ...]) -> dict[int, Expression]:
    """The row G of s = G q; raises ValueError if the expression is not linear and homogeneous in the q's."""
    row = {j: e.coefficient(f"q{j}") for j in joints}
    rest = e
    for j, c in row.items():
        rest = rest - c * Expression.symbol(f"q{j}")
    if rest or any(moves(c) for c in row.values()):
        raise ValueError(f"{e} is not a combination of joint positions such as q5 + q6 or 2*q3")
    return {j: c for j, c in row.items() if c}


def form_of(e: Expression, joints: tuple[int, ...]) -> dict[tuple[int, int], Expression]:
    """The symmetric matrix B of the quadratic form q' B q; raises ValueError if the expression is not one."""
    form: dict[tuple[int, int], Expression] = {}
    rest = e
    for i in joints:
        for j in joints:
            if i > j:
                continue
            c = e.coefficient(f"q{i}", f"q{j}")
            rest = rest - c * Expression.symbol(f"q{i}") * Expression.symbol(f"q{j}")
            if c:
                half = c if i == j else c * Fraction(1, 2)
                form[i, j] = form[j, i] = half
    if rest or any(moves(c) for c in form.values()):
        raise ValueError(f"{e} is not a quadratic form in the joint positions such as q6**2 + 2*q5*q6")
    return form


def moves(c: Expression) -> bool:
    """Whether a joint position occurs in `c`."""
    return any(re.fullmatch(r"q\d+", name) for name in c.symbols)


def determinant(matrix: tuple[tuple[float, ...], ...]) -> Fraction:
    """Exact determinant of a square matrix of floats."""
    a = [[Fraction(x) for x in row] for row in matrix]
    det = Fraction(1)
    for k in range(len(a)):
        pivot = next((i for i in range(k, len(a)) if a[i][k]), None)
        if pivot is None:
            return Fraction(0)
        if pivot != k:
            a[k], a[pivot], det = a[pivot], a[k], -det
        det *= a[k][k]
        for i in range(k + 1, len(a)):
            if factor := a[i][k] / a[k][k]:
                a[i] = [x - factor * y for x, y in zip(a[i], a[k], strict=True)]
    return det
