"""Random rounding of a measurement as by a coarser sensor, eqs. (15) and (28) of the chapter.

    two-point   x + Delta or x - Delta, probability 1/2 each           variance Delta^2
            eq. (15)
    gaussian    x + N(0, Delta^2)                                      variance Delta^2
            eq. (28)
    uniform     x + U(-Delta, Delta)                                   variance Delta^2 / 3
    quantise    the grid point below or above x, step Delta, 1/2 each
            variance Delta^2 / 3 about a smooth x
    phase       phi + Delta round((x - phi) / Delta), phi uniform in [0, Delta), one for each column
            variance Delta^2 / 12

The first three laws add Delta xi to the measurement, with xi the same for every Delta; the last two
replace the measurement. `phase` is what a real encoder does. Its error is a sawtooth along the
motion, not white noise, and its edges show when the position passed a known value; the other laws
destroy this information. Its lines, at phi + (k + 1/2) Delta, may be uneven: each line is displaced
by a normal random number of standard deviation `uneven` Delta. If a whole number of steps makes one
turn, the pattern repeats with every turn. Every draw has its own stream, a Philox generator with
the key (seed, level, run): its numbers do not depend on the process that draws, or on the order.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT

Array = np.ndarray
Mode = Literal["two-point", "uniform", "gaussian", "quantise", "phase"]

VARIANCE = {"two-point": 1.0, "gaussian": 1.0, "uniform": 1 / 3, "quantise": 1 / 3, "phase": 1 / 12}
"""Variance of a mode over Delta^2."""
ADDED = ("two-point", "gaussian", "uniform")  # Modes that add Delta xi


def stream(seed: int, *key: int) -> np.random.Generator:
    """Return a random number generator fixed by the seed and a key such as (level, run).

    Generators of different keys are independent.
    """
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))


def rounded(
    x: Array, step: float, mode: Mode, rng: np.random.Generator, uneven: float = 0.0
) -> Array:
    """Round x at random by the rounding law `mode`, like an encoder with the resolution `step`.

    x : shape (N, n) or (N,); step : in the unit of x.
    uneven : standard deviation of the lines of law phase from even spacing, in steps.
    """
    if mode in ADDED:
        return np.asarray(x + step * noise(x.shape, mode, rng))
    if mode == "phase":
        columns = x.reshape(len(x), -1).T
        phases = step * rng.random(len(columns))
        return np.stack(
            [
                counted(own, step, phi, uneven, rng)
                for own, phi in zip(columns, phases, strict=True)
            ],
            axis=-1,
        ).reshape(x.shape)
    cell = x / step
    below = np.floor(cell)
    up = (signs(x.shape, rng) > 0) & (cell > below)  # a value on the grid stays there
    return np.asarray(step * (below + up))


def counted(x: Array, step: float, phase: float, uneven: float, rng: np.random.Generator) -> Array:
    """Compute the positions, shape (N,), that an incremental encoder shows for the motion x.

    step, phase, uneven : distance, phase and unevenness of its lines, as of law phase.
    """
    cell = (x - phase) / step
    if not uneven:
        return np.asarray(phase + step * np.floor(cell + 0.5))
    first, last = (
        int(np.floor(cell.min() - LIMIT.LINES_BEYOND)),
        int(np.ceil(cell.max() + LIMIT.LINES_BEYOND)),
    )
    if last - first > LIMIT.UNEVEN_LINES:
        raise InputError(
            f"the motion crosses {last - first} encoder lines of step {step:.3g}, but unevenly "
            f"spaced lines are limited to {LIMIT.UNEVEN_LINES}; use larger steps"
        )
    line, turn = np.arange(first, last), 2 * np.pi / step
    lines = round(turn) if abs(turn - round(turn)) < 1e-6 and round(turn) < len(line) else len(line)
    edges = np.sort(line + 0.5 + uneven * rng.standard_normal(lines)[line % lines])
    return np.asarray(phase + step * (first + np.searchsorted(edges, cell, side="right")))


def noise(shape: tuple[int, ...], mode: Mode, rng: np.random.Generator) -> Array:
    """Draw random numbers xi, shape (N, n): x + Delta xi is x rounded at random to steps Delta."""
    if mode == "two-point":
        return signs(shape, rng)
    return rng.standard_normal(shape) if mode == "gaussian" else rng.uniform(-1.0, 1.0, shape)


def signs(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Draw random numbers +1.0 or -1.0, with probability 1/2 each, in an array of the given shape.

    Its columns are contiguous in memory, as the filters need.
    """
    return np.take([-1.0, 1.0], np.ascontiguousarray(bits(shape, rng).T)).T


def bits(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Draw random numbers 1 or 0, with probability 1/2 each, in an array of the given shape."""
    size = int(np.prod(shape))
    packed = np.frombuffer(rng.bytes(-(-size // 8) + 1), dtype=np.uint8)
    return np.unpackbits(packed, count=size).reshape(shape)
