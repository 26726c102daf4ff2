"""Joint states of measured positions, by the reader that the study names.

lowpass    positions as they are, filtered and differentiated (`runtime.observation.filters`)
counts     positions as counts of encoders (`runtime.observation.counts`), whose posterior mean is then filtered alike; errors of the
           velocities are known: rows with dry friction of uncertain direction are left out (`certain_rows`)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from runtime.errors import SettingsError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of
from runtime.observation.counts import Reading, read_counts
from runtime.observation.encoder_lattice import unwrapped_counts
from runtime.observation.filters import SpeedErrors, States, filtered_states
from runtime.observation.sign_errors import switches
from runtime.records.missing import COUNTS, Missing, require_positions
from runtime.records.record import Record
from runtime.settings.study import Signals

Array = np.ndarray

UNCERTAIN = 0.5
"""Deviations of a speed below which its sign is not used: wrong in 31 % of the cases or more. Chosen on simulated records (docs/theory/counts.md)."""


def observed_states(
    model: GeneratedModel,
    q: Array,
    rate: float,
    signals: Signals,
    *,
    drives: Drives | None = None,
    missing: Missing | None = None,
    name: str = "record",
) -> States:
    """q, qd, qdd of measured joint positions by the reader of the study.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module, for its drives.
    q : ndarray, shape (N, n), rad or m
        Joint side.
    rate : float, Hz
        Sampling rate.
    signals : Signals
        Reader and filters.
    drives : Drives, optional
        Motor side; default: that of the model.
    missing : Missing, optional
        Samples of q that hold no position.
    name : str
        What errors call the record.

    Raises
    ------
    InputError
        Positions are missing that the reader needs, or are no counts (`runtime.observation.counts.read_counts`).
    """
    if signals.reader == "lowpass":
        require_positions(missing, "reader: lowpass", name, COUNTS)
        return filtered_states(q, rate, signals)
    drives = encoder_drives(model, signals, drives)
    position = encoder_position(q, drives, None if missing is None else missing.at_encoders(drives))
    reading = read_counts(position, rate, signals.step, lines=signals.lines, name=name)
    return replace(joint_states(reading, rate, signals, drives), findings=sentences(reading.findings, name))


def unwrapped(model: GeneratedModel, record: Record, signals: Signals) -> Record:
    """The record as reader counts takes it: counts that start anew after a turn of the counter go on; another reader leaves it as it is."""
    if signals.reader != "counts":
        return record
    drives = encoder_drives(model, signals)
    position = encoder_position(record.q, drives)
    known, counts, unwrapping = unwrapped_counts(position, signals.step, name=record.name)
    if not unwrapping.wraps:
        return record
    x = known.position(counts)
    return replace(record, q=x if drives is None else drives.joint_position(x))


def sentences(findings: Iterable[str], name: str) -> tuple[str, ...]:
    """Findings of one record as sentences that name it."""
    return tuple(f"{name}: {text}." for text in findings)


def joint_states(reading: Reading, rate: float, signals: Signals, drives: Drives | None) -> States:
    """States of a reading, joint side, through the filters of the study; drives : None for encoders on the joint side."""
    q = reading.q if drives is None else drives.joint_position(reading.q)
    states = filtered_states(q, rate, replace(signals, median=1))
    return replace(states, errors=SpeedErrors(np.where(reading.unknown, np.inf, reading.s_qd), encoder_root(drives, q.shape[1])))


def certain_rows(
    model: GeneratedModel, states: States, constants: Mapping[str, float] | None = None, *, deviations: float = UNCERTAIN
) -> Array:
    """Rows of every joint in which the state and each direction of dry friction are known, bool, shape (n, K), of states (K, n) with known errors.

    A row of joint j is uncertain where |s| is below `deviations` of s, s = G qd the speed of a column that switches and acts on j.
    """
    certain = np.ones(states.q.T.shape, dtype=bool)
    if states.errors is not None:
        certain &= states.errors.known
        for switch in switches(model, model.BASE_PARAMETERS, constants, passive="left out"):
            certain[list(switch.joints)] &= np.abs(states.qd @ switch.G) >= deviations * states.errors.along(switch.G)
    return certain


def encoder_drives(model: GeneratedModel, signals: Signals, drives: Drives | None = None) -> Drives | None:
    """The drives between the joints and the encoders of reader counts; None where encoders are on the joint side."""
    if signals.side == "joint":
        return None
    drives = drives or drives_of(model)
    if drives is None:
        raise SettingsError(
            f"motor, but {model.NAME} has no drives; use side: joint or give drives in the robot file", path=("signals", "side")
        )
    return drives


def encoder_position(q: Array, drives: Drives | None, missing: Array | None = None) -> Array:
    """Positions at the encoders, shape (N, n), of joint positions q; nan where they are missing, bool of that shape or (N, 0)."""
    x = q if drives is None else drives.motor_position(q)
    return x if missing is None or not missing.any() else np.where(missing, np.nan, x)


def encoder_root(drives: Drives | None, n: int) -> Array:
    """Joint motion per encoder motion, shape (n, n): the identity on the joint side, R^-1 on the motor side."""
    if drives is None:
        return np.eye(n)
    return np.asarray(drives.joint_position(np.eye(n)).T - drives.joint_position(np.zeros((1, n))).T)
