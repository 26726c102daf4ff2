"""The identification of one robot from its records: one call, with everything a report says about
it.

model, records, study -> Y = W X + rho -> all parameters, eqs. (7)-(11), and the essential ones
                      -> measured beside predicted torques, windows of the records against each
                      other, parameters that trade, coupling
                      -> where they are asked for: a load, feasibility, friction curves
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from runtime.blas import single_threaded
from runtime.checks.plausibility import plausibility
from runtime.errors import InputError
from runtime.estimators.essential import essential_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.method import LINEAR, linear_companion
from runtime.identification.coupling import coupling_fits
from runtime.identification.cutoff_errors import cutoff_errors, cutoff_text
from runtime.identification.elastic import elasticity
from runtime.identification.friction import friction_curves
from runtime.identification.homogeneity import homogeneity
from runtime.identification.laws import fit_laws
from runtime.identification.parameter_sets import (
    SetName,
    best_set,
    held_out_validation,
    parameter_sets,
)
from runtime.identification.payload_study import payload_study
from runtime.identification.result import Identification
from runtime.identification.torque_law import completed, gain_doubt
from runtime.identification.transmitted import transmitted
from runtime.identification.uncertainty import uncertainty
from runtime.identification.validation import (
    CrossValidation,
    cross_validation,
    direct_comparison,
    split_validation,
    weak_directions,
)
from runtime.limits import LIMIT
from runtime.loop.methods import estimate_of, simulator_of
from runtime.loop.methods import observed as method_observation
from runtime.model.bound import BoundModel
from runtime.model.generated import GeneratedModel, elements_of
from runtime.model.inertia import physical_model
from runtime.parallel import Workers, started
from runtime.progress import at
from runtime.records.provenance import origin, record_names
from runtime.records.reading_by_blocks import records_or_streams
from runtime.records.record import Record
from runtime.records.stream import Stream, in_memory
from runtime.resolution.advisor import advise
from runtime.resolution.cestac import cestac
from runtime.rows.observation import halves
from runtime.rows.prepared import Prepared, prepared, resolved
from runtime.settings.record import behind_gears
from runtime.settings.study import Study

if TYPE_CHECKING:
    from runtime.estimators.feasibility import Feasibility
    from runtime.loop.simulation import Simulator

__all__ = ["Identification", "assess", "feasibility_of", "identify"]

T = TypeVar("T")
NEED_WHOLE = "a load, friction curves and scalars of laws need"
SIMULATING = ("iv", "didim", "cloe")
OF_DRIVES = ("inertia", "viscous", "coulomb")
"""Kinds of elements in which sensors behind the gears have no part."""


@single_threaded
def identify(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream],
    study: Study | None = None,
    *,
    further: Sequence[Record | Stream] | None = None,
    simulator: Simulator | None = None,
    physical: bool = False,
    friction: bool = False,
    variants: GeneratedModel | None = None,
    plausible: bool | None = None,
    workers: int | Workers = 1,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Parameters of a robot from its records, and how far to trust them.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    records : Record, Stream, or a sequence of them
        Joint side, SI, fitted together. Records are read by blocks where one of them is a stream.
    study : Study, optional
        Settings; default: Study().
    further : sequence of Record or Stream, optional
        Records that the parameters predict; default: those of study.validate.record, read from
        their files.
    simulator : Simulator, optional
        The closed loop, which iv, didim and cloe need; default: that of study.controller, with the
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
    workers : int or Workers, optional
        Processes, this one among them, that read and filter long records by blocks. The results do
        not depend on it in any bit; a record in memory, or of one
        piece, takes one process.
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
    asked_study = of_links(model, study or Study())
    study, lowpass = resolved(asked_study, records)
    own = tuple(
        record if isinstance(record, Stream) else prepared(model, record, study)
        for record in records
    )
    if further is None:
        further = records_or_streams(
            study.validate.record, model, study.stream, missing=study.signals.admits_missing
        )
    weighted = study.estimate.weights != "none"
    own, further, load = transmitted(model, own, further, weighted)
    laws = None
    if hasattr(model, "FIT"):
        if study.estimate.method in SIMULATING:
            raise InputError(
                f"scalars of laws are not fitted by {study.estimate.method}, which simulates the "
                "loop with those of the file; fit them by ols, then fix them: fit: {vs: 0.08}"
            )
        at("scalars of laws")
        columns = None if study.estimate.columns == "all" else tuple(study.estimate.columns)
        laws = fit_laws(model, in_memory(own, NEED_WHOLE), columns, weights=weighted)
        model = cast(GeneratedModel, BoundModel(model, laws.constants))
        own, further, load = transmitted(model, own, further, weighted)
    chosen = {"lowpass": lowpass} if lowpass else {}
    provenance = {**origin(records), **chosen, **(provenance or {})}
    simulator = simulator or simulator_of(model, study)
    asked = variants is not None if plausible is None else plausible
    own, further, law = completed(model, study, own, further)
    if law is not None:
        provenance["law"] = law.summary()
    with started(workers) as processes:
        judged = (
            processes.meanwhile(partial(plausibility, model, own, asked_study, variants=variants))
            if asked
            else None
        )
        observed = partial(method_observation, model, study=study, workers=processes)
        observation = observed(own, simulator=simulator)
        told = (*observation.findings, *([law.text] if law else []), *([load] if load else []))
        observation = replace(observation, findings=told)
        memory = [one for one in own if isinstance(one, Prepared)]
        short = sum(len(one.record) for one in memory) <= LIMIT.CUTOFF_SAMPLES
        low = asked_study.signals.lowpass
        if asked and lowpass and low and low.cutoff == "auto" and len(memory) == len(own) and short:
            at("other cut-offs")
            by_cutoff = cutoff_errors(model, memory, study)
            hertz = study.signals.lowpass.hertz if study.signals.lowpass else 0.0
            provenance["lowpass"] = lowpass + cutoff_text(by_cutoff, hertz)
        at("least squares, essential parameters")
        reduced = essential_of(
            observation,
            study.essential,
            linear_companion(study.estimate),
            model=model,
            provenance=provenance,
        )
        sets: dict[SetName, Estimate] = {}
        missing: list[str] = []
        if study.estimate.method in LINEAR:
            sets, how, note = parameter_sets(observation, study.estimate, reduced, model=model)
            fit, missing = reduced.all_parameters, [note] if note else []
        else:
            at(study.estimate.method)
            fit = estimate_of(observation, study.estimate, model=model, provenance=provenance)
            how = {
                "all": study.estimate,
                "essential": replace(study.estimate, columns=reduced.names),
            }
        if doubt := gain_doubt(model, study, own, fit.relative_error):
            observation = replace(observation, findings=(*observation.findings, doubt))
        windows = study.validate.split or halves(*observation.span)
        names = record_names([*records, *further])
        fitted, others = ", ".join(names[: len(records)]), names[len(records) :]
        validation: list[CrossValidation] = []
        ended = (
            fit.status == "ok" or study.estimate.method in LINEAR
        )  # else each validation would simulate a loop that is wrong once more
        if ended:
            at("validation")
            try:
                validation = [split_validation(observation, windows, how, model=model)]
            except InputError as e:
                missing = [*missing, f"validation between windows of the record: {e}"]
        else:
            missing = [
                *missing,
                f"validation: {study.estimate.method} ended with status {fit.status}",
            ]
        parts = {
            name: observed([record], windows=())
            for name, record in zip(others, further, strict=True)
        }
        if parts and ended:
            known = sets or {"all": fit}
            validation.append(
                cross_validation(observation, parts, how, name=fitted, model=model, fitted=known)
            )
        halved = not parts and not study.validate.split and "feasible" in sets
        if halved and validation and best_set(validation[0].errors()) == "all":
            validation = [held_out_validation(observation, how, model=model)]
        missing += [text for part in validation for text in part.missing]
        errors = validation[-1].errors() if validation and sets else {}
        best = best_set(errors, study.essential.first)
        comparison = direct_comparison(observation.first_rows, sets.get(best, fit))
        each = (
            {name: observation.of_record(k) for k, name in enumerate(names[: len(records)])}
            if len(names) > 1
            else {}
        )
        parts = {**each, **parts} if each else {}
        agreement = None
        for columns in (reduced.all_parameters.names, reduced.names) if parts else ():
            agreement = homogeneity(parts, columns, study.estimate, model=model)
            if not agreement.untested:  # else fewer columns, that each record determines
                break
        held = [one for one in own if isinstance(one, Prepared)]
        result = Identification(
            model=model,
            study=study,
            prepared=own,
            observation=observation,
            estimate=fit,
            essential=reduced,
            comparison=comparison,
            validation=tuple(validation),
            sets=sets,
            homogeneity=agreement,
            missing=tuple(missing),
            correlations=weak_directions(observation, study.estimate),
            coupling=coupling_fits(
                model, own, study, observation, fit, partial(observed, windows=())
            ),
            uncertainty=uncertainty(observation, study.estimate, reduced, comparison),
            laws=laws,
        )
        if physical and not result.determined:
            groups = "; ".join(", ".join(group) for group in fit.groups)
            text = f"physical consistency: the record does not tell apart {groups}"
            result, physical = replace(result, missing=(*result.missing, text)), False
        gears = elasticity(model, held, fit.names, fit.X) if result.determined else None
        if gears is not None:
            told = (*observation.findings, *gears.sentences)
            fit = replace(fit, provenance={**fit.provenance, "elastic": gears.summary()})
            result = replace(result, observation=replace(observation, findings=told), estimate=fit)
        whole = in_memory(own, NEED_WHOLE) if friction or study.payload is not None else []
        return replace(
            result,
            payload=None
            if study.payload is None
            else payload_study(model, whole, study, provenance=origin(records)),
            feasibility=feasibility_of(result) if physical else None,
            friction=friction_curves(model, whole, study, fit) if friction else (),
            plausibility=judged() if judged else None,
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
    records: Record | Stream | Sequence[Record | Stream],
    study: Study | None = None,
    *,
    encoder: Sequence[float] = (),
    simulator: Simulator | None = None,
    variants: GeneratedModel | None = None,
    runs: Callable[[], GeneratedModel] | None = None,
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
    runs : function, optional
        Gives the same model for the runs of the resolution study, such as one in C; asked for
        records of LIMIT.LONG_RECORD samples and more. Default: `model`.
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
    whole = [own for own in result.prepared if isinstance(own, Prepared)]
    if len(whole) < len(result.prepared):
        missing.append("friction and encoder resolution: they need whole records; set stream: off")
        return replace(result, missing=tuple(missing))
    study, names = result.study, result.essential.names
    columns = names if study.cestac.columns == "essential" else None
    sampled = (
        runs()
        if runs is not None and sum(len(own.record) for own in whole) >= LIMIT.LONG_RECORD
        else model
    )
    curves = attempt("friction", lambda: friction_curves(model, whole, study, result.estimate))
    advice = attempt(
        "resolution advice",
        lambda: advise(sampled, whole, study, columns=names, asked=tuple(encoder)),
    )
    resolution = attempt("resolution study", lambda: cestac(sampled, whole, study, columns=columns))
    return replace(
        result, friction=curves or (), advice=advice, resolution=resolution, missing=tuple(missing)
    )
