"""Parts of a report against what was not written for it: CAD values, extremes of long records,
names, the checklist and its limits.
"""

import base64
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.advisor.advice import answer
from runtime.compose import METHODS, judged
from runtime.core.essential import lost_joints
from runtime.core.least_squares.estimate import Estimate, JointFit
from runtime.core.model import load_model
from runtime.core.result import Identification
from runtime.core.study import Decimate
from runtime.core.validation import JointComparison
from runtime.expected import Expected, expected_off
from runtime.ground.check import Check, state_of
from runtime.ground.markup import split, symbol, unit
from runtime.ground.part import Part
from runtime.ground.table import percentage
from runtime.physical.consistency import Consistency
from runtime.reporting.pages import checks_section, settings_section
from runtime.reporting.parameters import (
    cad_values,
    correlation_matrix,
    every_section,
    parameter_section,
)
from runtime.reporting.sections import (
    decimation_cutoff,
    other_torques_section,
    probability,
    torque_section,
)
from runtime.reporting.series import extremes, gaps, series
from runtime.study import Signals
from runtime.verdict.questions import certain, separate
from symgen.symbols.printers import letter as other_symbol

GENERATED = Path(__file__).resolve().parents[2] / "generated"
ROBOTS = ("tx40", "haptic", "panda", "emps", "sr400")


@pytest.fixture(scope="module")
def models():
    return {name: load_model(GENERATED / f"{name}.py") for name in ROBOTS}


@pytest.mark.parametrize("name", ROBOTS)
def test_names_are_split_as_on_the_page_of_a_robot(models, name):
    """The rule stands twice, since neither package may import the other."""
    model = models[name]
    for parameter in (*model.BASE_PARAMETERS, *model.STANDARD_PARAMETERS, *model.CONSTANTS):
        assert split(parameter) == other_symbol(parameter)


def test_words_are_no_names_with_an_index():
    assert symbol("mass_1") == "<var>mass<sub>1</sub></var>" and symbol("left") == "<var>left</var>"
    assert (unit("kg*m**2"), unit("N*m*s/rad")) == ("kg\u00a0m²", "N\u00a0m\u00a0s/rad")


@pytest.mark.parametrize("name", ["tx40", "haptic", "emps"])
def test_cad_values_are_those_of_the_emitted_formulas(models, name):
    model = models[name]
    expected = model.base_parameters(model.VALUES)
    assert list(cad_values(model)) == list(model.BASE_PARAMETERS)
    np.testing.assert_allclose(list(cad_values(model).values()), expected, rtol=1e-12, atol=1e-15)


def test_cad_values_where_some_are_unknown(models):
    """A base parameter has a CAD value where every standard parameter of its formula has one."""
    model = models["tx40"]
    part = SimpleNamespace(**vars(model))
    part.VALUES = {n: v for n, v in model.VALUES.items() if n not in ("M5", "XY2")}
    missing = {
        n
        for n in model.BASE_PARAMETERS
        if {"M5", "XY2"} & set(re.findall(r"\w+", model.FORMULAS.get(n, n)))
    }
    assert (
        set(cad_values(part)) == set(model.BASE_PARAMETERS) - missing and {"ZZ1R", "XY2"} <= missing
    )
    assert cad_values(models["panda"]) == {}


@pytest.mark.parametrize("N", [5, 400, 401, 12345])
def test_extremes_survive(N):
    values = np.random.default_rng(N).normal(size=(3, N)).cumsum(axis=1)
    kept = extremes(values, 400)
    assert len(kept) <= 400 and kept[0] == 0 and kept[-1] == N - 1 and (np.diff(kept) > 0).all()
    np.testing.assert_array_equal(values[:, kept].min(axis=1), values.min(axis=1))
    np.testing.assert_array_equal(values[:, kept].max(axis=1), values.max(axis=1))
    spike = values.copy()
    spike[1, N // 3] = 1e6
    assert N // 3 in extremes(spike, 400)


def test_series_break_at_gaps_and_are_float32():
    t = np.r_[np.arange(3000) * 1e-3, 5 + np.arange(3000) * 1e-3] + 1e6
    joint = JointComparison("1", t, np.sin(t), np.zeros(6000))
    found = series(joint, "N m", "measured", most=600)
    assert list(gaps(t)) == [3000] and found.total == 6000 and np.isnan(found.t).sum() == 1
    data = found.data
    stored = np.frombuffer(base64.b64decode(data["t"]), "<f4") + data["start"]
    finite = np.isfinite(found.t)
    np.testing.assert_allclose(
        stored[finite], found.t[finite], atol=1e-5
    )  # s: float32 counts from the start
    assert np.diff(found.t[finite]).min() > 0 and data["start"] == pytest.approx(1e6)


def test_cut_off_of_the_decimation():
    """0.8 of half the rate of the rows, as scipy's decimate."""
    found = SimpleNamespace(
        study=SimpleNamespace(signals=Signals()),
        observation=SimpleNamespace(rate=125.0, settings={"factor": 40}),
    )
    assert decimation_cutoff(found) == 50.0
    found.observation.settings = {"factor": 1}
    assert decimation_cutoff(found) is None
    found.study = SimpleNamespace(signals=replace(Signals(decimate=Decimate()), decimate=None))
    assert decimation_cutoff(found) is None


def fit(X=(1.0, 2.0), sigma=(0.01, 0.02), correlation=0.0, error=4.0, joints=(3.0, 5.0), **changed):
    sigma = np.array(sigma)
    n = len(sigma)
    covariance = np.outer(sigma, sigma) * np.array([[1, correlation], [correlation, 1]])[:n, :n]
    per_joint = tuple(JointFit(str(j + 1), 100, 1.0, e, 0.1) for j, e in enumerate(joints))
    made = Estimate(
        ("A1", "B1")[:n],
        np.array(X),
        sigma,
        covariance,
        2 * sigma,
        0.1,
        5.0,
        3.0,
        2,
        1.0,
        error,
        per_joint,
        "ols",
    )
    return replace(made, **changed)


class Asking(Part):
    """A part of some questions."""

    name = title = "asking"

    def __init__(self, about, *checks):
        self.about, self.asked = about, checks

    def checks(self):
        return self.asked


def asked_about(estimate, unseen=5.0, *, every=None, halves=False, single=False, **known):
    """An identification as far as the questions look at it."""
    whole = every or estimate
    drawn = SimpleNamespace(names=estimate.names, drawn=2.5 * estimate.sigma)
    return SimpleNamespace(
        **{
            "estimate": whole,
            "model_estimate": estimate,
            "model_columns": "essential",
            "determined": whole.status != "rank-deficient",
            "uncertainty": SimpleNamespace(bootstrap=drawn),
            "verdict": "2 of 2.",
            "validation": (unseen,),
            "by_records": not halves,
            "prediction_error": unseen,
            "expected_error": np.nan,
            "unseen_error": np.nan,
            "negative": (),
            "parts": [Consistency(estimate, estimate), Asking("values", answer(None))],
            "study": SimpleNamespace(validate=SimpleNamespace(values=single)),
            **known,
        }
    )


def checked(estimate, unseen=5.0, **known):
    return judged(asked_about(estimate, unseen, **known))


@pytest.mark.parametrize(("estimate", "unseen", "state", "question"), [
    (fit(), 5.0, "good", None),
    (fit(error=15.0), 15.0, "doubtful", "explain"),
    (fit(error=25.0), 25.0, "no", "explain"),
    (fit(joints=(3.0, 30.0)), 5.0, "doubtful", "every joint"),
    (fit(), 9.0, "doubtful", "not seen"),
    (fit(), 13.0, "no", "not seen"),
    (fit(error=0.01, joints=(0.01,)), 1.9, "good", None),
    (fit(sigma=(0.01, 0.3)), 5.0, "doubtful", "certain"),
    (fit(sigma=(0.2, 0.3)), 5.0, "no", "certain"),
    (fit(correlation=-0.95), 5.0, "doubtful", "separated"),
    (fit(cond_unit=300.0), 5.0, "doubtful", "determine"),
    (fit(status="not-converged", message="after 20 steps."), 5.0, "no", "determine"),
    (fit(status="rank-deficient", rank=1, groups=(("A1", "B1"),)), 5.0, "no", "determine"),
])  # fmt: skip
def test_verdict_is_the_worst_answer(estimate, unseen, state, question):
    checklist = checked(estimate, unseen)
    assert checklist.state == state
    assert (
        checklist.answer
        == {"good": "Yes, as far as judged", "doubtful": "With care", "no": "No"}[state]
    )
    if question is None:
        assert checklist.worst is None and "Open questions" in checklist.doubt
    else:
        assert (
            question in checklist.worst.question
            and checklist.worst.finding in checklist.doubt
            and checklist.worst.remedy in checklist.next
        )
    assert set(checklist.summary()) == {
        "state", "answer", "grade", "use", "doubt", "next", "checks",
    }  # fmt: skip


@pytest.mark.parametrize(("X", "sigma", "state", "finding"), [
    ((1.0, 1e-9), (0.01, 0.01), "good", "Largest deviation 1 % (A1), median 1.0 %; not told from zero: B1"),
    ((1.0, 0.2), (0.01, 0.4), "doubtful", "Largest deviation 1 % (A1), median 1.0 %; not told from zero: B1"),
    ((1.0, 0.8), (0.01, 0.4), "doubtful", "Largest deviation 50 % (B1), median 25.5 %; above 30 %: B1"),
    ((0.1, 0.2), (0.3, 0.4), "no", "Not told from zero: B1, A1"),
    ((0.0, 1.0), (0.0, 0.01), "good", "Largest deviation 1 % (B1), median 1.0 %; not told from zero: A1"),
])  # fmt: skip
def test_a_value_within_its_interval_of_zero_has_no_percentage(X, sigma, state, finding):
    """439 % (MY2), 2975630 % (MY1) were said of parameters that are zero."""
    estimate = fit(X, np.array(sigma) / 2)  # corrected: sigma
    answer = certain(asked_about(estimate, model_columns="all"))
    assert (answer.state, answer.finding) == (state, finding)
    percents = [row[3] for row in estimate.tables()[0].rows]
    told = np.abs(X) > 1.96 * np.array(sigma)
    assert [percent != "-" for percent in percents] == told.tolist()
    assert estimate.to_latex().count("--") == 2 - told.sum()


def test_single_values_are_remarks_where_the_expected_error_is_known():
    """Deviations, correlations and condition count where values are asked for one by one."""
    for estimate in (fit(sigma=(0.2, 0.3)), fit(correlation=-0.95), fit(cond_unit=300.0)):
        checklist = checked(estimate, expected_error=2.0)
        assert checklist.state == "good" and checklist.grade == 2.0
        assert "Single values do not count in this verdict" in str(
            [c.finding for c in checklist.checks]
        )
        assert checked(estimate, expected_error=2.0, single=True).state != "good"


@pytest.mark.parametrize(
    ("expected", "state"),
    [
        (Expected(3.0, 1.0, 4.9), "good"),
        (Expected(4.0, 1.0, 5.1), "doubtful"),
        (Expected(30.0, 4.9, 60.0), "doubtful"),
        (Expected(8.0, 5.1, 12.0), "no"),
    ],
)
def test_expected_error_grades_by_its_interval(expected, state):
    parts = [Asking("prediction", expected_off(expected))]
    checklist = checked(fit(), expected_error=expected.error, parts=parts)
    assert checklist.state == state
    assert state == "good" or "other motions" in checklist.worst.question


def test_half_a_record_is_good_up_to_the_second_limit():
    """15 % in one half where 4 % were fitted: never a no; a validation record is judged harder."""
    assert checked(fit(error=4.0), 9.0, halves=True).state == "good"
    assert checked(fit(error=4.0), 9.0).state == "doubtful"
    assert checked(fit(error=4.0), 15.0, halves=True).state == "doubtful"
    assert checked(fit(error=4.0), 16.0).state == "no"


def test_half_a_record_counts_unless_the_other_half_explains_it():
    """6.5 % in one half where 1 % was fitted: a doubt, however small the expected error is."""
    told = {"halves": True, "expected_error": 0.6}
    assert checked(fit(error=1.0), 6.5, unseen_error=2.0, **told).state == "doubtful"
    assert checked(fit(error=1.0), 6.5, unseen_error=7.0, **told).state == "good"
    assert checked(fit(error=1.0), 15.5, unseen_error=99.0, **told).state == "doubtful"


def test_negative_friction_is_not_for_use():
    checklist = checked(fit(), negative=("Ia2", "FS2"))
    assert (
        checklist.state == "no"
        and "Below zero: Ia2, FS2" in checklist.doubt
        and "sign of ratio" in checklist.next
    )


def test_physical_consistency_counts():
    bad = SimpleNamespace(feasible=False, blocking=(("link 3", -0.01),), margin=-0.01)
    checklist = checked(fit(), parts=[Consistency(fit(), fit(), bad)])
    assert (
        checklist.state == "doubtful"
        and "link 3" in checklist.doubt
        and "feasible" in checklist.next
    )
    good = SimpleNamespace(feasible=True, blocking=(), margin=0.1)
    assert checked(fit(), parts=[Consistency(fit(), fit(), good)]).state == "good"
    under = fit(details={"standard": {}})
    assert checked(under, parts=[Consistency(under, under)]).state == "good"


@pytest.mark.parametrize(("error", "state"), [(0.5, "good"), (3.0, "doubtful"), (8.0, "no")])
def test_encoder_in_use_counts(error, state):
    limits = [SimpleNamespace(percent=1.0, delta=1e-4), SimpleNamespace(percent=5.0, delta=2e-4)]
    advice = SimpleNamespace(
        encoders=[SimpleNamespace(limits=limits)],
        unit="rad",
        place="at the motors",
        asked=(1e-3,),
        worst=lambda k: ("A1", 2 * error, error),
    )
    asked = checked(fit(), parts=[Asking("values", answer(advice))])
    assert "biased from 0.0002 rad (2*pi/31416) at the motors" in asked.checks[-1].finding
    assert state == "good" or "--columns" in asked.next
    assert (
        asked.state == state
        and asked.answer == {"good": "Yes", "doubtful": "With care", "no": "No"}[state]
    )
    advice.asked = ()
    checklist = checked(fit(), parts=[Asking("values", answer(advice))])
    assert (
        checklist.state == "good"
        and checklist.checks[-1].state == "open"
        and "--encoder" in checklist.checks[-1].remedy
    )


def test_limits_are_inclusive():
    assert [state_of(x, 1.0, 5.0) for x in (1.0, 1.1, 5.0, 5.1)] == [
        "good",
        "doubtful",
        "doubtful",
        "no",
    ]


def test_correlations_by_name():
    matrix = correlation_matrix(fit(correlation=-0.95))
    assert matrix.cells == [[("+1.00", 4), ("−0.95", 4)], [("−0.95", 4), ("+1.00", 4)]]
    assert correlation_matrix(fit(sigma=(0.0, 0.1))) is None
    assert separate(asked_about(fit(correlation=0.89))).state == "good"


def identified(robot_file=(1.0, 0.01)):
    """Two parameters of which the model uses one, and the values of the robot file."""
    every, used = fit(X=(1.23456, 0.0001), sigma=(0.01, 0.02)), fit(X=(1.23456,), sigma=(0.01,))
    model = SimpleNamespace(
        VALUES=dict(zip(every.names, robot_file, strict=True)),
        STANDARD_PARAMETERS=every.names,
        BASE_PARAMETERS=every.names,
        FORMULAS={"A1": "A1"},
        base_parameters=lambda chi: chi,
    )
    made = SimpleNamespace(
        model=model, model_estimate=used, estimate=every, model_columns="essential"
    )
    made.problem = SimpleNamespace(methods=METHODS)
    made.fitted = Identification.fitted.fget(made)
    return made


def test_values_have_the_digits_of_their_intervals():
    (table,) = parameter_section(identified()).tables
    words = (
        "1 of 2 base parameters, the essential ones, fitted by ols, ± 95 % if the others are zero"
    )
    assert table.caption == words
    assert table.header == ("parameter", "value", "± 95 %", "unit")
    assert table.rows == [(symbol("A1"), "1.235", "0.039", "")]


@pytest.mark.parametrize(("given", "difference"), [(1.0, "+23.5"), (0.039, ""), (0.0, "")])
def test_no_difference_to_a_value_within_the_interval(given, difference):
    (table,) = every_section(identified((given, 0.01))).tables
    first, second = (dict(zip(table.header, row, strict=True)) for row in table.rows)
    assert (first["value"], first["difference %"]) == ("1.235", difference)
    assert (second["value"], second["difference %"], second["made of"]) == ("", "", "itself")
    assert (second["all fitted: value"], second["all fitted: ± 95 %"]) == ("0.000", "0.078")


def test_small_and_large_statistics_keep_few_digits():
    percents = [percentage(x, x, ".2g") for x in (0.456, 23.45, 51.0, 1.3e12)]
    assert percents == ["0.46", "23", "51", "-"]
    assert [probability(p) for p in (0.92, 0.0049, 4.5e-176, 0.0)] == [
        "0.92", "0.0049", "< 0.0001", "< 0.0001",
    ]  # fmt: skip


def test_what_to_do_stands_where_there_is_something():
    checks = [
        Check("a?", "good", "fine", "1", "not said"),
        Check("b?", "doubtful", "so", "1", ""),
        Check("c?", "no", "bad", "1", "mend it"),
    ]
    bad, good = checks_section(SimpleNamespace(checks=checks)).tables
    assert [row[0] for row in bad.rows] == ["c?", "b?"] and bad.header[-1] == "what to do"
    assert [row[0] for row in good.rows] == ["a?"] and good.header[-1] == "good within"
    (only,) = checks_section(SimpleNamespace(checks=checks[1:2])).tables
    assert only.header[-1] == "good within"


def test_settings_are_those_that_are_set():
    section = settings_section("a:\n  b: null\n  c: 1\nd: null\n")
    assert section.folded and section.listing == "a:\n  c: 1"


@pytest.mark.parametrize(
    ("scale", "remedy"), [(1.0, "{method: wls}"), (0.2, "lower essential.threshold")]
)
def test_a_joint_lost_with_the_removed_parameters_is_told(scale, remedy):
    """A lift in N beside a wrist in N m: all parameters explain the wrist, the essential ones do
    not.
    """
    every = fit(joints=(2.0, 15.5))
    every = replace(
        every, per_joint=tuple(replace(joint, scale=scale) for joint in every.per_joint)
    )
    essential = fit(X=(1.0,), sigma=(0.01,), joints=(2.0, 99.0))
    checklist = checked(essential, every=every)
    assert (
        checklist.state == "no"
        and "15.5 % of joint 2 unexplained, the essential ones 99.0 %" in checklist.next
        and remedy in checklist.next
    )
    assert (
        lost_joints(every, every) == ""
        and lost_joints(fit(joints=(2.0, 80.0)), fit(joints=(2.0, 99.0))) == ""
    )


def test_of_many_joints_those_with_the_largest_errors_come_first():
    t, measured = np.arange(5.0), np.ones(5)
    joints = [
        JointComparison(str(j), t, measured, measured - 0.01 * (j % 20)) for j in range(1, 31)
    ]
    result = SimpleNamespace(
        comparison=joints, torque_unit="N m", model_columns="all", source="measured"
    )

    def shown(section):
        return [int(image.caption.split(":")[0].removeprefix("Joint ")) for image in section.images]

    assert shown(torque_section(result)) == [*range(12, 20)]
    (others,) = other_torques_section(result)
    assert shown(others) == [*range(1, 12), *range(20, 31)]
    result.comparison = joints[:8]
    assert len(shown(torque_section(result))) == 8 and other_torques_section(result) == []
