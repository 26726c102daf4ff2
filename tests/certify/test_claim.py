"""A claim is verified by a program of the standard library alone, and refused where it is false."""

from __future__ import annotations

import ast
import copy
import json
import random
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path

import pytest
from campaign import sampled, some
from certify.forgeries import (
    BESIDE,
    EDITS,
    LAWS,
    OTHER_LAWS,
    PAIRS,
    TRIPLES,
    edited,
    text_of,
    told,
    with_laws,
)
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


@pytest.mark.parametrize("name", ["four_bar", "five_bar"])
def test_joints_that_closure_equations_tie_are_judged(name: str, folder: Path) -> None:
    true = json.loads(claimed(name, folder))
    assert verdict(true, folder)[0] == 0
    for falsify in FALSE_OF_LOOPS:
        claim = copy.deepcopy(true)
        told = falsify(claim, random.Random(falsify.__name__))
        code, text = verdict(claim, folder)
        assert code == 1 and told in text, (falsify, text)


def test_what_no_square_root_closes_is_not_judged(folder: Path) -> None:
    claim = json.loads(claimed("four_bar", folder))
    frames = {f["j"]: f for f in claim["frames"]}
    frames[3]["alpha"] = "pi/2"  # the ends turn in different planes
    code, text = verdict(claim, folder)
    assert code == 2 and text == "not judged: the closure of frames 4 and 5\n"
    friction = copy.deepcopy(json.loads(claimed("four_bar", folder)))
    friction["elements"][2]["along"] = {"2": {"2": "1"}}
    friction["elements"][2]["signs"] = {"2": 1}
    renamed = json.dumps(friction).replace("FS1", "FS2")
    code, text = verdict(json.loads(renamed), folder)
    assert code == 2 and text == "not judged: FS2 along joints that closure equations tie\n"


def test_the_script_imports_the_standard_library_alone() -> None:
    modules = set()
    for node in ast.walk(ast.parse(SCRIPT.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules.add(node.module)
    assert modules and modules <= sys.stdlib_module_names


def wrong_sign(claim: dict, rng: random.Random) -> str:
    b = rng.choice([b for b in claim["base_parameters"] if len(b["coefficients"]) > 1])
    name = rng.choice([n for n in b["coefficients"] if n != b["own"]])
    b["coefficients"][name] = f"-({b['coefficients'][name]})"
    return f"the column of {name} is not"


def exchanged_constants(claim: dict, rng: random.Random) -> str:
    constants = [c for c in claim["constants"] if c.startswith(("D", "L", "RL"))][-2:]
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

FALSE_OF_LOOPS = (
    wrong_sign, exchanged_constants, missing_parameter_of_that_rank, dependent_parameter,
    no_effect_of_one, unlisted_parameter, element_of_another_kind,
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
    "tanh": ["CAB: {along: 2, torque: 'tanh(q/0.1)', unit: N*m}"],
    "sine of a sum": ["SP: {along: {2: q1 + q2}, torque: 'sin(2*q)', unit: N*m}"],
    "cube": ["CU: {along: 1, torque: 'qd**3 + q*qd', unit: N*m}"],
    "another joint": ["EX: {along: 1, torque: 'exp(q2)*sign(qd)', unit: N*m}"],
    "friction's sign": [
        "CAB: {along: 2, torque: sign(qd), unit: N*m}",
        "SPR: {along: 2, torque: sin(q), unit: N*m}",
    ],
    "friction's sign, turned": ["CAB: {along: {2: -q2}, torque: sign(qd), unit: N*m}"],
    "friction's size": ["CAB: {along: 2, torque: abs(qd)*sign(qd), unit: N*m}"],
    "sign of a position": [
        "CAB: {along: 2, torque: abs(q)*sign(qd), unit: N*m}",
        "SPR: {along: 2, torque: sign(q), unit: N*m}",
    ],
    "Stribeck": ["CAB: {along: all, torque: 'sign(qd)*exp(-abs(qd)/0.1)', unit: N*m}"],
    "exponentials of both signs": [
        "CAB: {along: 2, torque: exp(q), unit: N*m}",
        "SPR: {along: 2, torque: exp(-q), unit: N*m}",
    ],
    "one function twice": [
        "CAB: {along: 2, torque: 'tanh(q/0.1)', unit: N*m}",
        "SPR: {along: 2, torque: '-3*tanh(-q/0.1)', unit: N*m}",
    ],
}
NOT_JUDGED = {
    "a root": (["CAB: {along: 2, torque: sqrt(q**2 + 1), unit: N*m}"], "sqrt"),
    "sign of what is no coordinate": (
        ["CAB: {along: 2, torque: sign(q - 1), unit: N*m}"],
        "sign",
    ),
    "multiples": (
        [
            "CAB: {along: 2, torque: tanh(q), unit: N*m}",
            "SPR: {along: 2, torque: tanh(2*q), unit: N*m}",
        ],
        "tanh",
    ),
    "sums with a number": (
        [
            "CAB: {along: 2, torque: exp(q), unit: N*m}",
            "SPR: {along: 2, torque: exp(q + 1), unit: N*m}",
        ],
        "numeric",  # exp(q + 1) = e*exp(q): e is no number of the field
    ),
    "an argument that stops": (
        ["CAB: {along: 2, torque: exp(q + abs(q)), unit: N*m}"],
        "exp",
    ),
    "half an angle": (["CAB: {along: 2, torque: sin(q/2), unit: N*m}"], "1/2"),
    "sine of a rate": (["CAB: {along: 2, torque: sin(qd), unit: N*m}"], "qd"),
}


def with_columns(columns: list[str], tmp_path: Path) -> dict:
    (tmp_path / "cols.yaml").write_text(
        "symgen: 1\nname: cols\ngravity: [0, -g, 0]\nconstants: {D2: 0.5, g: 9.81}\nframes:\n"
        "  1: {ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}\n"
        "  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}\n"
        "elements:\n  FV: {kind: viscous, along: all}\n  FS: {kind: coulomb, along: all}\n"
        "columns:\n" + "".join(f"  {column}\n" for column in columns)
    )
    out = tmp_path / "own.json"
    arguments = ["check", str(tmp_path / "cols.yaml"), "--certificate", str(out)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    return json.loads(out.read_text())


@pytest.mark.parametrize("law", COLUMNS)
def test_a_claim_with_columns_of_its_own(law: str, tmp_path: Path) -> None:
    claim = with_columns(COLUMNS[law], tmp_path)
    code, text = verdict(claim, tmp_path)
    assert code == 0, text
    wrong_sign(claim, random.Random(law))
    assert verdict(claim, tmp_path)[0] == 1


@pytest.mark.parametrize("law", NOT_JUDGED)
def test_a_law_that_is_not_judged_is_named(law: str, tmp_path: Path) -> None:
    columns, name = NOT_JUDGED[law]
    code, text = verdict(with_columns(columns, tmp_path), tmp_path)
    assert code == 2 and text.startswith("not judged: ") and name in text, text


def with_coefficient(text: str) -> Callable[[dict], None]:
    """D2 is the coefficient of M2 in MX1R; a text that a reader could take for it."""

    def change(claim: dict) -> None:
        base = next(b for b in claim["base_parameters"] if b["own"] == "MX1")
        assert base["coefficients"]["M2"] == "D2"
        base["coefficients"]["M2"] = text

    return change


def element_of(claim: dict, family: str) -> dict:
    return next(e for e in claim["elements"] if e["family"] == family)


def other_elements(claim: dict, element: dict) -> None:
    """An element whose parameters have the names of others."""
    claim["elements"].append({"when": None, "form": {}, **element})


def without_friction(claim: dict) -> None:
    """Signs that are zero leave friction without effect."""
    element_of(claim, "FS")["signs"] = {"1": 0, "2": 0}
    base = claim["base_parameters"]
    claim["base_parameters"] = [b for b in base if not b["own"].startswith("FS")]
    claim["no_effect"] += ["FS1", "FS2"]
    claim["rank"] = claim["count"] = len(claim["base_parameters"])


ROW = {"along": {"2": {"2": "0"}}, "signs": {"2": 1}}
OFFSETS = {
    "kind": "offset",
    "along": {"1": {"1": "1"}, "2": {"2": "1"}},
    "signs": {"1": 1, "2": 1},
}
FORGED = {
    **{
        text: with_coefficient(text)
        for text in (
            "1 // D2", "D2 & 1", "D2 << 0", "D2 @ 1", "D2 % 2", "D2 | D2", "D2 ^ 0", "~D2", "not D2",
            "+D2", "cos(0, 7)*D2", "cos(0, x=7)*D2", "cos()*D2", "D2*cos(*[0])", "tan(D2)", "D2.real",
            "D2 # + 1", "D2 if 1 else 0", "(D2,)", "D2 == D2", "[D2][0]", "0x1*D2", "1_0*D2", "1j*D2",
            "True*D2", "D2*1.00000000000000000000000001", "D2 + q1", "D2*sin", "D2**1.5", "1e999999999",
            "(D2 := D2)", "lambda: D2", "D\u00b2", "\uff242", "D2\n",
        )
    },
    "family of a link's parameter": lambda c: other_elements(c, {"family": "MX", "kind": "stiffness", **ROW}),
    "family that ends in a number": lambda c: other_elements(
        c, {"family": "M", "kind": "stiffness", **ROW}
    ),
    "family twice": lambda c: other_elements(c, {"family": "FV", **OFFSETS}),
    "signs that are zero": without_friction,
    "signs that are two": lambda c: element_of(c, "FS")["signs"].update({"1": 2}),
    "signs that are true": lambda c: element_of(c, "FS")["signs"].update({"1": True}),
    "signs that are turned": lambda c: element_of(c, "FS")["signs"].update({"1": -1}),
    "a law of viscous friction": lambda c: element_of(c, "FV").update(laws=["tanh(qd)", "tanh(qd)"]),
    "a row of no constant": lambda c: element_of(c, "FV")["along"]["1"].update({"1": "x"}),
    "a joint in two ways": lambda c: element_of(c, "FV")["along"]["1"].update({"01": "1"}),
    "an unknown joint": lambda c: element_of(c, "FV")["along"]["1"].update({"3": "1"}),
    "gravity of the state": lambda c: c.update(gravity=["0", "-g*q1", "0"]),
    "a constant that is pi": lambda c: c["constants"].update(pi=3),
    "a constant without a value": lambda c: c["constants"].update(D2=None),
    "a parameter twice": lambda c: c["standard_parameters"].append("MX2"),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_claim_is_not_verified(name: str, folder: Path) -> None:
    claim = json.loads(claimed("planar_2r", folder))
    assert verdict(claim, folder)[0] == 0
    FORGED[name](claim)
    code, text = verdict(claim, folder)
    assert code in (1, 2) and text.isascii(), text


def test_a_key_that_stands_twice_is_refused(folder: Path) -> None:
    text = claimed("planar_2r", folder)
    path = folder / "twice.json"
    path.write_text(text.replace('"rank":', '"rank": 1, "rank":', 1))
    done = subprocess.run(
        [sys.executable, "-I", str(SCRIPT), str(path)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "no certificate: a key stands twice\n")


def test_a_root_of_a_square_and_a_size_are_not_taken_for_two_functions(tmp_path: Path) -> None:
    """sqrt(q**2) and abs(q) are one function: with both the rank is one less."""
    columns = [f"{family}: {{along: 2, torque: abs(q), unit: N*m}}" for family in ("CAB", "SPR")]
    claim = with_columns(columns, tmp_path)
    assert verdict(claim, tmp_path)[0] == 0
    element_of(claim, "CAB")["laws"] = ["sqrt(q**2)"]
    code, text = verdict(claim, tmp_path)
    assert code == 2 and text == "not judged: the function sqrt of 'sqrt(q**2)'\n"


def test_angles_that_are_numbers_have_one_unit(tmp_path: Path) -> None:
    """cos(0.6) is 2*cos(0.3)**2 - 1, whatever the constants are called."""
    claim = with_columns(COLUMNS["cube"], tmp_path)
    b = next(b for b in claim["base_parameters"] if b["own"] == "MX1")
    one = "(cos(0.6) - 2*cos(0.3)**2 + 2)"
    b["coefficients"]["M2"] = f"D2*{one}"
    assert verdict(claim, tmp_path)[0] == 0
    b["coefficients"]["M2"] = f"D2*{one}*cos(0.3)"
    assert verdict(claim, tmp_path)[0] == 1


TRUE = [(columns, 0) for columns in LAWS] + [(columns, 2) for columns in OTHER_LAWS]


@pytest.mark.parametrize("case", sampled(TRUE, 2, more=3), ids=lambda case: told(case[0]))
def test_a_true_claim_is_verified_or_not_judged(case, tmp_path: Path) -> None:
    """`benchmarks/certificates.py` judges all of them, and all forged claims."""
    columns, right = case
    code, text = verdict(json.loads(text_of(columns)), tmp_path)
    assert code == right, text
    assert right == 0 or text.startswith("not judged: ")


@pytest.mark.parametrize(
    "laws", sampled([*PAIRS, *((x,) for x in BESIDE), *TRIPLES], 12, more=12), ids=" and ".join
)
def test_dependent_laws_are_not_verified(laws, tmp_path: Path) -> None:
    assert verdict(with_laws(laws, 2), tmp_path)[0] in (1, 2)


def test_numeric_coefficients_are_not_judged(folder: Path) -> None:
    claim = json.loads(claimed("planar_2r", folder)) | {"method": "numeric, for the constants"}
    code, text = verdict(claim, folder)
    assert code == 2 and text.startswith("not judged: coefficients that are numeric")


@pytest.mark.parametrize("k", sampled(range(len(EDITS)), 2, more=4))
def test_an_edited_claim_is_not_verified(k: int, tmp_path: Path) -> None:
    what, claim = [*edited(k + 1, 3)][k]
    assert verdict(claim, tmp_path)[0] in (1, 2), what
