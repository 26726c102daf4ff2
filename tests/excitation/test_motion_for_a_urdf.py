"""A motion for a URDF: limits of acceleration that no file gives, files for ROS, and what is told."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import yaml
from scipy.interpolate import BPoly, make_interp_spline
from support.pair_urdf import URDF
from typer.testing import CliRunner

from runtime.core.record import Record
from runtime.excitation.accelerations import accelerations, recorded
from runtime.excitation.criteria import limits_of
from runtime.excitation.joint_trajectory import joint_trajectory
from runtime.ground.errors import SettingsError
from symgen.cli.main import app

LOWER, UPPER, SPEED = np.array([-2.0, -2.2]), np.array([2.5, 2.2]), np.array([2.5, 3.0])
FRICTION = np.array([0.8, 0.4]), np.array([0.5, 0.3])  # viscous, dry
SEARCH = """
excitation: {parts: [{family: fourier, period: 8, harmonics: 4}], starts: 2, iterations: 60, rate: 500}
"""


def run(*arguments: object) -> object:
    return CliRunner().invoke(app, [*map(str, arguments)])


def logged(path: Path, file: Path, t: np.ndarray, q: np.ndarray, states: tuple) -> None:
    """Write a log as the robot would: torques by pinocchio, friction and noise, encoders of 1e-4 rad."""
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    qd, qdd = states
    tau = np.array([pinocchio.rnea(model, data, *x) for x in zip(q, qd, qdd, strict=True)])
    tau += FRICTION[0] * qd + FRICTION[1] * np.sign(qd)
    tau += np.random.default_rng(1).normal(0, [0.05, 0.02], tau.shape)
    rows = np.column_stack([t, np.round(q / 1e-4) * 1e-4, tau])
    head = "t,q1,q2,tau1,tau2"
    np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.6f")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a motion for the URDF and a log of it, and the printed answer."""
    folder = tmp_path_factory.mktemp("urdf")
    robot = folder / "pair.urdf"
    robot.write_text(URDF)
    t, a, w = np.arange(4000) / 500, np.array([0.7, 0.4]), np.array([3.0, 2.0])
    angle = w * t[:, None]
    states = a * w * np.cos(angle), -a * w**2 * np.sin(angle)
    logged(robot, folder / "run.csv", t, a * np.sin(angle), states)
    (folder / "study.yaml").write_text("symgen: 1\nrecord: {files: [run.csv]}" + SEARCH)
    done = run("excite", robot, folder / "study.yaml", "-o", folder / "motion")
    assert done.exit_code == 0, done.output
    return folder, done.stdout


def test_accelerations_are_told_with_the_line_that_changes_them(found: tuple) -> None:
    """Joint 1 reached 6.3 rad/s^2 in the log, more than 2.5 rad/s in 1 s; joint 2 only 1.6."""
    text = found[1]
    assert "the largest of the record for joint 1 shoulder. This line" in text
    line = re.search(r"excitation: \{limits: \{qdd: \[.*?\]\}\}", text)
    assert line is not None
    first, second = yaml.safe_load(line[0])["excitation"]["limits"]["qdd"]
    assert first == pytest.approx(6.3, rel=0.03) and second == 3.0
    assert "Collisions and cables were not judged" in text


def test_the_line_is_one_that_the_study_file_reads(found: tuple, tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    limits = "limits: {qdd: [4.0, 9.0]}, "
    study.write_text("symgen: 1" + SEARCH.replace("{parts", "{" + limits + "parts"))
    done = run("excite", found[0] / "pair.urdf", study, "-o", tmp_path / "out", "--starts", 1)
    assert done.exit_code == 0, done.output
    assert "limits the accelerations" not in done.stdout
    assert "has no values of FV1, FS1" in done.stdout
    table = np.genfromtxt(tmp_path / "out" / "trajectory.csv", delimiter=",", names=True)
    assert np.abs(table["qdd1"]).max() <= 4.0 and 3.0 < np.abs(table["qdd2"]).max() <= 9.0


def test_the_motion_keeps_the_limits(found: tuple) -> None:
    """Velocities and accelerations are those of a spline through the positions of the table."""
    table = np.genfromtxt(found[0] / "motion" / "trajectory.csv", delimiter=",", names=True)
    q, qd, qdd = (np.column_stack([table[f"{x}{j}"] for j in (1, 2)]) for x in ("q", "qd", "qdd"))
    spline = make_interp_spline(table["t"], q, k=5)
    inner = slice(5, -5)
    np.testing.assert_allclose(spline.derivative()(table["t"])[inner], qd[inner], atol=1e-5)
    np.testing.assert_allclose(spline.derivative(2)(table["t"])[inner], qdd[inner], atol=5e-3)
    t = np.linspace(0.02, table["t"][-1] - 0.02, 40_000)
    assert np.all((spline(t) >= LOWER) & (spline(t) <= UPPER))
    assert np.all(np.abs(spline.derivative()(t)) <= SPEED)
    largest = np.abs(spline.derivative(2)(t)).max(axis=0)
    assert np.all(largest <= np.array([6.5, 3.001])) and largest[0] > 4.0


def test_the_message_is_the_table(found: tuple) -> None:
    """PyYAML reads rows of the table; quintics between them, as a controller has, keep the limits."""
    folder = found[0] / "motion"
    message = yaml.safe_load((folder / "joint_trajectory.yaml").read_text())
    assert list(message) == ["joint_names", "points"]
    assert message["joint_names"] == ["shoulder", "elbow"]
    with (folder / "trajectory.csv").open() as file:
        rows = {round(float(row["t"]) * 1e9): row for row in csv.DictReader(file)}
    points, times = message["points"], []
    for point in points:
        at = point["time_from_start"]
        assert set(at) == {"sec", "nanosec"} and 0 <= at["nanosec"] < 10**9
        times.append(at["sec"] * 10**9 + at["nanosec"])
        row = rows[times[-1]]
        for field, name in (("positions", "q"), ("velocities", "qd"), ("accelerations", "qdd")):
            assert point[field] == [float(row[f"{name}{j}"]) for j in (1, 2)]
    assert len(points) == 801 and times[0] == 0 and times[-1] == max(rows)
    assert max(np.diff(times)) == 10**7
    states = np.array([[p["positions"], p["velocities"], p["accelerations"]] for p in points])
    quintic = BPoly.from_derivatives(np.array(times) / 1e9, list(states))
    t = np.linspace(0, times[-1] / 1e9, 20_001)
    assert np.all(np.abs(quintic(t, 1)) <= SPEED)
    assert np.all(np.abs(quintic(t, 2)) <= np.array([6.5, 3.01]))


def test_the_last_row_is_a_point() -> None:
    t = np.arange(1001) / 300
    zero = np.zeros((1001, 1))
    zero[0] = 1e-5
    message = yaml.safe_load(joint_trajectory(['a "b": c'], t, zero, zero, zero, 300.0))
    assert message["joint_names"] == ['a "b": c'] and message["points"][0]["positions"] == [1e-5]
    times = [
        p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] / 1e9
        for p in message["points"]
    ]
    assert times[1] == pytest.approx(0.01) and times[-1] == pytest.approx(1000 / 300)
    assert times[-1] - times[-2] == pytest.approx(1 / 300)


def test_identify_says_yes_of_the_motion(found: tuple, tmp_path: Path) -> None:
    """The robot makes the motion; torques by pinocchio."""
    table = np.genfromtxt(found[0] / "motion" / "trajectory.csv", delimiter=",", names=True)
    q, qd, qdd = (np.column_stack([table[f"{x}{j}"] for j in (1, 2)]) for x in ("q", "qd", "qdd"))
    robot = found[0] / "pair.urdf"
    logged(robot, tmp_path / "run.csv", table["t"], q, (qd, qdd))
    done = run("identify", robot, tmp_path / "run.csv")
    assert done.exit_code == 0, done.output
    assert re.search(r"^Yes", done.stdout, re.MULTILINE), done.stdout
    for name, true in zip(("FV1", "FV2", "FS1", "FS2"), np.concatenate(FRICTION), strict=True):
        value = re.search(rf"\b{name} +([-0-9.e]+)", done.stdout)
        assert value is not None and float(value[1]) == pytest.approx(true, rel=0.03)


@pytest.mark.parametrize(
    "limit",
    ["", '<limit effort="40" velocity="2.5"/>', '<limit lower="-1" upper="1" effort="40"/>'],
)
def test_a_urdf_without_limits_is_told_in_one_sentence(tmp_path: Path, limit: str) -> None:
    robot = tmp_path / "bare.urdf"
    kind = "revolute" if "lower" in limit else "continuous"
    robot.write_text(re.sub("<limit lower=.-2. .*?/>", limit, URDF).replace("revolute", kind, 1))
    done = run("excite", robot, "-o", tmp_path / "out")
    assert done.exit_code == 2 and not (tmp_path / "out").exists()
    error, *notes = done.stderr.strip().split("\nnote: ")
    assert len(error.splitlines()) == 1 and len(notes) <= 1
    kinds = [k for k, name in (("q", "lower"), ("qd", "velocity")) if name not in limit]
    assert f"limits: {{{', '.join(f'{k}: [...]' for k in kinds)}}}" in error


@pytest.mark.parametrize("step", [2 * np.pi / 4096, 2 * np.pi / 65536, 0.0])
def test_coarse_encoders_do_not_enlarge_the_largest_acceleration(step: float) -> None:
    """Second differences give 100 times as much; a joint that rests gives 0."""
    t = np.arange(5000) / 500
    q = np.column_stack([0.8 * np.sin(2.5 * t), 0.3 * np.sin(4 * t), np.full(5000, 0.3)])
    q[:, 2] += np.random.default_rng(0).normal(0, 1e-4, 5000)
    q = np.round(q / step) * step if step else q
    found = recorded(Record(t=t, q=q, tau=np.zeros_like(q), rate=500.0))
    assert found[:2] == pytest.approx([0.8 * 2.5**2, 0.3 * 16], rel=0.03) and found[2] == 0
    raw = np.abs(np.diff(q, 2, axis=0)).max(axis=0) * 500**2
    assert raw[0] > 4 * found[0] or not step  # 383 and 24 rad/s^2


def test_chosen_limits_are_the_larger_of_both() -> None:
    t = np.arange(5000) / 500
    q = np.column_stack([np.sin(2 * t), np.sin(2 * t)])
    record = Record(t=t, q=q, tau=np.zeros_like(q), rate=500.0)
    qdd, of_record = accelerations(np.array([3.14159, 9.0]), [record])
    assert qdd.tolist() == [pytest.approx(4.0, rel=0.02), 9.0] and of_record.tolist() == [
        True,
        False,
    ]
    assert accelerations(np.array([3.14159, 9.0]))[0].tolist() == [3.14, 9.0]


def test_limits_of_another_number_are_refused() -> None:
    """Three velocities for two joints ended in an error of numpy."""
    import symgen

    with pytest.raises(SettingsError, match=r"qd: \[1.0, 2.0, 3.0\]; expected 2 numbers"):
        limits_of(symgen.model("planar_2r"), {"qd": [1, 2, 3]})
