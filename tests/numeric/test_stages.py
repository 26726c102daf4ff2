"""Filters by pieces: the results of the whole-record functions, for any pieces, both ends included."""

import numpy as np
import pytest
import scipy.signal

from runtime.errors import InputError
from runtime.observation.decimation import decimate, plan
from runtime.observation.filters import butterworth, derivative, lowpass_filtered, median_filtered
from runtime.observation.streaming_filters import (
    TRUNCATION,
    Chain,
    Local,
    StreamedDecimation,
    ZeroPhase,
    derivative_stage,
    median_stage,
    position_stage,
    velocity_stage,
)
from runtime.settings.study import Lowpass, Signals


def walk(N, columns, offset=10.0):
    """A random walk away from zero: its ends are far from it, and its values far from one another."""
    return offset + np.random.default_rng(N).normal(size=(N, columns)).cumsum(axis=0)


def pieces(x, size):
    """Pieces of `size` rows, or of random sizes, empty ones included."""
    cuts = range(size, len(x), size) if size else np.sort(np.random.default_rng(0).integers(0, len(x), 20))
    return np.split(x, list(cuts))


def through(stage, x, size):
    return np.concatenate([*(stage.push(part) for part in pieces(x, size)), stage.finish()])


@pytest.mark.parametrize("size", [1, 3, 100, 10**6, 0])
@pytest.mark.parametrize("N", [10, 41, 1000])
def test_median_and_differences_are_the_same_bits(N, size):
    x = walk(N, 2)
    for window in (3, 5, 9):
        np.testing.assert_array_equal(through(median_stage(window)[0], x, size), median_filtered(x, window))
    for ends in ("one-sided", "second-order"):
        np.testing.assert_array_equal(through(derivative_stage(50.0, ends), x, size), derivative(x, 50.0, ends))


@pytest.mark.parametrize("padding", ["matlab", "scipy"])
@pytest.mark.parametrize(("N", "size"), [(16, 1), (300, 7), (5000, 0), (5000, 1000), (60000, 4096), (60000, 7777)])
def test_lowpass(N, size, padding):
    low = Lowpass(cutoff=50.0, padding=padding)
    x = walk(N, 2)
    found, whole = through(ZeroPhase(*butterworth(1000.0, low)), x, size), lowpass_filtered(x, 1000.0, low)
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-14 * np.abs(x).max())


@pytest.mark.parametrize("order", [1, 2, 4, 7, 12])
@pytest.mark.parametrize("cutoff", [0.5, 20.0, 480.0])
def test_what_truncation_leaves_out(order, cutoff):
    """The backward filter forgets the state it starts in, steady for the value 1, to less than ten times the stated bound."""
    stage = ZeroPhase(*butterworth(1000.0, Lowpass(cutoff=cutoff, order=order)))
    left, _ = scipy.signal.sosfilt(stage.sos, np.zeros(stage.ahead), zi=stage.zi[..., 0])
    assert abs(left[-1]) < 10 * TRUNCATION


def test_lowpass_does_not_hold_the_record():
    stage = ZeroPhase(*butterworth(1000.0, Lowpass(cutoff=50.0)))
    assert stage.ahead < 600
    for part in pieces(walk(100_000, 1), 1000):
        stage.push(part)
        assert sum(map(len, stage.waiting)) < 3 * stage.ahead + 1000


@pytest.mark.parametrize(
    ("N", "factor", "pad", "size"),
    [
        (28, 2, 27, 5),
        (300, 2, 24, 1),
        (60, 40, 27, 7),
        (5007, 40, 27, 0),
        (45007, 40, 24, 1000),
        (45007, 13, 27, 4096),
        (30000, 500, 27, 0),
    ],
)
def test_decimation(N, factor, pad, size):
    u = walk(N, 3, offset=100.0)
    for phase in {0, factor - 1 - (factor * -(-N // factor) - N), min(factor, N) // 2}:
        how = plan(N, factor, phase, pad)
        stage = StreamedDecimation(how)
        found = np.concatenate([*(stage.push(part.T) for part in pieces(u, size)), stage.finish()], axis=1)
        whole = decimate(np.ascontiguousarray(u.T), how)
        assert found.shape == whole.shape == (3, how.K)
        np.testing.assert_allclose(found, whole, rtol=0, atol=2e-14 * np.abs(u).max())


def test_decimation_does_not_hold_the_record():
    stage = StreamedDecimation(plan(200_000, 10, 0, 27))
    for part in pieces(walk(200_000, 1), 1000):
        stage.push(part.T)
        assert stage.rest.shape[1] < 1500 and stage.count < 4 * stage.ahead + 100


@pytest.mark.parametrize(
    "signals", [Signals(), Signals(median=1, lowpass=None), Signals(lowpass=Lowpass(20.0, on=("qd",)), ends="second-order")]
)
@pytest.mark.parametrize("size", [0, 1500])
def test_positions_to_velocities(signals, size):
    x = walk(8000, 3)
    q = median_filtered(x, signals.median)
    if signals.lowpass is not None and "q" in signals.lowpass.on:
        q = lowpass_filtered(q, 1000.0, signals.lowpass)
    qd = derivative(q, 1000.0, signals.ends)
    if signals.lowpass is not None:
        qd = lowpass_filtered(qd, 1000.0, signals.lowpass)
    chain = Chain(position_stage(1000.0, signals), velocity_stage(1000.0, signals))
    np.testing.assert_allclose(through(chain, x, size), qd, rtol=0, atol=1e-11 * np.abs(qd).max())


def test_too_short_for_the_filter():
    stage = ZeroPhase(*butterworth(1000.0, Lowpass()))
    stage.push(walk(12, 1))
    with pytest.raises(InputError, match="12 samples; this zero-phase filter needs more than 12"):
        stage.finish()
    assert through(Local(lambda x: x, 3), walk(2, 1), 1).shape == (2, 1)
