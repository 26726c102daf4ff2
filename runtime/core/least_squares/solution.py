"""Least squares from a triangular factor, with its rank and the parameters that it cannot separate.

With D the norms of the columns of W, R_11 D^-1 = U diag(s) V' is the singular value decomposition
of a (b, b) matrix. Judged on unit columns, rank is the number of s_i above tolerance * s_1. If the
rank is full, eq. (7) is solved by back substitution, (W'W)^-1 = T T' with T = R_11^-1. Otherwise
the solution is that of least norm in the units of D, T = D^-1 V_1 diag(1/s_1), and P = V_2 V_2',
the projector on the directions that leave W X unchanged, names the parameters: i and k are in one
group if P_ik is not zero.

Reference: Gautier (1991) for rank and groups by orthogonal factorisation; Golub and Van Loan,
section 5.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse.csgraph import connected_components

from runtime.core.rows.factor import Array, Factor, triangularise
from runtime.ground.limits import LIMIT


@dataclass(frozen=True)
class Solution:
    """Least-squares solution X from the triangular factor of [W Y], with the rank of W.

    Attributes
    ----------
    X : ndarray, shape (b,), SI
        Parameters.
    T : ndarray, shape (b, rank)
        T T' = (W'W)^-1, on the determined directions when rank < b.
    residual_norm : float
        ||Y - W X|| of the factored system, weighted if the rows of the system are.
    rank : int
        Numerical rank of W with unit columns.
    cond_unit : float
        Condition number of W with unit columns.
    groups : tuple of tuples of str
        Names that this record cannot separate; a group of one has no effect on the rows.
    """

    X: Array
    T: Array
    residual_norm: float
    rank: int
    cond_unit: float
    groups: tuple[tuple[str, ...], ...]


def unit_columns(R11: Array) -> tuple[Array, Array]:
    """Scale the columns of the QR factor R_11 of W to norm 1; return the result and the norms.

    A zero column stays zero, with norm 1.
    """
    norms = np.linalg.norm(R11, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    return R11 / norms, norms


def rank_tolerance(factor: Factor) -> float:
    """Compute the default limit of s_i/s_1 above which a singular value s_i counts in the rank.

    The limit is the number of rows times the unit round-off.
    """
    return float(max(factor.rows, len(factor.names)) * np.finfo(float).eps)


def solve(factor: Factor, tolerance: float | None = None) -> Solution:
    """Compute the least-squares solution X from the QR factor of [W Y], for any rank of W.

    tolerance : smallest s_i / s_1 (unit columns) that counts as rank; default
    `rank_tolerance(factor)`.
    """
    b = len(factor.names)
    tolerance = rank_tolerance(factor) if tolerance is None else tolerance
    if b == 0:
        return Solution(np.zeros(0), np.zeros((0, 0)), factor.r22, 0, 1.0, ())
    R, D = unit_columns(factor.R11)
    U, s, Vt = np.linalg.svd(R)
    rank = int(np.count_nonzero(s > tolerance * s[0]))
    if rank == b:
        X = solve_triangular(factor.R11, factor.r12)
        T = solve_triangular(factor.R11, np.eye(b))
        return Solution(X, T, factor.r22, b, float(s[0] / s[-1]), ())
    T = Vt[:rank].T / s[:rank] / D[:, None]
    z = U[:, :rank].T @ factor.r12
    residual = float(np.hypot(factor.r22, np.linalg.norm(U[:, rank:].T @ factor.r12)))
    return Solution(T @ z, T, residual, rank, np.inf, null_groups(Vt[rank:], factor.names))


def null_groups(V2t: Array, names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Group the parameters that the record cannot separate, from the null space of W.

    V2t, shape (b - rank, b), has the null directions as orthonormal rows. A group contains names
    whose entries of P = V_2 V_2' (diagonal: its square root) are not nearly zero (above
    NULL_PARTICIPATION in limits.toml).
    """
    P = V2t.T @ V2t
    part = np.flatnonzero(np.sqrt(np.diag(P)) > LIMIT.NULL_PARTICIPATION)
    count, label = connected_components(
        np.abs(P[np.ix_(part, part)]) > LIMIT.NULL_PARTICIPATION, directed=False
    )
    return tuple(tuple(names[i] for i in part[label == g]) for g in range(count))


def joint_scatter(factor: Factor, tolerance: float | None = None) -> Array:
    """Compute the residual standard deviation s_j of each joint, with X fitted to this joint only.

        s_j^2 = ||Y_j - W_j X_j||^2 / (N_j - b_j)

    X_j is fitted to the rows of joint j only, and b_j = rank(W_j) with unit columns.
    The shape is (n,); nan if a joint has no more rows than b_j.
    """
    scatter = []
    for joint in factor.joints:
        names = tuple(factor.names[i] for i in joint.columns)
        fit = solve(Factor(names, triangularise(joint.R), (joint,)), tolerance)
        freedom = joint.rows - fit.rank
        scatter.append(fit.residual_norm / np.sqrt(freedom) if freedom > 0 else np.nan)
    return np.array(scatter)
