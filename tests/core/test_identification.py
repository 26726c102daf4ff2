"""`runtime.identify` and `runtime.report` from Python: records and streams mixed, records of one
name, everything asked for in one result.
"""

import json
import pydoc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from campaign import campaign

import runtime
import runtime.core.rows.prepared
import runtime.core.signals.reader
from runtime import InputError
from runtime.compose import assess
from runtime.core.provenance import origin, record_names
from runtime.core.record import Origin
from runtime.core.rows.tape import Tape
from runtime.core.study import Lowpass
from runtime.study import Signals, located, study_from_mapping, study_text

GENERATED = Path(__file__).resolve().parents[2] / "generated"
STUDY = study_from_mapping(
    {"signals": {"lowpass": {"cutoff": 20}}, "cestac": {"runs": 2, "delta": "2*pi/5000"}}
)


@pytest.fixture(scope="module")
def model():
    return runtime.load_model(GENERATED / "planar_2r.py")


def measured(model, seed, name="run", rate=200):
    """8 s of the planar arm with torque noise; another motion for each seed."""
    t = np.arange(8 * rate)[:, None] / rate
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * np.array([[0.3, 0.4], [0.7, 0.9], [1.6, 1.3]])[:, None]
    amplitude = np.array([[0.8, 0.9], [0.4, 0.3], [0.1, 0.15]])[:, None]
    phase = w * t + rng.uniform(0, 2 * np.pi, (3, 1, 2))
    q, qd, qdd = (
        (amplitude * np.sin(phase)).sum(0),
        (amplitude * w * np.cos(phase)).sum(0),
        -(amplitude * w**2 * np.sin(phase)).sum(0),
    )
    tau = model.inverse_dynamics(
        q, qd, qdd, model.base_parameters(model.VALUES)
    ) + 0.05 * rng.standard_normal(q.shape)
    return runtime.Record(t[:, 0], q, tau, name=name)


@pytest.mark.parametrize("rates", [(250, 125), (1000, 100)])
def test_records_of_different_rates(model, rates):
    """Fitted together; true values within four of their deviations."""
    records = [measured(model, seed, f"run {seed}", rate) for seed, rate in enumerate(rates)]
    estimate = runtime.identify(model, records, plausible=False).sets["essential"]
    true = dict(zip(model.BASE_PARAMETERS, model.base_parameters(model.VALUES), strict=True))
    error = np.abs([x - true[name] for name, x in zip(estimate.names, estimate.X, strict=True)])
    assert (error < 4 * estimate.sigma).all()


def test_one_record_without_a_study(model):
    """The five lines of a notebook: every part of the result, as text and as HTML."""
    result = runtime.identify(model, measured(model, 0))
    assert (
        result.estimate.names == model.BASE_PARAMETERS
        and result.model_estimate is result.sets["feasible"]
    )
    assert (
        result.checklist.state in ("good", "doubtful", "no") and len(result.checklist.checks) >= 8
    )
    for shown in (result, result.checklist, result.estimate):
        root = ElementTree.fromstring(shown._repr_html_())
        assert root.find("table") is not None
    assert result.verdict in str(result) and str(result.checklist).startswith(
        result.checklist.answer
    )


def test_work_is_done_once(model, monkeypatch):
    """One evaluation of W, one pass of the filters; W beside its torques is factored once."""
    evaluated, filtered, factored, positions = [], [], [], measured(model, 0)

    def regressor(q, qd, qdd, **options):
        evaluated.append(len(q))
        return model.regressor(q, qd, qdd, **options)

    drives = {
        "ratio": [[10.0, 0.0], [5.0, 10.0]],
        "offset": [0.0, 0.0],
        "torque_constant": [1.0, 1.0],
    }
    coupled = SimpleNamespace(**{**vars(model), "DRIVES": drives, "regressor": regressor})
    keep = {"filtered_states": filtered, "joint_factors": factored}
    for place in (
        "runtime.core.signals.reader.filtered_states",
        "runtime.core.rows.observation.joint_factors",
    ):
        calls, real = keep[place.rpartition(".")[2]], pydoc.locate(place)
        monkeypatch.setattr(
            place, lambda *given, calls=calls, real=real: calls.append(given) or real(*given)
        )
    taped, evaluate = [], Tape.evaluate
    monkeypatch.setattr(
        Tape, "evaluate", lambda tape, q, *x: taped.append(len(q)) or evaluate(tape, q, *x)
    )
    study = study_from_mapping(
        {"record": {"files": "run.npz", "side": "motor"}, "signals": {"lowpass": {"cutoff": 20}}}
    )
    result = runtime.identify(coupled, positions, study)
    N = len(positions) - 2 * 30  # 3/cutoff at each end
    assert sum(taped) == N
    assert max(evaluated, default=0) <= 64  # which tell equal entries apart
    assert len(filtered) == 1
    W = result.observation.W
    assert [Y is result.observation.Y for of, Y, *_ in factored if of is W] == [True]
    assert sum(len(of) == len(W) for of, *_ in factored) == 1


def test_a_record_is_filtered_once_for_all_checks(model, monkeypatch):
    """Identification, plausibility, delay, friction, and the advice on encoders share what the
    filters of the study made of the record. Plausibility filters it by a cut-off of its own, which
    is that of the study here.
    """
    passes, real, record = [], runtime.core.signals.reader.filtered_states, measured(model, 0)

    def counted(q, rate, signals, v=None):
        if np.array_equal(q, record.q):  # not the positions of other encoders
            passes.append((signals.median, signals.lowpass))
        return real(q, rate, signals, v)

    monkeypatch.setattr("runtime.core.signals.reader.filtered_states", counted)
    lowpass = Lowpass(cutoff=5)
    study = replace(STUDY, signals=Signals(median=1, lowpass=lowpass))
    result = assess(model, record, study)
    assert all(result.part(name) for name in ("plausibility", "friction", "advice"))
    assert result.part("resolution") is not None and str(result) and result.remarks is not None
    assert passes.count((1, lowpass)) == 2, passes


def test_records_of_one_name_stay_apart(model):
    """Keyed by name, the second of two further records overwrote the first, and time stamps were
    those of the last.
    """
    first, second = measured(model, 3), measured(model, 4)
    assert record_names([first, second, first]) == ("run", "run (2)", "run (3)")
    result = runtime.identify(model, first, STUDY, further=[first, second])
    parts = [p.part for p in result.validation[1].predictions if p.columns == "all"]
    assert len(result.validation[1].predictions) == 9 and len(set(parts)) == 3
    both = runtime.identify(model, [first, second], STUDY)
    assert both.name == "run, run (2)" and both.estimate.provenance["records"] == ["run", "run (2)"]
    assert [one.name for one in both.record_errors] == ["run", "run (2)"]
    stamped = [
        replace(first, name="run", origin=Origin(time="uniform")),
        replace(first, name="run", origin=Origin(time="a gap")),
    ]
    assert origin(stamped)["time"] == {"run": "uniform", "run (2)": "a gap"}


@campaign
def test_report_writes_what_the_verbs_write(model, tmp_path):
    result = assess(model, measured(model, 5), STUDY, encoder=(1e-4,))
    assert result.missing == () and result.part("feasibility").judged is not None
    assert len(result.part("friction").curves) == 2
    assert (
        result.checklist.checks[-1].state != "open" and result.checklist.checks[-2].state != "open"
    )
    paths = runtime.report(result, str(tmp_path / "out"))
    names = {path.name for path in paths}
    assert {
        "report.html",
        "estimate.json",
        "friction.png",
        "advice.json",
        "cestac.json",
        "study.yaml",
        "parameters.tex",
    } <= names
    assert names == {path.name for path in (tmp_path / "out").iterdir()}
    written = json.loads((tmp_path / "out" / "estimate.json").read_text())
    assert (
        written["X"] == result.estimate.X.tolist()
        and written["feasibility"]["feasible"]
        and len(written["friction"]) == 2
    )
    study = runtime.report(result.part("resolution"), tmp_path / "resolution", study=STUDY)
    assert "resolution.png" in {path.name for path in study} and "report.html" in {
        path.name for path in study
    }
    with pytest.raises(InputError, match="float cannot be written to files"):
        runtime.report(1.0, tmp_path / "wrong")
    assert not (tmp_path / "wrong").exists()


def test_files_of_a_study_follow_it(tmp_path):
    """Relative to the folder where it is written; the file of the controller's reference stayed
    behind.
    """
    study = study_from_mapping({
        "record": {"files": ["q.csv", "tau.csv"]}, "validate": {"record": {"files": ["b.csv"]}},
        "payload": {"record": {"files": ["loaded.csv"]}}, "controller": {"reference": {"file": "motion.csv"}},
    })  # fmt: skip
    here = located(study, tmp_path / "in")
    assert here.record[0].files == (
        str(tmp_path / "in" / "q.csv"),
        str(tmp_path / "in" / "tau.csv"),
    )
    text = study_text(here, tmp_path / "out")
    for file in ("q.csv", "tau.csv", "b.csv", "loaded.csv", "motion.csv"):
        assert f"../in/{file}" in text
    assert str(tmp_path) not in text
    dataset = study_from_mapping({"record": {"dataset": "emps", "files": ["DATA_EMPS.mat"]}})
    assert located(dataset, tmp_path).record == dataset.record


def test_undetermined_parameters_end_the_assessment(model):
    record = measured(model, 6)
    still = replace(record, q=np.column_stack([record.q[:, 0], np.zeros(len(record))]))
    result = assess(model, still, STUDY)
    assert (
        not result.determined
        and result.checklist.state == "no"
        and "does not determine" in result.missing[-1]
    )


def test_torques_that_are_currents_are_asked_about(model):
    """Currents of a drive of 12 N m/A run like the torques of the file's values at a twelfth of
    their size; true torques raise no question.
    """
    record = measured(model, 0)
    assert not any("currents" in sentence for sentence in runtime.identify(model, record).warnings)
    result = runtime.identify(model, runtime.Record(record.t, record.q, record.tau / 12))
    (question,) = (sentence for sentence in result.warnings if "currents" in sentence)
    assert (
        question.startswith(
            "the torques of joint 1, 2 run like those of the values in the robot file at 0.08"
        )
        and "units.tau: A" in question
    )
    bare = SimpleNamespace(**{**vars(model), "VALUES": {}})
    assert not any(
        "currents" in sentence
        for sentence in runtime.identify(
            bare, runtime.Record(record.t, record.q, record.tau / 12)
        ).warnings
    )


def test_records_that_do_not_belong_together_are_told_in_a_sentence(model):
    """A record with other joints, one of another robot, and one that rests."""
    record = measured(model, 1)
    other = runtime.Record(
        record.t,
        np.column_stack([record.q, record.q[:, :1]]),
        np.column_stack([record.tau, record.tau[:, :1]]),
        name="other",
    )
    for given in ({"records": other}, {"records": record, "further": [other]}):
        with pytest.raises(
            InputError, match="other: the record has 3 joints, but planar_2r has 2; give a record"
        ):
            runtime.identify(model, study=STUDY, **given)
    still = replace(record, q=np.tile(record.q[:1], (len(record), 1)), name="still")
    moving = replace(STUDY, rows=replace(STUDY.rows, low_speed=0.01))
    with pytest.raises(
        InputError,
        match=(
            r"still: none of the \d+ rows per joint is used: rows.trim leaves out 3?\d, "
            r"rows.low_speed leaves out"
        ),
    ):
        runtime.identify(model, [record, still], moving)
    heavier = replace(measured(model, 2), tau=3 * measured(model, 2).tau, name="heavier")
    result = runtime.identify(model, record, STUDY, further=[heavier])
    assert result.checklist.state == "no" and not result.part("homogeneity").agree
    assert "another robot, load or wiring" in result.checklist.next


def test_joints_of_which_no_row_is_left_are_told(model):
    """low_speed in degrees a second: too few rows for any test, and one sentence says why."""
    record = measured(model, 1)
    fastest = np.abs(np.gradient(record.q[:, 1], 1 / record.rate)).max()
    study = replace(STUDY, rows=replace(STUDY.rows, low_speed=(1e3, 0.97 * fastest)))
    result = runtime.identify(model, record, study, physical=True)
    assert result.part("feasibility").judged is None
    assert any("physical consistency: the record does not determine" in x for x in result.missing)
    assert (
        result.warnings[0] == "No row of joint 1 is used: rows.low_speed leaves all these rows out."
    )
    assert result.estimate.status == "rank-deficient"


def test_the_status_of_every_method_decides(model):
    """Not converged is no value, whatever the rest says."""
    result = runtime.identify(model, measured(model, 1), STUDY)
    assert (
        result.usable
        and list(result.sets) == ["essential", "all", "feasible"]
        and result.ranking.startswith("Predicts a part of the record")
    )
    unfinished = replace(
        result.estimate,
        status="not-converged",
        message="DIDIM has not converged after 3 passes. More.",
    )
    bad = replace(result, sets=replace(result.sets, all=unfinished))
    assert not bad.usable and bad.checklist.state == "no"
    assert bad.verdict == (
        "No values of planar_2r: ols ended with status not-converged. DIDIM has not converged "
        "after 3 passes."
    )


def test_a_number_in_the_name_of_a_record_is_kept(model):
    """A record called "run (1 of 2)" is no piece of another; pieces of one record at gaps share its sentence."""
    first = measured(model, 1)
    stamps = [replace(first, name="run (1 of 2)", origin=Origin(time="regular"))]
    for piece in ("gap (1 of 2)", "gap (2 of 2)"):
        stamps.append(replace(first, name=piece, origin=Origin(time="regular", whole="gap")))
    result = runtime.identify(model, stamps)
    assert [text.split(":")[0] for text in result.remarks] == [
        "Time stamps of run (1 of 2)",
        "Time stamps of gap",
        "Low-pass at 11 Hz (cutoff",
    ]


@pytest.mark.parametrize("name", ["b", "a part of the day", "[3] run"])
def test_the_name_of_a_validation_record_decides_nothing(model, name):
    """A record called "a part of the day" was judged by the limit of half a record."""
    bad = replace(measured(model, 2), tau=1.6 * measured(model, 2).tau, name=name)
    result = runtime.identify(model, measured(model, 1), STUDY, further=[bad])
    check = next(c for c in result.checklist.checks if c.question.startswith("Does it predict"))
    assert check.state == "no" and check.limit.startswith("2.0 %") and result.unseen == name


def test_the_name_of_a_measured_record_makes_it_no_simulated_one(model):
    named = measured(model, 1, "SIMULATED? no, measured")
    result = runtime.identify(model, named, STUDY)
    assert result.source == "measured" and "note" not in result.estimate.provenance
    made = replace(named, origin=Origin(simulated=True))
    assert runtime.identify(model, made, STUDY).source == "simulated"
