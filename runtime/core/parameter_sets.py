"""Nested sets of parameters of one robot: essential, feasible, all. Which predicts data it has not
seen best?

    essential    fewest columns, the others zero
    feasible     all columns, among physical robots, pulled to the values of the robot file if
                 there are any
    all          least squares

The feasible set is used and is printed first, unless all parameters predict unseen
data better by more than LIMIT.PREFERRED_SET: the validation records, else the second half of the
record and the fifths of `held_out_validation` too. Half a record may leave friction
open, where a joint moves one way; then both sets fail on the other half, and which fails less
means nothing. The feasible set needs semidefinite programs: it is fitted only if it may be used
(`physical_asked`), or if the essential set is used and a program needs all parameters. All rows
decide the weight of its prior and the bounds by reach, which fits of parts of the rows then use.

The essential set is an aid to reading: which parameters carry the model. Its deviations take the
parameters that were removed as zero, and what they are in truth moves those that stay: 95 %
intervals hold 67 to 74 % of the true values (benchmarks/truth.md). With essential: {first: true}, the
choice of the chapter, it is used if it predicts as well as all; the feasible set is
then not asked.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from runtime.core.errors import instant
from runtime.core.essential import Essential
from runtime.core.estimation import estimated
from runtime.core.least_squares.estimate import Estimate
from runtime.core.limits import LIMIT
from runtime.core.problem import Problem
from runtime.core.progress import at
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings
from runtime.core.validation import CrossValidation, cross_validation

SetName = Literal["essential", "feasible", "all"]
ORDER: tuple[SetName, ...] = ("essential", "feasible", "all")


def least_squares_sets(
    settings: EstimateSettings, reduced: Essential
) -> tuple[dict[SetName, Estimate], dict[SetName, EstimateSettings]]:
    """The essential parameters and all parameters by a linear method, and the settings of each."""
    essential = EstimateSettings(settings.method, settings.weights, reduced.names, settings.options)
    sets: dict[SetName, Estimate] = {"essential": reduced.estimate, "all": reduced.all_parameters}
    return sets, {"essential": essential, "all": settings}


def physical_asked(errors: Mapping[Any, float], first: bool) -> bool:
    """Whether the physical set may be the one that is used.

    Parameters
    ----------
    errors : mapping of float, %
        Of the essential parameters and of all on unseen data; empty if nothing was predicted.
    first : bool
        essential.first of the study.
    """
    known = np.isfinite(errors.get("essential", np.nan))
    stands = first and known and best_set(errors, essential=True) == "essential"
    return bool(errors) and not stands


def physical_possible(observation: Observation, settings: EstimateSettings, fit: Estimate) -> bool:
    """Whether a physical set can be fitted besides `fit`, all parameters by a linear method."""
    whole = settings.columns == "all" and fit.status == "ok"
    return whole and settings.weights != "covariance"


def physical_set(problem: Problem, observation: Observation) -> tuple[Estimate, EstimateSettings]:
    """The physical parameters from all rows, and the settings for fits of parts of the rows.

    These settings have the prior, its weight and the bounds by reach from all rows.
    """
    at("physical parameters")
    settings = problem.settings.estimate
    options = {"linear": settings.options} if settings.options else {}
    own = EstimateSettings(
        "feasible", "none" if settings.method == "ols" else "joint", "all", options
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
    """`cross_validation` of each of LIMIT.HELD_OUT_PARTS parts of the record from the other parts."""
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
    """Name of the set with the smallest error on unseen data, %.

    Without known errors: all parameters, or the essential ones if they may be used.
    """
    candidates = ORDER if essential else ORDER[1:]
    known = {name: errors[name] for name in candidates if np.isfinite(errors.get(name, np.nan))}
    if not known:
        return "essential" if essential else "all"
    limit = LIMIT.PREFERRED_SET * min(known.values())
    return next(name for name, error in known.items() if error <= limit)


def whole_set(names: Collection[SetName], model_columns: SetName) -> SetName:
    """Name of the set with all base parameters, for a robot file or a program.

    It is `model_columns`; if that is the essential set, the physical set if `names` has it.
    """
    if model_columns != "essential":
        return model_columns
    return "feasible" if "feasible" in names else "all"


def ranking_text(errors: Mapping[SetName, float], counts: Mapping[SetName, int], where: str) -> str:
    """The sets in the order of their errors on unseen data, in one sentence."""
    ranked = sorted((error, name) for name, error in errors.items() if np.isfinite(error))
    parts = [f"{name} ({counts[name]}) {error:.1f} %" for error, name in ranked]
    return (
        f"Predicts {where} best: {parts[0]}"
        + (f"; then {', '.join(parts[1:])}." if parts[1:] else ".")
        if parts
        else ""
    )
