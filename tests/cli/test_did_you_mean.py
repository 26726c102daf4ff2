"""A verb that is typed wrongly."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from symgen.cli.main import app


@pytest.mark.parametrize(
    ("typed", "meant"), [("identfy", "identify"), ("chek", "check"), ("cestak", "cestac")]
)
def test_the_nearest_verb_is_proposed(typed: str, meant: str) -> None:
    result = CliRunner().invoke(app, [typed])
    assert result.exit_code == 2 and f"did you mean {meant}?" in result.stderr


def test_of_a_word_that_is_near_none_nothing_is_proposed() -> None:
    result = CliRunner().invoke(app, ["xyzzy"])
    assert result.exit_code == 2 and "did you mean" not in result.stderr
