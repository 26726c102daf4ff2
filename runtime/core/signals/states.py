"""From a record to its joint states: what a reader is, and the reader of the chapter."""

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
    """A position reader that a study can name.

    Attributes
    ----------
    states : Reader
    options : type or None
        Settings class of signals.options, which it reads there; None: it has none.
    """

    states: Reader
    options: type[Settings] | None = None

    def checked(self, signals: Signals) -> dict[str, Any]:
        """All options with defaults; SettingsError if the settings do not suit."""
        path = ("signals", "options")
        if self.options is not None:
            return to_mapping(structure(self.options, signals.options, path))
        if signals.options:
            raise SettingsError(
                f"given, but reader {signals.reader} has no options; leave them out", path=path
            )
        return {}


def lowpassed(record: Record, signals: Signals) -> States:
    """Reader `lowpass`: median, low-pass and central differences of the positions (`runtime.core.signals.filters`)."""
    require_positions(record.missing, "reader: lowpass", record.name, COUNTS)
    return filtered_states(record.q, record.rate, signals, record.channels.get("qd"))


def require_motion(signals: Signals, who: str) -> None:
    """Raise SettingsError if the records are poses at rest; who : the analysis that needs a motion."""
    if signals.reader == "static":
        raise SettingsError(
            f"static, poses at rest; {who} needs records of a motion", path=("signals", "reader")
        )
