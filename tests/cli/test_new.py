"""`symgen new`: a skeleton that works as it is, and never replaces a file."""

import pytest
from typer.testing import CliRunner

from symgen.cli.main import app


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_skeleton_works_as_it_is(tmp_path):
    file = tmp_path / "my_arm.yaml"
    assert run("new", file).exit_code == 0
    assert run("check", file).exit_code == 0
    assert "ZZ1R" in run("show", file).stdout
    assert [p.name for p in tmp_path.iterdir()] == ["my_arm.yaml"]


def test_never_overwrites(tmp_path):
    file = tmp_path / "my_arm.yaml"
    file.write_text("mine")
    result = run("new", file)
    assert (
        result.exit_code == 2 and "exists already" in result.stderr and file.read_text() == "mine"
    )


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("2arm.yaml", "letter"),
        ("my arm.yaml", "letter"),
        ("arm.txt", ".yaml"),
        ("class.yaml", "word of Python"),
    ],
)
def test_bad_names(name, words, tmp_path):
    result = run("new", tmp_path / name)
    assert result.exit_code == 2 and words in result.stderr and list(tmp_path.iterdir()) == []


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "taken").write_text("mine")
    result = run("new", tmp_path / "taken" / "arm.yaml")
    assert result.exit_code == 2 and "taken" in result.stderr and "Traceback" not in result.output
