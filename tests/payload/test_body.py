"""Mass, centre and inertia of a load at a named link of the user's file.

The witness is pinocchio: it reads the same URDF, and carries the load at the flange.
"""

from __future__ import annotations

import json

import numpy as np
import pinocchio
import pytest
from typer.testing import CliRunner

import runtime
import symgen
from runtime.compose import payload
from runtime.core.model import load_model
from runtime.ground.errors import SettingsError
from runtime.payload.body import Place, body_at
from runtime.study import study_from_mapping
from symgen.cli.main import app
from symgen.description.mounts import mounts
from symgen.description.tree_robot import read_tree

INERTIA = '<inertial><origin xyz="0.05 0.02 0.01"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0.001" izz="0.015"/></inertial>'
URDF = f"""<robot name="arm"><link name="base"/><link name="a">{INERTIA}</link><link name="b">{INERTIA}</link>
<link name="c">{INERTIA}</link><link name="flange"/><link name="camera"/>
<joint name="ja" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/></joint>
<joint name="jb" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.1 0 0.1" rpy="0.3 0 0"/><axis xyz="0 1 0"/></joint>
<joint name="jc" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0.4 0.1 0" rpy="0 0.7 0.2"/><axis xyz="1 0 0"/></joint>
<joint name="f" type="fixed"><parent link="c"/><child link="flange"/><origin xyz="0.05 0.09 0.01" rpy="-1.5 0.3 0.5"/></joint>
<joint name="g" type="fixed"><parent link="flange"/><child link="camera"/><origin xyz="0 0.02 0.03" rpy="0.1 0 0"/></joint>
</robot>"""
MASS, CENTRE = 2.4, np.array([0.01, -0.02, 0.07])
TENSOR = np.array([[0.013, -0.001, 0.0005], [-0.001, 0.011, 0.0015], [0.0005, 0.0015, 0.008]])
RATE = 200.0


def table(urdf: str, loaded: bool, seed: int, noise: float) -> np.ndarray:
    """t, q, tau of sums of sinusoids, torques by pinocchio; 20 s."""
    model = pinocchio.buildModelFromXML(urdf)
    if loaded:
        frame = model.frames[model.getFrameId("flange")]
        body = pinocchio.Inertia(MASS, CENTRE, TENSOR)
        model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    data, rng = model.createData(), np.random.default_rng(seed)
    t = np.arange(round(20 * RATE)) / RATE
    w = 2 * np.pi * rng.uniform(0.1, 1.0, (3, 4, 1))
    a, phase = rng.uniform(0.2, 0.5, (3, 4, 1)), rng.uniform(0, 2 * np.pi, (3, 4, 1))
    q = (a * np.sin(w * t + phase)).sum(1).T
    qd = (a * w * np.cos(w * t + phase)).sum(1).T
    qdd = -(a * w**2 * np.sin(w * t + phase)).sum(1).T

    def torque(k: int) -> np.ndarray:
        turn = np.column_stack([np.cos(q[k]), np.sin(q[k])]).ravel()
        return pinocchio.rnea(model, data, turn, qd[k], qdd[k])

    tau = np.array([torque(k) for k in range(len(t))])
    return np.column_stack([t, q, tau + noise * rng.standard_normal(tau.shape)])


def write(folder, noise: float = 0.0) -> None:
    (folder / "arm.urdf").write_text(URDF)
    for name, loaded, seed in (("empty.csv", False, 1), ("loaded.csv", True, 2)):
        np.savetxt(
            folder / name,
            table(URDF, loaded, seed, noise),
            delimiter=",",
            header="time,ja.pos,jb.pos,jc.pos,ja.effort,jb.effort,jc.effort",
            comments="",
        )
    (folder / "load.yaml").write_text(
        "symgen: 1\nrecord: {files: [empty.csv], columns: {t: time, q: names}}\n"
        "payload:\n  record: {files: [loaded.csv]}\n"
    )


@pytest.mark.parametrize("at", [None, "flange", "camera", "c"])
def test_the_load_is_given_at_the_named_link(tmp_path, monkeypatch, at):
    """The columns of payload.record are those of record; the truth is in the frame of pinocchio."""
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    words = [] if at is None else ["--at", at]
    result = CliRunner().invoke(
        app, ["identify", "arm.urdf", "load.yaml", "--no-plausible", "--json", *words]
    )
    assert result.exit_code == 0, result.output
    body = json.loads(result.stdout)["payload"]["body"]
    assert body["at"] == (at or "flange")
    model = pinocchio.buildModelFromXML(URDF)
    flange, link = (model.frames[model.getFrameId(n)].placement for n in ("flange", at or "flange"))
    true = link.actInv(flange).act(pinocchio.Inertia(MASS, CENTRE, TENSOR))
    found = [entry["value"] for entry in body["values"].values()]
    inertia = true.inertia[np.triu_indices(3)]
    np.testing.assert_allclose(found[:4], [true.mass, *true.lever], atol=1e-4)
    np.testing.assert_allclose(found[4:], inertia, atol=3e-4)  # of differences of positions


def test_text_names_frame_unit_and_interval(tmp_path, monkeypatch):
    write(tmp_path, noise=0.05)
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(app, ["identify", "arm.urdf", "load.yaml", "--no-plausible"]).stdout
    assert "The load at flange, +- 95 %: mass 2.4" in said and " kg, centre, m\nx " in said
    assert "Inertia about the centre, kg m^2\nxx " in said
    assert "The load on link 3, in Khalil's frame 3, SI, +- 95 %" in said


def test_deviations_are_those_of_the_scatter(tmp_path):
    """12 pairs of records: squares of (value - truth) / sigma have the mean 1, within its spread."""
    (tmp_path / "arm.urdf").write_text(URDF)
    module = load_model(symgen.model(tmp_path / "arm.urdf"))
    study = study_from_mapping(
        {"signals": {"lowpass": None, "decimate": {"factor": 4}}, "payload": {"at": "flange"}}
    )
    clean = [table(URDF, loaded, seed, 0.0) for loaded, seed in ((False, 1), (True, 2))]
    true = np.array([MASS, *CENTRE, *TENSOR[np.triu_indices(3)]])
    z = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        empty, loaded = (
            runtime.Record(
                x[:, 0], x[:, 1:4], x[:, 4:] + 0.2 * rng.standard_normal((len(x), 3)), rate=RATE
            )
            for x in clean
        )
        body = payload(module, empty, study, loaded=loaded).payload.body
        z.append((body.value - true) / body.sigma)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5  # 12 runs of ten correlated numbers


def test_numbers_that_no_torque_shows_are_left_out():
    """A planar arm about z shows M, MX, MY and ZZ: the mass, x, y and zz, whatever the rest is."""
    unknown = [family not in ("ZZ", "MX", "MY", "M") for family in (
        "XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")]  # fmt: skip
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = [[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]], (0.1, 0.2, 0.3)
    chi = np.where(unknown, 0.0, [0, 0, 0, 0, 0, 0.3, 0.4, 0.1, 0, 2.0])
    body = body_at(Place("tool", "tool", T), np.eye(4), chi, np.zeros((10, 10)), unknown)
    assert [name for name, *_ in body.rows] == ["mass", "centre x", "centre y", "inertia zz"]
    assert "centre z" in body.missing and "inertia xx" in body.missing
    centre = T[:2, :2].T @ (np.array([0.2, 0.05]) - T[:2, 3])
    moment = 0.3 - (0.4**2 + 0.1**2) / 2
    assert [x for _, x, *_ in body.rows] == pytest.approx([2.0, *centre, moment])
    heavy = body_at(Place("tool", "tool", T), np.eye(4), -chi, np.zeros((10, 10)), unknown)
    assert heavy is None


def test_places_are_those_of_pinocchio():
    robot, _ = read_tree(URDF.encode(), "arm.urdf")
    module = symgen.model(robot)
    model = pinocchio.buildModelFromXML(URDF)
    q = np.array([0.3, -0.8, 1.9])
    data = model.createData()
    turn = np.column_stack([np.cos(q), np.sin(q)]).ravel()
    pinocchio.framesForwardKinematics(model, data, turn)
    poses = module.frame_poses(q)
    assert list(mounts(robot)) == ["a", "b", "c", "flange", "camera"] == list(module.MOUNTS)
    for name, (j, X) in module.MOUNTS.items():
        np.testing.assert_allclose(
            poses[j - 1] @ np.array(X),
            data.oMf[model.getFrameId(name)].homogeneous,
            atol=1e-12,
        )


def test_fixed_frames_of_a_robot_file_are_places():
    text = """symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {g: 9.81, L: 0.3}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: L, theta: q2, r: 0}
  3: {ant: 2, sigma: 2, alpha: pi/2, d: L, theta: 0, r: 0.1}
massless: [3]
labels: {3: tool0}
"""
    robot = symgen.parse_robot(text.encode(), "arm.yaml")
    ((name, (j, X)),) = mounts(robot).items()
    assert (name, j) == ("tool0", 2)
    np.testing.assert_allclose(np.array(X)[:3, 3], [0.3, -0.1, 0], atol=1e-15)


def test_a_place_that_is_not_there_is_named(tmp_path):
    write(tmp_path)
    module = load_model(symgen.model(tmp_path / "arm.urdf"))
    study = study_from_mapping({"payload": {"at": "tcp"}})
    x, y = (table(URDF, loaded, 1, 0.0) for loaded in (False, True))
    records = [runtime.Record(r[:, 0], r[:, 1:4], r[:, 4:], rate=RATE) for r in (x, y)]
    with pytest.raises(
        SettingsError, match=r"payload\.at: 'tcp' is no named place .* c, flange, camera"
    ):
        payload(module, records[0], study, loaded=records[1])


INHERIT = {
    "record": [
        {
            "files": "a.csv",
            "columns": {"t": "time", "q": "names"},
            "units": {"q": "deg", "tau": "A"},
            "torque_constant": 2.0,
            "side": "motor",
        },
        {"files": "b.csv"},
    ]
}


def test_records_with_a_load_inherit_what_they_leave_out():
    study = study_from_mapping({**INHERIT, "payload": {"record": {"files": "c.csv"}}})
    empty, (loaded,) = study.record[0], study.payload.record
    for key in ("columns", "units", "side", "torque_constant"):
        assert getattr(loaded, key) == getattr(empty, key)
    assert loaded.files == ("c.csv",)
    own = {"files": "c.csv", "side": "joint", "units": {"q": "deg"}}
    (loaded,) = study_from_mapping({**INHERIT, "payload": {"record": [own]}}).payload.record
    assert (loaded.side, loaded.units.tau, loaded.torque_constant) == ("joint", "N*m", None)
    assert loaded.columns == empty.columns
