"""HDF5 files with a group for each episode: each is a record, and groups of joints stay columns."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from runtime import read_record
from runtime.ground.errors import InputError
from runtime.reading.formats import read_table
from runtime.reading.records import read_records
from runtime.study import load_study, study_from_mapping
from symgen.cli.main import app

RATE = 50.0
NUMBERS = {0: 300, 1: 250, 2: 400, 10: 350}  # samples by episode
URDF = """<robot name="one"><link name="base"/>
<link name="rod"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.001" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="40" velocity="3"/></joint></robot>
"""


def motion(number: int, N: int) -> tuple[np.ndarray, ...]:
    """A pendulum of 2 kg at .2 m, friction .3 and .2: t, q, tau."""
    t, w = np.arange(N) / RATE, 2.0 + 0.2 * number
    q, qd, qdd = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    tau = 0.11 * qdd - 2 * 9.81 * 0.2 * np.cos(q) + 0.3 * qd + 0.2 * np.sign(qd)
    return t, q, tau + 0.005 * np.random.default_rng(number).standard_normal(N)


def written(path: Path, group: str = "data/demo_{}", clock: bool = False) -> Path:
    with h5py.File(path, "w") as archive:
        for number, N in NUMBERS.items():
            t, q, tau = motion(number, N)
            demo = archive.create_group(group.format(number))
            demo["obs/joint_pos"], demo["obs/joint_torques"] = q[:, None], tau[:, None]
            demo["actions"], demo["obs/image"] = np.zeros((N, 7)), np.zeros((N, 4, 4, 3), np.uint8)
            demo["gain"] = 3.0
            if clock:
                demo["obs/stamp"] = 1.7e9 + 100 * number + t
    return path


def records(path: Path, stem: str = "data.demo.obs.", **record: object) -> list:
    columns = {"q": [f"{stem}joint_pos"], "tau": [f"{stem}joint_torques"]}
    columns |= {} if "rate" in record else {"t": f"{stem}stamp"}
    study = study_from_mapping({"record": {"files": str(path), "columns": columns, **record}})
    return read_records(study.record)


@pytest.mark.parametrize(
    ("group", "stem"),
    [
        ("data/demo_{}", "data.demo.obs."),
        ("episode_{:06d}", "episode.obs."),
        ("Trajectory{}", "Trajectory.obs."),
        ("{}", "obs."),
        ("folder/x-{}", "folder.x.obs."),
    ],
)
def test_each_episode_is_a_record_in_the_order_of_their_numbers(tmp_path, group, stem):
    found = records(written(tmp_path / "a.hdf5", group), stem, rate=RATE)
    assert [len(record.q) for record in found] == [*NUMBERS.values()]
    for record, (number, N) in zip(found, NUMBERS.items(), strict=True):
        _, q, tau = motion(number, N)
        np.testing.assert_array_equal(record.q[:, 0], q)
        np.testing.assert_array_equal(record.tau[:, 0], tau)
        np.testing.assert_allclose(np.diff(record.t), 1 / RATE, rtol=1e-6)
    assert found[1].name == "a (2 of 4)" and "4 episodes" in found[1].origin.time


def test_the_clock_of_the_episodes(tmp_path):
    """Stamps of the day: the pause between two episodes is no gap of a record."""
    found = records(written(tmp_path / "a.h5", clock=True))
    assert [len(record.q) for record in found] == [*NUMBERS.values()]
    assert all(record.rate == pytest.approx(RATE) for record in found)


def test_one_episode_by_its_number(tmp_path):
    path = written(tmp_path / "a.hdf5")
    (record,) = records(path, "data.demo_10.obs.", rate=RATE)
    np.testing.assert_array_equal(record.q[:, 0], motion(10, 350)[1])
    with pytest.raises(InputError, match="300"):
        columns = {"q": ["data.demo_0.obs.joint_pos"], "tau": ["data.demo.obs.joint_torques"]}
        study = study_from_mapping(
            {"record": {"files": str(path), "columns": columns, "rate": RATE}}
        )
        read_record(study.record[0])


def test_groups_of_joints_and_of_other_data_sets_are_no_episodes(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as archive:
        for k in (1, 2):
            archive[f"joints/joint_{k}/position"] = np.arange(20.0) + k
        for k in (1, 2):
            archive[f"run_{k}/{'ab'[k - 1]}"] = np.arange(20.0)
    table = read_table(tmp_path / "a.h5")
    assert table.names == (
        "joints.joint_1.position",
        "joints.joint_2.position",
        "run_1.a",
        "run_2.b",
    )


def test_a_short_episode_is_left_out_and_told(tmp_path):
    path = written(tmp_path / "a.hdf5")
    with h5py.File(path, "a") as archive:
        for name, x in (("joint_pos", np.ones((4, 1))), ("joint_torques", np.ones((4, 1)))):
            archive[f"data/demo_3/obs/{name}"] = x
        archive["data/demo_3/actions"], archive["data/demo_3/gain"] = np.zeros((4, 7)), 3.0
    found = records(path, rate=RATE)
    assert [len(record.q) for record in found] == [*NUMBERS.values()]
    assert "1 episodes shorter than 10 samples left out" in found[0].origin.time


def test_identify_and_suggest(tmp_path: Path) -> None:
    """Gravity .4 kg m, viscous friction .3, dry friction .2; the suggestion asks for the rate alone."""
    path, robot = written(tmp_path / "demos.hdf5", clock=True), tmp_path / "one.urdf"
    robot.write_text(URDF)
    study = tmp_path / "study.yaml"
    done = CliRunner().invoke(
        app,
        ["identify", str(robot), str(path), "--suggest", str(study), "--json", "--no-plausible"],
    )
    assert done.exit_code == 0, done.output
    record = load_study(study).record[0]
    assert record.columns.q == ("data.demo.obs.joint_pos",)
    assert record.columns.tau == ("data.demo.obs.joint_torques",)
    result = json.loads(done.stdout)
    X = dict(zip(result["names"], result["X"], strict=True))
    assert X["MX1"] == pytest.approx(0.4, abs=0.01)
    assert X["FV1"] == pytest.approx(0.3, abs=0.01) and X["FS1"] == pytest.approx(0.2, abs=0.01)
