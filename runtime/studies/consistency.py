"""Semidefinite programs over the standard parameters: cvxpy and Clarabel, extra `consistency`. cvxpy only here.

    closest     min ||R (z - K chi)||^2 + weight D(chi)        subject to  P >= margin 1 of every condition, rows, K chi = X where asked
    margin      max t                                          subject to  P >= t 1 of every condition, rows, K chi = X

All unknowns are chi = scale * u: interior point methods want entries near one. Clarabel is a deterministic solver: same problem, same bits.

Reference: Goulart and Chen (2024) for Clarabel; Diamond and Boyd (2016) for cvxpy.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from runtime.errors import InputError
from runtime.physical import Condition

Array = np.ndarray
Distance = Literal["none", "euclidean", "entropic", "pullback"]

TOLERANCES = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-11}
SOLVED = ("optimal", "optimal_inaccurate")
FURTHEST = 1e3  # largest margin, SI: the problem of `margin` has a solution whatever X leaves open


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
class Reference:
    """Where the inertial parameters are pulled to: chi0 (p,), and its pseudo-inertias by name of the condition."""

    kind: Distance
    chi0: Array
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
    if cvxpy.CLARABEL not in cvxpy.installed_solvers():
        raise InputError("physical consistency needs the solver Clarabel; pip install symgen[consistency]")
    return cvxpy


def closest(
    R: Array,
    z: Array,
    conditions: Sequence[Condition],
    rows: Rows,
    scale: Array,
    *,
    margin: float,
    pull: Reference | None = None,
    equality: tuple[Array, Array] | None = None,
) -> Found:
    """chi nearest to R chi = z, shapes (m, p) and (m,), scaled by the caller so that ||z|| is about 1.

    margin : least eigenvalue of every condition, SI.   equality : (K, X) with K chi = X.
    """
    cp = require_solver()
    u = cp.Variable(len(scale))
    constraints, blocks = _constraints(cp, u, conditions, rows, scale, margin)
    if equality is not None:
        constraints.append(_balanced(equality[0] * scale, equality[1], u))
    criterion = cp.sum_squares((R * scale) @ u - z)
    if pull is not None:
        criterion = criterion + pull.weight * _distance(cp, u, conditions, scale, pull)
    return _solved(cp, cp.Problem(cp.Minimize(criterion), constraints), u, scale, blocks)


def margin(K: Array, X: Array, conditions: Sequence[Condition], rows: Rows, scale: Array) -> Found:
    """The largest t with every P - t 1 positive semidefinite and K chi = X: `value`; negative where no physical robot has X."""
    cp = require_solver()
    u, t = cp.Variable(len(scale)), cp.Variable()
    constraints, blocks = _constraints(cp, u, conditions, rows, scale, t)
    constraints += [_balanced(K * scale, X, u), t <= FURTHEST]
    return _solved(cp, cp.Problem(cp.Maximize(t), constraints), u, scale, blocks)


def _constraints(
    cp: Any, u: Any, conditions: Sequence[Condition], rows: Rows, scale: Array, least: Any
) -> tuple[list[Any], dict[str, Any]]:
    """Conditions and rows; the conditions also by name."""
    blocks = {}
    for c in conditions:
        P = _matrix(cp, u, c, scale)
        m = c.B.shape[1]
        blocks[c.name] = P - least * np.eye(m) >> 0 if m > 1 else P[0, 0] >= least
    constraints = list(blocks.values())
    for A, low, high in zip(rows.A * scale, rows.lower, rows.upper, strict=True):
        size = float(np.linalg.norm(A)) or 1.0
        if low == high:
            constraints.append((A / size) @ u == low / size)
            continue
        constraints += [(A / size) @ u >= low / size] if np.isfinite(low) else []
        constraints += [(A / size) @ u <= high / size] if np.isfinite(high) else []
    return constraints, blocks


def _matrix(cp: Any, u: Any, c: Condition, scale: Array) -> Any:
    """sum_k chi_k B_k as a symmetric expression."""
    m = c.B.shape[1]
    flat = c.B.reshape(len(c.numbers), m * m).T * scale[list(c.numbers)]
    return cp.reshape(flat @ u[list(c.numbers)], (m, m), order="C")


def _balanced(K: Array, X: Array, u: Any) -> Any:
    """K u = X with rows of norm 1."""
    size = np.linalg.norm(K, axis=1)
    size = np.where(size > 0, size, 1.0)
    return (K / size[:, None]) @ u == X / size


def _distance(cp: Any, u: Any, conditions: Sequence[Condition], scale: Array, pull: Reference) -> Any:
    """D(chi): ||(chi - chi0)/scale||^2 over the inertial parameters; or over the links

    entropic  tr(P0^-1 P) - log det P + log det P0 - 4        pullback  tr((P0^-1 (P - P0))^2)/2 = ||P0^-1/2 (P - P0) P0^-1/2||^2 / 2
    """
    numbers = list(pull.numbers)
    if pull.kind == "euclidean":
        return cp.sum_squares(u[numbers] - pull.chi0[numbers] / scale[numbers])
    total: Any = 0.0
    for c in conditions:
        if c.name.startswith("link "):
            L = np.linalg.inv(np.linalg.cholesky(c.matrix(pull.chi0)))
            whitened = L @ _matrix(cp, u, c, scale) @ L.T  # the identity at chi0
            whitened = (whitened + whitened.T) / 2
            if pull.kind == "entropic":
                total = total + cp.trace(whitened) - cp.log_det(whitened) - 4.0
            else:
                total = total + cp.sum_squares(whitened - np.eye(4)) / 2
    return total


def _solved(cp: Any, problem: Any, u: Any, scale: Array, blocks: Mapping[str, Any]) -> Found:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "may be inaccurate": the status says it
            problem.solve(solver=cp.CLARABEL, **TOLERANCES)
    except cp.error.SolverError as e:
        return Found(f"solver error: {e}", np.full(len(scale), np.nan), float("nan"), {})
    if problem.status not in SOLVED:
        return Found(problem.status, np.full(len(scale), np.nan), float("nan"), {})
    duals = {name: float(np.trace(np.atleast_2d(block.dual_value))) for name, block in blocks.items()}
    return Found(problem.status, np.asarray(scale * u.value), float(problem.value), duals)
