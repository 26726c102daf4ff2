"""Joints with two encoders: stiffness and damping of two motors that move two links through
springs, integrated by scipy, within the stated deviations.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import TRUE
from scipy.integrate import solve_ivp

from runtime import identify
from runtime.compose import problem
from runtime.core.record import Record
from runtime.core.study import Lowpass, Signals
from runtime.elastic import elasticity
from runtime.reading.records import read_records
from runtime.study import Study, study_from_mapping

RATE, N = 500.0, 6000
K, D = np.array([4000.0, 1500.0]), np.array([6.0, 2.0])
J, IA, FV = np.array([2.0, 0.5]), np.array([0.8, 0.2]), np.array([4.0, 1.0])
WEIGHT = np.array([12.0, 3.0])  # N m
STUDY = Study(signals=Signals(median=1, lowpass=Lowpass(cutoff=15)))


def torque(t):
    a = np.array([[20.0, 9.0, 4.0], [6.0, 3.0, 1.0]])
    w = np.array([[1.1, 4.3, 17.0], [1.7, 6.1, 23.0]])
    return (a * np.sin(w * t + np.array([[0.1], [1.0]]))).sum(1)


@cache
def simulated():
    def rate(t, x):
        m, l, md, ld = x.reshape(4, 2)
        gear = K * (m - l) + D * (md - ld)
        motor = (torque(t) - FV * md - gear) / IA
        return np.concatenate([md, ld, motor, (gear - WEIGHT * np.sin(l) - ld) / J])

    t = np.arange(N) / RATE
    x = solve_ivp(rate, (0, t[-1]), np.zeros(8), "DOP853", t, rtol=1e-9, atol=1e-12).y.T
    return t, x[:, :2], x[:, 2:4], np.array([torque(time) for time in t])


def record(seed=0, link=None):
    """A noisy record; link : positions of the links, default those of the simulation."""
    t, motor, q_link, tau = simulated()
    rng = np.random.default_rng(seed)
    noise = [s * rng.standard_normal(motor.shape) for s in (1e-5, 1e-5, 0.02)]
    q_link = q_link if link is None else link
    return Record(t, motor + noise[0], tau + noise[2], q_link=q_link + noise[1])


def found(seed=0, link=None):
    return elasticity(problem(planar, record(seed, link), STUDY), planar.BASE_PARAMETERS, TRUE)


def test_stiffness_and_damping_within_their_deviations():
    one = found()
    np.testing.assert_array_less(np.abs(one.K - K), 4 * one.sigma_K)
    np.testing.assert_array_less(np.abs(one.D - D), 4 * one.sigma_D)
    assert (one.sigma_K < 0.02 * K).all() and one.joints == ("1", "2")
    assert "a rigid model is" in one.sentences[0]


def test_scatter_over_noise_is_that_of_the_deviations():
    runs = [found(seed) for seed in range(15)]
    scatter = np.std([one.K for one in runs], axis=0, ddof=1)
    stated = np.mean([one.sigma_K for one in runs], axis=0)
    assert ((scatter > 0.3 * stated) & (scatter < 2 * stated)).all(), (scatter, stated)


def test_a_late_encoder_is_told_and_costs_no_stiffness():
    """3 ms between the encoders."""
    t, _, link, _ = simulated()
    late = np.column_stack([np.interp(t - 3e-3, t, x) for x in link.T])
    one, plain = found(link=late), found()
    np.testing.assert_allclose(one.lag - plain.lag, 3e-3, rtol=0.1)
    np.testing.assert_allclose(one.K, K, rtol=0.05)


def test_a_joint_without_second_encoder_and_one_that_tells_nothing():
    t, motor, link, tau = simulated()
    one = link.copy()
    one[:, 0] = np.nan
    assert found(link=one).joints == ("2",)
    noise = 1e-2 * np.random.default_rng(5).standard_normal(motor.shape)
    told = found(link=motor + noise)
    assert np.isnan(told.K).all() and "does not determine the stiffness" in told.sentences[0]
    assert elasticity(problem(planar, Record(t, motor, tau), STUDY), (), np.zeros(0)) is None


def test_identify_tells_it_from_a_file(tmp_path):
    one = record()
    l = one.channels["q_link"][:, 1]
    table = np.column_stack([simulated()[0], one.q, one.tau, l])
    head = "t,q1,q2,tau1,tau2,l2"
    np.savetxt(tmp_path / "a.csv", table, "%.12g", ",", header=head, comments="")
    study = study_from_mapping(
        {
            "record": {
                "files": str(tmp_path / "a.csv"),
                "columns": {"t": "t", "q_link": ["0", "l2"]},
            },
            "signals": {"median": 1, "lowpass": {"cutoff": 15}},
        }
    )
    result = identify(planar, read_records(study.record), study, plausible=False)
    gears = result.part("elastic")
    assert gears.joints == ("2",) and gears.K[0] == pytest.approx(K[1], rel=0.03)
    assert "Gear of joint 2: stiffness 1.5e+03" in result.brief()
