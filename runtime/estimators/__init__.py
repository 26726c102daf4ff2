"""Estimators, one file per method; `estimate` finds the method by its name.

ols   ordinary least squares               runtime/estimators/ols.py
wls   least squares weighted by joint      runtime/estimators/wls.py
irls  robust least squares, Huber or Tukey    runtime/estimators/irls.py
tls   total least squares with exact columns    runtime/estimators/tls.py
iv    instrumental variables of the simulated closed loop    runtime/estimators/iv.py
cloe    output error of the closed loop, position or torque    runtime/estimators/cloe.py
didim   torques on the regressor of the simulated motion    runtime/estimators/didim.py
feasible  least squares among physical robots, extra consistency    runtime/estimators/feasible.py
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from runtime.errors import SettingsError
from runtime.estimators import cloe, didim, feasible, irls, iv, ols, tls, wls
from runtime.estimators.estimate import Estimate
from runtime.estimators.linear import System, assemble
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import Observation
from runtime.observation.reduction import Reduction
from runtime.settings.study import EstimateSettings

T = TypeVar("T")

__all__ = ["CLOSED_LOOP", "LINEAR", "METHODS", "estimate", "linear_companion", "linear_system", "point_estimate"]


class Estimator(Protocol):
    """An estimation method."""

    def __call__(
        self, observation: Observation, settings: EstimateSettings, *, model: GeneratedModel | None, provenance: Mapping[str, Any] | None
    ) -> Estimate:
        """The Estimate of one observation."""


LINEAR: Mapping[str, Callable[[Observation | Reduction, EstimateSettings], System]] = {"ols": ols.system, "wls": wls.system}
"""Methods that are one least-squares problem in the rows of the observation."""


def linear_system(observation: Observation | Reduction, settings: EstimateSettings) -> System:
    """The factored rows as the method of `settings` weighs them; raises SettingsError for a method that is not one linear system."""
    return _known(LINEAR, settings.method)(observation, settings)


def linear_companion(settings: EstimateSettings) -> EstimateSettings:
    """The settings themselves where their method is one linear system; else least squares with the same weights and columns.

    Essential parameters and weak directions of such a method are those of its companion.
    """
    if settings.method in LINEAR:
        return settings
    return EstimateSettings("ols" if settings.weights == "none" else "wls", settings.weights, settings.columns)


def point_estimate(settings: EstimateSettings) -> EstimateSettings:
    """The settings of an estimate whose deviations nobody reads: without resampling."""
    return replace(settings, options={**settings.options, "bootstrap": 0}) if settings.method in ("feasible", "tls") else settings


def linear_estimate(
    observation: Observation | Reduction, settings: EstimateSettings, *, model: GeneratedModel | None, provenance: Mapping[str, Any] | None
) -> Estimate:
    """Solve the system of a linear method."""
    system = linear_system(observation, settings)
    return assemble(system, system.solve(), model=model, provenance=provenance)


CLOSED_LOOP = ("iv", "didim", "cloe")
"""Methods that simulate the closed loop of the records."""

METHODS: Mapping[str, Estimator] = {
    **dict.fromkeys(LINEAR, linear_estimate),
    "cloe": cloe.cloe,
    "didim": didim.didim,
    "feasible": feasible.feasible,
    "irls": irls.irls,
    "iv": iv.iv,
    "tls": tls.tls,
}
"""Every method, by the name that `estimate.method` of a study gives it."""


def estimate(
    observation: Observation | Reduction,
    settings: EstimateSettings | None = None,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """Parameters of Y = W X + rho by the method that `settings` names; by ols or wls where the record was read by blocks.

    model : gives units, joint numbers and the hash of the robot file.
    provenance : further entries for Estimate.provenance (a seed, the study file).
    """
    settings = settings or EstimateSettings()
    if isinstance(observation, Reduction):
        return linear_estimate(observation, settings, model=model, provenance=provenance)
    return _known(METHODS, settings.method)(observation, settings, model=model, provenance=provenance)


def _known(methods: Mapping[str, T], name: str) -> T:
    if name not in methods:
        raise SettingsError(f"{name!r} is not available here; expected {' or '.join(methods)}", path=("estimate", "method"))
    return methods[name]
