"""`symgen datasets`: what is known and where it lies; nothing is fetched."""

import json

from typer.testing import CliRunner

from runtime.reading.datasets import DATASETS
from symgen.cli.main import app


def run(*arguments):
    return CliRunner().invoke(app, ["datasets", *arguments])


def test_nothing_here(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_DATA", str(tmp_path))
    monkeypatch.setattr("pooch.os_cache", lambda name: tmp_path / "cache")
    result = run()
    assert result.exit_code == 0
    assert all(
        sha in result.stdout for dataset in DATASETS.values() for sha in dataset.files.values()
    )
    assert "not here" in result.stdout and list(tmp_path.iterdir()) == []
    rows = json.loads(run("--json").stdout)
    assert [row["name"] for row in rows] == list(DATASETS)
    assert all(file["path"] is None for row in rows for file in row["files"])


def test_found(emps_data):
    rows = {row["name"]: row for row in json.loads(run("--json").stdout)}
    assert {file["name"]: file["path"] for file in rows["emps"]["files"]} == {
        name: str(path) for name, path in emps_data.items()
    }
