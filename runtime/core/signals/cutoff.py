"""Automatic choice of the low-pass cut-off frequency (`signals.lowpass.cutoff: auto`).

For every joint, let S be the spectrum of the acceleration, N the spectrum that the noise of the
positions has in the acceleration, and G the gain of the low-pass on the acceleration. Then

    bias(fc) = sum_f [G (1 - G) S + G^2 N] / sum_f S

is the relative error that least squares makes on the acceleration: the part that the low-pass
removes from the columns but not from the torques, and the power of noise in the columns. fc
minimises the bias of the worst joint. One pass forward and backward has the gain 1/(1 + (w/wc)^(2
order)), with w = tan(pi f/rate); the acceleration passes one such filter for each entry of
`lowpass.on`. Friction switches when a joint reverses, and a low cut-off distorts this switch.
Therefore the highest cut-off is chosen at which noise alone makes less than a given share (QUIET in
limits.toml) of the least bias; it is at most the cut-off of the chapter.

N is flat in the positions: the median of the spectrum in the upper band, but at least the noise
step^2/12 of the steps that the positions show. The spectrum is that of second differences, so that
little leaks from the motion to the noise; it counts as motion where its running mean clearly
exceeds the noise (MOTION in limits.toml). Positions read as counts have less noise, so that their
cut-off is twice as high. Measured: benchmarks/counts.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from runtime.core.signals.filters import median_filtered
from runtime.core.study import CHAPTER_CUTOFF, Lowpass, Signals
from runtime.ground.limits import LIMIT

Array = np.ndarray


class Lines(NamedTuple):
    """Power spectra of the acceleration of one record.

    samples : number of samples. rate : Hz.
    power : frequencies, shape (m,), Hz, power of the motion and of the noise, shape (m, n) each;
        None for a record that is too short, or that lacks positions.
    """

    samples: int
    rate: float
    power: tuple[Array, Array, Array] | None


class Choice(NamedTuple):
    """Cut-off in Hz, the reason for it in words, and whether the records decide it."""

    hertz: float
    why: str
    decided: bool


def cutoff(
    positions: Sequence[tuple[Array, float]],
    signals: Signals,
    crossing: float | tuple[float, ...] = np.inf,
    counts: bool = False,
) -> tuple[float, str]:
    """Choose one cut-off frequency of the low-pass filter for the given records together.

    Returns the cut-off, Hz, rounded to two digits, and the reason in words.

    positions : q, shape (N, n), rad or m, and rate, Hz, of each record.
    crossing : frequency, Hz, above which recorded velocities replace differences of q
        (`runtime.speeds`).
    counts : whether positions are read as counts of encoders.
    """
    lines = [lines_of(q, rate, signals, crossing) for q, rate in positions]
    return chosen_cutoff(lines, signals, counts)[:2]


def lines_of(
    q: Array, rate: float, signals: Signals, crossing: float | tuple[float, ...] = np.inf
) -> Lines:
    """Compute the spectra of one record. The parameters are those of `cutoff`."""
    if len(q) <= LIMIT.FEWEST_LINES or not np.isfinite(q).all():
        return Lines(len(q), rate, None)
    f, motion, noise = spectra(q, rate, signals.median)
    noise = noise / (1 + (f[:, None] / crossing) ** 2)
    motion[:, stands(q, rate, signals.median)] = 0.0
    return Lines(len(q), rate, (f, motion, noise))


def chosen_cutoff(lines: Sequence[Lines], signals: Signals, counts: bool = False) -> Choice:
    """Choose one cut-off frequency for records of known spectra, as `cutoff` does."""
    low, parts = signals.lowpass or Lowpass(), []
    highest = LIMIT.HIGHEST_CUTOFF * min((one.rate for one in lines), default=np.inf)
    long = [one for one in lines if one.samples > LIMIT.FEWEST_LINES]
    read = [(one.rate, *one.power) for one in long if one.power is not None]
    if len(read) < len(long) or not read:
        return Choice(min(CHAPTER_CUTOFF, highest), "the value of the chapter", False)
    lowest = max(LIMIT.LOWEST_CUTOFF, *(LIMIT.CUTOFF_PERIODS * x.rate / x.samples for x in long))
    grid = np.geomspace(min(lowest, highest), highest, LIMIT.CUTOFF_GRID)
    for rate, f, motion, noise in read:
        G = _gain(f, rate, low, grid)
        parts.append((G * (1 - G) @ motion, G**2 @ noise, motion.sum(axis=0)))
    distorted, noisy, power = (np.sum(part, axis=0) for part in zip(*parts, strict=True))
    moving = np.flatnonzero(power > 0)
    if not len(moving):
        why = "no joint moves above the noise of its position"
        return Choice(min(CHAPTER_CUTOFF, highest), why, False)
    bias, noise = (
        (x / np.where(power > 0, power, np.inf))[:, moving] for x in (distorted + noisy, noisy)
    )
    worst = bias.max(axis=1)
    least = int(np.flatnonzero(worst <= max(worst.min(), LIMIT.NO_BIAS))[0])
    quiet = noise.max(axis=1) <= LIMIT.QUIET * max(worst[least], LIMIT.NO_BIAS)
    quiet &= (grid >= grid[least]) & (grid <= CHAPTER_CUTOFF)
    best = least if counts else max(least, int(np.flatnonzero(quiet)[-1:].sum()))
    hertz, joint = grid[best], 1 + int(moving[np.argmax(bias[best])])
    why = f"least bias by motion and noise, joint {joint} decides"
    if counts:
        hertz, why = min(2 * hertz, CHAPTER_CUTOFF, highest), f"counts, twice that of {why}"
    return Choice(float(f"{hertz:.2g}"), why, True)


def stands(q: Array, rate: float, median: int = 1) -> Array:
    """Find the joints that rest during the whole record, bool, shape (n,).

    A joint rests if its range is tiny (below STILL in limits.toml), or if its standard deviation
    hardly exceeds that of its white noise (STILL_NOISE in limits.toml).
    """
    noise = np.sqrt(white_noise(q, rate, median))
    return np.asarray(
        (np.ptp(q, axis=0) < LIMIT.STILL) | (q.std(axis=0) < LIMIT.STILL_NOISE * noise)
    )


def noise_share(q: Array, rate: float, low: Lowpass, median: int = 1) -> Array:
    """Compute the share of position noise in the power of the filtered acceleration of each joint.

    Shape (n,).

    q : shape (N, n), rad or m. rate : Hz. low : low-pass with its cut-off as a number.
    """
    f, motion, noise = spectra(q, rate, median)
    power = lowpass_gain(f, rate, low) ** 2
    whole = power @ (motion + noise)
    return np.asarray(power @ noise / np.where(whole > 0, whole, 1.0))


def lowpass_gain(f: Array, rate: float, low: Lowpass) -> Array:
    """Compute the gain of the low-pass filter on accelerations at the frequencies f, shape (m,)."""
    return np.asarray(_gain(f, rate, low, np.array([low.hertz]))[0])


def _gain(f: Array, rate: float, low: Lowpass, cutoffs: Array) -> Array:
    """Compute the gain G of the low-pass filter on accelerations, shape (cut-offs, frequencies)."""
    ratio = np.tan(np.pi * f / rate) / np.tan(np.pi * cutoffs / rate)[:, None]
    return np.asarray((1 + ratio ** (2 * low.order)) ** -float(max(len(set(low.on)), 1)))


def spectra(q: Array, rate: float, median: int = 1) -> tuple[Array, Array, Array]:
    """Compute two power spectra of the acceleration: of the motion and of the position noise.

    Returns the frequencies, Hz, shape (m,), the power of the motion and the power of the noise,
    shape (m, n) each.

    median : window of the median filter that finds spikes; 1 switches the filter off.
    """
    f, power, gain, level = _spectrum(q, rate, median)
    noise = gain * level
    moves = uniform_filter1d(power, LIMIT.SMOOTHED_LINES, axis=0) > LIMIT.MOTION * noise
    central = (np.cos(np.pi * f / rate) ** 4)[:, None]  # two central differences
    starts = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], LIMIT.CUTOFF_BINS)))
    motion = np.where(moves, np.maximum(power - noise, 0.0), 0.0)
    motion, noise = (np.add.reduceat(central * x, starts, axis=0) for x in (motion, noise))
    return np.add.reduceat(f, starts) / np.diff([*starts, len(f)]), motion, noise


def white_noise(x: Array, rate: float, median: int = 1) -> Array:
    """Estimate the variance of the white noise in each column of signals x, shape (N, n)."""
    return _spectrum(x, rate, median)[3]


def _spectrum(x: Array, rate: float, median: int) -> tuple[Array, Array, Array, Array]:
    """Compute power spectra of second differences of signals x, shape (N, n), and their noise.

    Returns four arrays: the frequencies, shape (m,), Hz; the power of the second differences, shape
    (m, n); their power for white noise of variance 1, shape (m, 1); the variance of the white noise
    of x, shape (n,).
    """
    smooth = median_filtered(x, median)
    away = np.abs(x - smooth)
    x = np.where(away > LIMIT.SPIKE * np.sqrt(np.mean(away**2, axis=0)), smooth, x)
    a = np.diff(x, 2, axis=0)
    a = np.hanning(len(a) + 2)[1:-1, None] * (a - a.mean(axis=0))
    f = np.fft.rfftfreq(len(a), 1 / rate)[1:-1]
    power = np.abs(np.fft.rfft(a, axis=0)[1:-1]) ** 2 / (0.375 * len(a))  # of one sample
    gain = ((2 * np.sin(np.pi * f / rate)) ** 4)[:, None]
    upper = (f > LIMIT.UPPER_BAND[0] * rate) & (f < LIMIT.UPPER_BAND[1] * rate)
    level = np.median((power / gain)[upper], axis=0) / np.log(2)
    steps = np.array([step(column) ** 2 for column in x.T]) / 12
    return f, power, gain, np.maximum(level, steps)


def step(x: Array) -> float:
    """Find the smallest step between the values of x, shape (N,), for instance one encoder count.

    Differences of the size of rounding errors are left out. The result is small if x has no steps.
    """
    steps = np.diff(np.unique(x))
    return float(min(steps[steps > 1e-6 * np.ptp(x)], default=0.0))
