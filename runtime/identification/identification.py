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
from typing import TYPE_CHECKING, Any, TypeVar

from runtime.blas import single_threaded
from runtime.checks.plausibility import plausibility
from runtime.errors import InputError
from runtime.estimators.essential import essential_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.method import LINEAR, linear_companion
from runtime.identification.coupling import coupling_fits
from runtime.identification.friction import friction_curves
from runtime.identification.homogeneity import homogeneity
from runtime.identification.parameter_sets import SetName, best_set, parameter_sets
from runtime.identification.payload_study import payload_study
from runtime.identification.result import Identification
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
from runtime.model.generated import GeneratedModel
from runtime.model.inertia import physical_model
from runtime.parallel import Workers, started
from runtime.progress import at
from runtime.records.provenance import origin, record_names
from runtime.records.reading_by_blocks import records_or_streams
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.resolution.advisor import advise
from runtime.resolution.cestac import cestac
from runtime.rows.observation import halves
from runtime.rows.prepared import Prepared, prepared, resolved
from runtime.settings.study import Study

if TYPE_CHECKING:
    from runtime.estimators.feasibility import Feasibility
    from runtime.loop.simulation import Simulator

__all__ = ["Identification", "assess", "feasibility_of", "identify", "whole_records"]

T = TypeVar("T")


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
    asked_study = study or Study()
    study, lowpass = resolved(asked_study, records)
    own = tuple(
        record if isinstance(record, Stream) else prepared(model, record, study)
        for record in records
    )
    chosen = {"lowpass": lowpass} if lowpass else {}
    provenance = {**origin(records), **chosen, **(provenance or {})}
    simulator = simulator or simulator_of(model, study)
    if further is None:
        further = records_or_streams(
            study.validate.record, model, study.stream, missing=study.signals.admits_missing
        )
    asked = variants is not None if plausible is None else plausible
    with started(workers) as processes:
        judged = (
            processes.meanwhile(partial(plausibility, model, own, asked_study, variants=variants))
            if asked
            else None
        )
        observed = partial(method_observation, model, study=study, workers=processes)
        observation = observed(own, simulator=simulator)
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
        )
        if physical and not result.determined:
            groups = "; ".join(", ".join(group) for group in fit.groups)
            text = f"physical consistency: the record does not tell apart {groups}"
            result, physical = replace(result, missing=(*result.missing, text)), False
        whole = whole_records(own) if friction or study.payload is not None else []
        return replace(
            result,
            payload=None
            if study.payload is None
            else payload_study(model, whole, study, provenance=origin(records)),
            feasibility=feasibility_of(result) if physical else None,
            friction=friction_curves(model, whole, study, fit) if friction else (),
            plausibility=judged() if judged else None,
        )


def feasibility_of(result: Identification) -> Feasibility:
    """Whether a physical robot can have the parameters of an identification."""
    from runtime.estimators.feasibility import feasibility

    return feasibility(physical_model(result.model), result.estimate.names, result.estimate.X)


def whole_records(records: Sequence[Prepared | Stream]) -> list[Prepared]:
    """The records, all of them in memory; InputError where one is read by blocks."""
    whole = [record for record in records if isinstance(record, Prepared)]
    if len(whole) < len(records):
        raise InputError("a load and friction curves need whole records; set stream: off")
    return whole


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
