"""Patterns of reversed torques, all at once.

W stays the same and torques only change their signs, so that 2^n fits cost little. The fits allow
neither negative friction nor impossible bodies, because a fit of free parameters hides a wrong sign
as negative friction. Over a closed motion, only the sum of mean(tau qd) over all joints is
dissipation; the sign of a single joint does not follow from this sum, so that all patterns are
fitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from runtime.ground.limits import limits
from runtime.mending.reading import Reading
from runtime.plausible.bodies import Grams, physical_fit
from runtime.plausible.causes import SCALE, Cause, unchanged_study

LIMIT = limits(__package__)

Array = np.ndarray


def patterns(n: int) -> Iterator[tuple[int, ...]]:
    """Yield sets of joints whose torques may be reversed: all sets, or sets of one and two joints
    if the robot has many.
    """
    most = n if n <= LIMIT.PATTERNS_OF else 2
    for count in range(1, most + 1):
        yield from combinations(range(n), count)


def reversed_torques(reading: Reading) -> list[Cause]:
    """Return the patterns of reversed torques that explain the rows of the search best."""
    baseline, n = reading.baseline, len(reading.p)
    if baseline is None:
        return []
    grams = baseline.standard(Grams.of(*baseline.as_given, baseline.tau))
    labels = reading.data.case.labels
    sigma = grams.sigma(baseline.given.X)
    scored = []
    for joints in patterns(n):
        G = grams.of_joints.copy()
        for j in joints:
            G[j, -1, :-1] *= -1
            G[j, :-1, -1] *= -1
        fit = physical_fit(replace(grams, of_joints=G), baseline.bodies, baseline.N, sigma, 2)
        scored.append((fit.score, joints))
    return [
        _reversing(reading, joints, labels)
        for score, joints in sorted(scored)[: LIMIT.PATTERNS_TAKEN]
        if baseline.given.score - score > LIMIT.STEP_GAIN
    ]


def _reversing(reading: Reading, joints: tuple[int, ...], labels: tuple[str, ...]) -> Cause:
    n = len(reading.p)
    signs = np.where(np.isin(np.arange(n), joints), -1.0, 1.0)
    names = ", ".join(labels[j] for j in joints)
    several = "s" if len(joints) > 1 else ""
    return unchanged_study(
        n,
        kind="sign",
        says=f"the torque{several} of joint{several} {names} {'have' if several else 'has'} the wrong sign",
        remedy=f"change the sign of the torque{several} of joint{several} {names}",
        change={f"{SCALE}tau": [int(s) for s in signs]},
        **reading.robot.torques(np.diag(signs)),
    )
