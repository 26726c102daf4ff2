"""Every entry point on every feature that changes a problem: the model, W and Y of `identify`, or one sentence.

REFUSED holds the cells that have no answer, each with its reason; all other cells are compared with the identification.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from features import FEATURES, Case

from runtime import compose
from runtime.advisor.advice import Advice
from runtime.controller.law import late
from runtime.core.problem import estimated
from runtime.core.rows.prepared import stacked
from runtime.friction import friction_curves
from runtime.ground.errors import InputError
from runtime.plausible.delay import delay as delay_of
from runtime.plausible.plausibility import plausibility as plausibility_of
from runtime.study import Study

CLOSE = 1e-12
"""Of the largest entry."""
FOLDER = TemporaryDirectory()
"""Of the files that studies name."""
NOT_ASKED = "Not checked: a trial of another reading"

MOTION = "of a motion"
NO_ADVICE = "advice on encoders of joints does not support force sensors"
NO_SLIPS = "check of record and study does not support force sensors"
REFUSED: Mapping[tuple[str, str], tuple[str, str]] = {
    ("force sensors", "advise"): (
        NO_ADVICE,
        "an advice is the step of an encoder by joint; an axis of a sensor has no encoder",
    ),
    ("force sensors", "plausibility"): (
        NO_SLIPS,
        "a cause is a map of the positions and torques of joints; it has no row for an axis of a sensor",
    ),
    ("poses at rest", "cestac"): (
        MOTION,
        "the error of an encoder acts by qd and qdd, which are zero by definition",
    ),
    ("poses at rest", "advise"): (
        MOTION,
        "the gains of the filters from q to qd and qdd, which the prediction is made of, do not exist",
    ),
    ("poses at rest", "delay"): (MOTION, "poses have no clock"),
    ("poses at rest", "plausibility"): (
        MOTION,
        "causes are told apart by inertia and friction, which have no torque at rest",
    ),
    ("missing samples", "advise"): (
        "positions are missing",
        "the prediction filters an error of every sample; a sample that is not there has none",
    ),
    ("channels", "plausibility"): (
        NOT_ASKED,
        "a record read at another rate, or joints exchanged, would have the channel at other instants",
    ),
    ("transmitted torque", "plausibility"): (
        NOT_ASKED,
        "tau_model is the torque of the parameters found; those of another reading have another",
    ),
}
"""(feature, entry point): words of the one sentence, and why the quantity has no meaning."""
MISSING: Mapping[str, tuple[tuple[str, str], ...]] = {
    "force sensors": (
        (NO_SLIPS, "as above"),
        (NO_ADVICE, "as above"),
    ),
    "poses at rest": (
        ("not judged for poses at rest", "as above"),
        ("a friction curve needs records of a motion", "friction has no torque at rest"),
        ("the study of encoders needs records of a motion", "as above"),
    ),
    "missing samples": (("positions are missing", "as above"),),
}
"""Parts of a report that have no meaning for a feature."""


@cache
def case_of(feature: str) -> Case:
    """The case of a feature, made once."""
    folder = Path(FOLDER.name) / str(list(FEATURES).index(feature))
    folder.mkdir()
    return replace(FEATURES[feature](folder), feature=feature)


@cache
def identified(feature: str) -> Any:
    """What `identify` says of the case."""
    case = case_of(feature)
    return compose.identify(case.model, case.records, case.study, further=case.unseen)


def equal(found: Any, expected: Any) -> None:
    """Both, to CLOSE of the largest entry."""
    size = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=CLOSE * size)


def same_rows(found: Any, expected: Any) -> None:
    """W, Y and their columns."""
    assert found.names == expected.names
    equal(found.W, expected.W)
    equal(found.Y, expected.Y)


def same_reference(reference: Any, result: Any) -> None:
    """X on some columns is that of the rows of the identification."""
    settings = replace(result.study.estimate, columns=reference.names)
    equal(reference.X, estimated(result.problem, result.observation, settings).X)


def estimate(case: Case, result: Any) -> None:
    found = compose.estimate(case.model, case.records, case.study)
    assert found.names == result.estimate.names
    equal(found.X, result.estimate.X)
    equal(found.sigma, result.estimate.sigma)


def essential(case: Case, result: Any) -> None:
    found = compose.essential(case.model, case.records, case.study)
    assert found.names == result.essential.names
    equal(found.all_parameters.X, result.essential.all_parameters.X)
    equal(found.estimate.X, result.essential.estimate.X)


def observe(case: Case, result: Any) -> None:
    same_rows(compose.observe(case.model, case.records, case.study), result.observation)


def identify(case: Case, result: Any) -> None:
    """Its rows are those of the prepared problem, and records that are predicted are read alike."""
    problem = compose.problem(case.model, case.records, case.study, unseen=case.unseen)
    assert problem.model.CONSTANTS == result.model.CONSTANTS
    same_rows(stacked(problem.model, problem.prepared), result.observation)
    assert result.prediction_error < 2 * result.estimate.relative_error + 0.2


def compare(case: Case, result: Any) -> None:
    ranking = compose.compare(case.model, {"as stated": (case.study, case.records, case.unseen)})
    found = ranking.results["as stated"]
    assert found.model.CONSTANTS == result.model.CONSTANTS
    same_rows(found.observation, result.observation)
    equal(found.estimate.X, result.estimate.X)
    assert found.prediction_error == pytest.approx(result.prediction_error, rel=1e-9)
    assert ranking.mean_errors["as stated"] < 1.2 * result.prediction_error


def cestac(case: Case, result: Any) -> None:
    found = compose.cestac(case.model, case.records, case.study)
    assert found.names == result.essential.names
    same_reference(found.reference, result)
    assert np.isfinite(found.levels[0].mean).all()


def advise(case: Case, result: Any) -> None:
    found = compose.advise(
        case.model, case.records, quick(case.study), asked=(2e-3,), confirm=False
    )
    assert found.names == result.essential.names
    same_reference(found.reference, result)
    assert np.isfinite(found.steps).all()


def delay(case: Case, result: Any) -> None:
    found = compose.delay(case.model, case.records[0], case.study)
    expected = delay_of(result.problem)
    np.testing.assert_allclose(found.shift, expected.shift, rtol=0, atol=1e-12)
    of_joints = found.shift[: len(case.model.JOINTS)]
    assert np.abs(of_joints).max() < 5e-4, "no torque of these records is late"


def plausibility(case: Case, result: Any) -> None:
    found = compose.plausibility(case.model, case.records, case.study)
    expected = plausibility_of(result.problem)
    assert [check.sentence for check in found.checks()] == [c.sentence for c in expected.checks()]
    open_checks = [check.sentence for check in found.checks() if check.state == "open"]
    if any(NOT_ASKED in sentence for sentence in open_checks):
        raise InputError(open_checks[0])


def assess(case: Case, result: Any) -> None:
    """The parts of a report that are computed stand on the same rows; what is missing is missing by the table."""
    found = compose.assess(case.model, case.records, case.study)
    same_rows(found.observation, result.observation)
    equal(found.estimate.X, result.estimate.X)
    resolution = found.part("resolution")
    if resolution is not None:
        same_reference(resolution.reference, result)
    advice = found.part("advice")
    if isinstance(advice, Advice):
        same_reference(advice.reference, result)
    friction = found.part("friction")
    if friction is not None:
        curves = friction_curves(result.problem, result.estimate)
        for curve, expected in zip(friction.curves, curves, strict=True):
            equal(curve.f, expected.f)
            assert curve.law_name == expected.law_name
    else:
        assert case.feature == "poses at rest"
    assert (resolution is None) == (case.feature == "poses at rest")
    allowed = [text for text, _ in MISSING.get(case.feature, ())]
    for sentence in found.missing:
        assert any(text in sentence for text in allowed), sentence


def quick(study: Study) -> Study:
    """The study with the cheapest question to the advisor: one law of rounding, no quadrature over phases."""
    return replace(study, cestac=replace(study.cestac, rounding="two-point"))


ENTRIES: Mapping[str, Callable[[Case, Any], None]] = {
    "estimate": estimate,
    "essential": essential,
    "observe": observe,
    "identify": identify,
    "compare": compare,
    "cestac": cestac,
    "advise": advise,
    "delay": delay,
    "plausibility": plausibility,
    "assess": assess,
}


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("feature", FEATURES)
def test_every_entry_point_has_the_rows_of_identify_or_refuses(feature: str, entry: str) -> None:
    case = case_of(feature)
    result = identified(feature)
    if (feature, entry) not in REFUSED:
        ENTRIES[entry](case, result)
        return
    words, _ = REFUSED[feature, entry]
    with pytest.raises(InputError, match=words) as refusal:
        ENTRIES[entry](case, result)
    assert "\n" not in str(refusal.value)


def test_the_features_change_what_is_fitted() -> None:
    """Each case needs its feature: without the step another model, other rows or another number of columns."""
    changed = {feature: identified(feature) for feature in FEATURES}
    assert len(changed["force sensors"].model.JOINTS) == 8
    assert not any(
        name.startswith(("Ia", "FV", "FS")) for name in changed["link side"].estimate.names
    )
    assert len(changed["poses at rest"].estimate.names) == 4
    assert changed["fitted scalars"].model.CONSTANTS["vs1"] == pytest.approx(0.3, rel=0.05)
    assert "tau_model2" in changed["transmitted torque"].problem.records[0].channels
    assert changed["law, kd: fit"].problem.noted("law") is not None
    assert "law_v" not in changed["law, kd: fit"].problem.records[0].channels
    delay = changed["law, delay: fit"].problem.noted("law").result.delay
    assert delay == pytest.approx(4e-3, abs=2e-4)
    given = case_of("law, delay: fit").records[0]
    fitted = changed["law, delay: fit"].problem.records[0]
    v = given.channels["law_v"]  # remains, as late as the torque: the doubt about kd reads it
    np.testing.assert_allclose(fitted.channels["law_v"], late(given.t, v, delay), atol=1e-12)
    assert changed["missing samples"].problem.records[0].missing is not None
    assert changed["automatic cut-off"].study.signals.lowpass.cutoff == pytest.approx(23, rel=0.1)
    assert "set torque_median: 1" in str(changed["torque median"].problem.notes)
    assert not isinstance(changed["recorded speeds"].study.signals.velocity, str)
    assert changed["drive commands"].estimate.units["FV1"] == "A*s/rad"
    assert changed["different rates"].observation.rates[:2] == (50.0, 62.5)
    assert len(changed["gaps"].records) == 2
