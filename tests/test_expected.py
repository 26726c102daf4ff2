"""The expected error of predictions: a motion of one joint alone is told by it, steps of encoders
are, and a rich motion is left alone.
"""

from dataclasses import replace

import numpy as np
import planar_arm
import pytest
from problems import linear_system

import runtime
import symgen
from runtime.expected import expected_error, with_values
from runtime.physical.inertia import physical_model
from runtime.study import study_from_mapping


@pytest.fixture(scope="module")
def arm():
    return symgen.model("planar_2r")


def record(model, size, step=0.0):
    rng = np.random.default_rng(5)
    t = np.arange(0, 10, 1e-3)
    w, phase = 2 * np.pi * rng.uniform(0.1, 1.0, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    angle = w[:, :, None] * t + phase[:, :, None]
    q, qd, qdd = (
        np.einsum("jk,jkt->tj", 0.4 * np.array(size)[:, None] * w**n, f(angle))
        for n, f in enumerate((np.sin, np.cos, lambda x: -np.sin(x)))
    )
    X = np.asarray(model.base_parameters(model.VALUES))
    tau = model.inverse_dynamics(q, qd, qdd, X)
    tau = tau + 0.02 * tau.std(axis=0) * rng.standard_normal(tau.shape)
    return runtime.Record(t, np.round(q / step) * step if step else q, tau)


def test_rich_motion_still_joint_and_steps(arm):
    study = study_from_mapping({"signals": {"lowpass": {"cutoff": 50}}})
    rich, still, steps = (
        runtime.identify(arm, one, study)
        for one in (
            record(arm, (1, 1)),
            record(arm, (1, 0.002)),
            record(arm, (1, 1), 2 * np.pi / 500),
        )
    )
    likely = rich.part("expected_error").expected
    assert rich.expected_error < 2 and rich.checklist.grade == rich.expected_error
    assert likely.low < rich.expected_error < likely.high < 5
    assert still.expected_error > 5 * rich.expected_error
    assert steps.expected_error > 15 and steps.checklist.state == "no"


def test_range_not_known_and_not_determined(arm):
    result = runtime.identify(arm, record(arm, (1, 1)))
    bare = type("Bare", (), {**{k: getattr(arm, k) for k in dir(arm) if k[0] != "_"}, "LIMITS": {}})
    fit = result.model_estimate
    assert np.isnan(expected_error(bare, linear_system(result.observation), fit, ()).error)
    failed = replace(result.estimate, status="rank-deficient")
    lost = replace(result, sets=replace(result.sets, all=failed))
    assert lost.expected_error == 999


def test_a_law_of_the_transmitted_torque_has_an_expected_error():
    """It was not known, so that single values (MY1, MY2, which are zero) counted in the verdict."""
    text = planar_arm.text_of(
        planar_arm.FRICTION + "\n  FL: {kind: load_dependent, along: all}",
        planar_arm.FRICTION_VALUES + ", FL1: 0.12, FL2: 0.12",
    )
    model = planar_arm.arm(text)
    t, q, qd, qdd = planar_arm.motion(0)
    X = planar_arm.parameters(model)
    rest = np.where([name.startswith("FL") for name in model.BASE_PARAMETERS], 0.0, X)
    none = dict.fromkeys(("tau_model1", "tau_model2"), np.zeros(len(t)))
    load = dict(zip(none, (model.regressor(q, qd, qdd, **none) @ rest).T, strict=True))
    tau = model.regressor(q, qd, qdd, **load) @ X
    tau = tau + 0.03 * np.random.default_rng(1).standard_normal(tau.shape)
    result = runtime.identify(model, runtime.Record(t, q, tau), planar_arm.study())
    assert result.estimate["FL1"] == pytest.approx(0.12, abs=0.01)
    assert result.expected_error < 2 and result.checklist.state == "good"


def test_values_hold_what_the_record_leaves_open(arm):
    """Small deviations stay, and the parameters with them; without rows the values stand."""
    physical = physical_model(arm)
    K, values = physical.K, [physical.values.get(name, 0.0) for name in physical.standard]
    X = 1.1 * (K @ np.array(values)) + 0.01
    chi, _ = with_values(physical, K, 1e6 * np.eye(len(X)), 1e6 * X)
    np.testing.assert_allclose(K @ chi, X, rtol=1e-6)
    chi, V = with_values(physical, K, 1e-9 * np.eye(len(X)), 0 * X)
    inertial = [k for j in physical.links for k in physical.link(j)]
    np.testing.assert_allclose(chi[inertial], np.array(values)[inertial], atol=1e-6)
    mass = physical.link(physical.links[-1])[-1]
    assert V[mass, mass] == pytest.approx((0.3 * values[mass]) ** 2, rel=1e-6)


@pytest.mark.parametrize(
    ("counts", "state", "named"),
    [(500, "doubtful", "0.0126"), (2000, "doubtful", "0.00314"), (200_000, "open", "3.14e-05")],
)
def test_steps_that_positions_show_are_named(arm, counts, state, named):
    study = study_from_mapping({"signals": {"lowpass": {"cutoff": 50}}})
    result = runtime.identify(arm, record(arm, (1, 1), 2 * np.pi / counts), study)
    asked = "Does the encoder resolve enough?"
    check = next(c for c in result.checklist.checks if c.question == asked)
    assert check.state == state and f"in steps of {named} (joint side)" in check.finding
