"""The clock of a record: stamps that increase, uniform within the jitter allowed, at the rate that
is stated.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError, instant
from runtime.records.remedies import remedies
from runtime.records.time_stamps import time_stamps
from runtime.settings.yaml import yaml_values

Array = np.ndarray

JITTER = 0.1  # sampling periods that stamps may be off the uniform grid where nothing is said
HINT = (
    "; where the clock alone is at fault, state record.rate without columns.t, or raise "
    "record.jitter (below 0.5)"
)
# between a stated rate and that of the stamps, beyond what the jitter of the two ends makes
RATE_TOLERANCE = 1e-3


def sample(i: int) -> str:
    """The place of sample i, from 0, of arrays."""
    return f"sample {i + 1}"


@dataclass(frozen=True)
class Stamps:
    """Time stamps of one record and how messages name them.

    Attributes
    ----------
    file : str
        Name of the file or of the record.
    column : str or None
        Name of the column.
    row : callable
        Place of sample i, from 0, in words.
    rate : float or None
        Stated rate, Hz.
    jitter : float
        Largest deviation from a uniform grid, sampling periods.
    """

    file: str
    column: str | None = None
    row: Callable[[int], str] = sample
    rate: float | None = None
    jitter: float = JITTER

    def error(self, message: str, i: int | None = None) -> InputError:
        """The error of sample i, or of all."""
        return InputError(
            message, file=self.file, column=self.column, row=None if i is None else self.row(i)
        )


def clock(stamps: Stamps, t: Array) -> float:
    """Sampling rate, Hz, of the stamps t, shape (N,), s: the stated one where there is one.

    Raises
    ------
    InputError
        Time that goes back or stands, another rate than the stated one, or stamps off the uniform
        grid.
    """
    N = len(t)
    step = np.diff(t)
    if (step <= 0).any():
        i = int(np.argmax(step <= 0))
        raise stamps.error(
            f"time goes from {instant(t[i])} s to {instant(t[i + 1])} s; expected increasing time",
            i + 1,
        )
    if N < 2:
        raise InputError(f"{N} samples; a record needs more", file=stamps.file)
    rate = float((N - 1) / (t[-1] - t[0]))
    if stamps.rate is not None and abs(
        rate / stamps.rate - 1
    ) > RATE_TOLERANCE + 2 * stamps.jitter / (N - 1):
        raise stamps.error(
            f"time runs at {rate:g} Hz, record.rate is {stamps.rate:g} Hz; correct one, or the "
            "unit of time"
        )
    deviation = np.abs(t - t[0] - np.arange(N) / rate).max() * rate
    if deviation > stamps.jitter:
        i = int(np.argmax(np.abs(step * rate - 1)))
        raise stamps.error(
            f"time is not uniform: off the grid by up to {deviation:.3g} sampling periods, step "
            f"{step[i]:g} s here, {1 / rate:g} s on average{HINT}",
            i + 1,
        )
    return stamps.rate or rate


def rate_of(stamps: Stamps, t: Array) -> float:
    """Sampling rate, Hz, of the stamps t, shape (N,), s, as `clock`; the error lists every
    irregularity and the setting that cures them.
    """
    try:
        return clock(stamps, t)
    except InputError as e:
        if not (np.diff(t) > 0).any():
            raise
        regularity = time_stamps(t, file=stamps.file)
        cure = (
            ""
            if regularity.regular and regularity.jitter <= stamps.jitter
            else f". {remedies(t, regularity, arrays=stamps.column is None)}"
        )
        setting = re.search(r"record\.resample: (\{[^}]*\})", cure)
        raise InputError(
            f"{e.message.removesuffix(HINT)}. In all: {regularity.to_text(stamps.row)}{cure}",
            file=e.file,
            column=e.column,
            row=e.row,
            remedy={"resample": yaml_values(setting[1], file="remedy")[0]} if setting else None,
        ) from None
