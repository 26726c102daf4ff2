"""The identification of one robot from its records: one call, with everything a report says about
it.

model, records, study -> Y = W X + rho -> all parameters, eqs. (7)-(11), and the essential ones
                      -> measured beside predicted torques, windows of the records against each
                      other, parameters that trade
                      -> where they are asked for: a load, feasibility, friction curves
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from runtime.blas import single_threaded
from runtime.errors import InputError
from runtime.identification.elastic import elasticity
from runtime.identification.fits import agreement, fitted, validated
from runtime.identification.friction import friction_curves
from runtime.identification.laws import FittedLaws, fit_laws
from runtime.identification.payload_study import PayloadStudy, payload_study
from runtime.identification.result import Identification
from runtime.identification.torque_law import completed, gain_doubt
from runtime.identification.transmitted import transmitted
from runtime.identification.uncertainty import uncertainty
from runtime.identification.validation import direct_comparison, weak_directions
from runtime.loop.methods import observed as method_observation
from runtime.loop.methods import simulator_of
from runtime.model.bound import BoundModel
from runtime.model.generated import GeneratedModel, elements_of
from runtime.model.inertia import physical_model
from runtime.plausible.plausibility import plausibility
from runtime.progress import at
from runtime.reading.records import read_records
from runtime.records.provenance import origin, record_names
from runtime.records.record import Record
from runtime.resolution.advisor import advise
from runtime.resolution.cestac import cestac
from runtime.rows.observation import Observation
from runtime.rows.observe import at_rest
from runtime.rows.prepared import Prepared, prepared, resolved
from runtime.rows.wrench import with_wrench
from runtime.settings.record import behind_gears
from runtime.settings.study import SIMULATING, Study

if TYPE_CHECKING:
    from runtime.estimators.feasibility import Feasibility
    from runtime.loop.simulation import Simulator

__all__ = ["Identification", "assess", "feasibility_of", "identify"]

T = TypeVar("T")
Measured = tuple[Prepared, ...]
"""Records as the study reads them."""
NO_CHECKS = "plausibility of the record: not judged beside force sensors; identify without them too"
OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


@single_threaded
def identify(
    model: GeneratedModel,
    records: Record | Sequence[Record],
    study: Study | None = None,
    *,
    further: Sequence[Record] | None = None,
    simulator: Simulator | None = None,
    physical: bool = False,
    friction: bool = False,
    variants: GeneratedModel | None = None,
    plausible: bool | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Parameters of a robot from its records, and how far to trust them.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    records : Record, or a sequence of them
        Joint side, SI, fitted together.
    study : Study, optional
        Settings; default: Study().
    further : sequence of Record, optional
        Records that the parameters predict; default: those of study.validate.record, read from
        their files.
    simulator : Simulator, optional
        The closed loop, which iv and didim need; default: that of study.controller, with the
        CasADi module that lies with `model`.
    physical : bool
        Whether a physical robot can have the parameters.
    friction : bool
        Curves of friction against velocity, joint by joint.
    variants : GeneratedModel, optional
        The module of `symgen.variants`: other tables of frames and directions of gravity are tried
        on the records.
    plausible : bool, optional
        Whether record, study and robot file suit each other (`runtime.plausibility`); default:
        where `variants` is given.
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
    records = tuple(records) if isinstance(records, Sequence) else (records,)
    study = study or Study()
    if further is None:
        missing_too = study.signals.admits_missing
        further = read_records(study.validate.record, model, missing=missing_too)
    wide, records, study, further = with_wrench(model, records, study, further)
    asked = variants is not None if plausible is None else plausible
    plausible = asked and wide is model and study.signals.reader != "static"
    model = wide
    asked_study, statement = at_rest(model, records, of_links(model, study))
    study, lowpass = resolved(asked_study, records)
    measured = tuple(prepared(model, record, study) for record in records)
    model, laws, measured, further, load = _with_laws(model, study, measured, further)
    simulator = simulator or simulator_of(model, study)
    measured, further, law = completed(model, study, measured, further)
    provenance = {
        **origin(records),
        **({"lowpass": lowpass} if lowpass else {}),
        **(provenance or {}),
        **({"law": law.summary()} if law else {}),
    }
    names = record_names([*records, *further])
    fitted_names, further_names = names[: len(records)], names[len(records) :]
    observe = partial(method_observation, model, study=study)
    observation = observe(measured, simulator=simulator)
    observation = _with_findings(observation, law.text if law else "", load, statement)
    fits = fitted(observation, study, model, provenance)
    doubt = gain_doubt(model, study, measured, fits.estimate.relative_error)
    observation = _with_findings(observation, doubt)
    unseen = {name: observe([record]) for name, record in zip(further_names, further, strict=True)}
    fits, validation, missing = validated(
        fits, observation, unseen, study, model, ", ".join(fitted_names)
    )
    if asked and not plausible:
        rest = "plausibility of the record: not judged for poses at rest"
        missing = (*missing, rest if statement else NO_CHECKS)
    comparison = direct_comparison(observation, fits.best(validation, study))
    result = Identification(
        model=model,
        study=study,
        prepared=measured,
        observation=observation,
        estimate=fits.estimate,
        essential=fits.reduced,
        comparison=comparison,
        validation=validation,
        sets=fits.sets,
        homogeneity=agreement(fits, observation, fitted_names, unseen, study, model),
        missing=missing,
        correlations=weak_directions(observation, study.estimate),
        uncertainty=uncertainty(observation, study.estimate, fits.reduced, comparison),
        laws=laws,
    )
    if physical and not result.determined:
        groups = "; ".join(", ".join(group) for group in result.estimate.groups)
        text = f"physical consistency: the record does not tell apart {groups}"
        result, physical = replace(result, missing=(*missing, text)), False
    result = result if statement else _with_elasticity(result)
    return replace(
        result,
        payload=_payload(model, measured, study, records),
        feasibility=feasibility_of(result) if physical else None,
        friction=friction_curves(model, measured, study, result.estimate) if friction else (),
        plausibility=plausibility(model, measured, asked_study, variants=variants)
        if plausible
        else None,
    )


def _with_laws(
    model: GeneratedModel, study: Study, measured: Measured, further: Sequence[Record]
) -> tuple[GeneratedModel, FittedLaws | None, Measured, Sequence[Record], str]:
    """The model with the scalars of its laws fitted, these, the records with the torque that each
    joint transmits, and a sentence on that torque ("": no column reads it).
    """
    weighted = study.estimate.weights != "none"
    loaded, others, load = transmitted(model, measured, further, weighted)
    if not hasattr(model, "FIT"):
        return model, None, loaded, others, load
    if study.estimate.method in SIMULATING:
        raise InputError(
            f"scalars of laws are not fitted by {study.estimate.method}, which simulates the "
            "loop with those of the file; fit them by ols, then fix them: fit: {vs: 0.08}"
        )
    at("scalars of laws")
    columns = None if study.estimate.columns == "all" else tuple(study.estimate.columns)
    laws = fit_laws(model, loaded, columns, weights=weighted)
    model = cast(GeneratedModel, BoundModel(model, laws.constants))
    return model, laws, *transmitted(model, loaded, others, weighted)


def _payload(
    model: GeneratedModel, measured: Measured, study: Study, records: Sequence[Record]
) -> PayloadStudy | None:
    """The load of study.payload; None where it names none."""
    if study.payload is None:
        return None
    missing_too = study.signals.admits_missing
    loaded = read_records(study.payload.record, model, missing=missing_too)
    return payload_study(model, measured, loaded, study, provenance=origin(records))


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
    elastic = elasticity(result.model, result.prepared, fit.names, fit.X)
    if elastic is None:
        return result
    return replace(
        result,
        observation=_with_findings(result.observation, *elastic.sentences),
        estimate=replace(fit, provenance={**fit.provenance, "elastic": elastic.summary()}),
    )


def of_links(model: GeneratedModel, study: Study) -> Study:
    """The study, where torques were measured behind the gears without the columns of the drives."""
    settings = [*study.record, *study.validate.record]
    if study.estimate.columns != "all" or not behind_gears(settings):
        return study
    kinds = {name: element[0] for name, element in elements_of(model).items()}
    own = tuple(name for name in model.BASE_PARAMETERS if kinds.get(name) not in OF_DRIVES)
    return replace(study, estimate=replace(study.estimate, columns=own))


def feasibility_of(result: Identification) -> Feasibility:
    """Whether a physical robot can have the parameters of an identification, or others that the
    record does not tell from them.
    """
    from runtime.estimators.feasibility import feasibility, within_noise

    physical, fit = physical_model(result.model), result.estimate
    judged = feasibility(physical, fit.names, fit.X)
    if judged.feasible or fit.covariance is None or not np.isfinite(fit.covariance).all():
        return judged
    wider = max(1.0, float(np.median(fit.sigma_corrected / fit.sigma)))
    return within_noise(judged, physical, fit.names, fit.X, wider**2 * fit.covariance)


def assess(
    model: GeneratedModel,
    records: Record | Sequence[Record],
    study: Study | None = None,
    *,
    encoder: Sequence[float] = (),
    simulator: Simulator | None = None,
    variants: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda part: None,
) -> Identification:
    """The identification with friction, physical consistency and encoder resolution, as far as
    records, study and installed extras allow.

    Parameters
    ----------
    model, records, study, simulator, variants, provenance : as for `identify`
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
        model,
        records,
        study,
        simulator=simulator,
        variants=variants,
        plausible=True,
        provenance=provenance,
    )
    if not result.determined:
        reason = (
            "friction, physical consistency, encoder resolution: the record does not "
            "determine the parameters"
        )
        return replace(result, missing=(*result.missing, reason))
    missing = list(result.missing)
    if len(result.model.JOINTS) > len(model.JOINTS):  # with force sensors
        model = result.model

    def attempt(part: str, compute: Callable[[], T]) -> T | None:
        progress(part)
        try:
            return compute()
        except InputError as e:  # an extra is missing, or the study does not suit the part
            missing.append(f"{part}: {e}")
        return None

    result = replace(
        result, feasibility=attempt("physical consistency", lambda: feasibility_of(result))
    )
    study, measured, names = result.study, result.prepared, result.essential.names
    columns = names if study.cestac.columns == "essential" else None
    curves = attempt("friction", lambda: friction_curves(model, measured, study, result.estimate))
    advice = attempt(
        "resolution advice",
        lambda: advise(model, measured, study, columns=names, asked=tuple(encoder)),
    )
    resolution = attempt(
        "resolution study", lambda: cestac(model, measured, study, columns=columns)
    )
    return replace(
        result, friction=curves or (), advice=advice, resolution=resolution, missing=tuple(missing)
    )
