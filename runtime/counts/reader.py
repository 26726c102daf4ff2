"""Reader `counts`: joint motion estimated from encoder counts (`runtime.counts.reading`).

The posterior mean of the positions goes through the filters of the study; errors of the velocities
are known.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from runtime.core.drives import Drives, encoder_drives, encoder_root
from runtime.core.missing import Missing
from runtime.core.record import Record
from runtime.core.signals.filters import SpeedErrors, States, filtered_states
from runtime.core.signals.reader import Reader, Steps
from runtime.counts.lattice import unwrapped_counts
from runtime.counts.reading import read_counts
from runtime.counts.settings import Signals

Array = np.ndarray


def counted(record: Record, signals: Signals) -> States:
    """Estimate joint positions, velocities and accelerations from encoder counts.

    The posterior mean of the positions is filtered as the study specifies. The standard deviations
    of the velocities are kept as errors of the states.

    Raises
    ------
    InputError
        If the positions are not encoder counts (`runtime.counts.reading.read_counts`).
    """
    drives = encoder_drives(signals.side, record.origin.drives)
    position = encoder_position(record.q, drives, record.missing)
    reading = read_counts(position, record.rate, signals.step, name=record.name)
    q, deviation = reading.motion
    q = q if drives is None else drives.joint_position(q)
    states = filtered_states(q, record.rate, replace(signals, median=1))
    errors = SpeedErrors(deviation, encoder_root(drives, q.shape[1]))
    findings = tuple(f"{record.name}: {text}." for text in reading.findings)
    return replace(states, errors=errors, findings=findings)


def rounded(record: Record, signals: Signals, step: Steps, side: Any) -> States:
    """Compute the joint states of a record whose encoders have known steps on `side` of the gears.

    The phase of the counts is not known. step : step of the encoders, rad or m; for 0, the
    positions are exact and only the filters of the study are used.
    """
    if not step:
        return filtered_states(record.q, record.rate, signals)
    return counted(record, replace(signals, step=step, side=side))


def motion(x: Array, rate: float, step: float, starts: Any = None) -> tuple[Array, Array, Any]:
    """Estimate the motion of m encoders of one step from their positions x, shape (N, m).

    Return positions, standard deviations of the velocities, and `starts`, the initial values for
    the same motion at other phases.
    """
    reading = read_counts(x, rate, step, starts=starts)
    return *reading.motion, reading.starts


def encoder(signals: Signals) -> tuple[Steps, str]:
    """Return step and side of the encoders by the settings; step None: from the record."""
    return signals.step, signals.side


def unwrapped(record: Record, signals: Signals, drives: Drives | None = None) -> Record:
    """Return the record without the jumps of position that overflowing encoder counters cause.

    `drives` are the drives of the robot, for encoders on the motor side.
    """
    drives = encoder_drives(signals.side, drives)
    position = encoder_position(record.q, drives)
    known, counts, wraps = unwrapped_counts(position, signals.step, name=record.name)
    if not wraps:
        return record
    x = known.position(counts)
    return replace(record, q=x if drives is None else drives.joint_position(x))


def encoder_position(q: Array, drives: Drives | None, missing: Missing | None = None) -> Array:
    """Convert joint positions q to encoder positions, shape (N, n); nan at missing samples."""
    x = q.copy() if drives is None else drives.motor_position(q)
    return x if missing is None else np.where(missing.at_encoders(drives), np.nan, x)


COUNTS = Reader(
    counted,
    settings=Signals,
    missing=True,
    rounded=rounded,
    encoder=encoder,
    unwrapped=unwrapped,
    motion=motion,
)
"""Positions are counts of encoders, which bound the motion."""
