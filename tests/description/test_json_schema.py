"""The published JSON Schema: current, true of every robot file this package ships, and as strict as
the reader on keys.
"""

import json
from importlib import resources

import jsonschema
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import json_schema, packaged_robots, skeleton


def plain(text):
    """Data as an editor sees it: keys are text."""
    return json.loads(json.dumps(YAML(typ="safe", pure=True).load(text)))


def faults(data):
    validator = jsonschema.Draft202012Validator(json_schema())
    return [error.message for error in validator.iter_errors(data)]


def test_it_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(json_schema())


def test_schema_verb_prints_it():
    assert json.loads(CliRunner().invoke(app, ["schema"]).stdout) == json_schema()


@pytest.mark.parametrize("name", packaged_robots())
def test_packaged_robots_follow_it(name):
    assert (
        faults(
            plain(
                (resources.files("symgen.description") / "robots" / f"{name}.yaml").read_text(
                    encoding="utf-8"
                )
            )
        )
        == []
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("title:", "titel:", "titel"),
        ("kind: coulomb", "kind: dry", "'dry' is not one of"),
        ("[0, -g, 0]", "[0, -g]", "too short"),
        ("ant: 1", "ant: one", "'one' is not of type 'integer'"),
        ("symgen: 1 ", "convention: classic\nsymgen: 1 ", "'classic' is not one of"),
    ],
)
def test_editors_see_faults(old, new, words):
    text = skeleton("arm")
    assert old in text and faults(plain(text)) == []
    assert words in " ".join(faults(plain(text.replace(old, new, 1))))


def test_first_line_of_a_new_file_leads_to_it(tmp_path):
    """To a file beside it, which `symgen schema` writes: no path of this machine is in it."""
    file = tmp_path / "a folder" / "my_arm.yaml"
    assert CliRunner().invoke(app, ["new", str(file)]).exit_code == 0
    first, second = file.read_text(encoding="utf-8").splitlines()[:2]
    assert first == "# yaml-language-server: $schema=robot.schema.json"
    assert "symgen schema > robot.schema.json" in second
