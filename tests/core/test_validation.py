"""Direct comparison, cross-validation, weak directions."""

import json
from dataclasses import replace

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import OLS, TRUE, motion, observation
from problems import linear_system

from runtime.compose import estimate_of, state_problem
from runtime.core.parameter_sets import held_out_validation
from runtime.core.study import EstimateSettings
from runtime.core.validation import (
    cross_validation,
    direct_comparison,
    prediction_errors,
    split_validation,
    weak_directions,
)
from runtime.ground.errors import InputError

PROBLEM = state_problem(planar, ())


def test_comparison_holds_the_torques_of_every_joint():
    seen = observation(noise=(0.3, 0.05), seed=1)
    found = estimate_of(seen, model=planar)
    compared = direct_comparison(seen, found)
    assert [joint.joint for joint in compared] == ["1", "2"]
    error, measured = (
        np.linalg.norm(np.concatenate([getattr(joint, name) for joint in compared]))
        for name in ("error", "measured")
    )
    assert np.isclose(100 * error / measured, found.relative_error)
    for j, joint in enumerate(compared):
        assert np.array_equal(joint.measured, seen.Y[seen.joint(j)])
        assert np.array_equal(joint.t, seen.t[seen.joint(j)])
        assert np.isclose(joint.relative_error, found.per_joint[j].relative_error)
        assert np.isclose(np.linalg.norm(joint.error), found.per_joint[j].residual_norm)


def test_comparison_uses_the_columns_of_the_estimate():
    seen = observation(noise=(0.3, 0.05), seed=1)
    found = estimate_of(seen, EstimateSettings(columns=("MX1R", "FS2", "FV1")))
    predicted = np.concatenate([joint.predicted for joint in direct_comparison(seen, found)])
    assert np.allclose(predicted, seen.W[:, [1, 9, 3]] @ found.X)
    with pytest.raises(InputError, match="FS2"):
        direct_comparison(seen.columns(("MX1R", "FV1")), found)


def test_other_records_are_predicted():
    fit = observation(noise=(0.3, 0.05), seed=1)
    other = observation(noise=(0.3, 0.05), seed=2, motion=lambda t: motion(1.3 * t + 5))
    result = cross_validation(
        PROBLEM,
        fit,
        {"second": other},
        {
            "all": OLS,
            "essential": replace(OLS, columns=("MX1R", "FV1", "FS1", "MX2", "FV2", "FS2", "ZZ1R")),
        },
    )
    assert [(p.part, p.columns, p.count, p.fitted) for p in result.predictions] == [
        ("fit", "all", 10, True),
        ("second", "all", 10, False),
        ("fit", "essential", 7, True),
        ("second", "essential", 7, False),
    ]
    found = estimate_of(fit)
    assert np.isclose(result.predictions[0].relative_error, found.relative_error)
    expected = 100 * np.linalg.norm(other.Y - other.W @ found.X) / np.linalg.norm(other.Y)
    assert np.isclose(result.predictions[1].relative_error, expected)
    assert result.predictions[1].relative_error < 1.5 * result.predictions[0].relative_error
    assert "predicted" in str(result) and json.loads(result.to_json())["joints"] == ["1", "2"]


def test_windows_of_one_record():
    seen = observation(noise=(0.3, 0.05), seed=1)
    result = split_validation(PROBLEM, seen, [(0, 5), (5.01, None)], {"all": OLS})
    assert [p.part for p in result.predictions] == ["[0, 5] s", "[5.01, ] s"]
    found = estimate_of(seen.between(0, 5))
    late = seen.between(5.01, None)
    assert np.isclose(
        result.predictions[1].relative_error,
        100 * np.linalg.norm(late.Y - late.W @ found.X) / np.linalg.norm(late.Y),
    )
    epoch = replace(seen, t=seen.t + 1.795e9)
    parts = [
        p.part
        for p in split_validation(
            PROBLEM, epoch, [(1.795e9, 1.795e9 + 5), (1.795e9 + 5.01, None)], {"all": OLS}
        ).predictions
    ]
    assert parts == ["[1795000000.000, 1795000005.000] s", "[1795000005.010, ] s"]
    with pytest.raises(InputError, match="at least two"):
        split_validation(PROBLEM, seen, [(0, 5)], {"all": OLS})


def test_parameters_that_trade_are_named():
    seen = observation(noise=(0.3, 0.05), seed=1)
    W = seen.W.copy()
    rng = np.random.default_rng(0)
    W[:, 2] = 40 * W[:, 1] + 0.1 * rng.standard_normal(len(W))  # MY1 nearly as MX1R
    found = weak_directions(linear_system(replace(seen, W=W, Y=W @ TRUE)))
    assert (found.pairs[0].first, found.pairs[0].second) == ("MX1R", "MY1")
    assert found.pairs[0].correlation < -0.999
    assert ("MX1R", "MY1") in found.groups
    assert set(found.directions[0].weights) == {"MX1R", "MY1"}
    assert found.directions[0].ratio < 1e-3
    assert np.isclose(sum(w**2 for w in found.directions[0].weights.values()), 1, atol=1e-3)
    assert found.tables()[0].rows[0][:2] == ("MX1R", "MY1") and "MX1R, MY1" in str(found)
    (warning,) = found.warnings
    assert (
        warning.startswith(
            "MX1R and MY1 are strongly correlated on this record (correlation -1.00)"
        )
        and "excite" in warning
    )
    json.loads(found.to_json())


def test_correlations_are_those_of_the_covariance():
    seen = observation(noise=(0.3, 0.05), seed=1)
    found = weak_directions(linear_system(seen, EstimateSettings(method="wls")), threshold=0.2)
    assert len(found.warnings) == len(found.groups) and all(
        ", ".join(g[:-1]) in w for g, w in zip(found.groups, found.warnings, strict=True)
    )
    C = estimate_of(seen, EstimateSettings(method="wls")).covariance
    for pair in found.pairs:
        i, k = seen.names.index(pair.first), seen.names.index(pair.second)
        assert np.isclose(pair.correlation, C[i, k] / np.sqrt(C[i, i] * C[k, k]))


def test_each_fifth_is_predicted_by_the_others():
    whole = observation(noise=(0.3, 0.05), seed=1)
    result = held_out_validation(PROBLEM, whole, {"all": OLS})
    number = whole.equal_parts(5)
    assert [np.ptp(whole.t[number == p]) for p in range(5)] == pytest.approx([2] * 5, abs=0.1)
    assert not any(p.fitted for p in result.predictions) and not result.missing
    for p, prediction in enumerate(result.predictions):
        others = estimate_of(whole.where(number != p), OLS)
        total, by_joint = prediction_errors(whole.where(number == p), others)
        assert (prediction.relative_error, prediction.per_joint) == (total, by_joint)
    assert result.errors() == {"all": max(p.relative_error for p in result.predictions)}


@pytest.mark.parametrize("method", ["ols", "wls", "irls"])
def test_fits_of_which_only_x_is_used_have_no_corrected_deviations(method, monkeypatch):
    """They took most of the time of a long record, and nobody read them."""
    seen = observation(noise=(0.3, 0.05), seed=1)
    weights = {"wls": {"weights": "joint"}}.get(method, {})
    settings = EstimateSettings(method=method, **weights)
    whole = estimate_of(seen, settings)
    assert np.isfinite(whole.sigma_corrected).all()

    def refused(*_):
        raise AssertionError("computed, and not used")

    monkeypatch.setattr("runtime.core.least_squares.linear.corrected_deviations", refused)
    monkeypatch.setattr("runtime.robust.corrected_deviations", refused)
    alone = estimate_of(seen, settings, corrected=False)
    assert np.isnan(alone.sigma_corrected).all()
    assert np.array_equal(alone.X, whole.X) and np.array_equal(alone.sigma, whole.sigma)
    assert alone.status == whole.status
    found = cross_validation(PROBLEM, seen, {"again": seen}, {"all": settings})
    errors = [prediction.relative_error for prediction in found.predictions]
    np.testing.assert_allclose(errors, whole.relative_error, rtol=1e-9)
