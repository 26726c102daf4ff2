"""Check of the sampling rate against the motion: do differences of the positions show its accelerations?

    qdd_f (1 - (sin w / w)^2),    w = 2 pi f / rate

is what two central differences lose of the acceleration qdd_f of frequency f. The share of a joint
is the root of the power lost, over the root of the power of its acceleration below the cut-off of
the low-pass. Logs recorded for machine learning (10 to 50 Hz) lose much of fast motions; the fit
then uses accelerations that are too small, and no other record shows this error.
"""

from __future__ import annotations

import numpy as np

from runtime.core.record import Record
from runtime.core.signals.cutoff import cutoff, lowpass_gain, spectra, stands
from runtime.core.study import Lowpass, Signals
from runtime.ground.check import Answer, Question
from runtime.ground.limits import limits
from runtime.plausible.case import Case
from runtime.plausible.rests import rounded_up

LIMIT = limits(__package__)

Array = np.ndarray


@Question(
    "Is the motion slow enough for the sampling rate?",
    f"differences of the positions lose at most {100 * LIMIT.LOST_ACCELERATION:g} % of the accelerations",
)
def sampled(case: Case) -> Answer | None:
    """Check how much of the accelerations the sampling rate loses; return None if the loss is
    small.
    """
    record = min(case.records, key=lambda one: one.rate)
    lost = lost_accelerations(record, case.study.signals)
    worst = int(np.argmax(lost))
    share = float(lost[worst])
    if share <= LIMIT.LOST_ACCELERATION:
        return None
    wanted = record.rate * np.sqrt(share / LIMIT.LITTLE_LOST)  # the loss grows with w^2
    return Answer(
        "doubtful",
        f"{record.rate:.3g} Hz are slow for this motion: differences of the positions lose "
        f"{100 * share:.2g} % of the acceleration of joint {case.labels[worst]}",
        f"record at {rounded_up(wanted):g} Hz or more, or move more slowly",
        explains=share,
    )


def lost_accelerations(record: Record, signals: Signals) -> Array:
    """Compute the share of the acceleration that central differences lose, of each joint, shape (n,)."""
    q, rate = record.q, record.rate
    if len(q) <= LIMIT.FEWEST_LINES:
        return np.zeros(record.n)
    low = signals.lowpass or Lowpass()
    if low.cutoff == "auto":
        low = Lowpass(cutoff=cutoff([(q, rate)], signals)[0], order=low.order, on=low.on)
    f, motion, _ = spectra(q, rate, signals.median)
    w = 2 * np.pi * f / rate
    exact = (w / 2 / np.sin(w / 2)) ** 4 / np.cos(
        w / 2
    ) ** 4  # power of the acceleration, of motion
    power = (lowpass_gain(f, rate, low) ** 2 * exact)[:, None] * motion
    lost = (1 - (np.sin(w) / w) ** 2)[:, None] ** 2 * power
    total = power.sum(axis=0)
    share = np.sqrt(lost.sum(axis=0) / np.where(total > 0, total, 1.0))
    return np.where(stands(q, rate, signals.median), 0.0, share)
