"""Filters of a part of a record with the samples in their reach: those of the whole record."""

import numpy as np
import pytest
import scipy.signal

from runtime.rows.pieces import DIFFERENCE, TRUNCATION, memory, reach
from runtime.settings.study import Lowpass, Signals
from runtime.signals.filters import butterworth, filtered_states


def walk(N, columns, offset=10.0):
    """A random walk away from zero: its ends are far from it, and its values far from one another."""
    return offset + np.random.default_rng(N).normal(size=(N, columns)).cumsum(axis=0)


@pytest.mark.parametrize("order", [1, 2, 4, 7, 12])
@pytest.mark.parametrize("cutoff", [0.5, 20.0, 480.0])
def test_what_truncation_leaves_out(order, cutoff):
    """A filter forgets the state it starts in, steady for the value 1, to less than ten times the
    stated bound.
    """
    sos, _ = butterworth(1000.0, Lowpass(cutoff=cutoff, order=order))
    left, _ = scipy.signal.sosfilt(sos, np.zeros(memory(sos)), zi=scipy.signal.sosfilt_zi(sos))
    assert abs(left[-1]) < 10 * TRUNCATION


@pytest.mark.parametrize(
    "signals",
    [
        Signals(),
        Signals(lowpass=Lowpass(cutoff=50.0, padding="scipy")),
        Signals(lowpass=Lowpass(20.0, on=("qd",)), ends="second-order"),
    ],
)
@pytest.mark.parametrize(("a", "b"), [(0, 1), (0, 3000), (2000, 2001), (3100, 6000), (7000, 8000)])
def test_states_of_a_part_are_those_of_the_whole(signals, a, b):
    x = walk(8000, 3)
    far, whole = reach(1000.0, signals, 1), filtered_states(x, 1000.0, signals)
    begin, end = max(a - far, 0), min(b + far, len(x))
    assert end - begin < len(x) or b - a > 1
    part = filtered_states(x[begin:end], 1000.0, signals)[a - begin : b - begin]
    for name, share in (("q", 1e-14), ("qd", 1e-11), ("qdd", 1e-9)):
        expected = getattr(whole, name)
        np.testing.assert_allclose(
            getattr(part, name), expected[a:b], rtol=0, atol=share * np.abs(expected).max()
        )


@pytest.mark.parametrize("window", [3, 5, 9])
def test_median_and_differences_of_a_part_are_the_same_bits(window):
    signals, x = Signals(median=window, lowpass=None, decimate=None), walk(1000, 2)
    far, whole = reach(50.0, signals, 1), filtered_states(x, 50.0, signals)
    assert far == window + 2 * DIFFERENCE
    part = filtered_states(x[300 - far : 600 + far], 50.0, signals)[far:-far]
    for name in ("q", "qd", "qdd"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[300:600])
