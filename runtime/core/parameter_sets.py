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
    """Return the estimates of the essential and of all parameters, and the settings of each fit.

    The method of estimation is linear.
    """
    essential = EstimateSettings(settings.method, settings.weights, reduced.names, settings.options)
    sets: dict[SetName, Estimate] = {"essential": reduced.estimate, "all": reduced.all_parameters}
    return sets, {"essential": essential, "all": settings}


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


def physical_possible(observation: Observation, settings: EstimateSettings, fit: Estimate) -> bool:
    """Whether a second fit, of physically consistent parameters, is possible after this fit.

    `fit` has all parameters. This needs all columns, a fit with status ok, and weights other than
    "covariance".
    """
    whole = settings.columns == "all" and fit.status == "ok"
    return whole and settings.weights != "covariance"


def physical_set(problem: Problem, observation: Observation) -> tuple[Estimate, EstimateSettings]:
    """Fit physically consistent parameters to all rows; return the fit, and settings to repeat it.

    The settings are for later fits to parts of the rows: they fix the prior, its weight and the
    bounds by reach as found from all rows.
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
