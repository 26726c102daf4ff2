"""Combine recorded velocities with differentiated positions to get velocities with the least noise.

    qd = v + L (dq/dt - v)          L = 1/(1 + (f/f_c)^2), zero phase
    2 pi f_c = sigma_v/sigma_q      standard deviations of the white noise of v and of q

v is the recorded velocity. The noise of a differentiated position grows with the frequency, the
noise of v does not: below f_c differences of q have less noise, above f_c v has less noise. The
weight L gives the least variance at every frequency. L is a Butterworth filter of first order,
applied forward and backward.

The velocity of a drive may be filtered, delayed, or in another unit. On the motion itself,

    v = gain (dq/dt - lag d2q/dt2) + rest,

and v of a joint is not used if the errors of gain and lag exceed a share of the velocity
(SPEED_DISAGREES in limits.toml).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from runtime.core.problem import SIGNALS, Note, Problem
from runtime.core.rows.selection import excerpt
from runtime.core.signals.cutoff import cutoff
from runtime.core.signals.velocities import agreement
from runtime.core.study import Signals

Array = np.ndarray


def crossings(
    records: Sequence[tuple[Array, Mapping[str, Array], float]], signals: Signals
) -> tuple[tuple[float, ...], str]:
    """Find the frequencies, Hz, above which recorded velocities replace differentiated positions.

    Return the frequencies (signals.velocity of a study) and a sentence on them. For a joint whose
    recorded velocity is not used, the frequency is half the sampling rate of the slowest record.

    records : positions, channels with qd, and sampling rate of each record; fitted together.
    """
    parts = [agreement(q, channels["qd"], rate, signals) for q, channels, rate in records]
    agrees = np.all([part.agrees for part in parts], axis=0)
    longest = max(range(len(parts)), key=lambda k: len(records[k][0]))
    most = min(rate for *_, rate in records) / 2
    low = most / len(records[longest][0])
    found = np.where(agrees, np.clip(parts[longest].crossing, low, most), most)
    hertz = tuple(float(f"{x:.3g}") for x in found)
    used = ", ".join(f"{x:g}" for x, yes in zip(hertz, agrees, strict=True) if yes)
    text = f"Recorded velocities take over above {used} Hz" if used else ""
    off = ", ".join(str(j) for j, yes in enumerate(agrees, 1) if not yes)
    left = f"recorded velocities of joint {off} disagree with the positions and are not used"
    return hertz, "; ".join(part for part in (text, left if off else "") if part) + "."


def recorded_speeds(problem: Problem) -> Problem:
    """Set the frequencies, Hz, above which recorded velocities replace differentiated positions.

    This is a step of the preparation of a problem. The step acts if signals.velocity is auto, the
    reader uses recorded velocities, and all fitted records have them.
    """
    signals = problem.settings.signals
    if signals.velocity != "auto" or not problem.reader.velocities or not problem.records:
        return problem
    if not all("qd" in record.channels for record in problem.records):
        return problem
    parts = []
    for record in problem.records:
        samples = excerpt(record, problem.settings.rows)
        parts.append((record.q[samples], {"qd": record.channels["qd"][samples]}, record.rate))
    low, known = signals.lowpass, signals
    if low is not None and low.cutoff == "auto":
        hertz, _ = cutoff(
            [(q, rate) for q, _, rate in parts], signals, counts=problem.reader.encoder is not None
        )
        known = replace(signals, lowpass=replace(low, cutoff=hertz))
    crossing, text = crossings(parts, known)
    settings = replace(problem.settings, signals=replace(signals, velocity=crossing))
    return problem.changed(Note(SIGNALS, text), settings=settings)
