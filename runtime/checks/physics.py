"""After the fit: can a physical robot explain the record, of this size, with these values, with
gravity and time as they are said to be? And would another study explain it better?
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.checks.case import Case
from runtime.checks.check import Check, State
from runtime.checks.trials import Trial, reach
from runtime.limits import LIMIT


def not_asked(case: Case) -> Check | None:
    """Why nothing is fitted; None where it is."""
    if not case.silent:
        return None
    return Check("Does physics agree?", "open", f"Not asked: {case.silent}")


def physics(case: Case) -> Check | None:
    """Errors by joint of the best physical robot beside those of free parameters."""
    if case.alone is None:
        return None
    free, given = case.alone.free, case.alone.given
    gap = (given.score - given.penalty - free.score) / case.alone.N
    ratio = given.errors / np.maximum(free.errors, 0.3)
    j = int(np.argmax(given.errors - free.errors))
    text = (
        f"A physical robot leaves {given.errors[j]:.1f} % of the torque of joint "
        f"{case.model.JOINTS[j]}, free parameters {free.errors[j]:.1f} %"
    )
    remedy = (
        "a sign, an axis, a length or the order of the columns is wrong: look at the "
        "alternatives below"
    )
    worse = (
        gap > LIMIT.PHYSICS_GAP
        and ratio[j] > 1.5
        and given.errors[j] - free.errors[j] > LIMIT.PHYSICS_ERROR
    )
    question = "Can a physical robot explain the record?"
    state: State = "doubtful" if worse else "good"
    return Check(question, state, text, "about the same error", remedy)


def size(case: Case) -> Check | None:
    """Mass that the torques ask for, against the reach of the robot; None where that is not
    known.
    """
    if case.alone is None or not case.alone.physical.links or not case.turning.all():
        return None
    length, physical = reach(case.model, case.samples.q), case.alone.physical
    if length > LIMIT.FARTHEST_REACH or length <= 0.1:
        return None
    masses = sum(case.alone.given.X[physical.link(j)[-1]] for j in physical.links)
    low, high = LIMIT.DENSITY
    state: State = "good" if low <= masses / length**3 <= high else "doubtful"
    return Check(
        "Do the torques suit the size of the robot?",
        state,
        f"They ask for a robot of about {masses:.2g} kg with a reach of {length:.2g} m",
        f"{low:g} to {high:g} kg per cubic metre of reach",
        "look at side, unit and gear of the torques (record.torque_side, units.tau, "
        "drives.ratio, torque_constant)",
    )


def values(case: Case) -> Check | None:
    """The values of the robot file, by joint."""
    if case.robot_values is None:
        return None
    remedy = (
        "look at ratio, torque constant, unit and sign of that joint, at the load, and at what the "
        "model leaves out: a counterbalance or a cable is "
        "subtracted as record.columns.tau_known; or the values are those of another robot"
    )
    ratios = [x for x in (*case.robot_values.gravity, *case.robot_values.inertia) if np.isfinite(x)]
    text = (
        f"Ratios of gravity and inertia torques from {min(ratios):.2f} to {max(ratios):.2f}"
        if ratios
        else "Too small beside friction to tell"
    )
    off = case.robot_values.off
    return Check(
        "Do the values of the robot file agree with the record?",
        "doubtful" if off else "good",
        f"No: {'; '.join(off[:4])}" if off else text,
        "gravity and inertia torques a third to three times those of the values",
        remedy,
    )


def delayed(case: Case) -> Check | None:
    """Time shift between positions and torques; None where the record does not tell."""
    late = None if case.problem is None else case.late
    if late is None or not np.isfinite(late.sigma).any():
        return None
    least = max(LIMIT.CERTAIN_DELAY * late.sigma_common, LIMIT.LATE)
    j = int(np.nanargmax(late.before - late.after))
    text = (
        f"Torques are {'late' if late.common > 0 else 'early'} by {1e3 * abs(late.common):.1f} "
        f"ms, deviation {1e3 * late.sigma_common:.1f} ms; correcting it changes the error of joint "
        f"{late.joints[j]} from {late.before[j]:.1f} to {late.after[j]:.1f} %"
    )
    remedy = (
        f"shift the torques by {-1e3 * late.common:+.1f} ms against the positions before "
        "reading the record, or mend the logger"
    )
    worth = abs(late.common) > least and late.before[j] > 1.1 * late.after[j]
    return Check(
        "Do positions and torques belong to the same instants?",
        "doubtful" if worth else "good",
        text,
        f"shift below {1e3 * LIMIT.LATE:g} ms",
        remedy,
    )


def direction(case: Case, named: Sequence[Trial]) -> Check | None:
    """Direction of gravity fitted freely; what another alternative explains better is not told
    twice.
    """
    gravity = case.gravity
    if gravity is None:
        return None
    off = (
        gravity.angle > max(LIMIT.TILT, LIMIT.CERTAIN_DELAY * gravity.sigma)
        and gravity.gain > LIMIT.DECISIVE
    )
    first = not named or gravity.gain >= 0.9 * named[0].gain
    return Check(
        "Does gravity point where the robot file says?",
        "good" if not off else "doubtful" if first else "open",
        f"Fitted freely it is {gravity.text}",
        f"within {LIMIT.TILT:g} degrees",
        "look at gravity in the robot file, at alpha and theta of the first frames, and at "
        "how the robot is mounted",
    )


def better(case: Case, named: Sequence[Trial]) -> Check:
    """The alternatives that explain the record decisively better."""
    question = "Is the study the best explanation of the record?"
    limit = f"no single change explains it decisively better ({LIMIT.DECISIVE:g} nats)"
    if not named:
        text = "No single change of signs, columns, units, angles or lengths explains it better"
        return Check(question, "good", text, limit)
    assert case.problem is not None and named[0].fit is not None
    before, after = case.problem.given.errors, named[0].fit.errors
    j = int(np.argmax(before / np.maximum(after, 0.3)))
    cause, *others = (t.alternative.cause for t in named)
    text = f"No: {cause}" + (f" (or: {'; '.join(others)})" if others else "")
    text += (
        f"; the error of joint {case.model.JOINTS[j]} goes from {before[j]:.1f} to {after[j]:.1f} %"
    )
    return Check(question, "no", text, limit, named[0].alternative.remedy)
