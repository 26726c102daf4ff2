"""The identification of one robot from the records of a prepared problem, with everything a report says about it.

problem -> Y = W X + rho -> all parameters, eqs. (7)-(11), and the essential ones
        -> measured beside predicted torques, windows of the records against each other, parameters that trade
        -> where they are asked for: a load, feasibility, friction curves
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from runtime.advisor.advisor import advise
from runtime.controller.fitted import gain_doubt
from runtime.core.cestac.cestac import cestac
from runtime.core.errors import InputError
from runtime.core.estimation import observed, observed_unseen
from runtime.core.fits import agreement, fitted, validated
from runtime.core.model import GeneratedModel, is_axis
from runtime.core.problem import Problem
from runtime.core.provenance import record_names
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.core.uncertainty import uncertainty
from runtime.core.validation import direct_comparison, weak_directions
from runtime.elastic import elasticity
from runtime.friction.curves import friction_curves
from runtime.laws.scalars import KIND as LAWS
from runtime.payload.study import payload_study
from runtime.physical.inertia import physical_model
from runtime.plausible.plausibility import plausibility

if TYPE_CHECKING:
    from runtime.physical.feasibility import Feasibility

__all__ = ["Identification", "assess", "feasibility_of", "identify"]

T = TypeVar("T")
NO_CHECKS = "plausibility of the record: not judged beside force sensors; identify without them too"
NO_CHECKS_AT_REST = "plausibility of the record: not judged for poses at rest"


def identify(
    problem: Problem,
    *,
    loaded: Sequence[Record] = (),
    physical: bool = False,
    friction: bool = False,
    variants: GeneratedModel | None = None,
    plausible: bool = False,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Parameters of a robot from a prepared problem, and how far to trust them.

    Parameters
    ----------
    problem : Problem
        Prepared.
    loaded : sequence of Record
        Records with the load of settings.payload, prepared by the same steps.
    physical : bool
        Whether a physical robot can have the parameters.
    friction : bool
        Curves of friction against velocity, joint by joint.
    variants : GeneratedModel, optional
        The module of `symgen.variants`: other tables of frames and directions of gravity are tried on the records.
    plausible : bool
        Whether record, study and robot file suit each other (`runtime.plausibility`).
    provenance : mapping, optional
        What else reproduces the result; names of the records, hashes and versions are added.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        A record, setting or extra that does not suit what is asked for.
    """
    model, settings = problem.model, problem.settings
    static = settings.signals.reader == "static"
    provenance = {**problem.provenance, **(provenance or {})}
    names = record_names([*problem.records, *problem.unseen])
    fitted_names, unseen_names = names[: len(problem.records)], names[len(problem.records) :]
    observation = observed(problem)
    fits = fitted(problem, observation, provenance)
    doubt = gain_doubt(problem, fits.estimate.relative_error)
    notes = [note.text for note in problem.notes if note.text and note.kind != "signals"]
    observation = _with_findings(observation, *notes, doubt)
    unseen = {name: observed_unseen(problem, k) for k, name in enumerate(unseen_names)}
    fits, validation, missing = validated(
        problem, fits, observation, unseen, ", ".join(fitted_names)
    )
    if plausible and (static or any(is_axis(joint) for joint in model.JOINTS)):
        missing = (*missing, NO_CHECKS_AT_REST if static else NO_CHECKS)
        plausible = False
    comparison = direct_comparison(observation, fits.best(validation, settings))
    laws = problem.noted(LAWS)
    result = Identification(
        problem=problem,
        observation=observation,
        estimate=fits.estimate,
        essential=fits.reduced,
        comparison=comparison,
        validation=validation,
        sets=fits.sets,
        homogeneity=agreement(problem, fits, observation, fitted_names, unseen),
        missing=missing,
        correlations=weak_directions(observation, settings.estimate),
        uncertainty=uncertainty(observation, settings.estimate, fits.reduced, comparison),
        laws=None if laws is None else laws.result,
    )
    if physical and not result.determined:
        groups = "; ".join(", ".join(group) for group in result.estimate.groups)
        text = f"physical consistency: the record does not tell apart {groups}"
        result, physical = replace(result, missing=(*missing, text)), False
    result = result if static else _with_elasticity(result)
    return replace(
        result,
        payload=payload_study(problem, loaded) if cast(Any, settings).payload else None,
        feasibility=feasibility_of(result) if physical else None,
        friction=friction_curves(problem, result.estimate) if friction else (),
        plausibility=plausibility(problem, variants=variants) if plausible else None,
    )


def _with_findings(observation: Observation, *sentences: str) -> Observation:
    """The observation with further findings; itself, with the factor it holds, where all are ""."""
    if not any(sentences):
        return observation
    return replace(observation, findings=(*observation.findings, *filter(None, sentences)))


def _with_elasticity(result: Identification) -> Identification:
    """The result with the stiffness of transmissions whose motor and link are both measured."""
    if not result.determined:
        return result
    fit = result.estimate
    elastic = elasticity(result.problem, fit.names, fit.X)
    if elastic is None:
        return result
    return replace(
        result,
        observation=_with_findings(result.observation, *elastic.sentences),
        estimate=replace(fit, provenance={**fit.provenance, "elastic": elastic.summary()}),
    )


def feasibility_of(result: Identification) -> Feasibility:
    """Whether a physical robot can have the parameters of an identification, or others that the
    record does not tell from them.
    """
    from runtime.physical.feasibility import feasibility, within_noise

    physical, fit = physical_model(result.model), result.estimate
    judged = feasibility(physical, fit.names, fit.X)
    if judged.feasible or fit.covariance is None or not np.isfinite(fit.covariance).all():
        return judged
    wider = max(1.0, float(np.median(fit.sigma_corrected / fit.sigma)))
    return within_noise(judged, physical, fit.names, fit.X, wider**2 * fit.covariance)


def assess(
    problem: Problem,
    *,
    loaded: Sequence[Record] = (),
    encoder: Sequence[float] = (),
    variants: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda part: None,
) -> Identification:
    """The identification with friction, physical consistency and encoder resolution, as far as records, settings and installed extras allow.

    Parameters
    ----------
    problem, loaded, variants, provenance : as for `identify`
    encoder : sequence of float
        Steps of the encoders in use, rad or m; judged like every other check.
    progress : function of str
        Called with the name of each part before it is computed.

    Returns
    -------
    Identification
        `missing` holds the parts that cannot be computed, each with its reason.
    """
    progress("identification")
    result = identify(
        problem, loaded=loaded, variants=variants, plausible=True, provenance=provenance
    )
    if not result.determined:
        reason = "friction, physical consistency, encoder resolution: the record does not determine the parameters"
        return replace(result, missing=(*result.missing, reason))
    missing = list(result.missing)

    def attempt(part: str, compute: Callable[[], T]) -> T | None:
        progress(part)
        try:
            return compute()
        except InputError as e:  # an extra is missing, or the study does not suit the part
            missing.append(f"{part}: {e}")
        return None

    columns = result.essential.names if problem.settings.cestac.columns == "essential" else None
    feasible = attempt("physical consistency", lambda: feasibility_of(result))
    curves = attempt("friction", lambda: friction_curves(problem, result.estimate))
    advice = attempt(
        "resolution advice",
        lambda: advise(problem, columns=result.essential.names, asked=tuple(encoder)),
    )
    resolution = attempt("resolution study", lambda: cestac(problem, columns=columns))
    return replace(
        result,
        feasibility=feasible,
        friction=curves or (),
        advice=advice,
        resolution=resolution,
        missing=tuple(missing),
    )
