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
from runtime.core.errors import InputError
from runtime.core.estimation import estimated
from runtime.core.limits import LIMIT
from runtime.core.study import Study
from runtime.plausible.delay import delay as delay_of
from runtime.plausible.plausibility import plausibility as plausibility_of

CLOSE = 1e-12
"""Of the largest entry."""


@cache
def case_of(feature: str) -> Case:
    """The case of a feature; its files are read once."""
    with TemporaryDirectory() as folder:
        return FEATURES[feature](Path(folder))


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
    ranking = compose.compare(case.model, (case.study, case.records, case.unseen))
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
    found = compose.advise(case.model, case.records, quick(case.study), asked=(2e-3,), confirm=False)
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
    assert [check.sentence for check in found.checks] == [c.sentence for c in expected.checks]
    open_checks = [check.sentence for check in found.checks if check.state == "open"]
    if any(sentence.startswith(NOT_ASKED) for sentence in open_checks):
        raise InputError(open_checks[0])


def assess(case: Case, result: Any) -> None:
    """The parts of a report that are computed stand on the same rows; what is missing is missing by the table."""
    found = compose.assess(case.model, case.records, quick(case.study))
    same_rows(found.observation, result.observation)
    equal(found.estimate.X, result.estimate.X)
    if found.resolution is not None:
        same_reference(found.resolution.reference, result)
    if found.advice is not None:
        same_reference(found.advice.reference, result)
    if found.friction:
        asked = compose.identify(case.model, case.records, case.study, friction=True)
        for curve, expected in zip(found.friction, asked.friction, strict=True):
            equal(curve.f, expected.f)
            assert curve.law_name == expected.law_name
    allowed = [text for text, _ in MISSING.get(case.feature, ())]
    for sentence in found.missing:
        assert any(text in sentence for text in allowed), sentence


def quick(study: Study) -> Study:
    """The study with the cheapest question to the advisor: one law of rounding, no quadrature over phases."""
    return replace(study, cestac=replace(study.cestac, rounding="two-point"))
