"""Semidefinite programs over the standard parameters, as cone programs for Clarabel.

    closest     min ||R chi - z||^2 + weight D(chi)    subject to
            P >= least 1 of every condition, rows, chi in a Space
    extreme     min d'chi                              subject to  the same, ||R chi - z|| <= radius
    margin      max t                                  subject to
            P >= t 1 of every condition, rows, chi in a Space

Clarabel solves  min 1/2 x'Qx + c'x,  A x + s = b,  s in a product of cones. The unknowns x are w of
chi = origin + basis w, with sizes near one as
interior point methods want, then what the criterion adds: residuals y with y = R chi - z as an
equation, so that R is not squared (the euclidean
distance, of unknowns in units of their size, is). A symmetric matrix enters by the columns of its
upper triangle, entries off the diagonal times sqrt(2). K chi = X is a Space, not an equation, and
holds to
rounding. Clarabel is deterministic: same problem, same bits.

    entropic distance, without its constants     tr M - log det M,  M = L P L' with P0 = (L'L)^-1
    log det M = max sum_i log Z_ii               [[M, Z], [Z', diag(Z_ii)]] >= 0,
            Z lower triangular

Reference: Goulart and Chen (2024) for Clarabel; Boyd and Vandenberghe, Convex Optimization (2004),
for the cones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import null_space

from runtime.limits import LIMIT
from runtime.model.inertia import Condition

Array = np.ndarray
Distance = Literal["none", "euclidean", "entropic", "pullback"]

TOLERANCES = (
    (1e-12, 1e-11),
    (1e-9, 1e-9),
)  # of the gap and of the constraints, tried in this order
STATUS = {
    "Solved": "optimal",
    "AlmostSolved": "optimal_inaccurate",
    "PrimalInfeasible": "infeasible",
    "AlmostPrimalInfeasible": "infeasible_inaccurate",
    "DualInfeasible": "unbounded",
    "AlmostDualInfeasible": "unbounded_inaccurate",
}
SOLVED = ("optimal", "optimal_inaccurate")
# largest unknown, in units of its size: the problem of `margin` has a solution whatever K leaves


@dataclass(frozen=True, eq=False)
class LinearBounds:
    """lower <= A chi <= upper, one name per row; infinite where there is no bound."""

    names: tuple[str, ...]
    A: Array
    lower: Array
    upper: Array

    def without(self, name: str) -> LinearBounds:
        """The rows of other names."""
        kept = [k for k, own in enumerate(self.names) if own != name]
        return LinearBounds(
            tuple(self.names[k] for k in kept), self.A[kept], self.lower[kept], self.upper[kept]
        )


@dataclass(frozen=True, eq=False)
class Space:
    """chi = origin + basis w: origin (p,), basis (p, m)."""

    origin: Array
    basis: Array


def everything(scale: Array) -> Space:
    """Every chi, in units of `scale`, (p,)."""
    return Space(np.zeros(len(scale)), np.diag(scale))


def solutions(K: Array, X: Array, scale: Array) -> Space:
    """Every chi with K chi = X, K of full row rank."""
    return Space(
        scale * np.linalg.lstsq(K * scale, X, rcond=None)[0], scale[:, None] * null_space(K * scale)
    )


def within(space: Space, rows: LinearBounds) -> tuple[Space, LinearBounds]:
    """`space` with the rows that are equations fulfilled (nearest to that where they contradict
    it), and the other rows.
    """
    equal = rows.lower == rows.upper
    others = LinearBounds(
        tuple(n for n, e in zip(rows.names, equal, strict=True) if not e),
        *(x[~equal] for x in (rows.A, rows.lower, rows.upper)),
    )
    if not equal.any():
        return space, others
    A = rows.A[equal]
    origin = (
        space.origin
        + space.basis
        @ np.linalg.lstsq(A @ space.basis, rows.lower[equal] - A @ space.origin, rcond=None)[0]
    )
    return Space(origin, space.basis @ null_space(A @ space.basis)), others


@dataclass(frozen=True, eq=False)
class Prior:
    """Pull of the inertial parameters towards chi0.

    Attributes
    ----------
    kind : str
        Distance D.
    chi0 : ndarray, shape (p,), SI
        Where they are pulled to.
    scale : ndarray, shape (p,), SI
        Units of the euclidean distance.
    numbers : tuple of int
        Numbers of the inertial parameters among the p.
    weight : float
        Weight of D.
    """

    kind: Distance
    chi0: Array
    scale: Array
    numbers: tuple[int, ...]
    weight: float


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of a program.

    Attributes
    ----------
    status : str
        "optimal", "optimal_inaccurate", "infeasible", ..., or the solver's own word.
    chi : ndarray, shape (p,), SI
        Standard parameters; nan without solution.
    margin : float, SI
        t of a problem of `margin`; nan of others.
    duals : mapping of str to float
        Trace of the multiplier of each condition, their sum 1 in a problem of `margin`: what stands
        in the way.
    """

    status: str
    chi: Array
    margin: float
    duals: Mapping[str, float]

    @property
    def solved(self) -> bool:
        """Whether there is a chi."""
        return self.status in SOLVED


class Program:
    """A cone program in w of chi = origin + basis w and `more` further unknowns, built constraint
    by constraint.
    """

    def __init__(self, space: Space, more: int) -> None:
        self.space, self.m = space, space.basis.shape[1]
        self.quadratic, self.linear = (
            np.zeros((self.m + more, self.m + more)),
            np.zeros(self.m + more),
        )
        self.constraints: list[tuple[Any, Array, Array]] = []  # cone, A, b: b + A x in the cone
        self.multipliers: dict[str, slice] = {}  # of each condition

    def unknowns(self, count: int) -> Array:
        """The matrix with which zeros stand for x in `count` rows."""
        return np.zeros((count, len(self.linear)))

    def of_chi(self, M: Array) -> tuple[Array, Array]:
        """M chi as A x + b, M of shape (k, p): A and b."""
        A = self.unknowns(len(M))
        A[:, : self.m] = M @ self.space.basis
        return A, M @ self.space.origin

    def conditions_hold(self, conditions: Sequence[Condition], least: float) -> None:
        """P >= least 1 of every condition; of least 0: P >= t 1, t the last unknown, in a problem
        of `margin`.
        """
        start = sum(len(b) for _, _, b in self.constraints)
        triangles, ones = _triangles(tuple(conditions), len(self.space.origin))
        A, b = self.of_chi(triangles)
        if not least:
            A[:, -1] = -ones
        b, end = b - least * ones, 0
        for c in conditions:
            n = c.B.shape[1]
            own = slice(end, end := end + n * (n + 1) // 2)
            self.constraints.append(
                (
                    clarabel.PSDTriangleConeT(n) if n > 1 else clarabel.NonnegativeConeT(1),
                    A[own],
                    b[own],
                )
            )
            self.multipliers[c.name] = slice(start + own.start, start + own.stop)

    def rows_hold(self, rows: LinearBounds) -> None:
        """lower <= A chi <= upper."""
        A, b = self.of_chi(rows.A)
        for sign, bound in ((1.0, rows.lower), (-1.0, rows.upper)):
            given = np.isfinite(bound)
            self.at_least_zero(sign * A[given], sign * (b - bound)[given])

    def within_ball(self, M: Array, z: Array, radius: float) -> None:
        """||M chi - z|| <= radius."""
        A, b = self.of_chi(M)
        self.constraints.append(
            (
                clarabel.SecondOrderConeT(1 + len(z)),
                np.vstack([self.unknowns(1), A]),
                np.concatenate([[radius], b - z]),
            )
        )

    def at_least_zero(self, A: Array, b: Array) -> None:
        """A x + b >= 0, row by row."""
        if len(b):
            self.constraints.append((clarabel.NonnegativeConeT(len(b)), A, b))

    def add_squares(self, first: int, M: Array, z: Array, weight: float) -> None:
        """weight ||M chi - z||^2 in the criterion; the residual are unknowns from number `first`
        on.
        """
        A, b = self.of_chi(M)
        own = np.arange(first, first + len(z))
        A[np.arange(len(z)), own] = -1.0
        self.quadratic[own, own] = 2 * weight
        self.constraints.append((clarabel.ZeroConeT(len(z)), A, b - z))

    def add_squared(self, M: Array, z: Array, weight: float) -> None:
        """weight ||M chi - z||^2 in the criterion, M'M well conditioned."""
        A, b = self.of_chi(M)
        self.quadratic += 2 * weight * A.T @ A
        self.linear += 2 * weight * A.T @ (b - z)

    def add_entropy(self, first: int, B: Array, numbers: Sequence[int], weight: float) -> None:
        """weight (tr M - log det M) in the criterion, M = sum_k chi[numbers[k]] B[k], shape (n, n);
        Z and log Z_ii are unknowns from `first` on.
        """
        n, p = B.shape[1], len(self.space.origin)
        i, j = np.tril_indices(n)
        A, b = self.of_chi(on_standard(triangle(np.pad(B, ((0, 0), (0, n), (0, n)))), numbers, p))
        Z = np.zeros((len(i), 2 * n, 2 * n))
        Z[np.arange(len(i)), i, n + j] = Z[np.arange(len(i)), n + j, i] = 1.0
        Z[i == j, n + i[i == j], n + i[i == j]] = 1.0
        A[:, first : first + len(i)] = triangle(Z)
        self.constraints.append((clarabel.PSDTriangleConeT(2 * n), A, b))
        for k, place in enumerate(np.flatnonzero(i == j)):
            logarithm, E = first + len(i) + k, self.unknowns(3)
            E[0, logarithm] = E[2, first + place] = 1.0
            self.constraints.append((clarabel.ExponentialConeT(), E, np.array([0.0, 1.0, 0.0])))
            self.linear[logarithm] = -weight
        self.linear[: self.m] += (
            weight * np.trace(B, axis1=1, axis2=2) @ self.space.basis[list(numbers)]
        )

    def solve(self) -> tuple[str, Array, dict[str, float]]:
        """Status, x, and the trace of the multiplier of each condition."""
        cones, A, b = zip(*self.constraints, strict=True)
        Q, given = sparse.csc_matrix(np.triu(self.quadratic)), sparse.csc_matrix(-np.vstack(A))
        status = ""
        for gap, feasible in TOLERANCES:
            settings = clarabel.DefaultSettings()
            settings.verbose = False
            settings.tol_gap_abs = settings.tol_gap_rel = gap
            settings.tol_feas = feasible
            solution = clarabel.DefaultSolver(
                Q, self.linear, given, np.concatenate(b), list(cones), settings
            ).solve()
            status = STATUS.get(str(solution.status), f"Clarabel: {solution.status}")
            if status in SOLVED:
                z = np.array(solution.z)
                return (
                    status,
                    np.array(solution.x),
                    {name: trace(z[rows]) for name, rows in self.multipliers.items()},
                )
        return status, np.full(len(self.linear), np.nan), {}


def closest(
    R: Array,
    z: Array,
    conditions: Sequence[Condition],
    rows: LinearBounds,
    space: Space,
    *,
    least: float,
    pull: Prior | None = None,
) -> Optimum:
    """chi of `space` nearest to R chi = z, shapes (m, p) and (m,), scaled by the caller so that
    ||z|| is about 1.

    least : smallest eigenvalue of every condition, SI, not zero.
    """
    space, rows = within(space, rows)
    squares, entropies = [(R, z, 1.0)], []
    if pull is not None and pull.kind != "euclidean":
        for c in (c for c in conditions if c.name.startswith("link ")):
            L = np.linalg.inv(np.linalg.cholesky(c.matrix(pull.chi0)))
            B = L @ c.B @ L.T  # the identity at chi0
            B = (B + B.swapaxes(1, 2)) / 2
            if pull.kind == "entropic":
                entropies.append((B, c.numbers))
            else:
                M = on_standard(triangle(B), c.numbers, len(pull.chi0))
                squares.append((M, triangle(np.eye(4)[None])[:, 0], pull.weight / 2))
    residuals = sum(len(value) for _, value, _ in squares)
    program = Program(space, residuals + sum(14 for _ in entropies))
    program.conditions_hold(conditions, least)
    program.rows_hold(rows)
    if pull is not None and pull.kind == "euclidean":
        numbers = list(pull.numbers)
        program.add_squared(
            np.eye(len(pull.chi0))[numbers] / pull.scale[numbers, None],
            (pull.chi0 / pull.scale)[numbers],
            pull.weight,
        )
    first = program.m
    for M, value, weight in squares:
        program.add_squares(first, M, value, weight)
        first += len(value)
    for B, numbers_of_link in entropies:
        assert pull is not None
        program.add_entropy(first, B, numbers_of_link, pull.weight)
        first += 14  # Z of a pseudo-inertia, (4, 4), and four logarithms
    status, x, duals = program.solve()
    return Optimum(status, space.origin + space.basis @ x[: program.m], float("nan"), duals)


def extreme(
    direction: Array,
    R: Array,
    z: Array,
    radius: float,
    conditions: Sequence[Condition],
    rows: LinearBounds,
    space: Space,
    *,
    least: float,
) -> Optimum:
    """The chi of `space` with the smallest direction'chi, direction of shape (p,), among those with
    ||R chi - z|| <= radius; scaled as for `closest`.
    """
    space, rows = within(space, rows)
    program = Program(space, 0)
    program.linear[:] = direction @ space.basis
    program.conditions_hold(conditions, least)
    program.rows_hold(rows)
    program.within_ball(R, z, radius)
    bounds = np.full(program.m, LIMIT.LARGEST_UNKNOWN)
    program.at_least_zero(-np.eye(program.m), bounds)
    program.at_least_zero(np.eye(program.m), bounds)
    status, x, duals = program.solve()
    return Optimum(status, space.origin + space.basis @ x, float("nan"), duals)


def margin(conditions: Sequence[Condition], rows: LinearBounds, space: Space) -> Optimum:
    """The largest t with every P - t 1 positive semidefinite: `margin`; negative where no physical
    robot is in `space`.
    """
    space, rows = within(space, rows)
    program = Program(space, 1)
    program.linear[-1] = -1.0
    program.conditions_hold(conditions, 0.0)
    program.rows_hold(rows)
    bounds = np.full(program.m + 1, LIMIT.LARGEST_UNKNOWN)
    bounds[-1] = LIMIT.LARGEST_MARGIN
    program.at_least_zero(-np.eye(program.m + 1), bounds)
    program.at_least_zero(np.eye(program.m + 1)[:-1], bounds[:-1])
    status, x, duals = program.solve()
    return Optimum(status, space.origin + space.basis @ x[:-1], float(x[-1]), duals)


def triangle(B: Array) -> Array:
    """Columns of the upper triangles of symmetric matrices, shape (k, n, n), entries off the
    diagonal times sqrt(2): shape (n (n + 1)/2, k).
    """
    i, j, factor = _upper(B.shape[1])
    return np.asarray((B[:, i, j] * factor).T)


@lru_cache(maxsize=8)
def _triangles(conditions: tuple[Condition, ...], p: int) -> tuple[Array, Array]:
    """Triangles of the conditions on p standard parameters, one below the other, shape (rows, p),
    and those of the identity, (rows,).
    """
    ones = [triangle(np.eye(c.B.shape[1])[None])[:, 0] for c in conditions]
    return np.vstack(
        [on_standard(triangle(c.B), c.numbers, p) for c in conditions] or [np.zeros((0, p))]
    ), np.concatenate([*ones, []])


@lru_cache(maxsize=32)
def _upper(n: int) -> tuple[Array, Array, Array]:
    """Row and column of the entries of an upper triangle, column by column, and their factors."""
    j, i = np.tril_indices(n)
    return i, j, np.where(i == j, 1.0, np.sqrt(2.0))


def trace(z: Array) -> float:
    """Trace of a symmetric matrix from its triangle."""
    ends = np.cumsum(np.arange(1, len(z) + 1)) - 1  # places of the diagonal
    return float(z[ends[ends < len(z)]].sum())


def on_standard(M: Array, numbers: Sequence[int], p: int) -> Array:
    """Columns of M, shape (k, len(numbers)), as those of all p standard parameters, shape
    (k, p).
    """
    spread = np.zeros((len(M), p))
    spread[:, list(numbers)] = M
    return spread
