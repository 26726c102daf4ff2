"""Identification on a base that moves, from records simulated by pinocchio; what is refused, and how."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import runtime
import symgen
from oracles.urdf_robots import ur5
from runtime.core.quaternions import motion_of_pose
from runtime.core.signals.base import INPUTS, base_motion
from runtime.core.study import Signals
from runtime.ground.errors import InputError, SettingsError
from symgen.description.tree_robot import read_tree

RATE, SECONDS = 400.0, 16.0
DOWN = np.array([0.0, 0.0, -9.81])


def fourier(rng, t, count, size):
    """Positions, rates and accelerations of `count` coordinates, five harmonics of 0.1 Hz."""
    k = np.arange(1, 6)
    a, b = rng.normal(size=(2, count, 5)) * size / k
    w = 0.2 * np.pi * k
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    return (
        s @ a.T + c @ b.T,
        (c * w) @ a.T - (s * w) @ b.T,
        -(s * w**2) @ a.T - (c * w**2) @ b.T,
    )


def turned(e, ed, edd):
    """R = Rz(yaw) Ry(pitch) Rx(roll), and w, wd in its axes, from e = (roll, pitch, yaw) and its rates."""
    r, p = e[:2]
    sr, cr, sp, cp = np.sin(r), np.cos(r), np.sin(p), np.cos(p)
    E = np.array([[1, 0, -sp], [0, cr, sr * cp], [0, -sr, cr * cp]])
    of_r = np.array([[0, 0, 0], [0, -sr, cr * cp], [0, -cr, -sr * cp]])
    of_p = np.array([[0, 0, -cp], [0, 0, -sr * sp], [0, 0, -cr * sp]])
    return pin.rpy.rpyToMatrix(*e), E @ ed, E @ edd + (of_r * ed[0] + of_p * ed[1]) @ ed


def simulated(seed):
    """t, q, tau of the UR5 on a base in motion, with that motion (N, 9) and its pose (N, 7), exact."""
    model = pin.buildModelFromXML(ur5(), pin.JointModelFreeFlyer())
    data, rng = model.createData(), np.random.default_rng(seed)
    t = np.arange(int(RATE * SECONDS)) / RATE
    q, qd, qdd = fourier(rng, t, model.nv - 6, 0.7)
    p, pd, pdd = fourier(rng, t, 3, 0.2)
    angles = fourier(rng, t, 3, 0.4)
    tau, base, pose = np.empty_like(q), np.empty((len(t), 9)), np.empty((len(t), 7))
    for k in range(len(t)):
        R, w, wd = turned(*(x[k] for x in angles))
        v, a = R.T @ pd[k], R.T @ pdd[k]
        xyzw = pin.Quaternion(R).coeffs()
        tau[k] = pin.rnea(
            model,
            data,
            np.concatenate([p[k], xyzw, q[k]]),
            np.concatenate([v, w, qd[k]]),
            np.concatenate([a - np.cross(w, v), wd, qdd[k]]),
        )[6:]
        base[k] = [*w, *wd, *(a - R.T @ DOWN)]
        pose[k] = [*p[k], xyzw[3], *xyzw[:3]]
    return t, q, tau, base, pose


@pytest.fixture(scope="module")
def case():
    robot, _ = read_tree(ur5().encode(), "ur5.urdf")
    module = symgen.model(robot, base="moving")
    truth = module.base_parameters(
        dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(module.VALUES)
    )
    return robot, module, dict(zip(module.BASE_PARAMETERS, truth, strict=True)), simulated(3)


def test_the_motion_of_a_pose_is_that_of_the_simulation(case):
    """Positions and quaternions, of either sign, give w0, wd0 and a0, but for the filters."""
    pose, base = case[3][4].copy(), case[3][3]
    flipped = np.random.default_rng(0).choice([-1.0, 1.0], len(pose))
    channels = {
        "base_position": pose[:, :3],
        "base_quaternion": pose[:, 3:] * flipped[:, None],
        "base_gravity": np.broadcast_to(DOWN, (len(pose), 3)),
    }
    found = base_motion(channels, RATE, Signals(lowpass=None, median=1))
    assert tuple(found) == INPUTS
    error = np.abs(np.stack([*found.values()], axis=1) - base)[20:-20].max(axis=0)
    assert (error < 2e-4 * np.abs(base).max(axis=0)).all()


def test_the_rates_of_a_quaternion_do_not_feel_its_length():
    """w0 and wd0 of r u are those of the unit quaternion u, for any function r of time."""
    rng = np.random.default_rng(4)
    u = rng.normal(size=(1, 4))
    u /= np.linalg.norm(u)
    ud = rng.normal(size=(1, 4))
    ud -= (ud @ u.T) * u
    udd = rng.normal(size=(1, 4))
    udd -= (udd @ u.T + ud @ ud.T) * u
    r, rd, rdd, a = 1.1, 0.3, -0.7, rng.normal(size=(1, 3))
    unit = motion_of_pose(a, u, ud, udd)
    other = motion_of_pose(a, r * u, rd * u + r * ud, rdd * u + 2 * rd * ud + r * udd)
    np.testing.assert_allclose(other, unit, atol=1e-12)
    R = pin.Quaternion(*u[0]).matrix()
    np.testing.assert_allclose(unit[0, 6:], R.T @ a[0], atol=1e-12)


@pytest.mark.parametrize("form", ["motion", "pose", "sensor"])
def test_parameters_lie_within_their_intervals(case, form):
    """Noise of torques, encoders and of the motion of the base; least squares in all parameters."""
    _, module, truth, (t, q, tau, base, pose) = case
    rng = np.random.default_rng(11)
    w, wd, a0 = np.hsplit(base, 3)
    r = np.array([0.1, -0.2, 0.3])
    f = a0 + np.cross(wd, r) + np.cross(w, np.cross(w, r))
    forms = {
        "motion": {"base_motion": base + 0.01 * rng.normal(size=base.shape)},
        "pose": {
            "base_position": pose[:, :3] + 2e-5 * rng.normal(size=(len(t), 3)),
            "base_quaternion": pose[:, 3:] + 2e-5 * rng.normal(size=(len(t), 4)),
        },
        "sensor": {
            "base_imu": np.hstack(
                [
                    w + 0.001 * rng.normal(size=w.shape),
                    f + 0.01 * rng.normal(size=f.shape),
                    np.broadcast_to(r, f.shape),
                ]
            )
        },
    }
    channels = forms[form]
    record = runtime.Record(
        t,
        q + 1e-6 * rng.normal(size=q.shape),
        tau + 0.2 * rng.normal(size=tau.shape),
        channels=channels,
    )
    fit = runtime.estimate(module, record)
    assert fit.status == "ok"
    z = np.array([(x - truth[n]) / s for n, x, s in zip(fit.names, fit.X, fit.sigma, strict=True)])
    assert len(z) == len(module.BASE_PARAMETERS)
    assert np.abs(z).max() < 4.5
    assert np.mean(np.abs(z) < 2) > 0.8  # .92 over 4 draws; .94 on a fixed base


def test_a_sensor_on_the_base_is_read_at_its_place_and_in_its_axes(case, tmp_path: Path):
    """Gyroscope in deg/s, accelerometer in g with the other sign, turned and away from frame 0."""
    _, module, _, (t, q, tau, base, _) = case
    w, wd, a0 = np.hsplit(base, 3)
    r, rpy = np.array([0.1, -0.2, 0.3]), np.array([0.4, -0.7, 1.1])
    R = pin.rpy.rpyToMatrix(*rpy)
    f = a0 + np.cross(wd, r) + np.cross(w, np.cross(w, r))
    sensor = np.hstack([np.rad2deg(w) @ R, -f @ R / 9.80665])
    head = ["t", *(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    six = [f"s{k}" for k in range(6)]
    table, names = np.column_stack([t, q, tau, sensor]), ",".join([*head, *six])
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=names, comments="", fmt="%.12g")
    form = (
        "{gyroscope: [s0, s1, s2], accelerometer: [s3, s4, s5], gyroscope_unit: deg/s, "
        "accelerometer_unit: g, specific_force: false, "
        f"mounting: {{position: {r.tolist()}, rotation: {rpy.tolist()}}}}}"
    )
    (tmp_path / "study.yaml").write_text(study_text(form), encoding="utf-8")
    record = runtime.read_record(tmp_path / "study.yaml", module)
    signals = Signals(lowpass=None, median=1)
    found = np.stack([*base_motion(record.channels, RATE, signals).values()], axis=1)
    error = np.abs(found - base)[20:-20].max(axis=0)
    assert (error < 2e-4 * np.abs(base).max(axis=0)).all()


def test_a_base_that_moves_needs_its_motion_and_a_fixed_one_has_none(case):
    robot, module, _, (t, q, tau, base, pose) = case
    with pytest.raises(InputError, match=r"give record\.base: .*payload needs its own `base`"):
        runtime.estimate(module, runtime.Record(t, q, tau))
    moved = runtime.Record(t, q, tau, channels={"base_motion": base})
    with pytest.raises(InputError, match="the base of ur5 is fixed; use --base moving"):
        runtime.estimate(symgen.model(robot), moved)
    narrow = runtime.Record(t, q, tau, channels={"base_motion": base[:, :8]})
    with pytest.raises(InputError, match="base_motion has 8 columns; expected 9"):
        runtime.estimate(module, narrow)
    gap = pose[:, 3:].copy()
    gap[7] = 0.0
    channels = {"base_position": pose[:, :3], "base_quaternion": gap}
    with pytest.raises(InputError, match="length 0 at sample 8; expected 1, without gaps"):
        runtime.estimate(module, runtime.Record(t, q, tau, channels=channels))
    with pytest.raises(InputError, match="not possible for ur5, whose base moves"):
        runtime.excite(module)


def study_text(base: str) -> str:
    n = 6
    return (
        "symgen: 1\nrecord:\n  files: [arm.csv]\n"
        f"  columns: {{t: t, q: [{', '.join(f'q{j + 1}' for j in range(n))}], "
        f"tau: [{', '.join(f'tau{j + 1}' for j in range(n))}]}}\n  base: {base}\n"
    )


def test_a_study_names_the_columns_of_the_base(case, tmp_path: Path):
    """The nine columns, or the pose with the scalar of the quaternion last, read as from arrays."""
    _, module, _, (t, q, tau, base, pose) = case
    head = ["t", *(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    nine, where = [f"b{k}" for k in range(9)], ["x", "y", "z", "qx", "qy", "qz", "qw"]
    table = np.column_stack([t, q, tau, base, pose[:, [0, 1, 2, 4, 5, 6, 3]]])[:400]
    text = ",".join([*head, *nine, *where])
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=text, comments="")
    for form, width in (
        (f"{{motion: [{', '.join(nine)}]}}", 1),
        ("{position: [x, y, z], quaternion: [qx, qy, qz, qw], order: xyzw}", 2),
    ):
        file = tmp_path / "study.yaml"
        file.write_text(study_text(form), encoding="utf-8")
        record = runtime.read_record(file, module)
        assert len(record.channels) == width
        given = {"base_motion": base, "base_position": pose[:, :3], "base_quaternion": pose[:, 3:]}
        for name, x in record.channels.items():
            np.testing.assert_allclose(x, given[name][:400], atol=1e-12)
    for wrong, message in (
        ("{motion: [b0, b1]}", "2 columns; expected 9 columns"),
        ("{position: [x, y, z]}", "position and quaternion belong together"),
        (f"{{motion: [{', '.join(nine)}], position: [x, y, z]}}", "more than one form is given"),
        ("{gyroscope: [b0, b1, b2]}", "gyroscope and accelerometer belong together"),
    ):
        (tmp_path / "study.yaml").write_text(study_text(wrong), encoding="utf-8")
        with pytest.raises(SettingsError, match=message):
            runtime.read_record(tmp_path / "study.yaml", module)


@pytest.mark.parametrize("flying", [False, True])
def test_identified_values_are_written_into_the_file(case, tmp_path: Path, flying):
    """With --base moving, into a URDF, and into one whose root joint is floating: mass of the forearm."""
    _, module, _, (t, q, tau, base, _) = case
    rng = np.random.default_rng(12)
    noisy = tau + 0.1 * rng.normal(size=tau.shape)
    result = runtime.identify(module, runtime.Record(t, q, noisy, channels={"base_motion": base}))
    text = ur5()
    if flying:
        root = text.split('<link name="')[1].split('"')[0]
        text = text.replace(
            "</robot>",
            '<link name="earth"/><joint name="fly" type="floating"><parent link="earth"/>'
            f'<child link="{root}"/></joint></robot>',
        )
    file = tmp_path / "ur5.urdf"
    file.write_text(text, encoding="utf-8")
    applied = symgen.apply(result, file, base="moving")
    new = tmp_path / "new.urdf"
    applied.write(new)
    before, after = (read_tree(f.read_bytes(), f.name)[0] for f in (file, new))
    assert after.base == before.base == ("free" if flying else "fixed")
    X = [
        module.base_parameters(dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(r.values))
        for r in (before, after)
    ]
    inertial = [n for n in module.BASE_PARAMETERS if n[:2] in ("XX", "ZZ", "MX", "MY")]
    for n in inertial:
        k = module.BASE_PARAMETERS.index(n)
        assert abs(X[1][k] - X[0][k]) < 0.02 * max(map(abs, X[0])), n
