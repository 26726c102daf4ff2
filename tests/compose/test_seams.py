"""Seams that gave wrong numbers or words: scalars of laws, force sensors, names of records, the median of CESTAC. Right values are those of the arm that is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from features import STRIBECK, arm, force_sensors, record, recorded_speeds, study

import runtime
import symgen
from runtime.compose import assess, cestac, compare, estimate
from runtime.ground.errors import InputError
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping

TRUE = {"vs1": 0.3, "vs2": 0.3}
SECONDS = 20.0
VALUES = ", STR1: 1.5, STR2: 0.8"


def laws(seed):
    """A record of the arm whose friction follows Stribeck's law, vs = 0.3 rad/s in truth."""
    return record(arm(STRIBECK, VALUES), seed, rate=500.0, seconds=SECONDS, **TRUE)


@pytest.fixture(scope="module")
def stribeck():
    """Model, a record, one that is predicted, and what identify says of them."""
    model = arm(STRIBECK, VALUES)
    fitted = laws(0)
    unseen = laws(1)
    result = runtime.identify(model, fitted, study(), further=[unseen], friction=True)
    return model, fitted, unseen, result


def test_every_call_has_the_scalars_of_laws_that_identify_fits(stribeck):
    model, fitted, unseen, result = stribeck
    assert result.estimate["STR1"] == pytest.approx(1.5, rel=0.02)
    assert result.model.CONSTANTS["vs1"] == pytest.approx(0.3, rel=0.01)
    error = result.estimate.relative_error
    assert error < 0.1
    assert estimate(model, fitted, study()).relative_error == pytest.approx(error, rel=1e-9)
    ranking = compare(model, {"as stated": (study(), fitted, unseen)})
    assert ranking.mean_errors["as stated"] == pytest.approx(result.prediction_error, rel=0.1)


def test_a_report_has_the_friction_and_the_cestac_of_the_fitted_laws(stribeck):
    model, fitted, _, result = stribeck
    whole = assess(model, fitted, study())
    assert [curve.law_name for curve in whole.part("friction").curves] == ["coulomb+viscous"] * 2
    for curve, expected in zip(
        whole.part("friction").curves, result.part("friction").curves, strict=True
    ):
        np.testing.assert_allclose(curve.f, expected.f, rtol=1e-9)
    reference = whole.part("resolution").reference
    error = whole.essential.estimate.relative_error
    assert reference.relative_error == pytest.approx(error, rel=1e-9)
    assert reference["STR1"] == pytest.approx(1.5, rel=0.02)


def test_every_call_has_the_force_sensors(tmp_path):
    case = force_sensors(tmp_path)
    result = runtime.identify(case.model, case.records, case.study, further=case.unseen)
    assert len(result.estimate.names) > len(case.model.BASE_PARAMETERS)
    alone = estimate(case.model, case.records, case.study)
    assert alone.names == result.estimate.names
    assert alone.method == "wls"
    ranking = compare(case.model, {"as stated": (case.study, case.records, case.unseen)})
    assert ranking.mean_errors["as stated"] == pytest.approx(result.prediction_error, rel=0.1)
    with pytest.raises(InputError, match="advice on encoders of joints does not support"):
        runtime.advise(case.model, case.records, case.study)


@pytest.mark.parametrize("name", ["run", "a part of the day", "[3] run"])
def test_a_name_decides_no_verdict(name):
    """A record that the model does not predict, whatever it is called."""
    model = arm()
    unseen = record(model, 1)
    wrong = replace(unseen, tau=1.6 * unseen.tau, name=name)
    result = runtime.identify(model, record(model, 0), study(), further=[wrong])
    (check,) = [
        check for check in result.checklist.checks if check.question.startswith("Does it predict")
    ]
    assert check.state == "no"
    assert check.limit.startswith("2.0 %")


def test_a_name_makes_no_record_simulated():
    model = arm()
    measured = replace(record(model, 0), name="SIMULATED? no, measured")
    result = runtime.identify(model, measured, study())
    assert result.source == "measured"
    assert "nothing was measured" not in str(result.estimate.provenance)


@pytest.mark.parametrize("median", [1, 5])
def test_cestac_compares_with_the_estimate_of_identify(tx40_data, median):
    """X_LS of the TX40 is the essential estimate of identify, whose positions and torques have a median, with that of the runs or without."""
    whole = study_from_mapping(dataset_study("tx40"))
    settings = replace(whole.cestac, delta=whole.cestac.delta[:1], runs=2, median=median)
    asked = replace(whole, cestac=settings)
    model = symgen.model("tx40")
    records = read_records(asked.record, model)
    found = runtime.essential(model, records, asked)
    reference = cestac(model, records, asked).reference
    assert reference.names == found.names
    np.testing.assert_allclose(reference.X, found.estimate.X, rtol=1e-12)


def test_steps_change_recorded_velocities_with_the_positions(tmp_path):
    """Runs of steps of nothing are the estimate of identify, and coarse steps move it as they move differences."""
    case = recorded_speeds(tmp_path)
    settings = replace(
        case.study.cestac, delta=(1e-9, 1e-3), runs=5, median=case.study.signals.median
    )
    asked = replace(case.study, cestac=settings)
    found = cestac(case.model, case.records, asked)
    assert found.reference.settings["signals"]["velocity"] != "auto"
    X = found.reference.X
    assert np.abs(found.levels[0].mean - X).max() < 1e-5 * np.abs(X).max()
    assert np.abs(found.levels[1].mean - X).max() > 1e-3 * np.abs(X).max()
