"""What may be wrong with a record, a study or a robot file, found by computing: one call, one Check for each question.

    before the fit   positions, speeds, accelerations, torques, lengths, values, rest
    after it         physics alone, size, values of the robot file, direction of gravity, delay of each joint, alternatives

The alternatives (`runtime.identification.plausibility.alternatives`) are tried where `variants` is given, or where something else is doubtful.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.identification.checklist import WORST, Check, State
from runtime.identification.plausibility.alternatives import times_of
from runtime.identification.plausibility.before import REST, before_checks, constant_torques, still, times
from runtime.identification.plausibility.continuous import searched
from runtime.identification.plausibility.delay import CERTAIN, LONGEST, Delay, delay
from runtime.identification.plausibility.excited import excited
from runtime.identification.plausibility.gravity import Gravity, gravity_direction
from runtime.identification.plausibility.known import KnownValues, known_values
from runtime.identification.plausibility.samples import STANDING, Samples, excerpts, samples_of
from runtime.identification.plausibility.through_time import change, cut_torques, jumps
from runtime.identification.plausibility.trials import ALIKE, DECISIVE, Problem, Trial, decisive, problem_of, tried
from runtime.model.compiled import text_of
from runtime.model.generated import GeneratedModel, ModelText, joint_units, loaded
from runtime.model.inertia import physical_model
from runtime.observation.observation import Observation, observe
from runtime.observation.states import unwrapped
from runtime.progress import at
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.settings.study import EstimateSettings, Study
from runtime.table import Table

Array = np.ndarray

GAP = 1.0
"""Score of the best physical robot less that of free parameters, nats a row that counts, from which physics objects."""
WORSE = 2.5
"""... and its error of a joint above that of free parameters, %."""
DENSITY = (0.02, 1e5)
"""Mass of a robot over the cube of its reach, kg/m^3: outside, the torques have another unit or side."""
ROWS = 5
"""Rows for one parameter, below which nothing is judged but the record itself."""
FEWEST = 20
"""Rows of a joint that moves, below which nothing is judged but the record itself."""
RATE = 20.0
"""Gain, nats, that another sampling rate needs beyond that of other alternatives."""
LATE = 0.004
"""Delay, s, from which it is told."""
TILT = 15.0
"""Angle of gravity, degrees, from which it is told."""


@dataclass(frozen=True, eq=False)
class Plausibility:
    """Checks of a record, a study and a robot file.

    Attributes
    ----------
    checks : tuple of Check
    trials : tuple of Trial
        Alternatives, the best first; empty where none were tried.
    named : tuple of Trial
        Those that explain the record decisively better.
    equivalent : tuple of str
        Changes that no fit of this record can tell from the study as given.
    delay : Delay or None
    gravity : Gravity or None
    known : KnownValues or None
    """

    checks: tuple[Check, ...]
    trials: tuple[Trial, ...] = ()
    named: tuple[Trial, ...] = ()
    equivalent: tuple[str, ...] = ()
    delay: Delay | None = None
    gravity: Gravity | None = None
    known: KnownValues | None = None

    @property
    def worst(self) -> Check | None:
        """The first finding that is not good."""
        return next((check for state in WORST[:2] for check in self.checks if check.state == state), None)

    @property
    def line(self) -> str:
        """The worst finding in one line; "" where there is none."""
        return "" if self.worst is None else f"{self.worst.question} {self.worst.finding}. {_sentence(self.worst.remedy)}"

    def __str__(self) -> str:
        return self.to_text()

    def to_text(self) -> str:
        """Findings that are not good, then what was found besides."""
        lines = [f"{c.state}: {c.question} {c.finding}. {_sentence(c.remedy)}" for c in self.checks if c.state in WORST[:2]]
        lines += [f"no record can tell: {text}" for text in self.equivalent]
        return "\n".join(lines or ["Record, study and robot file suit each other, as far as judged."])

    def table(self) -> Table:
        """The alternatives that come nearest, errors by joint in %."""
        rows = [(t.alternative.cause, f"{t.gain:+.0f}", *(f"{e:.1f}" for e in t.fit.errors)) for t in self.trials if t.fit is not None]
        joints = len(self.trials[0].fit.errors) if self.trials and self.trials[0].fit is not None else 0
        header = ("changed", "gain, nats", *(f"joint {j + 1} %" for j in range(joints)))
        return Table("What would explain the record better (gain above 0), or as well", header, rows[:10], wide=(0,))

    def summary(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "checks": [vars(check) for check in self.checks],
            "named": [{"cause": t.alternative.cause, "remedy": t.alternative.remedy, "gain": t.gain} for t in self.named],
            "equivalent": self.equivalent,
            "delay": None if self.delay is None else self.delay.summary(),
            "gravity": None if self.gravity is None else vars(self.gravity),
            "known_values": None if self.known is None else self.known.summary(),
        }


def plausibility(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream],
    study: Study | None = None,
    *,
    variants: GeneratedModel | None = None,
) -> Plausibility:
    """Whether record, study and robot file suit each other, and what explains the record better where they do not.

    Parameters
    ----------
    model : GeneratedModel
    records : Record, Stream, or a sequence of them
        Joint side, SI. Of a record that is read by blocks some excerpts are judged.
    study : Study, optional
        Default: Study().
    variants : GeneratedModel, optional
        The module of `symgen.variants`: alternatives are then tried in any case, those of the table of frames too.
    """
    study = study or Study()
    several = list(records) if isinstance(records, Sequence) else [records]
    at("plausibility of the record")
    checks = [times(several)]
    whole = [part for record in several for part in ([record] if isinstance(record, Record) else excerpts(record, study))]
    try:
        whole = [unwrapped(model, record, study.signals) for record in whole]
        samples = samples_of(whole, study)
    except InputError as e:
        return Plausibility((*checks, Check("Do record and robot file suit each other?", "open", f"Not asked: {e.message}")))
    try:
        model.regressor(samples.q, samples.qd, samples.qdd)
    except ValueError as e:
        return Plausibility((*checks, closure(str(e))))
    try:
        physical = physical_model(model)
    except InputError:
        physical = None
    try:
        observation: Observation | None = observe(model, whole, study)
    except (InputError, np.linalg.LinAlgError):  # no row is used, counts that cannot be read
        observation = None
    motion = None if observation is None else excited(observation, study.signals, whole[0].rate)
    checks += [jumps(model, whole, study), *before_checks(model, samples, physical), rest(model, whole, study, samples, observation)]
    checks += [] if motion is None else [motion]
    rows = samples.moving().sum(axis=0)
    enough = int(rows.sum()) > ROWS * len(model.BASE_PARAMETERS) and int(rows.min()) > FEWEST
    flat = constant_torques(samples).any()
    if physical is None or not enough or flat:
        reason = (
            "the model has no standard parameters"
            if physical is None
            else "a torque never changes"
            if flat
            else "too few samples at which every joint moves"
        )
        return Plausibility((*checks, Check("Does physics agree?", "open", f"Not asked: {reason}")))
    checks += [check for check in (cut_torques(model, whole, samples), change(model, samples)) if check is not None]
    sides = study.record[0].sides if study.record else ("joint", "joint")
    problem = problem_of(model, samples, variants, torque_side=sides[1])
    known = known_values(problem) if problem.barrier.near_values else None
    alone = problem_of(model, samples, variants, torque_side=sides[1], values=False) if known is not None else problem
    gravity = gravity_direction(problem)
    late = delays(model, whole, study)
    asked = (physics(model, alone), size(model, alone), None if late is None else delayed(late), None if known is None else values(known))
    checks += [check for check in asked if check is not None]
    trials: list[Trial] = []
    if variants is not None or any(check.state in WORST[:2] for check in checks):
        at("what would explain the record better")
        trials = _ranked([*tried(problem, sides), *searched(problem)])
        if variants is not None and not any(key.startswith("free_alpha") for key in variants.CONSTANTS):
            text = "Not asked: the loops of the robot file would not close with others"
            checks.append(Check("Are angles and lengths of the table of frames right?", "open", text))
    named = decisive(trials, problem.given)
    checks += [] if gravity is None else [direction(gravity, named)]
    if trials:
        checks.append(better(problem, named))
    hidden = tuple(dict.fromkeys(trial.alternative.subject for trial in trials if trial.equivalent))
    return Plausibility(tuple(checks), tuple(t for t in trials if t.fit is not None)[:10], tuple(named), hidden, late, gravity, known)


@dataclass(frozen=True, eq=False)
class PlausibilityTask:
    """The arguments of `plausibility` for this process or another one, which is sent models as text."""

    model: GeneratedModel | ModelText
    records: Sequence[Record | Stream]
    study: Study
    variants: GeneratedModel | ModelText | None

    def __call__(self) -> Plausibility:
        """What is found."""
        variants = None if self.variants is None else loaded(self.variants)
        return plausibility(loaded(self.model), self.records, self.study, variants=variants)

    def __getstate__(self) -> dict[str, Any]:
        variants = None if self.variants is None else text_of(self.variants)
        return {**vars(self), "model": text_of(self.model), "variants": variants}


def _ranked(trials: Sequence[Trial]) -> list[Trial]:
    """The best first; sampling rates as one, which has to gain RATE more: a slower motion gives the parameters more room."""
    rates = [replace(t, gain=t.gain - RATE) for t in trials if t.alternative.kind == "rate" and t.fit is not None]
    kept = [t for t in trials if t.alternative.kind != "rate" or t.equivalent]
    if rates:
        best = max(rates, key=lambda t: t.gain)
        alike = sorted(t.alternative.rate for t in rates if t.gain >= best.gain - ALIKE * abs(best.gain))
        cause = f"the sampling rate is {times_of(alike)} the stated one"
        kept.append(replace(best, alternative=replace(best.alternative, cause=cause)))
    return sorted(kept, key=lambda trial: -trial.gain)


def rest(model: GeneratedModel, records: Sequence[Record], study: Study, samples: Samples, observation: Observation | None) -> Check:
    """Share of the instants at which a joint stands, and what leaving them out changes. observation : of the study; None: without rows."""
    from runtime.estimators.methods import estimate_of

    question = "Do the joints move while they are used?"
    limit = f"standing at most {100 * REST:g} % of the rows that are used"
    share = standing_share(samples, study)
    worst = int(np.argmax(share))
    text = f"Joint {model.JOINTS[worst]} stands in {100 * share[worst]:.0f} % of its rows"
    proposed = low_speed_of_rest(samples, study)
    if proposed is None:
        return Check(question, "good", text, limit)
    stated = list(proposed) if isinstance(proposed, tuple) else proposed
    remedy = f"set rows.low_speed: {stated} ({joint_units(model)[worst]}/s), or cut the record (rows.window)"
    try:
        without = observe(model, records, replace(study, rows=replace(study.rows, low_speed=proposed)))
    except InputError:
        without = None
    if observation is None or without is None:
        return Check(question, "doubtful", text, limit, remedy)
    before, after = (estimate_of(one, EstimateSettings(), model=model).relative_error for one in (observation, without))
    text += f"; without these rows the fit leaves {after:.1f} % in place of {before:.1f} %"
    state: State = "no" if after < 0.5 * before else "doubtful" if after < 0.8 * before else "good"
    return Check(question, state, text, limit, remedy)


def standing_share(samples: Samples, study: Study) -> Array:
    """Share of the rows of each joint at which it stands, shape (n,)."""
    speed = np.where(still(samples), np.inf, np.abs(samples.qd))  # a joint that never moves is told as such
    used = speed >= np.asarray(study.rows.low_speed, dtype=float)
    standing = used & (speed <= samples.standing())
    return np.asarray(standing.sum(axis=0) / np.maximum(used.sum(axis=0), 1))


def low_speed_of_rest(samples: Samples, study: Study) -> float | tuple[float, ...] | None:
    """rows.low_speed that leaves out the rows of joints that stand, rad/s or m/s; None where at most REST of them stand."""
    if standing_share(samples, study).max() <= REST:
        return None
    low = np.broadcast_to(np.asarray(study.rows.low_speed, dtype=float), (samples.n,))
    wanted = tuple(float(f"{max(v, x):.1g}") for v, x in zip(np.where(still(samples), 0.0, samples.standing()), low, strict=True))
    return max(wanted) if max(wanted) <= 3 * min(wanted) else wanted


def closure(message: str) -> Check:
    """The loops of the robot file do not close in the positions of the record."""
    remedy = "look at sign, zero and order of the positions, at their unit, and at the lengths and the start of the loop"
    return Check("Do the loops close in the positions of the record?", "no", f"No: {message}", "every instant", remedy)


def physics(model: GeneratedModel, problem: Problem) -> Check:
    """Errors by joint of the best physical robot beside those of free parameters."""
    free, given = problem.free, problem.given
    gap = (given.score - given.penalty - free.score) / problem.N
    ratio = given.errors / np.maximum(free.errors, 0.3)
    j = int(np.argmax(given.errors - free.errors))
    text = (
        f"A physical robot leaves {given.errors[j]:.1f} % of the torque of joint {model.JOINTS[j]}, free parameters {free.errors[j]:.1f} %"
    )
    limit = "about the same error"
    remedy = "a sign, an axis, a length or the order of the columns is wrong: look at the alternatives below"
    worse = gap > GAP and ratio[j] > 1.5 and given.errors[j] - free.errors[j] > WORSE
    return Check("Can a physical robot explain the record?", "doubtful" if worse else "good", text, limit, remedy)


def size(model: GeneratedModel, problem: Problem) -> Check | None:
    """Mass that the torques ask for, against the reach of the robot; None where that is not known."""
    from runtime.identification.plausibility.trials import FARTHEST, reach

    question, limit = "Do the torques suit the size of the robot?", f"{DENSITY[0]:g} to {DENSITY[1]:g} kg per cubic metre of reach"
    length = reach(model, problem.samples.q)
    physical = problem.physical
    masses = sum(problem.given.X[physical.link(j)[-1]] for j in physical.links)
    if not physical.links or length > FARTHEST or length <= 0.1 or "m" in joint_units(model):
        return None
    density = masses / length**3
    text = f"They ask for a robot of about {masses:.2g} kg with a reach of {length:.2g} m"
    state: State = "good" if DENSITY[0] <= density <= DENSITY[1] else "doubtful"
    remedy = "look at side, unit and gear of the torques (record.torque_side, units.tau, drives.ratio, torque_constant)"
    return Check(question, state, text, limit, remedy)


def values(known: KnownValues) -> Check:
    """The values of the robot file, by joint."""
    question = "Do the values of the robot file agree with the record?"
    limit = "gravity and inertia torques a third to three times those of the values"
    remedy = (
        "look at ratio, torque constant, unit and sign of that joint, at the load, and at what the model leaves out: a counterbalance or a cable is "
        "subtracted as record.columns.tau_known; or the values are those of another robot"
    )
    ratios = [x for x in (*known.gravity, *known.inertia) if np.isfinite(x)]
    text = (
        f"Ratios of gravity and inertia torques from {min(ratios):.2f} to {max(ratios):.2f}"
        if ratios
        else "Too small beside friction to tell"
    )
    off = known.off
    state: State = "good" if not off else "doubtful"
    return Check(question, state, f"No: {'; '.join(off[:4])}" if off else text, limit, remedy)


def delays(model: GeneratedModel, records: Sequence[Record], study: Study) -> Delay | None:
    """Delay of the longest record; None where it is too short."""
    record = max(records, key=len)
    duration = float(record.t[-1] - record.t[0])
    try:
        return delay(model, record, study, longest=min(LONGEST, duration / 20))
    except (InputError, ValueError):
        return None


def delayed(late: Delay) -> Check | None:
    """Time shift between positions and torques; None where the record does not tell."""
    question, limit = "Do positions and torques belong to the same instants?", f"shift below {1e3 * LATE:g} ms"
    known = np.isfinite(late.sigma)
    if not known.any():
        return None
    certain = np.isfinite(late.common) and abs(late.common) > max(CERTAIN * late.sigma_common, LATE)
    text = f"Torques are {'late' if late.common > 0 else 'early'} by {1e3 * abs(late.common):.1f} ms, deviation {1e3 * late.sigma_common:.1f} ms"
    j = int(np.nanargmax(late.before - late.after))
    text += f"; correcting it changes the error of joint {late.joints[j]} from {late.before[j]:.1f} to {late.after[j]:.1f} %"
    remedy = f"shift the torques by {-1e3 * late.common:+.1f} ms against the positions before reading the record, or mend the logger"
    worth = certain and late.before[j] > 1.1 * late.after[j]
    return Check(question, "doubtful" if worth else "good", text, limit, remedy)


def direction(gravity: Gravity, named: Sequence[Trial]) -> Check:
    """Direction of gravity fitted freely; what another alternative explains better is not told twice."""
    question, limit = "Does gravity point where the robot file says?", f"within {TILT:g} degrees"
    off = gravity.angle > max(TILT, CERTAIN * gravity.sigma) and gravity.gain > DECISIVE
    first = not named or gravity.gain >= 0.9 * named[0].gain
    state: State = "good" if not off else "doubtful" if first else "open"
    remedy = "look at gravity in the robot file, at alpha and theta of the first frames, and at how the robot is mounted"
    return Check(question, state, f"Fitted freely it is {gravity.text}", limit, remedy)


def better(problem: Problem, named: Sequence[Trial]) -> Check:
    """The alternatives that explain the record decisively better."""
    question, limit = (
        "Is the study the best explanation of the record?",
        f"no single change explains it decisively better ({DECISIVE:g} nats)",
    )
    if not named:
        return Check(question, "good", "No single change of signs, columns, units, angles or lengths explains it better", limit)
    best = named[0]
    assert best.fit is not None
    j = int(np.argmax(problem.given.errors / np.maximum(best.fit.errors, 0.3)))
    causes = [t.alternative.cause for t in named]
    text = f"No: {causes[0]}" + (f" (or: {'; '.join(causes[1:])})" if causes[1:] else "")
    text += f"; the error of joint {problem.model.JOINTS[j]} goes from {problem.given.errors[j]:.1f} to {best.fit.errors[j]:.1f} %"
    return Check(question, "no", text, limit, best.alternative.remedy)


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


__all__ = ["STANDING", "Plausibility", "plausibility"]
