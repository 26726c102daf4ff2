"""Linear algebra over F_p: rank, reduced echelon form, small rationals from residues."""

from __future__ import annotations

from fractions import Fraction
from math import gcd

import numpy as np

from symgen.derive.exact import Array, power


def rref(M: Array, p: int) -> tuple[list[int], Array]:
    """Pivot columns (leftmost first) and the reduced rows, shape (rank, columns), of M over F_p."""
    M = M % p
    pivots: list[int] = []
    rank, (rows, columns) = 0, M.shape
    for c in range(columns):
        below = np.flatnonzero(M[rank:, c])
        if below.size == 0:
            continue
        r = rank + int(below[0])
        if r != rank:
            M[[rank, r]] = M[[r, rank]]
        M[rank, c:] = M[rank, c:] * pow(int(M[rank, c]), -1, p) % p
        factor = M[:, c].copy()
        factor[rank] = 0
        touched = np.flatnonzero(factor)
        if touched.size:
            M[touched, c:] = (M[touched, c:] - factor[touched, None] * M[rank, c:] % p) % p
        pivots.append(c)
        rank += 1
        if rank == rows:
            break
    return pivots, M[:rank]


def solve_each(W: Array, p: int, rng: np.random.Generator) -> Array | None:
    """beta with W[g, :, -1] = W[g, :, :-1] beta[g] for every g at once, shape (G, columns - 1); None unless all are consistent.

    Random combinations of the rows need no pivoting; three more than unknowns, which must come out zero.
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


def small_rational(x: int, p: int, bound: int = 1000) -> Fraction | None:
    """The fraction a/b with |a|, b <= bound that equals x mod p, if there is one (Wang's reconstruction)."""
    r0, r1, t0, t1 = p, x % p, 0, 1
    while r1 > bound:
        quotient = r0 // r1
        r0, r1, t0, t1 = r1, r0 - quotient * r1, t1, t0 - quotient * t1
    if t1 == 0 or abs(t1) > bound or gcd(r1, abs(t1)) != 1:
        return None
    return Fraction(r1 if t1 > 0 else -r1, abs(t1))
