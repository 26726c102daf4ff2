"""A reader: how the recorded positions of a record become the joint states q, qd, qdd.

    states = reader.states(record, signals)
    again  = reader.at_step(step, side).states(rounded_record, signals)

The attributes of a reader state everything that other modules need to know, so that no module
compares names of readers. The names are in the list READERS of `runtime/compose.py`; signals.reader
is one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, TypeAlias, TypeVar

import numpy as np

from runtime.core.drives import Drives
from runtime.core.missing import COUNTS, require_positions
from runtime.core.record import Record
from runtime.core.signals.filters import States, filtered_states
from runtime.core.study import Signals, Study
from runtime.ground.errors import SettingsError
from runtime.ground.settings import Settings, structure, to_mapping

Array = np.ndarray

Steps: TypeAlias = float | tuple[float, ...] | None
"""Steps of the encoders, rad or m: one for all joints, or one for each; None: from the record."""
S = TypeVar("S", bound=Study)

UNFILTERED = {"median": 1, "torque_median": 1, "lowpass": None, "decimate": None}
"""Settings of the signals of poses at rest, which no filter may mix."""


@dataclass(frozen=True)
class Reader:
    """Computes the joint states q, qd, qdd of a record, and says how it does so.

    Attributes
    ----------
    states : function of Record and Signals to States
        Joint states, shape (N, n) each.
    options : type or None
        Settings class of signals.options; None: the reader has no options.
    settings : type
        Class of the section `signals` for this reader: the class of the chapter, or a subclass with
        settings of its own.
    linear : bool
        Whether each position is used as it is, and the states are linear in the positions of the
        same joint: a joint that stands is read as standing, and rounded positions are read like
        measured ones.
    velocities : bool
        Whether recorded velocities are used.
    at_rest : bool
        Whether each sample is a pose at rest: nothing is filtered or left out at the ends.
    missing : bool
        Whether records may lack positions at some samples.
    rounded : function of Record, Signals, step and side to States, or None
        States of a record whose positions were rounded to steps of `step`, rad or m, of encoders on
        `side`, motor or joint, of the gears; step 0: the positions are exact. None: a linear reader
        reads rounded positions like any others; for a nonlinear reader, coarser encoders cannot be
        studied.
    encoder : function of Signals to (step, side), or None
        Step (None: from the record) and side of the encoders by the settings, of a reader that
        reads positions as counts: a count bounds the motion. None: positions are values.
    unwrapped : function of Record, Signals and drives to Record, or None
        Record without the jumps of encoder counters that overflow.
    motion : function of positions, rate, step and earlier result, or None
        Motion of m encoders of known step, from their positions x, shape (N, m): returns x and the
        standard deviation of its velocity, shape (N, m), and a result that saves time if it is
        given with the same motion and other phases of the steps. None: the positions are the
        motion.
    """

    states: Callable[[Record, Any], States]
    options: type[Settings] | None = None
    settings: type[Signals] = Signals
    linear: bool = False
    velocities: bool = False
    at_rest: bool = False
    missing: bool = False
    rounded: Callable[[Record, Any, Any, str], States] | None = None
    encoder: Callable[[Any], tuple[Steps, str]] | None = None
    unwrapped: Callable[[Record, Any, Drives | None], Record] | None = None
    motion: Callable[[Array, float, float, Any], tuple[Array, Array, Any]] | None = None

    @property
    def own_settings(self) -> dict[str, Any]:
        """Keys of the section `signals` of this reader that the chapter does not have, with their
        defaults.
        """
        known = {f.name for f in fields(Signals)}
        return {f.name: f.default for f in fields(self.settings) if f.name not in known}

    @property
    def filters_positions(self) -> bool:
        """Whether the filters alone decide how errors of positions change the states."""
        return self.linear and not self.at_rest

    @property
    def reads_encoders(self) -> bool:
        """Whether the motion of single encoders of known step can be read from their positions."""
        return self.filters_positions or self.motion is not None

    @property
    def reads_rounded(self) -> bool:
        """Whether positions that were rounded to given steps can be read."""
        return self.linear or self.rounded is not None

    def at_step(self, step: Steps, side: str) -> Reader:
        """Return this reader for records whose positions have known steps.

        step : of encoders on `side` of the gears, rad or m; 0: the positions are exact.
        """
        if self.rounded is None:
            return self
        return replace(self, states=partial(_rounded_states, self.rounded, step, side))

    def settled(self, study: S) -> S:
        """Complete the settings of a study: all options of the reader, with their defaults.

        Poses at rest have no filter, no decimation and no trim, whatever their settings are.

        Raises
        ------
        SettingsError
            An option does not suit the reader.
        """
        signals, rows = study.signals, study.rows
        changed: dict[str, Any] = {
            "options": self._checked(signals),
            **(UNFILTERED if self.at_rest else {}),
        }
        if any(getattr(signals, key) != value for key, value in changed.items()):
            signals = replace(signals, **changed)
        if self.at_rest and rows.trim != 0:
            rows = replace(rows, trim=0)
        if signals is study.signals and rows is study.rows:
            return study
        return replace(study, signals=signals, rows=rows)

    def _checked(self, signals: Signals) -> dict[str, Any]:
        """Check the options of the reader, and return all options with defaults."""
        path = ("signals", "options")
        if self.options is not None:
            return to_mapping(structure(self.options, signals.options, path))
        if signals.options:
            raise SettingsError(
                f"the reader {signals.reader} has no options; remove this key", path=path
            )
        return {}


def _rounded_states(
    rounded: Callable[[Record, Signals, Any, str], States],
    step: Steps,
    side: str,
    record: Record,
    signals: Signals,
) -> States:
    """Order the arguments of `Reader.rounded` for functools.partial, which pickle needs."""
    return rounded(record, signals, step, side)


def lowpassed(record: Record, signals: Signals) -> States:
    """Compute the joint states of a record by median, low-pass and central differences."""
    require_positions(record.missing, f"reader: {signals.reader}", record.name, COUNTS)
    return filtered_states(record.q, record.rate, signals, record.channels.get("qd"))


LOWPASS = Reader(lowpassed, linear=True, velocities=True)
"""Positions are used as they are."""
