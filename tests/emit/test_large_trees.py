"""Trees of many joints: their functions against pinocchio, and how their size grows.

The trees are those of `benchmarks/trees.py`; `benchmarks/growth.py` measures time and memory.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from emit.test_casadi import loaded

from oracles.pinocchio_model import PinocchioModel
from symgen.certify.lagrange import Lagrange
from symgen.certify.witness import bodies
from symgen.derive.derivation import derive
from symgen.description import parse_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_module

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
from trees import TREES

MANY = 24  # joints: more than `symgen.emit.python_target.LARGE`
SOME = ["humanoid", *(pytest.param(x, marks=pytest.mark.campaign) for x in ("chain", "hands"))]


@cache
def tree(shape: str, n: int = MANY) -> Robot:
    return parse_robot(TREES[shape](n), file=f"{shape}.yaml")


@cache
def module_of(shape: str, n: int = MANY) -> ModuleType:
    return loaded(shape, generate_module(tree(shape, n)))


def entries(robot: Robot) -> int:
    """Pairs of a joint and a frame that it moves: blocks of the regressor that are not zero."""
    return sum(len(robot.path(f.j)) for f in robot.frames)


@pytest.mark.parametrize("shape", SOME)
def test_trees_agree_with_pinocchio(shape: str) -> None:
    """Torques, and the accelerations that CasADi solves from them, 1e-9 of the largest."""
    robot, module = tree(shape), module_of(shape)
    oracle, rng = PinocchioModel(robot), np.random.default_rng(3)
    chi = bodies(robot, rng)
    q, qd, qdd = rng.uniform(-2, 2, (3, MANY))
    tau = oracle.torque(q, qd, qdd, chi)
    X = module.base_parameters(chi)
    found = module.inverse_dynamics(q, qd, qdd, X)
    assert np.abs(found - tau).max() < 1e-9 * np.abs(tau).max()
    solved = module.casadi("forward_dynamics")(q=q, qd=qd, tau=tau, X=X)
    (by_casadi,) = (np.ravel(x) for x in solved.values())
    A = module.inertia_matrix(q, X)
    assert np.abs(A @ (by_casadi - qdd)).max() < 1e-9 * np.abs(tau).max()


@pytest.mark.parametrize("shape", TREES)
def test_derivatives_are_those_of_the_frames_that_a_joint_moves(shape: str) -> None:
    """The certificate computes 16 numbers for each such pair, none for the others."""
    robot = tree(shape)
    model, q = Lagrange(robot), np.random.default_rng(2).uniform(-2, 2, (2, MANY))
    slopes = model.slopes(q)
    assert np.count_nonzero(np.abs(slopes).max(axis=(0, 3, 4))) == entries(robot)
    step = 1e-6 * np.eye(MANY)[:, None]
    differences = (model.poses(q + step) - model.poses(q - step)) / 2e-6
    assert np.abs(np.moveaxis(differences, 0, 1) - slopes).max() < 1e-7


def test_the_inertia_matrix_of_the_energies_is_that_of_their_torques() -> None:
    robot = tree("hands")
    model, rng = Lagrange(robot), np.random.default_rng(4)
    q, chi, units = rng.uniform(-2, 2, MANY), bodies(robot, rng), np.eye(MANY)
    at = [model.torque(q, 0 * q, qdd, chi) for qdd in (0 * q, *units)]
    A = model.inertia_matrix(q, chi)
    assert np.abs(A - np.array(at[1:]).T + at[0][:, None]).max() < 1e-12 * np.abs(A).max()


def test_operations_grow_with_the_blocks_that_are_not_zero() -> None:
    """A tree of twice the joints in twice as many fingers has about twice the operations."""
    sizes = []
    for n in (MANY, 2 * MANY):
        robot = tree("hands", n)
        nodes = len(derive(robot).algebra.graph.nodes)
        solve = module_of("hands", n).casadi("forward_dynamics").n_instructions()
        sizes.append(np.array([nodes, solve]) / entries(robot))
    assert (sizes[1] < 1.3 * sizes[0]).all(), sizes
