"""What a release says of itself: one version, one list of dependencies."""

import re
import tomllib
from pathlib import Path

from ruamel.yaml import YAML

from symgen.version import VERSION

ROOT = Path(__file__).resolve().parents[1]
RECIPE = YAML(typ="safe").load((ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_version_stands_in_one_place() -> None:
    assert "version" not in PROJECT and PROJECT["dynamic"] == ["version"]
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == VERSION
    assert RECIPE["context"]["version"] == VERSION
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## {re.escape(VERSION)}\b", changes, re.MULTILINE)


def test_recipe_asks_for_what_the_package_asks_for() -> None:
    asked = {line.replace("-base", "").replace(" ", "") for line in RECIPE["requirements"]["run"]}
    minimum = RECIPE["context"]["python_min"]
    asked = {line.replace("${{python_min}}", minimum) for line in asked}
    assert asked == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}


def test_every_python_that_ci_tries_is_named() -> None:
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    tried = re.search(r"python: \[(.*)\]", workflow)
    assert tried is not None
    for version in re.findall(r'"([\d.]+)"', tried[1]):
        assert f"Programming Language :: Python :: {version}" in PROJECT["classifiers"]
