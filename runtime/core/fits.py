"""Estimates of all, of the essential and of the physical parameters, and their validation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from runtime.core.errors import InputError
from runtime.core.essential import Essential, essential_of
from runtime.core.estimation import estimated
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.method import LINEAR, linear_companion
from runtime.core.parameter_sets import (
    SetName,
    best_set,
    held_out_validation,
    least_squares_sets,
    physical_asked,
    physical_possible,
    physical_set,
)
from runtime.core.problem import Problem
from runtime.core.progress import at
from runtime.core.rows.observation import Observation, halves
from runtime.core.study import EstimateSettings, Study
from runtime.core.validation import CrossValidation, cross_validation, split_validation


@dataclass(frozen=True)
class Fits:
    """Estimates from all rows of the records, one for each set of parameters (essential, all, ...).

    Attributes
    ----------
    estimate : Estimate
        All parameters, by the method of the study.
    reduced : Essential
        The essential parameters, by the linear companion of that method.
    sets : mapping of str to Estimate
        Estimates of the sets "essential" and "all", and of "feasible" if it was fitted; empty if
        the method is not linear.
    settings : mapping of str to EstimateSettings
        Settings that fit each set from parts of the rows.
    """

    estimate: Estimate
    reduced: Essential
    sets: Mapping[SetName, Estimate]
    settings: Mapping[Any, EstimateSettings]

    def best(self, validation: Sequence[CrossValidation], study: Study) -> Estimate:
        """Return the estimate of the set of parameters that best predicts data not fitted.

        If the method is not linear, return the estimate of all parameters.
        """
        errors = validation[-1].errors() if validation and self.sets else {}
        return self.sets.get(best_set(errors, study.essential.first), self.estimate)


def fit_problem(problem: Problem, observation: Observation, provenance: Mapping[str, Any]) -> Fits:
    """Fit all parameters to the rows Y = W X + rho of a problem, then only the essential ones."""
    study, model = problem.settings, problem.model
    at("least squares, essential parameters")
    reduced = essential_of(
        observation,
        study.essential,
        linear_companion(study.estimate),
        model=model,
        provenance=provenance,
    )
    if study.estimate.method in LINEAR:
        return Fits(reduced.all_parameters, reduced, *least_squares_sets(study.estimate, reduced))
    at(study.estimate.method)
    essential = replace(study.estimate, columns=reduced.names)
    return Fits(
        estimated(problem, observation, provenance=provenance),
        reduced,
        {},
        {"all": study.estimate, "essential": essential},
    )


def validated(
    problem: Problem,
    fits: Fits,
    observation: Observation,
    unseen: Mapping[str, Observation],
    name: str,
) -> tuple[Fits, tuple[CrossValidation, ...], tuple[str, ...]]:
    """Validate each set of parameters: predict the torques of data that were not fitted.

    The data are other parts of the records (time windows or fifths), then separate records.

    Return three values: the fits, with the physical set if it may be used; the predictions; and
    sentences on the predictions or fits that failed. Fifths of the records are used if their halves
    prefer all parameters to the physical ones. Nothing is predicted if a nonlinear method did not
    converge, because each prediction would simulate a wrong loop.
    """
    study = problem.settings
    method, status = study.estimate.method, fits.estimate.status
    if status != "ok" and method not in LINEAR:
        return fits, (), (f"validation: {method} ended with status {status}",)
    at("validation")
    predict = partial(_validation, problem, observation, unseen, name)
    validation, missing = predict(fits.settings, fits.sets or {"all": fits.estimate})
    errors = validation[-1].errors() if validation else {}
    linear = method in LINEAR
    possible = linear and physical_possible(observation, study.estimate, fits.estimate)
    if possible and physical_asked(errors, study.essential.first):
        try:
            fit, settings = physical_set(problem, observation)
        except InputError as e:
            return fits, validation, (f"physical parameters: {e}", *missing)
        if fit.status != "ok":
            reason = f"physical parameters: {fit.status}. {fit.message.split('. ')[0]}"
            return fits, validation, (reason, *missing)
        sets, choices = {**fits.sets, "feasible": fit}, {**fits.settings, "feasible": settings}
        fits = replace(fits, sets=sets, settings=choices)
        physical, more = predict({"feasible": settings}, {"feasible": fit})
        validation = tuple(map(CrossValidation.beside, validation, physical))
        missing = tuple(dict.fromkeys((*missing, *more)))
    halved = not unseen and not study.validate.split and "feasible" in fits.sets
    if halved and validation and best_set(validation[0].errors()) == "all":
        by_fifths = held_out_validation(problem, observation, fits.settings)
        validation, missing = (by_fifths,), by_fifths.missing
    return fits, validation, missing


def _validation(
    problem: Problem,
    observation: Observation,
    unseen: Mapping[str, Observation],
    name: str,
    choices: Mapping[Any, EstimateSettings],
    known: Mapping[Any, Estimate],
) -> tuple[tuple[CrossValidation, ...], tuple[str, ...]]:
    """Predict other time windows, then other records, with every set of parameters.

    Between windows, the sets `choices` are fitted again; on further records the estimates `known`,
    from all rows, are used. Return the validations, and sentences on those that failed.
    """
    validation, missing = [], []
    try:
        windows = problem.settings.validate.split or halves(*observation.span)
        validation.append(split_validation(problem, observation, windows, choices))
    except InputError as e:
        missing.append(f"validation between windows of the record: {e}")
    if unseen:
        validation.append(
            cross_validation(
                problem, observation, unseen, choices, name=name, fitted=known, further=True
            )
        )
    missing += [text for part in validation for text in part.missing]
    return tuple(validation), tuple(missing)
