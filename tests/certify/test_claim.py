"""A claim is verified by a program of the standard library alone, and refused where it is false."""

from __future__ import annotations

import copy
import json
import random
import subprocess
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path

import pytest
from campaign import sampled, some
from typer.testing import CliRunner

from symgen.cli.main import app
from symgen.description import load_robot
from symgen.emit.generate import generate_module

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "examples" / "check_certificate.py"
ROBOTS = ("tx40", "scara", "sr400", "two_branch")


@cache
def claimed(name: str, folder: Path) -> str:
    path = folder / f"{name}.json"
    result = CliRunner().invoke(app, ["check", name, "--certificate", str(path)])
    assert result.exit_code == 0, result.output
    return path.read_text(encoding="utf-8")


def verdict(claim: dict, folder: Path) -> tuple[int, str]:
    path = folder / "claim.json"
    path.write_text(json.dumps(claim))
    done = subprocess.run(
        [sys.executable, "-I", str(SCRIPT), str(path)], capture_output=True, text=True, check=False
    )
    assert not done.stderr, done.stderr
    return done.returncode, done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("claims")


@pytest.mark.parametrize("name", ROBOTS)
@some(2)
def test_a_claim_is_verified(name: str, folder: Path) -> None:
    claim = json.loads(claimed(name, folder))
    code, text = verdict(claim, folder)
    assert code == 0 and text == f"{name}: verified: rank {claim['rank']} and every formula\n"
    digest = sha256(generate_module(load_robot(name)).encode()).hexdigest()
    assert claim["texts"][f"{name}.py"]["sha256"] == digest and claim["valid"] is True


def test_what_is_skipped_is_said(folder: Path) -> None:
    code, text = verdict(json.loads(claimed("four_bar", folder)), folder)
    assert code == 2 and text == "skipped: only closure equations tie joints [2, 3]\n"


def test_the_script_imports_the_standard_library_alone() -> None:
    lines = [line for line in SCRIPT.read_text().splitlines() if "import" in line.split()[:1]]
    assert lines == ["import ast", "import json", "import random", "import sys"]


def wrong_sign(claim: dict, rng: random.Random) -> str:
    b = rng.choice([b for b in claim["base_parameters"] if len(b["coefficients"]) > 1])
    name = rng.choice([n for n in b["coefficients"] if n != b["own"]])
    b["coefficients"][name] = f"-({b['coefficients'][name]})"
    return f"the column of {name} is not"


def exchanged_constants(claim: dict, rng: random.Random) -> str:
    constants = [c for c in claim["constants"] if c.startswith(("D", "RL"))]
    for b in claim["base_parameters"]:
        for name, text in b["coefficients"].items():
            if constants[0] in text:
                b["coefficients"][name] = text.replace(constants[0], constants[-1])
    return "is not what the formulas say"


def missing_parameter(claim: dict, rng: random.Random) -> str:
    claim["base_parameters"].remove(rng.choice(claim["base_parameters"]))
    return "the rank is"


def missing_parameter_of_that_rank(claim: dict, rng: random.Random) -> str:
    missing_parameter(claim, rng)
    claim["rank"] -= 1
    return "is not what the formulas say"


def dependent_parameter(claim: dict, rng: random.Random) -> str:
    claim["base_parameters"].append({"name": "M2", "own": "M2", "coefficients": {"M2": "1"}})
    claim["rank"] += 1
    return "the rank is"


def wrong_rank(claim: dict, rng: random.Random) -> str:
    claim["rank"] -= 1
    return f"not {claim['rank']}"


def no_prime(claim: dict, rng: random.Random) -> str:
    claim["primes"][1] = claim["primes"][0] * 3
    return "is no prime"


FALSE = (
    wrong_sign, exchanged_constants, missing_parameter, missing_parameter_of_that_rank,
    dependent_parameter, wrong_rank, no_prime,
)  # fmt: skip


@pytest.mark.parametrize("falsify", FALSE)
@pytest.mark.parametrize("name", sampled(ROBOTS, 0, always=("tx40",)))
@some(3)
def test_a_false_claim_is_refused(name: str, falsify, folder: Path) -> None:
    claim = copy.deepcopy(json.loads(claimed(name, folder)))
    told = falsify(claim, random.Random(f"{name} {falsify.__name__}"))
    code, text = verdict(claim, folder)
    assert code == 1 and told in text, text


def test_a_loop_that_does_not_close_is_refused(folder: Path) -> None:
    claim = json.loads(claimed("sr400", folder))
    j, text = next(iter(claim["passive"].items()))
    claim["passive"][j] = f"{text} + pi/2"
    code, text = verdict(claim, folder)
    assert code == 1 and "do not coincide" in text
