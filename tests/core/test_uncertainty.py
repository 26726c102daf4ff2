"""Whiteness, drawn blocks, F-tests and sets by threshold: against scipy's own, against scatter, on
residuals whose colour is known.
"""

import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from planar_data import OLS, WLS, observation
from problems import linear_system
from scipy import stats
from scipy.signal import lfilter

from runtime.compose import estimate_of
from runtime.core.documents import json_text
from runtime.core.essential import essential_of
from runtime.core.residuals import effective_share, joint_whiteness
from runtime.core.study import EssentialSettings, EstimateSettings
from runtime.core.uncertainty import block_bootstrap, f_tests, uncertainty
from runtime.core.validation import JointComparison, direct_comparison


def coloured(white):
    """First order, correlation 0.8 from row to row, variance 1."""
    return lfilter([0.6], [1, -0.8], white, axis=-1)


def joint(error, t=None, rate=30.0):
    t = np.arange(len(error)) / rate if t is None else t
    return JointComparison("1", t, error, np.zeros(len(error)))


def test_white_residuals_pass_as_often_as_they_should():
    rng = np.random.default_rng(0)
    found = [joint_whiteness(joint(rng.standard_normal(400)), 30.0) for _ in range(400)]
    assert stats.kstest([w.p for w in found], "uniform").pvalue > 0.01
    assert np.mean([w.white for w in found]) == pytest.approx(0.95, abs=0.03)
    assert effective_share(found) == pytest.approx(1.0, abs=0.12)


def test_ljung_box_as_written_down():
    e = coloured(np.random.default_rng(1).standard_normal(300)) + 0.3
    x, N = e - e.mean(), 300
    full = np.correlate(x, x, "full")[N - 1 :]
    rho = full[1:21] / (N - np.arange(1, 21)) * N / full[0]
    w = joint_whiteness(joint(e), 30.0)
    assert np.allclose(w.correlation, rho)
    assert pytest.approx(N * (N + 2) * np.sum(rho**2 / (N - np.arange(1, 21)))) == w.Q
    assert w.p == pytest.approx(stats.chi2.sf(w.Q, 20)) and not w.white


def test_coloured_residuals_are_worth_fewer_rows():
    e = coloured(np.random.default_rng(2).standard_normal(20000))
    w = joint_whiteness(joint(e), 30.0)
    assert w.correlation[0] == pytest.approx(0.8, abs=0.02)
    assert w.effective_rows / w.rows == pytest.approx((1 - 0.8) / (1 + 0.8), rel=0.15)
    assert w.half < 2.0 and np.trapezoid(w.density, w.frequency) == pytest.approx(
        np.var(e), rel=0.05
    )


def test_rows_that_count_over_a_long_memory():
    """First order, 0.99 from row to row: (1 - 0.99)/(1 + 0.99) of 4000 rows are 20; 20 lags alone
    would say 111.
    """
    rng = np.random.default_rng(4)
    worth = [
        joint_whiteness(
            joint(lfilter([1], [1, -0.99], rng.standard_normal(6000))[2000:]), 30.0
        ).effective_rows
        for _ in range(40)
    ]
    assert np.median(worth) == pytest.approx(20, rel=0.35)


def test_records_a_month_apart_take_the_room_of_their_rows():
    e = coloured(np.random.default_rng(5).standard_normal(2000))
    t = np.arange(1000) / 125
    month = 30 * 24 * 3600.0
    tracemalloc.start()
    apart = joint_whiteness(joint(e, np.concatenate([t, t + month]), 125.0), 125.0)
    assert tracemalloc.get_traced_memory()[1] < 2e6
    tracemalloc.stop()
    together = joint_whiteness(joint(e, np.concatenate([t, t]), 125.0), 125.0)
    assert (
        np.array_equal(apart.correlation, together.correlation)
        and apart.effective_rows == together.effective_rows
    )
    assert np.array_equal(apart.density, together.density)


def test_gaps_and_records_are_no_neighbours():
    rng = np.random.default_rng(3)
    e = coloured(rng.standard_normal(3000))
    t = np.arange(3000) / 30
    kept = np.sort(rng.choice(3000, 1500, replace=False))
    assert joint_whiteness(joint(e[kept], t[kept]), 30.0).correlation[0] == pytest.approx(
        0.8, abs=0.05
    )
    two = joint(
        np.concatenate([np.full(50, 1.0), np.full(50, -1.0)]), np.tile(np.arange(50) / 30, 2)
    )
    assert np.allclose(
        joint_whiteness(two, 30.0).correlation, 1.0
    )  # a pair across the records would give less
    tone = joint_whiteness(joint(np.sin(2 * np.pi * 3.0 * t)), 30.0)
    assert tone.peak == pytest.approx(3.0, abs=0.15)


def test_drawn_deviations_match_the_scatter_where_sigma_does_not():
    settings = EstimateSettings(options={"block": 1.5})
    found, drawn, sigma = [], [], []
    for seed in range(120):
        seen = observation(N=900, noise=(0.5, 0.2), seed=seed, colour=coloured)
        fit = estimate_of(seen, settings)
        found.append(fit.X)
        sigma.append(fit.sigma)
        if seed < 30:
            drawn.append(block_bootstrap(linear_system(seen, settings), fit).drawn)
    real = np.std(found, axis=0, ddof=1)
    assert np.mean(real / np.mean(sigma, axis=0)) > 1.4
    assert np.median(np.mean(drawn, axis=0) / real) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize("settings", [OLS, WLS, EstimateSettings("wls", "covariance")])
def test_whole_record_drawn_once_is_the_estimate(settings):
    """The sum of the blocks is the record: its solution is the fit; few draws agree with many."""
    seen = observation(N=600, noise=(0.5, 0.1))
    fit = estimate_of(seen, settings)
    one, other = (
        block_bootstrap(linear_system(seen, settings), fit, runs=300, seed=1),
        block_bootstrap(linear_system(seen, settings), fit, runs=300, seed=2),
    )
    assert np.allclose(one.drawn, other.drawn, rtol=0.25) and np.array_equal(
        one.drawn, block_bootstrap(linear_system(seen, settings), fit, runs=300, seed=1).drawn
    )
    assert np.median(one.drawn / fit.sigma_corrected) == pytest.approx(1, abs=0.12)


def test_f_is_that_of_two_nested_fits():
    seen = observation(noise=(6.0, 2.0), seed=3)
    found = essential_of(linear_system(seen), EssentialSettings(1.04))
    tests = f_tests(found)
    r, b = seen.W.shape
    S0 = np.sum((seen.Y - seen.W @ np.linalg.lstsq(seen.W, seen.Y, rcond=None)[0]) ** 2)
    gone, before = [], S0
    for q, test in enumerate(tests, start=1):
        gone.append(seen.names.index(test.name))
        W = np.delete(seen.W, gone, axis=1)
        S = np.sum((seen.Y - W @ np.linalg.lstsq(W, seen.Y, rcond=None)[0]) ** 2)
        F, F_step = (S - S0) / q / (S0 / (r - b)), (S - before) / (before / (r - b + q - 1))
        assert pytest.approx(F, rel=1e-6, abs=1e-7) == test.F and test.p == pytest.approx(
            stats.f.sf(F, q, r - b), abs=1e-6
        )
        assert test.F_step == pytest.approx(
            F_step, rel=1e-5, abs=1e-6
        ) and test.p_step == pytest.approx(stats.f.sf(F_step, 1, r - b + q - 1), abs=1e-5)
        before = S
    fewer = f_tests(found, 0.2)
    assert all(
        few.F < test.F and few.p > test.p for few, test in zip(fewer[1:], tests[1:], strict=True)
    )


def test_sets_by_threshold_and_what_is_shown():
    seen = observation(noise=(9.0, 4.0), seed=5)
    found = essential_of(linear_system(seen), EssentialSettings(1.03))
    checked = uncertainty(linear_system(seen), found, direct_comparison(seen, found.estimate))
    by_threshold = {threshold: (count, names) for threshold, count, names in checked.sets}
    assert by_threshold[1.03] == (len(found.names), ())
    for threshold, (count, names) in by_threshold.items():
        kept = essential_of(linear_system(seen), EssentialSettings(threshold)).names
        assert count == len(kept)
        expected = {f"-{n}" for n in found.names if n not in kept} | {
            f"+{n}" for n in kept if n not in found.names
        }
        assert set(names) == expected
    text = checked.to_table()
    assert "Ljung-Box" in text and "threshold keeps" in text and len(checked.verdict) == 3
    data = json.loads(json_text(checked.summary()))
    assert (
        data["whiteness"][0]["joint"] == "1"
        and len(data["scatter"]["drawn"]) == len(found.names)
        and data["f_tests"][0]["name"] == found.trail[0].name
    )
    assert [len(t.rows) for t in checked.tables()] == [
        len(found.names),
        2,
        len(found.trail),
        len(found.counts),
    ]


def test_a_record_that_determines_nothing_is_no_error():
    seen = observation()
    lost = replace(seen, W=np.column_stack([seen.W[:, 0], seen.W[:, :-1]]))
    found = essential_of(linear_system(lost), EssentialSettings())
    checked = uncertainty(linear_system(lost), found, direct_comparison(lost, found.estimate))
    assert len(checked.bootstrap.drawn) == len(found.names)
