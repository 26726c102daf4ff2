"""Loops whose plane joints before them turn: closure is written in the frame that carries the loop,
so nothing of it depends on those joints, at no angle of theirs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import FULL, campaign, sampled

from oracles.multipliers import Multipliers
from oracles.random_loops import KINDS, random_loop
from oracles.random_robots import random_parameters
from oracles.test_loops_agree import whole
from oracles.test_random_loops import SEEDS, module_of, torques_agree
from symgen.certify.certificate import certify_formulas
from symgen.certify.lagrange import sampled as sampled_states
from symgen.certify.modules import certify
from symgen.derive.loops import close
from symgen.description import parse_robot
from symgen.description.expression import Expression
from symgen.emit.generate import generate_module
from symgen.regroup import solve
from symgen.regroup.regrouping import EXACT, _regrouped, regroup

WITH_COUNTERBALANCE = """symgen: 1
name: balanced
gravity: [0, 0, -g]
constants: {A1: 0.35, A2: 1.15, A3: 0.041, D1: 0.675, D4: 1.0, D6: 0.24, E1: 0.3, H1: 0.5, E2: 0.25,
  g: 9.81}
frames:                            # KUKA KR300 R2500 ultra, its counterbalance as a jack: 7, 8, 9
  1: {ant: 0, sigma: 0, alpha: pi,    d: 0,  theta: q1,        r: -D1}
  2: {ant: 1, sigma: 0, alpha: pi/2,  d: A1, theta: q2 - pi/2, r: 0}
  3: {ant: 2, sigma: 0, alpha: 0,     d: A2, theta: q3 + pi,   r: 0}
  4: {ant: 3, sigma: 0, alpha: -pi/2, d: A3, theta: q4,        r: -D4}
  5: {ant: 4, sigma: 0, alpha: pi/2,  d: 0,  theta: q5,        r: 0}
  6: {ant: 5, sigma: 0, alpha: -pi/2, d: 0,  theta: q6,        r: 0}
  7: {ant: 1, sigma: 0, mu: 0, b: H1, alpha: pi/2,  d: -E1, theta: q7, r: 0}
  8: {ant: 7, sigma: 1, mu: 0, alpha: pi/2,  d: 0,  theta: 0,  r: q8}
  9: {ant: 8, sigma: 0, mu: 0, alpha: -pi/2, d: 0,  theta: q9, r: 0}
  10: {ant: 2, sigma: 2,       alpha: 0,     d: E2, theta: 0,  r: 0}
loops: [{cut: 9, twin: 10, start: {q2: 0.1}}]
elements:
  Ia: {kind: inertia, along: all}
  FV: {kind: viscous, along: all}
  GAS: {kind: offset, along: {8: q8}}
  K: {kind: stiffness, along: {8: q8}}
"""


def check_behind(kind: str, seed: int, behind: int, folder: Path) -> None:
    """Torques and base parameters at all angles of the joints before, on which the passive ones do
    not depend.
    """
    robot = random_loop(kind, seed, behind=behind)
    module = module_of(generate_module(robot), folder)
    torques_agree(robot, module, behind)
    q = np.tile([close(robot).start[j] for j in robot.joints], (25, 1))
    for k in range(behind):
        q[:, k] = np.linspace(-np.pi, np.pi, 25)
        assert np.ptp(module.passive_joints(q), axis=0).max() < 1e-9


@pytest.mark.parametrize("kind", sampled(KINDS, 2))
def test_behind_turning_joints(kind: str, tmp_path: Path) -> None:
    check_behind(kind, KINDS.index(kind), 1 + KINDS.index(kind) % 3, tmp_path)


def test_a_jack_in_millimetres_on_an_arm_in_metres(tmp_path: Path) -> None:
    """Its stroke is drawn at the size of the loop: no state closed at that of the arm."""
    robot = random_loop("jack", 0, behind=1)
    assert 100 * robot.longest < max(abs(f.d.value(robot.constants)) for f in robot.frames)
    assert certify(regroup(robot)).valid
    check_behind("jack", 0, 1, tmp_path)


BEHIND = [(kind, behind) for kind in KINDS for behind in (1, 2, 3)]
# coefficients that only hold for the numbers of the file were checked at other numbers
IN_NUMBERS = [
    ("isosceles slider-crank", 3, 1),
    ("five-bar", 2, 1),
    ("four-bar", 2, 3),
    ("slotted lever", 3, 3),
    ("kite across the ground", 3, 1),
    ("five-bar", 2, 3),
    ("six-bar", 2, 1),
    ("six-bar", 2, 3),
    ("jack", 3, 3),
]


@pytest.mark.parametrize(
    ("kind", "behind", "seed"),
    [
        ("four-bar", 1, 1),
        ("five-bar", 2, 7),  # -0.43623**2/0.25808 is -491/983 over the first prime
    ],
)
def test_coefficients_at_the_numbers_of_the_file(
    kind: str, behind: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of them are taken for true of these lengths alone, the last thing that is tried."""
    monkeypatch.setattr(solve, "FREEDOMS", ((),))
    robot = random_loop(kind, seed, behind=behind)
    certificate = certify_formulas(_regrouped.__wrapped__(robot, 1))
    assert certificate.valid, certificate.failures
    assert certificate.method == EXACT


@campaign
@pytest.mark.parametrize(("kind", "behind", "seed"), IN_NUMBERS if FULL else IN_NUMBERS[:4])
def test_coefficients_of_no_moderate_degree(
    kind: str, behind: int, seed: int, tmp_path: Path
) -> None:
    robot = random_loop(kind, seed, behind=behind)
    certificate = certify_formulas(regroup(robot))
    assert certificate.valid, certificate.failures
    assert certificate.method == EXACT
    check_behind(kind, seed, behind, tmp_path)


def test_a_coefficient_of_the_numbers_of_the_file_that_is_off_is_refused() -> None:
    found = regroup(random_loop("slotted lever", 1, behind=1))
    b, off = next(
        (b, {**b.combination, name: c * Expression.number("1.001")})
        for b in found.base
        for name, c in b.combination.items()
        if name != b.own
    )
    base = tuple(replace(x, combination=off) if x is b else x for x in found.base)
    certificate = certify_formulas(replace(found, base=base))
    assert any("modulo" in text for text in certificate.failures)


def test_the_oracle_closes_a_small_loop_on_a_long_arm_in_its_own_digits() -> None:
    """Angle of the first boom by the cosine rule; closed in frame 0 it was off by 2e-12, and the
    regressor of a right text by 1.2e-9 of the largest.
    """
    robot = random_loop("jack", 1, behind=1)
    sample = sampled_states(robot, 20)
    x, *_ = sample.model.motion(sample.q, sample.qd, sample.qdd)
    foot, boom, stroke = 0.0003014, 0.0003193, sample.q[:, 1]
    angle = np.arccos((foot**2 + boom**2 - stroke**2) / (2 * foot * boom))
    assert np.abs(np.abs(x[:, robot.moving.index(2)]) - angle).max() < 1e-14


@pytest.mark.parametrize(
    "case", sampled(BEHIND, 0, more=12), ids=lambda case: f"{case[0]}-{case[1]}"
)
def test_more_behind_turning_joints(case: tuple[str, int], tmp_path: Path) -> None:
    kind, behind = case
    for seed in SEEDS:
        check_behind(kind, seed, behind, tmp_path)


def test_counterbalance_as_a_jack_over_the_range_of_axis_1(tmp_path: Path) -> None:
    """-147 to 147 degrees of axis 1, -50 to 85 of axis 2."""
    robot = parse_robot(WITH_COUNTERBALANCE.encode(), "balanced.yaml")
    module = module_of(generate_module(robot), tmp_path)
    rng = np.random.default_rng(4)
    q = rng.uniform(-1, 1, (41, 6))
    q[:, 0] = np.radians(np.linspace(-147, 147, 41))
    q[:, 1] = np.radians(rng.uniform(-50, 85, 41))
    qd, qdd = rng.standard_normal((2, *q.shape))
    oracle = Multipliers(robot, whole(robot, q, module.passive_joints(q)), qd, qdd)
    chi = random_parameters(robot, seed=7)
    X, tau = module.base_parameters(chi), oracle.torque(chi)
    for found in (module.inverse_dynamics(q, qd, qdd, X), module.regressor(q, qd, qdd) @ X):
        assert np.abs(found - tau).max() < 1e-10 * np.abs(tau).max()
