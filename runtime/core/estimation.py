"""Estimation of the parameters X from records, by eqs. (6) to (11) of the chapter.

rows = observe_rows(problem)
fit  = estimated(problem, rows)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from runtime.core.errors import SettingsError
from runtime.core.essential import Essential, essential_of
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import assemble
from runtime.core.least_squares.method import Beginning, Method, linear_companion
from runtime.core.model import GeneratedModel
from runtime.core.problem import Problem
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import stacked
from runtime.core.study import EstimateSettings

Array = np.ndarray


def observe_rows(problem: Problem) -> Observation:
    """Build the observation matrix W and the torques Y of all fitted records.

    A method of estimation may have its own function for this step (`Method.observe`).

    Parameters
    ----------
    problem : Problem
        A prepared problem.

    Returns
    -------
    Observation
        Y = W X + rho, eqs. (6) and (14), rows joint-major.

    Raises
    ------
    InputError
        There is no record, or no row of a record is left.
    """
    method = problem.method
    return (
        stacked(problem.model, problem.prepared)
        if method.observe is None
        else method.observe(problem)
    )


def observed_unseen(problem: Problem, k: int) -> Observation:
    """Build W and Y of validation record k, counted from 0, which is not used for the fit."""
    alone = problem.changed(records=(problem.unseen[k],), unseen=())
    if "prepared_unseen" in vars(problem):
        alone.prepared[0].take_states(problem.prepared_unseen[k])
    return observe_rows(alone)


def estimated(
    problem: Problem,
    rows: Observation,
    settings: EstimateSettings | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """Estimate the parameters X of a problem from given rows Y = W X + rho of its records.

    settings : method of estimation; default: the settings of the problem.
    """
    settings = settings or problem.settings.estimate
    return estimate_of(rows, settings, problem.methods, model=problem.model, provenance=provenance)


def estimate(problem: Problem) -> Estimate:
    """Estimate all parameters from the records of a problem, by the method in its settings."""
    return estimated(problem, observe_rows(problem), provenance=problem.provenance)


def essential(problem: Problem) -> Essential:
    """Find the essential parameters of a problem (model, records and settings).

    A method of estimation that is not linear is replaced by least squares with the same weights
    (`linear_companion`).
    """
    settings = problem.settings
    return essential_of(
        observe_rows(problem),
        settings.essential,
        linear_companion(settings.estimate),
        model=problem.model,
        provenance=problem.provenance,
    )


def estimate_of(
    observation: Observation,
    settings: EstimateSettings,
    methods: Mapping[str, Method],
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """Estimate X of Y = W X + rho by the method that `settings` names.

    Parameters
    ----------
    observation : Observation
        Rows of the records.
    settings : EstimateSettings
        Method, weights, columns, options.
    methods : mapping of str to Method
        All methods, by name.
    model : GeneratedModel, optional
        Model that gives units, joint numbers and the hash of the robot file.
    provenance : mapping, optional
        Further entries for Estimate.provenance (a seed, the study file).
    """
    method = method_of(settings, methods)
    system = method.system(observation, settings)
    solution = system.solve()
    if method.fit is None or (solution.rank < len(system.names) and not method.any_rank):
        return assemble(system, solution, model=model, provenance=provenance)
    rows, options = observation.columns(system.names), method.checked(settings)
    fitted = method.fit(Beginning(rows, settings, options, system, solution, model))
    estimate = assemble(fitted.system, fitted.solution, model=model, provenance=provenance)
    C = estimate.covariance if fitted.covariance is None else fitted.covariance
    return replace(
        estimate,
        covariance=C,
        sigma=estimate.sigma if fitted.covariance is None else np.sqrt(np.diag(C)),
        sigma_corrected=estimate.sigma_corrected if fitted.corrected is None else fitted.corrected,
        status=fitted.status if estimate.status == "ok" else estimate.status,
        message=" ".join(note for note in (estimate.message, fitted.message) if note),
        details=fitted.details,
    )


def method_of(settings: EstimateSettings, methods: Mapping[str, Method]) -> Method:
    """Return the method of estimation that `settings` names; SettingsError if it is unknown."""
    if settings.method not in methods:
        raise SettingsError(
            f"unknown method {settings.method!r}; expected {' or '.join(methods)}",
            path=("estimate", "method"),
        )
    return methods[settings.method]


def point_estimate(settings: EstimateSettings, methods: Mapping[str, Method]) -> EstimateSettings:
    """Return settings for a faster fit that gives X only, without explanations for the user.

    Methods that have no such options use the settings unchanged.
    """
    brief = method_of(settings, methods).brief
    return replace(settings, options={**settings.options, **brief}) if brief else settings
