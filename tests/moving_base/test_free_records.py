"""Identification of a free base: six more rows, contacts, flight; records simulated by pinocchio."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from moving_base.test_records import DOWN, fourier, turned

import runtime
import symgen
from oracles.urdf_robots import ur5
from runtime.compose import problem
from runtime.core.problem import observe_rows
from runtime.ground.errors import InputError
from runtime.sensor_axes import sensor_axes
from symgen.description.tree_robot import read_tree

RATE, SECONDS = 200.0, 12.0
ELBOW, WRIST = 3, 5  # frames on which the world pushes


@pytest.fixture(scope="module")
def case():
    """The robot as a free base, its true X by name, and a motion with the wrench that it takes."""
    robot, _ = read_tree(ur5().encode(), "ur5.urdf")
    module = symgen.model(robot, base="free")
    chi = dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(module.VALUES)
    truth = dict(zip(module.BASE_PARAMETERS, module.base_parameters(chi), strict=True))
    model = pin.buildModelFromXML(ur5(), pin.JointModelFreeFlyer())
    data, rng = model.createData(), np.random.default_rng(7)
    t = np.arange(int(RATE * SECONDS)) / RATE
    q, qd, qdd = fourier(rng, t, model.nv - 6, 0.7)
    p, pd, pdd = fourier(rng, t, 3, 0.2)
    angles = fourier(rng, t, 3, 0.4)
    tau, base = np.empty((len(t), model.nv)), np.empty((len(t), 9))
    for k in range(len(t)):
        R, w, wd = turned(*(x[k] for x in angles))
        v, a = R.T @ pd[k], R.T @ pdd[k]
        Q = np.concatenate([p[k], pin.Quaternion(R).coeffs(), q[k]])
        motion = np.concatenate([v, w, qd[k]]), np.concatenate([a - np.cross(w, v), wd, qdd[k]])
        tau[k] = pin.rnea(model, data, Q, *motion)
        base[k] = [*w, *wd, *(a - R.T @ DOWN)]
    return robot, module, truth, (t, q, tau, base)


def pushed(q, tau, frame, wrench):
    """What is left of the torques of a free-flyer if a wrench in local axes pushes a link, by pinocchio.

    frame : number of the joint whose frame of Khalil the wrench is in.
    """
    robot, _ = read_tree(ur5().encode(), "ur5.urdf")
    module = symgen.model(robot, base="free")
    model = pin.buildModelFromXML(ur5(), pin.JointModelFreeFlyer())
    data, left = model.createData(), tau.copy()
    joint = frame + 1  # universe and free-flyer come before
    poses = module.frame_poses(q)[:, frame - 1]
    for k in range(len(q)):
        Q = np.concatenate([np.zeros(6), [1.0], q[k]])
        pin.computeJointJacobians(model, data, Q)
        J = pin.getJointJacobian(model, data, joint, pin.LOCAL)
        own = data.oMi[joint].actInv(pin.SE3(poses[k, :3, :3], poses[k, :3, 3]))
        left[k] -= J.T @ own.act(pin.Force(wrench[k, :3], wrench[k, 3:])).vector
    return left


def test_contacts_enter_joints_and_base_as_in_pinocchio(case):
    """Exact records: with two contacts and the wrench on the base, Y is W X to rounding of filters."""
    robot, module, truth, (t, q, tau, base) = case
    rng = np.random.default_rng(1)
    waves = np.sin(np.outer(t, rng.uniform(1, 9, 6)) + rng.uniform(0, 6, 6))
    elbow, wrist = waves * [30, 20, 40, 3, 4, 5], np.roll(waves, 2, axis=1) * [9, 9, 9, 1, 2, 1]
    left = pushed(q, pushed(q, tau, ELBOW, elbow), WRIST, wrist)
    channels = {
        "base_motion": base,
        "wrench0": left[:, :6],
        f"wrench{ELBOW}": elbow,
        f"wrench{WRIST}": wrist,
    }
    record = runtime.Record(t, q, left[:, 6:], channels=channels)
    torque = problem(module, record).records[0].torque
    np.testing.assert_allclose(torque, np.hstack([tau[:, 6:], tau[:, :6]]), atol=1e-9)
    fit = runtime.estimate(module, record)
    assert fit.status == "ok"
    assert fit.names == module.BASE_PARAMETERS
    size = max(map(abs, truth.values()))
    np.testing.assert_allclose(fit.X, [*truth.values()], atol=2e-3 * size)
    moving = symgen.model(robot, base="moving")
    alone = runtime.estimate(moving, record)  # the same contacts, in the rows of the joints
    assert alone.status == "ok"
    of_joints = [truth[name] for name in alone.names if name in truth]
    found = [x for name, x in zip(alone.names, alone.X, strict=True) if name in truth]
    np.testing.assert_allclose(found, of_joints, atol=2e-3 * size)


def test_parameters_of_a_free_base_lie_within_their_intervals(case):
    """Noise of torques, wrench, encoders and of the sensor on the base; link 0 among them."""
    _, module, truth, (t, q, tau, base) = case
    w, _, a0 = np.hsplit(base, 3)
    z = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        noise = (
            rng.normal(size=tau.shape) * np.r_[np.full(3, 1.0), np.full(3, 0.3), np.full(6, 0.2)]
        )
        w_noisy, a_noisy = w + 1e-3 * rng.normal(size=w.shape), a0 + 0.01 * rng.normal(size=w.shape)
        imu = np.hstack([w_noisy, a_noisy, np.zeros_like(w)])
        record = runtime.Record(
            t,
            q + 1e-6 * rng.normal(size=q.shape),
            (tau + noise)[:, 6:],
            channels={"base_imu": imu, "wrench0": (tau + noise)[:, :6]},
        )
        fit = runtime.estimate(module, record)
        assert fit.status == "ok"
        z += [(x - truth[n]) / s for n, x, s in zip(fit.names, fit.X, fit.sigma, strict=True)]
        mass = dict(zip(fit.names, fit.X, strict=True))["M0R"]
        assert abs(mass - truth["M0R"]) < 0.002 * truth["M0R"]
    assert np.abs(z).max() < 5
    assert np.mean(np.abs(z) < 2) > 0.8


def test_the_rows_of_the_base_alone_tell_what_needs_no_torque_sensor(case):
    """Without torques: no rotors, no friction; the base parameters of the links as before."""
    _, module, truth, (t, q, tau, base) = case
    record = runtime.Record(
        t, q, 0 * tau[:, 6:], channels={"base_motion": base, "wrench0": tau[:, :6]}
    )
    rows = observe_rows(problem(module, record))
    assert rows.rows[:6] == (0,) * 6
    assert min(rows.rows[6:]) > 0
    fit = runtime.estimate(module, record)
    lost = [n for n, s in zip(fit.names, fit.sigma, strict=True) if not np.isfinite(s)]
    assert fit.status == "rank-deficient"
    assert lost == [n for n in fit.names if n in module.ELEMENTS]
    found = dict(zip(fit.names, fit.X, strict=True))
    size = max(map(abs, truth.values()))
    for name in ("M0R", "MX2R", "XX1R", "MZ0R"):
        assert abs(found[name] - truth[name]) < 2e-3 * size


def test_a_flight_and_what_it_reveals(case):
    """Without forces from outside: the joints alone say how heavy all is, up to what they feel."""
    _, module, truth, (t, _, _, _) = case
    X = np.array([*truth.values()])
    n = len(module.JOINTS)
    rng = np.random.default_rng(2)
    q, qd, qdd = fourier(np.random.default_rng(3), t, n, 0.5)
    w0 = rng.normal(size=3) * 0.1
    # the torques that make the joints move so, and the motion of the base that follows
    flight = np.empty((len(t), 9))
    for k in range(len(t)):
        state = np.concatenate([w0, np.zeros(6)])
        rest = module.inverse_dynamics(state, q[k], qd[k], qdd[k], X)
        A = module.inertia_matrix(q[k], X)
        moved = np.linalg.solve(A[:6, :6], -rest[:6])
        flight[k] = [*w0, *moved[3:], *moved[:3]]
        w0 = w0 + moved[3:] / RATE
    torque = module.inverse_dynamics(flight, q, qd, qdd, X)
    assert np.abs(torque[:, :6]).max() < 1e-9 * np.abs(torque).max()
    channels = {"base_motion": flight, "wrench0": np.zeros((len(t), 6))}
    record = runtime.Record(t, q, torque[:, 6:], channels=channels)
    fit = runtime.estimate(module, record)
    assert fit.rank >= len(module.BASE_PARAMETERS) - 1


def test_what_a_free_base_needs_is_said_in_one_sentence(case):
    _, module, _, (t, q, tau, base) = case
    motion = {"base_motion": base}
    with pytest.raises(
        InputError, match=r"does not say what acts on it; give record\.columns: .*none for"
    ):
        runtime.estimate(module, runtime.Record(t, q, tau[:, 6:], channels=motion))
    flight = motion | {"wrench0": np.zeros((len(t), 6))}
    with pytest.raises(InputError, match="all torques and all wrenches are zero"):
        runtime.estimate(module, runtime.Record(t, q, 0 * tau[:, 6:], channels=flight))
    with pytest.raises(InputError, match="wrench0 has 5 columns; expected 6"):
        bad = motion | {"wrench0": np.zeros((len(t), 5))}
        runtime.estimate(module, runtime.Record(t, q, tau[:, 6:], channels=bad))
    with pytest.raises(InputError, match=r"wrench9: ur5 has the frames 0 to"):
        bad = motion | {"wrench9": np.ones((len(t), 6))}
        runtime.estimate(module, runtime.Record(t, q, tau[:, 6:], channels=bad))
    with pytest.raises(InputError, match=r"the record does not say how; give record\.base"):
        only = {"wrench0": tau[:, :6]}
        runtime.estimate(module, runtime.Record(t, q, tau[:, 6:], channels=only))
    with pytest.raises(InputError, match="not possible for ur5, whose base moves"):
        runtime.excite(module)
    record = runtime.Record(t, q, tau[:, 6:], channels=motion | {"wrench0": tau[:, :6]})
    with pytest.raises(InputError, match="repair of a study does not support a free base"):
        runtime.repair(module, record)


def test_a_study_names_wrenches_or_flight(case, tmp_path: Path):
    _, module, _, (t, q, tau, base) = case
    head = ["t", *(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    head += [*(f"b{k}" for k in range(9)), *(f"w{k}" for k in range(6))]
    table = np.column_stack([t, q, tau[:, 6:], base, tau[:, :6]])[:400]
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=",".join(head), comments="")
    text = (
        "symgen: 1\nrecord:\n  files: [arm.csv]\n  columns: {wrench: WRENCH}\n"
        f"  base: {{motion: [{', '.join(f'b{k}' for k in range(9))}]}}\n"
    )
    file = tmp_path / "study.yaml"
    for wrench, expected in (
        ("{0: [w0, w1, w2, w3, w4, w5]}", tau[:400, :6]),
        ("none", np.zeros((400, 6))),
    ):
        file.write_text(text.replace("WRENCH", wrench), encoding="utf-8")
        record = runtime.read_record(file, module)
        np.testing.assert_allclose(record.channels["wrench0"], expected)
        np.testing.assert_allclose(record.tau, tau[:400, 6:])
    late = np.sin(3 * (t - 0.02))  # as logged 20 ms late
    table[:, 13] = late[:400]
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=",".join(head), comments="")
    text = text.replace("{motion:", "{delay: 0.02, motion:").replace("WRENCH", "none")
    file.write_text(text, encoding="utf-8")
    record = runtime.read_record(file, module)
    assert len(record) == 396
    np.testing.assert_allclose(
        record.channels["base_motion"][:, 0], np.sin(3 * record.t), atol=1e-6
    )
    with pytest.raises(InputError, match="says that the robot flies, but its base is fixed"):
        runtime.read_record(file, symgen.model("tx40"))


def test_a_wrench_that_is_zero_is_called_so():
    """The six rows of a robot that flies were printed as "FX0 no motor"."""
    model = symgen.model("planar_2r", base="free")
    rng, t = np.random.default_rng(5), np.arange(0, 6, 0.01)
    q, base = (np.sin(np.outer(t, rng.uniform(1, 6, n))) for n in (2, 9))
    channels = {"base_motion": base, "wrench0": np.zeros((len(t), 6))}
    tau = rng.standard_normal((len(t), 2))
    brief = runtime.identify(model, runtime.Record(t, q, tau, channels=channels)).brief()
    assert "FX0 zero" in brief and "no motor" not in brief


def test_identified_values_of_link_0_are_written_into_the_file(case, tmp_path: Path):
    _, module, truth, (t, q, tau, base) = case
    rng = np.random.default_rng(12)
    noisy = tau + 0.1 * rng.normal(size=tau.shape)
    record = runtime.Record(
        t, q, noisy[:, 6:], channels={"base_motion": base, "wrench0": noisy[:, :6]}
    )
    result = runtime.identify(module, record)
    assert result.verdict is not None
    file = tmp_path / "ur5.urdf"
    heavier = ur5().replace('<mass value="4.0"', '<mass value="4.5"', 1)
    file.write_text(heavier, encoding="utf-8")
    new = tmp_path / "new.urdf"
    symgen.apply(result, file, base="free").write(new)
    after = symgen.load_robot(new, base="free")
    X = module.base_parameters(dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(after.values))
    found = dict(zip(module.BASE_PARAMETERS, X, strict=True))
    assert abs(found["M0R"] - truth["M0R"]) < 0.01 * truth["M0R"]
    assert "M0" in after.values


@pytest.mark.parametrize(
    ("rpy", "sign", "unit", "told"),
    [
        ((np.pi / 2, 0, 0), 1, 1, "mounting.rotation: [1.571, 0, 0]"),
        ((0, np.pi / 2, np.pi), 1, 9.80665, "accelerometer_unit: g"),
        ((0, 0, 0), -1, 1, "{specific_force: false}"),
        ((0, 0, 0), 1, 1, None),
    ],
)
def test_a_sensor_that_is_mounted_or_read_otherwise_is_told(case, rpy, sign, unit, told):
    """Readings in the axes of a turned sensor, taken as those of frame 0: the verdict names the turn."""
    _, module, _, (t, q, tau, base) = case
    w, _, a0 = np.hsplit(base, 3)
    R = pin.rpy.rpyToMatrix(*rpy)
    imu = np.hstack([w @ R, sign * a0 @ R / unit, 0 * w])
    record = runtime.Record(t, q, tau[:, 6:], channels={"base_imu": imu, "wrench0": tau[:, :6]})
    prepared = problem(module, record)
    result = SimpleNamespace(
        problem=prepared, model=prepared.model, estimate=runtime.estimate(module, record)
    )
    doubt = sensor_axes(result)
    if told is None:
        assert doubt is None
        return
    assert told in doubt.sentence
    turned_back = re.search(r"rotation: \[(.*?)\]", doubt.sentence)
    if any(rpy):
        found = pin.rpy.rpyToMatrix(*map(float, turned_back[1].split(",")))
        np.testing.assert_allclose(found, R, atol=1e-3)
    else:
        assert turned_back is None


PLACES = {
    "pad": ("tool0", (0.02, -0.05, 0.11), (0.4, -0.7, 1.9)),
    "eye": ("base", (-0.1, 0.06, 0.2), (-0.5, 0.3, 2.2)),
}


def with_places(text: str) -> str:
    """Add a link at each of PLACES, on a fixed joint, to a URDF."""
    more = "".join(
        f'<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{" ".join(map(str, xyz))}" '
        f'rpy="{" ".join(map(str, rpy))}"/></joint>'
        for name, (parent, xyz, rpy) in PLACES.items()
    )
    return text.replace("</robot>", f"{more}</robot>")


def test_wrenches_at_named_links_are_those_of_pinocchio(case, tmp_path: Path):
    """A pad on the last link, an eye on the base: their forces in their axes, about their origins."""
    _, _, _, (t, q, tau, base) = case
    t, q, tau, base = (x[:300] for x in (t, q, tau, base))
    file = tmp_path / "ur5.urdf"
    file.write_text(with_places(ur5()), encoding="utf-8")
    module = symgen.model(file, base="free")
    rng = np.random.default_rng(4)
    pushes = {name: rng.normal(size=(len(t), 6)) * [30, 20, 40, 3, 4, 5] for name in PLACES}
    model = pin.buildModelFromXML(with_places(ur5()), pin.JointModelFreeFlyer())
    data, left = model.createData(), tau.copy()
    for k in range(len(t)):
        Q = np.concatenate([np.zeros(6), [1.0], q[k]])
        for name, x in pushes.items():
            left[k] -= pin.computeFrameJacobian(model, data, Q, model.getFrameId(name)).T @ x[k]
    columns = {
        "q": q,
        "tau": left[:, 6:],
        "b": base,
        "w": left[:, :6],  # of what holds the base, about the origin of frame 0
        **pushes,
    }
    heads = [f"{key}{k}" for key, x in columns.items() for k in range(1, x.shape[1] + 1)]
    table = np.column_stack([t, *columns.values()])
    text = ",".join(["t", *heads])
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=text, comments="", fmt="%.17g")
    six = {key: "[" + ", ".join(f"{key}{k}" for k in range(1, 7)) + "]" for key in ("w", *PLACES)}
    study = tmp_path / "study.yaml"

    def read(wrench: str, model=module) -> runtime.Record:
        study.write_text(
            f"symgen: 1\nrecord:\n  files: [arm.csv]\n  columns: {{wrench: {{{wrench}}}}}\n"
            f"  base: {{motion: [{', '.join(f'b{k}' for k in range(1, 10))}]}}\n",
            encoding="utf-8",
        )
        return runtime.read_record(study, model)

    record = read(f"0: {six['w']}, pad: {six['pad']}, eye: {six['eye']}")
    assert {c for c in record.channels if c.startswith("wrench")} == {"wrench0", "wrench6"}
    pin.framesForwardKinematics(model, data, Q)
    of_link = np.linalg.inv(module.frame_poses(q[-1])[5])  # the last link by its number
    pose = pin.SE3(of_link @ data.oMf[model.getFrameId("pad")].homogeneous)
    turned = pose.act(pin.Force(pushes["pad"][-1])).vector
    np.testing.assert_allclose(record.channels["wrench6"][-1], turned, atol=1e-12)
    torque = problem(module, record).records[0].torque
    np.testing.assert_allclose(torque, np.hstack([tau[:, 6:], tau[:, :6]]), atol=1e-9)
    with pytest.raises(InputError, match=r"'pod' is no link, site or fixed frame of .*'pad'"):
        read(f"0: {six['w']}, pod: {six['pad']}")
    with pytest.raises(
        InputError, match="'pad' is the name of a place, but the base of ur5 is fixed"
    ):
        read(f"pad: {six['pad']}", symgen.model(file))
    with pytest.raises(InputError, match="only a robot file with links, sites or fixed frames"):
        read(f"pad: {six['pad']}", None)
    with pytest.raises(InputError, match=r"wrench\.pad: 5 columns; expected 6"):
        read(f"0: {six['w']}, pad: [pad1, pad2, pad3, pad4, pad5]")
