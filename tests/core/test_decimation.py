"""Decimation at the kept samples only: equal to the filter that computes every sample, ends
included.
"""

import numpy as np
import pytest
import scipy.signal

from runtime.core.signals.decimation import decimate, operator, plan


@pytest.mark.parametrize("offset", [0, 100])
@pytest.mark.parametrize("pad", [27, 24])
@pytest.mark.parametrize(
    ("N", "factor"),
    [
        (300, 2),
        (301, 3),
        (1000, 10),
        (7104, 40),
        (5007, 40),
        (3000, 100),
        (4500, 500),
        (60, 40),
        (35, 40),
        (28, 2),
    ],
)
def test_equals_the_whole_filter(N, factor, pad, offset):
    """Tolerance: the rounding of the second-order sections of the reference, which grows with the
    square of the factor.
    """
    u = np.random.default_rng(N).normal(size=(3, N)).cumsum(axis=1) + offset
    sos = scipy.signal.cheby1(8, 0.05, 0.8 / factor, output="sos")
    whole = scipy.signal.sosfiltfilt(sos, u, axis=-1, padtype="odd", padlen=pad)
    for phase in {0, factor - 1 - (factor * -(-N // factor) - N), min(factor, N) // 2}:
        kept = decimate(u, plan(N, factor, phase, pad))
        np.testing.assert_allclose(
            kept,
            whole[:, phase::factor],
            rtol=0,
            atol=(2e-14 + 2e-15 * factor**2) * np.abs(u).max(),
        )


def test_impulse_response_is_that_of_the_filter():
    impulse = np.zeros(200)
    impulse[0] = 1
    sos = scipy.signal.cheby1(8, 0.05, 0.8 / 10, output="sos")
    np.testing.assert_allclose(
        operator(10).impulse(200), scipy.signal.sosfilt(sos, impulse), atol=1e-14
    )


@pytest.mark.parametrize("phase", [0, 4, 6])
@pytest.mark.parametrize("samples", [1, 100, 2000])
def test_pieces_change_nothing(samples, phase, monkeypatch):
    """Pieces of whole blocks."""
    u = np.random.default_rng(1).normal(size=(3, 1003)).cumsum(axis=-1)
    how = plan(1003, 7, phase, 27)
    expected = decimate(u, how)
    monkeypatch.setattr("runtime.core.signals.decimation.PIECE", samples)
    assert len(how.pieces()) == (18 if samples < 1000 else 1)
    np.testing.assert_allclose(decimate(u, how), expected, rtol=0, atol=1e-13)
