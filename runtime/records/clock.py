"""The clock of a record: increasing, uniform within the jitter allowed, and at the rate that the settings state. Time is read by blocks, twice."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.records.formats.table import Table
from runtime.records.joint_side import finite_columns
from runtime.settings.record import RecordSettings
from runtime.settings.units import time_unit

Array = np.ndarray

RATE_TOLERANCE = 1e-3  # between the rate of the settings and that of the time column


@dataclass(frozen=True)
class Clock:
    """Number of samples and sampling rate, Hz."""

    samples: int
    rate: float


def clock(settings: RecordSettings, tables: Callable[[], Iterable[Table]], name: str) -> Clock:
    """The clock of the time column called `name`; tables : the blocks of the file, as often as asked."""
    first = last = np.nan
    N, file = 0, ""
    for table, t, step in _times(settings, tables(), name):
        if (step <= 0).any():
            i = int(np.argmax(step <= 0))
            after = t[i + len(t) - len(step)]
            raise InputError(
                f"time goes from {after - step[i]:g} s to {after:g} s; expected increasing time",
                file=table.file,
                column=name,
                row=table.row(i + len(t) - len(step)),
            )
        first, last, N = (float(t[0]) if N == 0 else first), float(t[-1]), N + len(t)
        file = table.file
    if N < 2:
        raise InputError(f"{N} samples; a record needs more", file=file)
    rate = (N - 1) / (last - first)
    if settings.rate is not None and abs(rate / settings.rate - 1) > RATE_TOLERANCE:
        raise InputError(
            f"time runs at {rate:g} Hz, record.rate is {settings.rate:g} Hz; correct one, or the unit of time", file=file, column=name
        )
    _require_uniform(settings, tables(), name, first, rate)
    return Clock(N, settings.rate or rate)


def _require_uniform(settings: RecordSettings, tables: Iterable[Table], name: str, first: float, rate: float) -> None:
    """Raise InputError where time leaves the uniform grid by more than the jitter, at the step that differs most."""
    deviation = worst = 0.0
    place: tuple[str, str, float] | None = None
    N = 0
    for table, t, step in _times(settings, tables, name):
        deviation = max(deviation, float(np.max(np.abs(t - first - np.arange(N, N + len(t)) / rate) * rate)))
        off = np.abs(step * rate - 1)
        if len(off) and off.max() > worst:
            i = int(np.argmax(off))
            worst, place = float(off[i]), (table.file, table.row(i + len(t) - len(step)), float(step[i]))
        N += len(t)
    if deviation > settings.jitter and place is not None:
        file, row, step_here = place
        raise InputError(
            f"time is not uniform: off the grid by up to {deviation:.3g} sampling periods, step {step_here:g} s here, {1 / rate:g} s on average; "
            "where the clock alone is at fault, state record.rate without columns.t, or raise record.jitter (below 0.5)",
            file=file,
            column=name,
            row=row,
        )


def _times(settings: RecordSettings, tables: Iterable[Table], name: str) -> Iterator[tuple[Table, Array, Array]]:
    """Table, time in s, and the steps that end in it, by block."""
    before: list[float] = []
    for table in tables:
        t = finite_columns(table, [name])[:, 0] * time_unit(settings.units.t)
        yield table, t, np.diff(np.concatenate([before, t]))
        before = [float(t[-1])]
