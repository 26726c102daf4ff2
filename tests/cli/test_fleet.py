"""`symgen fleet`: several robots and records, one of which fails; one folder each, one table."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import typer
from campaign import campaign
from typer.testing import CliRunner

from runtime.model.generated import load_model
from symgen.cli.fleet import fleet

GENERATED = Path(__file__).resolve().parents[2] / "generated"
FLEET = """symgen: 1
jobs:
  - {robot: emps, record: emps}
  - {name: no such record, robot: emps, record: missing.csv}
  - {robot: planar_2r, record: run.yaml}
  - {robot: planar_2r, record: run.csv, name: emps-emps}
  - {robot: other.yaml, record: run.csv}
"""


def run(*arguments):
    app = typer.Typer()
    app.command()(fleet)
    return CliRunner().invoke(app, [str(a) for a in arguments])


def simulated(folder, moving=(1.0, 1.0)):
    """8 s of the planar arm at 200 Hz, run.csv, and run.yaml for it."""
    model = load_model(GENERATED / "planar_2r.py")
    t = np.arange(1600)[:, None] / 200
    w = 2 * np.pi * np.array([[0.3, 0.4], [0.7, 0.9], [1.6, 1.3]])[:, None]
    amplitude = np.array([[0.8, 0.9], [0.4, 0.3], [0.1, 0.15]])[:, None] * moving
    phase = w * t + np.array([0.4, 1.0])
    q, qd, qdd = (
        (amplitude * np.sin(phase)).sum(0),
        (amplitude * w * np.cos(phase)).sum(0),
        -(amplitude * w**2 * np.sin(phase)).sum(0),
    )
    tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(model.VALUES))
    tau += 0.05 * np.random.default_rng(0).standard_normal(q.shape)
    np.savetxt(
        folder / "run.csv",
        np.column_stack([t, q, tau]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
    )
    (folder / "run.yaml").write_text("record: {files: run.csv}\nsignals: {lowpass: {cutoff: 20}}\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    simulated(folder)
    (folder / "fleet.yaml").write_text(FLEET)
    return folder


@pytest.fixture(scope="module")
def shown(folder, emps_data):
    return run(folder / "fleet.yaml", "-o", folder / "out")


@campaign
def test_one_job_fails_and_the_others_go_on(shown):
    assert shown.exit_code == 1, shown.output
    assert "5 of 5" in shown.stderr
    lines = shown.stdout.splitlines()
    assert [line.split()[0] for line in lines[1:6]] == [
        "emps-emps",
        "no_such_record",
        "planar_2r-run",
        "emps-emps-2",
        "other-run",
    ]
    assert [line.split()[-1] for line in lines[1:6]] == ["ok", "failed", "ok", "ok", "failed"]
    assert any(line.startswith("no_such_record: ") and "missing.csv" in line for line in lines)
    assert any(line.startswith("other-run: ") and "other.yaml" in line for line in lines)


def test_one_folder_per_job_and_the_table(shown, folder):
    out = folder / "out"
    folders = {p.name for p in out.iterdir() if p.is_dir()}
    assert folders == {"emps-emps", "planar_2r-run", "emps-emps-2"}
    rows = list(csv.DictReader((out / "summary.csv").open(newline="")))
    found = json.loads((out / "summary.json").read_text())["jobs"]
    assert [row["name"] for row in rows] == [row["name"] for row in found]
    assert (out / "summary.txt").read_text() == shown.stdout
    emps = found[0]
    assert (emps["rows"], emps["parameters"], emps["worst_joint"]) == (
        2480,
        4,
        "1",
    )  # EMPS_Description.pdf, section 3.4: 4.0834 %, 25.9883
    assert (round(emps["relative_error"], 4), round(emps["cond"], 4)) == (4.0834, 25.9883)
    for name in folders:
        own = json.loads((out / name / "estimate.json").read_text())
        row = next(row for row in found if row["name"] == name)
        assert own["relative_error"] == row["relative_error"] and own["cond"] == row["cond"]
        assert (out / name / "report.html").stat().st_size > 10_000
    assert found[1]["status"] == "failed" and found[1]["rows"] is None


@campaign
def test_processes_give_the_same_table(shown, folder, emps_data):
    again = run(folder / "fleet.yaml", "--workers", 2, "--json")
    assert again.exit_code == 1
    assert json.loads(again.stdout) == json.loads((folder / "out" / "summary.json").read_text())


def test_a_record_that_does_not_determine_its_robot(tmp_path):
    simulated(tmp_path, moving=(1.0, 0.0))
    (tmp_path / "fleet.yaml").write_text("jobs: [{robot: planar_2r, record: run.yaml}]")
    result = run(tmp_path / "fleet.yaml")
    assert result.exit_code == 1 and "rank-deficient" in result.stdout


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("jobs: []", ["jobs", "no job"]),
        ("symgen: 2\njobs: [{robot: emps, record: emps}]", ["schema 2", "line 1"]),
        ("jobs: [{robot: emps}]", ["record"]),
        ("jobs: [{robot: emps, record: emps, colour: red}]", ["colour", "line 1"]),
        ("jobs: {", ["not YAML", "line 1"]),
        ("[1, 2]", ["mapping"]),
    ],
)
def test_bad_fleet_files(tmp_path, text, words):
    (tmp_path / "fleet.yaml").write_text(text)
    result = run(tmp_path / "fleet.yaml")
    assert result.exit_code == 2
    assert all(word in result.stderr for word in words), result.stderr


def test_missing_fleet_file_and_silent_scheduler(tmp_path, folder):
    assert "nothing.yaml" in run(tmp_path / "nothing.yaml").stderr
    result = run(folder / "fleet.yaml", "--scheduler", "nonsense://1")
    assert result.exit_code == 2 and "no answer from the scheduler nonsense://1" in result.stderr
