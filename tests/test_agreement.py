"""Records of one robot agree within their stated deviations, and those of two robots do not: size
and power on simulated pairs.
"""

import numpy as np
import pytest
from campaign import FULL, campaign
from scipy.signal import butter, lfilter

import runtime
import symgen
from runtime.agreement import homogeneity
from runtime.study import study_from_mapping

STUDY = study_from_mapping({"signals": {"median": 1, "lowpass": {"cutoff": 20}}})


@pytest.fixture(scope="module")
def arm():
    return symgen.model("planar_2r")


def record(model, X, rng, rate=400.0, duration=20.0):
    """Five sines per joint; torque noise of 5 %, coloured up to 5 Hz, so that neighbouring rows are
    not independent.
    """
    t = np.arange(0, duration, 1 / rate)
    w, phase = 2 * np.pi * rng.uniform(0.1, 1.2, (2, 5)), rng.uniform(0, 2 * np.pi, (2, 5))
    a = 0.5 * rng.standard_normal((2, 5)) / (1 + w / 3)
    angle = w[:, :, None] * t + phase[:, :, None]
    q, qd, qdd = (
        np.einsum("jk,jkt->tj", a * w**n, f(angle))
        for n, f in enumerate((np.sin, np.cos, lambda x: -np.sin(x)))
    )
    tau = model.inverse_dynamics(q, qd, qdd, X)
    noise = lfilter(*butter(1, 5, fs=rate), rng.standard_normal(tau.shape), axis=0)
    return runtime.Record(t, q, tau + 0.05 * tau.std(axis=0) * noise / noise.std(axis=0), rate=rate)


def pairs(model, count):
    """Tests of pairs from one robot, and from two that differ by 10 % in ZZ1R."""
    X = np.asarray(model.base_parameters(model.VALUES))
    other = X.copy()
    other[model.BASE_PARAMETERS.index("ZZ1R")] *= 1.1
    for k in range(count):
        rng = np.random.default_rng([7, k])
        a, b, c = (runtime.observe(model, record(model, x, rng), STUDY) for x in (X, X, other))
        yield tuple(
            homogeneity({"first": a, "second": second}, model.BASE_PARAMETERS, model=model)
            for second in (b, c)
        )


def rates(found):
    """Shares of the pairs of one robot, and of two, that are said to differ, and of those of two
    that name the parameter.
    """
    same, differ = zip(*found, strict=True)
    named = [any(d.parameter == "ZZ1R" for d in one.disagreements) for one in differ]
    return (
        np.mean([not one.agree for one in same]),
        np.mean([not one.agree for one in differ]),
        np.mean(named),
    )


def test_pairs(arm):
    """Of one robot none differs; a parameter off by 10 % is found where its deviation allows it."""
    size, power, named = rates(pairs(arm, 10))
    assert size == 0 and named == power >= 0.5


@campaign
def test_many_pairs(arm):
    size, power, _ = rates(pairs(arm, 200 if FULL else 40))
    assert size <= 0.05 and power >= 0.5


def test_values_are_those_of_the_record_alone(arm):
    X = np.asarray(arm.base_parameters(arm.VALUES))
    other = X * np.where(np.array(arm.BASE_PARAMETERS) == "MX1R", 1.3, 1.0)
    rng = np.random.default_rng(3)
    a, b = (record(arm, x, rng) for x in (X, other))
    found = runtime.identify(arm, [a, b], STUDY).part("homogeneity").disagreements[0]
    alone = runtime.identify(arm, b, STUDY).estimate
    k = alone.names.index("MX1R")
    np.testing.assert_allclose(
        (found.value, found.deviation), (alone.X[k], alone.sigma_corrected[k]), rtol=1e-9
    )


@pytest.mark.parametrize("duration", [3.0, 20.0])
def test_slow_noise_of_one_robot_does_not_differ(arm, duration):
    """Noise that remembers for longer than a block: three of twenty differ by the corrected deviations alone."""
    X = np.asarray(arm.base_parameters(arm.VALUES))
    differ = 0
    for k in range(20):
        rng, parts = np.random.default_rng([11, k]), {}
        for name in "ab":
            one = record(arm, X, rng, duration=duration)
            slow = lfilter([1], [1, -0.99], rng.standard_normal(one.tau.shape), axis=0)
            tau = one.tau + 0.05 * one.tau.std(axis=0) * slow / slow.std(axis=0)
            parts[name] = runtime.observe(arm, runtime.Record(one.t, one.q, tau), STUDY)
        differ += not homogeneity(parts, arm.BASE_PARAMETERS, model=arm).agree
    assert differ <= 1


def test_names_the_record_of_three(arm):
    X = np.asarray(arm.base_parameters(arm.VALUES))
    other = X * np.where(np.array(arm.BASE_PARAMETERS) == "MX1R", 1.2, 1.0)
    rng = np.random.default_rng(3)
    parts = {
        name: runtime.observe(arm, record(arm, x, rng), STUDY)
        for name, x in (("monday", X), ("tuesday", other), ("friday", X))
    }
    found = homogeneity(parts, arm.BASE_PARAMETERS, model=arm)
    assert not found.agree and (
        found.disagreements[0].record,
        found.disagreements[0].parameter,
    ) == ("tuesday", "MX1R")
    assert "tuesday: MX1R" in found.text() and "differ" in found.text()


def test_a_record_at_rest_is_left_out_and_told(arm):
    """One whose rows do not determine the parameters is named; of the two others nothing is
    concluded from it.
    """
    X = np.asarray(arm.base_parameters(arm.VALUES))
    rng = np.random.default_rng(4)
    a, b, c = (record(arm, X, rng) for _ in range(3))
    still = runtime.Record(c.t, np.tile(c.q[:1], (len(c), 1)), c.tau, rate=c.rate)
    parts = {
        name: runtime.observe(arm, x, STUDY) for name, x in (("a", a), ("b", b), ("still", still))
    }
    found = homogeneity(parts, arm.BASE_PARAMETERS, model=arm)
    assert found.records == ("a", "b") and found.untested[0].startswith(
        "still, which alone does not determine"
    )
    alone = homogeneity({"a": parts["a"], "still": parts["still"]}, arm.BASE_PARAMETERS, model=arm)
    assert "cannot be compared" in alone.text()
