"""Find out whether the running median of the torques (`signals.torque_median`) removes torque of
the motion.

A controller that reacts to each count of an encoder drives the motor in pulses. The mean of these
pulses moves the robot, but a median removes them. Let d be the change of the torque tau of a joint
by the median. With means over blocks of 0.1 s (`TORQUE_BLOCK`),

    d = a tau + b qd + c sign(qd) + rest       taken = ||d - rest|| / ||tau||

Noise and spikes, which a median is meant to remove, do not depend on the motion. Measured values:
benchmarks/truth.md.
"""

from __future__ import annotations

import numpy as np

from runtime.core.problem import SIGNALS, Note, Problem
from runtime.core.provenance import record_names
from runtime.core.rows.selection import excerpt
from runtime.core.signals.filters import median_filtered
from runtime.ground.limits import LIMIT

FEWEST_BLOCKS = 20
"""Such means of a record from which it is asked."""
MEDIAN_TAKES = 0.015
"""Share of a torque in time with the motion from which it is told: loops 0.022 to 0.18, TX40 0.007, noise of 15 % 0.003. Measured: benchmarks/truth.md."""
TORQUE_BLOCK = 0.1
"""Length of the means that tell what a median takes from torques, s. Measured: benchmarks/truth.md."""

Array = np.ndarray


def share_taken(tau: Array, q: Array, rate: float, window: int) -> Array:
    """Compute the share of each joint torque that follows the motion and that the median removes.

    Return the shares, shape (n,). The share of a joint is 0 if most of the removed torque does not
    depend on the motion.

    tau, q : torques and positions, shape (N, n).
    window : samples of the median.
    """
    block = max(1, round(TORQUE_BLOCK * rate))
    count, n = len(tau) // block, tau.shape[1]
    share = np.zeros(n)
    if window == 1 or count < FEWEST_BLOCKS:
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


def pulses_in_torques(problem: Problem) -> Problem:
    """Note if the running median of the torques removes torque that follows the motion.

    This is a step of the preparation of a problem; it changes no setting.
    """
    window = problem.settings.signals.torque_median
    if window == 1:
        return problem
    taken = {}
    for name, record in zip(record_names(problem.records), problem.records, strict=True):
        samples = excerpt(record, problem.settings.rows)
        share = share_taken(record.tau[samples], record.q[samples], record.rate, window)
        if share.max() > MEDIAN_TAKES:
            taken[name] = f"{100 * share.max():.2g} % of the torque of joint {1 + share.argmax()}"
    if not taken:
        return problem
    several = len(problem.records) > 1
    removed = "; ".join(f"{what} of {name}" if several else what for name, what in taken.items())
    text = (
        f"The median filter of the torques (signals.torque_median: {window}) removes {removed} "
        "together with the motion, as if a controller answers every count of its encoder; "
        "set torque_median: 1."
    )
    return problem.changed(Note(SIGNALS, text))
