"""`symgen convert`: by suffix, whole or not at all, with a report; verbs take the formats as ROBOT."""

import json

import pytest
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import load_robot


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_par_and_back(tmp_path):
    there, back = tmp_path / "tx40.par", tmp_path / "back.yaml"
    result = run("convert", "tx40", there)
    assert result.exit_code == 0 and "not carried by tx40.par" in result.stdout and "FVM6" in result.stdout
    result = run("convert", there, back)
    assert result.exit_code == 0 and "not carried" not in result.stdout
    assert load_robot(back).frames == load_robot("tx40").frames == load_robot(there).frames
    shown = [json.loads(run("show", file, "--json").stdout) for file in (there, back)]
    assert shown[0] == shown[1] and shown[0]["count"] > 40


def test_never_overwrites_unless_told(tmp_path):
    file = tmp_path / "arm.par"
    file.write_text("mine")
    result = run("convert", "rx90", file)
    assert result.exit_code == 2 and "--force" in result.stderr and file.read_text() == "mine"
    assert run("convert", "rx90", file, "--force").exit_code == 0 and "RL4" in file.read_text()


def test_nothing_is_written_for_another_mechanism(tmp_path):
    result = run("convert", "haptic", tmp_path / "haptic.par")
    assert result.exit_code == 2 and "no place for" in result.stderr and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("rx90", "arm.txt"), "expected a file name"),
        (("nothing.par", "arm.yaml"), "no file"),
        (("rx90", "arm.par", "--constant", "D3"), "NAME=NUMBER"),
        (("rx90", "arm.par", "--constant", "D3=1/0"), "division by zero"),
    ],
)
def test_bad_input(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("convert", *arguments)
    assert result.exit_code == 2 and words in result.stderr and list(tmp_path.iterdir()) == []


def test_constants_of_a_foreign_file(tmp_path):
    file = tmp_path / "arm.par"
    run("convert", "planar_2r", file)
    text = "\n".join(line for line in file.read_text().splitlines() if not line.startswith("(* constants"))
    file.write_text(text)
    result = run("convert", file, tmp_path / "arm.yaml")
    assert result.exit_code == 2 and "--constant" in result.stderr
    names = load_robot("planar_2r").constants
    options = [part for name in names for part in ("--constant", f"{name}=3/2")]
    assert run("convert", file, tmp_path / "arm.yaml", *options).exit_code == 0
    assert set(load_robot(tmp_path / "arm.yaml").constants.values()) == {1.5}
