"""Find by computation what may be wrong with a record, a study or a robot file.

One call answers several questions, each with a Check:

    CHECKS       questions about the record and the robot file, then about the fit; one file
                 for each family of errors
    EXPLAINED    questions about causes (`runtime.plausible.causes`), which are tried if
                 `variants` is given or if another check is doubtful

A new check is a function of a `Case` and its line in the table `CHECKS` (docs/contributing.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.core.model import GeneratedModel, require_no_axes, require_no_channels
from runtime.core.problem import Problem
from runtime.core.result import Identification
from runtime.ground.check import WORST, Check, worst_of
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.part import Part
from runtime.ground.progress import at
from runtime.ground.table import Table
from runtime.plausible.case import Case
from runtime.plausible.delay import Delay
from runtime.plausible.friction import friction
from runtime.plausible.jumps import cut_torques, jumps
from runtime.plausible.known import KnownValues
from runtime.plausible.motion import motion_excites, recorded_speeds, rest
from runtime.plausible.physics import (
    better,
    delayed,
    gain_of_alternative,
    late_gain,
    measured,
    not_asked,
    physics,
    size,
    values,
)
from runtime.plausible.registers import signed
from runtime.plausible.samples import excerpts, filtered, samples_of
from runtime.plausible.sampling import sampled
from runtime.plausible.sizes import (
    accelerations,
    inertias,
    lengths,
    positions,
    speeds,
    standing,
    times,
    torques,
)
from runtime.plausible.trials import Trial, decisive, regressor, try_causes

CHECKS: tuple[Callable[[Case], Check | None], ...] = (
    standing,
    jumps,
    positions,
    speeds,
    accelerations,
    torques,
    lengths,
    inertias,
    rest,
    sampled,
    recorded_speeds,
    motion_excites,
    not_asked,
    cut_torques,
    signed,
    friction,
    physics,
    measured,
    size,
    values,
)
EXPLAINED: tuple[Callable[[Case, Sequence[Trial]], Check | None], ...] = (
    delayed,
    better,
)


@dataclass(frozen=True, eq=False)
class Plausibility(
    Result,
    Part,
    keys="checks:answers named:named_causes equivalent delay known_values:robot_values",
):
    """Results of the checks of a record, a study and a robot file, with the corrections tried.

    Attributes
    ----------
    answers : tuple of Check
    trials : tuple of Trial
        Changes of the study that were fitted, the best first; empty if none were tried.
    named : tuple of Trial
        The trials that explain the record decisively better than the study.
    equivalent : tuple of str
        Changes that no fit of this record can distinguish from the study as given.
    delay : Delay or None
    robot_values : KnownValues or None
    """

    answers: tuple[Check, ...]
    trials: tuple[Trial, ...] = ()
    named: tuple[Trial, ...] = ()
    equivalent: tuple[str, ...] = ()
    delay: Delay | None = None
    robot_values: KnownValues | None = None

    name = "plausibility"
    title = "Record, study and robot file"
    about = "record"

    @property
    def worst(self) -> Check | None:
        """The check that has the worst finding; None if all findings are good."""
        return worst_of(self.answers)

    @property
    def named_causes(self) -> list[dict[str, Any]]:
        """Possible errors (causes) whose correction explains the record decisively better.

        Each has the keys cause, remedy, gain (nats) and change (of the study).
        """
        return [
            {
                "cause": t.cause.says,
                "remedy": t.cause.remedy,
                "gain": t.gain,
                "change": t.cause.change,
            }
            for t in self.named
        ]

    @property
    def line(self) -> str:
        """Question, finding and remedy of the worst check; an empty string if all are good."""
        return "" if self.worst is None else self.worst.sentence

    def checks(self) -> tuple[Check, ...]:
        """Return all checks: the questions with their answers."""
        return self.answers

    def text(self) -> str:
        """List the possible errors of the study that no fit of the record can reveal."""
        return "\n".join(f"No record can show: {change}." for change in self.equivalent)

    def to_text(self) -> str:
        """Write the findings that are not good, then the errors that no fit can reveal."""
        lines = [f"{c.state}: {c.sentence}" for c in self.answers if c.state in WORST[:2]]
        told = "\n".join(filter(None, [*lines, self.text()]))
        return told or "Record, study and robot file agree, as far as symgen can judge."

    def tables(self) -> list[Table]:
        """Make the tables of the corrections tried, of delays, and of the robot file's values."""
        judged = (self.delay, self.robot_values)
        tried = [self.table()] if any(trial.fit is not None for trial in self.trials) else []
        return [*tried, *(own.table() for own in judged if own is not None)]

    def table(self) -> Table:
        """Tabulate the ten best corrections tried: gain in nats, and error of each joint in %."""
        rows = [
            (t.cause.says, f"{t.gain:+.0f}", *(f"{e:.1f}" for e in t.fit.errors))
            for t in self.trials
            if t.fit is not None
        ]
        joints = range(1, max(map(len, rows), default=2) - 1)
        header = ("changed", "gain, nats", *(f"joint {j} %" for j in joints))
        return Table(
            "What would explain the record better (gain above 0), or as well",
            header,
            rows[:10],
            wide=(0,),
        )


def plausibility_of(result: Identification, variants: GeneratedModel | None = None) -> Plausibility:
    """Check record, study and robot file of an identification (see `plausibility`).

    Static poses and robots with force sensors or a free base are refused with an InputError.
    """
    if result.problem.reader.at_rest:
        raise InputError(
            "record and study are not judged for poses at rest; the checks need a motion"
        )
    return plausibility(result.problem, variants=variants)


def plausibility(problem: Problem, *, variants: GeneratedModel | None = None) -> Plausibility:
    """Check whether record, study and robot file agree; if not, search for the possible error.

    A cause is a single change of the study, for instance another sign, that explains the record
    better.

    Parameters
    ----------
    problem : Problem
        Prepared.
    variants : GeneratedModel, optional
        The module of `symgen.variants`. With it, causes are tried in any case, and errors of the
        table of frames are among them.
    """
    problem.require_motion("a check of slips")
    require_no_axes(problem.model, "the check of record and study")
    at("plausibility of the record")
    first = times(problem.records)
    case = case_of(problem, variants)
    if isinstance(case, Check):
        return Plausibility((first, case))
    answers = {check: check(case) for check in CHECKS}
    checks = [first, *(found for found in answers.values() if found is not None)]
    if case.baseline is None:
        return Plausibility(tuple(checks), robot_values=case.robot_values)
    question = "Is the study the best explanation of the record?"
    broken_by = (
        (jumps, "the positions jump"),
        (signed, "torques lack their sign"),
        (cut_torques, "torques are cut off"),
    )
    for check, text in broken_by:
        # what explains a broken record better is no cause
        if (broken := answers[check]) is not None and broken.state == "no":
            checks.append(Check(question, "open", f"Not checked: {text}"))
            return Plausibility(tuple(checks))
    if (lacking := answers[friction]) is not None and lacking.state in WORST[:2]:
        checks.append(Check(question, "open", "Not checked: the robot file lacks friction"))
        return Plausibility(tuple(checks), robot_values=case.robot_values)
    trials: list[Trial] = []
    if variants is not None or worst_of(checks) is not None:
        at("what would explain the record better")
        trials = try_causes(case.baseline, case.sides, case.column_units)
        if case.robot_values is not None and case.robot_values.heavy:
            trials = [t for t in trials if t.cause.kind != "rate"]
        if case.robot_values is not None and case.robot_values.factors:
            # factors of single joints are differences of their gears
            trials = [t for t in trials if t.cause.kind != "factor"]
        if variants is not None and "free_alpha" not in " ".join(variants.CONSTANTS):
            text = (
                "Not checked: with other angles or lengths the loops of the robot file "
                "would not close"
            )
            question = "Are angles and lengths of the table of frames right?"
            checks.append(Check(question, "open", text))
    named = [
        t
        for t in decisive(trials, case.baseline, case.noise_floor, case.validation, case.alone)
        if gain_of_alternative(case, t) > late_gain(case)
    ]
    wrong = [t for t in named if named[0].cause.kind != "friction"]
    asked = EXPLAINED if trials else EXPLAINED[:-1]
    checks += [found for check in asked if (found := check(case, named)) is not None]
    hidden = dict.fromkeys(trial.cause.subject for trial in trials if trial.equivalent)
    return Plausibility(
        tuple(checks),
        tuple(t for t in trials if t.fit is not None)[:10],
        tuple(wrong),
        tuple(hidden),
        case.late,
        case.robot_values,
    )


def case_of(problem: Problem, variants: GeneratedModel | None) -> Case | Check:
    """Prepare the data for the checks; if this is impossible, return a Check with the reason."""
    model, study = problem.model, problem.settings
    own = [part for reading in problem.prepared for part in excerpts(reading)]
    try:
        require_no_channels(model, "a trial of another reading")
        straight = own
        if (unwrapped := problem.reader.unwrapped) is not None:
            straight = [
                replace(one, record=unwrapped(one.record, study.signals, one.drives)) for one in own
            ]
        through = [filtered(one, study) for one in straight]
        samples = samples_of(through, study)
    except InputError as e:
        question = "Do record and robot file agree?"
        return Check(question, "open", f"Not checked: {e.message}")
    try:
        D = regressor(model, (samples.q, samples.qd, samples.qdd))
    except ValueError as e:
        return Check(
            "Do the loops close in the positions of the record?",
            "no",
            f"No: {e}",
            "every instant",
            "check sign, zero, order and unit of the positions, and the lengths and the start "
            "of the loop",
        )
    unseen = problem.prepared_unseen
    return Case(model, own, straight, study, through, samples, D, variants, unseen)


__all__ = ["Plausibility", "plausibility"]
