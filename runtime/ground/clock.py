"""The clock of a record: are its time stamps uniform, and what is the sampling rate?

Steps between time stamps are classified by the period T, the median of the positive steps:

    step < 0              time goes back: the clock was set, or a second record follows
    step = 0              a repeated stamp
    0 < step <= gap T     jitter, step/T - 1
    step > gap T          a gap: samples are missing
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from runtime.ground.errors import InputError, instant
from runtime.ground.settings import LARGEST

Array = np.ndarray

GAP = 3.0  # periods; a longer step is a gap
DIGITS = 1e-6  # relative error of stamps as they are written: three periods are no more than that
LISTED = 3  # places named, of those of one kind
JITTER = 0.1  # sampling periods that stamps may be off the uniform grid where nothing is said
SHOWN = 5e-5  # periods; a smaller jitter is not printed
RATE_TOLERANCE = 1e-3
"""Between a stated rate and that of the stamps, beyond what the jitter of the two ends makes."""
ROUNDED = 1e-3  # units; stamps so near to multiples of a decimal unit are rounded to it
SHORTEST = 100  # samples of a piece whose rate is counted
WHOLE = 0.9  # share of the samples that these pieces must have
BRIDGED = 0.02  # s
BRIDGED_PERIODS = 10.0
"""Gaps up to the longer of the two are bridged: by the bound 5 (w h)^4/384 of `resampled` a spline over 10 ms is right to 2e-3 at 10 Hz."""


def sample(i: int) -> str:
    """Return the name of sample i, counted from 0, for messages: "sample 1" for i = 0."""
    return f"sample {i + 1}"


@dataclass(frozen=True)
class Stamps:
    """Data to check the time stamps of a record: file, column, stated rate and allowed jitter.

    Attributes
    ----------
    file : str
        Name of the file or of the record.
    column : str or None
        Name of the column; None: the record is made of arrays.
    row : callable
        Function that names sample i, counted from 0, by its place in the file.
    rate : float or None
        Sampling rate that the user states, Hz.
    jitter : float
        Largest allowed difference from a uniform grid, in sampling periods.
    """

    file: str
    column: str | None = None
    row: Callable[[int], str] = sample
    rate: float | None = None
    jitter: float = JITTER


def require_rate(t: Array, file: str | None = None) -> None:
    """Raise InputError for time stamps, s, whose mean rate no record has: t is then not in seconds."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        rate = (len(t) - 1) / (t[-1] - t[0])
    if not 1 / LARGEST <= abs(rate) <= LARGEST:
        raise InputError(
            f"the time stamps have a mean rate of {rate:g} Hz; expected {1 / LARGEST:g} to {LARGEST:g} "
            "Hz: give t in seconds",
            file=file,
        )


def rate_of(stamps: Stamps, t: Array) -> float:
    """Compute the sampling rate, Hz, from uniform time stamps t, shape (N,), s.

    If the user stated a rate and the stamps agree, the stated rate is returned.

    Raises
    ------
    InputError
        Time goes back or repeats, the rate differs from the stated rate, or the stamps are off the
        uniform grid. The message lists every irregularity and a setting that cures it.
    """
    N = len(t)
    if N < 2:
        raise InputError(f"the record has {N} samples; at least 2 are needed", file=stamps.file)
    step = np.diff(t)
    place: int | None = None
    if (step <= 0).any():
        place = int(np.argmax(step <= 0)) + 1
        message = f"time goes from {instant(t[place - 1])} s to {instant(t[place])} s; expected increasing time"
    else:
        require_rate(t, stamps.file)
        rate = (N - 1) / float(t[-1] - t[0])
        tolerance = RATE_TOLERANCE + 2 * stamps.jitter / (N - 1)
        off_grid = np.abs(t - t[0] - np.arange(N) / rate).max() * rate
        if stamps.rate is not None and abs(rate / stamps.rate - 1) > tolerance:
            message = (
                f"the time stamps have the rate {rate:g} Hz, but record.rate is "
                f"{stamps.rate:g} Hz; correct record.rate, the time or the unit of time"
            )
        elif off_grid > stamps.jitter:
            place = int(np.argmax(np.abs(step * rate - 1))) + 1
            message = f"time is not uniform: up to {off_grid:.3g} sampling periods off the uniform grid; the step is {step[place - 1]:g} s here and {1 / rate:g} s on average"
        else:
            return stamps.rate or rate
    resample: dict[str, Any] | None = None
    if (step > 0).any():
        regularity = time_stamps(t, file=stamps.file)
        message += f". In all: {regularity.to_text(stamps.row)}"
        if not regularity.regular or regularity.jitter > stamps.jitter:
            counted = None if stamps.column is None else counted_rate(t)
            resample = remedy(regularity)
            if counted is None:
                message += f". {remedy_text(t, regularity, arrays=stamps.column is None)}"
            else:
                split = {"gaps": "split"} if regularity.gaps or regularity.resets else {}
                resample = {**split, "method": "count", "rate": counted}
                written = ", ".join(
                    f"{key}: {value:g}" if key == "rate" else f"{key}: {value}"
                    for key, value in resample.items()
                )
                off = regularity.repeats or regularity.jitter > stamps.jitter
                rounded = f", with stamps rounded to {resolution(t):g} s" if off else ""
                message += f". The samples are uniform at {counted:g} Hz{rounded}. Remedy: record.resample: {{{written}}}, which uses the samples as they are"
    raise InputError(
        message,
        file=stamps.file,
        column=stamps.column,
        row=None if place is None else stamps.row(place),
        remedy=None if resample is None or stamps.column is None else {"resample": resample},
    )


def resolution(t: Array) -> float:
    """Return the coarsest decimal unit, 1 s ... 1e-6 s, of which all steps of t are multiples.

    The result is 0 if there is no such unit, because the stamps are not rounded.
    """
    for k in range(7):
        multiples = (t - t[0]) * 10.0**k
        if np.abs(multiples - np.round(multiples)).max() < ROUNDED:
            return float(10.0**-k)
    return 0.0


def counted_rate(t: Array) -> float | None:
    """Find the rate, Hz, of uniform samples whose stamps were rounded, or start anew; else None.

        t_k = t_0 + k / rate + e_k,   |e_k| up to the resolution of the stamps, in each piece
                                      between gaps and steps back

    The rate comes from least squares over all pieces. It is rounded to a whole number of Hz if the
    rounding of the stamps does not distinguish the two numbers. Nine tenths of the samples must be
    in pieces.
    """
    step = np.diff(t)
    u, period = resolution(t), float(np.median(step[step > 0]))
    cuts = [0, *(np.flatnonzero((step < 0) | (step > GAP * period * (1 + DIGITS))) + 1), len(t)]
    pieces = [
        (np.arange(b - a) - (b - a - 1) / 2, t[a:b] - t[a:b].mean())
        for a, b in pairwise(cuts)
        if b - a >= SHORTEST
    ]
    if sum(len(k) for k, _ in pieces) < WHOLE * len(t):
        return None
    square = sum(float(k @ k) for k, _ in pieces)
    T = sum(float(k @ x) for k, x in pieces) / square
    off = max(np.abs(x - T * k).max() for k, x in pieces)
    if T <= 0 or off > max(u * (1 + DIGITS), JITTER * T):
        return None
    rate = 1 / T
    uncertain = rate * max(u, JITTER * T) / max(float(np.ptp(x)) for _, x in pieces)
    near = round(rate)
    return float(near) if abs(near - rate) <= uncertain else float(f"{rate:.6g}")


def remedy(stamps: TimeStamps) -> dict[str, Any]:
    """Propose settings `record.resample` that make irregular time stamps uniform.

    Short gaps are bridged by interpolation; at long gaps the record is split.
    """
    periods = [gap.step / stamps.period for gap in stamps.gaps]
    most = max(BRIDGED / stamps.period, BRIDGED_PERIODS)
    short = [gap for gap in periods if gap <= most]
    settings: dict[str, Any] = {}
    if stamps.resets or len(short) < len(periods):
        settings["gaps"] = "split"
    if short:
        settings["longest"] = int(np.ceil(max(short) + 0.5))
    return settings


def remedy_text(t: Array, stamps: TimeStamps, *, arrays: bool = False) -> str:
    """Write sentences for the user on irregular time stamps: the mean sampling rate and a remedy.

    A second remedy is for samples that are uniform although their stamps jitter. arrays : whether
    the record is made of arrays; the remedy is then a function call, not a setting.
    """
    settings = remedy(stamps)
    step = np.diff(t)
    taken = step[(step > 0) & (step <= max(BRIDGED, BRIDGED_PERIODS * stamps.period))]
    rate = len(taken) / float(taken.sum())
    count = (
        f"{len(taken) + 1} samples in {taken.sum():.6g} s (without pauses) give {rate:.6g} Hz; "
        f"the median step gives {1 / stamps.period:.6g} Hz. Remedy:"
    )
    if arrays and "gaps" in settings:
        return f"{count} one Record for each piece"
    if arrays:
        bridging = f", longest={settings['longest']:g}" if settings else ""
        return f"{count} runtime.resample(t, q{bridging}), and so for tau"
    does = []
    if "gaps" in settings:
        does.append("makes a record of each piece between gaps")
    if "longest" in settings:
        does.append(f"bridges gaps of up to {settings['longest']:g} periods by interpolation")
    written = ", ".join(f"{key}: {value}" for key, value in settings.items())
    uniform = "{gaps: split, method: count}" if "gaps" in settings else "{method: count}"
    return f"{count} record.resample: {{{written}}} {' and '.join(does) or 'interpolates at the stamps'}. If the samples are uniform and only their stamps are not: record.resample: {uniform}, or record.rate: {rate:.6g} without columns.t"


@dataclass(frozen=True)
class Irregular:
    """An irregular step between two time stamps: a gap, a step back or a repeated stamp.

    Attributes
    ----------
    sample : int
        Number, from 0, of the sample at the end of the step.
    before, after : float, s
        Time stamps at the start and at the end of the step.
    """

    sample: int
    before: float
    after: float

    @property
    def step(self) -> float:
        """Length of the step, s."""
        return self.after - self.before


@dataclass(frozen=True)
class TimeStamps:
    """Regularity of the N time stamps of a record: period, jitter and irregular steps.

    Attributes
    ----------
    samples : int
        N.
    period : float, s
        T, the median of the positive steps.
    jitter, jitter_rms : float, periods
        Largest and rms difference of the regular steps from T.
    gaps, resets, repeats : tuple of Irregular
        Steps that are too long, steps back, and repeated stamps, in order of time.
    longest : float, s
        A longer step is a gap.
    """

    samples: int
    period: float
    jitter: float
    jitter_rms: float
    gaps: tuple[Irregular, ...]
    resets: tuple[Irregular, ...]
    repeats: tuple[Irregular, ...]
    longest: float

    @property
    def regular(self) -> bool:
        """Whether the time stamps have no gaps, no steps back and no repetitions."""
        return not (self.gaps or self.resets or self.repeats)

    def to_text(self, row: Callable[[int], str] = lambda i: f"sample {i + 1}") -> str:
        """Describe the regularity of the time stamps in one sentence.

        A jitter below 0.005 % is left out.

        row : function from a sample number to its place in the file.
        """
        parts = [f"{self.samples} samples, median step {self.period:.6g} s"]
        if self.jitter >= SHOWN:
            parts[0] += (
                f", jitter up to {100 * self.jitter:.2g} % ({100 * self.jitter_rms:.2g} % rms)"
            )
        for found, kind in (
            (self.gaps, "gap"),
            (self.resets, "step back"),
            (self.repeats, "repeated stamp"),
        ):
            if found:
                largest = sorted(found, key=lambda s: -abs(s.step))[:LISTED]
                places = ", ".join(
                    f"{row(s.sample)} (t = {s.before:.6g} s"
                    + (f", {s.step:.6g} s" if s.step else "")
                    + (f", {s.step / self.period:.0f} periods)" if s.step > 0 else ")")
                    for s in largest
                )
                parts.append(
                    f"{times(len(found), kind)}{', the largest' if len(found) > LISTED else ''} "
                    f"at {places}"
                )
        return "; ".join(parts)


def times(number: int, kind: str) -> str:
    """Write a count with its noun in singular or plural: "1 gap", "2 steps back"."""
    several = "steps back" if kind == "step back" else f"{kind}s"
    return f"{number} {kind if number == 1 else several}"


def time_stamps(t: Array, *, gap: float = GAP, file: str = "record") -> TimeStamps:
    """Find the period, the jitter and the irregular steps of the time stamps t, shape (N,), s.

    A step of more than `gap` periods is a gap.
    """
    step = np.diff(t)
    forward = step[step > 0]
    if not len(forward):
        raise InputError("the time stamps never increase; correct the time column", file=file)
    period = float(np.median(forward))
    rounding = (gap + 2) * np.spacing(np.abs(t).max())  # of the step and of the median
    longest = gap * period * (1 + DIGITS) + rounding
    regular = forward[forward <= longest]
    off = regular / period - 1

    def those(mask: Array) -> tuple[Irregular, ...]:
        return tuple(
            Irregular(int(i) + 1, float(t[i]), float(t[i + 1])) for i in np.flatnonzero(mask)
        )

    return TimeStamps(
        len(t),
        period,
        float(np.abs(off).max()),
        float(np.sqrt(np.mean(off**2))),
        those(step > longest),
        those(step < 0),
        those(step == 0),
        longest,
    )
