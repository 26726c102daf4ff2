"""From a record to its joint states: what a reader is, and the reader of the chapter."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from runtime.core.errors import SettingsError
from runtime.core.missing import COUNTS, require_positions
from runtime.core.record import Record
from runtime.core.signals.filters import States, filtered_states
from runtime.core.study import Signals

Reader: TypeAlias = Callable[[Record, Signals], States]
"""From a record to its joint states q, qd, qdd, shape (N, n) each, by the settings of the signals."""


def lowpassed(record: Record, signals: Signals) -> States:
    """Reader `lowpass`: positions as they are, median, low-pass and central differences (`runtime.core.signals.filters`)."""
    require_positions(record.missing, "reader: lowpass", record.name, COUNTS)
    return filtered_states(record.q, record.rate, signals, record.channels.get("qd"))


def require_motion(signals: Signals, who: str) -> None:
    """SettingsError where the records are poses at rest; who : what needs a motion."""
    if signals.reader == "static":
        raise SettingsError(
            f"static, poses at rest; {who} needs records of a motion", path=("signals", "reader")
        )
