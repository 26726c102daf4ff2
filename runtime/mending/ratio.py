"""The gear ratio of a joint: its positions and torques are wrong by inverse factors.

    q_j' = q_j/x,   tau_j' = x tau_j

The power tau qd stays, so that no fit of positions or torques alone explains the record.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from runtime.ground.limits import limits
from runtime.mending.reading import Reading
from runtime.plausible.causes import Item, Maps, Robot, Row, factor_words, joints
from runtime.plausible.trials import Trial, search_number

TRIED = limits("runtime.plausible")


def _maps(robot: Robot, item: Item, xi: float) -> Maps:
    """Make the correction of a ratio by the factor exp(xi)."""
    q, tau = (np.diag(robot.one(item["j"], np.exp(x))) for x in (-xi, xi))
    return {**robot.positions(q), **robot.torques(tau)}


RATIO = Row(
    "ratio",
    joints,
    "the gear ratio of joint {joint} must be multiplied by {factor}",
    "check the ratio of joint {joint}",
    _maps,
    "the gear ratio of joint {joint}",
    1.2,
    factor_words,
)


def other_ratios(reading: Reading) -> list[Trial]:
    """Return the trials of another gear ratio of one joint, at the best ratio each."""
    baseline = reading.baseline
    if baseline is None:
        return []
    trials = []
    for item in joints(reading.robot):
        change = partial(RATIO.cause, reading.robot, item)
        step = baseline.first_step(baseline.effect(change)[None])
        if step is None:
            continue
        xi, variance = float(step[0][0]), float(step[1][0, 0])
        if 0.5 * xi**2 / variance < TRIED.WORTH_SEARCHING * TRIED.DECISIVE:
            continue
        trial = search_number(baseline, RATIO, change, xi)
        if trial is not None:
            trials.append(trial)
    return trials
