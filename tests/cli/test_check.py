"""`symgen check`: true certificates pass, false ones give exit code 1."""

import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.regroup import regrouping as module

regroup = module.regroup


def run(*arguments):
    return CliRunner().invoke(app, ["check", *map(str, arguments)])


@pytest.mark.parametrize("name", ["planar_2r", "haptic", "four_bar"])
def test_packaged_robots_hold(name):
    result = run(name, "--verbose")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "certificate valid"
    assert "FALSE" not in result.stdout and "CasADi" in result.stdout


def test_one_line_where_every_check_holds():
    line = "planar_2r: certificate valid, "
    text = run("planar_2r").stdout
    assert text.startswith(line) and text.endswith(" checks\n") and text.count("\n") == 1


def test_json():
    document = json.loads(run("tx40", "--json").stdout)
    assert document["valid"] is True and document["failures"] == []
    assert document["count"] == document["rank"] == document["numeric_rank"] == 60
    assert len(set(document["primes"])) == 2 and document["torque_error"] < 1e-12


def mutated(robot):
    """The regrouping of `robot` with the sign of D3**2*M3 in XX2R flipped."""
    found = regroup(robot)
    base = [
        replace(b, combination={**b.combination, "M3": -b.combination["M3"]})
        if b.name == "XX2R"
        else b
        for b in found.base
    ]
    return replace(found, base=tuple(base))


def test_a_flipped_coefficient_is_caught_twice(monkeypatch):
    """By the identities over F_p, and by the torques of a dynamics that shares no code."""
    monkeypatch.setattr(module, "regroup", mutated)
    result = run("tx40", "--json")
    document = json.loads(result.stdout)
    assert result.exit_code == 1 and document["valid"] is False
    assert any("M3" in text for text in document["failures"]) and document["torque_error"] > 1e-3
    text = run("tx40")
    lines = text.stdout.splitlines()
    assert text.exit_code == 1 and lines[0].startswith("tx40: certificate FALSE, ")
    assert lines[1].startswith("FALSE ") and any("column of M3" in line for line in lines)


def test_a_missing_parameter_is_caught(monkeypatch):
    monkeypatch.setattr(
        module, "regroup", lambda robot: replace(regroup(robot), base=regroup(robot).base[:-1])
    )
    result = run("planar_2r")
    assert result.exit_code == 1 and "FALSE" in result.stdout


def test_bad_input_is_exit_2():
    result = run("planar_3r")
    assert (
        result.exit_code == 2 and "planar_2r" in result.stderr and "Traceback" not in result.output
    )
