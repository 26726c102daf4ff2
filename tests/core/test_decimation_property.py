"""Decimation of any signal, length and factor: scipy's decimate and MATLAB's, every kept sample,
the ends included; by pieces too.
"""

from math import ceil

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime.core.signals.decimation import decimated_parts
from runtime.core.signals.filters import decimated, decimation_plan
from runtime.core.study import Decimate
from runtime.ground.errors import InputError

SCIPY, MATLAB = Decimate(), Decimate(phase="last", padding="matlab")


def signal(kind, N, seed):
    rng, t = np.random.default_rng(seed), np.arange(N)
    return {
        "noise": lambda: rng.normal(size=N),
        "walk": lambda: rng.normal(size=N).cumsum(),
        "offset": lambda: 1e6 + rng.normal(size=N),
        "step": lambda: np.where(t < rng.integers(0, N), -1.0, 3.0),
        "impulse at an end": lambda: 1.0 * (t == rng.choice([0, N - 1])),
        "sine": lambda: 1e-9 * np.sin(rng.uniform(0, np.pi) * t + 1),
        "ramp": lambda: t - N / 3,
    }[kind]()


kinds = st.sampled_from(["noise", "walk", "offset", "step", "impulse at an end", "sine", "ramp"])
factors = st.one_of(st.integers(2, 60), st.integers(2, 500))


def close(found, expected, factor, u):
    """The tolerance is the rounding of the reference, whose sections lose digits with the square of
    the factor.
    """
    assert found.shape == expected.shape
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=(2e-14 + 2e-15 * factor**2) * np.abs(u).max()
    )


@settings(max_examples=150)
@given(kind=kinds, N=st.integers(28, 6000), factor=factors, seed=st.integers(0, 10**6))
def test_scipys_decimate(kind, N, factor, seed):
    u = signal(kind, N, seed)
    close(decimated(u, factor, SCIPY), scipy.signal.decimate(u, factor, zero_phase=True), factor, u)


@settings(max_examples=150)
@given(kind=kinds, N=st.integers(25, 6000), factor=factors, seed=st.integers(0, 10**6))
def test_matlabs_decimate(kind, N, factor, seed):
    """decimate.m: nout = ceil(nd/r), nbeg = r - (r*nout - nd), odata = filtfilt(b, a, idata),
    odata(nbeg:r:nd); filtfilt.m: nfact = 3*(nfilt-1).
    """
    u = signal(kind, N, seed)
    sos = scipy.signal.cheby1(8, 0.05, 0.8 / factor, output="sos")
    begin = factor - (factor * ceil(N / factor) - N)  # counts from 1
    close(
        decimated(u, factor, MATLAB),
        scipy.signal.sosfiltfilt(sos, u, padtype="odd", padlen=3 * (9 - 1))[begin - 1 :: factor],
        factor,
        u,
    )


@settings(max_examples=60)
@given(
    kind=kinds,
    N=st.integers(28, 20000),
    factor=factors,
    how=st.sampled_from([SCIPY, MATLAB]),
    seed=st.integers(0, 10**6),
    most=st.integers(1, 2000),
)
def test_parts_are_those_of_the_whole(kind, N, factor, how, seed, most):
    """What samples out of reach would change is far below rounding: the tolerance does not grow
    with the factor.
    """
    u = signal(kind, N, seed)[None]
    whole, plan = decimated(u, factor, how), decimation_plan(N, factor, how)
    assert plan is not None
    most = max(most, plan.K // 20)
    parts = list(decimated_parts(lambda t0, t1: u[:, t0:t1], 1, plan, most))
    assert [part.stop - part.start for part, _ in parts[:-1]] == [most] * (len(parts) - 1)
    found = np.concatenate([y for _, y in parts], axis=1)
    np.testing.assert_allclose(found, whole, rtol=0, atol=5e-14 * np.abs(u).max())


@pytest.mark.parametrize(("N", "how", "pad"), [(27, SCIPY, 27), (24, MATLAB, 24), (1, SCIPY, 27)])
def test_too_short(N, how, pad):
    with pytest.raises(
        InputError,
        match=(
            f"{N} samples; this zero-phase filter needs more than {pad}, use a longer record or "
            "window"
        ),
    ):
        decimated(np.ones(N), 3, how)
    assert decimated(np.ones(pad + 1), 3, how).shape == (ceil((pad + 1) / 3),)


def test_a_batch_of_rows_is_row_by_row():
    u = np.stack([signal(kind, 1003, 5) for kind in ("noise", "walk", "step", "ramp")]).reshape(
        2, 2, 1003
    )
    found = decimated(u, 13, SCIPY)
    for i in np.ndindex(2, 2):
        np.testing.assert_allclose(
            found[i], decimated(u[i], 13, SCIPY), rtol=0, atol=1e-13 * np.abs(u[i]).max()
        )
