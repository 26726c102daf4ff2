"""Echelon forms over F_p against those of SymPy, on matrices of every rank with many zeros."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import GF
from sympy.polys.matrices import DomainMatrix

from symgen.regroup.finite_field import rank, rref

P = 2147483647


@pytest.mark.parametrize("seed", range(60))
def test_reduced_form_and_rank_are_those_of_sympy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, columns, inner = rng.integers(1, 12, 3)
    A, B = (
        rng.integers(0, P, shape, dtype=np.int64) * (rng.random(shape) < 0.5)
        for shape in ((rows, inner), (inner, columns))
    )
    M = (A[:, :, None] * B % P).sum(axis=1) % P
    field = GF(P, symmetric=False)
    expected, at = DomainMatrix([[field(int(x)) for x in row] for row in M], M.shape, field).rref()
    pivots, R = rref(M, P)
    assert pivots == list(at) and rank(M, P) == len(at)
    assert [[int(x) % P for x in row] for row in expected.to_list()[: len(at)]] == R.tolist()
