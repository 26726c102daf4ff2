"""Method DIDIM: direct and inverse dynamic identification models.

The measured torques are fitted with the regressor of the simulated motion:

    X^(k+1) = argmin sum_j ||Y_j - Z_j^k X||^2 / s_j^2,
            Z^k = F_p[W(q_s, qd_s, qdd_s)] of the simulation with X^k

DIDIM needs the measured torque, the reference, and only the first of the measured positions. Z
passes through the decimation only, because simulated states are exact. DIDIM is an output-error
method on the torque whose Jacobian leaves out the loop (the loop holds q_s near q_r). C =
(Z'VZ)^-1. The residual is computed with the simulated motion. This residual is larger than that of
IV with the same X, because Z does not contain the motion that effects outside the model cause.

Reference: Gautier, Janot and Vandanjon (2013).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from runtime.core.least_squares.linear import System, standard_deviations
from runtime.core.least_squares.method import Beginning, Fitted
from runtime.core.least_squares.wls import weighted_system
from runtime.core.rows.factor import Array
from runtime.loop.closed_loop import loop_of
from runtime.loop.fixed_point import Step, iterate, outcome_of
from runtime.loop.result import Simulation
from runtime.loop.simulated_motion import simulating_method

ROUNDING = (
    "{method} uses only the first recorded position, so rounding the record says nothing about an "
    "encoder in the loop, whose steps the controller answers; place: loop studies that."
)


def fit(start: Beginning) -> Fitted:
    """Fit the parameters by method DIDIM, which simulates the closed loop in each pass.

    `details` holds the list of passes, and the contraction (ratio of the last two changes of X).
    Raise SettingsError if no loop is attached to the observation.
    """
    loop, observation = loop_of(start.observation, start.settings.method), start.observation

    def update(runs: Sequence[Simulation], X: Array) -> Step:
        rows = loop.simulated(runs, observation, exact=True)
        system = weighted_system(rows, "joint")
        solution = system.solve()
        C = standard_deviations(system, solution)[1]
        return Step(solution.X, C, solution.residual_norm, system)

    fixed = iterate(loop, start, update)
    system: System = fixed.step.result
    system = replace(system, settings=start.settings, iterations=len(fixed.trail))
    status, message, details = outcome_of(loop, fixed, start.settings.method)
    return Fitted(system, system.solve(), status=status, message=message, details=details)


METHOD = replace(
    simulating_method(fit, ROUNDING), intervals="which held 81 % of the values of simulated robots"
)
"""The method `didim`."""
