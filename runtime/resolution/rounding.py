"""Random rounding of a measurement as a coarser sensor would make it, eqs. (15) and (28).

    two-point   x + Delta or x - Delta, probability 1/2 each           variance Delta^2      eq. (15)
    gaussian    x + N(0, Delta^2)                                      variance Delta^2      eq. (28)
    uniform     x + U(-Delta, Delta)                                   variance Delta^2 / 3
    quantise    the grid point below or above x, step Delta, 1/2 each  variance Delta^2 / 3 about a smooth x

The first three add Delta xi to the measurement, with xi the same for every Delta; the last one replaces it. Every draw has its own stream, a Philox
generator keyed by (seed, level, run): its numbers do not depend on who draws, or when.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Array = np.ndarray
Mode = Literal["two-point", "uniform", "gaussian", "quantise"]

ADDED = ("two-point", "gaussian", "uniform")  # Modes that add Delta xi


def stream(seed: int, *key: int) -> np.random.Generator:
    """Random numbers of one draw: the same ones for the same seed and key, independent ones for others."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))


def rounded(x: Array, step: float, mode: Mode, rng: np.random.Generator) -> Array:
    """x, shape (N, n), as measured with steps of `step` (in the unit of x)."""
    if mode in ADDED:
        return np.asarray(x + step * noise(x.shape, mode, rng))
    cell = x / step
    below = np.floor(cell)
    up = (signs(x.shape, rng) > 0) & (cell > below)  # a value on the grid stays there
    return np.asarray(step * (below + up))


def noise(shape: tuple[int, ...], mode: Mode, rng: np.random.Generator) -> Array:
    """xi of a mode that adds, shape (N, n)."""
    if mode == "two-point":
        return signs(shape, rng)
    return rng.standard_normal(shape) if mode == "gaussian" else rng.uniform(-1.0, 1.0, shape)


def signs(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """+1.0 or -1.0 with probability 1/2, one random bit each; columns are contiguous, as filters want them."""
    return np.asarray(2.0 * np.ascontiguousarray(bits(shape, rng).T) - 1.0).T


def bits(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """1 or 0 with probability 1/2."""
    size = int(np.prod(shape))
    return np.unpackbits(np.frombuffer(rng.bytes(-(-size // 8)), dtype=np.uint8), count=size).reshape(shape)
