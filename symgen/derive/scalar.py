"""Vectors and matrices whose components are nodes of the expression graph.

A scalar is a node of the graph with a sign, a constant expression, or any other object with + - *
and unary minus. The Python integers 0, 1 and -1 cost nothing: a sum with 0 or a product with 0, 1
or -1 is simplified at once and makes no node of the graph.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from symgen.derive.graph import Turn
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.expression import Expression

K = TypeVar("K")
Scalar = Any
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]  # rows

ZERO3: Vector = (0, 0, 0)
E3: Vector = (0, 0, 1)


def is_zero(v: Vector) -> bool:
    """Whether every component of v is the Python integer 0, so that v vanishes identically."""
    return all(x == 0 for x in v)


def dot(u: Sequence[Scalar], v: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0
    for a, b in zip(u, v, strict=True):
        total = total + a * b
    return total


def linear(algebra: GraphAlgebra, row: Mapping[K, Expression], x: Mapping[K, Scalar]) -> Scalar:
    """Return sum_i row_i x_i, with constant expressions row_i and scalars x_i."""
    return dot([algebra.constant(g) for g in row.values()], [x[i] for i in row])


def turned(algebra: GraphAlgebra, turn: Turn, x: Mapping[int, Scalar]) -> Scalar:
    """Return sum_j n_j x_j for the pairs (j, n_j) of `turn`; a joint j missing in x counts as 0."""
    row = {j: Expression.number(n) for j, n in turn}
    return linear(algebra, row, {j: x.get(j, 0) for j in row})


def cross(u: Vector, v: Vector) -> Vector:
    return (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )


def vadd(u: Vector, v: Vector) -> Vector:
    return (u[0] + v[0], u[1] + v[1], u[2] + v[2])


def scale(s: Scalar, u: Vector) -> Vector:
    return (s * u[0], s * u[1], s * u[2])


def apply(m: Matrix, u: Vector) -> Vector:
    """Return the product M u of a 3x3 matrix M and a vector u."""
    return (dot(m[0], u), dot(m[1], u), dot(m[2], u))


def apply_transposed(m: Matrix, u: Vector) -> Vector:
    """Return the product M' u of the transpose of a 3x3 matrix M and a vector u."""
    return (
        dot((m[0][0], m[1][0], m[2][0]), u),
        dot((m[0][1], m[1][1], m[2][1]), u),
        dot((m[0][2], m[1][2], m[2][2]), u),
    )
