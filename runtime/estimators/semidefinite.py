"""Semidefinite programs over the standard parameters: cvxpy and Clarabel, extra `consistency`. cvxpy only here.

    closest     min ||R chi - z||^2 + weight D(chi)    subject to  P >= least 1 of every condition, rows, chi in a Space
    margin      max t                                  subject to  P >= t 1 of every condition, rows, chi in a Space

The unknowns w of chi = origin + basis w have sizes near one, as interior point methods want. K chi = X is a Space, not an equation, and holds to
rounding. Clarabel is deterministic: same problem, same bits.

Reference: Goulart and Chen (2024) for Clarabel; Diamond and Boyd (2016) for cvxpy.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.linalg import null_space

from runtime.errors import InputError
from runtime.model.inertia import Condition

Array = np.ndarray
Distance = Literal["none", "euclidean", "entropic", "pullback"]

TOLERANCES = ((1e-12, 1e-11), (1e-9, 1e-9))  # of the gap and of the constraints, tried in this order
SOLVED = ("optimal", "optimal_inaccurate")
FURTHEST = 1.0  # largest margin, SI, and ...
LARGEST = 1e4  # largest unknown, in units of its size: the problem of `margin` has a solution whatever K leaves open


@dataclass(frozen=True, eq=False)
class Rows:
    """lower <= A chi <= upper, one name per row; infinite where there is no bound."""

    names: tuple[str, ...]
    A: Array
    lower: Array
    upper: Array

    def without(self, name: str) -> Rows:
        """The rows of other names."""
        kept = [k for k, own in enumerate(self.names) if own != name]
        return Rows(tuple(self.names[k] for k in kept), self.A[kept], self.lower[kept], self.upper[kept])


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
    return Space(scale * np.linalg.lstsq(K * scale, X, rcond=None)[0], scale[:, None] * null_space(K * scale))


def within(space: Space, rows: Rows) -> tuple[Space, Rows]:
    """`space` with the rows that are equations fulfilled (nearest to that where they contradict it), and the other rows."""
    equal = rows.lower == rows.upper
    others = Rows(tuple(n for n, e in zip(rows.names, equal, strict=True) if not e), *(x[~equal] for x in (rows.A, rows.lower, rows.upper)))
    if not equal.any():
        return space, others
    A = rows.A[equal]
    origin = space.origin + space.basis @ np.linalg.lstsq(A @ space.basis, rows.lower[equal] - A @ space.origin, rcond=None)[0]
    return Space(origin, space.basis @ null_space(A @ space.basis)), others


@dataclass(frozen=True, eq=False)
class Reference:
    """Where the inertial parameters are pulled to, chi0 (p,), in units of scale, (p,)."""

    kind: Distance
    chi0: Array
    scale: Array
    numbers: tuple[int, ...]  # the inertial parameters among the p
    weight: float


@dataclass(frozen=True, eq=False)
class Found:
    """status : "optimal", "optimal_inaccurate", "infeasible", ... of the solver.   chi : (p,), nan without solution.

    duals : trace of the multiplier of each condition, their sum 1 in a problem of `margin`: what stands in the way.
    """

    status: str
    chi: Array
    value: float
    duals: Mapping[str, float]

    @property
    def solved(self) -> bool:
        """Whether there is a chi."""
        return self.status in SOLVED


def require_solver() -> Any:
    """cvxpy with Clarabel; InputError that says how to get them."""
    try:
        import cvxpy
    except ImportError:
        raise InputError("physical consistency needs cvxpy; pip install symgen[consistency]") from None
    installed: Any = cvxpy.installed_solvers
    if cvxpy.CLARABEL not in installed():
        raise InputError("physical consistency needs the solver Clarabel; pip install symgen[consistency]")
    return cvxpy


def closest(
    R: Array,
    z: Array,
    conditions: Sequence[Condition],
    rows: Rows,
    space: Space,
    *,
    least: float,
    pull: Reference | None = None,
) -> Found:
    """chi of `space` nearest to R chi = z, shapes (m, p) and (m,), scaled by the caller so that ||z|| is about 1.

    least : smallest eigenvalue of every condition, SI.
    """
    cp = require_solver()
    space, rows = within(space, rows)
    w = cp.Variable(space.basis.shape[1])
    chi = space.origin + space.basis @ w
    constraints, blocks = _constraints(cp, chi, conditions, rows, least)
    criterion = cp.sum_squares((R @ space.basis) @ w - (z - R @ space.origin))
    if pull is not None:
        criterion = criterion + pull.weight * _distance(cp, chi, conditions, pull)
    return _solved(cp, cp.Problem(cp.Minimize(criterion), constraints), w, space, blocks)


def margin(conditions: Sequence[Condition], rows: Rows, space: Space) -> Found:
    """The largest t with every P - t 1 positive semidefinite: `value`; negative where no physical robot is in `space`."""
    cp = require_solver()
    space, rows = within(space, rows)
    w, t = cp.Variable(space.basis.shape[1]), cp.Variable()
    constraints, blocks = _constraints(cp, space.origin + space.basis @ w, conditions, rows, t)
    return _solved(cp, cp.Problem(cp.Maximize(t), [*constraints, t <= FURTHEST, w <= LARGEST, w >= -LARGEST]), w, space, blocks)


def _constraints(cp: Any, chi: Any, conditions: Sequence[Condition], rows: Rows, least: Any) -> tuple[list[Any], dict[str, Any]]:
    """Conditions and rows; the conditions also by name."""
    blocks = {}
    for c in conditions:
        P = _matrix(cp, chi, c)
        m = c.B.shape[1]
        blocks[c.name] = P - least * np.eye(m) >> 0 if m > 1 else P[0, 0] >= least
    constraints = list(blocks.values())
    for A, low, high in zip(rows.A, rows.lower, rows.upper, strict=True):
        constraints += [A @ chi >= low] if np.isfinite(low) else []
        constraints += [A @ chi <= high] if np.isfinite(high) else []
    return constraints, blocks


def _matrix(cp: Any, chi: Any, c: Condition) -> Any:
    """sum_k chi_k B_k as an expression."""
    m = c.B.shape[1]
    return cp.reshape(c.B.reshape(len(c.numbers), m * m).T @ chi[list(c.numbers)], (m, m), order="C")


def _distance(cp: Any, chi: Any, conditions: Sequence[Condition], pull: Reference) -> Any:
    """D(chi): ||(chi - chi0)/scale||^2 over the inertial parameters; or over the links

    entropic  tr(P0^-1 P) - log det P + log det P0 - 4        pullback  tr((P0^-1 (P - P0))^2)/2 = ||P0^-1/2 (P - P0) P0^-1/2||^2 / 2
    """
    numbers = list(pull.numbers)
    if pull.kind == "euclidean":
        return cp.sum_squares(cp.multiply(1 / pull.scale[numbers], chi[numbers] - pull.chi0[numbers]))
    total: Any = 0.0
    for c in conditions:
        if c.name.startswith("link "):
            L = np.linalg.inv(np.linalg.cholesky(c.matrix(pull.chi0)))
            whitened = L @ _matrix(cp, chi, c) @ L.T  # the identity at chi0
            whitened = (whitened + whitened.T) / 2
            if pull.kind == "entropic":
                total = total + cp.trace(whitened) - cp.log_det(whitened) - 4.0
            else:
                total = total + cp.sum_squares(whitened - np.eye(4)) / 2
    return total


def _solved(cp: Any, problem: Any, w: Any, space: Space, blocks: Mapping[str, Any]) -> Found:
    status = ""
    for gap, feasible in TOLERANCES:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # "may be inaccurate": the status says it
                problem.solve(solver=cp.CLARABEL, tol_gap_abs=gap, tol_gap_rel=gap, tol_feas=feasible)
            status = problem.status
        except cp.error.SolverError:
            status = "Clarabel failed"
        if status in SOLVED:
            break
    if status not in SOLVED:
        return Found(status, np.full(len(space.origin), np.nan), float("nan"), {})
    duals = {name: float(np.trace(np.atleast_2d(block.dual_value))) for name, block in blocks.items()}
    return Found(status, space.origin + space.basis @ w.value, float(problem.value), duals)
