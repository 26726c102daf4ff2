"""Tool frames, known loads on them, and loads identified at them; transforms against pinocchio's
Inertia.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from test_payload import BOX, emitted, observe, record
from test_payload import STUDY as PAYLOAD_STUDY

from runtime import InputError, load_model
from runtime.ground.errors import SettingsError
from runtime.payload.load import load_effect, load_of_body, mount, payload, ten_parameters
from runtime.physical.inertia import INERTIAL, physical_model, pseudo_inertia
from runtime.study import PayloadSettings
from symgen.description import load_robot, parse, parse_robot
from symgen.description.expression import Expression
from symgen.description.robot import Frame
from symgen.emit.generate import generate_module

PINOCCHIO = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
TOOL = {"gamma": "pi/4", "b": "0.1", "alpha": "pi/3", "d": "0.05", "theta": "0.2", "r": "0.065"}


def with_tool(name: str, *, massless: bool):
    """A packaged robot with a fixed frame on its last link."""
    robot = load_robot(name)
    j = len(robot.frames) + 1
    geometry: dict[str, Expression] = {key: parse(text, ()) for key, text in TOOL.items()}
    frames = (*robot.frames, Frame(j, j - 1, 2, 0, **geometry))
    return replace(
        robot,
        name=f"{name}_tool",
        frames=frames,
        massless=robot.massless | ({j} if massless else set()),
    )


@pytest.fixture(scope="module", params=[True, False], ids=["massless", "own link"])
def arm(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("tool") / "tx40_tool.py"
    path.write_text(generate_module(with_tool("tx40", massless=request.param)))
    return load_model(path, trust=True)


def test_ten_parameters_are_those_of_the_pseudo_inertia() -> None:
    ten = np.arange(1.0, 11.0)
    np.testing.assert_allclose(ten_parameters(pseudo_inertia(ten)), ten, rtol=1e-14)


def test_moved_parameters_are_pinocchios(arm) -> None:
    """Inertia.se3Action with the pose of the tool frame in the link."""
    at = mount(arm, 7, 6)
    q = np.linspace(-1, 1, 6)
    T = arm.frame_poses(q)
    np.testing.assert_allclose(at.T, np.linalg.inv(T[5]) @ T[6], atol=1e-14)
    body = pin.Inertia(2.0, np.array([0.1, -0.03, 0.15]), np.diag([0.02, 0.03, 0.025]))
    here, there = (
        dict(zip(PINOCCHIO, x.toDynamicParameters(), strict=True))
        for x in (body, body.se3Action(pin.SE3(at.T)))
    )
    np.testing.assert_allclose(
        at.action @ [here[f] for f in INERTIAL],
        [there[f] for f in INERTIAL],
        rtol=1e-12,
        atol=1e-14,
    )


def test_data_sheet_of_a_body_as_pinocchio() -> None:
    I, c, R = (
        np.diag([0.02, 0.03, 0.025]),
        np.array([0.1, -0.03, 0.15]),
        pin.exp3(np.array([0.3, -0.5, 0.2])),
    )
    ours = load_of_body(2.0, c, I, R)
    theirs = dict(
        zip(PINOCCHIO, pin.Inertia(2.0, c, R @ I @ R.T).toDynamicParameters(), strict=True)
    )
    assert all(np.isclose(ours[f], theirs[f], rtol=1e-13, atol=1e-16) for f in INERTIAL)
    with pytest.raises(InputError, match="positive"):
        load_of_body(0.0, c)
    with pytest.raises(InputError, match="symmetric"):
        load_of_body(1.0, c, np.arange(9.0).reshape(3, 3))


def test_known_load_changes_torques_as_the_work_of_a_point_mass(arm) -> None:
    """M (J_P' (a - g)) of a point mass at the tool frame, from the Jacobian of that frame alone: an
    independent route at rest and in motion.
    """
    q, qd, qdd = np.random.default_rng(3).uniform(-1, 1, (3, 6))
    dX = load_effect(arm, {"M": 1.5}, frame=7)
    extra = arm.inverse_dynamics(q, qd, qdd, dX)
    h = 1e-5
    J = arm.jacobian(q, frame=7)[:3]
    Jd = (arm.jacobian(q + h * qd, frame=7)[:3] - arm.jacobian(q - h * qd, frame=7)[:3]) / (2 * h)
    np.testing.assert_allclose(extra, 1.5 * J.T @ (J @ qdd + Jd @ qd + [0, 0, 9.81]), atol=1e-8)


def test_a_body_does_not_care_about_the_frame(arm) -> None:
    """The same body told at the tool frame and at the frame of the link."""
    at = mount(arm, 7, 6)
    ten = np.array([BOX[f] for f in INERTIAL])
    moved = dict(zip(INERTIAL, at.action @ ten, strict=True))
    np.testing.assert_allclose(
        load_effect(arm, BOX, frame=7), load_effect(arm, moved, link=6), atol=1e-13
    )
    further = load_effect(arm, BOX, frame=7, D3=0.3)  # another geometry
    assert np.abs(further - load_effect(arm, BOX, frame=7)).max() > 1e-3


def test_load_identified_at_the_tool_frame(arm) -> None:
    """Simulated with the load on the tool: all ten come back at the tool frame, and a weighed mass
    enters there.
    """
    physical = physical_model(arm)
    at = mount(arm, 7)
    on_link = dict(
        zip(INERTIAL, mount(arm, 7, 6).action @ np.array([BOX[f] for f in INERTIAL]), strict=True)
    )
    without = [observe(arm, record(arm, {}, 1, 0.0, link=6), PAYLOAD_STUDY)]
    loaded = [observe(arm, record(arm, on_link, 2, 0.0, link=6), PAYLOAD_STUDY)]
    found = payload(arm, without, loaded, PayloadSettings(frame=7))
    assert (
        found.place == f"link {7 if 7 in physical.links else 6}, in Khalil's frame 7"
        and found.link == at.link
        and found.summary()["frame"] == 7
    )
    np.testing.assert_allclose(found.value, [BOX[f] for f in found.names], atol=5e-3)
    known = payload(arm, without, loaded, PayloadSettings(frame=7, known={"M": 2.0}))
    np.testing.assert_allclose([known[f] for f in INERTIAL], [BOX[f] for f in INERTIAL], atol=5e-3)


def test_frames_that_cannot_carry(arm) -> None:
    tx40 = emitted("tx40")
    for arguments, words in (
        ((8,), "frames 1 to 7"),
        ((7, 5), "not fixed to link 5"),
        ((None, 9), "no link 9"),
    ):
        with pytest.raises(InputError, match=words):
            mount(arm, *arguments)
    with pytest.raises(InputError, match="unknown parameter mass"):
        load_effect(tx40, {"mass": 1.0})
    with pytest.raises(SettingsError, match=r"payload\.frame"):
        payload(
            tx40,
            [observe(tx40, record(tx40, {}, 1, 0.0), PAYLOAD_STUDY)] * 1,
            [object()],
            PayloadSettings(frame=9),
        )
    assert mount(tx40).link == mount(tx40, 6).link == 6


BELT = """
symgen: 1
name: belt
title: two joints in a plane whose viscous friction a belt couples by KR
gravity: [0, -g, 0]
constants: {L: 0.4, KR: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: L, theta: q2, r: 0}
elements:
  FV: {kind: viscous, along: all}
  FVM: {kind: viscous, form: {2: 2*KR*q1*q2}}
"""


def test_conditions_are_those_of_the_constants_given(tmp_path) -> None:
    """FV1 q1^2 + FV2 q2^2 + 2 KR FVM2 q1 q2 takes power: its matrix held the KR of the robot file
    whatever was given.
    """
    models = {}
    for ratio in ("0.5", "2.0"):
        (tmp_path / f"belt_{ratio[0]}.py").write_text(
            generate_module(
                parse_robot(BELT.replace("KR: 0.5", f"KR: {ratio}").encode(), "belt.yaml")
            )
        )
        models[ratio] = load_model(tmp_path / f"belt_{ratio[0]}.py", trust=True)
    given, expected = physical_model(models["0.5"], {"KR": 2.0}), physical_model(models["2.0"])
    assert [c.name for c in given.conditions] == [c.name for c in expected.conditions]
    for one, other in zip(given.conditions, expected.conditions, strict=True):
        np.testing.assert_array_equal(one.B, other.B)
    (own,) = (
        c for c in physical_model(models["0.5"]).conditions if c.name == "viscous of joints 1, 2"
    )
    (doubled,) = (c for c in given.conditions if c.name == "viscous of joints 1, 2")
    assert own.B.max() == 1.0 and doubled.B.max() == 2.0
