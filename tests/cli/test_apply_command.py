"""`symgen apply`: in place or into another file, neither asked nothing is written, an existing file is
whole or as it was, errors are one line.
"""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import symgen
from oracles.applying import exact
from oracles.mjcf_robots import BRANCHES
from runtime.reporting import result_files
from symgen.cli.main import app
from symgen.description.files import read_robot


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A file and an estimate with another damping, in the current folder."""
    monkeypatch.chdir(tmp_path)
    Path("arm.xml").write_text(BRANCHES)
    model = symgen.model(read_robot("arm.xml")[0])
    damped = next(j for j, name in model.LABELS.items() if name == "a2")
    Path("results").mkdir()
    Path("results/estimate.json").write_text(
        exact(model, dict(model.VALUES) | {f"FV{damped}": 0.0625}).to_json()
    )
    return tmp_path


EXPECTED = BRANCHES.replace('damping="0.05"', 'damping="0.0625"')


def run(*words: str, code: int = 0):
    result = CliRunner().invoke(app, ["apply", *words])
    assert result.exit_code == code, result.output
    return result


def test_in_place_and_into_another_file(folder) -> None:
    said = run("results", "arm.xml", "-o", "new.xml").stdout
    assert (
        Path("arm.xml").read_text() == BRANCHES
        and Path("new.xml").read_text() == EXPECTED
        and "0.0625" in said
        and "+25 " in said
    )
    assert "exists already" in run("results", "arm.xml", "-o", "new.xml", code=2).stderr
    run("results/estimate.json", "arm.xml", "--in-place")
    assert Path("arm.xml").read_text() == EXPECTED
    assert "no number changes" in run("results", "arm.xml", "--in-place").stdout
    both = run("results", "arm.xml", "--in-place", "-o", "x.xml", code=2).stderr
    assert "give only one of the two options" in both
    assert sorted(p.name for p in folder.iterdir()) == ["arm.xml", "new.xml", "results"]


def test_nothing_is_written_unless_asked(folder) -> None:
    told = run("results", "arm.xml")
    assert "0.0625" in told.stdout
    assert (
        told.stderr
        == "nothing is written; -o FILE writes another file, --in-place writes arm.xml\n"
    )
    assert '-        <body name="a2"' in run("results", "arm.xml", "--diff").stdout
    changes = json.loads(run("results", "arm.xml", "--json").stdout)
    (change,) = changes["changes"]
    assert (change["place"], change["number"], change["before"]) == (
        "joint 'a2'",
        "damping",
        0.05,
    ) and changes["schema"] == "symgen-apply/1"
    assert Path("arm.xml").read_text() == BRANCHES and sorted(p.name for p in Path().iterdir()) == [
        "arm.xml",
        "results",
    ]


def test_an_existing_file_is_never_half_written(folder, monkeypatch) -> None:
    Path("new.xml").write_text("old")

    def full(path, data):
        path.write_bytes(data[: len(data) // 2])
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(result_files, "_write_durably", full)
    assert (
        "nothing was changed"
        in run("results", "arm.xml", "-o", "new.xml", "--force", code=2).stderr
    )
    assert Path("new.xml").read_text() == "old" and sorted(p.name for p in Path().iterdir()) == [
        "arm.xml",
        "new.xml",
        "results",
    ]


def test_a_link_to_the_file_stays_one(folder) -> None:
    Path("link.xml").symlink_to("arm.xml")
    run("results", "link.xml", "--in-place")
    assert Path("link.xml").is_symlink() and Path("arm.xml").read_text() == EXPECTED


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere", "arm.xml"], "nowhere"),
        (["results", "nowhere.urdf"], "no file nowhere.urdf"),
        (["results", "arm.xml", "--lock", "a2=0"], "no base parameters of arm.xml"),
        (["results", "arm.xml", "--chain", "world", "nothing"], "no link 'nothing'"),
        (["results", "results/estimate.json"], "apply writes URDF"),
    ],
)
def test_errors_are_one_line(folder, words, message) -> None:
    said = run(*words, code=2).stderr
    assert message in said and said.startswith("error: ") and said.count("\n") == 1
