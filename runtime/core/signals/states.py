"""Joint states of measured positions: the readers.

lowpass    positions as they are, filtered and differentiated (`runtime.core.signals.filters`)
counts     positions as counts of encoders (`runtime.counts.reading`), whose posterior mean is then filtered alike; errors of the velocities are known
static     poses at rest: q as it is, qd = qdd = 0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from runtime.core.drives import Drives
from runtime.core.errors import SettingsError
from runtime.core.missing import COUNTS, Missing, require_positions
from runtime.core.record import Record
from runtime.core.signals.filters import SpeedErrors, States, filtered_states
from runtime.core.study import Signals
from runtime.counts.lattice import unwrapped_counts
from runtime.counts.reading import read_counts

Array = np.ndarray


Reader: TypeAlias = Callable[[Record, Signals], States]
"""From a record to its joint states q, qd, qdd, shape (N, n) each, by the settings of the signals."""


def lowpassed(record: Record, signals: Signals) -> States:
    """Reader `lowpass`: positions as they are, median, low-pass and central differences (`runtime.core.signals.filters`)."""
    require_positions(record.missing, "reader: lowpass", record.name, COUNTS)
    return filtered_states(record.q, record.rate, signals, record.channels.get("qd"))


def counted(record: Record, signals: Signals) -> States:
    """Reader `counts`: positions as counts of encoders, whose posterior mean goes through the filters of the study.

    Raises
    ------
    InputError
        Positions that are no counts (`runtime.counts.reading.read_counts`).
    """
    drives = encoder_drives(signals.side, record.origin.drives)
    position = encoder_position(record.q, drives, record.missing)
    reading = read_counts(position, record.rate, signals.step, name=record.name)
    q, deviation = reading.motion
    q = q if drives is None else drives.joint_position(q)
    states = filtered_states(q, record.rate, replace(signals, median=1))
    errors = SpeedErrors(deviation, encoder_root(drives, q.shape[1]))
    return replace(states, errors=errors, findings=sentences(reading.findings, record.name))


def require_motion(signals: Signals, who: str) -> None:
    """SettingsError where the records are poses at rest; who : what needs a motion."""
    if signals.reader == "static":
        raise SettingsError(
            f"static, poses at rest; {who} needs records of a motion", path=("signals", "reader")
        )


def unwrapped(record: Record, signals: Signals, drives: Drives | None = None) -> Record:
    """The record as reader counts takes it: counts that start anew after a turn of the counter go
    on; another reader leaves it as it is. drives : as of `observed_states`.
    """
    if signals.reader != "counts":
        return record
    drives = encoder_drives(signals.side, drives)
    position = encoder_position(record.q, drives)
    known, counts, wraps = unwrapped_counts(position, signals.step, name=record.name)
    if not wraps:
        return record
    x = known.position(counts)
    return replace(record, q=x if drives is None else drives.joint_position(x))


def sentences(findings: Iterable[str], name: str) -> tuple[str, ...]:
    """Findings of one record as sentences that name it."""
    return tuple(f"{name}: {text}." for text in findings)


def encoder_drives(side: str, drives: Drives | None, section: str = "signals") -> Drives | None:
    """The drives between the joints and encoders on that side; None where these are at the joints.

    section : of the study, which names the side.
    """
    if side == "joint":
        return None
    if drives is None:
        raise SettingsError(
            "motor, but the robot has no drives; use side: joint or give drives in the robot file",
            path=(section, "side"),
        )
    return drives


def encoder_position(q: Array, drives: Drives | None, missing: Missing | None = None) -> Array:
    """Positions at the encoders, shape (N, n), of joint positions q; nan where they are missing."""
    x = q if drives is None else drives.motor_position(q)
    return x if missing is None else np.where(missing.at_encoders(drives), np.nan, x)


def encoder_root(drives: Drives | None, n: int) -> Array:
    """Joint motion per encoder motion, shape (n, n): the identity on the joint side, R^-1 on the
    motor side.
    """
    if drives is None:
        return np.eye(n)
    return np.asarray(
        drives.joint_position(np.eye(n)).T - drives.joint_position(np.zeros((1, n))).T
    )
