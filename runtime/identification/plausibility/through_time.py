"""Along the record: positions that jump, torques that are cut off, a robot that changes.

jumps      a step of q between two samples that is STEP times the usual one and faster than any robot: an encoder that dropped out, samples that are
           missing, angles that wrap, two records joined into one
cut        the largest or the smallest torque holds for many samples, and the fit is better without them: a clipped signal. A torque that saturates
           the drive and is recorded as it acted leaves the fit as it is
change     Y = W X fitted apart before and after an instant t leaves less than 1/CHANGE of what one X leaves
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.errors import instant
from runtime.identification.checklist import Check, State
from runtime.identification.plausibility.before import limits_of, speed_bounds
from runtime.identification.plausibility.fits import Grams, least_squares
from runtime.identification.plausibility.samples import Samples
from runtime.model.generated import GeneratedModel, joint_units
from runtime.observation.filters import median_filtered
from runtime.records.record import Record
from runtime.settings.study import Study

Array = np.ndarray

STEP = 10.0
"""A jump over the steps that nine in ten of the steps other than zero stay below."""
CUT = 0.01
"""Share of the samples at the largest or the smallest torque, ..."""
CUT_LEVELS = 10.0
"""... which is this many times as often met as any of the next NEXT values."""
NEXT = 5
CHANGE = 2.0
"""Error of one fit over that of two, from which the record has changed, ..."""
LEAST_CHANGE = 2.5
"""... and their difference, %."""
SPLITS = 19
"""Instants at which a record is split."""
ROWS = 10
"""Rows for one parameter in each part."""


def jumps(model: GeneratedModel, records: Sequence[Record], study: Study) -> Check:
    """Positions that no joint can have passed through."""
    question, limit = "Are the positions those of a motion?", f"steps below {STEP:g} times the usual ones, or below the speed of any robot"
    units = joint_units(model)
    limits = limits_of(model, "qd")
    fastest = 4 * limits if limits is not None and len(limits) == len(units) else speed_bounds(units)[:, 1]
    for record in records:
        steps = np.abs(np.diff(median_filtered(record.q, study.signals.median), axis=0))
        usual = np.array([np.quantile(s[s > 0], 0.9) if s.any() else np.inf for s in steps.T])
        high = steps > np.maximum(STEP * usual, fastest / record.rate)
        if not high.any():
            continue
        k = int(np.flatnonzero(high.any(axis=1))[0])
        joints = np.flatnonzero(high[k])
        text = f"{'Joint' if len(joints) == 1 else 'Joints'} {', '.join(str(model.JOINTS[j]) for j in joints)} "
        text += f"{'jumps' if len(joints) == 1 else 'jump'} by {', '.join(f'{steps[k, j]:.3g} {units[j]}' for j in joints)} at {instant(record.t[k])} s"
        if more := int(np.count_nonzero(np.diff(np.flatnonzero(high.any(axis=1))) > study.signals.median)):
            text += f", and at {more} more {'instant' if more == 1 else 'instants'}"
        if _wrap(steps, high, usual):
            remedy = "it wraps: unwrap it, or record counts and let signals: {reader: counts} do so"
        elif len(joints) == len(units):
            remedy = "samples are missing there, or two records are joined: give each its own file (record.also), or cut (rows.window)"
        else:
            remedy = "an encoder dropped out, froze or was set anew: leave this time out (rows.window), or repair the record"
        return Check(question, "no", text, limit, remedy)
    return Check(question, "good", "No joint jumps between two samples", limit)


def _wrap(steps: Array, high: Array, usual: Array) -> bool:
    """Whether all jumps of every joint have one size, more than once, as those of a count or an angle that starts anew."""
    sizes = [s[h] for s, h in zip(steps.T, high.T, strict=True)]
    again = [len(x) > 1 and np.ptp(x) <= STEP * u for x, u in zip(sizes, usual, strict=True) if len(x)]
    return bool(again) and all(again)


def cut_torques(model: GeneratedModel, records: Sequence[Record], samples: Samples) -> Check | None:
    """Torques that stay at their largest or smallest value, and what leaving these samples out changes; None where there are none."""
    question, limit = (
        "Are the torques recorded in full?",
        f"less than {100 * CUT:g} % of the samples at the largest torque, or no better fit without them",
    )
    at_bounds = np.zeros((len(samples), samples.n), dtype=bool)
    shares = np.zeros(samples.n)
    for number, record in enumerate(records):
        held = np.stack([_held(tau) for tau in (record.tau if record.tau_known is None else record.tau + record.tau_known).T], axis=1)
        own = samples.record == number
        reach = max(1, round(0.5 * record.rate / samples.cutoff))
        near = np.clip(np.searchsorted(record.t, samples.t[own])[:, None] + np.arange(-reach, reach + 1), 0, len(record) - 1)
        at_bounds[own] = held[near].any(axis=1)
        shares = np.maximum(shares, held.mean(axis=0))
    if not at_bounds.any():
        return None
    D, moving = model.regressor(samples.q, samples.qd, samples.qdd), samples.moving()
    Y = samples.tau - samples.known
    with_them, without = (least_squares(Grams.of(D, Y, mask, samples.tau), 1.0).errors for mask in (moving, moving & ~at_bounds))
    enough = (moving & ~at_bounds).sum(axis=0) >= 0.5 * moving.sum(axis=0)  # a drive that knows its two bounds alone is no clipped signal
    j = int(np.argmax(np.where(at_bounds.any(axis=0) & enough, with_them / np.maximum(without, 0.3), 0.0)))
    text = f"The torque of joint {model.JOINTS[j]} is at its largest or smallest value in {100 * shares[j]:.0f} % of the samples"
    text += f"; without them the fit leaves {without[j]:.1f} % of it in place of {with_them[j]:.1f} %"
    state: State = "no" if enough[j] and with_them[j] > CHANGE * without[j] and with_them[j] - without[j] > LEAST_CHANGE else "good"
    return Check(
        question, state, text, limit, "the signal is clipped: raise the range of the logger, or record a motion that asks for less torque"
    )


def _held(tau: Array) -> Array:
    """Whether each sample is at a bound at which the torque stays, (N,)."""
    held = np.zeros(len(tau), dtype=bool)
    span = float(np.ptp(tau))
    for side in (1.0, -1.0):
        x = side * tau
        levels, counts = np.unique(x[x >= x.max() - 0.2 * span], return_counts=True)
        if span > 0 and counts[-1] >= CUT * len(tau) and counts[-1] > CUT_LEVELS * counts[-1 - NEXT : -1].max(initial=1):
            held |= x == levels[-1]
    return held


def change(model: GeneratedModel, samples: Samples) -> Check:
    """The instant at which two fits, before and after it, leave least, beside one fit."""
    question, limit = "Is the robot the same from beginning to end?", f"two fits in time leave more than 1/{CHANGE:g} of what one leaves"
    D, moving, Y = model.regressor(samples.q, samples.qd, samples.qdd), samples.moving(), samples.tau - samples.known
    best, text = 1.0, "One fit serves all of it"
    for number in np.unique(samples.record):
        own = samples.record == number
        t = samples.t[own]
        whole = Grams.of(D, Y, moving & own[:, None], samples.tau)
        together = least_squares(whole, 1.0).errors
        for split in t[np.linspace(0, len(t) - 1, SPLITS + 2).astype(int)[1:-1]]:
            parts = [Grams.of(D, Y, moving & (own & side)[:, None], samples.tau) for side in (samples.t < split, samples.t >= split)]
            if min(int(part.rows.sum()) for part in parts) < ROWS * D.shape[2] or min(int(part.rows.min()) for part in parts) < 2 * ROWS:
                continue
            left = sum(part.squares(least_squares(part, 1.0).X) for part in parts)
            apart = 100 * np.sqrt(left / np.where(whole.measured > 0, whole.measured, 1.0))
            ratio = np.where(together - apart > LEAST_CHANGE, together / np.maximum(apart, 0.3), 0.0)
            j = int(np.argmax(ratio))
            if ratio[j] > best:
                best = float(ratio[j])
                text = f"Before and after {instant(round(float(split), 1))} s, fitted apart, {apart[j]:.1f} % of the torque of joint {model.JOINTS[j]} stay unexplained, "
                text += f"fitted together {together[j]:.1f} %"
    remedy = "a load, a gain or friction changed there, or two records are joined: use one part (rows.window), or name them as records of their own"
    return Check(question, "doubtful" if best > CHANGE else "good", text, limit, remedy)
