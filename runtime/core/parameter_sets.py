"""Which set of parameters predicts unseen data best: essential, physically consistent or all?

    essential    fewest columns, the others zero
    feasible     all columns; values of a physically possible robot, close to the values of the
                 robot file if there are any
    all          least squares

The feasible set is used and is printed first, unless all parameters predict unseen data better by
more than 5 % (PREFERRED_SET in limits.toml). Unseen data are the validation records. Without them,
they are the second half of the record, and also the fifths of `held_out_validation`: half a record
may not determine friction, if a joint moves in one direction only. Both sets then fail on the other
half, and their order means nothing. The feasible set needs semidefinite programs: it is fitted only
if it may be used (`physical_asked`), or if the essential set is used and a program needs all
parameters. The weight of its prior and its bounds by reach are found from all rows; fits of parts
of the rows then use these values.

The essential set shows which parameters explain the torques. Its standard deviations assume that
the removed parameters are zero, but their true values bias the others: 95 % intervals hold 67 to 74
% of the true values (benchmarks/truth.md). With essential: {first: true}, the choice of the
chapter, the essential set is used if it predicts as well as all; the feasible set is then not
fitted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np

from runtime.core.essential import Essential, essential_of
from runtime.core.least_squares.estimate import Estimate
from runtime.core.problem import Problem, estimated
from runtime.core.rows.observation import Observation, halves
from runtime.core.study import EstimateSettings, Weights
from runtime.core.validation import CrossValidation, cross_validation, split_validation
from runtime.ground.documents import NanIfNull, Vector, Whole
from runtime.ground.errors import InputError, instant
from runtime.ground.limits import LIMIT
from runtime.ground.progress import at

SetName = Literal["essential", "feasible", "all"]
ORDER: tuple[SetName, ...] = ("essential", "feasible", "all")


@dataclass(frozen=True, eq=False)
class Sets(Mapping[SetName, Estimate]):
    """Estimates of the sets of parameters from all rows, and which set answers which question.

        used     which set predicts best?                   `best_set`: printed first, verdict
        whole    which set has a value for every column?    `whole_set`: robot files, programs

    As a mapping it has the sets that were fitted, by name; it is empty if the method is not linear.
    In that case the set of all parameters, by the method of the study, answers both questions.

    Attributes
    ----------
    all : Estimate
        All parameters, by the method of the study.
    essential : Estimate or None
        The essential parameters; None if the method is not linear.
    feasible : Estimate or None
        Parameters of a physical robot; None if they were not fitted.
    settings : mapping of str to EstimateSettings
        Settings that fit each set again, to parts of the rows.
    first : bool
        Whether the essential set may be used: essential.first of the study.
    errors : mapping of str to float, %
        Largest relative error of torques that each set predicts for unseen data; empty if nothing
        was predicted.
    """

    all: Estimate
    essential: Estimate | None = None
    feasible: Estimate | None = None
    settings: Mapping[SetName, EstimateSettings] = field(default_factory=dict)
    first: bool = False
    errors: Mapping[SetName, float] = field(default_factory=dict)

    @cached_property
    def _fitted(self) -> dict[SetName, Estimate]:
        if self.essential is None:
            return {}
        fits: dict[SetName, Estimate] = {"essential": self.essential, "all": self.all}
        return fits if self.feasible is None else {**fits, "feasible": self.feasible}

    def __getitem__(self, name: SetName) -> Estimate:
        return self._fitted[name]

    def __iter__(self) -> Iterator[SetName]:
        return iter(self._fitted)

    def __len__(self) -> int:
        return len(self._fitted)

    @property
    def used(self) -> SetName:
        """Name of the set that is used: it predicts unseen data best."""
        return best_set(self.errors, self.first) if self else "all"

    @property
    def whole(self) -> SetName:
        """Name of the set that is written where every base parameter needs a value."""
        return whole_set(self, self.used) if self else "all"

    def wider(self, moves: Mapping[str, float]) -> Sets:
        """Return the sets with deviations sqrt(s^2 + dX^2), s being the present deviations.

        moves : change dX of each parameter, SI, if the model had what it lacks.
        """

        def own(fit: Estimate) -> Estimate:
            dX = np.array([moves.get(name, 0.0) for name in fit.names])
            return replace(fit, sigma_corrected=np.hypot(fit.sigma_corrected, dX))

        return replace(
            self,
            all=own(self.all),
            essential=None if self.essential is None else own(self.essential),
            feasible=None if self.feasible is None else own(self.feasible),
        )

    def estimate(self, name: SetName) -> Estimate:
        """Return the estimate of one set; if the method is not linear, return that of all
        parameters.
        """
        return self.get(name, self.all)


@dataclass(frozen=True, eq=False)
class SetDocument:
    """One set of estimated parameters (essential, feasible or all), with its values and errors.

    See `runtime.core.parameter_sets`.

    Attributes
    ----------
    name : str
        essential, feasible or all.
    count : int
        Number of parameters b.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    unseen : float, %
        Error on data that the set was not fitted to; null if nothing was predicted.
    names : tuple of str
        Names in column order.
    X : ndarray, shape (b,), SI
        Values.
    sigma_corrected : ndarray, shape (b,), SI
        Standard deviations without the assumption of independent residuals.
    standard : mapping, SI
        Standard parameters of the physical robot, by name; empty for the other sets.
    """

    name: SetName
    count: Whole
    relative_error: NanIfNull
    unseen: NanIfNull
    names: tuple[str, ...]
    X: Vector
    sigma_corrected: Vector
    standard: dict[str, float] = field(default_factory=dict)  # files of before have none

    @classmethod
    def of(cls, sets: Sets, name: SetName) -> SetDocument:
        """Make the entry of estimate.json of one of the sets."""
        fit = sets[name]
        return cls(
            name,
            len(fit.names),
            fit.relative_error,
            sets.errors.get(name, np.nan),
            fit.names,
            fit.X,
            fit.sigma_corrected,
            fit.details.get("standard", {}),
        )


def best_set(errors: Mapping[Any, float], essential: bool = False) -> SetName:
    """Return the name of the set of parameters with the smallest error on unseen data.

    errors : by set, %. essential : whether the essential set may be used. A smaller set is
      preferred if its error is nearly the smallest (within PREFERRED_SET in limits.toml). Without
      known errors, the result is "essential" if that set may be used, else "all".
    """
    candidates = ORDER if essential else ORDER[1:]
    known = {name: errors[name] for name in candidates if np.isfinite(errors.get(name, np.nan))}
    if not known:
        return "essential" if essential else "all"
    limit = LIMIT.PREFERRED_SET * min(known.values())
    return next(name for name, error in known.items() if error <= limit)


def whole_set(names: Collection[SetName], model_columns: SetName) -> SetName:
    """Return the name of the set of parameters to use where every base parameter needs a value.

    A robot file, for instance, needs all of them. The result is the set in use or, if that is the
    essential set, the physical set ("all" if `names` has no physical set).
    """
    if model_columns != "essential":
        return model_columns
    return "feasible" if "feasible" in names else "all"


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


def physical_method(problem: Problem, fit: Estimate) -> str | None:
    """Return the name of the method that fits the physical set after the fit of all parameters.

    Return None if the fit is not possible: it needs such a method, a linear method of the study, a
    fit with status ok that has every inertial base parameter (friction and other elements may be
    left out), and weights other than "covariance".
    """
    settings, needed = problem.settings.estimate, {*problem.model.BASE_PARAMETERS}
    if settings.columns != "all":
        needed -= {*getattr(problem.model, "ELEMENTS", {})}
    whole = needed <= {*fit.names} and fit.status == "ok" and settings.weights != "covariance"
    if not (problem.method.linear and whole):
        return None
    return next((name for name, method in problem.methods.items() if method.physical), None)


def with_physical(problem: Problem, observation: Observation, sets: Sets) -> tuple[Sets, str]:
    """Fit physically consistent parameters to all rows, if possible, and add them to the sets.

    The settings stored with the set are for later fits to parts of the rows: they fix the prior,
    its weight and the bounds by reach at the values found from all rows. Return the sets, and a
    sentence if the fit failed.
    """
    name = physical_method(problem, sets.all)
    if name is None:
        return sets, ""
    at("physical parameters")
    settings = problem.settings.estimate
    options = {"linear": settings.options} if settings.options else {}
    weights: Weights = "joint" if problem.method.weighs else "none"
    own = EstimateSettings(name, weights, settings.columns, options)
    try:
        fit = estimated(problem, observation, own)
    except InputError as e:
        return sets, f"physical parameters: {e}"
    if fit.status != "ok":
        return sets, f"physical parameters: {fit.status}. {fit.message.split('. ')[0]}"
    decided = fit.details["options"]
    known = {"prior": decided["prior"], "reach": decided["reach"]}
    if decided["prior"] != "none":
        known["weight"] = fit.details["weight"]
    again = replace(own, options={**options, **known})
    return replace(sets, feasible=fit, settings={**sets.settings, "feasible": again}), ""


def written_sets(problem: Problem, observation: Observation, sets: Sets) -> Sets:
    """Add the physical set if the essential set is used.

    A robot file or a program needs all parameters, which the essential set does not have.
    """
    if sets.used != "essential" or sets.feasible is not None:
        return sets
    return with_physical(problem, observation, sets)[0]


def held_out_validation(
    problem: Problem, observation: Observation, choices: Mapping[Any, EstimateSettings]
) -> CrossValidation:
    """Divide the record into equal parts, and predict each part by a fit of the other parts.

    The record has five parts (HELD_OUT_PARTS in limits.toml).
    """
    folds = []
    for rest, part in observation.folds(LIMIT.HELD_OUT_PARTS):
        label = f"[{', '.join(map(instant, part.span))}] s"
        name = f"all but {label}"
        folds.append(cross_validation(problem, rest, {label: part}, choices, name=name))
    predictions = tuple(p for fold in folds for p in fold.predictions if not p.fitted)
    missing = tuple(text for fold in folds for text in fold.missing)
    return CrossValidation(folds[0].joints, predictions, missing, folds=LIMIT.HELD_OUT_PARTS)


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


def fit_problem(
    problem: Problem, observation: Observation, provenance: Mapping[str, Any]
) -> tuple[Sets, Essential]:
    """Fit all parameters to the rows Y = W X + rho of a problem, then only the essential ones.

    The essential parameters, and their elimination, are those of the linear companion of the
    method.
    """
    study = problem.settings
    at("least squares, essential parameters")
    essential = essential_of(
        problem.linear_system(observation),
        study.essential,
        model=problem.model,
        provenance=provenance,
    )
    own = replace(study.estimate, columns=essential.names)
    if problem.method.linear:
        return Sets(
            all=essential.all_parameters,
            essential=essential.estimate,
            settings={"essential": own, "all": study.estimate},
            first=study.essential.first,
        ), essential
    at(study.estimate.method)
    fit = estimated(problem, observation, provenance=provenance)
    return Sets(fit, settings={"all": study.estimate, "essential": own}), essential


def validated(
    problem: Problem,
    sets: Sets,
    observation: Observation,
    unseen: Mapping[str, Observation],
    name: str,
) -> tuple[Sets, tuple[CrossValidation, ...], tuple[str, ...]]:
    """Validate each set of parameters: predict the torques of data that were not fitted.

    The data are other parts of the records (time windows or fifths), then separate records.

    Return three values: the sets with their errors, and with the physical set if it may be used;
    the predictions; and sentences on the predictions or fits that failed. Fifths of the records are
    used if halves of the records prefer all parameters to the physical set. Nothing is predicted if
    a nonlinear method did not converge, because each prediction would simulate a wrong loop.
    """
    study = problem.settings
    status = sets.all.status
    if status != "ok" and not problem.method.linear:
        return sets, (), (f"validation: {study.estimate.method} ended with status {status}",)
    at("validation")
    predict = partial(_validation, problem, observation, unseen, name)
    validation, missing = predict(sets.settings, sets or {"all": sets.all})
    if physical_asked(_errors(validation), study.essential.first):
        sets, failure = with_physical(problem, observation, sets)
        missing = (failure, *missing) if failure else missing
    if sets.feasible is not None:
        choice = {"feasible": sets.settings["feasible"]}
        physical, more = predict(choice, {"feasible": sets.feasible})
        validation = tuple(map(CrossValidation.beside, validation, physical))
        missing = tuple(dict.fromkeys((*missing, *more)))
        halved = not unseen and not study.validate.split
        if halved and validation and best_set(validation[0].errors()) == "all":
            by_fifths = held_out_validation(problem, observation, sets.settings)
            validation, missing = (by_fifths,), by_fifths.missing
    return replace(sets, errors=_errors(validation)), validation, missing


def _errors(validation: Sequence[CrossValidation]) -> dict[SetName, float]:
    """Return the error of each set (essential, feasible, all) on the last data it predicts, %."""
    errors = validation[-1].errors() if validation else {}
    return {name: errors[name] for name in ORDER if name in errors}


def _validation(
    problem: Problem,
    observation: Observation,
    unseen: Mapping[str, Observation],
    name: str,
    choices: Mapping[Any, EstimateSettings],
    known: Mapping[Any, Estimate],
) -> tuple[tuple[CrossValidation, ...], tuple[str, ...]]:
    """Predict other time windows, then other records, with every set of parameters.

    The sets `choices` are fitted again to the first window; further records are predicted with the
    estimates `known`, from all rows. Return the validations, and sentences on those that failed.
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
