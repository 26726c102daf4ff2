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

The rows are those of a run of a resolution study whose signals were made in C.

References: Golub and Van Loan, Matrix Computations, sections 5.3 and 5.3.8; Higham, Accuracy and
Stability of Numerical Algorithms, chapters 12 and 20.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg.lapack import dpocon, dpotrf, dpotrs

from runtime.estimators.solution import solve
from runtime.limits import LIMIT
from runtime.rows.factor import Array, Factor, JointFactor

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


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of [W Y] by joint.

    names : columns of W.   columns : C_j, by joint.
    rows : [W_j[:, C_j] Y_j]', by joint, shape (|C_j| + 1, rows of the joint).
    """

    names: tuple[str, ...]
    columns: tuple[Array, ...]
    rows: tuple[Array, ...]

    def normal(self) -> JointEquations:
        """The normal equations."""
        return JointEquations(self.columns, tuple(a @ a.T for a in self.rows), len(self.names))

    def residuals(self, X: Array) -> list[Array]:
        """Y_j - W_j X by joint."""
        return [a[-1] - X[C] @ a[:-1] for C, a in zip(self.columns, self.rows, strict=True)]

    def factor(self) -> Factor:
        """Structured triangular factor of [W Y]."""
        joints = [
            JointFactor(C, np.linalg.qr(a.T, mode="r"), a.shape[1])
            for C, a in zip(self.columns, self.rows, strict=True)
        ]
        return Factor.of(self.names, joints)


def least_squares(rows: JointRows, limit: float = LIMIT.NORMAL_EQUATIONS) -> LeastSquares:
    """X = argmin ||Y - W X|| by normal equations and one refinement; by the triangular factor where
    kappa reaches `limit`.

    The residual norms are those before the refinement: it changes them by less than kappa^2 eps
    squared.
    """
    equations = rows.normal()
    cholesky = equations.cholesky()
    if cholesky is None or not cholesky.kappa < limit:
        factor = rows.factor()
        fit = solve(factor)
        norms = np.array([joint.residual_norm(fit.X) for joint in factor.joints])
        return LeastSquares(fit.X, norms, fit.cond_unit, "triangular factor")
    X = cholesky.solve(equations.g)
    residuals = rows.residuals(X)
    gradients = [a[:-1] @ r for a, r in zip(rows.rows, residuals, strict=True)]
    norms = np.array([np.linalg.norm(r) for r in residuals])
    X += cholesky.solve(equations.scattered(gradients))
    return LeastSquares(X, norms, cholesky.kappa, "normal equations")
