"""Friction curves against simulated laws, the published asymmetric friction of EMPS, and the TX40
record.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

from runtime import InputError, Record, observe
from runtime.compose import estimate_of, problem
from runtime.core.model import load_model
from runtime.core.residuals import correlation_time, residual_correlation
from runtime.friction import Friction, friction_curves, friction_figure, own_friction
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.reporting import figures as plots
from runtime.reporting.page import Page, render
from runtime.reporting.sections import part_section
from runtime.study import study_from_mapping

GENERATED = Path(__file__).resolve().parents[2] / "generated"
RATE = 500.0
STUDY = study_from_mapping(
    {"signals": {"median": 1, "lowpass": None, "decimate": {"factor": 5}}, "rows": {"trim": 5}}
)


def emitted(name: str):
    return load_model(GENERATED / f"{name}.py")


@pytest.fixture(scope="module")
def arm():
    return emitted("planar_2r")


def simulated(arm, law, noise: float = 0.05, seconds: float = 40.0, seed: int = 0):
    """Record and exact rigid-body fit of the arm with friction law(v, rigid torque) on both joints."""
    t = np.arange(round(seconds * RATE)) / RATE
    w = 2 * np.pi * np.array([[0.11, 0.27, 0.61], [0.13, 0.31, 0.71]])[:, :, None]
    a = np.array([1.6, 0.7, 0.25])[:, None]
    q, qd, qdd = (
        (a * x).sum(axis=1).T for x in (np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t))
    )
    X = arm.base_parameters(arm.VALUES)
    rest = X.copy()
    for j in range(2):
        rest[own_friction(arm, j)] = 0.0
    rigid = arm.inverse_dynamics(q, qd, qdd, rest)
    tau = rigid + law(qd, rigid) + noise * np.random.default_rng(seed).standard_normal(q.shape)
    record = Record(t, q, tau, rate=RATE)
    fit = estimate_of(observe(arm, record, STUDY))
    return record, type(fit)(**{**vars(fit), "X": X})


def coulomb(v, rigid):
    return 0.8 * np.sign(v) + 0.5 * v + 0.1


def test_own_friction_of_a_joint(arm) -> None:
    named = [[arm.BASE_PARAMETERS[k] for k in own_friction(arm, j)] for j in range(2)]
    assert named == [["FV1", "FS1", "OFFSET1"], ["FV2", "FS2", "OFFSET2"]]
    tx40 = emitted("tx40")
    assert [tx40.BASE_PARAMETERS[k] for k in own_friction(tx40, 5)] == [
        "FV6",
        "FS6",
        "OFFSET6",
    ]  # FVM6 and FSM6 act on joint 5 too


def test_plain_friction_is_left_alone(arm) -> None:
    record, fit = simulated(arm, coulomb)
    for curve in friction_curves(problem(arm, [record], STUDY), fit):
        assert curve.law_name == "coulomb+viscous" and curve.note == ""
        true = {"FS": 0.8, "FV": 0.5, "OFFSET": 0.1}
        for name, value in true.items():
            assert abs(curve.law.parameters[name] - value) < 4 * curve.law.sigma[name] + 2e-3
        within = np.abs(curve.mean - curve.law_torques["coulomb+viscous"]) < 1.3 * curve.half
        assert within.mean() > 0.85


def test_stribeck_friction_is_found(arm) -> None:
    def law(v, rigid):
        return coulomb(v, rigid) + 0.6 * np.sign(v) * np.exp(-((v / 0.3) ** 2))

    record, fit = simulated(arm, law)
    for curve in friction_curves(problem(arm, [record], STUDY), fit):
        assert (
            curve.law_name.startswith("stribeck")
            and "Stribeck effect" in curve.note
            and curve.label == curve.law_name
        )
        stribeck = next(law for law in curve.laws if law.name == "stribeck")
        for name, value in {"FS": 0.8, "FV": 0.5, "FST": 0.6, "VS": 0.3}.items():
            assert abs(stribeck.parameters[name] - value) < 4 * stribeck.sigma[name] + 5e-3, name
        assert stribeck.p_value < 1e-6 and stribeck.aic < -20


def test_friction_under_load_is_found(arm) -> None:
    record, fit = simulated(
        arm, lambda v, rigid: coulomb(v, rigid) + 0.1 * np.sign(v) * np.abs(rigid)
    )
    for curve in friction_curves(problem(arm, [record], STUDY), fit):
        assert curve.law_name in ("load", "stribeck+load")
        load = next(law for law in curve.laws if law.name == "load")
        assert (
            load.parameters["FL"] == pytest.approx(0.1, abs=0.005)
            and load.held_out < 0.9 * curve.laws[0].held_out
        )


def test_two_records_are_one_curve(arm) -> None:
    record, fit = simulated(arm, coulomb, seconds=15.0)
    other, _ = simulated(arm, coulomb, seconds=15.0, seed=1)
    one, two = (
        friction_curves(problem(arm, [record], STUDY), fit)[0],
        friction_curves(problem(arm, [record, other], STUDY), fit)[0],
    )
    assert len(two.v) == 2 * len(one.v) and two.laws[0].sigma["FV"] < one.laws[0].sigma["FV"]


def test_correlation_time_of_known_noise() -> None:
    """First-order noise with coefficient 0.8: (1 + 0.8)/(1 - 0.8) = 9."""
    e = np.random.default_rng(0).standard_normal(40000)
    x = np.zeros_like(e)
    for k in range(1, len(e)):
        x[k] = 0.8 * x[k - 1] + e[k]
    assert correlation_time(residual_correlation(x)) == pytest.approx(9, rel=0.15)
    assert correlation_time(residual_correlation(e)) == pytest.approx(1, abs=0.1)


def test_emps_has_the_published_asymmetric_friction(emps_data) -> None:
    """Janot, Gautier and Brunot (2019): Fv+ 166.7061, Fc+ 20.1440, Fv- 240.4236, Fc- 20.6277 with M
    fitted too; here M is held.
    """
    emps = emitted("emps")
    study = study_from_mapping(dataset_study("emps"))
    records = read_records(study.record, emps)
    fit = estimate_of(observe(emps, records[0], study), study.estimate, model=emps)
    (curve,) = friction_curves(problem(emps, records, study), fit)
    assert curve.law_name == "asymmetric"
    published = {"FVP": 166.7061, "FSP": 20.1440, "FVN": 240.4236, "FSN": 20.6277}
    for name, value in published.items():
        assert curve.law.parameters[name] == pytest.approx(value, rel=5e-4)


@campaign
def test_tx40_record(tx40_data) -> None:
    """Held out, joint 3 goes from 12.7 to 8.4 % with load and a bend towards standstill; no joint
    has a Stribeck peak.
    """
    tx40 = emitted("tx40")
    study = study_from_mapping(dataset_study("tx40"))
    records = read_records(study.record, tx40)
    curves = friction_curves(
        problem(tx40, records, study), estimate_of(observe(tx40, records[0], study), model=tx40)
    )
    assert [curve.joint for curve in curves] == list("123456")
    assert all(curve.law.held_out < curve.laws[0].held_out for curve in curves)
    assert (
        curves[2].law_name == "stribeck+load"
        and curves[2].law.held_out < 0.7 * curves[2].laws[0].held_out
    )
    assert all(
        curve.law.parameters["FST"] < 0
        and "no Stribeck peak" in curve.note
        and "(no peak)" in curve.label
        for curve in curves
    )
    png = plots.of_part(friction_figure(curves)).files["friction.png"]
    assert png[:4] == b"\x89PNG"
    page = render(Page("friction", "", [part_section(Friction(curves))]))
    assert "Friction curves" in page and "stribeck+load (no peak)" in page


def test_too_few_rows(arm) -> None:
    record, fit = simulated(arm, coulomb, seconds=0.6)
    with pytest.raises(InputError, match="a friction curve needs more rows"):
        friction_curves(problem(arm, [record], STUDY), fit)
