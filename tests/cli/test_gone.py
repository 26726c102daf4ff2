"""Verbs of earlier versions: one sentence that names what to use instead, and exit code 2."""

import pytest
from typer.testing import CliRunner

from symgen.cli.main import WENT, app


@pytest.mark.parametrize("verb", WENT)
def test_a_verb_that_went_names_its_replacement(verb) -> None:
    done = CliRunner().invoke(app, [verb, "some.yaml", "--workers", "2"])
    assert done.exit_code == 2
    assert done.stderr == f"error: {WENT[verb]}\n"
