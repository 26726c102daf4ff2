"""`symgen identify`: published digits through the command line, its files, and every kind of bad
input.
"""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from runtime.core.least_squares.estimate import Estimate
from runtime.reporting.result_files import write_all
from runtime.study import load_study
from symgen.cli.identify import identify
from symgen.cli.main import app

GENERATED = Path(__file__).resolve().parents[2] / "generated"
FILES = {
    "report.html",
    "estimate.json",
    "estimate.mat",
    "estimate.npz",
    "parameters.csv",
    "parameters.tex",
}
FILES |= {"study.yaml", "torques.png", "torques.svg", "residuals.png", "residuals.svg"}


def run(*arguments):
    app = typer.Typer()
    app.command()(identify)
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def emps(emps_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("emps")
    return run("emps", "emps", "-o", folder, "--json"), folder


def test_emps_digits(emps):
    """EMPS_Description.pdf, Janot, Gautier and Brunot 2019, section 3.4."""
    result, _ = emps
    assert result.exit_code == 0, result.output
    estimate = json.loads(result.stdout)
    assert np.round(estimate["X"], 4).tolist() == [95.1089, 203.5034, 20.3935, -3.1648]
    assert round(estimate["cond"], 4) == 25.9883
    assert (round(estimate["residual_norm"], 4), round(estimate["relative_error"], 4)) == (
        108.7569,
        4.0834,
    )
    validation = estimate["validation"][1]["predictions"]
    assert [
        (p["part"], round(p["relative_error"], 4)) for p in validation if p["columns"] == "all"
    ] == [
        ("emps", 4.0834),
        ("emps_pulses", 5.9824),
    ]


def test_arguments_exchanged_or_no_record_at_all(tmp_path):
    """The robot comes first; a folder of results is no bag; a header of other names asks for a
    study file.
    """
    for name, text in (("log.csv", "time,a,b\n0,1,2\n"), ("robot.yaml", "symgen: 1\n")):
        (tmp_path / name).write_text(text)
    (tmp_path / "results").mkdir()
    for arguments, said in (
        ((tmp_path / "log.csv", tmp_path / "robot.yaml"), "the robot comes first, then the record"),
        (
            ("emps", tmp_path / "results"),
            "no ROS 2 bag; give a measured file or study file in this folder",
        ),
        (
            ("emps", tmp_path / "log.csv"),
            "no columns q1, q2 ... among time, a, b; give the column names in a study file, record.columns.q",
        ),
    ):
        result = run(*arguments)
        assert result.exit_code == 2 and said in result.stderr


def test_files_are_complete_and_readable(emps):
    _, folder = emps
    assert {path.name for path in folder.iterdir()} == FILES
    assert Estimate.from_json((folder / "estimate.json").read_text()).names == (
        "M1R",
        "FV1",
        "FS1",
        "OFFSET1",
    )
    written = json.loads((folder / "estimate.json").read_text())
    jsonschema.validate(
        written, json.loads(CliRunner().invoke(app, ["schema", "--of", "estimate"]).stdout)
    )
    assert written["warnings"] == [] and written["weak_directions"]["groups"] == []
    assert load_study(folder / "study.yaml").signals.lowpass.cutoff == 100
    assert "95.11" in (folder / "report.html").read_text(encoding="utf-8")
    assert (folder / "parameters.csv").read_text().splitlines()[1].startswith("M1R,95.10")
    assert r"\toprule" in (folder / "parameters.tex").read_text()


def test_study_written_is_the_study_run(emps, emps_data):
    _, folder = emps
    again = run("emps", folder / "study.yaml", "--json")
    first, second = json.loads((folder / "estimate.json").read_text()), json.loads(again.stdout)
    assert again.exit_code == 0 and first["X"] == second["X"]


def plain_csv(path, q=None, tau=None, header="t,q1,q2,tau1,tau2", N=4000):
    """A record of the 2R arm at 1 kHz whose torques are no fit to anything."""
    rng = np.random.default_rng(3)
    t = np.arange(N) / 1000
    q = np.column_stack([np.sin(5 * t), np.cos(7 * t) + 0.3 * np.sin(3 * t)]) if q is None else q
    tau = rng.normal(size=(N, 2)) if tau is None else tau
    np.savetxt(
        path, np.column_stack([t, q, tau]), delimiter=",", header=header, comments="", fmt="%.9g"
    )
    return path


def test_generated_module_and_plain_record(tmp_path):
    record = plain_csv(tmp_path / "record.csv")
    by_name, by_module = (
        run(robot, record, "--json") for robot in ("planar_2r", GENERATED / "planar_2r.py")
    )
    assert by_name.exit_code == by_module.exit_code == 1, by_name.output  # the verdict is a No
    assert json.loads(by_name.stdout)["X"] == json.loads(by_module.stdout)["X"]
    brief, verbose = run("planar_2r", record), run("planar_2r", record, "--verbose")
    for text in (brief.stdout, verbose.stdout):
        assert "No. The model of planar_2r with " in text and "\nNext: " in text
    assert len(brief.stdout.splitlines()) <= 25 and "Ljung-Box" in verbose.stdout


def test_rank_deficient_record_names_the_parameters(tmp_path):
    q = np.zeros((4000, 2))
    q[:, 0] = np.sin(5 * np.arange(4000) / 1000)
    result = run("planar_2r", plain_csv(tmp_path / "record.csv", q=q), "-o", tmp_path / "out")
    assert result.exit_code == 1, result.output
    assert (
        json.loads((tmp_path / "out" / "estimate.json").read_text())["status"] == "rank-deficient"
    )
    assert (
        "No. The record does not determine" in result.stdout
        and "cannot be separated" in result.stdout
        and "FV2" in result.stdout
    )


def test_hostile_record_name_is_escaped(tmp_path):
    plain_csv(tmp_path / "record.csv")
    study = tmp_path / "study.yaml"
    study.write_text(
        "symgen: 1\nrecord: {files: [record.csv], name: '<script>alert(1)</script>'}\n"
    )
    result = run("planar_2r", study, "-o", tmp_path / "out")
    assert result.exit_code == 1, result.output
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert (
        "<script>alert" not in html
        and html.count("<script") == 2
        and "&lt;script&gt;alert(1)" in html
    )


def nan_record(folder):
    tau = np.ones((4000, 2))
    tau[17, 1] = np.nan
    return plain_csv(folder / "nan.csv", tau=tau)


def study_file(folder, text):
    plain_csv(folder / "record.csv")
    path = folder / "study.yaml"
    path.write_text(f"symgen: 1\nrecord: {{files: [record.csv]}}\n{text}\n")
    return path


BAD = {
    "nan": (nan_record, ["nan.csv", "tau2", "nan"]),
    "short": (lambda f: plain_csv(f / "short.csv", N=20), ["short", "2 rows", "longer record"]),
    "columns": (lambda f: plain_csv(f / "names.csv", header="t,a,b,c,d"), ["names.csv", "q1"]),
    "joints": (
        lambda f: plain_csv(
            f / "three.csv", q=np.zeros((4000, 1)), tau=np.zeros((4000, 1)), header="t,q1,tau1"
        ),
        ["2"],
    ),
    "dataset": (lambda f: "nothing", ["nothing", "tx40, emps"]),
    "missing file": (lambda f: f / "gone.csv", ["gone.csv"]),
    "nyquist": (
        lambda f: study_file(f, "signals: {lowpass: {cutoff: 900}}"),
        ["900 Hz", "Nyquist", "500"],
    ),
    "window": (lambda f: study_file(f, "rows: {window: [50, 60]}"), ["window", "50"]),
    "key": (lambda f: study_file(f, "sginals: {}"), ["study.yaml", "line 3", "sginals"]),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_input_is_one_message_and_exit_code_2(kind, tmp_path):
    make, words = BAD[kind]
    result = run("planar_2r", make(tmp_path), "-o", tmp_path / "out")
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ") and "Traceback" not in result.output
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "out").exists()


def test_unknown_robot(tmp_path):
    result = run("no_such_robot", "emps")
    assert result.exit_code == 2 and "packaged are" in result.stderr


def test_all_files_or_none(tmp_path):
    write_all(tmp_path / "out", {"a.txt": "old"})
    with pytest.raises(TypeError):
        write_all(tmp_path / "out", {"a.txt": "new", "b.txt": None})
    assert {p.name: p.read_text() for p in (tmp_path / "out").iterdir()} == {"a.txt": "old"}


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "out").write_text("a file stands here")
    result = run("planar_2r", plain_csv(tmp_path / "record.csv"), "-o", tmp_path / "out")
    assert result.exit_code == 2 and result.stderr.startswith("error: ")


def test_a_study_that_asks_for_blocks_is_told_what_to_do(tmp_path):
    (tmp_path / "study.yaml").write_text("record: {files: axis.npz}\nstream: 65536\n")
    result = run("emps", tmp_path / "study.yaml")
    assert result.exit_code == 2
    assert (
        "study.yaml, line 2: stream: this setting was removed, every record is read whole"
        in result.stderr
    )
