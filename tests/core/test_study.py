"""Settings: defaults of the chapter, round trip, arithmetic, and errors that say which key."""

import math
import pickle
import re
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from runtime.compose import METHODS, complete_study
from runtime.core.study import Lowpass
from runtime.ground import settings_errors
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings import number, to_mapping
from runtime.ground.settings_errors import WENT
from runtime.reading.datasets import DATASETS, dataset_study
from runtime.study import (
    CestacSettings,
    Rows,
    Signals,
    Study,
    load_study,
    study_from_mapping,
    study_from_text,
    study_of,
)

DESIGN = """
symgen: 1
record:   {files: [q.csv.gz, tau.csv.gz], columns: {q: [Joint_1, Joint_2], tau: [Joint_1, Joint_2]}, side: motor, rate: 5000, units: {q: rad, tau: N*m}}
signals:  {median: 5, lowpass: {cutoff: 50, order: 4, on: [q, qd]}, ends: one-sided, decimate: {factor: auto, phase: first}}
rows:     {window: [0, 7.5], trim: 3, low_speed: 0}
estimate: {method: ols, weights: none, columns: all}
essential: {threshold: 1.04}
validate: {split: [[0, 3.7], [3.7, 7.5]]}
cestac:   {side: joint, rounding: two-point, delta: [2*pi/10000, 2*pi/5000, 2*pi/2000, 2*pi/1000], runs: 5, seed: 1, columns: essential, torque: null}
controller: {law: {kind: cascade, kp: 160.18}}
"""


def test_defaults_are_those_of_the_chapter_but_for_the_cutoff():
    study = Study()
    assert (
        study.signals.lowpass.cutoff,
        study.signals.lowpass.order,
        study.signals.lowpass.on,
    ) == ("auto", 4, ("q", "qd"))
    assert study.signals.lowpass.hertz == 50
    assert study.signals.decimate.factor == "auto"
    assert study.essential.threshold == 1.04
    assert study.cestac.runs == 5
    assert study.cestac.delta == tuple(2 * math.pi / k for k in (10000, 5000, 2000, 1000))


def test_study_file_of_the_design():
    study = study_from_text(DESIGN)
    defaults = study_from_mapping({"signals": {"lowpass": {"cutoff": 50}}})
    assert (study.signals, study.estimate, study.essential, study.cestac) == (
        defaults.signals,
        defaults.estimate,
        defaults.essential,
        defaults.cestac,
    )
    assert study.record[0].files == ("q.csv.gz", "tau.csv.gz") and study.record[0].side == "motor"
    assert study.rows.window == (0, 7.5)
    assert study.controller.law.kp == 160.18 and study.controller.delay == 0


@pytest.mark.parametrize(
    "study",
    [
        Study(),
        study_from_text(DESIGN),
        *(study_from_mapping(dataset_study(name)) for name in DATASETS),
    ],
)
def test_written_settings_read_back(study):
    mapping = to_mapping(study)
    assert study_from_mapping(mapping) == study
    assert set(mapping) == {
        "symgen",
        "record",
        "signals",
        "rows",
        "estimate",
        "essential",
        "validate",
        "cestac",
        "payload",
        "robot",
        "controller",
        "excitation",
    }
    assert set(mapping["signals"]) == {
        "velocity",
        "median",
        "lowpass",
        "ends",
        "decimate",
        "reader",
        "step",
        "side",
        "torque_median",
        "options",
    }  # complete, defaults filled


def test_a_filter_is_switched_off_by_null():
    study = study_from_text("signals: {lowpass: null, decimate: null, median: 1}")
    assert study.signals.lowpass is None and study.signals.decimate is None


def test_one_record_or_several():
    assert len(study_from_text("record: {files: a.csv}").record) == 1
    assert [
        r.files for r in study_from_text("record: [{files: a.csv}, {files: b.csv}]").record
    ] == [("a.csv",), ("b.csv",)]


@pytest.mark.parametrize(
    ("mapping", "path", "said"),
    [
        ({"signal": {}}, ("signal",), "unknown key signal; known: symgen, record, signals"),
        (
            {"signals": {"lowpas": 1}},
            ("signals", "lowpas"),
            "known: median, lowpass, ends, decimate",
        ),
        ({"signals": {"median": 4}}, ("signals", "median"), "odd window"),
        ({"signals": {"median": 2.5}}, ("signals", "median"), "expected an integer"),
        (
            {"signals": {"lowpass": {"cutoff": "fast"}}},
            ("signals", "lowpass", "cutoff"),
            "expected a number",
        ),
        (
            {"signals": {"lowpass": {"cutoff": -1}}},
            ("signals", "lowpass", "cutoff"),
            "expected more than 0",
        ),
        (
            {"signals": {"lowpass": {"on": ["qdd"]}}},
            ("signals", "lowpass", "on", 0),
            "expected q or qd",
        ),
        (
            {"signals": {"decimate": {"factor": 0}}},
            ("signals", "decimate", "factor"),
            "0; expected at least 1 or auto",
        ),
        ({"rows": {"window": [1, 0]}}, ("rows", "window"), "the earlier time first"),
        ({"rows": {"window": [1]}}, ("rows", "window"), "1 values; expected at least 2"),
        ({"rows": {"low_speed": "slow"}}, ("rows", "low_speed"), "expected a number"),
        (
            {"estimate": {"method": "magic"}},
            ("estimate", "method"),
            "expected ols, wls, feasible, irls, iv or didim",
        ),
        ({"essential": {"threshold": 1}}, ("essential", "threshold"), "expected more than 1"),
        (
            {"record": [{"files": "a"}, {"side": "left"}]},
            ("record", 1, "side"),
            "expected motor, joint or link",
        ),
        ({"record": {"rate": True}}, ("record", "rate"), "expected a number"),
        (
            {"record": {"units": {"q": "counts"}}},
            ("record", "counts_per_revolution"),
            "counts need this key",
        ),
        ({"cestac": {"runs": 1}}, ("cestac", "runs"), "at least 2"),
        (
            {"cestac": {"delta": [1e-3, float("inf")]}},
            ("cestac", "delta", 1),
            "inf; expected a finite number",
        ),
        ({"symgen": 2}, ("symgen",), "this version of symgen reads schema 1"),
        ({"validate": {"split": [[0, 1]]}}, ("validate", "split"), "at least two"),
    ],
)
def test_errors_give_the_path(mapping, path, said):
    with pytest.raises(SettingsError) as e:
        complete_study(study_from_mapping(mapping))
    assert e.value.path[: len(path)] == path or e.value.path == path[:-1]
    assert said in str(e.value)


def test_a_setting_that_went_names_what_to_use_instead():
    for name, said in WENT.items():
        key, _, value = name.partition(": ")
        mapping = value or "auto"
        for part in reversed(key.split(".")):
            mapping = {part: mapping}
        with pytest.raises(SettingsError) as e:
            study = complete_study(study_from_mapping(mapping))
            settings = replace(study.estimate, method="feasible")  # the method reads its options
            METHODS["feasible"].checked(settings)
        assert (e.value.path, e.value.reason) == (tuple(key.split(".")), said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("old: 3\n", "line 1: old: read whole"),
        ("rows: {trim: 1}\nrecord:\n- {files: a}\n- {old: 1}\n", "line 4: record[1].old: by name"),
        ("record: {old: 1}\n", "line 1: record.old: by name"),
    ],
)
def test_what_went_is_told_from_what_is_unknown(monkeypatch, text, said):
    went = {"old": "read whole", "record.old": "by name"}
    monkeypatch.setattr(settings_errors, "WENT", went)
    with pytest.raises(SettingsError, match=re.escape(said)):
        study_from_text(text)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (
            "symgen: 1\nsignals:\n  lowpass: {cutoff: 50,\n    order: four}\n",
            4,
            "signals.lowpass.order",
        ),
        ("record:\n- files: a\n- files: b\n  side: 3\n", 4, "record[1].side"),
        ("cestac:\n  delta:\n  - 1e-3\n  - 2*qi\n", 4, "cestac.delta[1]"),
        ("rows: {window: [0,\n", 2, "not YAML"),
        ("rows: {trim: 1}\nrows: {trim: 2}\n", 2, "given twice"),
        ("rows: 3", 1, "expected a mapping"),
    ],
)
def test_errors_of_a_file_give_the_line(text, line, said):
    with pytest.raises(SettingsError) as e:
        study_from_text(text, file="arm.study.yaml")
    assert e.value.line == line and said in str(e.value) and "arm.study.yaml" in str(e.value)


@pytest.mark.parametrize(
    "text", ["a: !!python/object/apply:os.getcwd []", "a: &a [*a]", "- 1", "a: 2024-01-01", "\x00"]
)
def test_other_content_is_refused(text):
    with pytest.raises(InputError):
        study_from_text(text)


def test_an_alias_bomb_is_refused():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"] + [
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)
    ]
    with pytest.raises(InputError, match="anchors and aliases"):
        study_from_text("\n".join(lines))


def test_load_study(tmp_path):
    (tmp_path / "arm.yaml").write_text(DESIGN, encoding="utf-8")
    assert load_study(tmp_path / "arm.yaml") == study_from_text(DESIGN)
    with pytest.raises(InputError, match="cannot be read"):
        load_study(tmp_path / "none.yaml")


def test_record_on_a_command_line(tmp_path):
    (tmp_path / "arm.yaml").write_text(DESIGN, encoding="utf-8")
    assert study_of(str(tmp_path / "arm.yaml")) == (study_from_text(DESIGN), tmp_path)
    assert study_of("emps")[0] == study_from_mapping(dataset_study("emps"))
    study, folder = study_of(str(tmp_path / "run.csv.gz"))
    assert (
        study.record[0].files == ("run.csv.gz",)
        and study.record[0].side == "joint"
        and folder == tmp_path
    )
    with pytest.raises(InputError, match="expected a dataset"):
        study_of("rx90")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2*pi/10000", 2 * math.pi / 10000),
        ("-3", -3),
        ("1e-3", 1e-3),
        ("(1 + 2)*3", 9),
        ("2**-3", 0.125),
        (" 4 ", 4),
        ("+pi", math.pi),
    ],
)
def test_arithmetic(text, value):
    assert number(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "pi()",
        "2pi",
        "1/0",
        "10**400",
        "9**9**9**9",
        "(-1)**0.5",
        "1j",
        "True",
        "[1]",
        "__import__('os')",
        "1 if 1 else 2",
        "1,2",
        "'a'",
        "(" * 150,
        "1" * 300,
    ],
)
def test_arithmetic_refuses(text):
    with pytest.raises(ValueError, match=r"number|value|allowed"):
        number(text)


def test_words_that_run_into_numbers_warn_nobody(recwarn):
    for text in ("1if 1else 2", "0xfor x", "30rpm"):
        with pytest.raises(ValueError, match=r"number|allowed"):
            number(text)
    assert not recwarn.list


def test_a_file_is_a_text_or_a_path(tmp_path):
    """load_study("s.yaml") failed on texts."""
    path = tmp_path / "arm.yaml"
    path.write_text(DESIGN, encoding="utf-8")
    assert load_study(str(path)) == load_study(path)
    assert study_of(path) == study_of(str(path))


def test_settings_made_in_python_are_checked():
    for make, said in (
        (lambda: Lowpass(cutoff=-1), "cutoff: -1; expected more than 0"),
        (lambda: Lowpass(50, 4, ("q", "qdd")), r"on[1]: 'qdd'; expected q or qd"),
        (lambda: Lowpass(frequency=50), "unknown key frequency; known: cutoff, order, on, padding"),
        (lambda: Rows((0, 1), 3, 0.0, 0.0, 5), "Unexpected positional argument"),
        (lambda: Signals(lowpass=3), "lowpass: 3; expected a mapping with some of cutoff"),
    ):
        with pytest.raises(SettingsError) as e:
            make()
        assert said in str(e.value)


def test_numbers_of_numpy_are_numbers():
    study = Study(
        cestac=CestacSettings(delta=np.array([1e-3, 2e-3]), runs=np.int64(3)),
        rows=Rows(low_speed=np.float32(0.5)),
    )
    assert (study.cestac.delta, study.cestac.runs, study.rows.low_speed) == ((1e-3, 2e-3), 3, 0.5)


def test_settings_are_values():
    study = study_from_text(DESIGN)
    assert hash(study.rows) == hash(study_from_text(DESIGN).rows)
    assert study == pickle.loads(pickle.dumps(study))  # noqa: S301
    assert replace(study, rows=replace(study.rows, trim=0)).rows == Rows(
        window=(0, 7.5), trim=0, low_speed=0
    )
    with pytest.raises(FrozenInstanceError):
        study.rows = Rows()


def test_a_gear_ratio_belongs_into_the_robot_file() -> None:
    with pytest.raises(SettingsError, match=r"record\.ratio: write gear ratios in the robot file"):
        study_from_mapping({"record": {"files": ["a.csv"], "ratio": [100, 80]}})
