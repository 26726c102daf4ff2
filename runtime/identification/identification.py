"""The identification of one robot on its records, with everything a report says about it.

    model, records, study -> Y = W X + rho -> all parameters, eqs. (7)-(11), and the essential ones
                          -> measured beside predicted, halves of the record against each other, weak directions, drives without coupling

Values only: files and figures are made by the caller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.estimators import CLOSED_LOOP, LINEAR, estimate, linear_companion, point_estimate
from runtime.estimators.closed_loop import Simulator, closed_loop
from runtime.estimators.essential import Essential, essential
from runtime.estimators.estimate import Estimate
from runtime.estimators.physical import negative_elements
from runtime.estimators.tls import tls_options
from runtime.identification.record_errors import RecordError, record_errors
from runtime.identification.uncertainty import Trust, trust
from runtime.identification.validation import (
    Comparison,
    CrossValidation,
    WeakDirections,
    cross_validation,
    direct_comparison,
    split_validation,
    weak_directions,
)
from runtime.model.drives import Coupling, Drives
from runtime.model.generated import GeneratedModel
from runtime.observation.by_blocks import halves, reduce_records
from runtime.observation.observation import Observation, observe, stack
from runtime.observation.position_errors import with_errors
from runtime.observation.reduction import Reduction, Window
from runtime.records.record import Record
from runtime.records.stream import ChangedStream, Stream
from runtime.settings.study import Study

Array = np.ndarray

COUPLINGS: tuple[Coupling, ...] = ("both", "position", "torque", "none")


LOST = 25.0
"""Relative error of a joint in %, above which it is asked whether the removed parameters explained it."""


def lost_joints(every: Estimate, carried: Estimate) -> str:
    """What was lost with the parameters that were removed, and what to do; "" where every joint keeps its own.

    The threshold of the essential parameters looks at ||Y - W X|| of all joints. Without weights a joint of large forces rules it, such as a lift
    in N beside a wrist in N m.
    """
    whole = {fit.joint: fit.relative_error for fit in every.per_joint}
    lost = [fit for fit in carried.per_joint if fit.relative_error > max(LOST, 2 * whole.get(fit.joint, np.inf))]
    if not lost:
        return ""
    weighted = any(fit.scale != 1.0 for fit in every.per_joint)
    remedy = "lower essential.threshold" if weighted else "weigh the joints by their noise (estimate: {method: wls})"
    every_left = " and ".join(f"{whole[fit.joint]:.1f} % of joint {fit.joint}" for fit in lost)
    left = " and ".join(f"{fit.relative_error:.1f} %" for fit in lost)
    return f"all parameters leave {every_left} unexplained, the essential ones {left}: parameters of small torques were removed beside large forces; {remedy}"


@dataclass(frozen=True, eq=False)
class Identification:
    """Results on one robot.

    found : all parameters, the essential ones and the trail between them; of the linear companion of a method that is not linear.
    chosen : all parameters by the method of the study.   comparison : torques by the essential parameters, or by `chosen` of such a method.
    trust : deviations without independence, whiteness of the residuals, F-tests, sets by threshold.
    validation : one part of the data predicts the others: halves first, then further records.   weak : parameters that trade.
    coupling : fit of all parameters with the off-diagonal part of the drives in both directions, one, or none; empty where there is none.
    """

    model: GeneratedModel
    study: Study
    records: tuple[Record | Stream, ...]
    observation: Observation | Reduction
    found: Essential
    chosen: Estimate
    comparison: Comparison
    validation: tuple[CrossValidation, ...]
    weak: WeakDirections
    coupling: Mapping[Coupling, Estimate]
    trust: Trust

    @property
    def name(self) -> str:
        """Names of the records."""
        return ", ".join(record.name for record in self.records)

    @property
    def source(self) -> str:
        """Where the data come from: "measured", or "simulated" where the provenance says so."""
        return "simulated" if self.every.provenance.get("simulated") else "measured"

    @property
    def every(self) -> Estimate:
        """The fit of all parameters."""
        return self.chosen

    @property
    def carried(self) -> Estimate:
        """The fit that stands for the robot: of the essential parameters, or of all by a method that needs them all."""
        return self.found.estimate if self.study.estimate.method in LINEAR else self.chosen

    @cached_property
    def by_record(self) -> tuple[RecordError, ...]:
        """Error of each record with the parameters that stand for the robot; empty where there is one record."""
        return record_errors(self.observation, self.carried, [record.name for record in self.records]) if len(self.records) > 1 else ()

    @property
    def predicted_error(self) -> float:
        """Relative error in % of the parameters that carry the model on the parts of the record that did not give them, the largest."""
        columns = "essential" if self.carried is self.found.estimate else "all"
        errors = [p.relative_error for p in self.validation[0].predictions if not p.fitted and p.columns == columns]
        return max(errors, default=float("nan"))

    @property
    def shown_rows(self) -> int:
        """Rows of the comparison, which stands for the first instants of records that were read by blocks."""
        return sum(len(joint.t) for joint in self.comparison)

    @property
    def in_part(self) -> bool:
        """Whether the comparison leaves rows out."""
        return self.shown_rows < self.every.rows

    @property
    def verdict(self) -> str:
        """One sentence."""
        if self.every.status == "rank-deficient":
            names = "; ".join(", ".join(group) for group in self.every.groups)
            return (
                f"The record {self.name} does not determine {self.model.NAME}: rank {self.every.rank} for {len(self.every.names)} "
                f"parameters, cannot be told apart: {names}."
            )
        worst = max(self.carried.per_joint, key=lambda joint: joint.relative_error)
        named = f" (joint {worst.joint} worst, {worst.relative_error:.1f} %)" if self.observation.n > 1 else ""
        return (
            f"{len(self.carried.names)} of {len(self.every.names)} parameters carry the model of {self.model.NAME}: they leave "
            f"{self.carried.relative_error:.1f} % of the torques of the record {self.name} unexplained{named}, and {self.predicted_error:.1f} % of a part that "
            "the fit has not seen."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to look at before the values are used, in sentences: signs that no drive has, parameters that trade against each other, by name."""
        signs = (
            f"{', '.join(self.negative)} below zero, which no friction and no motor inertia is: a sign of the joint is wrong (ratio, torque constant or "
            "column), or its coupling, unit or frame."
        )
        lost = lost_joints(self.every, self.carried)
        return (*([signs] if self.negative else []), *([f"{lost}."] if lost else []), *self.weak.warnings)

    @property
    def negative(self) -> tuple[str, ...]:
        """Motor inertias and frictions that carry the model and are certainly negative."""
        return negative_elements(self.model, self.carried)

    def summary(self) -> dict[str, Any]:
        """What estimate.json holds beside the Estimate of all parameters."""
        fit = self.found.estimate
        return {
            "essential": {
                **self.found.summary(),
                "X": fit.X,
                "sigma": fit.sigma,
                "relative_sigma": fit.relative_sigma,
                "sigma_corrected": fit.sigma_corrected,
                "relative_error": fit.relative_error,
                "per_joint": fit.per_joint,
            },
            "validation": [part.summary() for part in self.validation],
            "weak_directions": {
                "threshold": self.weak.threshold,
                "pairs": self.weak.pairs,
                "groups": self.weak.groups,
                "directions": self.weak.directions,
            },
            "warnings": self.warnings,
            "trust": self.trust.summary(),
            "coupling": {key: {"relative_error": e.relative_error, "per_joint": e.per_joint} for key, e in self.coupling.items()},
            **({"by_record": self.by_record} if self.by_record else {}),
            "verdict": self.verdict,
        }


def identification(
    model: GeneratedModel,
    study: Study,
    records: Sequence[Record | Stream],
    *,
    further: Sequence[Record | Stream] = (),
    simulator: Simulator | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Identify by the settings of `study`.

    records : joint side, as read by study.record, in memory or by blocks.
    further : those of study.validate.record, predicted with the parameters found.
    simulator : of the section `controller`; needed by iv, didim and cloe.
    """
    observation = observed(model, records, study, simulator=simulator)
    found = essential(observation, study.essential, linear_companion(study.estimate), model=model, provenance=provenance)
    linear = study.estimate.method in LINEAR
    chosen = found.all_parameters if linear else estimate(observation, study.estimate, model=model, provenance=provenance)
    windows = study.validate.split or halves(*observation.span)
    validation = [split_validation(observation, windows, study.estimate, essential=found.names, model=model)]
    if further:
        seen = {record.name: observed(model, [record], study, windows=()) for record in further}
        name = ", ".join(record.name for record in records)
        validation.append(cross_validation(observation, seen, study.estimate, essential=found.names, name=name, model=model))
    shown = observation if isinstance(observation, Observation) else observation.shown
    comparison = direct_comparison(shown, found.estimate if linear else chosen)
    return Identification(
        model=model,
        study=study,
        records=tuple(records),
        observation=observation,
        found=found,
        chosen=chosen,
        comparison=comparison,
        validation=tuple(validation),
        weak=weak_directions(observation, study.estimate),
        coupling=coupling_fits(model, study, records),
        trust=trust(observation, study.estimate, found, comparison),
    )


def observed(
    model: GeneratedModel,
    records: Sequence[Record | Stream],
    study: Study,
    *,
    windows: Sequence[Window] | None = None,
    simulator: Simulator | None = None,
) -> Observation | Reduction:
    """The rows of the records, or what is left of them where they are read by blocks; windows : as in `streaming.reduce_records`.

    simulator : where the method simulates the closed loop, the rows carry it along.
    """
    in_memory = [record for record in records if isinstance(record, Record)]
    if simulator is not None and in_memory:
        asked = {key: study.estimate.options[key] for key in ("reference", "around") if key in study.estimate.options}
        return closed_loop(model, in_memory, study, simulator, **asked).measured()
    if in_memory:
        return stack([rows_of(model, record, study) for record in in_memory])
    return reduce_records(model, [record for record in records if not isinstance(record, Record)], study, windows=windows)


def rows_of(model: GeneratedModel, record: Record, study: Study) -> Observation:
    """Rows of one record, with the errors of their columns where the method asks for them."""
    seen = observe(model, record, study)
    if study.estimate.method != "tls":
        return seen
    return with_errors(model, record, study, seen, tls_options(study.estimate).position_error)


def coupling_fits(model: GeneratedModel, study: Study, records: Sequence[Record | Stream]) -> dict[Coupling, Estimate]:
    """Fits of all parameters with the coupling of the drives in position and torque, in one, or in none; motor-side records only."""
    read = [settings.coupling for settings in study.record]
    if len(records) != len(study.record):  # a record that was split at gaps, or records from elsewhere
        read = [*set(read)] * len(records)
    if model.DRIVES is None or any(settings.sides != ("motor", "motor") for settings in study.record) or len(read) != len(records):
        return {}
    drives = Drives.from_mapping(model.DRIVES)
    if not (drives.ratio - np.diag(np.diag(drives.ratio))).any():
        return {}
    fits: dict[Coupling, Estimate] = {}
    simulated = study.estimate.method in CLOSED_LOOP
    compared = linear_companion(study.estimate) if simulated else point_estimate(study.estimate)
    for coupling in COUPLINGS:
        changed: list[Record | Stream] = []
        for record, own in zip(records, read, strict=True):
            used, wanted = drives.decoupled(own), drives.decoupled(coupling)
            again = recoupled(record, used, wanted) if isinstance(record, Record) else recoupled_stream(record, used, wanted)
            changed.append(again)
        fits[coupling] = estimate(observed(model, changed, study, windows=()), compared, model=model)
    return fits


def recoupled(record: Record, used: Drives, wanted: Drives) -> Record:
    """The record as the drives `wanted` would have turned its motor side into the joint side; `used` are those it was read with."""
    q = wanted.joint_position(used.motor_position(record.q))
    return replace(record, q=q, tau=wanted.joint_torque(used.motor_command(record.tau)))


def recoupled_stream(stream: Stream, used: Drives, wanted: Drives) -> Stream:
    """`recoupled` of a record that is read by blocks."""

    def change(q: Array, tau: Array) -> tuple[Array, Array]:
        return wanted.joint_position(used.motor_position(q)), wanted.joint_torque(used.motor_command(tau))

    return ChangedStream(stream, change)
