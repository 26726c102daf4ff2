"""Filters against their definitions: no phase shift, MATLAB's padding and phases, exact
derivatives, ends.
"""

import numpy as np
import pytest
import scipy.signal

from runtime.core.signals.filters import (
    decimated,
    decimation_factor,
    derivative,
    filtered_states,
    kept_samples,
    lowpass_filtered,
    median_filtered,
)
from runtime.core.study import Decimate, Lowpass
from runtime.ground.errors import InputError
from runtime.study import Signals

RATE = 1000.0
T = np.arange(3000) / RATE


@pytest.fixture
def noise():
    return np.random.default_rng(0).normal(size=(3000, 2)).cumsum(axis=0)


def test_lowpass_is_filtfilt_with_matlab_padding(noise):
    """filtfilt of MATLAB extends by 3*(filter length - 1) = 12 samples for order 4; the (b, a) form
    is accurate at this cut-off.
    """
    b, a = scipy.signal.butter(4, 100, fs=RATE)
    expected = scipy.signal.filtfilt(b, a, noise, axis=0, padtype="odd", padlen=12)
    np.testing.assert_allclose(
        lowpass_filtered(noise, RATE, Lowpass(cutoff=100)), expected, atol=1e-9
    )
    expected = scipy.signal.filtfilt(b, a, noise, axis=0)  # scipy's default, 15
    np.testing.assert_allclose(
        lowpass_filtered(noise, RATE, Lowpass(cutoff=100, padding="scipy")), expected, atol=1e-9
    )


def test_lowpass_shifts_no_phase_and_halves_power_at_the_cutoff():
    inside = slice(500, -500)
    for frequency, gain in ((5, 1.0), (50, 0.5)):  # forward and backward: 1/sqrt(2) twice
        x = np.sin(2 * np.pi * frequency * T)[:, None]
        np.testing.assert_allclose(
            lowpass_filtered(x, RATE, Lowpass())[inside], gain * x[inside], atol=1e-3
        )


@pytest.mark.parametrize("window", [3, 5, 7])
def test_median_is_that_of_sorted_windows(window):
    for N in (1, 2, 3, 4, 40):
        x = np.random.default_rng(N).standard_normal((N, 3)).round(1)  # equal values among them
        extended = np.pad(x, ((window // 2, window // 2), (0, 0)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(extended, window, axis=0)
        np.testing.assert_array_equal(
            median_filtered(x, window), np.sort(windows, axis=-1)[..., window // 2]
        )


def test_median_removes_an_outlier_and_keeps_ends():
    x = np.linspace(1, 2, 50)[:, None].repeat(2, axis=1)
    y = x.copy()
    y[20, 1] = 1e6
    np.testing.assert_allclose(median_filtered(y, 5), x, atol=0.05)
    assert median_filtered(y, 5)[0, 0] == pytest.approx(1, abs=0.05)  # not pulled to zero
    assert median_filtered(y, 1) is y


def test_derivative_is_exact_for_polynomials():
    x = np.stack([3 * T, T**2], axis=1)
    np.testing.assert_allclose(derivative(x, RATE)[:, 0], 3, rtol=1e-9)
    np.testing.assert_allclose(derivative(x, RATE)[1:-1, 1], 2 * T[1:-1], atol=1e-9)
    assert derivative(x, RATE)[0, 1] == pytest.approx((x[1, 1] - x[0, 1]) * RATE)  # one-sided
    np.testing.assert_allclose(derivative(x, RATE, "second-order")[:, 1], 2 * T, atol=1e-9)


def test_states_of_a_sine():
    w = 2 * np.pi * 2
    states = filtered_states(np.sin(w * T)[:, None], RATE, Signals(median=1))
    inside = slice(200, -200)
    np.testing.assert_allclose(states.qd[inside, 0], w * np.cos(w * T)[inside], atol=1e-3 * w)
    np.testing.assert_allclose(
        states.qdd[inside, 0], -(w**2) * np.sin(w * T)[inside], atol=1e-3 * w**2
    )
    assert states[inside].q.shape == (2600, 1)


def test_second_filter_acts_on_the_velocity():
    q = np.random.default_rng(3).normal(size=(3000, 1))
    both = filtered_states(q, RATE, Signals(median=1))
    once = filtered_states(q, RATE, Signals(median=1, lowpass=Lowpass(on=("q",))))
    np.testing.assert_array_equal(both.q, once.q)
    np.testing.assert_allclose(both.qd, lowpass_filtered(once.qd, RATE, Lowpass()))
    np.testing.assert_allclose(both.qdd, derivative(both.qd, RATE))
    none = filtered_states(q, RATE, Signals(median=1, lowpass=None))
    np.testing.assert_array_equal(none.q, q)


@pytest.mark.parametrize("factor", [2, 10, 40])
def test_decimation_is_scipys(noise, factor):
    np.testing.assert_allclose(
        decimated(noise.T, factor, Decimate()),
        scipy.signal.decimate(noise.T, factor, zero_phase=True),
        rtol=1e-9,
        atol=1e-9,
    )


def test_decimation_of_a_constant():
    """Even order: the passband ripple is at zero frequency, forward and backward."""
    np.testing.assert_allclose(
        decimated(np.ones((1, 1000)), 10, Decimate()), 10 ** (-2 * 0.05 / 20)
    )


def test_no_decimation(noise):
    assert decimated(noise.T, 1, Decimate()).shape == decimated(noise.T, 1, None).shape == (2, 3000)


@pytest.mark.parametrize(
    ("N", "factor"), [(24792, 10), (100, 7), (101, 7), (99, 7), (5, 5), (1000, 1)]
)
def test_phases(N, factor):
    first, last = kept_samples(N, factor, "first"), kept_samples(N, factor, "last")
    assert first[0] == 0 and last[-1] == N - 1
    n_out = -(-N // factor)
    assert len(first) == len(last) == n_out
    assert (
        last[0] == factor - (factor * n_out - N) - 1
    )  # MATLAB: n_beg = r - (r n_out - n), counted from 1


def test_equation_13():
    assert decimation_factor(Signals(), 5000.0) == 40  # 0.8*5000/(2*50)
    assert (
        decimation_factor(Signals(lowpass=Lowpass(cutoff=60)), 5000.0) == 33
    )  # rounded down: the band is kept
    assert (
        decimation_factor(Signals(), 4999.9999) == 40
    )  # the rate of a time column that counts from an epoch
    assert decimation_factor(Signals(), 100.5) == 1
    assert decimation_factor(Signals(decimate=Decimate(factor=7)), 5000.0) == 7
    assert decimation_factor(Signals(decimate=None), 5000.0) == 1
    with pytest.raises(InputError, match=r"signals\.lowpass is not set"):
        decimation_factor(Signals(lowpass=None), 5000.0)


def test_cutoff_above_nyquist():
    with pytest.raises(InputError, match="Nyquist frequency 50 Hz"):
        lowpass_filtered(np.zeros((100, 1)), 100.0, Lowpass(cutoff=50))


def test_too_short():
    with pytest.raises(InputError, match="needs more than 12"):
        lowpass_filtered(np.zeros((12, 1)), RATE, Lowpass())
    with pytest.raises(InputError, match="needs more than 27"):
        decimated(np.zeros((1, 27)), 2, Decimate())
