"""`symgen excite`: files that simulate and identify read, a better motion than the record's, bad
input as one line.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign
from ruamel.yaml import YAML
from typer.testing import CliRunner

from runtime.loop.trajectories import motion_from_mapping
from symgen.cli.main import app

STUDY = """
symgen: 1
signals: {lowpass: {cutoff: 20}, decimate: {factor: 10}}
excitation:
  parts: [{family: triangular, points: 4, travel: 0.8, blend: 0.2, speed: 0.1}, {family: point-to-point, points: 5, travel: 0.5, blend: 0.15}]
  limits: {q: [[-0.05, 0.25]], qd: [0.6], qdd: [6.0]}
  columns: all
  iterations: 40
"""


def run(*arguments: object) -> object:
    return CliRunner().invoke(app, [*map(str, arguments)])


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The settings with a record of the same axis, simulated on a slow motion."""
    t = np.arange(4000) / 1000
    q = 0.05 * (1 - np.cos(2 * np.pi * t / 2))
    qd, qdd = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    tau = (
        95.0 * qdd
        + 200.0 * qd
        + 20.0 * np.sign(qd)
        - 3.0
        + np.random.default_rng(0).normal(0, 2.0, len(t))
    )
    np.savetxt(
        tmp_path / "slow.csv",
        np.column_stack([t, q, tau]),
        delimiter=",",
        header="t,q1,tau1",
        comments="",
    )
    path = tmp_path / "study.yaml"
    path.write_text(STUDY + "record: {files: [slow.csv]}\n", encoding="utf-8")
    return path


def test_motion_from_a_record(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run("excite", "emps", study, "-o", out, "--starts", 2, "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads((out / "excitation.json").read_text())
    assert json.loads(done.stdout) == summary
    before = summary["relative_sigma_of_record"]
    assert summary["worse_than_record"] == {
        k: x / before[k]
        for k, x in sorted(summary["relative_sigma"].items(), key=lambda i: -i[1] / before[i[0]])
        if x > before[k]
    }
    assert summary["settings"]["criterion"] == "record"
    assert max(max(x) for x in summary["limits_used"].values()) <= 1
    assert {p.name for p in out.iterdir()} == {
        "report.html",
        "excitation.json",
        "trajectory.csv",
        "joint_trajectory.yaml",
        "motion.yaml",
        "motion.png",
        "motion.svg",
    }
    table = np.genfromtxt(out / "trajectory.csv", delimiter=",", names=True)
    assert table.dtype.names == ("t", "q1", "qd1", "qdd1")
    motion = motion_from_mapping(YAML(typ="safe").load((out / "motion.yaml").read_text())["motion"])
    assert np.allclose(motion.sampled(1000)[1][:, 0], table["q1"], atol=1e-9)
    slow = (table["t"] > 0.3) & (table["t"] < 2.2)
    assert np.abs(table["qd1"][slow]).max() <= 0.1 + 1e-6
    page = (out / "report.html").read_text()
    assert "FV1" in page and "<script" not in page


@campaign
def test_the_trajectory_is_a_reference(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert (
        run("excite", "emps", study, "-o", out, "--starts", 1, "--criterion", "sigma").exit_code
        == 0
    )
    summary = json.loads((out / "excitation.json").read_text())
    assert max(summary["relative_sigma"].values()) < max(
        summary["relative_sigma_of_record"].values()
    )
    loop = (
        "controller: {law: {kind: cascade, kp: 160, kv: 243, gain: 35}, rate: 1000, reference: "
        "{file: trajectory.csv, limits: ignore}}\n"
    )
    (out / "loop.yaml").write_text("symgen: 1\n" + loop, encoding="utf-8")
    done = run("simulate", "emps", out / "loop.yaml", "-o", tmp_path / "record")
    assert done.exit_code == 0, done.output
    done = run("identify", "emps", tmp_path / "record" / "study.yaml", "--json")
    assert done.exit_code == 0, done.output
    assert dict(zip(*(json.loads(done.stdout)[key] for key in ("names", "X")), strict=True))[
        "M1R"
    ] == pytest.approx(95.1, rel=0.01)


def test_bad_input_is_one_line(study: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    for text, said in (
        (STUDY.replace("triangular", "square"), "no family 'square'"),
        (STUDY.replace("qd: [0.6]", "qd: [-1]"), "expected more than 0"),
        (STUDY.replace("columns: all", "columns: [ZZ9]"), "no parameter ZZ9"),
        (STUDY.replace("iterations: 40", "begin: [0.4]"), "gave a motion within the limits"),
    ):
        wrong.write_text(text + "record: {files: [slow.csv]}\n", encoding="utf-8")
        done = run("excite", "emps", wrong, "--starts", 1)
        assert done.exit_code == 2 and said in done.stderr, done.output
        assert len(done.stderr.strip().splitlines()) == 1
    assert run("excite", "scara").exit_code == 2


def test_settings_without_a_record_use_the_values_of_the_robot(tmp_path: Path) -> None:
    """Such a study was refused: families and limits could not be chosen before the first record."""
    study = tmp_path / "search.yaml"
    study.write_text(STUDY, encoding="utf-8")
    done = run("excite", "emps", study, "--starts", 1, "--rate", 200, "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert (
        json.loads((tmp_path / "out" / "excitation.json").read_text())["parameters_from"]
        == "values of the robot file"
    )
