"""Which set of parameters predicts unseen data best: essential, physically consistent or all?

    essential    fewest columns, the others zero
    feasible     all columns; values of a physically possible robot, close to the values of the
                 robot file if there are any
    all          least squares

The feasible set is used and is printed first, unless all parameters predict unseen data better by
more than LIMIT.PREFERRED_SET. Unseen data are the validation records. Without them, they are the
second half of the record, and also the fifths of `held_out_validation`: half a record may not
determine friction, if a joint moves one way only. Then both sets fail on the other half, and their
order means nothing. The feasible set needs semidefinite programs: it is fitted only if it may be
used (`physical_asked`), or if the essential set is used and a program needs all parameters. The
weight of its prior and its bounds by reach are found from all rows; fits of parts of the rows then
use these values.

The essential set shows which parameters explain the torques. Its standard deviations assume that
the removed parameters are zero, but their true values bias the others: 95 % intervals hold 67 to 74
% of the true values (benchmarks/truth.md). With essential: {first: true}, the choice of the
chapter, the essential set is used if it predicts as well as all; the feasible set is then not
fitted.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from runtime.core.errors import InputError, instant
from runtime.core.essential import Essential, essential_of
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.method import LINEAR, linear_companion
from runtime.core.limits import LIMIT
from runtime.core.problem import Problem, estimated
from runtime.core.progress import at
from runtime.core.rows.observation import Observation, halves
from runtime.core.study import EstimateSettings, Study
from runtime.core.validation import CrossValidation, cross_validation, split_validation

SetName = Literal["essential", "feasible", "all"]
ORDER: tuple[SetName, ...] = ("essential", "feasible", "all")


def physical_asked(errors: Mapping[Any, float], first: bool) -> bool:
    """Whether a fit of physically consistent parameters is needed for the final model.

    Parameters
    ----------
    errors : mapping of float, %
        Errors of the essential parameters and of all parameters on unseen data; empty if nothing
        was predicted.
    first : bool
        essential.first of the study.
    """
    known = np.isfinite(errors.get("essential", np.nan))
    stands = first and known and best_set(errors, essential=True) == "essential"
    return bool(errors) and not stands


def physical_possible(problem: Problem, fit: Estimate) -> bool:
    """Whether a second fit, of physically consistent parameters, is possible after this fit.

    It needs a fit with status ok that has every inertial base parameter (friction and other
    elements may be left out), and weights other than "covariance".
    """
    estimate, names = problem.settings.estimate, problem.model.BASE_PARAMETERS
    if estimate.columns != "all":
        elements = getattr(problem.model, "ELEMENTS", {})
        names = tuple(name for name in names if name not in elements)
    whole = {*names} <= {*fit.names} and fit.status == "ok"
    return whole and estimate.weights != "covariance"


def physical_set(problem: Problem, observation: Observation) -> tuple[Estimate, EstimateSettings]:
    """Fit physically consistent parameters to all rows; return the fit, and settings to repeat it.

    The settings are for later fits to parts of the rows: they fix the prior, its weight and the
    bounds by reach as found from all rows.
    """
    at("physical parameters")
    settings = problem.settings.estimate
    options = {"linear": settings.options} if settings.options else {}
    own = EstimateSettings(
        "feasible", "none" if settings.method == "ols" else "joint", settings.columns, options
    )
    fit = estimated(problem, observation, own)
    decided = fit.details["options"]
    known = {"prior": decided["prior"], "reach": decided["reach"]}
    if decided["prior"] != "none":
        known["weight"] = fit.details["weight"]
    return fit, replace(own, options={**options, **known})


def held_out_validation(
    problem: Problem, observation: Observation, choices: Mapping[Any, EstimateSettings]
) -> CrossValidation:
    """Divide the record into equal parts, and predict each part by a fit of the other parts.

    The number of parts is LIMIT.HELD_OUT_PARTS.
    """
    number, folds = observation.equal_parts(LIMIT.HELD_OUT_PARTS), []
    for p in np.unique(number):
        part = observation.where(number == p)
        label = f"[{', '.join(map(instant, part.span))}] s"
        rest, name = observation.where(number != p), f"all but {label}"
        folds.append(cross_validation(problem, rest, {label: part}, choices, name=name))
    predictions = tuple(p for fold in folds for p in fold.predictions if not p.fitted)
    missing = tuple(text for fold in folds for text in fold.missing)
    return CrossValidation(folds[0].joints, predictions, missing)


def best_set(errors: Mapping[Any, float], essential: bool = False) -> SetName:
    """Return the name of the set of parameters with the smallest error on unseen data.

    errors : by set, %. essential : whether the essential set may be used. A smaller set is
    preferred if its error is nearly the smallest (LIMIT.PREFERRED_SET). Without known errors:
    "essential" if it may be used, else "all".
    """
    candidates = ORDER if essential else ORDER[1:]
    known = {name: errors[name] for name in candidates if np.isfinite(errors.get(name, np.nan))}
    if not known:
        return "essential" if essential else "all"
    limit = LIMIT.PREFERRED_SET * min(known.values())
    return next(name for name, error in known.items() if error <= limit)


def whole_set(names: Collection[SetName], model_columns: SetName) -> SetName:
    """Return the name of the set of parameters to use where every base parameter needs a value.

    A robot file, for instance, needs all of them.

    This is `model_columns`, the set that is used. If that is the essential set, it is the physical
    set if `names` has it, else "all".
    """
    if model_columns != "essential":
        return model_columns
    return "feasible" if "feasible" in names else "all"


def ranking_text(errors: Mapping[SetName, float], counts: Mapping[SetName, int], where: str) -> str:
    """Write in one sentence how well each set of parameters predicts unseen data, best first.

    counts : number of parameters of each set. where : name of the unseen data.
    """
    ranked = sorted((error, name) for name, error in errors.items() if np.isfinite(error))
    parts = [f"{name} ({counts[name]}) {error:.1f} %" for error, name in ranked]
    return (
        f"Predicts {where} best: {parts[0]}"
        + (f"; then {', '.join(parts[1:])}." if parts[1:] else ".")
        if parts
        else ""
    )


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
    essential = replace(study.estimate, columns=reduced.names)
    if study.estimate.method in LINEAR:
        return Fits(
            reduced.all_parameters,
            reduced,
            {"essential": reduced.estimate, "all": reduced.all_parameters},
            {"essential": essential, "all": study.estimate},
        )
    at(study.estimate.method)
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
    possible = linear and physical_possible(problem, fits.estimate)
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
