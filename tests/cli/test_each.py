"""`symgen identify --each`: one identification a record, results that exist are kept."""

import json
import shutil

import numpy as np
import pytest
from planar_data import record
from typer.testing import CliRunner

import runtime
import runtime.each
import symgen
from symgen.cli import told
from symgen.cli.main import app

RUNS = 6
STUDY = {"record": {"files": ["run0.csv"]}, "signals": {"lowpass": {"cutoff": 20}}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Six records of the planar arm, and the study of the first."""
    monkeypatch.chdir(tmp_path)
    for k in range(RUNS):
        run = record(N=3000, seed=k)
        columns = np.column_stack([run.t, run.q, run.tau])
        names = "t,q1,q2,tau1,tau2"
        np.savetxt(tmp_path / f"run{k}.csv", columns, delimiter=",", header=names, comments="")
    (tmp_path / "study.yaml").write_text(json.dumps(STUDY))
    return tmp_path


def each(count, *options):
    """Lines of the answer, the error stream, and the exit code, for the first records."""
    files = [f"run{k}.csv" for k in range(1, count)]
    arguments = ["identify", "planar_2r", "study.yaml", *files, "--each", "-o", "results"]
    result = CliRunner().invoke(app, [*arguments, "--no-plausible", *options])
    assert result.exit_code in (0, 1, 2), result.output
    return result.stdout.splitlines(), result.stderr, result.exit_code


def written(folder):
    """Time of the last change of each estimate, and its content."""
    files = sorted(folder.glob("results/*/estimate.json"))
    return {f.parent.name: (f.stat().st_mtime_ns, json.loads(f.read_text())) for f in files}


def test_three_of_six_records_are_identified_already(folder):
    """Their files stay as they are, and all estimates are those of `runtime.identify`."""
    three, _, _ = each(3)
    before = written(folder)
    assert list(before) == ["run0", "run1", "run2"]
    six, told, code = each(RUNS)
    after = written(folder)
    assert "6 records in results; 3 of them had their results already" in told
    assert six[:3] == three and len(six) == len(after) == RUNS
    assert all(line.startswith(f"run{k}: ") for k, line in enumerate(six))
    assert {name: after[name] for name in before} == before
    model = symgen.model("planar_2r")
    study = runtime.load_study("study.yaml")
    alone = runtime.identify(model, runtime.read_record("run4.csv", model), study)
    assert after["run4"][1]["X"] == alone.estimate.X.tolist()
    states = [one["checklist"]["state"] for _, one in after.values()]
    assert code == ("no" in states)


@pytest.mark.parametrize("changed", ["file", "study", "damaged", "option"])
def test_what_decides_results_makes_them_again(folder, changed):
    each(2)
    before = written(folder)
    if changed == "file":
        shutil.copy("run5.csv", "run0.csv")
    elif changed == "study":
        (folder / "study.yaml").write_text(json.dumps({**STUDY, "essential": {"threshold": 1.1}}))
    elif changed == "damaged":
        (folder / "results" / "run0" / "estimate.json").write_text('{"provenance": []}')
    _, told, _ = each(2, *(["--physical"] if changed == "option" else []))
    kept = 1 if changed in ("file", "damaged") else 0
    assert f"2 records in results; {kept} of them" in told
    after = written(folder)
    assert after["run0"][0] != before["run0"][0]
    assert (after["run1"] == before["run1"]) == (kept == 1)


def test_a_record_that_cannot_be_used_is_told_and_the_others_go_on(folder):
    (folder / "run1.csv").write_text("t,q1\n0,0\n")
    lines, _, code = each(3)
    assert lines[1].startswith("run1: failed. ") and "run1.csv" in lines[1]
    assert len(lines) == 3 and code == 1
    assert list(written(folder)) == ["run0", "run2"]


def test_records_of_one_name_have_their_folders(folder):
    for day in ("day1", "day2"):
        (folder / day).mkdir()
        shutil.copy("run1.csv", folder / day / "log.csv")
    files = ["day1/log.csv", "day2/log.csv", f"../{folder.name}/run2.csv"]
    options = ["--each", "-o", "results", "--no-plausible"]
    result = CliRunner().invoke(app, ["identify", "planar_2r", *files, *options])
    assert [line.partition(":")[0] for line in result.stdout.splitlines()] == [
        "day1/log",
        "day2/log",
        "run2",
    ]
    assert len(list(folder.glob("results/day*/log/estimate.json"))) == 2


def test_an_interrupted_command_is_continued(folder, monkeypatch):
    """Ctrl-C while the third record is being written."""
    write = runtime.each.write_all

    def interrupted(place, files):
        if place.name == "run2":
            raise KeyboardInterrupt
        return write(place, files)

    with monkeypatch.context() as patch:
        patch.setattr(runtime.each, "write_all", interrupted)
        files = [f"run{k}.csv" for k in range(1, 4)]
        arguments = ["planar_2r", "study.yaml", *files, "--each", "-o", "results"]
        result = CliRunner().invoke(app, ["identify", *arguments, "--no-plausible"])
    assert result.exit_code == 130 and result.stderr.splitlines()[-1] == (
        "stopped; 2 of 4 records are finished, and their results are in results; the next one was "
        "run2: repeat the command to continue"
    )
    before = written(folder)
    assert list(before) == ["run0", "run1"]
    lines, said, _ = each(4)
    assert "4 records in results; 2 of them had their results already" in said
    assert len(lines) == 4 and {name: written(folder)[name] for name in before} == before


def test_programs_read_the_records_and_the_time_that_is_left(folder, monkeypatch):
    """Records whose results are kept take no time, so the time of the others is not theirs."""
    each(2)
    monkeypatch.setenv("SYMGEN_LINES", "json")
    clock = iter(range(100, 200, 7))
    monkeypatch.setattr("symgen.cli.told.monotonic", lambda: next(clock) / 7)
    _, said, _ = each(5)
    lines = [line for line in map(json.loads, said.splitlines()) if "done" in line]
    assert [line["done"] for line in lines] == [2, 3, 4, 5]
    assert {line["total"] for line in lines} == {5} and lines[0]["left_s"] is None
    assert lines[-1]["left_s"] == 0 and lines[1]["left_s"] > 0


def test_the_time_that_is_left_is_that_of_the_steps_done_since_the_first_call(monkeypatch):
    """100 of 110 steps are kept; then two take 3 s each, and 8 are left."""
    clock = iter([50.0, 53.0, 56.0])
    monkeypatch.setattr(told, "monotonic", lambda: next(clock))
    left = told.time_left()
    assert [left(100, 110), left(101, 110), left(102, 110)] == [None, 27.0, 24.0]


@pytest.mark.campaign
def test_processes_give_the_same_lines(folder):
    alone, _, _ = each(3)
    shutil.rmtree(folder / "results")
    assert each(3, "--workers", "2")[0] == alone


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--each"], "--each needs -o FOLDER"),
        (["--each", "-o", "results", "--json"], "without --repair, --json"),
        (["--workers", "2"], "--workers is for --each"),
    ],
)
def test_options_that_do_not_go_together(folder, options, said):
    result = CliRunner().invoke(app, ["identify", "planar_2r", "run0.csv", *options])
    assert result.exit_code == 2 and said in result.stderr
