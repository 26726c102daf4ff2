"""Checks along the record: positions that jump or freeze, torques that are clipped.

jumps      a step of q between two samples that differs from the steps around it by JUMP times the
           usual change, and by more than any robot accelerates. Causes are an encoder that dropped
           out, missing samples, angles that wrap, or two records joined into one
frozen     a moving joint that suddenly holds one value for HELD samples
cut        the largest or the smallest torque is repeated in many samples, and a model that is
           fitted to the other samples predicts larger values: the signal was clipped. If the drive
           saturates and its true torque is recorded, the model does not predict larger values
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.ndimage import median_filter

from runtime.core.model import drives_of, joint_torque_units
from runtime.core.record import Record
from runtime.core.signals.filters import median_filtered
from runtime.ground.check import Answer, Question
from runtime.ground.errors import instant
from runtime.ground.limits import limits
from runtime.plausible.bodies import least_squares
from runtime.plausible.case import Case
from runtime.plausible.samples import moving as in_motion

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Course:
    """Positions of one record from sample to sample.

    Attributes
    ----------
    record : Record
    q : ndarray, shape (N, n), rad or m
        Positions after the median filter of the study.
    high : ndarray of bool, shape (N - 1, n)
        Steps between two samples that are jumps.
    sharp : ndarray of bool, shape (N - 2, n)
        Changes from one step to the next that no robot makes.
    window : int
        Samples of the median filter.
    """

    record: Record
    q: Array
    high: Array
    sharp: Array
    window: int

    @cached_property
    def steps(self) -> Array:
        """Size of each step between two samples, shape (N - 1, n)."""
        return np.abs(np.diff(self.q, axis=0))

    def jumps(self) -> tuple[Array, Array]:
        """First and last step of each jump of any joint."""
        return _runs(np.asarray(self.high.any(axis=1)), self.window)


def course_of(case: Case, record: Record) -> Course:
    """Find the jumps and the sharp changes of the positions of a record."""
    window, limits = case.study.signals.median, case.limits("qd")
    fastest = np.array([LIMIT.LARGEST_SPEED[unit][1] for unit in case.units])
    fastest = fastest if limits is None else 4 * limits
    good, none = np.array([LIMIT.LARGEST_ACCELERATION[unit] for unit in case.units]).T
    q = median_filtered(record.q, window)
    steps = np.diff(q, axis=0)
    apart = np.abs(steps - median_filter(steps, (2 * LIMIT.JUMP_STEPS + 1, 1)))
    least = np.minimum(fastest / record.rate, none / record.rate**2)
    high = apart > np.maximum(LIMIT.JUMP * _usual(apart), least)
    changes = np.abs(np.diff(q, 2, axis=0))
    sharp = changes > np.maximum(LIMIT.JUMP * _usual(changes), good / record.rate**2)
    return Course(record, q, high, sharp, window)


def same_positions(case: Case, course: Course) -> Answer | None:
    """Report two joints that move and have the same positions in the file."""
    drives = drives_of(case.model) if case.sides[0] == "motor" else None
    q = course.record.q
    files = np.diff(q if drives is None else drives.motor_position(q), axis=0)
    for two in combinations(np.flatnonzero(course.steps.any(axis=0)), 2):
        if np.ptp(files[:, two], axis=1).max() <= 1e-9 * np.abs(files[:, two]).max():
            return Answer(
                "no",
                f"Positions of joints {' and '.join(case.labels[j] for j in two)} are the same",
                "one column is used for both joints: check record.columns.q",
            )
    return None


def frozen_encoder(case: Case, course: Course) -> Answer | None:
    """Report a joint that moves and whose position suddenly stays at one value."""
    pairs = zip(course.steps.T, course.sharp.T, strict=True)
    frozen = np.array([_frozen(steps, sharp) for steps, sharp in pairs])
    if not frozen.any():
        return None
    k = int(np.flatnonzero(frozen.any(axis=0))[0])
    return Answer(
        "no",
        f"Joint {case.joint_labels(np.asarray(frozen.any(axis=1)))} moves, but its position suddenly "
        f"stays at one value at {instant(course.record.t[k])} s",
        "an encoder froze: leave this time out (rows.window), or repair the record",
    )


def jumping_joints(case: Case, course: Course) -> Answer | None:
    """Report the joints of the first jump, its size, and its probable cause."""
    if not course.high.any():
        return None
    first, _ = course.jumps()
    k = int(first[0])
    jumping = course.high[k]
    sizes = zip(course.steps[k], case.units, jumping, strict=True)
    by = ", ".join(f"{size:.3g} {unit}" for size, unit, own in sizes if own)
    one = np.count_nonzero(jumping) == 1
    who = (
        f"{'Joint' if one else 'Joints'} {case.joint_labels(jumping)} {'jumps' if one else 'jump'}"
    )
    text = f"{who} by {by} at {instant(course.record.t[k])} s"
    if more := len(first) - 1:
        text += f", and at {more} more {'instant' if more == 1 else 'instants'}"
    if _wrap(course):
        remedy = (
            "the position starts anew: for an angle at a full turn set record: "
            "{unwrap: true}, for a counter set signals: {reader: counts}"
        )
    elif not one or len(case.units) == 1:
        remedy = (
            "samples are missing there, or two records are joined: give each its own file "
            "(record.also), or cut (rows.window)"
        )
    else:
        remedy = (
            "an encoder failed, froze or was reset: leave this time out (rows.window), or "
            "repair the record"
        )
    return Answer("no", text, remedy)


FINDINGS = (same_positions, frozen_encoder, jumping_joints)


@Question(
    "Are the positions those of a motion?",
    f"steps between samples that differ by less than {LIMIT.JUMP:g} times the usual change, or by "
    "less than the largest acceleration of a robot allows",
)
def jumps(case: Case) -> Answer:
    """Check whether a joint position jumps, freezes, or is the same as that of another joint."""
    for record in case.records:
        course = course_of(case, record)
        for finding in FINDINGS:
            if (answer := finding(case, course)) is not None:
                return answer
    return Answer("good", "No joint jumps between two samples")


def _usual(x: Array) -> Array:
    """Compute the usual change of each joint: the 90 % quantile of all changes that are not zero.

    `x` holds the sizes of the changes, shape (N, n); the result has the shape (n,).
    """
    return np.array([np.quantile(own[own > 0], 0.9) if own.any() else np.inf for own in x.T])


def _frozen(steps: Array, sharp: Array) -> Array:
    """Find the instants at which a joint stops sharply and then holds one value, bool (N,).

    The value must stay for HELD samples (limits.toml).

    steps : size of each step between samples, shape (N - 1,).
    sharp : whether the speed changes sharply from one step to the next, bool (N - 2,).
    """
    still = np.append(np.cumsum(steps == 0), 0)
    k = np.flatnonzero(sharp) + 1  # the first of the steps after each change
    k = k[(k + LIMIT.HELD < len(steps)) & (steps[k - 1] > 0)]
    held = np.zeros(len(steps) + 1, dtype=bool)
    held[k] = still[k + LIMIT.HELD - 1] - still[k - 1] == LIMIT.HELD
    return held


def _runs(high: Array, window: int) -> tuple[Array, Array]:
    """Find the start and the end of each jump: its first and its last step between samples.

    Resampling may spread a jump over several steps.
    """
    instants = np.flatnonzero(high)
    apart = np.diff(instants) > max(window, LIMIT.JUMP_STEPS)
    return instants[np.append(True, apart)], instants[np.append(apart, True)]


def _wrap(course: Course) -> bool:
    """Whether all jumps of each joint have one size, as if its angle or counter wraps around.

    A joint that jumps must do so more than once.
    """
    around, again = LIMIT.JUMP_STEPS, []
    for own, jump, step in zip(course.q.T, course.high.T, _usual(course.steps), strict=True):
        if jump.any():
            first, last = _runs(jump, course.window)
            before = own[np.maximum(first - around, 0)]
            sizes = np.abs(own[np.minimum(last + around, len(own) - 1)] - before)
            again.append(len(sizes) > 1 and np.ptp(sizes) <= 2 * LIMIT.JUMP * step)
    return all(again)


@Question(
    "Are the torques recorded in full?",
    f"less than {100 * LIMIT.CUT:g} % of the samples at the largest torque, or a model of the "
    f"other samples that exceeds this torque by less than {LIMIT.BEYOND_BOUND:g} "
    "times their residual",
    "the signal is clipped: raise the range of the logger, or record a motion that "
    "needs less torque",
)
def cut_torques(case: Case) -> Answer | None:
    """Check whether torques were clipped at their largest or smallest value.

    A model that is fitted to the other samples predicts the torques at these values. The result is
    None if no torque stays at such a value, or if nothing is fitted.
    """
    if case.silent:
        return None
    samples, moving = case.samples, in_motion(case.samples.qd)
    at_bounds, beside, shares = np.zeros_like(moving), np.zeros_like(moving), np.zeros(samples.n)
    for number, one in enumerate(case.straight):
        record, drives, own = one.record, one.drives, samples.record == number
        held = np.stack([_at_bound(tau) for tau in record.tau.T], axis=1)
        if drives is not None:  # a motor that is clipped shows in every joint that it moves
            motors = np.stack([_at_bound(u) for u in drives.motor_command(record.tau).T], axis=1)
            held |= motors @ (drives.ratio != 0)
        reach = max(1, round(0.5 * record.rate / samples.cutoff))
        k = np.searchsorted(record.t, samples.t[own])
        near = (k[:, None] + np.arange(-reach, reach + 1)).clip(0, len(record) - 1)
        at_bounds[own], beside[own] = held[k.clip(0, len(record) - 1)], held[near].any(axis=1)
        shares = np.maximum(shares, held.mean(axis=0))
    if not beside.any():
        return None
    asked = beside.any(axis=0) & (shares < LIMIT.TWO_BOUNDS)
    apart = moving & ~beside
    columns = (case.D != 0).any(axis=0).sum(axis=1)
    few = asked & (apart.sum(axis=0) < 2 * np.maximum(LIMIT.PART_ROWS, columns))
    fit = least_squares(case.grams(apart), 1.0)
    outward = np.sign(samples.tau - (samples.tau.max(axis=0) + samples.tau.min(axis=0)) / 2)
    missing = outward * (case.D @ fit.X - samples.tau + samples.tau_known) * at_bounds
    missing = missing.sum(axis=0) / np.maximum(at_bounds.sum(axis=0), 1)
    beyond = np.where(asked & ~few, missing / fit.sigma, 0.0)
    clipped = beyond > LIMIT.BEYOND_BOUND
    j = int(
        np.argmax(
            beyond
            if clipped.any()
            else shares * (few if few.any() else asked if asked.any() else 1)
        )
    )
    motor = " or of a motor that moves it" if case.straight[0].drives is not None else ""
    text = (
        f"The torque of joint {case.labels[j]}{motor} is at its largest or "
        f"smallest value in {100 * shares[j]:.0f} % of the samples"
    )
    if not asked.any():
        return Answer(
            "good", f"{text}: an on-off drive has only these two values, so this is no clipping"
        )
    if few[j]:
        return Answer(
            "doubtful", f"{text}: too few other samples remain to judge whether it was clipped"
        )
    return Answer(
        "no" if clipped[j] else "good",
        f"{text}; there, a model of the other samples exceeds the value by {missing[j]:.2g} "
        f"{joint_torque_units(case.model)[j]} on average, {beyond[j]:.1f} times "
        "the residual elsewhere",
    )


def _at_bound(tau: Array) -> Array:
    """Whether each sample has the largest or the smallest torque of the record, bool (N,).

    The answer is True only if the record repeats this value far more often than the values next to
    it.
    """
    held = np.zeros(len(tau), dtype=bool)
    span = float(np.ptp(tau))
    for side in (1.0, -1.0):
        x = side * tau
        x = np.round(x / (1e-9 * span or 1.0))  # rounding of a conversion is no level
        levels, counts = np.unique(x[x >= x.max() - 2e8], return_counts=True)
        if (
            span > 0
            and counts[-1] >= LIMIT.CUT * len(tau)
            and counts[-1] > LIMIT.CUT_LEVELS * counts[-1 - LIMIT.CUT_NEXT : -1].max(initial=1)
        ):
            held |= x == levels[-1]
    return held
