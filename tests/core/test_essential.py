"""Essential parameters against elimination by refitting W at every step."""

import json

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import TRUE, WLS, observation, one_joint_at_rest
from problems import linear_system

from runtime.compose import estimate_of
from runtime.core.essential import essential_of
from runtime.core.study import EssentialSettings, EstimateSettings


def eliminated(seen, threshold):
    """Oracle: numpy lstsq on the remaining columns at every step."""

    def fit(names):
        W = seen.W[:, [seen.names.index(name) for name in names]]
        X, *_ = np.linalg.lstsq(W, seen.Y, rcond=None)
        sigma_rho = np.linalg.norm(seen.Y - W @ X) / np.sqrt(len(W) - len(names))
        return sigma_rho, 100 * sigma_rho * np.sqrt(np.diag(np.linalg.inv(W.T @ W))) / np.abs(X)

    names, trail = list(seen.names), []
    first, relative = fit(names)
    while True:
        worst = names[int(np.argmax(relative))]
        fewer = [name for name in names if name != worst]
        sigma_rho, after = fit(fewer)
        trail.append((worst, relative.max(), sigma_rho / first))
        if sigma_rho >= threshold * first:
            return names, trail
        names, relative = fewer, after


@pytest.mark.parametrize("threshold", [1.02, 1.04, 1.3])
def test_trail_equals_refitting(threshold):
    seen = observation(noise=(1.5, 1.5), seed=2, X=TRUE * np.where(np.arange(10) == 5, 0.01, 1))
    found = essential_of(linear_system(seen), EssentialSettings(threshold))
    names, trail = eliminated(seen, threshold)
    assert list(found.names) == names
    assert [step.name for step in found.trail] == [name for name, _, _ in trail]
    assert np.allclose(
        [(s.relative_sigma, s.ratio) for s in found.trail], [(r, q) for _, r, q in trail], rtol=1e-9
    )
    assert [step.removed for step in found.trail] == [True] * (len(trail) - 1) + [False]
    assert found.counts[threshold] == len(names)
    again = estimate_of(seen, EstimateSettings(columns=found.names))
    assert np.allclose(found.estimate.X, again.X, rtol=1e-10)
    assert np.allclose(found.estimate.sigma_corrected, again.sigma_corrected, rtol=1e-9)


def test_counts_fall_with_the_threshold():
    found = essential_of(linear_system(observation(noise=(1.5, 1.5), seed=2)), model=planar)
    counts = list(found.counts.values())
    assert (min(found.counts), max(found.counts)) == (1.02, 1.10)
    assert counts == sorted(counts, reverse=True)
    for threshold in (1.02, 1.06, 1.10):
        assert found.counts[threshold] == len(
            essential_of(
                linear_system(observation(noise=(1.5, 1.5), seed=2)), EssentialSettings(threshold)
            ).names
        )
    assert found.estimate.units["FV1"] == "N*m*s/rad"


def test_zero_parameters_go_first():
    X = TRUE.copy()
    X[[2, 7]] = 0
    found = essential_of(linear_system(observation(noise=(0.3, 0.05), seed=3, X=X), WLS))
    assert set(found.removed[:2]) == {"MY1", "MY2"}
    assert {"ZZ1R", "FV1", "FS1", "FV2", "FS2", "MX1R", "MX2"} <= set(found.names)


def test_exact_data_keep_everything_that_acts():
    found = essential_of(linear_system(observation()))
    assert found.names == planar.BASE_PARAMETERS


def test_rank_loss_removes_what_the_record_does_not_show():
    found = essential_of(linear_system(observation(motion=one_joint_at_rest, noise=(0.1, 0.1))))
    assert {"FV2", "FS2"} <= set(found.removed)
    assert found.all_parameters.status == "rank-deficient"
    assert found.estimate.status == "ok"


def test_text_and_json():
    found = essential_of(linear_system(observation(noise=(1.5, 1.5), seed=2)))
    data = json.loads(found.to_json())
    assert data["names"] == list(found.names) and data["counts"]["1.04"] == len(found.names)
    assert "(kept)" in str(found) and "1.02:" in str(found)


def test_a_method_that_is_not_linear_has_a_companion_with_its_weights():
    for weights, companion in (("none", "ols"), ("joint", "wls")):
        system = linear_system(observation(noise=(0.1, 0.1)), EstimateSettings("didim", weights))
        assert essential_of(system).estimate.method == companion
