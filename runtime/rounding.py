"""Random rounding of a measurement as a coarser sensor would make it, eqs. (15) and (28).

    two-point   x + Delta or x - Delta, probability 1/2 each           variance Delta^2      eq. (15)
    gaussian    x + N(0, Delta^2)                                      variance Delta^2      eq. (28)
    uniform     x + U(-Delta, Delta)                                   variance Delta^2 / 3
    quantise    the grid point below or above x, step Delta, 1/2 each  variance Delta^2 / 3 about a smooth x

The first three add to the measurement, the last one replaces it. Every draw has its own stream, a Philox generator keyed by (seed, level, run):
its numbers do not depend on who draws, or when.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Array = np.ndarray
Mode = Literal["two-point", "uniform", "gaussian", "quantise"]


def stream(seed: int, *key: int) -> np.random.Generator:
    """Random numbers of one draw: the same ones for the same seed and key, independent ones for others."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))


def rounded(x: Array, step: float, mode: Mode, rng: np.random.Generator) -> Array:
    """x as measured with steps of `step` (in the unit of x), same shape."""
    if mode == "two-point":
        return x + step * signs(x.shape, rng)
    if mode == "gaussian":
        return x + step * rng.standard_normal(x.shape)
    if mode == "uniform":
        return x + rng.uniform(-step, step, x.shape)
    cell = x / step
    below = np.floor(cell)
    up = (signs(x.shape, rng) > 0) & (cell > below)  # a value on the grid stays there
    return step * (below + up)


def signs(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """+1.0 or -1.0 with probability 1/2, one random bit each."""
    size = int(np.prod(shape))
    bits = np.unpackbits(np.frombuffer(rng.bytes(-(-size // 8)), dtype=np.uint8), count=size)
    return np.asarray(2.0 * bits - 1.0).reshape(shape)
