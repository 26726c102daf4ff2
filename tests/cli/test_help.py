"""Help of every verb, the version, and the exit codes of a misspelt command line."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from symgen.cli.main import VERBS, app
from symgen.version import VERSION


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def test_help_lists_every_verb():
    result = run("--help")
    assert result.exit_code == 0 and all(verb in result.stdout for verb in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb):
    result = run(verb, "--help")
    assert (
        result.exit_code == 0
        and f" {verb} [OPTIONS]" in result.stdout
        and "--help" in result.stdout
    )


def test_version():
    assert run("--version").stdout.strip() == f"symgen {VERSION}"


@pytest.mark.parametrize(
    "arguments", [["shwo", "tx40"], ["show"], ["show", "tx40", "--formt", "json"], ["--nothing"]]
)
def test_misspelt_is_exit_2(arguments):
    result = run(*arguments)
    assert result.exit_code == 2 and "Traceback" not in result.output


def test_the_installed_entry_point_ends_without_traceback():
    code = (
        "from symgen.cli.main import main; import sys; sys.argv = ['symgen', 'show', "
        "'nothing.yaml']; main()"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (
        result.returncode == 2
        and result.stderr.startswith("error: ")
        and "Traceback" not in result.stderr
    )


def test_python_runs_the_command_where_the_shell_does_not_find_it():
    said = subprocess.run(
        [sys.executable, "-m", "symgen", "--version"], capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == f"symgen {VERSION}"


@pytest.mark.parametrize("option", [["-o", ""], ["--output", ""], ["--output="]])
def test_an_empty_output_is_refused(option, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("generate", "planar_2r", *option)
    assert result.exit_code == 2 and "-o is empty" in result.stderr
    assert not list(tmp_path.iterdir())
