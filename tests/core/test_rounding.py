"""Rounding modes: variance, grid, streams."""

import numpy as np
import pytest
from scipy.stats import chi2

from runtime.core.cestac.rounding import rounded, signs, stream
from runtime.ground.errors import InputError

STEP = 0.02


@pytest.mark.parametrize(
    ("mode", "factor"),
    [("two-point", 1.0), ("gaussian", 1.0), ("uniform", 1 / 3), ("quantise", 1 / 3)],
)
def test_variance_of_the_noise(mode, factor):
    x = np.linspace(-3, 5, 40000).reshape(20000, 2)
    noise = rounded(x, STEP, mode, stream(1, 0, 0)) - x
    assert noise.shape == x.shape
    # the mean of n independent errors: five deviations; the variance: chi2 bounds are wide enough
    # for the lighter tails of the others
    assert abs(noise.mean()) < 5 * STEP * np.sqrt(factor / x.size)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], x.size - 1) / (x.size - 1)
    assert low < noise.var() / (factor * STEP**2) < high
    if (
        mode != "quantise"
    ):  # there the mean error is the distance to the middle of the cell, which moves with x
        assert abs(np.corrcoef(noise.T)[0, 1]) < 0.03
        assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.03


def test_two_point_takes_two_values():
    noise = rounded(np.zeros((1001, 3)), STEP, "two-point", stream(1, 0, 0))
    assert set(np.unique(noise)) == {-STEP, STEP}


def test_quantisation_gives_a_neighbour_on_the_grid():
    x = np.linspace(-1, 1, 999)
    y = rounded(x, STEP, "quantise", stream(1, 0, 0))
    assert np.allclose(y / STEP, np.round(y / STEP), atol=1e-9)
    assert np.all(np.abs(y - x) < STEP * (1 + 1e-9))
    assert (y > x).any() and (y < x).any()
    on_grid = 0.25 * np.arange(-8, 9)
    assert np.array_equal(rounded(on_grid, 0.25, "quantise", stream(1, 0, 0)), on_grid)


def test_streams_depend_on_seed_and_key_alone():
    assert np.array_equal(signs((7, 3), stream(5, 2, 1)), signs((7, 3), stream(5, 2, 1)))
    others = [stream(5, 2, 2), stream(5, 1, 1), stream(6, 2, 1), stream(5, 1), stream(5, 2, 1, 1)]
    first = signs((64, 6), stream(5, 2, 1))
    assert all(abs((first * signs((64, 6), rng)).mean()) < 0.25 for rng in others)
    assert abs(first.mean()) < 0.25


def test_a_real_encoder_has_one_phase_for_each_column():
    """phi + k Delta, k to the nearest; over many steps the error is uniform and independent of the
    phase of others.
    """
    x = np.linspace(-3, 5, 40000)[:, None] * [1.0, -0.7, 0.3]
    y = rounded(x, STEP, "phase", stream(1, 0, 0))
    phases = y[0] / STEP % 1
    assert np.allclose((y / STEP - phases + 0.5) % 1, 0.5, atol=1e-6) and np.ptp(phases) > 0.01
    assert np.abs(y - x).max() <= STEP / 2 * (1 + 1e-9)
    assert np.allclose((y - x).var(axis=0), STEP**2 / 12, rtol=0.03)
    alone = rounded(x[:, 0], STEP, "phase", stream(2, 0, 0))
    assert (
        alone.shape == (40000,)
        and abs(alone[0] - rounded(x[:, 0], STEP, "phase", stream(3, 0, 0))[0]) > 1e-6
    )


def test_uneven_lines():
    """Where the counts change is off the even lines by the stated deviation, and alike in every
    turn.
    """
    step, turns = 2 * np.pi / 400, 3
    x = np.linspace(0, turns * 2 * np.pi, 400_000)
    y = rounded(x, step, "phase", stream(1, 0, 0), 0.1)
    steps = np.flatnonzero(np.diff(y))
    edges, between = x[steps], (y[steps] + y[steps + 1]) / 2
    off = (edges - between) / step
    assert len(steps) == 400 * turns and np.all(np.diff(y) >= 0)
    assert 0.09 < off.std() < 0.11
    assert np.allclose(off[:400], off[400:800], atol=0.01)  # 333 samples for one step
    assert np.abs(np.corrcoef(off[:399], off[1:400])[0, 1]) < 0.2
    with pytest.raises(InputError, match="use larger steps"):
        rounded(x, 1e-7, "phase", stream(1, 0, 0), 0.1)
