"""Linear algebra modulo a prime p: echelon form, linear systems, conversion to small fractions."""

from __future__ import annotations

from fractions import Fraction
from math import gcd

import numpy as np

from symgen.derive.exact import Array, power


def rref(M: Array, p: int) -> tuple[list[int], Array]:
    """Compute the reduced row echelon form of M modulo a prime p.

    Return the pivot columns, leftmost first, and the rows with pivots, shape (rank, columns). The
    relations between the columns give them: a column has a pivot unless it is the last one of a
    relation, and the entries of such a column are the coefficients of that relation. So the time
    is that of `echelon`, and of the few relations.
    """
    K = _relations(M, p)[:, ::-1]  # the last column of a relation first
    last, K = echelon(K, p)
    for k in reversed(range(len(last))):
        K[:k] = (K[:k] + (p - K[:k, last[k], None]) * K[k]) % p
    dependent = M.shape[1] - 1 - np.array(last, dtype=int)
    pivots = np.setdiff1d(np.arange(M.shape[1]), dependent)
    R = np.zeros((len(pivots), M.shape[1]), dtype=np.int64)
    R[np.arange(len(pivots)), pivots] = 1
    R[:, dependent] = -K[:, ::-1][:, pivots].T % p
    return pivots.tolist(), R


def rank(M: Array, p: int) -> int:
    """Compute the rank of M modulo a prime p."""
    return len(echelon(M[:, ::-1], p)[0])


def _relations(M: Array, p: int) -> Array:
    """Return K, shape (columns - rank, columns), with M K' = 0 modulo a prime p."""
    pivots, U = echelon(M[:, ::-1], p)
    free = np.setdiff1d(np.arange(M.shape[1]), pivots)
    K = np.zeros((len(free), M.shape[1]), dtype=np.int64)
    K[np.arange(len(free)), free] = 1
    for c, row in zip(reversed(pivots), U[::-1], strict=True):
        entries = c + 1 + np.flatnonzero(row[c + 1 :])
        K[:, c] = -(K[:, entries] * row[entries] % p).sum(axis=1) % p
    return K[:, ::-1]


def echelon(M: Array, p: int) -> tuple[list[int], Array]:
    """Compute a row echelon form of M modulo a prime p, whose pivots are 1.

    Return the pivot columns, leftmost first, and the rows with pivots, shape (rank, columns). Rows
    with few nonzero entries are used first, and only the columns of these entries are changed. In a
    tree the last links come first where the columns run from the tips to the base: each pivot row
    then has the columns of one link, and the time grows with the number of nonzero entries.
    """
    M = M[np.argsort(np.count_nonzero(M, axis=1), kind="stable")] % p
    left = np.ones(len(M), dtype=bool)
    pivots: list[int] = []
    order: list[int] = []
    for c in range(M.shape[1]):
        rows = np.flatnonzero(left & (M[:, c] != 0))
        if rows.size == 0:
            continue
        r, touched = int(rows[0]), rows[1:]
        left[r] = False
        pivots.append(c)
        order.append(r)
        entries = c + np.flatnonzero(M[r, c:])
        pivot = M[r, entries] * pow(int(M[r, c]), -1, p) % p
        M[r, entries] = pivot
        if 2 * entries.size > M.shape[1] - c:
            pivot, entries = M[r, c:], np.arange(c, M.shape[1])
        place = np.ix_(touched, entries) if entries.size < M.shape[1] - c else np.s_[touched, c:]
        M[place] = (M[place] + (p - M[touched, c])[:, None] * pivot) % p
        if len(order) == len(M):
            break
    return pivots, M[order]


def solve_each(W: Array, p: int, rng: np.random.Generator) -> Array | None:
    """Solve linear systems modulo p, one for each index g: W[g, :, :-1] beta[g] = W[g, :, -1] for
    beta.

    Return beta, shape (G, columns - 1), or None unless all systems are consistent. Random
    combinations of the rows make pivoting unnecessary. There are three more combinations than
    unknowns, to check consistency.
    """
    count, rows, columns = W.shape
    unknowns = columns - 1
    mix = rng.integers(1, p, (unknowns + 3, rows))
    M = np.zeros((count, unknowns + 3, columns), dtype=np.int64)
    for r in range(rows):
        M = (M + mix[None, :, r, None] * W[:, None, r, :]) % p
    for c in range(unknowns):
        if not M[:, c, c].all():
            return None
        M[:, c, c:] = M[:, c, c:] * power(M[:, c, c], p - 2, p)[:, None] % p
        factor = M[:, :, c].copy()
        factor[:, c] = 0
        M[:, :, c:] = (M[:, :, c:] - factor[:, :, None] * M[:, c, None, c:]) % p
    return None if M[:, unknowns:, unknowns].any() else M[:, :unknowns, unknowns]


def small_rational(x: int, p: int, bound: int = 30) -> Fraction | None:
    """Find the fraction a/b with |a|, b <= bound that equals x mod p, by Wang's reconstruction.

    Return None if there is no such fraction. A random residue of 31 bits is such a fraction with a
    probability of one in two million for the bound 30, and one in two thousand for the bound 1000.
    """
    r0, r1, t0, t1 = p, x % p, 0, 1
    while r1 > bound:
        quotient = r0 // r1
        r0, r1, t0, t1 = r1, r0 - quotient * r1, t1, t0 - quotient * t1
    if t1 == 0 or abs(t1) > bound or gcd(r1, abs(t1)) != 1:
        return None
    return Fraction(r1 if t1 > 0 else -r1, abs(t1))
