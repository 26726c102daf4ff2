"""Rows at rest are left out by default, where dry friction holds the joint with any torque.

The torques are those of formulas written here, of pinocchio (benchmarks/truth_rests.py), or of the
shared case `rests`, whose true values are in its truth.json.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
pytest.importorskip("pinocchio")

import truth_simulator as world
from truth_rests import dwelling, held_torques, stick_slip
from truth_shared import Unseen, emitted, record_of
from truth_simulator import Encoder, Truth, noise

import runtime
import symgen
from runtime.study import study_from_mapping

DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASE = Path(DATA).parent / "cases5" / "rests"
PENDULUM = """\
symgen: 1
name: pendulum
gravity: [0, -g, 0]
constants: {g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
elements:
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
  OFFSET: {kind: offset, along: all}
"""
TRUE = {"ZZ1": 0.8, "MX1": 1.5, "MY1": 0.3, "FV1": 0.6, "FS1": 2.0, "OFFSET1": 0.4}


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    file = tmp_path_factory.mktemp("rests") / "pendulum.yaml"
    file.write_text(PENDULUM)
    return symgen.model(file)


def moves(ways: list[float], seed: int, *, hold: float = 1.0, still: float = 0.5) -> runtime.Record:
    """Moves of a pendulum by polynomials of degree 5 with rests of about `still` s between them.

    At rest friction holds it with a torque between -hold FS and hold FS.
    """
    rng, dt = np.random.default_rng(seed), 0.002
    q, qd, qdd, held = [], [], [], []
    here = 0.0
    for way in ways:
        last = 1.875 * abs(way) / rng.uniform(1, 3)
        u = np.arange(0, 1, dt / last)[1:]
        count = round(rng.uniform(0.4, 1.6) * still / dt)
        rest = np.zeros(count)
        q += [*(here + way * (10 * u**3 - 15 * u**4 + 6 * u**5)), *(here + way + rest)]
        qd += [*(way / last * 30 * (u * (1 - u)) ** 2), *rest]
        qdd += [*(way / last**2 * 60 * u * (1 - u) * (1 - 2 * u)), *rest]
        held += [*(0 * u), *(rest + hold * TRUE["FS1"] * rng.uniform(-1, 1))]
        here += way
    q, qd, qdd, held = map(np.array, (q, qd, qdd, held))
    p = TRUE
    weight = 9.81 * (p["MX1"] * np.cos(q) - p["MY1"] * np.sin(q))
    friction = p["FV1"] * qd + p["FS1"] * np.sign(qd) + held + p["OFFSET1"]
    tau = p["ZZ1"] * qdd + weight + friction + 0.05 * rng.standard_normal(len(q))
    q = q + 1e-6 * rng.standard_normal(len(q))
    return runtime.Record(np.arange(len(q)) * dt, q[:, None], tau[:, None])


def both_ways(seed: int, **options: float) -> runtime.Record:
    ways = np.random.default_rng(seed).uniform(0.5, 1.2, 20) * np.resize([1, -1], 20)
    return moves(list(ways), seed, **options)


def test_the_shared_case_is_right_by_default() -> None:
    if not CASE.is_dir() and not os.environ.get("SYMGEN_REQUIRE_DATA"):
        pytest.skip(f"{CASE} is not there")
    model = symgen.model(CASE / "arm3.yaml")
    result = runtime.identify(model, runtime.read_record(CASE / "log.csv.gz"), plausible=True)
    assert result.checklist.answer == "Yes, as far as judged"
    fit = result.model_estimate
    truth = model.base_parameters(json.loads((CASE / "truth.json").read_text()))
    X = dict(zip(model.BASE_PARAMETERS, truth, strict=True))
    true = np.array([X[name] for name in fit.names])
    assert fit.relative_error < 1
    assert np.linalg.norm(fit.X - true) < 0.01 * np.linalg.norm(true)
    inside = np.abs(fit.X - true) < 1.96 * fit.sigma_corrected
    assert inside.mean() > 0.9
    (sentence,) = [note for note in result.observation.findings if "at rest" in note]
    assert "joint 2 44 % (below 0.04 rad/s)" in sentence and "\n" not in sentence


def test_only_rests_and_what_they_reach_are_left_out(pendulum) -> None:
    """Of 20 rows in motion, at most the REST_REACH next to a rest go."""
    record = both_ways(1)
    rows = runtime.observe(pendulum, record)
    every = runtime.observe(pendulum, record, study_from_mapping({"rows": {"low_speed": 0}}))
    (low,), around = rows.settings["rows"]["low_speed"], rows.settings["rows"]["around"]
    again = runtime.observe(
        pendulum, record, study_from_mapping({"rows": {"low_speed": low, "around": around}})
    )
    np.testing.assert_array_equal(rows.W, again.W)
    speed = np.abs(every.motion[:, 1])
    at_rest = every.t[speed < low]
    near = np.abs(every.t[:, None] - at_rest).min(axis=1) <= around
    gone = ~np.isin(every.t, rows.t)
    assert gone[speed < low].all() and gone.sum() < near.sum() * 1.05
    assert 0.3 < gone.mean() < 0.7


def test_a_model_without_dry_friction_keeps_all_rows(pendulum) -> None:
    """The same record without dry friction in motion: at rest, only sign(qd) would be noise."""
    smooth = symgen.model(
        symgen.parse_robot(
            PENDULUM.replace("  FS: {kind: coulomb, along: all}\n", "").encode(), file="smooth.yaml"
        )
    )
    record = both_ways(1)
    assert runtime.observe(pendulum, record).dropped["low_speed"][0] > 0
    speed = np.gradient(record.q, record.t, axis=0)
    dry = TRUE["FS1"] * np.sign(speed) * (np.abs(speed) > 0.02)
    rows = runtime.observe(smooth, replace(record, tau=record.tau - dry))
    assert rows.dropped["low_speed"] == (0,) and rows.settings["rows"]["low_speed"] == 0


def test_a_joint_at_rest_with_the_torque_of_the_model_keeps_its_rows(pendulum) -> None:
    """Friction of the model at rest: sign(qd) of the noise is the only difference, and FS is small."""
    rng = np.random.default_rng(5)
    t = np.arange(4000) / 500
    q = np.where(t < 5, 1.2 * np.sin(2.2 * t) * np.clip(5 - t, 0, 1) ** 3, 0.0)
    qd = np.gradient(q, t, edge_order=2)
    states = (x[:, None] for x in (q, qd, np.gradient(qd, t, edge_order=2)))
    X = [TRUE[name] if name not in ("FS1", "FV1") else 0.01 for name in pendulum.BASE_PARAMETERS]
    tau = pendulum.inverse_dynamics(*states, np.array(X))
    record = runtime.Record(t, q[:, None], tau + 0.05 * rng.standard_normal(tau.shape))
    rows = runtime.observe(pendulum, record)
    assert rows.dropped["low_speed"] == (0,) and rows.settings["rows"]["low_speed"] == 0
    speed = np.abs(rows.motion[:, 1])
    assert (speed < 0.02 * speed.max()).mean() > 0.3


def test_a_record_without_rests_keeps_its_rows() -> None:
    robot = world.ROBOTS["anthropomorphic"]
    truth, move = Truth(robot, 3), world.fourier(robot, 3)
    tau = truth.torque(move)
    record, model = record_of(move, tau + noise(tau, 0.0, 0.01, 3)), emitted(robot.name)[0]
    rows, zero = (
        runtime.observe(model, record, study_from_mapping({"rows": given}))
        for given in ({}, {"low_speed": 0})
    )
    np.testing.assert_array_equal(rows.W, zero.W)
    np.testing.assert_array_equal(rows.Y, zero.Y)
    assert rows.settings == zero.settings and not any("at rest" in f for f in rows.findings)


@pytest.mark.parametrize("seed", [1, 2])
def test_rests_of_a_joint_that_moves_one_way_are_kept(pendulum, seed) -> None:
    """Without them FS and OFFSET are one column: FS was .31 +- .13 for 2.0, with the answer Yes."""
    record = moves(list(np.random.default_rng(seed).uniform(0.5, 1.2, 20)), seed)
    result = runtime.identify(pendulum, record, plausible=True)
    assert result.observation.dropped["low_speed"] == (0,)
    check = next(c for c in result.checklist.checks if c.question.startswith("Do the joints move"))
    assert check.state in ("doubtful", "no") and "both directions" in check.remedy
    assert "low_speed" not in check.remedy and not check.change


@pytest.mark.parametrize("way", ["planned", "loop"])
def test_each_joint_has_its_own_rests(way) -> None:
    """Pinocchio's torques with stick friction: Yes, and the true error on unseen motion is small."""
    robot = world.ROBOTS["scara"]
    truth, move = Truth(robot, 8), dwelling(robot, 8, rest=0.4)
    encoder = Encoder(2 * pi / 6.5e4)
    if way == "planned":
        q, tau = move.q, held_torques(truth, move, 8)
    else:
        _, q, tau = stick_slip(truth, move, encoder, 8)
    tau = tau + noise(tau, 0.0, 0.01, 8)
    model = emitted(robot.name)[0]
    result = runtime.identify(model, record_of(move, tau, q))
    low = result.observation.settings["rows"]["low_speed"]
    assert len({*low}) == robot.n and min(low) > 0
    assert result.checklist.answer.startswith("Yes")
    fit = result.model_estimate
    assert Unseen(truth, 8).errors(fit.names, fit.X)[0] < 1.5
    kept = runtime.identify(
        model, record_of(move, tau, q), study_from_mapping({"rows": {"low_speed": 0}})
    )
    fit = kept.model_estimate
    assert Unseen(truth, 8).errors(fit.names, fit.X)[0] > 1.5


@pytest.mark.parametrize(
    "sections",
    [
        {"estimate": {"method": "wls", "weights": "covariance"}},
        {"estimate": {"method": "irls"}},
        {"estimate": {"method": "feasible"}},
        {"signals": {"reader": "counts", "step": 2 * pi / 65536}},
    ],
    ids=["covariance", "irls", "feasible", "counts"],
)
def test_methods_and_readers_use_the_rows_without_rests(sections) -> None:
    robot = world.ROBOTS["planar"]
    truth, move = Truth(robot, 5), dwelling(robot, 5)
    tau = held_torques(truth, move, 5)
    q = world.encoded(robot, move, Encoder(2 * pi / 65536), 5)
    record = record_of(move, tau + noise(tau, 0.0, 0.01, 5), q)
    model = emitted(robot.name)[0]
    fit = runtime.estimate(model, record, study_from_mapping(sections))
    assert len({joint.rows for joint in fit.per_joint}) == 2  # each joint has its own
    assert fit.status == "ok"
    assert Unseen(truth, 5).errors(fit.names, fit.X)[0] < 1


def test_a_study_of_resolution_has_the_rows_of_the_measured_record() -> None:
    """The rounded positions of a run never decide which rows are used."""
    robot = world.ROBOTS["planar"]
    truth, move = Truth(robot, 6), dwelling(robot, 6)
    tau = held_torques(truth, move, 6)
    record, model = record_of(move, tau + noise(tau, 0.0, 0.01, 6)), emitted(robot.name)[0]
    study = study_from_mapping({"cestac": {"delta": [1e-4, 2e-3], "runs": 3}})
    found = runtime.cestac(model, record, study)
    rows = runtime.observe(model, record, study)
    low = rows.settings["rows"]
    fixed = replace(
        study, rows=replace(study.rows, low_speed=low["low_speed"], around=low["around"])
    )
    same = runtime.cestac(model, record, fixed)
    assert rows.dropped["low_speed"][0] > 0
    np.testing.assert_array_equal(found.reference.X, same.reference.X)
    for ours, theirs in zip(found.levels, same.levels, strict=True):
        np.testing.assert_array_equal(ours.mean, theirs.mean)
