"""`symgen cestac`: options, exit codes, files."""

import json
import re

import numpy as np
import pytest
import typer
from campaign import campaign
from typer.testing import CliRunner

from runtime.parallel.checkpoint import Checkpoint
from symgen.cli.cestac import cestac

FILES = {"report.html", "study.yaml", "resolution.png", "resolution.svg"} | {
    f"cestac.{kind}" for kind in ("json", "csv", "mat", "npz")
}


def run(*arguments):
    app = typer.Typer()
    app.command()(cestac)
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_fine_encoder_is_unbiased(emps_data, tmp_path):
    result = run("emps", "emps", "--delta", "1e-6", "--runs", 3, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert "practically unbiased at 1e-06" in result.stdout
    assert {p.name for p in tmp_path.iterdir()} == FILES


def test_coarse_encoder_is_biased(emps_data):
    result = run(
        "emps",
        "emps",
        "--delta",
        "1e-4",
        "--delta",
        "2e-5",
        "--runs",
        2,
        "--rounding",
        "uniform",
        "--seed",
        7,
        "--json",
    )
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert [level["level"]["delta"] for level in found["levels"]] == [1e-4, 2e-5]
    assert found["settings"]["cestac"]["rounding"] == "uniform" and found["provenance"]["seed"] == 7
    assert {"e_rho", "e_rho_own", "increase"} <= set(found["levels"][0])


@campaign
def test_workers_give_the_same_bits(emps_data):
    one, two = (
        json.loads(
            run("emps", "emps", "--delta", "1e-6", "--runs", 2, "--workers", w, "--json").stdout
        )
        for w in (1, 2)
    )
    assert one["levels"] == two["levels"]


def test_torque_steps_and_named_columns(emps_data):
    result = run(
        "emps",
        "emps",
        "--delta",
        "1e-6",
        "--torque",
        "0.01",
        "--runs",
        2,
        "--columns",
        "M1R,FV1",
        "--json",
    )
    found = json.loads(result.stdout)
    assert found["names"][:2] == ["M1R", "FV1"] and len(found["levels"]) == 3
    assert {*found["deciding"]} == {"M1R", "FV1"} and "FS1" in found["names"]  # fitted, not judged


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--delta", "foo"], ["cestac.delta", "foo"]),
        (["--delta", "-1"], ["cestac.delta", "more than 0"]),
        (["--runs", "1"], ["cestac.runs", "at least 2"]),
        (["--rounding", "up"], ["cestac.rounding", "two-point"]),
        (["--side", "left"], ["cestac.side", "motor"]),
        (["--columns", "M9"], ["M9", "M1R"]),
        (["--uneven", "0.1"], ["cestac.uneven", "rounding: phase"]),
        (["--uneven", "0.6", "--rounding", "phase"], ["cestac.uneven", "0.5"]),
        (["--reader", "counts"], ["cestac.rounding", "destroys the changes"]),
        (["--reader", "edges"], ["signals.reader", "counts"]),
        (["--place", "loop"], ["cestac.rounding", "expected phase, the only rounding"]),
        (["--method", "best"], ["estimate.method", "didim"]),
        (
            ["--rounding", "phase", "--delta", "5e-8"],
            ["cestac.delta", "not coarser than the step of encoder"],
        ),
    ],
)
def test_bad_options(emps_data, options, words):
    result = run("emps", "emps", *options)
    assert result.exit_code == 2
    assert all(word in result.stderr for word in words), result.stderr


def test_advice(emps_data, tmp_path):
    result = run("emps", "emps", "--advise", "--rounding", "two-point", "--runs", 4, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    caption, header, answer, *_ = result.stdout.splitlines()
    assert caption.startswith(
        "Encoder step at the joints, m: least squares is practically unbiased"
    )
    assert re.fullmatch(r"encoder +rounding two-point", header)
    assert re.fullmatch(r"all +4\.59e-06, 1\.0\de-05", answer)  # the answer comes first
    assert {p.name for p in tmp_path.iterdir()} == {
        "report.html",
        "advice.json",
        "study.yaml",
        "advice.png",
        "advice.svg",
    }
    assert "Resolution advice" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_advice_judges_the_steps_asked_for(emps_data):
    fine, coarse = (
        run(
            "emps",
            "emps",
            "--advise",
            "--rounding",
            "two-point",
            "--runs",
            4,
            "--delta",
            step,
            "--json",
        )
        for step in ("1e-6", "1e-4")
    )
    assert (fine.exit_code, coarse.exit_code) == (0, 1)
    assert json.loads(coarse.stdout)["asked"][0]["worst"][0] == "M1R"
    refused = run("emps", "emps", "--advise", "--runs", 4, "--delta", "x")
    assert refused.exit_code == 2


@campaign
def test_ctrl_c_keeps_what_is_done_and_the_same_command_goes_on(emps_data, tmp_path, monkeypatch):
    arguments = ["emps", "emps", "--delta", "1e-6", "--runs", 12, "-o", tmp_path]
    taken = []

    def interrupted(checkpoint, runs):
        taken.append(len(runs))
        checkpoint._runs.append(runs)
        if sum(taken) >= 6:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "add", interrupted)
        stopped = run(*arguments)
    assert stopped.exit_code == 130
    assert (
        f"stopped; 6 runs are in {tmp_path / 'runs.npz'}: repeat the command to continue"
        in stopped.stderr
    )
    assert {p.name for p in tmp_path.iterdir()} == {"runs.npz"}
    other = run(*arguments[:-2], "--seed", 2, "-o", tmp_path)
    assert other.exit_code == 2 and "another study (different: cestac.seed)" in other.stderr
    whole = run(*arguments)
    assert whole.exit_code == 0 and {p.name for p in tmp_path.iterdir()} == FILES
    assert (
        json.loads((tmp_path / "cestac.json").read_text())["levels"]
        == json.loads(run(*arguments[:-2], "--json").stdout)["levels"]
    )


@campaign
def test_many_runs_stay_in_their_archives(tmp_path, emps_data):
    """2 steps of 501 runs: more than cestac.json lists."""
    result = run(
        "emps",
        "emps",
        "--delta",
        "1e-6",
        "--delta",
        "1e-7",
        "--runs",
        501,
        "--columns",
        "M1R",
        "-o",
        tmp_path,
    )
    assert result.exit_code == 0
    assert {p.name for p in tmp_path.iterdir()} == FILES | {"runs.npz"}
    assert json.loads((tmp_path / "cestac.json").read_text())["levels"][1]["runs"] is None
    with np.load(tmp_path / "runs.npz") as archive:
        assert archive["X"].shape == (1002, 4)  # the essential columns and M1R
