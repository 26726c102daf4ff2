"""What the time stamps of a record are like: how regular, where samples are missing, where time
goes back or stands.

Steps are told apart by the period T, the median of the steps that go forward:

    step < 0              time goes back: the clock was set, or a second record follows
    step = 0              a repeated stamp
    0 < step <= gap T     jitter, step/T - 1
    step > gap T          a gap: samples are missing
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError

Array = np.ndarray

GAP = 3.0  # periods; a longer step is a gap
DIGITS = 1e-6  # relative error of stamps as they are written: three periods are no more than that
LISTED = 3  # places named, of those of one kind


@dataclass(frozen=True)
class Irregular:
    """A step that is no jitter; sample : number, from 0, of the sample in which it ends.   before,
    after : s.
    """

    sample: int
    before: float
    after: float

    @property
    def step(self) -> float:
        """Length, s."""
        return self.after - self.before


@dataclass(frozen=True)
class TimeStamps:
    """Regularity of N time stamps.

    period : T, s.
    jitter, jitter_rms : largest and rms deviation of the regular steps from T, in periods.
    gaps, resets, repeats : the other steps, in time.   longest : s, a longer step is a gap.
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
        """Whether every step is one period, jitter aside."""
        return not (self.gaps or self.resets or self.repeats)

    def to_text(self, row: Callable[[int], str] = lambda i: f"sample {i + 1}") -> str:
        """One sentence; row : how the file counts sample i, from 0."""
        parts = [
            (
                f"{self.samples} samples, median step {self.period:.6g} s, jitter up to "
                f"{100 * self.jitter:.2g} % ({100 * self.jitter_rms:.2g} % rms)"
            )
        ]
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
    """1 gap, 2 steps back."""
    several = "steps back" if kind == "step back" else f"{kind}s"
    return f"{number} {kind if number == 1 else several}"


def time_stamps(t: Array, *, gap: float = GAP, file: str = "record") -> TimeStamps:
    """What the stamps t, shape (N,), s, are like."""
    step = np.diff(t)
    forward = step[step > 0]
    if not len(forward):
        raise InputError("time never goes forward; expected increasing time", file=file)
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
