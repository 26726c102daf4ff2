"""CLOE and CLIE: output error of the closed loop, in position or in torque.

    X = argmin sum_j ||y_j - y_s,j(X)||^2 / s_j^2,
            y decimated position (CLOE) or torque (CLIE), y_s that of the simulation with X

Gauss-Newton in a trust region (`scipy.optimize.least_squares`) on D^-1 X, D = max(|X^0|, sigma of
least squares); J = dy_s/dX from the tangent
system of the loop, g = 1.
s_j is the deviation of the residual: found at the start, found again at the first minimum, from
where the search goes on once more.
C = s^2 (J'VJ)^-1. A loop that holds its position well makes J small: slow, dependent on its start,
and the first to fail where the simulation
does not know what the encoder did to the loop.

Reference: Landau, Anderson and De Bruyne (2001) for output error in closed loop; Jubien, Gautier
and Janot (2014) against DIDIM.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.optimize import least_squares

from runtime.errors import InputError
from runtime.estimators.block_covariance import block_covariance
from runtime.estimators.linear import percent, standard_deviations
from runtime.estimators.method import Beginning, Fitted
from runtime.loop import iv
from runtime.loop.closed_loop import ClosedLoop, LoopOptions, loop_of
from runtime.loop.fixed_point import FixedPointOptions, full, initial
from runtime.progress import at
from runtime.rows.factor import Array
from runtime.rows.observation import Observation, split_rows
from runtime.settings.schema import Count, Positive


class CloeOptions(LoopOptions):
    """estimate.options of method cloe.

    Attributes
    ----------
    output : str
        position, or torque (CLIE).
    start : str
        First parameters: iv, ols, or values of the robot file.
    passes : int
        Largest number of simulations of each of two searches.
    step : float
        Length of a step, of that of X in units of D, at which a search ends.
    decrease : float
        Relative decrease of the criterion at which a search ends.
    """

    output: Literal["position", "torque"] = "position"
    start: Literal["iv", "ols", "values"] = "iv"
    passes: Count = 30
    step: Positive = 1e-4
    decrease: Positive = 1e-6


def fit(start: Beginning) -> Fitted:
    """The fit; its residual norms and relative errors are those of Y - W X, `details` holds those
    of the output. SettingsError where no loop is attached to the observation.
    """
    search = Search(
        loop_of(start.observation, start.settings.method), start.observation, start.options
    )
    observation, first = start.observation, start.solution
    if start.options.start == "iv":
        X = iv.fit(replace(start, options=FixedPointOptions())).solution.X
    else:
        X = initial(search.loop, start, start.options.start)
    D = np.maximum(np.abs(X), np.sqrt(np.diag(standard_deviations(start.system, first)[1])))
    y = observation.Y
    if search.position:
        y = search.loop.outputs([part.record.q for part in search.loop.parts], observation)
    e, converged = y - search.simulated(X), True
    for _ in range(2):
        X, converged = search.minimum(X, y, D, _weights(e, observation))
        e = y - search.simulated(X)
    J, weights = search.slope(X), _weights(e, observation)
    T = np.linalg.inv(np.linalg.qr(J * weights[:, None] * D, mode="r")) * D[:, None]
    joints = [observation.joint(j) for j in range(observation.n) if observation.rows[j]]
    r, c = J.shape
    rows = split_rows(np.column_stack([J, e]) * weights[:, None], observation.blocks())
    message = (
        f"CLOE has not converged after {len(search.trail)} simulations. Output error depends on "
        "its start: start from iv, raise passes, or take didim."
    )
    parts = ["" if converged else message, search.loop.assumption]
    return Fitted(
        replace(start.system, iterations=len(search.trail)),
        replace(first, X=X),
        T @ T.T * float(np.sum((weights * e) ** 2)) / max(r - c, 1),
        np.sqrt(np.diag(block_covariance(rows, np.zeros(c), T))),
        "ok" if converged else "not-converged",
        " ".join(part for part in parts if part),
        {
            "output": start.options.output,
            "output_error": [percent(e[rows], y[rows]) for rows in joints],  # 100 ||y - y_s||/||y||
            "trail": search.trail,
        },
    )


class Search:
    """Output of the loop by parameters X of the columns of `observation`.

    Parameters
    ----------
    loop : ClosedLoop
    observation : Observation
    options : CloeOptions
    """

    def __init__(self, loop: ClosedLoop, observation: Observation, options: CloeOptions) -> None:
        self.loop, self.observation, self.options = loop, observation, options
        self.position = options.output == "position"
        self.trail: list[dict[str, Any]] = []

    def _full(self, X: Array) -> Array:
        return full(self.observation.names, X, self.loop.model.BASE_PARAMETERS)

    def simulated(self, X: Array) -> Array:
        """y_s, shape (r,)."""
        runs = self.loop.run(self._full(X))
        signals = [run.q for run in runs] if self.position else self.loop.torques(runs)
        return self.loop.outputs(signals, self.observation)

    def slope(self, X: Array) -> Array:
        """J = dy_s/dX, shape (r, c)."""
        names = self.loop.model.BASE_PARAMETERS
        numbers = [names.index(name) for name in self.observation.names]
        tangents = [tangent for _, tangent in self.loop.sensitivity(self._full(X))]
        signals = [tangent.q if self.position else tangent.tau for tangent in tangents]
        return self.loop.outputs([x[:, :, numbers] for x in signals], self.observation)

    def minimum(self, X: Array, y: Array, D: Array, weights: Array) -> tuple[Array, bool]:
        """X at a minimum of the weighted criterion near X, and whether the search has converged;
        parameters without a loop are no point of it.
        """

        def residual(X: Array) -> Array:
            last = f", criterion {self.trail[-1]['criterion']:.4g}" if self.trail else ""
            at(f"simulation {len(self.trail) + 1}{last}")
            try:
                e: Array = weights * (self.simulated(X) - y)
            except InputError:  # no loop with these parameters: least_squares shortens its step
                e = np.full(len(y), np.nan)
            self.trail.append({"X": X.tolist(), "criterion": float(e @ e)})
            return e

        solution = least_squares(
            residual,
            X,
            jac=lambda X: weights[:, None] * self.slope(X),
            x_scale=D,
            ftol=self.options.decrease,
            xtol=self.options.step,
            gtol=None,
            max_nfev=self.options.passes,
        )
        return np.asarray(solution.x), bool(solution.success)


def _weights(e: Array, observation: Observation) -> Array:
    """1/s_j of every row, s_j the root mean square of the residual of its joint, never zero."""
    s = np.array(
        [
            np.sqrt(np.mean(e[observation.joint(j)] ** 2)) if observation.rows[j] else 0.0
            for j in range(observation.n)
        ]
    )
    s = np.maximum(s, 1e-9 * max(float(s.max()), 1e-12))
    return np.asarray(1 / np.repeat(s, observation.rows))
