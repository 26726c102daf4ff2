"""DIDIM: direct and inverse dynamic identification models; measured torques on the regressor of the simulated motion.

    X^(k+1) = argmin sum_j ||Y_j - Z_j^k X||^2 / s_j^2,     Z^k = F_p[W(q_s, qd_s, qdd_s)] of the simulation with X^k

Needs the measured torque and the reference; of the measured position only its start. Z passes the decimation alone: simulated states are
exact. It is output error on the torque with the Jacobian of the loop left out (the loop holds q_s near q_r). C = (Z'VZ)^-1. The residual is that
of the simulated motion, larger than that of IV with the same X: what moved the arm besides the model is not in Z.

Reference: Gautier, Janot and Vandanjon (2013).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from runtime.estimators import wls
from runtime.estimators.closed_loop import SimulatedRun, loop_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.fixed_point import Array, Step, full, iterate, options_of, outcome_of, trail_of
from runtime.estimators.linear import System, assemble, columns_asked, standard_deviations
from runtime.estimators.simulated_motion import judged
from runtime.model.generated import GeneratedModel
from runtime.observation.system import Observation
from runtime.settings.study import EstimateSettings


def didim(
    observation: Observation,
    settings: EstimateSettings,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """The Estimate; `details`: trail of the passes, contraction, `motion` simulated beside measured. SettingsError where no loop is attached to the observation."""
    loop, options = loop_of(observation, "didim"), options_of(settings)
    observation = observation.columns(columns_asked(observation, settings))

    def update(runs: Sequence[SimulatedRun], X: Array) -> Step:
        system = wls.system(loop.motion(runs, observation), EstimateSettings(method="wls"))
        fit = system.solve()
        _, C = standard_deviations(system, fit)
        return Step(fit.X, C, fit.residual_norm, system)

    fixed = iterate(loop, observation, options, update)
    status, message = outcome_of(loop, fixed, options, "DIDIM")
    apart, note, motion = judged(loop, observation, full(observation.names, fixed.step.X, loop.model.BASE_PARAMETERS))
    status = status if status != "ok" else apart
    system: System = fixed.step.kept
    estimate = assemble(replace(system, settings=settings, iterations=len(fixed.trail)), system.solve(), model=model, provenance=provenance)
    return replace(
        estimate,
        status=status if estimate.status == "ok" else estimate.status,
        message=" ".join(part for part in (estimate.message, message, note) if part),
        details={"trail": trail_of(fixed), "contraction": fixed.contraction, **motion},
    )
