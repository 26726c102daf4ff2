"""Hinges that turn a fraction of another one, or a decimal: fingers that follow by -1/2 and 0.333,
on axes of their own and on parallel ones where the angles meet in one sine. Lagrange multipliers
are the oracle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import some
from typer.testing import CliRunner

from oracles.multipliers import Multipliers
from oracles.random_robots import random_parameters, random_robot
from oracles.test_loops_agree import whole
from oracles.test_random_loops import module_of
from symgen.certify.modules import certify
from symgen.cli.main import app
from symgen.description import Robot, parse_robot
from symgen.description.grammar import parse
from symgen.emit.generate import generate_module
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import EXACT, regroup

HAND = """symgen: 1
name: hand
gravity: [0, -g, 0]
constants: {{L: 0.08, D: 0.05, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: {tilt}, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: L, theta: q2, r: 0}}
  3: {{ant: 2, sigma: 0, mu: 0, alpha: {alpha}, d: D, theta: q3, r: 0}}
  4: {{ant: 1, sigma: 0, mu: 0, alpha: {alpha}, d: D, theta: q4, r: 0}}
constraints: {{q3: {ratio}, q4: {other}}}
elements:
  Ia: {{kind: inertia, along: all}}
  FV: {{kind: viscous, along: all}}
"""


def hand(ratio: str, other: str, alpha: str = "0", tilt: str = "0") -> Robot:
    text = HAND.format(ratio=ratio, other=other, alpha=alpha, tilt=tilt)
    return parse_robot(text.encode(), "hand.yaml")


@pytest.mark.parametrize("alpha", ["0", "pi/3"])
@pytest.mark.parametrize(
    ("ratio", "other"),
    [
        ("-q2/2", "q1/2 + 0.3"),
        ("-2/3*q2", "-q3"),
        ("q2/4", "q3/3"),
        ("2*q2/5 - q1/2", "-q2/2"),
        ("-4/21*q2", "4/21*q1"),  # the product of the denominators is beyond those that are read
        ("0.333*q2", "q1"),
        ("0.666*q2", "-0.333*q2 + 0.1"),  # the same angle twice
        ("0.333*q2", "0.333*q3"),
        ("1.0472*q2 + pi/2", "0.7*q1 - 1.414214*q2"),
        ("q2/361", "q1/7"),
    ],
)
@some(4)
def test_torques_and_rank(ratio: str, other: str, alpha: str, tmp_path: Path) -> None:
    """To 1e-10 of the largest torque, at all angles; the number of base parameters is the rank of
    the oracle's regressor.
    """
    robot, rng = hand(ratio, other, alpha), np.random.default_rng(2)
    found = regroup(robot)
    certificate = certify(found)
    assert found.method == EXACT and certificate.valid, str(certificate)
    module = module_of(generate_module(robot), tmp_path)
    q = rng.uniform(-np.pi, np.pi, (60, 2))
    qd, qdd = rng.standard_normal((2, *q.shape))
    oracle = Multipliers(robot, whole(robot, q, module.passive_joints(q)), qd, qdd)
    chi = random_parameters(robot, seed=7)
    X, torque = module.base_parameters(chi), oracle.torque(chi)
    for tau in (module.inverse_dynamics(q, qd, qdd, X), module.regressor(q, qd, qdd) @ X):
        assert np.abs(tau - torque).max() < 1e-10 * np.abs(torque).max()
    W = oracle.regressor().reshape(-1, len(chi))
    assert np.linalg.matrix_rank(W, tol=1e-9 * np.linalg.norm(W)) == len(found)


@pytest.mark.parametrize("form", ["closed", "recursive"])
@pytest.mark.parametrize("ratio", ["-q2/2", "0.333*q2"])
def test_models_are_shown(ratio: str, form: str, tmp_path: Path) -> None:
    file = tmp_path / "hand.yaml"
    file.write_text(HAND.format(ratio=ratio, other="-2/3*q1", alpha="0", tilt="0"))
    command = ["show", str(file), "--model", "inverse_dynamics", "--form", form]
    for more in ("text", "latex", "sympy"):
        result = CliRunner().invoke(app, [*command, "--format", more])
        assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("ratio", "number"), [("L*q2", "0.08"), ("pi*q2", "3.14159265359")])
def test_a_ratio_that_is_no_number_is_refused_with_the_number(ratio: str, number: str) -> None:
    with pytest.raises(
        DescriptionError, match=rf"q3: the ratio of q3 to q2 is .*; .* write {number}"
    ):
        regroup(hand(ratio, "q1"))


def tied(seed: int, relations: Mapping[int, str]) -> Robot:
    """A random robot of which some joints follow others."""
    robot = random_robot(seed)
    frames = tuple(replace(f, mu=0) if f.j in relations else f for f in robot.frames)
    names = [f"q{j}" for j in robot.moving]
    constraints = {j: parse(text, names) for j, text in relations.items()}
    return replace(robot, frames=frames, constraints=constraints)


@pytest.mark.parametrize("seed", [1028, 1035, 1062, 1098])
def test_relations_put_into_one_another(seed: int) -> None:
    """Angles about parallel axes add up, whatever their ratios; ratios through slides too."""
    moving = random_robot(seed).moving
    ratios = ["-1.4142*q{}", "0.1*q{} - 0.666*q{} + 0.3", "57.3*q{} + 2/7*q{}"]
    relations = {
        j: ratios[k % 3].format(moving[max(j - 2, 0)], moving[0])
        for k, j in enumerate(moving[2::2])
    }
    certificate = certify(regroup(tied(seed, relations)))
    assert certificate.valid, str(certificate)


def test_frictions_of_a_joint_that_two_tie_are_told_apart() -> None:
    """sign(qd1/2 + qd3/361) is that of qd1 at random, unless qd3 is drawn larger."""
    relations = {4: "q1/2 + q3/361", 5: "pi/2 - 2*q1/3 - 0.7071*q4", 6: "2*q4"}
    certificate = certify(regroup(tied(2067, relations)))
    assert certificate.valid, str(certificate)
