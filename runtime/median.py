"""Whether a running median suits the torques of a record: `signals.torque_median: auto`.

A controller that answers every count of an encoder drives in pulses. Their mean moves the robot,
and a median cuts them off. With d what the median takes from the torque tau of a joint, and
means over blocks of LIMIT.TORQUE_BLOCK,

    d = a tau + b qd + c sign(qd) + rest       taken = ||d - rest|| / ||tau||

Spikes, for which a median is there, and noise go with no motion. Measured: benchmarks/truth.md.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from runtime.core.limits import LIMIT
from runtime.core.problem import SIGNALS, Note, Problem
from runtime.core.rows.selection import excerpt
from runtime.core.signals.filters import median_filtered
from runtime.core.study import Study

Array = np.ndarray


def share_taken(tau: Array, q: Array, rate: float, window: int) -> Array:
    """Share of the torques tau, shape (N, n), that a median over `window` samples takes with the motion q, shape (N, n), shape (n,).

    0 if most of what it takes goes with no motion.
    """
    block = max(1, round(LIMIT.TORQUE_BLOCK * rate))
    count, n = len(tau) // block, tau.shape[1]
    share = np.zeros(n)
    if window == 1 or count < LIMIT.FEWEST_BLOCKS:
        return share
    off = median_filtered(tau, window) - tau
    off = np.where(np.abs(off) > LIMIT.SPIKE * np.sqrt(np.mean(off**2, axis=0)), 0.0, off)
    d, torque, place = (
        x[: count * block].reshape(-1, block, n).mean(axis=1) for x in (off, tau, q)
    )
    qd = np.gradient(place, axis=0)
    columns = np.stack([torque, qd, np.sign(qd)], axis=2)  # (blocks, n, 3)
    for j in np.flatnonzero(np.isfinite(columns).all(axis=(0, 2)) & torque.any(axis=0)):
        with_motion = columns[:, j] @ np.linalg.lstsq(columns[:, j], d[:, j], rcond=None)[0]
        part, whole, size = (np.linalg.norm(x) for x in (with_motion, d[:, j], torque[:, j]))
        share[j] = part / size if 2 * part**2 > whole**2 else 0.0
    return share


def torque_median(problem: Problem) -> Problem:
    """The step: torques without a median where signals.torque_median is auto and it would take torque that goes with the motion."""
    signals = problem.settings.signals
    if signals.torque_median != "auto":
        return problem
    shares = []
    for record in problem.records:
        samples = excerpt(record, problem.settings.rows)
        shares.append(
            share_taken(record.tau[samples], record.q[samples], record.rate, signals.median)
        )
    if np.max(shares, initial=0.0) <= LIMIT.MEDIAN_TAKES:
        return problem.changed(settings=_with_window(problem, signals.median))
    worst = np.max(shares, axis=0)
    text = f"Torques without a median (torque_median: auto): it would take {100 * worst.max():.2g} % of the torque of joint {1 + worst.argmax()} in time with the motion, as from a controller that answers every count of its encoder."
    return problem.changed(Note(SIGNALS, text), settings=_with_window(problem, 1))


def _with_window(problem: Problem, window: int) -> Study:
    """The settings with that window of the median on torques."""
    settings = problem.settings
    return replace(settings, signals=replace(settings.signals, torque_median=window))
