"""Parameters assumed to be zero: fewer columns, proved; and what a record says of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import runtime
import symgen
from oracles.random_robots import random_robot
from runtime.assumptions import assumptions_asked
from runtime.study import study_from_mapping
from symgen.certify.modules import certify
from symgen.description.yaml import parse_robot, write_yaml
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import regroup

ARM = """
symgen: 1
name: arm
gravity: [0, 0, -g]
constants: {{g: 9.81, L: 0.4}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: 0, theta: q2, r: 0}}
  3: {{ant: 2, sigma: 0, alpha: 0, d: L, theta: q3, r: 0}}
elements:
  FV: {{kind: viscous, along: all}}
assume: {{{assume}}}
"""


def arm(assume: str):
    return parse_robot(ARM.format(assume=assume).encode(), "arm.yaml")


def test_formulas_show_what_becomes_identifiable() -> None:
    """Without YY2 the inertia XX2 stands with the mass of link 3 alone."""
    formulas = {b.own: str(b.formula) for b in regroup(arm("YY2: 0, link 3: symmetric xz")).base}
    assert formulas["XX2"] == "XX2 - L**2*M3"
    assert formulas["ZZ1"] == "ZZ1 + YY3 + L**2*M3"
    assert not {"XY3", "YZ3", "MY3"} & {*formulas}


@pytest.mark.parametrize("seed", [2, 5, 11, 17, 23])
def test_random_assumptions_are_certified(seed: int) -> None:
    """Rank, formulas and the module against energies, with the assumed parameters zero."""
    robot, rng = random_robot(seed), np.random.default_rng(seed)
    inertial = [name for name in robot.parameters if name[:2] in ("XX", "XY", "YY", "MX", "MZ")]
    names = frozenset(map(str, rng.choice(inertial, min(5, len(inertial)), replace=False)))
    own = replace(robot, assume=names)
    regrouping = regroup(own)
    assert certify(regrouping).valid
    assert len(regrouping) <= len(regroup(robot))
    assert not names & {n for b in regrouping.base for n in b.combination}


def test_written_and_refused() -> None:
    robot = arm("XY2: 0, link 3: symmetric yz")
    assert robot.assume == {"XY2", "XY3", "XZ3", "MX3"}
    assert parse_robot(write_yaml(robot).encode(), "a.yaml").assume == robot.assume
    for wrong, sentence in (
        ("M2: 1.2", "write another known value under `values`"),
        ("link 3: symmetric z", "symmetric xy"),
        ("XX9: 0", "not a standard parameter"),
    ):
        with pytest.raises(DescriptionError, match=sentence):
            arm(wrong)


def test_a_record_contradicts_what_is_false() -> None:
    """XY3 and MY3 are zero in the record, MX3 is not, M1 acts nowhere."""
    robot = arm("XY3: 0, MY3: 0, MX3: 0, M1: 0")
    free = symgen.model(replace(robot, assume=frozenset()))
    rng, t = np.random.default_rng(2), np.arange(4000) / 200
    q = sum(
        0.5 / k * np.sin(2 * np.pi * 0.1 * k * t[:, None] + rng.uniform(0, 6, 3))
        for k in range(1, 6)
    )
    qd, qdd = np.gradient(q, 1 / 200, axis=0), np.zeros_like(q)
    qdd = np.gradient(qd, 1 / 200, axis=0)
    chi = dict.fromkeys(free.STANDARD_PARAMETERS, 0.5) | {"XY3": 0, "MY3": 0, "MX3": 0.3, "M1": 0}
    tau = free.inverse_dynamics(q, qd, qdd, free.base_parameters(chi))
    tau += 0.05 * rng.standard_normal(tau.shape)
    study = study_from_mapping({"signals": {"median": 1, "lowpass": None, "decimate": None}})
    record = runtime.Record(t, q, tau, rate=200.0)
    fit = runtime.estimate(free, record, study)
    tests = {a.name: a for a in assumptions_asked(free, fit, sorted(robot.assume))}
    assert tests["MX3"].p_value < 1e-6 and "contradicts MX3 = 0" in tests["MX3"].text
    assert abs(tests["MX3"].value - 0.3) < 0.05
    assert tests["XY3"].p_value > 0.001 and tests["MY3"].p_value > 0.001
    assert "cannot be tested" in tests["M1"].text
