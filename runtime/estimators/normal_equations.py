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

The rows come as blocks: for every block a list over the joints of [W_j[:, C_j] Y_j]', shape (|C_j|
+ 1, B), read once per pass.

References: Golub and Van Loan, Matrix Computations, sections 5.3 and 5.3.8; Higham, Accuracy and
Stability of Numerical Algorithms, chapters 12 and 20.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg.lapack import dpocon, dpotrf, dpotrs

from runtime.estimators.solution import solve
from runtime.limits import LIMIT
from runtime.rows.factor import Array, Factor, JointFactor
from runtime.rows.segments import RowsFactor

Block = Sequence[Array]
"""Rows of one block, by joint: [W_j[:, C_j] Y_j]', shape (|C_j| + 1, B)."""
Method = Literal["normal equations", "triangular factor"]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Least-squares solution of rows that were read in blocks.

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


def normal(blocks: Iterable[Block], columns: Sequence[Array], b: int) -> JointEquations:
    """Normal equations of all blocks."""
    grams = [np.zeros((len(C) + 1, len(C) + 1)) for C in columns]
    for block in blocks:
        for gram, rows in zip(grams, block, strict=True):
            gram += rows @ rows.T
    return JointEquations(tuple(columns), tuple(grams), b)


def least_squares(
    blocks: Callable[[], Iterable[Block]],
    columns: Sequence[Array],
    b: int,
    *,
    refinements: int = 1,
    limit: float = LIMIT.NORMAL_EQUATIONS,
) -> LeastSquares:
    """X = argmin ||Y - W X|| by normal equations and `refinements`, by the triangular factor where
    kappa reaches `limit`.

    blocks : called once per pass.   columns : C_j by joint, positions among the b columns.
    """
    equations = normal(blocks(), columns, b)
    factor = equations.cholesky()
    if factor is None or not factor.kappa < limit:
        return _by_triangular_factor(blocks, columns, b)
    X = factor.solve(equations.g)
    squares = _squares(equations, X)
    for _ in range(refinements):
        g, squares = _gradient(blocks(), equations, X)
        step = factor.solve(equations.scattered(g))
        X, squares = X + step, squares + _change(equations, g, step)
    return LeastSquares(X, np.sqrt(np.maximum(squares, 0.0)), factor.kappa, "normal equations")


def triangular(blocks: Iterable[Block], columns: Sequence[Array], names: Sequence[str]) -> Factor:
    """Structured triangular factor of [W Y], updated block by block: R_j = R factor of [R_j; new
    rows of joint j].
    """
    joints = [RowsFactor(len(C) + 1) for C in columns]
    for block in blocks:
        for joint, rows in zip(joints, block, strict=True):
            joint.take(rows)
    return Factor.of(
        names,
        [
            JointFactor(np.asarray(C), joint.factor(), joint.count)
            for C, joint in zip(columns, joints, strict=True)
        ],
    )


def _by_triangular_factor(
    blocks: Callable[[], Iterable[Block]], columns: Sequence[Array], b: int
) -> LeastSquares:
    factor = triangular(blocks(), columns, [str(k) for k in range(b)])
    fit = solve(factor)
    return LeastSquares(
        fit.X,
        np.array([joint.residual_norm(fit.X) for joint in factor.joints]),
        fit.cond_unit,
        "triangular factor",
    )


def _gradient(
    blocks: Iterable[Block], equations: JointEquations, X: Array
) -> tuple[list[Array], Array]:
    """W_j'(Y_j - W_j X) and ||Y_j - W_j X||^2 by joint, from the rows themselves."""
    weights = [np.append(-X[C], 1.0) for C in equations.columns]
    g, squares = [np.zeros(len(C)) for C in equations.columns], np.zeros(len(weights))
    for block in blocks:
        for j, rows in enumerate(block):
            r = weights[j] @ rows
            g[j] += rows[:-1] @ r
            squares[j] += r @ r
    return g, squares


def _change(equations: JointEquations, g: Sequence[Array], step: Array) -> Array:
    """||r_j - W_j step||^2 - ||r_j||^2 = step'A_j step - 2 step'g_j by joint: small beside
    ||r_j||^2, so nothing cancels.
    """
    parts = zip(equations.columns, equations.grams, g, strict=True)
    return np.array(
        [step[C] @ gram[:-1, :-1] @ step[C] - 2 * step[C] @ g_j for C, gram, g_j in parts]
    )


def _squares(equations: JointEquations, X: Array) -> Array:
    """||Y_j - W_j X||^2 from the Gram matrices: without a refinement, exact to eps
    ||Y_j||^2 only.
    """
    weights = [np.append(-X[C], 1.0) for C in equations.columns]
    return np.array([w @ gram @ w for w, gram in zip(weights, equations.grams, strict=True)])
