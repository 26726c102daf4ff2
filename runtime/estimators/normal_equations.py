"""Normal equations joint by joint, with refinement: the cheapest least squares, for matrices that
are not too ill-conditioned.

    A = sum_j W_j'W_j,   g = sum_j W_j'Y_j
            over the columns C_j that act on joint j, nothing else is multiplied
    D = diag(A)^-1/2,    D A D = L L',   X = D (L L')^-1 D g
    refinement           X + A^-1 sum_j W_j'(Y_j - W_j X)

With kappa the condition number of W with unit columns (Cholesky does not care how columns are
scaled), the first X is off by about kappa^2 eps and
each refinement multiplies the error by that, down to the level of an orthogonal factorisation.
kappa = rcond^(-1/2), rcond of D A D in the
1-norm as LAPACK's pocon estimates it. Where kappa reaches LIMIT.NORMAL_EQUATIONS, or A is not
positive definite, the structured triangular factor is used instead (`runtime.rows.factor`), and the
result says so.

The rows are those of a resolution study, read in C (`runtime.resolution.c.least_squares`).

References: Golub and Van Loan, Matrix Computations, sections 5.3 and 5.3.8; Higham, Accuracy and
Stability of Numerical Algorithms, chapters 12 and 20.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg.lapack import dpocon, dpotrf, dpotrs

from runtime.rows.factor import Array

Method = Literal["normal equations", "triangular factor"]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Least-squares solution of the rows of a resolution study.

    X : ndarray, shape (b,).   residual_norms : ||Y_j - W_j X|| by joint, N m (N), shape (n,).
    kappa : condition number of W with unit columns, estimated where `method` is "normal equations".
    """

    X: Array
    residual_norms: Array
    kappa: float
    method: Method


@dataclass(frozen=True, eq=False)
class JointEquations:
    """Normal equations of [W Y] by joint.

    columns : C_j, by joint.   grams : Gram matrix of [W_j[:, C_j] Y_j], shape (|C_j| + 1, |C_j| +
                               1), by joint.   b : number of columns of W.
    """

    columns: tuple[Array, ...]
    grams: tuple[Array, ...]
    b: int

    @property
    def A(self) -> Array:
        """W'W, shape (b, b)."""
        A = np.zeros((self.b, self.b))
        for C, gram in zip(self.columns, self.grams, strict=True):
            A[C[:, None], C] += gram[:-1, :-1]
        return A

    @property
    def g(self) -> Array:
        """W'Y, shape (b,)."""
        return self.scattered([gram[:-1, -1] for gram in self.grams])

    def scattered(self, parts: Sequence[Array]) -> Array:
        """Sum, shape (b,), of vectors over the columns of each joint."""
        total = np.zeros(self.b)
        for C, part in zip(self.columns, parts, strict=True):
            total[C] += part
        return total

    def cholesky(self) -> Cholesky | None:
        """Factor of the scaled A; None where it is not positive definite to working precision."""
        A = self.A
        diagonal = np.diag(A)
        if not (diagonal > 0).all():
            return None
        D = 1 / np.sqrt(diagonal)
        scaled = A * D * D[:, None]
        L, failed = dpotrf(scaled, lower=1)
        if failed:
            return None
        rcond, _ = dpocon(L, np.abs(scaled).sum(axis=0).max(), uplo="L")
        return Cholesky(L, D, float(1 / np.sqrt(rcond)) if rcond > 0 else np.inf)


@dataclass(frozen=True, eq=False)
class Cholesky:
    """D A D = L L', and kappa of W with unit columns."""

    L: Array
    D: Array
    kappa: float

    def solve(self, g: Array) -> Array:
        """A^-1 g."""
        return np.asarray(self.D * dpotrs(self.L, self.D * g, lower=1)[0])
