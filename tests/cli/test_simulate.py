"""`symgen simulate`: a record that `identify` reads back, with its reference; bad input as one
line.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from symgen.cli.main import app

STUDY = """
symgen: 1
signals: {lowpass: {cutoff: 100, on: [q]}}
controller:
  law: {kind: cascade, kp: 160.18, kv: 243.45, gain: 35.15}
  rate: 1000
  encoder: {step: 1e-6}
  torque: {noise: 0.5}
  reference:
    limits: ignore
    motion: {parts: [{family: fourier, period: 3.0, harmonics: 3, p: [[0.0, 0.06, -0.05, -0.01, 0.02, 0.01, -0.01333333]]}]}
"""


def run(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)])


def test_record_figure_and_study(tmp_path):
    (tmp_path / "loop.yaml").write_text(STUDY)
    out = tmp_path / "out"
    done = run("simulate", "emps", tmp_path / "loop.yaml", "-o", out)
    assert done.exit_code == 0, done.output
    assert "joint" in done.stdout and "nothing was measured" in done.stdout
    assert {p.name for p in out.iterdir()} == {
        "simulated.csv",
        "study.yaml",
        "simulation.json",
        "simulation.svg",
        "simulation.png",
    }
    assert (out / "simulated.csv").read_text().startswith("t,q1,tau1,qr1\n")
    summary = json.loads((out / "simulation.json").read_text())
    assert (
        summary["note"].startswith("SIMULATED")
        and summary["samples"] == 3001
        and summary["parameters"]["M1R"] == pytest.approx(95.1089)
    )
    again = run("simulate", "emps", out / "study.yaml", "-o", tmp_path / "again")
    assert again.exit_code == 0, again.output
    assert (tmp_path / "again" / "simulated.csv").read_bytes() == (
        out / "simulated.csv"
    ).read_bytes()
    found = run("identify", "emps", out / "study.yaml", "--json")
    estimate = json.loads(found.stdout)
    assert estimate["provenance"]["simulated"]
    assert dict(zip(estimate["names"], estimate["X"], strict=True))["M1R"] == pytest.approx(
        95.1089, rel=0.01
    )


def test_ideal_json(tmp_path):
    (tmp_path / "loop.yaml").write_text(STUDY)
    noisy, ideal = (
        json.loads(run("simulate", "emps", tmp_path / "loop.yaml", "--json", *more).stdout)
        for more in ((), ("--ideal",))
    )
    assert ideal["ideal"] and not noisy["ideal"]
    assert (
        np.abs(np.array(ideal["tracking_error"]["rms"]) / noisy["tracking_error"]["rms"] - 1).max()
        < 0.1
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("kv: 243.45", "kv: 90000", "lower kp and kv"),
        (
            "limits: ignore\n",
            "limits: refuse\n    file: a.csv\n",
            "expected one of file, record, motion, points",
        ),
        ("cutoff: 100, on: [q]}}\ncontroller:", "cutoff: 100}}\ncontrol:", "unknown key"),
        ("kind: cascade", "kind: lqr", "line 5"),
        ("rate: 1000\n", "rate: 1000\n  values: {M1: -3}\n", "not positive definite"),
    ],
)
def test_bad_input(tmp_path, old, new, said):
    (tmp_path / "loop.yaml").write_text(STUDY.replace(old, new))
    done = run("simulate", "emps", tmp_path / "loop.yaml", "-o", tmp_path / "out")
    assert done.exit_code == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "out").exists()


def test_without_controller_and_without_casadi_model(tmp_path):
    (tmp_path / "empty.yaml").write_text("symgen: 1\n")
    assert "no section `controller`" in run("simulate", "emps", tmp_path / "empty.yaml").stderr
    (tmp_path / "loop.yaml").write_text(STUDY.replace("p: [[", "p: [[0.0, 0, 0, 0, 0, 0, 0], ["))
    assert run("simulate", "five_bar", tmp_path / "loop.yaml").exit_code == 2


def test_parameters_without_effect_need_no_value(tmp_path: Path) -> None:
    """A carriage needs a mass and friction; its tensor was asked for, too, and `excite` ended in a
    traceback.
    """
    robot = tmp_path / "axis.yaml"
    robot.write_text(
        "symgen: 1\nname: axis\ngravity: [-9.81, 0, 0]\nframes: {1: {ant: 0, sigma: 1, alpha: 0, "
        "d: 0, theta: 0, r: q1}}\n"
        "elements: {FV: {kind: viscous, along: all}}\nlimits: {q: [0.3], qd: [0.5], qdd: "
        "[2]}\nvalues: {M1: 95, FV1: 200}\n"
    )
    study = tmp_path / "loop.yaml"
    study.write_text(
        "controller: {law: {kind: pid, kp: 150000, kd: 9000}, rate: 1000, reference: {points: "
        "{duration: 2, seed: 1}}}\n"
    )
    done = CliRunner().invoke(app, ["simulate", str(robot), str(study)])
    assert done.exit_code == 0, done.output
    robot.write_text(robot.read_text().replace("M1: 95, ", ""))
    for verb in (["simulate", str(robot), str(study)], ["excite", str(robot)]):
        refused = CliRunner().invoke(app, verb)
        assert refused.exit_code == 2
        assert "M1" in refused.output
