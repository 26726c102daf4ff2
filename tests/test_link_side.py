"""Torques of sensors behind the gears: the drives have no part in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import planar_arm
import pytest

import runtime
import symgen
from runtime.core.errors import SettingsError
from runtime.study import study_from_mapping

DRIVES = ("Ia", "FV", "FS")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("link") / "arm.yaml"
    path.write_text(
        """symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {L: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: L, theta: q2, r: 0}
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
  OFFSET: {kind: offset, along: all}
"""
    )
    return symgen.model(path)


def record(model, side):
    """Torques of a link without rotors and friction, by pinocchio; with them at the joint."""
    pin = pytest.importorskip("pinocchio")
    arm = pin.Model()
    arm.gravity.linear = np.array([0, -9.81, 0])
    bodies = (
        (3.0, [0.2, 0.03, 0.0], 0.05, [0, 0, 0]),
        (1.5, [0.15, -0.02, 0.0], 0.02, [0.5, 0, 0]),
    )
    parent = 0
    for k, (mass, centre, inertia, place) in enumerate(bodies):
        at = pin.SE3(np.eye(3), np.array(place, dtype=float))
        parent = arm.addJoint(parent, pin.JointModelRZ(), at, f"j{k}")
        body = pin.Inertia(mass, np.array(centre), inertia * np.eye(3))
        arm.appendBodyToJoint(parent, body, pin.SE3.Identity())
    t = np.arange(5000) / 500.0
    w = np.array([[1.3, 3.1], [1.7, 4.3]])
    phase = w * t[:, None, None] + 0.4
    q, qd, qdd = np.sin(phase).sum(-1), (w * np.cos(phase)).sum(-1), -(w**2 * np.sin(phase)).sum(-1)
    data = arm.createData()
    tau = np.array([pin.rnea(arm, data, *x) for x in zip(q, qd, qdd, strict=True)])
    drive = [0.4, 0.2] * qdd + [2.0, 1.0] * qd + [1.0, 0.5] * np.sign(qd)
    return runtime.Record(t, q, tau + 0.3 + (0 if side == "link" else drive), name=side)


def study(side):
    settings = {"files": ["a.csv"], "side": side}
    return study_from_mapping({"record": settings, "signals": {"lowpass": {"cutoff": 20}}})


def test_a_sensor_behind_the_gear_sees_no_drive(model):
    link = runtime.identify(model, record(model, "link"), study("link"), plausible=False).estimate
    assert not [name for name in link.names if name.startswith(DRIVES)]
    assert {"OFFSET1", "OFFSET2"} <= {*link.names} and link.relative_error < 0.2
    whole = runtime.identify(
        model, record(model, "joint"), study("joint"), plausible=False
    ).estimate
    assert link["ZZ1R"] == pytest.approx(whole["ZZ1R"] - 0.4, abs=5e-3)
    assert whole["FV1"] == pytest.approx(2.0, abs=0.05)


def test_sides_of_records_that_are_fitted_together_agree(model):
    one, other = study("link").record[0], study("joint").record[0]
    with pytest.raises(SettingsError, match=r"side: link\) in .* and not in"):
        both = replace(study("link"), record=(one, other))
        runtime.identify(model, record(model, "link"), both, plausible=False)


@pytest.fixture(scope="module")
def arm():
    return planar_arm.arm()


def test_a_record_keeps_its_side_without_its_study(arm, tmp_path):
    """11 parameters before: the side was a setting of the study only."""
    X = planar_arm.parameters(arm, link=True)
    planar_arm.written(tmp_path / "link.csv", planar_arm.record(arm, 0, X))
    path = tmp_path / "link.yaml"
    path.write_text("symgen: 1\nrecord: {files: link.csv, side: link}\n")
    run = runtime.read_record(path, arm)
    assert run.origin.sides == ("link", "link")
    for study in (None, runtime.load_study(path)):
        found = runtime.identify(arm, run, study, plausible=False).estimate.names
        assert len(found) == 6 and not [x for x in found if x.startswith(DRIVES)]


def test_a_file_read_alone_has_the_side_of_the_study(arm, tmp_path):
    X = planar_arm.parameters(arm, link=True)
    file = planar_arm.written(tmp_path / "link.csv", planar_arm.record(arm, 0, X))
    run = runtime.read_record(file, arm)
    assert run.origin.sides is None
    found = runtime.identify(arm, run, study("link"), plausible=False)
    assert len(found.estimate.names) == 6


def test_sensors_behind_the_gears_are_no_doubt(arm):
    """ "Were the torques measured?" and the ratio of the inertia torques were doubts."""
    run = planar_arm.record(arm, 0, planar_arm.parameters(arm, link=True))
    settings = planar_arm.study(record={"files": "a.csv", "side": "link"})
    result = runtime.identify(arm, run, settings, plausible=True)
    assert result.checklist.state == "good", result.checklist.doubt
    known = result.part("plausibility").robot_values
    np.testing.assert_allclose(known.inertia, 1.0, atol=0.02)
    plain = runtime.identify(arm, run, planar_arm.study(), plausible=True)
    check = next(c for c in plain.checklist.checks if c.question == "Were the torques measured?")
    assert check.state == "doubtful" and "record.torque_side: link" in check.remedy


def test_records_made_of_arrays_have_the_sides_of_the_study(arm):
    run = planar_arm.record(arm, 0, planar_arm.parameters(arm, link=True))
    (record,) = runtime.problem(arm, run, study("link")).records
    assert run.origin.sides is None and record.sides == ("link", "link")


def test_a_robot_behind_its_gears_has_the_physical_set(arm):
    """It had none, because columns of friction are left out."""
    run = planar_arm.record(arm, 0, planar_arm.parameters(arm, link=True))
    settings = planar_arm.study(record={"files": "a.csv", "side": "link"})
    result = runtime.identify(arm, run, settings, plausible=False)
    physical = result.sets["feasible"]
    assert physical.names == result.estimate.names
    np.testing.assert_allclose(physical.X, result.estimate.X, atol=1e-3)
