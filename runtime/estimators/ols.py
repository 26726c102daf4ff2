"""Ordinary least squares, eq. (7): every row counts the same, in N m.

X = argmin ||Y - W X||,    C = sigma_rho^2 (W'W)^-1,    sigma_rho^2 = ||Y - W X||^2 / (r - b)
"""

from __future__ import annotations

from runtime.errors import SettingsError
from runtime.estimators.linear import System, checked_options, raw_factor
from runtime.observation.observation import Observation
from runtime.settings.study import EstimateSettings


def system(observation: Observation, settings: EstimateSettings) -> System:
    """The rows as they are."""
    if settings.weights != "none":
        raise SettingsError(f"{settings.weights!r} with method ols; weights belong to method wls", path=("estimate", "weights"))
    options = checked_options(settings)
    raw = raw_factor(observation, settings)
    return System(observation, settings, raw, raw, (1.0,) * observation.n, options=options)
