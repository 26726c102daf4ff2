"""True claims with columns of their own, and forged ones: what `check_certificate.py` is tried on.

A forged claim says what is false: a rank that its columns do not have, since two of its laws are
one function or several are dependent; a coefficient, a name or a list that is another one.
"""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from symgen.certify.claim import claim
from symgen.certify.modules import certify
from symgen.description import load_robot, parse_robot
from symgen.regroup.regrouping import regroup

Claim = dict[str, Any]
ROBOT = """\
symgen: 1
name: arm
gravity: [0, -g, 0]
constants: {{D2: 0.5, VS: 0.1, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0,  theta: q1, r: 0}}
  2: {{ant: 1, sigma: {sigma}, alpha: {alpha}, d: D2, theta: {theta}, r: {r}}}
elements:
  FV: {{kind: viscous, along: all}}
  FS: {{kind: coulomb, along: all}}
  OFFSET: {{kind: offset, along: all}}
columns:
{columns}
"""
HINGE = {"sigma": 0, "alpha": 0, "theta": "q2", "r": 0}
SLIDE = {"sigma": 1, "alpha": "pi/2", "theta": 0, "r": "q2"}
FAMILIES = ("CA", "CB", "CC", "CD")


@cache
def text_of(columns: tuple[tuple[str, str], ...], slides: bool = False) -> str:
    """The claim of a robot with columns (along, law), as JSON."""
    lines = [
        f"  {family}: {{along: {along}, torque: '{law}', unit: N*m}}"
        for family, (along, law) in zip(FAMILIES, columns, strict=False)
    ]
    text = ROBOT.format(columns="\n".join(lines), **(SLIDE if slides else HINGE))
    return written(parse_robot(text.encode(), "arm.yaml"))


@cache
def packaged(name: str) -> str:
    return written(load_robot(name))


def written(robot: Any) -> str:
    regrouping = regroup(robot)
    certificate = certify(regrouping, {})
    assert certificate.valid, certificate.failures
    return json.dumps(claim(regrouping, certificate))


# --- true ---

LAWS = (
    (("2", "tanh(q/0.1)"),),
    (("all", "tanh(qd/VS)"),),
    (("1", "q**3"), ("2", "q**3")),
    (("2", "qd**3 + q*qd"),),
    (("2", "sin(2*q)"), ("2", "cos(2*q)")),
    (("2", "sin(3*q)"), ("1", "sin(q)")),
    (("{2: q1 + q2}", "sin(2*q)"),),
    (("{2: q1 - q2}", "tanh(q)"),),
    (("1", "exp(q2)*sign(qd)"),),
    (("2", "sign(q)"),),
    (("2", "abs(q)*sign(qd)"),),
    (("2", "abs(qd)*qd"),),
    (("all", "sign(qd)*exp(-abs(qd)/VS)"),),
    (("2", "exp(q)"), ("2", "exp(-q)")),
    (("2", "cos(q)*qd"),),
    (("1", "q*qd**2"), ("2", "q**2")),
    (("2", "exp(q)*sin(q)"), ("2", "exp(q)*cos(q)")),
    (("2", "sign(qd)*qd**2"), ("2", "sign(qd)*qd**4")),
    (("2", "tanh(qd)"), ("1", "tanh(qd)"), ("2", "exp(q)")),
    (("2", "tanh(10*qd)*(1 + q**2)"),),
    (("all", "q"), ("2", "q**5")),
    (("2", "(1 + q)**4"),),
)
OTHER_LAWS = (
    (("2", "sqrt(q**2 + 1)"),),
    (("2", "sign(q - 1)"),),
    (("2", "tanh(q)"), ("2", "tanh(2*q)")),
    (("2", "exp(q)"), ("2", "exp(q + 1)")),
    (("2", "exp(q + abs(q))"),),
    (("2", "sin(q/2)"),),
    (("2", "sin(qd)"),),
    (("2", "exp(tanh(q))"),),
)
"""Laws that are true too, of which the script does not know the independence."""


def true_claims() -> Iterator[tuple[str, str, int]]:
    """(what, claim, right exit code): 20 and more that are judged, the others not."""
    for columns in LAWS:
        yield told(columns), text_of(columns), 0
    for columns in OTHER_LAWS:
        yield told(columns), text_of(columns), 2


def told(columns: Sequence[tuple[str, str]]) -> str:
    return "; ".join(f"{law} along {along}" for along, law in columns)


# --- forged: laws that are dependent ---

PAIRS = (
    ("exp(2*q)", "exp(q)**2"), ("exp(q + 1)", "exp(q)"), ("exp(q)*exp(q)", "exp(2*q)"), ("exp(-q)", "1/exp(q)"),
    ("exp(0.5*q)**2", "exp(q)"), ("exp(q - 2)*3", "exp(q)"), ("exp(q)*exp(-q)", "1"), ("exp(3*q)*exp(-q)", "exp(2*q)"),
    ("tanh(-q)", "tanh(q)"), ("tanh(q)*(exp(2*q) + 1)", "exp(2*q) - 1"), ("tanh(q)*(exp(q) + exp(-q))", "exp(q) - exp(-q)"),
    ("tanh(2*q)*(1 + tanh(q)**2)", "2*tanh(q)"), ("(1 - tanh(q)**2)*(exp(q) + exp(-q))**2", "1"), ("1 - 2/(exp(2*q) + 1)", "tanh(q)"),
    ("sin(2*q)", "sin(q)*cos(q)"), ("cos(2*q)", "1 - 2*sin(q)**2"), ("sin(q)**2 + cos(q)**2", "1"), ("cos(q + pi)", "cos(q)"),
    ("sin(q + pi/2)", "cos(q)"), ("cos(-q)", "cos(q)"), ("sin(-q)", "sin(q)"), ("sin(q - pi)", "sin(q)"), ("sin(3*q)", "3*sin(q) - 4*sin(q)**3"),
    ("cos(q + 0.3)", "cos(q)*cos(0.3) - sin(q)*sin(0.3)"), ("cos(q + 0.6)", "cos(q)*(2*cos(0.3)**2 - 1) - 2*sin(q)*sin(0.3)*cos(0.3)"),
    ("sin(q + D2)", "sin(q)*cos(D2) + cos(q)*sin(D2)"), ("cos(4*q)", "8*cos(q)**4 - 8*cos(q)**2 + 1"),
    ("sign(q)**2", "1"), ("sign(-q)", "sign(q)"), ("sign(2*q)", "sign(q)"), ("sign(q)**3", "sign(q)"), ("abs(-q)", "abs(q)"), ("abs(2*q)", "abs(q)"),
    ("abs(q)*sign(q)", "q"), ("abs(q)**2", "q**2"), ("abs(q)", "q*sign(q)"), ("sqrt(q**2)", "abs(q)"), ("sqrt(4*q**2)", "abs(q)"),
    ("sign(q**3)", "sign(q)"), ("sign(sign(q))", "sign(q)"), ("abs(abs(q))", "abs(q)"), ("sign(q*(1 + q**2))", "sign(q)"), ("abs(q**3)", "q**2*abs(q)"),
    ("sign(tanh(q))", "sign(q)"), ("abs(sin(q))*abs(sin(q))", "sin(q)**2"), ("exp(abs(q)) + exp(-abs(q))", "exp(q) + exp(-q)"),
    ("sign(q)*tanh(abs(q))", "tanh(q)"), ("tanh(abs(q))**2", "tanh(q)**2"), ("max(q, -q)", "abs(q)"), ("min(q, -q)", "abs(q)"),
    ("q**2 + 2*q + 1", "(q + 1)**2"), ("q*q", "q**2"), ("q**1.0", "q"), ("2*q", "q"), ("q/VS", "q"), ("(q**2)**0.5", "abs(q)"),
    ("tan(q)*cos(q)", "sin(q)"), ("exp(q*1)", "exp(q)"), ("exp(q)**(2)", "exp(q)**2"), ("exp(VS*q)*exp(q)", "exp((1 + VS)*q)"),
    ("tanh(q + 0)", "tanh(q)"), ("sin(6*q/3)", "sin(2*q)"), ("sin(q*2)", "sin(2*q)"), ("exp(q + qd)", "exp(q)*exp(qd)"),
    ("log(exp(q))", "q"), ("floor(q) - floor(q)", "0"), ("sinh(q)", "exp(q) - exp(-q)"), ("cosh(q)**2 - sinh(q)**2", "1"), ("heaviside(qd)", "1 + sign(qd)"),
    ("x*q", "q"), ("q*VS", "q*D2"), ("pi*q", "q"), ("e**q", "exp(q)"), ("D2**q", "exp(q)"), ("1", "cos(0)"), ("cos(pi)", "1"),
)  # fmt: skip
BESIDE = (  # one law, dependent on friction, offset or the links themselves
    "sign(qd)", "sign(-qd)", "sign(3*qd)", "sign(qd)**3", "qd", "-qd", "abs(qd)*sign(qd)", "1", "sign(qd)**2", "sign(q)**2", "cos(q)**2 + sin(q)**2",
    "exp(qd)*exp(-qd)", "qd/VS", "qd + sign(qd)", "abs(qd)/sign(qd)", "qd*sign(q)**2", "D2", "pi", "2*sign(qd) - 3*qd + 1", "tanh(qd)*0 + qd", "abs(qd)/qd",
    "qd*(sin(q)**2 + cos(q)**2)", "sign(qd)*exp(0)", "qd**2/qd", "0", "q - q", "sign(qd)*abs(sign(qd))", "sqrt(qd**2)*sign(qd)",
)  # fmt: skip
TRIPLES = (
    ("exp(q) + exp(-q)", "exp(q)", "exp(-q)"), ("cos(q + pi/3)", "cos(q)", "sin(q)"), ("(1 + q)**2", "q**2", "q"), ("sign(q)*exp(q)", "abs(q)*sign(q)*exp(q)", "q*exp(q)"),
    ("exp(abs(q))", "(1 + sign(q))*exp(q)", "(1 - sign(q))*exp(-q)"), ("cos(3*q)", "cos(q)", "cos(q)**3"), ("tanh(q)*(exp(q) + exp(-q))", "exp(q)", "exp(-q)"),
)  # fmt: skip


def with_laws(laws: Sequence[str], joint: int) -> Claim:
    """The claim of as many independent columns, with these laws in place of theirs."""
    before = (("1", "2")[joint - 1],)
    columns = tuple((before[0], f"q**{3 + 2 * k}") for k in range(len(laws)))
    forged: Claim = json.loads(text_of(columns))
    for family, law in zip(FAMILIES, laws, strict=False):
        element = next(e for e in forged["elements"] if e["family"] == family)
        element["laws"] = [law] * len(element["laws"])
    return forged


def with_dependent_laws() -> Iterator[tuple[str, Claim]]:
    for k, laws in enumerate((*PAIRS, *((x,) for x in BESIDE), *TRIPLES)):
        yield " | ".join(laws), with_laws(laws, 1 + k % 2)


# --- forged: fields ---

ROBOTS = ("planar_2r", "scara", "two_branch", "sr400", "stanford")


def edited(count: int, seed: int, robots: Sequence[str] = ROBOTS) -> Iterator[tuple[str, Claim]]:
    """Edits of every field that make a true claim false; robots and edits take turns."""
    rng = random.Random(seed)
    for k in range(count):
        name = robots[k % len(robots)]
        edit = EDITS[k % len(EDITS)]
        forged = json.loads(packaged(name))
        what = edit(forged, rng)
        yield f"{name}: {edit.__name__.replace('_', ' ')}, {what}", forged


def _coefficient(c: Claim, rng: random.Random) -> tuple[Claim, str]:
    pairs = [(b["coefficients"], n) for b in c["base_parameters"] for n in b["coefficients"]]
    return rng.choice(
        [
            (m, n)
            for m, n in pairs
            if not any(m is b["coefficients"] and n == b["own"] for b in c["base_parameters"])
        ]
    )


def another_coefficient(c: Claim, rng: random.Random) -> str:
    of, n = _coefficient(c, rng)
    of[n] = rng.choice(
        ["-({})", "2*({})", "({}) + 1", "({})*cos(1)", "({})*pi", "({})/3", "({}) - 0.0001"]
    ).format(of[n])
    return f"{n}: {of[n]}"


def coefficient_of_own(c: Claim, rng: random.Random) -> str:
    b = rng.choice(c["base_parameters"])
    b["coefficients"][b["own"]] = rng.choice(("2", "-1", "0", "1.0001"))
    return str(b["own"])


def coefficient_dropped(c: Claim, rng: random.Random) -> str:
    of, n = _coefficient(c, rng)
    del of[n]
    return n


def coefficient_added(c: Claim, rng: random.Random) -> str:
    b = rng.choice(c["base_parameters"])
    n = rng.choice([n for n in c["standard_parameters"] if n not in b["coefficients"]])
    b["coefficients"][n] = "1"
    return f"{n} in {b['name']}"


def name_that_is_no_constant(c: Claim, rng: random.Random) -> str:
    of, n = _coefficient(c, rng)
    of[n] = f"({of[n]})*" + rng.choice(("x", "q1", "qd1", "M1", "sin", "e", "inf", "g0"))
    return of[n]


def base_parameter_dropped(c: Claim, rng: random.Random) -> str:
    b = c["base_parameters"].pop(rng.randrange(len(c["base_parameters"])))
    if rng.random() < 0.5:
        c["rank"] = c["count"] = c["rank"] - 1
    return str(b["name"])


def base_parameter_added(c: Claim, rng: random.Random) -> str:
    own = {b["own"] for b in c["base_parameters"]}
    n = rng.choice([n for n in c["standard_parameters"] if n not in own])
    c["base_parameters"].append({"name": n, "own": n, "coefficients": {n: "1"}})
    c["rank"] = c["count"] = c["rank"] + 1
    return str(n)


def no_effect_that_has_one(c: Claim, rng: random.Random) -> str:
    n = rng.choice([n for n in c["standard_parameters"] if n not in c["no_effect"]])
    c["no_effect"].append(n)
    return str(n)


def effect_that_is_none(c: Claim, rng: random.Random) -> str:
    return (
        str(c["no_effect"].pop(rng.randrange(len(c["no_effect"]))))
        if c["no_effect"]
        else no_effect_that_has_one(c, rng)
    )


def another_rank(c: Claim, rng: random.Random) -> str:
    key = rng.choice(("rank", "count"))
    c[key] += rng.choice((-1, 1, 0.5, 10))
    return f"{key} {c[key]}"


def names_of_two_exchanged(c: Claim, rng: random.Random) -> str:
    a, b = rng.sample(c["base_parameters"], 2)
    a["coefficients"], b["coefficients"] = b["coefficients"], a["coefficients"]
    return f"{a['name']}, {b['name']}"


def parameter_unlisted(c: Claim, rng: random.Random) -> str:
    return str(c["standard_parameters"].pop(rng.randrange(len(c["standard_parameters"]))))


def link_flag(c: Claim, rng: random.Random) -> str:
    f = rng.choice(c["frames"])
    f["link"] = not f["link"]
    return str(f["j"])


def element_dropped(c: Claim, rng: random.Random) -> str:
    return str(c["elements"].pop(rng.randrange(len(c["elements"])))["family"])


def element_of_two_kinds(c: Claim, rng: random.Random) -> str:
    e = copy.deepcopy(rng.choice([e for e in c["elements"] if e["along"]]))
    c["elements"].append(e)
    return str(e["family"])


def valid_is_false(c: Claim, rng: random.Random) -> str:
    c["valid"] = rng.choice((False, None, "true", 1.5))
    return str(c["valid"])


def frame_without_antecedent(c: Claim, rng: random.Random) -> str:
    f = rng.choice(c["frames"])
    f["ant"] = rng.choice((99, f["j"], "0", None))
    return str(f["ant"])


def joint_left_out(c: Claim, rng: random.Random) -> str:
    return str(c["joints"].pop())


def loop_of_open_frames(c: Claim, rng: random.Random) -> str:
    c["loops"].append([c["frames"][0]["j"], c["frames"][-1]["j"]])
    return str(c["loops"][-1])


def name_of_another(c: Claim, rng: random.Random) -> str:
    b = rng.choice(c["base_parameters"])
    b["name"] = rng.choice((b["own"] + "X", "ZZ99", b["own"].lower(), "", b["own"] + " "))
    return str(b["name"])


EDITS = (
    another_coefficient, coefficient_of_own, coefficient_dropped, coefficient_added, name_that_is_no_constant,
    base_parameter_dropped, base_parameter_added, no_effect_that_has_one, effect_that_is_none, another_rank,
    names_of_two_exchanged, parameter_unlisted, link_flag, element_dropped, element_of_two_kinds, valid_is_false,
    frame_without_antecedent, joint_left_out, loop_of_open_frames, name_of_another,
)  # fmt: skip


def forged_claims() -> Iterator[tuple[str, Claim]]:
    yield from with_dependent_laws()
    yield from edited(100, 1)
