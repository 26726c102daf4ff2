"""JSON Schemas, as `symgen schema` prints them: made from the types, true of what is written, complete."""

import ast
import re
from pathlib import Path
from typing import get_args

import jsonschema
import pytest

import runtime
from runtime.compose import json_schema
from runtime.core.least_squares.estimate import Status
from runtime.ground.settings import to_mapping
from runtime.reading.datasets import DATASETS, dataset_study
from runtime.study import Study, study_from_mapping

ROOM = Path(runtime.__file__).parent


@pytest.mark.parametrize("kind", ["study", "estimate", "cestac"])
def test_schemas_are_schemas(kind):
    jsonschema.Draft202012Validator.check_schema(json_schema(kind))


def statuses(tree):
    """Texts that a module gives as the status of an Estimate: to the keyword or name `status`, or
    first in what a function returns as one.
    """
    values = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg == "status"
    ]
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple | ast.Name):
            first = (
                node.targets[0].elts[0]
                if isinstance(node.targets[0], ast.Tuple)
                else node.targets[0]
            )
            values += [node.value] if isinstance(first, ast.Name) and first.id == "status" else []
        if (
            isinstance(node, ast.AnnAssign)
            and ast.unparse(node.annotation) == "Status"
            and node.value
        ):
            values.append(node.value)
        if (
            isinstance(node, ast.FunctionDef)
            and node.returns
            and "Status" in ast.unparse(node.returns)
        ):
            values += [
                n.value.elts[0]
                for n in ast.walk(node)
                if isinstance(n, ast.Return) and isinstance(n.value, ast.Tuple)
            ]
    words = {
        n.value
        for value in values
        for n in ast.walk(value)
        if isinstance(n, ast.Constant) and isinstance(n.value, str)
    }
    return {word for word in words if re.fullmatch(r"[a-z]+(-[a-z]+)*", word)}


def test_every_status_of_the_code_is_in_the_schema():
    trees = [
        ast.parse(p.read_text(encoding="utf-8"))
        for p in ROOM.rglob("*.py")
        if p.stem != "semidefinite"
    ]
    written = set().union(*map(statuses, trees))
    known = json_schema("estimate")["properties"]["status"]["enum"]
    assert written == set(known) == set(get_args(Status))


@pytest.mark.parametrize("name", [None, *DATASETS])
def test_studies_follow_their_schema(name):
    schema = json_schema("study")
    written = {} if name is None else dataset_study(name)
    jsonschema.validate(written, schema)
    jsonschema.validate(
        to_mapping(Study() if name is None else study_from_mapping(written)), schema
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"signals": {"median": 5.5}},
        {"signals": {"lowpas": {}}},
        {"signals": {"lowpass": {"cutoff": -1}}},
        {"cestac": {"runs": 1}},
        {"rows": {"window": [0]}},
        {"record": [{"side": "left"}]},
        {"essential": {"threshold": 1}},
    ],
)
def test_editors_see_what_the_reader_refuses(wrong):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, json_schema("study"))
    with pytest.raises(runtime.InputError):
        study_from_mapping(wrong)


@pytest.mark.parametrize(
    "wrong", [{"signals": {"reader": "lowpas"}}, {"estimate": {"method": "tls"}}]
)
def test_editors_know_the_lists(wrong):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, json_schema("study"))


def test_editors_show_what_a_key_holds():
    definitions = json_schema("study")["$defs"]
    assert definitions["Lowpass"]["properties"]["cutoff"]["description"] == (
        "Cut-off frequency. auto: symgen derives it from the motion and the noise of each record "
        "(`runtime.core.signals.cutoff`), doubles it for counts, and limits it to 50 Hz, the value of "
        "the chapter, which is also used if there is no record. [Hz]"
    )
    for name, definition in definitions.items():
        assert [
            key for key, value in definition["properties"].items() if "description" not in value
        ] == [], name
