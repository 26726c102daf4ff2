"""`symgen report`: every part in one folder, parts that cannot be done named with their reason,
exit codes.
"""

import json

import numpy as np
import pytest
from campaign import campaign
from typer.testing import CliRunner

from runtime.study import load_study
from symgen.cli.main import app

FILES = {
    "report.html",
    "estimate.json",
    "parameters.csv",
    "study.yaml",
    "torques.png",
    "friction.png",
    "advice.json",
    "cestac.json",
}


def run(*arguments):
    return CliRunner().invoke(app, ["report", *map(str, arguments)])


@pytest.fixture
def record(tmp_path):
    """A record of the 2R arm at 1 kHz whose torques are no fit to anything."""
    rng, t = np.random.default_rng(3), np.arange(3000) / 1000
    q = np.column_stack([np.sin(5 * t), np.cos(7 * t) + 0.3 * np.sin(3 * t)])
    np.savetxt(
        tmp_path / "record.csv",
        np.column_stack([t, q, rng.normal(size=(3000, 2))]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
    )
    return tmp_path / "record.csv"


@campaign
def test_measured_record_of_one_joint(emps_data, tmp_path):
    result = run("emps", "emps", "-o", tmp_path / "out", "--encoder", "1e-6")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("With care. The model of emps with 4 of 4 parameters leaves")
    assert {path.name for path in (tmp_path / "out").iterdir()} >= FILES
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for words in (
        "physically feasible",
        "Friction curves",
        "Resolution advice",
        "Resolution study",
        "95.11",
        "SHA-256",
    ):
        assert words in html
    assert "Not done" not in html


@campaign
def test_noise_is_not_for_use(record, tmp_path):
    """With a method that no prediction of the resolution knows: it is said, the rest is there."""
    (tmp_path / "study.yaml").write_text(
        "symgen: 1\nrecord: {files: [record.csv]}\nestimate: {method: irls}\n"
        "signals: {lowpass: {cutoff: 50}}\n"
    )
    result = run("planar_2r", tmp_path / "study.yaml", "-o", tmp_path / "out", "--json")
    assert result.exit_code == 1, result.output
    judgement = json.loads(result.stdout)
    assert judgement["state"] == "no" and judgement["answer"] == "No"
    assert {check["state"] for check in judgement["checks"]} >= {"no", "good"}
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "resolution advice: " in html and "Friction curves" in html


def test_record_that_determines_nothing(record, tmp_path):
    table = np.loadtxt(record, delimiter=",", skiprows=1)
    table[:, 2] = 0
    np.savetxt(record, table, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    result = run("planar_2r", record, "-o", tmp_path / "out")
    assert (
        result.exit_code == 1
        and "cannot be separated" in result.stdout
        and "does not determine" in result.stderr
    )
    assert "✕</span> No" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@campaign
def test_encoders_at_the_motors(emps_data, tmp_path):
    """The step of --encoder is one of the motors where --side says so, in the words of the verdict
    and in study.yaml.
    """
    result = run("emps", "emps", "-o", tmp_path / "out", "--encoder", "1e-6", "--side", "motor")
    assert result.exit_code in (0, 1), result.output
    assert "at the motors" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    study = load_study(tmp_path / "out" / "study.yaml")
    assert study.cestac.side == "motor"
    bad = run("emps", "emps", "-o", tmp_path / "bad", "--side", "shaft")
    assert bad.exit_code == 2 and "cestac.side: 'shaft'; expected joint or motor" in bad.stderr


def test_bad_step_is_told(record, tmp_path):
    result = run("planar_2r", record, "-o", tmp_path / "out", "--encoder", "-1")
    assert (
        result.exit_code == 2
        and "expected more than 0" in result.stderr
        and not (tmp_path / "out").exists()
    )
