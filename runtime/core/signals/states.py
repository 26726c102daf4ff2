"""Readers: functions that compute the joint states q, qd, qdd of a record from its positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

from runtime.core.errors import SettingsError
from runtime.core.missing import COUNTS, require_positions
from runtime.core.record import Record
from runtime.core.settings import Settings, structure, to_mapping
from runtime.core.signals.filters import States, filtered_states
from runtime.core.study import Signals

Reader: TypeAlias = Callable[[Record, Signals], States]
"""From a record to its joint states q, qd, qdd, shape (N, n) each, by the settings of the signals."""


@dataclass(frozen=True)
class SignalReader:
    """A reader that the setting signals.reader can name: it computes the joint states of a record.

    Attributes
    ----------
    states : Reader
        Function that computes the states.
    options : type or None
        Settings class of signals.options; None: the reader has no options.
    """

    states: Reader
    options: type[Settings] | None = None

    def checked(self, signals: Signals) -> dict[str, Any]:
        """Check the options of the reader, and return all options with defaults.

        SettingsError if they do not suit.
        """
        path = ("signals", "options")
        if self.options is not None:
            return to_mapping(structure(self.options, signals.options, path))
        if signals.options:
            raise SettingsError(
                f"the reader {signals.reader} has no options; remove this key", path=path
            )
        return {}


def lowpassed(record: Record, signals: Signals) -> States:
    """Compute the joint states of a record by median, low-pass and central differences.

    This is the reader `lowpass` (`runtime.core.signals.filters`).
    """
    require_positions(record.missing, "reader: lowpass", record.name, COUNTS)
    return filtered_states(record.q, record.rate, signals, record.channels.get("qd"))


def require_motion(signals: Signals, who: str) -> None:
    """Raise SettingsError if the records are static poses, for an analysis that needs a motion.

    who : name of the analysis in the message.
    """
    if signals.reader == "static":
        raise SettingsError(
            f"reader: static is for poses at rest, but {who} needs records of a motion; "
            "set another reader",
            path=("signals", "reader"),
        )
