"""The inertia matrix by composite links: that of unit accelerations entry by entry over F_p, and that of Lagrange."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import sampled, some

import symgen
from oracles.random_loops import KINDS, random_loop
from oracles.random_parallelograms import random_parallelogram
from oracles.random_robots import random_robot
from symgen.certify.lagrange import in_one_mode
from symgen.certify.lagrange import sampled as lagrange_sample
from symgen.derive.assembly import inertia_of
from symgen.derive.derivation import derive
from symgen.derive.models import MODELS, Request, rewriting
from symgen.description import Robot, load_robot, packaged_robots


def assert_equal_over_F_p(robot: Robot) -> None:
    """Column by column Gamma of a unit acceleration from rest: nodes of one value over F_p are one
    node of a rewriting.
    """
    d, model = derive(robot), MODELS["inertia_matrix"]
    request = Request({name: name for name in robot.parameters})
    rewrite = rewriting(d, request)
    composite = model.values(d, request, rewrite)
    accelerated = model.values(d, request, rewrite, closed=True)
    by_place = {e.place: str(e.value) for e in accelerated.entries}
    assert {e.place: str(e.value) for e in composite.entries} == by_place, robot.name


@pytest.mark.parametrize("name", packaged_robots())
def test_packaged_robots_over_F_p(name: str) -> None:
    assert_equal_over_F_p(load_robot(name))


@pytest.mark.parametrize("make", [random_robot, random_parallelogram])
@pytest.mark.parametrize("seed", sampled(range(12), 3))
def test_random_robots_over_F_p(make, seed: int) -> None:
    assert_equal_over_F_p(make(seed))


@pytest.mark.parametrize("kind", sampled(KINDS, 3))
def test_general_loops_over_F_p(kind: str) -> None:
    assert_equal_over_F_p(random_loop(kind, 2))


@pytest.mark.parametrize(
    "name", sampled(packaged_robots(), 5, always=("tx40", "stanford", "sr400"))
)
@some(3)
def test_lagrange(name: str) -> None:
    """E = 1/2 qd' A qd by energies, which shares no code with the recursions."""
    robot = load_robot(name)
    module, regrouping = symgen.model(robot), symgen.regrouping(robot)
    sample = lagrange_sample(in_one_mode(robot), 20, seed=3)
    chi = np.random.default_rng(4).uniform(0.5, 1.0, len(robot.parameters))
    chi[[p in robot.assume for p in robot.parameters]] = 0.0
    A = inertia_of(
        lambda qdd: sample.model.actuated_regressor(sample.q, 0 * sample.q, qdd) @ chi, sample.q
    )
    X = module.base_parameters(chi)
    assert len(X) == len(regrouping)
    assert np.abs(module.inertia_matrix(sample.q, X) - A).max() < 1e-9 * np.abs(A).max()
