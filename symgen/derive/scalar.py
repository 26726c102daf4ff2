"""Vectors and matrices whose components are nodes of the expression graph.

A scalar is a node of the graph with a sign, a constant expression, or any other object with + - *
and unary minus. The Python integers 0, 1 and -1 cost nothing: a sum with 0 or a product with 0, 1
or -1 is simplified at once and makes no node of the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np

from symgen.derive.graph import Turn
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.description.expression import Expression

K = TypeVar("K")
Scalar = Any
Vector = np.ndarray  # of three scalars
Matrix = np.ndarray  # of three rows


def array(entries: Any) -> Vector:
    """Return a vector of scalars, or a matrix from its rows; + - * and @ act on the scalars.

    It cannot be changed in place, because several links may share it.
    """
    made = np.array(entries, dtype=object)
    made.flags.writeable = False
    return made


ZERO3, E3 = array((0, 0, 0)), array((0, 0, 1))
IDENTITY = array(((1, 0, 0), (0, 1, 0), (0, 0, 1)))


def is_zero(v: Iterable[Scalar]) -> bool:
    """Whether every component of v is the Python integer 0, so that v vanishes identically."""
    return all(x == 0 for x in v)


def dot(u: Iterable[Scalar], v: Iterable[Scalar]) -> Scalar:
    total: Scalar = 0
    for a, b in zip(u, v, strict=True):
        total = total + a * b
    return total


def named_vector(
    algebra: GraphAlgebra, family: str, value: Iterable[Scalar], *indices: int
) -> Vector:
    """Name the components of a vector, such as W12 (component 1, link 2); return the vector."""
    named = algebra.named
    return array([algebra.name(x, named(family, k, *indices)) for k, x in enumerate(value, 1)])


def linear(algebra: GraphAlgebra, row: Mapping[K, Expression], x: Mapping[K, Scalar]) -> Scalar:
    """Return sum_i row_i x_i, with constant expressions row_i and scalars x_i."""
    return dot([algebra.constant(g) for g in row.values()], [x[i] for i in row])


def turned(algebra: GraphAlgebra, turn: Turn, x: Mapping[int, Scalar]) -> Scalar:
    """Return sum_j n_j x_j for the pairs (j, n_j) of `turn`; a joint j missing in x counts as 0."""
    row = {j: Expression.number(n) for j, n in turn}
    return linear(algebra, row, {j: x.get(j, 0) for j in row})


def cross(u: Vector, v: Vector) -> Vector:
    return array(
        (
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        )
    )
