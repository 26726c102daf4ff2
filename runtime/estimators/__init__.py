"""Estimators, one file per method; `estimate` finds the method by its name.

ols   ordinary least squares               runtime/estimators/ols.py
wls   least squares weighted by joint      runtime/estimators/wls.py
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from runtime.errors import SettingsError
from runtime.estimate import Estimate
from runtime.estimators import ols, wls
from runtime.estimators.linear import System, assemble
from runtime.model import GeneratedModel
from runtime.observation import Observation
from runtime.study import EstimateSettings

__all__ = ["LINEAR", "estimate", "linear_system"]

LINEAR: Mapping[str, Callable[[Observation, EstimateSettings], System]] = {"ols": ols.system, "wls": wls.system}
"""Methods that are one least-squares problem in the rows of the observation."""


def linear_system(observation: Observation, settings: EstimateSettings) -> System:
    """The factored rows as the method of `settings` weighs them; raises SettingsError for a method that is not one linear system."""
    if settings.method not in LINEAR:
        raise SettingsError(f"{settings.method!r} cannot be used here; expected {' or '.join(LINEAR)}", path=("estimate", "method"))
    return LINEAR[settings.method](observation, settings)


def estimate(
    observation: Observation,
    settings: EstimateSettings | None = None,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """Parameters of Y = W X + rho by the method that `settings` names.

    model : gives units, joint numbers and the hash of the robot file.
    provenance : further entries for Estimate.provenance (a seed, the study file).
    """
    system = linear_system(observation, settings or EstimateSettings())
    return assemble(system, system.solve(), model=model, provenance=provenance)
