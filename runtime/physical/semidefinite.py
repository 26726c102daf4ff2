"""Semidefinite programs over the standard parameters, as cone programs for the solver Clarabel.

    closest     min ||R chi - z||^2 + weight D(chi)    subject to
            P >= least S of every condition, rows, chi in a Space
    margin      max t                                  subject to
            P >= t S of every condition, rows, chi in a Space
    Quadratic   min 1/2 chi'A chi - g'chi              subject to
            P >= 0 of every condition, rows chi >= 0, for many A and g

S = diag(size) of the condition: the cones hold S^-1/2 P S^-1/2, whose entries are near one.
Clarabel solves  min 1/2 x'Qx + c'x,  A x + s = b,  s in a product of cones. The unknowns x are
first w of chi = origin + basis w, with sizes near one, as interior point methods need. Then follow
unknowns that the criterion adds: residuals y with y = R chi - z as an equation, so that R is not
squared (the euclidean distance, of unknowns in units of their size, is). A symmetric matrix enters
by the columns of its upper triangle, with entries off the diagonal times sqrt(2). K chi = X is a
Space, not an equation, and holds to rounding. Clarabel is deterministic: same problem, same bits.

Reference: Goulart and Chen (2024) for Clarabel; Boyd and Vandenberghe, Convex Optimization (2004),
for the cones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np
from scipy import sparse
from scipy.linalg import null_space

from runtime.ground.limits import limits
from runtime.physical.inertia import Condition

LIMIT = limits(__package__)

Array = np.ndarray
Distance = Literal["none", "euclidean"]

TOLERANCES = (
    (1e-14, 1e-12),
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


def _clarabel() -> Any:
    """Import the solver Clarabel, only when a program is solved."""
    import clarabel

    return clarabel


@dataclass(frozen=True, eq=False)
class LinearBounds:
    """Named linear inequalities lower <= A chi <= upper; a missing bound is infinite."""

    names: tuple[str, ...]
    A: Array
    lower: Array
    upper: Array

    def without(self, name: str) -> LinearBounds:
        """Return the inequalities without the rows called `name`."""
        kept = [k for k, own in enumerate(self.names) if own != name]
        return LinearBounds(
            tuple(self.names[k] for k in kept), self.A[kept], self.lower[kept], self.upper[kept]
        )


@dataclass(frozen=True, eq=False)
class Space:
    """Set of vectors of standard parameters: all chi = origin + basis w, with any vector w.

    origin has shape (p,), basis (p, m).
    """

    origin: Array
    basis: Array


def everything(scale: Array) -> Space:
    """Return the set (Space) of all vectors chi of p standard parameters, in units of `scale`."""
    return Space(np.zeros(len(scale)), np.diag(scale))


def solutions(K: Array, X: Array, scale: Array) -> Space:
    """Return the set (Space) of all standard parameters chi with given base parameters X = K chi.

    K has full row rank. scale : units of the unknowns, shape (p,).
    """
    return Space(
        scale * np.linalg.lstsq(K * scale, X, rcond=None)[0], scale[:, None] * null_space(K * scale)
    )


def within(space: Space, rows: LinearBounds) -> tuple[Space, LinearBounds]:
    """Restrict a set of standard parameters chi to the solutions of the equations in `rows`.

    An equation is a row whose lower and upper bounds are equal.

    Returns the restricted space and the other rows. If the equations contradict the space, the
    points of the space that come nearest to the equations are used.
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
    """Penalty that pulls the inertial parameters towards given values chi0.

    Attributes
    ----------
    chi0 : ndarray, shape (p,), SI
        Values towards which the parameters are pulled.
    scale : ndarray, shape (p,), SI
        Units of the euclidean distance D.
    numbers : tuple of int
        Indices of the inertial parameters in chi.
    weight : float
        Weight of D.
    """

    chi0: Array
    scale: Array
    numbers: tuple[int, ...]
    weight: float


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of a semidefinite program: standard parameters, and the status of the solver.

    Attributes
    ----------
    status : str
        "optimal", "optimal_inaccurate", "infeasible", ..., or the solver's own word.
    chi : ndarray, shape (p,), SI
        Standard parameters; nan without solution.
    margin : float
        t of a problem of `margin`; nan for other problems.
    duals : mapping of str to float
        Trace of the multiplier of each condition; the largest belongs to the condition that
        prevents a larger margin. In a problem of `margin` their sum is 1.
    """

    status: str
    chi: Array
    margin: float
    duals: Mapping[str, float]

    @property
    def solved(self) -> bool:
        """Whether the program has a solution chi."""
        return self.status in SOLVED


class Program:
    """A cone program whose solution is the vector of standard parameters chi = origin + basis w.

    The unknowns are w. The program is built constraint by constraint.

    The program starts with the constraint P >= least S of every condition, or P >= t S with an
    unknown t, and with the linear rows. The criterion may add further unknowns.

    Parameters
    ----------
    space : Space
    rows : LinearBounds
    conditions : sequence of Condition
    least : float or None
        Smallest eigenvalue of every condition, in units of its size; None: the unknown t, after
        w.
    """

    def __init__(
        self,
        space: Space,
        rows: LinearBounds,
        conditions: Sequence[Condition],
        least: float | None,
    ) -> None:
        self.space, rows = within(space, rows)
        self.conditions, self.with_margin = conditions, least is None
        self.m = self.space.basis.shape[1]
        self.squares = np.zeros((self.m, self.m))  # of w, in the criterion
        self.linear, self.diagonal = np.zeros((2, self.m + self.with_margin))
        self.constraints: list[tuple[Any, Array, Array]] = []  # cone, A, b: b + A x in the cone
        triangles, ones = _triangles(tuple(conditions), len(space.origin))
        A, b = self.of_chi(triangles)
        if least is None:
            A[:, self.m] = -ones
        else:
            b = b - least * ones
        sizes = [c.B.shape[1] for c in conditions]
        ends = np.cumsum([n * (n + 1) // 2 for n in sizes])[:-1]
        for n, of_A, of_b in zip(sizes, np.split(A, ends), np.split(b, ends), strict=False):
            self.constraints.append((_cone(n), of_A, of_b))
        A, b = self.of_chi(rows.A)
        for sign, bound in ((1.0, rows.lower), (-1.0, rows.upper)):
            given = np.isfinite(bound)
            self.at_least_zero(sign * A[given], sign * (b - bound)[given])

    def more(self, count: int) -> Array:
        """Add `count` unknowns to the program and return their indices."""
        first = len(self.linear)
        self.linear, self.diagonal = (
            np.append(x, np.zeros(count)) for x in (self.linear, self.diagonal)
        )
        return np.arange(first, first + count)

    def of_chi(self, M: Array) -> tuple[Array, Array]:
        """Write M chi as A x + b, with x the unknowns and M of shape (k, p); return A and b."""
        A = np.zeros((len(M), len(self.linear)))
        A[:, : self.m] = M @ self.space.basis
        return A, M @ self.space.origin

    def at_least_zero(self, A: Array, b: Array) -> None:
        """Add one constraint per row of A x + b >= 0, with x the unknowns of the program."""
        if len(b):
            self.constraints.append((_clarabel().NonnegativeConeT(len(b)), A, b))

    def add_squares(self, M: Array, z: Array, weight: float) -> None:
        """Add weight ||M chi - z||^2 to the criterion; the residuals become further unknowns."""
        own = self.more(len(z))
        A, b = self.of_chi(M)
        A[np.arange(len(z)), own] = -1.0
        self.diagonal[own] = 2 * weight
        self.constraints.append((_clarabel().ZeroConeT(len(z)), A, b - z))

    def solve(self) -> Optimum:
        """Solve the program with the tightest tolerances that Clarabel reaches."""
        cones, A, b = zip(*self.constraints, strict=True)
        status = ""
        Q = np.diag(self.diagonal)
        Q[: self.m, : self.m] += self.squares
        ends = np.cumsum([len(part) for part in b])
        whole = np.zeros((ends[-1], len(self.linear)))
        for rows, part in zip(np.split(whole, ends), A, strict=False):
            rows[:, : part.shape[1]] = part
        for gap, feasible in TOLERANCES:
            settings = _clarabel().DefaultSettings()
            settings.verbose = False
            settings.tol_gap_abs = settings.tol_gap_rel = gap
            settings.tol_feas = feasible
            data = (
                sparse.csc_matrix(np.triu(Q)),
                self.linear,
                sparse.csc_matrix(-whole),
                np.concatenate(b),
                list(cones),
                settings,
            )
            solution = _solution(partial(_solved, *data))
            if solution is None:
                status = "Clarabel stopped by an error of its own"
                continue
            status = STATUS.get(str(solution.status), f"Clarabel: {solution.status}")
            if status in SOLVED:
                x, z = np.array(solution.x), np.array(solution.z)
                multipliers = np.split(z, ends)
                duals = {
                    c.name: trace(of_c)
                    for c, of_c in zip(self.conditions, multipliers, strict=False)
                }
                chi = self.space.origin + self.space.basis @ x[: self.m]
                return Optimum(status, chi, float(x[self.m]) if self.with_margin else np.nan, duals)
        return Optimum(status, np.full(len(self.space.origin), np.nan), np.nan, {})


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
    """Find the standard parameters chi that minimise ||R chi - z|| under physical conditions.

    R has shape (m, p), z shape (m,); the caller scales both so that ||z|| is about 1. chi is in
    `space` and fulfils the inequalities `rows`.

    least : lower bound, above zero, of the smallest eigenvalue of every condition, relative to its
    size. pull : adds weight D(chi) to ||R chi - z||^2.
    """
    program = Program(space, rows, conditions, least)
    program.add_squares(R, z, 1.0)
    if pull is not None:  # M'M well conditioned: no residuals
        numbers, p = list(pull.numbers), len(pull.chi0)
        A, b = program.of_chi(np.eye(p)[numbers] / pull.scale[numbers, None])
        of_w, rest = A[:, : program.m], b - (pull.chi0 / pull.scale)[numbers]
        program.squares += 2 * pull.weight * of_w.T @ of_w
        program.linear[: program.m] += 2 * pull.weight * of_w.T @ rest
    return program.solve()


def margin(conditions: Sequence[Condition], rows: LinearBounds, space: Space) -> Optimum:
    """Find the standard parameters that fulfil all physical conditions with the largest margin t.

    With margin t, P - t S is positive semidefinite for the matrix P and the scale S of every
    condition. t is negative if there is no physical robot in `space`.
    """
    program = Program(space, rows, conditions, None)
    program.linear[-1] = -1.0
    bounds = np.full(program.m + 1, LIMIT.LARGEST_UNKNOWN)
    bounds[-1] = LIMIT.LARGEST_MARGIN
    program.at_least_zero(-np.eye(program.m + 1), bounds)
    program.at_least_zero(np.eye(program.m + 1)[:-1], bounds[:-1])
    return program.solve()


class Quadratic:
    """Solver for the minimum of 1/2 chi'A chi - g'chi over physical robots, for many A and g.

    The constraints are P >= 0 of every condition, and rows chi >= 0. The cones are set up once.

    Parameters
    ----------
    conditions : sequence of Condition
    rows : ndarray, shape (k, p)
        Rows of sizes near one if chi has its size.
    scale : ndarray, shape (p,), SI
        Sizes of the parameters.
    """

    def __init__(self, conditions: Sequence[Condition], rows: Array, scale: Array) -> None:
        p = len(scale)
        self.scale = scale
        column, row = np.tril_indices(p)
        self.upper = (row, column)  # of the upper triangle, column by column
        self.starts = np.concatenate([[0], np.cumsum(np.arange(1, p + 1))])
        triangles, _ = _triangles(tuple(conditions), p)
        self.A = sparse.csc_matrix(-scale * np.vstack([triangles, rows]))
        self.cones = [_cone(c.B.shape[1]) for c in conditions]
        if len(rows):
            self.cones.append(_clarabel().NonnegativeConeT(len(rows)))
        self.solver: Any = None

    def minimum(self, A: Array, g: Array) -> Array:
        """Find the standard parameters chi, shape (p,), that minimise 1/2 chi'A chi - g'chi.

        chi belongs to a physical robot; the result is zeros if Clarabel finds no minimum.
        """
        squares = (A * self.scale * self.scale[:, None])[self.upper]
        linear = -g * self.scale
        if self.solver is None:
            self.solver = self._solver(squares, linear, scaled=True)
        else:
            self.solver.update(P=squares, q=linear)
        solution = _solution(self.solver.solve)
        if solution is None or STATUS.get(str(solution.status)) not in SOLVED:
            self.solver = None
            solution = _solution(self._solver(squares, linear, scaled=False).solve)
        x = np.zeros(len(g)) if solution is None else np.array(solution.x)
        return self.scale * np.where(np.isfinite(x), x, 0.0)

    def _solver(self, squares: Array, linear: Array, *, scaled: bool) -> Any:
        """Make a Clarabel solver whose quadratic criterion can be changed later.

        For this purpose, Clarabel must not remove anything from the program. scaled : whether the
        unknowns are near one, so that Clarabel does not scale them again, which saves half of the
        time.
        """
        settings = _clarabel().DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.chordal_decomposition_enable = False
        settings.input_sparse_dropzeros = False
        settings.equilibrate_enable = not scaled
        settings.iterative_refinement_abstol = settings.iterative_refinement_reltol = 1e-8
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-7
        p, b = len(linear), np.zeros(self.A.shape[0])
        Q = sparse.csc_matrix((squares, self.upper[0], self.starts), shape=(p, p))
        return _clarabel().DefaultSolver(Q, linear, self.A, b, self.cones, settings)


def _solved(*data: Any) -> Any:
    """Solve one program with a new Clarabel solver."""
    return _clarabel().DefaultSolver(*data).solve()


def _solution(solve: Callable[[], Any]) -> Any:
    """Run `solve`, a call of Clarabel; return None if Clarabel stops with an error of its own."""
    try:
        return solve()
    except BaseException as e:  # a panic of Rust is no Exception
        if type(e).__name__ != "PanicException":
            raise
        return None


def _cone(n: int) -> Any:
    """Make the Clarabel cone of a condition whose matrix has n rows."""
    return _clarabel().PSDTriangleConeT(n) if n > 1 else _clarabel().NonnegativeConeT(1)


def triangle(B: Array) -> Array:
    """Convert symmetric matrices, shape (k, n, n), to columns that hold their upper triangles.

    Entries off the diagonal are multiplied by sqrt(2). The result has shape (n (n + 1)/2, k).
    """
    j, i = np.tril_indices(B.shape[1])
    return np.asarray((B[:, i, j] * np.where(i == j, 1.0, np.sqrt(2.0))).T)


@lru_cache(maxsize=8)
def _triangles(conditions: tuple[Condition, ...], p: int) -> tuple[Array, Array]:
    """Write the scaled matrices of all physical conditions as upper triangles, in one matrix.

    The triangles are over all p standard parameters, shape (rows, p). The second result has the
    triangles of identity matrices, shape (rows,).
    """
    ones = [triangle(np.eye(c.B.shape[1])[None])[:, 0] for c in conditions]
    return np.vstack(
        [on_standard(triangle(c.scaled), c.numbers, p) for c in conditions] or [np.zeros((0, p))]
    ), np.concatenate([*ones, []])


def trace(z: Array) -> float:
    """Compute the trace of a symmetric matrix that is given as its upper triangle."""
    ends = np.cumsum(np.arange(1, len(z) + 1)) - 1  # places of the diagonal
    return float(z[ends[ends < len(z)]].sum())


def on_standard(M: Array, numbers: Sequence[int], p: int) -> Array:
    """Build a matrix with p columns, shape (k, p), from M: column i of M is at index numbers[i].

    The other columns are zero.
    """
    spread = np.zeros((len(M), p))
    spread[:, list(numbers)] = M
    return spread
