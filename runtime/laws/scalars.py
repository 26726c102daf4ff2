"""Fit of the nonlinear constants (scalars) of laws, such as the velocity of a Stribeck law.

`runtime.laws.projection` makes the fit; other local minima are reported. Standard deviations are
computed for X and the scalars together, from the linear problem with the columns [W, (dW/da) X],
with blocks of time as independent. A law is useful if it improves the prediction of blocks of time
that were not used in the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.least_squares.linear import percent
from runtime.core.model import BoundModel, GeneratedModel
from runtime.core.problem import Note, Problem
from runtime.core.residuals import correlation_time, p_value, residual_correlation
from runtime.core.result import Identification
from runtime.core.rows.observation import split_rows
from runtime.core.rows.prepared import Prepared
from runtime.ground.errors import InputError
from runtime.ground.part import Part
from runtime.ground.progress import at
from runtime.ground.table import Table, number
from runtime.laws.projection import LawProblem, Projection, orthonormal_basis
from runtime.laws.transmitted import transmitted_torque

Array = np.ndarray

KIND = "laws"
"""Kind of the note that holds the FittedLaws of a problem."""
SURE = 0.01  # p of the F-test above which a record does not show a law
LOOSE = 0.5  # deviation of log(a), or share of the bounds, above which a is not determined


@dataclass(frozen=True)
class FittedScalar:
    """One fitted constant of a law, for instance the velocity of a Stribeck law.

    Attributes
    ----------
    name : str
        Name of the constant in the module.
    parameter : str
        The parameter that multiplies the law.
    value, sigma : float
        Estimate and its standard deviation, computed jointly with X.
    minima : tuple of float
        Values at other local minima, the best first.
    doubt : str
        Reason why the scalar is not determined; empty if it is.
    """

    name: str
    parameter: str
    value: float
    sigma: float
    minima: tuple[float, ...]
    doubt: str


@dataclass(frozen=True)
class LawTest:
    """Test of a law, such as Stribeck friction: whether the law improves the prediction of torques.

    Attributes
    ----------
    parameter : str
        The parameter that multiplies the law.
    value, sigma : float
        Estimate of the parameter and its standard deviation, computed jointly with the scalars.
    p_value : float
        p-value of the F-test of the law and its scalars on all rows.
    without, with_law : float, %
        Prediction errors without the law and with it, on blocks of time not used in the fit.
    """

    parameter: str
    value: float
    sigma: float
    p_value: float
    without: float
    with_law: float

    @property
    def earned(self) -> bool:
        """Whether the law is significant and improves the prediction of unseen data."""
        return self.p_value < SURE and self.with_law < self.without


@dataclass(frozen=True)
class FittedLaws(Part):
    """Fitted constants of laws, such as a Stribeck velocity, with tests of the laws."""

    scalars: tuple[FittedScalar, ...]
    tests: tuple[LawTest, ...]

    name = "laws"
    title = "Laws of columns"

    @property
    def constants(self) -> dict[str, float]:
        """Fitted values of the nonlinear constants of the laws, by name."""
        return {s.name: s.value for s in self.scalars}

    def tables(self) -> list[Table]:
        """Make a table of the fitted constants, and one of the prediction errors of the laws."""
        said = [
            (s.name, s.parameter, s.doubt, "")
            if s.doubt
            else (
                s.name,
                s.parameter,
                f"{s.value:.4g} ± {1.96 * s.sigma:.2g}",
                ", ".join(f"{x:.4g}" for x in s.minima),
            )
            for s in self.scalars
        ]
        tests = [
            (
                *(t.parameter, f"{t.value:.4g} ± {1.96 * t.sigma:.2g}", f"{t.p_value:.2g}"),
                *(number(t.without, ".3f"), number(t.with_law, ".3f")),
                "yes" if t.earned else "no",
            )
            for t in self.tests
        ]
        return [
            Table(
                "Scalars of laws", ("scalar", "law of", "value ± 95 %, SI", "other minima"), said
            ),
            Table(
                "Do the laws improve the prediction?",
                ("law of", "value ± 95 %", "p", "unseen without %", "unseen with %", "earned"),
                tests,
            ),
        ]

    def text(self) -> str:
        """Sentence that says how the nonlinear constants of the laws were estimated."""
        return "Scalars inside the laws of columns, by variable projection."

    def brief(self) -> str:
        """Write the fitted constants with their 95 % confidence intervals in one line."""
        said = [
            f"{s.name} {s.doubt or f'{s.value:.4g} ± {1.96 * s.sigma:.2g}'}" for s in self.scalars
        ]
        idle = [t.parameter for t in self.tests if not t.earned]
        worth = (
            f"; these laws do not improve the prediction of unseen data: {', '.join(idle)}"
            if idle
            else ""
        )
        return f"Scalars of laws (± 95 %): {', '.join(said)}{worth}"

    def summary(self) -> dict[str, Any]:
        """Return the fitted constants and the tests of the laws as a mapping for JSON."""
        return {"scalars": self.scalars, "tests": self.tests}


def fitted_scalars(problem: Problem) -> Problem:
    """Fit the nonlinear constants of laws, such as a Stribeck velocity; set them in the model.

    This is a step of the preparation of a problem. Without scalars (`fit:` of the robot file) or
    records, the problem is returned unchanged.

    Raises
    ------
    InputError
        The method simulates the loop, and would use the scalars of the robot file.
    """
    if not problem.records or not hasattr(problem.model, "FIT"):
        return problem
    estimate = problem.settings.estimate
    if problem.method.observe is not None:
        raise InputError(
            f"{estimate.method} cannot fit the constants of a law, because it simulates the loop with the constants of the robot file; fit these constants by ols, then write the values found into the robot file, as in fit: {{vs: 0.08}}"
        )
    at("scalars of laws")
    columns = None if estimate.columns == "all" else tuple(estimate.columns)
    laws = fit_laws(problem.model, problem.prepared, columns, weights=estimate.weights != "none")
    model = cast(GeneratedModel, BoundModel(problem.model, laws.constants))
    return transmitted_torque(problem.changed(Note(KIND, "", result=laws), model=model))


def scalars_of_laws(result: Identification) -> FittedLaws | None:
    """Return the fitted nonlinear constants of the laws; None if none were fitted."""
    note = result.problem.noted(KIND)
    return None if note is None else note.result


def fit_laws(
    model: GeneratedModel,
    records: Sequence[Prepared],
    columns: Sequence[str] | None = None,
    *,
    weights: bool = False,
) -> FittedLaws:
    """Fit the nonlinear constants of a model's laws, such as a Stribeck velocity, to records.

    Parameters
    ----------
    model : GeneratedModel
        A module with the table FIT of its scalars.
    records : sequence of Prepared
        Records at the joint side, in SI units.
    columns : sequence of str, optional
        Base parameters that are fitted; default: all.
    weights : bool
        Whether the rows of each joint are divided by the standard deviation of its residual.
    """
    problem = LawProblem(model, records, columns or model.BASE_PARAMETERS)
    every, scale = np.ones(len(problem.Y), dtype=bool), np.ones(len(problem.Y))
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(problem.scalars):
        groups.setdefault(str(problem.table[name][2]), []).append(k)
    projection = Projection(problem, every, scale)
    if weights:
        r = projection.residual(problem.start)
        by_joint = [np.sqrt(np.mean(r[problem.joint == j] ** 2)) for j in np.unique(problem.joint)]
        scale = np.array(by_joint)[problem.joint]
        projection = Projection(problem, every, scale)
    u, cost, others = projection.fitted(list(groups.values()))
    A, X, sigma = _joint_deviations(problem, u, scale)
    r = problem.Y - A @ X
    count = len(r) / correlation_time(residual_correlation(r))
    b = len(problem.names)
    even = problem.block % 2 == 0
    halves = [(rows, Projection(problem, rows, scale).polished(u)[0]) for rows in (even, ~even)]
    tests, scalars = [], []
    for g, (parameter, group) in enumerate(groups.items()):
        own = sorted({c for k in group for c in problem.varying[k]})
        rest = [c for c in range(b) if c not in own]
        squares = _squares(A[:, rest], problem.Y, scale)
        p = p_value(squares, cost, b - len(own), b + len(group), count)
        errors = [_unseen(problem, halves, without, scale) for without in (own, [])]
        c = own[0] if own else 0
        test = LawTest(parameter, float(X[c]), float(sigma[c]), p, *errors)
        tests.append(test)
        for k in group:
            scalars.append(_scalar(problem, k, u, float(sigma[b + k]), others.get(g, []), test))
    return FittedLaws(tuple(scalars), tuple(tests))


def _joint_deviations(problem: LawProblem, u: Array, scale: Array) -> tuple[Array, Array, Array]:
    """Compute W and X at the search coordinates u, and the standard deviations of X and of u.

    Both standard deviations come from one covariance. Blocks of time are taken as independent.
    """
    A = problem.W.copy()
    for c in problem.moving:
        A[:, c] = problem.column(c, u)
    X = np.linalg.lstsq(A / scale[:, None], problem.Y / scale, rcond=1e-10)[0]
    S = np.column_stack([problem.slope(k, u, X) for k in range(len(u))])
    whole = np.column_stack([A, S]) / scale[:, None]
    residual = (problem.Y - A @ X) / scale
    T = np.linalg.pinv(np.linalg.qr(whole, mode="r"), rcond=1e-10)
    blocks = split_rows(np.column_stack([whole, residual]), problem.block)
    C = block_covariance(blocks, np.zeros(whole.shape[1]), T)
    return A, X, np.sqrt(np.diag(C))


def _squares(A: Array, Y: Array, scale: Array) -> float:
    Q, y = orthonormal_basis(A / scale[:, None]), Y / scale
    r = y - Q @ (Q.T @ y)
    return float(r @ r)


def _unseen(
    problem: LawProblem, halves: Sequence[tuple[Array, Array]], without: Sequence[int], scale: Array
) -> float:
    """Compute the prediction error, %, if each half of the rows is predicted from the other half.

    `without` lists the columns of W that are left out.
    """
    kept = [c for c in range(len(problem.names)) if c not in without]
    residual = np.zeros(len(problem.Y))
    for rows, u in halves:
        A = problem.W.copy()
        for c in problem.moving:
            A[:, c] = problem.column(c, u)
        A = A[:, kept]
        X = np.linalg.lstsq(A[rows] / scale[rows, None], problem.Y[rows] / scale[rows], rcond=1e-10)
        residual[~rows] = (problem.Y - A @ X[0])[~rows]
    return percent(residual, problem.Y)


def _scalar(
    problem: LawProblem, k: int, u: Array, sigma: float, others: Sequence[Array], test: LawTest
) -> FittedScalar:
    name, a = problem.scalars[k], float(problem.values(u)[k])
    width = problem.upper[k] - problem.lower[k]
    end = min(u[k] - problem.lower[k], problem.upper[k] - u[k]) < 1e-3 * width
    loose = sigma if problem.log[k] else sigma / width
    doubt = ""
    if test.p_value > SURE:
        doubt = f"not determined: the record does not show the law (p = {test.p_value:.2g})"
    elif not loose < LOOSE:
        doubt = "not determined: its standard deviation is as large as its value"
    elif end:
        doubt = f"not determined: it ends at its bound, {a:.3g}"
    minima = tuple(float(problem.values(o)[k]) for o in others)
    sigma *= a if problem.log[k] else 1.0
    return FittedScalar(name, test.parameter, a, sigma, minima, doubt)
