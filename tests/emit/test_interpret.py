"""The one evaluator: values of graph nodes over CasADi's SX, floats and SymPy, and their rates."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import sympy

from symgen.certify.lagrange import Lagrange
from symgen.derive.derivation import derive
from symgen.derive.graph import POS, Floats, Symbol, interpret, rates, states_of
from symgen.description import load_robot
from symgen.description.expression import FUNCTIONS
from symgen.symbols.sympy_objects import Objects

SX = {n: getattr(ca, f.casadi) for n, f in FUNCTIONS.items() if f.casadi} | {POS: ca.fmax}


def states(name: str) -> tuple[dict[int, float], dict[int, float], dict[int, float]]:
    robot, rng = load_robot(name), np.random.default_rng(1)
    x = rng.uniform(-1, 1, (3, len(robot.moving)))
    q, qd, qdd = (dict(zip(robot.moving, row, strict=True)) for row in x)
    return q, qd, qdd


@pytest.mark.parametrize("name", ["tx40", "stanford", "two_branch"])
def test_torques_are_those_of_lagrange(name: str) -> None:
    """In floats, and over SX: numbers, functions and symbols are all that a domain needs."""
    robot = load_robot(name)
    q, qd, qdd = states(name)
    chi = np.random.default_rng(2).uniform(0.5, 1.0, len(robot.parameters))
    parameters = {Symbol("parameter", p): x for p, x in zip(robot.parameters, chi, strict=True)}
    x = [np.array([*state.values()]) for state in (q, qd, qdd)]
    expected = Lagrange(robot).torque(*x, chi)
    outputs = [*derive(robot).torque.values()]
    given = states_of(q=q, qd=qd, qdd=qdd) | parameters
    floats = np.array(interpret(outputs, Floats(robot, given)))
    assert np.abs(floats - expected).max() < 1e-12 * np.abs(expected).max()
    symbols = {s: ca.SX.sym(s.name) for s in given}
    torque = ca.vertcat(*interpret(outputs, Floats(robot, symbols, functions=SX)))
    f = ca.Function("torque", [ca.vertcat(*symbols.values())], [torque])
    value = np.asarray(f([*given.values()])).ravel()
    assert np.abs(value - expected).max() < 1e-12 * np.abs(expected).max()


def test_poses_over_sympy() -> None:
    d = derive(load_robot("planar_2r"))
    A, P = d.poses[2]
    x, y = interpret([A[0][0], P[0]], Objects())
    q1, q2, D2 = sympy.symbols("q1 q2 D2", real=True)
    assert (
        sympy.simplify(x - sympy.cos(q1 + q2)) == 0 and sympy.simplify(y - D2 * sympy.cos(q1)) == 0
    )


@pytest.mark.parametrize("name", ["tx40", "stanford", "sr400"])
def test_rates_are_difference_quotients(name: str) -> None:
    """First and second time derivatives of the origin of the last frame at constant rates."""
    robot, h = load_robot(name), 1e-4
    d = derive(robot)
    q, qd, _ = states(name)
    along = {Symbol("q", f"q{i}"): d.algebra.qd(i) for i in d.closure.independent}
    P = d.poses[robot.frames[-1].j][1]
    first = rates(P, along)
    second = rates(first, along)

    def at(outputs, t: float) -> np.ndarray:
        moved = {i: x + t * qd[i] for i, x in q.items()}
        return np.array(interpret(outputs, Floats(robot, states_of(q=moved, qd=qd))), dtype=float)

    assert np.allclose(at(first, 0.0), (at(P, h) - at(P, -h)) / (2 * h), atol=1e-7)
    assert np.allclose(at(second, 0.0), (at(first, h) - at(first, -h)) / (2 * h), atol=1e-7)
