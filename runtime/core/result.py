"""Result of `identify`: the parameters of one robot, and all results about its records."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from runtime.core.essential import Essential, lost_joints
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel, joint_labels, joint_torque_units
from runtime.core.parameter_sets import SetDocument, SetName, Sets, ranking_text, written_sets
from runtime.core.problem import SIGNALS, Problem
from runtime.core.provenance import record_names
from runtime.core.record import UNNAMED, Record
from runtime.core.rows.observation import Observation, halves
from runtime.core.rows.prepared import Prepared
from runtime.core.rows.selection import unused_joints
from runtime.core.study import Study
from runtime.core.uncertainty import Uncertainty, negative_elements
from runtime.core.validation import (
    CrossValidation,
    JointComparison,
    RecordError,
    WeakDirections,
    record_errors,
)
from runtime.ground.checklist import Checklist
from runtime.ground.documents import json_text
from runtime.ground.limits import LIMIT
from runtime.ground.part import Part, printed
from runtime.ground.table import Table, in_lines, notebook, number, with_intervals


@dataclass(frozen=True, eq=False)
class Identification:
    """Parameters of one robot from one or several records, with the results of all analyses.

    Attributes
    ----------
    problem : Problem
        Prepared: model, records, settings.
    observation : Observation
        Y = W X + rho of all records.
    sets : Sets
        The essential, the feasible and all parameters; which set is used, and which set is written
        (`runtime.core.parameter_sets`). A mapping of the estimates by name; empty if the method of
        the study is not linear.
    essential : Essential
        The essential parameters and the elimination; if the method is not linear, by its linear
        companion.
    comparison : tuple of JointComparison
        Measured torques and W X by joint, of `model_estimate`.
    validation : tuple of CrossValidation
        Fits of one part of the data that predict the others: first windows of the records, or each
        fifth from the other four (`parameter_sets`), then further records.
    correlations : WeakDirections
        Parameters with correlated estimates.
    uncertainty : Uncertainty
        Standard deviations without the assumption of independent residuals, whiteness of the
        residuals, F-tests, essential sets by threshold.
    judge : function of Identification
        Answers the questions of the verdict.
    unseen_rows : mapping of str to Observation
        Rows of the records that are predicted, not fitted, by name.
    parts : tuple of Part
        Results of further analyses, in the order in which they are printed.
    missing : tuple of str
        Analyses that were requested and failed, each with its reason.
    lacking : object or None
        What the model lacks, found before the parts are made (`runtime.unmodelled`); the deviations
        of the sets include it.
    """

    problem: Problem
    observation: Observation
    sets: Sets
    essential: Essential
    comparison: tuple[JointComparison, ...]
    validation: tuple[CrossValidation, ...]
    correlations: WeakDirections
    uncertainty: Uncertainty
    judge: Callable[[Identification], Checklist]
    unseen_rows: Mapping[str, Observation] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    missing: tuple[str, ...] = ()
    lacking: Any = None

    def part(self, name: str) -> Any:
        """Return the part (result of a further analysis) with this name; None if there is none."""
        return next((part for part in self.parts if part.name == name), None)

    def with_part(self, part: Part) -> Identification:
        """Copy the identification and add, or replace, the result (part) of one analysis."""
        others = [other for other in self.parts if other.name != part.name]
        return replace(self, parts=(*others, part))

    @property
    def model(self) -> GeneratedModel:
        """The robot model, with fitted constants of its laws and added axes of force sensors."""
        return self.problem.model

    @property
    def study(self) -> Study:
        """All settings of the identification; file names are relative to the current folder."""
        return self.problem.settings

    @property
    def prepared(self) -> tuple[Prepared, ...]:
        """The fitted records with their filtered states q, qd, qdd."""
        return self.problem.prepared

    @property
    def records(self) -> tuple[Record, ...]:
        """The fitted records, with positions and torques of the joints in SI."""
        return self.problem.records

    @property
    def name(self) -> str:
        """Names of the records, separated by commas."""
        return ", ".join(record_names(self.records))

    @property
    def _of_record(self) -> str:
        """The word "record" with the names of the records, for use in a sentence.

        A record without a name is "record" alone.
        """
        return (
            "record"
            if self.name == UNNAMED
            else f"record{'s' if len(self.records) > 1 else ''} {self.name}"
        )

    @property
    def source(self) -> Literal["measured", "simulated"]:
        """Source of the data: "measured" or "simulated"."""
        return "simulated" if self.estimate.provenance.get("simulated") else "measured"

    @property
    def determined(self) -> bool:
        """Whether the records determine all parameters, that is, W has full rank."""
        return self.estimate.status != "rank-deficient"

    @property
    def usable(self) -> bool:
        """Whether the estimation ended with status "ok"."""
        return self.estimate.status == "ok"

    @property
    def set_errors(self) -> Mapping[SetName, float]:
        """Relative error, %, of torques that each set of parameters predicts for unseen data.

        The sets are "essential", "feasible" (the physical set) and "all". If several parts or
        records are predicted, the largest error counts. The mapping is empty if nothing is
        predicted.
        """
        return self.sets.errors

    @property
    def unseen(self) -> str:
        """Name of the data on which the sets of parameters are compared.

        These are the validation records of the study, or else a part of the records.
        """
        parts = dict.fromkeys(
            p.part for part in self.validation[-1:] for p in part.predictions if not p.fitted
        )
        return ", ".join(parts) if self.by_records else "a part of the record that it has not seen"

    @property
    def by_records(self) -> bool:
        """Whether the sets of parameters are compared on separate validation records.

        Otherwise, the sets are compared on parts of the fitted records.
        """
        return bool(self.validation) and self.validation[-1].further

    @property
    def estimate(self) -> Estimate:
        """Estimate of all parameters, by the method of the study."""
        return self.sets.all

    @property
    def model_columns(self) -> SetName:
        """Name of the set of parameters in the final model: "essential", "feasible" or "all".

        `runtime.core.parameter_sets` explains the choice; the name is "all" if the method is not
        linear.
        """
        return self.sets.used

    @property
    def model_estimate(self) -> Estimate:
        """Estimate of the parameters in the final model: essential, physical ("feasible") or all.

        If the method is not linear, the final model is `estimate`.
        """
        return self.sets.estimate(self.sets.used)

    @property
    def whole_estimate(self) -> Estimate:
        """Estimate of all base parameters, to be written to a robot file or used in a program.

        The result is the estimate of the set in use or, if that is the essential set, of the
        physical set.
        """
        return self.written.estimate(self.written.whole)

    @cached_property
    def written(self) -> Sets:
        """The sets of estimate.json; for a final model "essential" also a physical set."""
        return written_sets(self.problem, self.observation, self.sets)

    @property
    def torque_unit(self) -> str:
        """Unit of the torques: A or V of a CommandModel, "N" if all joints are prismatic, else "N m".

        The joints are judged by the units of the parameters.
        """
        units = {*joint_torque_units(self.model)}
        return units.pop() if len(units) == 1 else "N m"

    @cached_property
    def record_errors(self) -> tuple[RecordError, ...]:
        """Relative error, %, of each fitted record with the final model; empty for one record."""
        names = record_names(self.records)
        return record_errors(self.observation, self.model_estimate, names) if len(names) > 1 else ()

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the records: time stamps, subtracted torques, low-pass, other findings.

        Other findings are messages of the readers and the preparation steps.
        """
        texts = {
            (record.origin.whole or record.name, record.origin.time): None
            for record in self.records
            if record.origin.time
        }
        known = [f"{r.name}: {r.subtracted}." for r in self.records if r.subtracted]
        return (
            *(f"Time stamps of {name}: {text}." for name, text in texts),
            *known,
            *filter(None, [self.estimate.provenance.get(SIGNALS)]),
            *self.observation.findings,
        )

    @property
    def prediction_error(self) -> float:
        """Largest relative error, %, of the final model on data that were not fitted.

        These data are the validation records, or else parts of the records; nan without such data.
        """
        return self.set_errors.get(self.model_columns, float("nan"))

    @property
    def held_out(self) -> Iterator[tuple[Observation, Observation]]:
        """Parts of the records that fits of other parts predict: rows of the fit, and of the part.

        There are no parts if separate records are predicted, or no data are.
        """
        if not self.validation or self.by_records:
            return
        if self.validation[0].folds:
            yield from self.observation.folds(self.validation[0].folds)
            return
        first, *others = self.study.validate.split or halves(*self.observation.span)
        for window in others:
            yield self.observation.between(*first), self.observation.between(*window)

    @property
    def unseen_error(self) -> float:
        """Error on a part of the record that fits of other parts explain, %; nan if unknown."""
        told = (part.unseen_error for part in self.parts)
        return next((error for error in told if not np.isnan(error)), float("nan"))

    @property
    def negative(self) -> tuple[str, ...]:
        """Motor inertias and friction parameters that are certainly below zero.

        The values are those of the final model, `model_estimate`. Sensors behind the gears measure
        neither inertia nor friction of motors, so that these are not judged.
        """
        if any(record.sides[1] == "link" for record in self.records):
            return ()
        return negative_elements(self.model, self.model_estimate)

    @property
    def expected_error(self) -> float:
        """Expected relative error of torques predicted for other motions, %; nan if not computed.

        If the records do not determine the parameters, the error is LARGEST_EXPECTED in
        limits.toml.
        """
        if not self.determined:
            return float(LIMIT.LARGEST_EXPECTED)
        told = (part.expected_error for part in self.parts)
        return next((error for error in told if np.isfinite(error)), float("nan"))

    @cached_property
    def checklist(self) -> Checklist:
        """The verdict on the identification, with all its checks."""
        return self.judge(self)

    @property
    def verdict(self) -> str:
        """Sentence on the number of fitted parameters and the unexplained part of the torques, %.

        If there are no usable values, the sentence gives the reason.
        """
        if not self.determined:
            names = "; ".join(", ".join(group) for group in self.estimate.groups)
            return (
                f"The {self._of_record} does not determine {self.model.NAME}: rank "
                f"{self.estimate.rank} for {len(self.estimate.names)} "
                f"parameters; these cannot be separated: {names}."
            )
        fit = self.model_estimate
        if not self.usable:
            reason = self.estimate.message.split(". ")[0].rstrip(".")
            return (
                f"No values of {self.model.NAME}: {self.estimate.method} ended with status "
                f"{self.estimate.status}. {reason}."
            )
        worst = fit.worst_joint
        by_joint = (
            f" (joint {worst.joint} worst, {worst.relative_error:.1f} %)"
            if self.observation.n > 1
            else ""
        )
        most = "at most " if ", " in self.unseen else ""  # the largest of several records
        unseen = (
            f", and {most}{self.prediction_error:.1f} % of {self.unseen}"
            if np.isfinite(self.prediction_error)
            else ""
        )
        return (
            f"The model of {self.model.NAME} with {len(fit.names)} of {len(self.estimate.names)} "
            f"parameters leaves {fit.relative_error:.1f} % "
            f"of the torques of the {self._of_record} unexplained{by_joint}{unseen}."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings to read before the values are used, including those on correlated parameters."""
        return (*self.own_warnings, *self.correlations.warnings)

    @property
    def own_warnings(self) -> tuple[str, ...]:
        """Warnings on single joints and from further analyses; correlations are left out.

        The warnings name joints without rows, joints with negative friction or motor inertia, and
        joints that lost their parameters in the elimination.
        """
        lost = lost_joints(self.estimate, self.model_estimate)
        joints = joint_labels(self.model)
        unused = unused_joints(self.observation.rows, self.observation.dropped, joints)
        sentences = (
            unused,
            self._negative_text() if self.negative else "",
            f"{lost}." if lost else "",
            *(sentence for part in self.parts for sentence in part.warnings()),
        )
        return tuple(sentence for sentence in sentences if sentence)

    def _negative_text(self) -> str:
        """Name the parameters that are below zero, with a guess at the cause if the checks have
        found none.
        """
        text = f"{', '.join(self.negative)} below zero, but friction and motor inertia cannot be negative"
        worst = self.checklist.worst
        if worst is not None and worst.state == "no" and not worst.outcome:
            return f"{text}."
        by_law = any(record.origin.by_law for record in self.records)
        return (
            f"{text}: {'kd of the law is larger than that of the drive, or ' * by_law}a sign of "
            "the joint is wrong (ratio, torque constant or column), or its coupling, "
            "unit or frame."
        )

    def __str__(self) -> str:
        return self.brief()

    def brief(self, others: int = 0) -> str:
        """Write a short text: verdict, largest doubt, next step, values, errors and warnings.

        Values have 95 % intervals. The text has a limited number of lines (LINES_PRINTED in
        limits.toml); `to_text` has everything. others : number of lines that are printed in
        addition to this text.
        """
        ahead = [check for check in self.checklist.checks if check.ahead]
        first = [f"{check.finding}." for check in ahead]
        notes = [*self.observation.findings, *self.own_warnings, *self.missing]
        if len(notes) > LIMIT.NOTES_PRINTED:
            more = len(notes) - LIMIT.NOTES_PRINTED + 1
            notes = [*notes[:-more], f"{more} more notes: --verbose"]
        head = "\n".join([*first, self.checklist.to_text()])
        rest = [
            "\n".join(f"note: {note}" for note in notes),
            *(part.brief() for part in self.parts),
        ]
        if self.determined and self.usable:
            taken = sum(len(text.splitlines()) + 1 for text in (head, *rest) if text)
            room = max(LIMIT.LINES_PRINTED - others - taken - 2, LIMIT.LINES_OF_VALUES)
            rest = [self._values(room, known=any(check.state != "good" for check in ahead)), *rest]
        return "\n\n".join(text for text in (head, *rest) if text)

    def _values(self, room: int, *, known: bool) -> str:
        """Write the parameter values in at most `room` lines, and the error of each joint.

        If there is no room for all values, only the essential ones are written. known : whether to
        write only values that are larger than half their 95 % interval.
        """
        fit, names = self.model_estimate, list(self.model_estimate.names)
        index = {name: k for k, name in enumerate(names)}
        shown = [
            name
            for name, k in index.items()
            if not known or abs(fit.X[k]) > 1.96 * fit.sigma_corrected[k]
        ]
        unknown = len(names) - len(shown)
        lines, more = self._lines(shown), 0
        if len(lines) > room:
            shown = [name for name in shown if name in self.essential.names] or shown
            lines = self._lines(shown)
            per_line = -(-len(shown) // len(lines))
            more = len(names) - unknown - min(len(shown), per_line * room)
        by_joint = ", ".join(
            f"{one.joint} {one.relative_error:.1f} %"
            if one.has_motor
            else f"{one.joint} {'zero' if one.is_axis else 'no motor'}"
            for one in fit.per_joint
            if one.rows
        )
        head = f"{self.fitted}; value +- half of the 95 % interval{self.of_intervals}."
        head += f" {more} more: --verbose." if more else ""
        head += f" {unknown} smaller than their intervals: --verbose." if unknown else ""
        return "\n".join([head, *lines[:room], f"Unexplained by joint: {by_joint}"])

    @property
    def fitted(self) -> str:
        """Which of the base parameters the final model has, and how they were fitted."""
        names, of = self.model_estimate.names, len(self.estimate.names)
        count = f"All {of}" if len(names) == of else f"{len(names)} of {of}"
        chosen = ", the essential ones" if self.model_columns == "essential" else ""
        method = self.model_estimate.method
        physical = self.problem.methods[method].physical
        how = "under physical constraints" if physical else f"by {method}"
        return f"{count} base parameters{chosen}, fitted {how}"

    @property
    def of_intervals(self) -> str:
        """Words after "95 % interval": the condition of the intervals of an essential set, or their measure."""
        known = self.problem.method.intervals
        if self.model_columns == "essential":
            return " if the others are zero"
        return f", {known}" if known else ""

    def _lines(self, names: Sequence[str]) -> list[str]:
        """Write parameters with 95 % intervals and units, several parameters per line."""
        fit = self.model_estimate
        k = [fit.names.index(name) for name in names]
        units = [fit.units.get(name, "") for name in names]
        return in_lines(with_intervals(names, fit.X[k], fit.sigma_corrected[k], units))

    def _repr_html_(self) -> str:
        parameters, joints = (self.model_estimate if self.determined else self.estimate).tables()
        return notebook([self.verdict, *self.warnings], parameters, joints)

    def to_text(self) -> str:
        """Write a long text: parameters, validation, correlations, uncertainty, verdict."""
        fit = self.model_estimate if self.determined else self.estimate
        trade = [f"warning: {sentence}" for sentence in self.warnings] or [
            "no two parameters are strongly correlated: no "
            f"|correlation| above {self.correlations.threshold:g}"
        ]
        records = [
            f"error in {one.name}: {one.relative_error:.2f} % in total, per joint "
            + " ".join(f"{error:.2f}" for error in one.per_joint)
            for one in self.record_errors
        ]
        weak = [
            f"{d.ratio:.1e}  " + " ".join(f"{w:+.2f} {name}" for name, w in d.weights.items())
            for d in self.correlations.directions
        ]
        head = "directions that W sees least (singular value over the largest, unit columns)"
        tables: tuple[Any, ...] = (fit, self.essential, *self.validation)
        parts = [
            *(table.to_table() for table in tables),
            "\n".join([*records, *self.remarks]),
            "\n".join(trade),
            "\n".join([head, *weak]),
            self.ranking,
            self.motion_table().to_text() if self.motion_table().rows else "",
            self.uncertainty.to_text(),
            *map(printed, self.parts),
            *self.missing,
            self.checklist.to_text(),
        ]
        return "\n\n".join(part for part in parts if part)

    @property
    def ranking(self) -> str:
        """Sentence that ranks the sets of parameters by prediction error; "" without sets."""
        return (
            ranking_text(
                self.set_errors,
                {name: len(fit.names) for name, fit in self.sets.items()},
                self.unseen,
            )
            if self.sets
            else ""
        )

    def motion_table(self) -> Table:
        """Make a table of the difference between simulated and measured motion, joint by joint.

        The table is empty unless the method simulates the closed loop.
        """
        rows = [
            (
                m["joint"],
                f"{m['rms']:.3g}",
                *(number(m[key], ".3g") for key in ("position", "tracking", "torque")),
            )
            for m in self.estimate.details.get("motion", ())
        ]
        header = (
            "joint",
            "rms of q_s - q, rad or m",
            "of the motion, %",
            "of the tracking error, %",
            "torque, %",
        )
        return Table("Simulated minus measured motion", header, rows)

    def to_json(self) -> str:
        """Return the text of estimate.json: Estimate of all parameters, and all other results."""
        return json_text({**json.loads(self.estimate.to_json()), **self.summary()})

    def summary(self) -> dict[str, Any]:
        """Return the entries that estimate.json has besides the Estimate of all parameters."""
        fit = self.essential.estimate
        summary: dict[str, Any] = {
            "essential": {
                **self.essential.summary(),
                "X": fit.X,
                "sigma": fit.sigma,
                "relative_sigma": fit.relative_sigma,
                "sigma_corrected": fit.sigma_corrected,
                "relative_error": fit.relative_error,
                "per_joint": fit.per_joint,
            },
            "validation": self.validation,
            "weak_directions": {
                name: getattr(self.correlations, name)
                for name in ("threshold", "pairs", "groups", "directions")
            },
            "warnings": self.warnings,
            "trust": self.uncertainty,
            **({"by_record": self.record_errors} if self.record_errors else {}),
            "verdict": self.verdict,
            "checklist": self.checklist,
            "sets": [SetDocument.of(self.written, name) for name in self.written],
            "model_columns": self.model_columns,
        }
        for part in self.parts:
            summary |= part.entries()
        return summary
