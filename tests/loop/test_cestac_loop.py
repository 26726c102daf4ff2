"""CESTAC with every estimator, on recorded positions and with the encoder inside the loop of the
planar arm.
"""

from dataclasses import replace

import numpy as np
import pytest
from campaign import campaign
from problems import loop_of_records
from test_closed_loop import ARM, arm, away  # noqa: F401  (arm is a fixture)

from runtime.compose import METHODS, cestac, estimate_of, observe, problem
from runtime.core.cestac.rounding import rounded, stream
from runtime.core.cestac.runs import Level
from runtime.core.study import EstimateSettings
from runtime.ground.errors import InputError, SettingsError
from runtime.loop.cestac import loop_of
from runtime.loop.simulation import Simulator
from runtime.parallel.processes import processes
from runtime.study import CestacSettings, study_from_mapping

STEP = 2e-4
TORQUE = {"saturation": None, "noise": 0.05}


@pytest.fixture(scope="module")
def study():
    settings = {"columns": "all", "rounding": "phase", "delta": [STEP], "runs": 2}
    return study_from_mapping(
        {**ARM, "cestac": settings, "controller": {**ARM["controller"], "torque": TORQUE}}
    )


@pytest.fixture(scope="module")
def simulator(arm, study):  # noqa: F811
    return Simulator(arm[0], study.controller)


@pytest.fixture(scope="module")
def record(arm, simulator):  # noqa: F811
    *_, truth, reference = arm
    return simulator.run(truth, reference, seed=5).record()


def method(study, name, **options):
    return replace(study, estimate=EstimateSettings(name, options=options))


def in_loop(study, **changed):
    return replace(study, cestac=replace(study.cestac, place="loop", **changed))


def test_robust_least_squares_on_rounded_positions(arm, study, record):  # noqa: F811
    """A run is the identification of the record with the positions of that draw."""
    robust = replace(
        method(study, "irls"), rows=replace(study.rows, low_speed=0.0)
    )  # else the rows of a run are those of the measured speeds
    found = cestac(arm[0], record, robust)
    q = rounded(record.q, STEP, "phase", stream(1, 0, 1))
    by_hand = estimate_of(observe(arm[0], replace(record, q=q), robust), robust.estimate)
    assert np.allclose(found.levels[0].runs[1].X, by_hand.X, rtol=1e-9)
    (note,) = found.notes  # of the rounding, not of the estimator
    assert found.reference.method == "irls" and note.startswith("Rounding phase")


@campaign
def test_instruments_on_rounded_positions(arm, study, record, simulator):  # noqa: F811
    model, *_, truth, _ = arm
    start = away(truth, model.BASE_PARAMETERS)
    instruments = method(study, "iv", start=start, gains="one")
    found = cestac(model, record, instruments, simulator=simulator)
    q = rounded(record.q, STEP, "phase", stream(1, 0, 0))
    selected = loop_of_records(model, [record], instruments, simulator).measured()
    by_hand = loop_of_records(model, [replace(record, q=q)], instruments, simulator).measured()
    assert np.allclose(
        found.levels[0].runs[0].X,
        estimate_of(by_hand, instruments.estimate, model=model).X,
        rtol=1e-6,
    )
    assert np.allclose(
        found.reference.X, estimate_of(selected, instruments.estimate, model=model).X, rtol=1e-9
    )
    i = found.names.index("ZZ1R")
    assert found.levels[0].e[i] < cestac(model, record, study).levels[0].e[i] / 2
    assert "place: loop" in found.notes[0]


@campaign
def test_didim_does_not_see_recorded_positions_and_says_so(arm, study, record, simulator):  # noqa: F811
    model, *_, truth, _ = arm
    found = cestac(
        model,
        record,
        method(study, "didim", start=away(truth, model.BASE_PARAMETERS), gains="one"),
        simulator=simulator,
    )
    i = found.names.index("ZZ1R")
    assert found.levels[0].e[i] < 0.1 < cestac(model, record, study).levels[0].e[i]
    assert "uses only the first recorded position" in found.notes[0]
    assert found.estimator == "DIDIM" and "DIDIM" in found.mean_table().to_text()


@campaign
def test_the_encoder_in_the_loop_has_a_random_phase(arm, study, simulator):  # noqa: F811
    """Positions of a run lie on phi + k Delta; the arm answers them; the run is least squares of
    that record.
    """
    model, *_ = arm
    asked = in_loop(study)
    loop = loop_of(problem(model, (), asked, simulator=simulator), simulator)
    fine, coarse = (loop.simulated(Level(step), (0, 0)).parts[0].record for step in (1e-7, STEP))
    phases = (coarse.q / STEP) % 1
    assert np.allclose(phases, phases[0], atol=1e-6) and abs(phases[0, 0] - phases[0, 1]) > 0.01
    assert np.abs(coarse.tau - fine.tau).max() > 1  # N m: 400 N m/rad and differences over 0.25 ms
    found = cestac(model, (), asked, simulator=simulator)
    rows = loop.simulated(Level(STEP), (1, 1)).measured()
    X, *_ = np.linalg.lstsq(rows.W, rows.Y, rcond=None)
    assert len(found.levels) == 1 and np.allclose(found.levels[0].runs[1].X, X, rtol=1e-7)
    exact = [loop.simulated(Level(0.0), (0, run)).measured() for run in range(2)]
    mean = np.mean([np.linalg.lstsq(o.W, o.Y, rcond=None)[0] for o in exact], axis=0)
    assert np.allclose(found.reference.X, mean, rtol=1e-7)
    assert found.settings["controller"]["rate"] == 4000


@campaign
def test_didim_sees_the_encoder_in_the_loop(arm, study, simulator):  # noqa: F811
    model, *_, truth, _ = arm
    asked = in_loop(method(study, "didim", start=away(truth, model.BASE_PARAMETERS), gains="one"))
    asked = replace(asked, rows=replace(asked.rows, around=0.05))
    found = cestac(model, (), asked, simulator=simulator)
    assert found.levels[0].e[found.names.index("ZZ1R")] > 0.2


@campaign
def test_other_processes_simulate_the_same_loop(arm, study, simulator):  # noqa: F811
    one = cestac(arm[0], (), in_loop(study), simulator=simulator)
    with processes(2) as several:
        two = cestac(arm[0], (), in_loop(study), simulator=simulator, map=several)
    assert np.allclose(
        [run.X for run in one.levels[0].runs], [run.X for run in two.levels[0].runs], rtol=1e-9
    )


def test_what_cannot_be_asked(arm, study, record):  # noqa: F811
    for changed, words in (
        ({"uneven": 0.1}, "uneven lines need rounding: phase"),
        ({"rounding": "phase", "common": True}, "set common: false"),
        ({"place": "loop"}, "expected phase, the only rounding of an encoder in the loop"),
        ({"place": "loop", "rounding": "phase", "uneven": 0.1}, "has even lines"),
        ({"place": "loop", "rounding": "phase", "torque": [0.1]}, "controller.torque.step"),
    ):
        with pytest.raises(SettingsError, match=words):
            CestacSettings(**changed)
    with pytest.raises(
        SettingsError, match="didim simulates the closed loop, but this study does not describe it"
    ):
        cestac(arm[0], record, replace(method(study, "didim"), controller=None))
    with pytest.raises(SettingsError, match="place: loop simulates the closed loop"):
        cestac(arm[0], (), replace(in_loop(study), controller=None))
    once = method(study, "iv", passes=1, start=away(arm[3], arm[0].BASE_PARAMETERS), gains="one")
    with pytest.raises(InputError, match="iv finds no estimate from the measured record"):
        cestac(arm[0], record, once)


@pytest.mark.parametrize("name", ["iv", pytest.param("didim", marks=campaign)])
def test_a_simulating_method_under_another_name_is_the_method(
    arm,  # noqa: F811
    study,
    record,
    simulator,
    monkeypatch,
    name,
):
    monkeypatch.setitem(METHODS, "twinned", METHODS[name])
    expected, found = (
        cestac(arm[0], record, method(study, own), simulator=simulator).to_json()
        for own in (name, "twinned")
    )
    assert name in expected and found.replace("twinned", name) == expected
