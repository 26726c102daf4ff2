"""Check whether torques have lost their sign: unsigned registers, and magnitudes.

A register that is read as an unsigned number gives torques that jump where they change their sign.
If the register is read as

    sign and magnitude     y = x below 2^k u, else -(x - 2^k u)       u: step of the register
    two's complement       y = x below 2^k u, else x - 2^(k+1) u

the jumps vanish. A magnitude |tau| has no jump but a kink where it touches zero: before and
after, its slope has the same size and the other sign. A torque that is above zero because of gravity
turns smoothly, and does not touch zero.
"""

from __future__ import annotations

import numpy as np

from runtime.core.model import drives_of
from runtime.ground.check import Answer, Question
from runtime.ground.limits import limits
from runtime.plausible.case import Case

LIMIT = limits(__package__)

Array = np.ndarray


@Question(
    "Do the torques have their sign?",
    "no jumps by a power of two of the smallest step, and no kinks at zero",
)
def signed(case: Case) -> Answer | None:
    """Check whether torques are unsigned registers or magnitudes; return None if nothing indicates
    this.
    """
    if any(record.origin.by_law for record in case.records):
        return None
    drives = drives_of(case.model) if case.sides[1] == "motor" else None
    for record in case.records:
        tau = record.tau if drives is None else drives.motor_command(record.tau)
        bits = [register_bit(x) for x in tau.T]
        if found := [(j, bit) for j, bit in enumerate(bits) if bit is not None]:
            _, (k, complement) = found[0]
            joints = ", ".join(case.labels[j] for j, _ in found)
            meaning = (
                f"raw values from {2**k} on are negative, raw - {2 ** (k + 1)} (two's complement)"
                if complement
                else f"raw values from {2**k} on are negative, -(raw - {2**k})"
            )
            return Answer(
                "no",
                f"The torque of joint {joints} jumps by {2**k * (1 + complement)} of its smallest steps "
                f"where it should change its sign: {meaning}",
                f"decode the register of the torque before the record is read: {meaning}",
            )
        reverses = [(np.sign(np.diff(q)) > 0).any() and (np.diff(q) < 0).any() for q in record.q.T]
        kinks = np.array([kinks_at_zero(x, record.rate) for x in tau.T])
        bare = np.array(reverses) & (kinks >= LIMIT.FEWEST_KINKS)
        if bare.any():
            return Answer(
                "no",
                f"The torque of joint {case.joint_labels(bare)} is never below zero and turns back at zero "
                f"{int(kinks[bare].max())} times, although the joint reverses: it is a magnitude",
                "log torques with their sign; a magnitude does not determine the parameters",
            )
    return None


def register_bit(x: Array) -> tuple[int, bool] | None:
    """Find the bit of the sign of an unsigned register in a torque x, shape (N,).

    Return the bit k and whether the register is a two's complement; None if x has no such jumps.
    """
    size = np.abs(x)
    if np.ptp(x) == 0 or x.min() * x.max() < 0:
        return None
    levels = np.unique(np.round(size / size.max(), 12)) * size.max()
    step = float(np.diff(levels).min(initial=np.inf))
    if not np.isfinite(step):
        return None
    raw = size / size.max() * np.round(size.max() / step)
    if np.abs(raw - np.round(raw)).max() > LIMIT.OFF_STEPS:
        return None
    raw = np.round(raw)
    k = int(np.log2(max(raw.max(), 1.0)))  # the sign is the highest bit
    negative = raw >= 2**k
    crossing = np.diff(negative)
    if k < LIMIT.FEWEST_BITS or np.count_nonzero(crossing) < LIMIT.FEWEST_CROSSINGS:
        return None
    for complement in (False, True):
        y = np.where(negative, raw - 2 ** (k + 1) if complement else 2**k - raw, raw)
        if np.abs(np.diff(y))[crossing].max() <= 2**k / LIMIT.JUMP_VANISHES:
            return k, complement
    return None


def kinks_at_zero(x: Array, rate: float) -> int:
    """Count the kinks of a torque x, shape (N,), where it touches zero and turns back.

    The result is 0 if x changes its sign.
    """
    if x.min() * x.max() < 0:
        return 0
    x = np.abs(x)
    reach = max(2, round(LIMIT.KINK_TIME * rate))
    near = x < LIMIT.NEAR_ZERO * np.quantile(x, 0.9)
    ends = np.flatnonzero(np.diff(near, prepend=False, append=False)).reshape(-1, 2)
    slopes = (x[2 * reach :] - x[: -2 * reach]) / 2  # change in one reach
    usual = float(np.sqrt(np.mean(slopes**2)))
    kinks, touches, last = 0, 0, -reach
    for a, b in ends:
        k = a + int(np.argmin(x[a:b]))
        if k - last < 2 * reach or k < 3 * reach or k + 3 * reach >= len(x):
            continue
        last, touches = k, touches + 1
        sides = np.stack([x[k : k + 3 * reach], x[k - 3 * reach : k][::-1]])
        slopes = np.diff(sides.reshape(2, 3, reach).mean(axis=2), axis=1)  # near zero, then farther
        steep = (slopes > LIMIT.KINK * usual).all()
        kinks += bool(steep and slopes[:, 0].sum() > LIMIT.STRAIGHT * slopes[:, 1].sum())
    return kinks if kinks > LIMIT.MOST_TOUCHES * touches else 0
