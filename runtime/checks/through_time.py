"""Along the record: positions that jump, torques that are cut off, a robot that changes.

jumps      a step of q between two samples that is LIMIT.JUMP times the usual one and faster than
           any robot: an encoder that dropped out, samples that are
           missing, angles that wrap, two records joined into one
cut        the largest or the smallest torque holds for many samples, and the fit is better without
           them: a clipped signal. A torque that saturates
           the drive and is recorded as it acted leaves the fit as it is
change     Y = W X fitted apart before and after an instant t leaves less than 1/LIMIT.CHANGE of
           what one X leaves
"""

from __future__ import annotations

import numpy as np

from runtime.checks.case import Case
from runtime.checks.check import Answer, Question
from runtime.checks.fits import least_squares
from runtime.errors import instant
from runtime.limits import LIMIT
from runtime.signals.filters import median_filtered

Array = np.ndarray


@Question(
    "Are the positions those of a motion?",
    f"steps below {LIMIT.JUMP:g} times the usual ones, or below the speed of any robot",
)
def jumps(case: Case) -> Answer:
    """Positions that no joint can have passed through."""
    median, units, limits = case.study.signals.median, case.units, case.limits("qd")
    fastest = np.array([LIMIT.LARGEST_SPEED[unit][1] for unit in units])
    fastest = fastest if limits is None else 4 * limits
    for record in case.records:
        steps = np.abs(np.diff(median_filtered(record.q, median), axis=0))
        usual = np.array([np.quantile(s[s > 0], 0.9) if s.any() else np.inf for s in steps.T])
        high = steps > np.maximum(LIMIT.JUMP * usual, fastest / record.rate)
        if not high.any():
            continue
        instants = np.flatnonzero(high.any(axis=1))
        k = int(instants[0])
        joints = np.flatnonzero(high[k])
        by = ", ".join(f"{steps[k, j]:.3g} {units[j]}" for j in joints)
        who = f"Joints {case.joints(high[k])} jump"
        if len(joints) == 1:
            who = f"Joint {case.joints(high[k])} jumps"
        text = f"{who} by {by} at {instant(record.t[k])} s"
        if more := np.count_nonzero(np.diff(instants) > median):
            text += f", and at {more} more {'instant' if more == 1 else 'instants'}"
        if _wrap(steps, high, usual):
            remedy = "it wraps: unwrap it, or record counts and let signals: {reader: counts} do so"
        elif len(joints) == len(units):
            remedy = (
                "samples are missing there, or two records are joined: give each its own file "
                "(record.also), or cut (rows.window)"
            )
        else:
            remedy = (
                "an encoder dropped out, froze or was set anew: leave this time out "
                "(rows.window), or repair the record"
            )
        return Answer("no", text, remedy)
    return Answer("good", "No joint jumps between two samples")


def _wrap(steps: Array, high: Array, usual: Array) -> bool:
    """Whether all jumps of every joint have one size, more than once, as those of a count or an
    angle that starts anew.
    """
    sizes = [s[h] for s, h in zip(steps.T, high.T, strict=True)]
    again = [
        len(x) > 1 and np.ptp(x) <= LIMIT.JUMP * u
        for x, u in zip(sizes, usual, strict=True)
        if len(x)
    ]
    return bool(again) and all(again)


@Question(
    "Are the torques recorded in full?",
    f"less than {100 * LIMIT.CUT:g} % of the samples at the largest torque, or no better fit "
    "without them",
    "the signal is clipped: raise the range of the logger, or record a motion that asks "
    "for less torque",
)
def cut_torques(case: Case) -> Answer | None:
    """Torques that stay at their largest or smallest value, and what leaving these samples out
    changes; None where there are none.
    """
    if case.silent:
        return None
    samples, moving = case.samples, case.samples.moving()
    at_bounds, shares = np.zeros_like(moving), np.zeros(samples.n)
    for number, record in enumerate(case.records):
        held = np.stack([_held(tau) for tau in record.tau.T], axis=1)
        own = samples.record == number
        reach = max(1, round(0.5 * record.rate / samples.cutoff))
        near = np.searchsorted(record.t, samples.t[own])[:, None] + np.arange(-reach, reach + 1)
        at_bounds[own] = held[near.clip(0, len(record) - 1)].any(axis=1)
        shares = np.maximum(shares, held.mean(axis=0))
    if not at_bounds.any():
        return None
    apart = moving & ~at_bounds
    with_them, without = (least_squares(case.grams(mask), 1.0).errors for mask in (moving, apart))
    # a drive that knows its two bounds alone is no clipped signal
    enough = apart.sum(axis=0) >= 0.5 * moving.sum(axis=0)
    better = with_them / np.maximum(without, 0.3)
    j = int(np.argmax(np.where(at_bounds.any(axis=0) & enough, better, 0.0)))
    clipped = (
        enough[j]
        and with_them[j] > LIMIT.CHANGE * without[j]
        and with_them[j] - without[j] > LIMIT.LEAST_CHANGE
    )
    return Answer(
        "no" if clipped else "good",
        f"The torque of joint {case.model.JOINTS[j]} is at its largest or smallest value in "
        f"{100 * shares[j]:.0f} % of the samples; without them the fit leaves {without[j]:.1f} % "
        f"of it in place of {with_them[j]:.1f} %",
    )


def _held(tau: Array) -> Array:
    """Whether each sample is at a bound at which the torque stays, (N,)."""
    held = np.zeros(len(tau), dtype=bool)
    span = float(np.ptp(tau))
    for side in (1.0, -1.0):
        x = side * tau
        levels, counts = np.unique(x[x >= x.max() - 0.2 * span], return_counts=True)
        if (
            span > 0
            and counts[-1] >= LIMIT.CUT * len(tau)
            and counts[-1] > LIMIT.CUT_LEVELS * counts[-1 - LIMIT.CUT_NEXT : -1].max(initial=1)
        ):
            held |= x == levels[-1]
    return held


@Question(
    "Is the robot the same from beginning to end?",
    f"two fits in time leave more than 1/{LIMIT.CHANGE:g} of what one leaves",
    "a load, a gain or friction changed there, or two records are joined: use one part "
    "(rows.window), or name them as records of their own",
)
def change(case: Case) -> Answer | None:
    """The instant at which two fits, before and after it, leave least, beside one fit."""
    if case.silent:
        return None
    samples, b, moving = case.samples, case.D.shape[2], case.samples.moving()
    best, text = 1.0, "One fit serves all of it"
    for number in np.unique(samples.record):
        own = samples.record == number
        t = samples.t[own]
        whole = case.grams(moving & own[:, None])
        together = least_squares(whole, 1.0).errors
        for split in t[np.linspace(0, len(t) - 1, LIMIT.SPLITS + 2).astype(int)[1:-1]]:
            parts = [
                case.grams(moving & (own & side)[:, None])
                for side in (samples.t < split, samples.t >= split)
            ]
            if any(
                part.rows.sum() < LIMIT.PART_ROWS * b or part.rows.min() < 2 * LIMIT.PART_ROWS
                for part in parts
            ):
                continue
            left = sum(part.squares(least_squares(part, 1.0).X) for part in parts)
            apart = 100 * np.sqrt(left / np.where(whole.measured > 0, whole.measured, 1.0))
            clear = together - apart > LIMIT.LEAST_CHANGE
            ratio = np.where(clear, together / np.maximum(apart, 0.3), 0.0)
            j = int(np.argmax(ratio))
            if ratio[j] > best:
                best = float(ratio[j])
                text = (
                    f"Before and after {instant(round(float(split), 1))} s, fitted apart, "
                    f"{apart[j]:.1f} % of the torque of joint {case.model.JOINTS[j]} stay "
                    f"unexplained, fitted together {together[j]:.1f} %"
                )
    return Answer("doubtful" if best > LIMIT.CHANGE else "good", text)
