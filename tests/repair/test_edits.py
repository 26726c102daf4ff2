"""Every cause that a study can correct is written so that the record is read as the cause corrects it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import RATE, motion, written

import runtime
import symgen
from runtime.compose import problem, records_of
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings import structure, to_mapping
from runtime.mending import repair as mending
from runtime.mending.edits import angle_text, delayed
from runtime.mending.reading import Reading, record_of
from runtime.mending.settings import digest
from runtime.plausible.causes import CAUSES, NUMBERS, Cause, Robot
from runtime.plausible.plausibility import case_of
from runtime.study import Study, located, study_from_mapping, study_from_text, study_text
from symgen.description.yaml import parse_robot
from symgen.errors import DescriptionError

ROBOT = """
symgen: 1
name: geared
gravity: [0, 0, -9.81]
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0.3}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0.1, theta: q2 + pi/2, r: 0}
  3: {ant: 2, sigma: 0, alpha: 0, d: 0.4, theta: q3, r: 0.05}
elements: {FV: {kind: viscous, along: all}, FS: {kind: coulomb, along: all}}
DRIVES
"""
DRIVES = "drives: {ratio: [50, -80, 40], offset: [0.1, 0, -0.2]}"


@pytest.fixture(scope="module", params=["joint", "motor"])
def start(request: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Reading, Any, Any, Path]:
    """A reading of a record at joints or motors, its robot, its study and its folder."""
    folder, side = tmp_path_factory.mktemp("edits"), request.param
    robot = parse_robot(
        ROBOT.replace("DRIVES", DRIVES if side == "motor" else "").encode(), "geared.yaml"
    )
    model, variants = symgen.model(robot), symgen.variants(robot)
    t, q, qd, qdd = motion(1, 5.0)
    X = np.random.default_rng(2).uniform(0.5, 1, len(model.BASE_PARAMETERS))
    tau = model.inverse_dynamics(q, qd, qdd, X)
    tau += 0.01 * np.random.default_rng(3).standard_normal(tau.shape)
    written(folder, t, q, tau)
    study = located(
        study_from_mapping(
            {"record": {"files": ["run.csv"], "side": side, "scale": {"tau": [1, 2, 3]}}}
        ),
        folder,
    )
    whole = problem(model, records_of(study.record, model, study), study)
    case = case_of(whole, variants)
    data = mending.data_of(
        case,
        whole,
        to_mapping(study),
        lambda record: (
            record["columns"]["q"] or ["q1", "q2", "q3"],
            record["columns"]["tau"] or ["tau1", "tau2", "tau3"],
        ),
        RATE,
    )
    return Reading.given(data, to_mapping(study)), robot, model, folder


def causes_of(reading: Reading) -> Iterator[Cause]:
    case = reading.data.case
    robot = Robot(case.model, case.variants, reading.sides, case.samples, None, reading.units)
    robot.R, robot.offset = reading.robot.R, reading.robot.offset
    for row in CAUSES:
        for item in row.of(robot):
            yield row.cause(robot, item)
    for row in NUMBERS:
        for item in row.of(robot):
            yield row.cause(robot, item, 0.3)


def read_again(reading: Reading, robot: Any, folder: Path) -> tuple[Any, Any]:
    """The record and the robot of the written study."""
    study = structure(Study, reading.study)
    text = study_text(study, folder, defaults=False)
    study = located(study_from_text(text), folder)
    corrected = symgen.corrected(robot, study)
    model = reading.data.case.model
    if corrected.drives != robot.drives:
        model = symgen.model(corrected)
    return records_of(study.record, model, study)[0], corrected


def same_table(corrected: Any, reading: Reading) -> None:
    for key, x in reading.constants.items():
        if key.startswith("free_g") and key[-1] in "xyz":
            entry = corrected.gravity["xyz".index(key[-1])]
        else:
            name, frame = key.removeprefix("free_")[:-1], int(key[-1])
            name = {"theta": "theta0", "r": "r0"}.get(name, name)
            entry = getattr(corrected.frame(frame), name)
        assert float(entry.value(corrected.constants)) == pytest.approx(x, abs=1e-9), key


def test_written_causes_are_read_back(start: Any) -> None:
    first, robot, _, folder = start
    record = first.data.case.records[0]
    kinds: dict[str, list[bool]] = {}
    for cause in causes_of(first):
        reading = first.changed(cause)
        kinds.setdefault(cause.kind, []).append(reading is not None)
        if reading is None:
            continue
        again, corrected = read_again(reading, robot, folder)
        meant = record_of(reading, record)
        np.testing.assert_allclose(again.q, meant.q, rtol=1e-8, atol=1e-8, err_msg=cause.says)
        np.testing.assert_allclose(again.tau, meant.tau, rtol=1e-8, atol=1e-6, err_msg=cause.says)
        assert again.rate == pytest.approx(meant.rate, rel=1e-6), cause.says
        same_table(corrected, reading)
    every = {kind for kind, made in kinds.items() if all(made)}
    assert {"sign", "exchange", "order", "rate", "zero", "gravity", "angle", "length"} <= every
    assert not any(kinds.get("offset", [])) and not any(kinds.get("friction", []))


def test_pairs_of_causes_are_read_back(start: Any) -> None:
    """Changes of several kinds, one after the other: order, units, rate, table, delay."""
    first, robot, _, folder = start
    record = first.data.case.records[0]
    rng = np.random.default_rng(5)
    made = slower = 0
    for _ in range(60):
        reading: Any = first
        late = rng.integers(6)  # before a change, after all of them, or never
        for k in range(4):
            if k == late:
                reading = reading.late(np.array([0.0, 0.01, -0.02]) / reading.rate, "late")
            causes = [c for c in causes_of(reading) if c.kind not in ("side", "coupling")]
            if k == 3 or (changed := reading.changed(causes[rng.integers(len(causes))])) is None:
                continue
            slower += k > late and changed.rate != reading.rate
            reading = changed
        again, corrected = read_again(reading, robot, folder)
        meant = record_of(reading, record)
        scale = np.abs(meant.tau).max(axis=0)
        np.testing.assert_allclose(again.q, meant.q, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(again.tau / scale, meant.tau / scale, rtol=1e-7, atol=1e-7)
        same_table(corrected, reading)
        made += len(reading.steps) > 1
    assert made > 30 and slower > 0


def test_samples_are_those_of_the_record_read_again(start: Any) -> None:
    """The search never reads a file again: its samples are those that a new problem would have."""
    first, robot, model, folder = start
    for cause in causes_of(first):
        reading = first.changed(cause)
        if reading is None or cause.constants or cause.kind != "exchange":
            continue
        again, _ = read_again(reading, robot, folder)
        case = case_of(problem(model, [again], first.data.case.study), None)
        samples = reading.samples()
        assert not isinstance(case, runtime.InputError)
        at = np.searchsorted(case.samples.t, samples.t).clip(max=len(case.samples) - 1)
        near = np.abs(case.samples.t[at] - samples.t) < 1e-9
        assert near.mean() > 0.5
        for key in ("q", "qd", "tau"):
            a, b = getattr(case.samples, key)[at[near]], getattr(samples, key)[near]
            np.testing.assert_allclose(a, b, atol=1e-6 * np.abs(b).max())


def test_angles_are_written_as_multiples() -> None:
    texts = {0.0: "0", np.pi / 2: "pi/2", -np.pi / 2: "-pi/2", np.pi: "pi", 0.3: "0.3"}
    assert {x: angle_text(x) for x in texts} == texts


def test_corrections_of_a_robot() -> None:
    study = study_from_mapping(
        {"robot": {"gravity": [0, "-9.81/2", 0], "frames": {2: {"theta": "q2 + 0.1", "d": 0.6}}}}
    )
    robot = symgen.corrected("planar_2r", study)
    assert [float(g.value({})) for g in robot.gravity] == [0, -4.905, 0]
    assert str(robot.frame(2).theta) == "q2 + 0.1"
    assert robot.sha256.endswith(digest(study.robot))
    assert symgen.corrected("planar_2r", runtime.Study()).sha256 == robot.sha256.partition("+")[0]
    for wrong, told in (
        ({"frames": {9: {"d": 1}}}, "frames.9"),
        ({"frames": {2: {"theta": "q9"}}}, "section `robot`"),
        ({"drives": {"ratio": [0, 1, 2]}}, "section `robot`"),
    ):
        with pytest.raises(DescriptionError, match=told):
            symgen.corrected("planar_2r", study_from_mapping({"robot": wrong}))
    with pytest.raises(SettingsError, match="robot"):
        study_from_mapping({"robot": {"frames": {1: {"length": 2}}}})


def test_delays_are_read(tmp_path: Path) -> None:
    """tau'(t) = tau(t + delay), joint by joint; samples without a torque at an end are left out."""
    t, q, _, _ = motion(4, 4.0)
    tau = np.stack([np.sin(t), np.cos(2 * t), t], axis=1)
    delay = (0.0, 0.013, -0.02)
    late = np.stack([np.sin(t), np.cos(2 * (t - 0.013)), t + 0.02], axis=1)
    written(tmp_path, t, q, late)
    study = located(
        study_from_mapping({"record": {"files": ["run.csv"], "delay": list(delay)}}), tmp_path
    )
    record = runtime.read_record(study.record[0])
    k = np.searchsorted(t, record.t[0] - 1e-9)
    want = tau[k : k + len(record)]
    assert len(record) == len(t) - 3 - 4 and record.t[0] == pytest.approx(0.02)
    np.testing.assert_allclose(record.q, q[k : k + len(record)], atol=1e-8)
    np.testing.assert_allclose(record.tau[5:-5], want[5:-5], atol=1e-6)
    with pytest.raises(InputError, match=r"record\.delay"):
        runtime.read_record(replace(study.record[0], delay=(0.1, 0.1)))
    with pytest.raises(InputError, match="in s"):
        runtime.read_record(replace(study.record[0], delay=20.0))
    assert RATE == 200


def test_a_delay_that_the_study_gives_stays(start: Any) -> None:
    """A found delay is added to it, another order moves it, and another rate shortens it."""
    first, *_ = start
    study = delayed(first.study, np.array([0.01, 0.02, 0.03]))
    given = replace(first, study=study)
    assert given.late(np.full(3, 0.005), "").study["record"][0]["delay"] == [0.015, 0.025, 0.035]
    for cause in causes_of(given):
        reading = given.changed(cause)
        if reading is None or cause.kind not in ("rate", "exchange"):
            continue
        order = np.abs(cause.T).argmax(axis=1)
        want = np.array([0.01, 0.02, 0.03])[order] / cause.rate
        np.testing.assert_allclose(reading.study["record"][0]["delay"], want, rtol=1e-9)
