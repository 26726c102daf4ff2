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
    assert code == 2 and text == "no certificate: only closure equations tie joints [2, 3]\n"


def test_the_script_imports_the_standard_library_alone() -> None:
    lines = [line for line in SCRIPT.read_text().splitlines() if "import" in line.split()[:1]]
    assert lines == ["import ast", "import json", "import random", "import re", "import sys"]


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
    return "base parameters, rank"


def missing_parameter_of_that_rank(claim: dict, rng: random.Random) -> str:
    missing_parameter(claim, rng)
    claim["rank"] -= 1
    claim["count"] -= 1
    return "is not what the formulas say"


def dependent_parameter(claim: dict, rng: random.Random) -> str:
    claim["base_parameters"].append({"name": "M2", "own": "M2", "coefficients": {"M2": "1"}})
    claim["rank"] += 1
    claim["count"] += 1
    return "the rank is"


def wrong_rank(claim: dict, rng: random.Random) -> str:
    claim["rank"] -= 1
    return f"rank {claim['rank']}"


def no_effect_of_one(claim: dict, rng: random.Random) -> str:
    claim["no_effect"].append(claim["base_parameters"][0]["own"])
    return "no effect"


def effect_of_none(claim: dict, rng: random.Random) -> str:
    claim["no_effect"].pop()
    return "no effect"


def other_frame(claim: dict, rng: random.Random) -> str:
    frame = rng.choice([f for f in claim["frames"] if f["ant"]])
    frame["alpha"] = f"({frame['alpha']}) + pi/2"
    return "refuted"


def unlisted_parameter(claim: dict, rng: random.Random) -> str:
    absorbed = [n for b in claim["base_parameters"] for n in b["coefficients"] if n != b["own"]]
    claim["standard_parameters"].remove(rng.choice(absorbed))
    return "names other parameters"


def unknown_parameter(claim: dict, rng: random.Random) -> str:
    rng.choice(claim["base_parameters"])["coefficients"]["ZZ99"] = "1"
    return "names other parameters"


def unnamed(claim: dict, rng: random.Random) -> str:
    rng.choice(claim["base_parameters"])["name"] = "INERTIA"
    return "not called"


def link_without_mass(claim: dict, rng: random.Random) -> str:
    rng.choice([f for f in claim["frames"] if f["link"]])["link"] = False
    return "names other parameters"


def element_dropped(claim: dict, rng: random.Random) -> str:
    claim["elements"].pop()
    return "names other parameters"


def element_of_another_kind(claim: dict, rng: random.Random) -> str:
    next(e for e in claim["elements"] if e["kind"] == "inertia")["kind"] = "stiffness"
    return "refuted"


def closed_where_open(claim: dict, rng: random.Random) -> str:
    claim["loops"] = [[claim["frames"][0]["j"], claim["frames"][1]["j"]]]
    return "do not coincide"


FALSE = (
    wrong_sign, exchanged_constants, missing_parameter, missing_parameter_of_that_rank,
    dependent_parameter, wrong_rank, no_effect_of_one, effect_of_none, other_frame,
    unlisted_parameter, unknown_parameter, unnamed, link_without_mass, element_dropped,
    element_of_another_kind, closed_where_open,
)  # fmt: skip


@pytest.mark.parametrize("falsify", FALSE)
@pytest.mark.parametrize("name", sampled(ROBOTS, 0, always=("tx40",), more=1))
@some(3)
def test_a_false_claim_is_refused(name: str, falsify, folder: Path) -> None:
    claim = copy.deepcopy(json.loads(claimed(name, folder)))
    told = falsify(claim, random.Random(f"{name} {falsify.__name__}"))
    code, text = verdict(claim, folder)
    assert code == 1 and told in text, text


def test_gravity_left_out_is_refused(folder: Path) -> None:
    claim = json.loads(claimed("tx40", folder)) | {"gravity": ["0", "0", "0"]}
    assert verdict(claim, folder)[0] == 1


def test_a_loop_that_does_not_close_is_refused(folder: Path) -> None:
    claim = json.loads(claimed("sr400", folder))
    j, text = next(iter(claim["passive"].items()))
    claim["passive"][j] = f"{text} + pi/2"
    code, text = verdict(claim, folder)
    assert code == 1 and "do not coincide" in text


MALFORMED = {
    "primes are texts": lambda c: c | {"primes": ["1406887367"]},
    "primes are missing": lambda c: {k: x for k, x in c.items() if k != "primes"},
    "no object": lambda c: [c],
    "no robot": lambda c: c | {"frames": []},
    "escape": lambda c: c | {"robot": "\x1b[31mtx40"},
    "says that it fails": lambda c: c | {"valid": False},
    "frame without a frame before": lambda c: c | {"frames": c["frames"][1:]},
    "joints of no frame": lambda c: c | {"tied": [99]},
    "a constant that is none": lambda c: c | {"constants": {}},
    "huge power": lambda c: altered(c, "d", "D3**99999999"),
    "deep": lambda c: altered(c, "d", "-" * 1900 + "1"),
    "brackets": lambda c: altered(c, "alpha", "(" * 900 + "1" + ")" * 900),
    "long": lambda c: altered(c, "r", "1+" * 5000 + "1"),
    "angle of many turns": lambda c: altered(c, "theta", "100000000*q1"),
    "another joint's angle": lambda c: altered(c, "theta", "q2"),
    "code": lambda c: altered(c, "d", "__import__('os').getcwd()"),
    "null": lambda c: c | {"elements": None},
    "nan": lambda c: altered(c, "d", "nan"),
    "number for a text": lambda c: altered(c, "d", 1.0),
    "division by zero": lambda c: altered(c, "d", "1/0"),
}


def altered(claim: dict, key: str, text: object) -> dict:
    first, *others = claim["frames"]
    return claim | {"frames": [first | {key: text}, *others]}


@pytest.mark.parametrize("name", MALFORMED)
def test_what_is_no_certificate_is_never_refuted(name: str, folder: Path) -> None:
    claim = MALFORMED[name](json.loads(claimed("tx40", folder)))
    code, text = verdict(claim, folder)
    assert (
        code == 2 and text.startswith("no certificate: ") and text.isascii() and "\x1b" not in text
    )


@pytest.mark.parametrize("primes", [[], [2**127 - 1], [4611685975477714963], [2147483647]])
def test_primes_of_the_claim_are_not_used(primes: list[int], folder: Path) -> None:
    claim = json.loads(claimed("tx40", folder)) | {"primes": primes}
    assert verdict(claim, folder)[0] == 0


COLUMNS = {
    "tanh": "CAB: {along: 2, torque: 'tanh(q/0.1)', unit: N*m}",
    "sine of a sum": "SP: {along: {2: q1 + q2}, torque: 'sin(2*q)', unit: N*m}",
    "cube": "CU: {along: 1, torque: 'qd**3 + q*qd', unit: N*m}",
    "another joint": "EX: {along: 1, torque: 'exp(q2)*sign(qd)', unit: N*m}",
}


@pytest.mark.parametrize("law", COLUMNS)
def test_a_claim_with_columns_of_its_own(law: str, tmp_path: Path) -> None:
    (tmp_path / "cols.yaml").write_text(
        "symgen: 1\nname: cols\ngravity: [0, -g, 0]\nconstants: {D2: 0.5, g: 9.81}\nframes:\n"
        "  1: {ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}\n"
        "  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}\n"
        f"elements:\n  FV: {{kind: viscous, along: all}}\ncolumns:\n  {COLUMNS[law]}\n"
    )
    out = tmp_path / "own.json"
    arguments = ["check", str(tmp_path / "cols.yaml"), "--certificate", str(out)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    claim = json.loads(out.read_text())
    assert verdict(claim, tmp_path)[0] == 0
    wrong_sign(claim, random.Random(law))
    assert verdict(claim, tmp_path)[0] == 1
