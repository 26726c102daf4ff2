"""Pinocchio and Lagrange, two routes without common code, on random and hand-built robots.

Tolerance 1e-10 of the largest entry (of each column for regressors): rounding of a few thousand
operations stays below 1e-12.
"""

from __future__ import annotations

import numpy as np
import pytest

from oracles.named_robots import four_bar, planar_2r, six_r
from oracles.pinocchio_model import PinocchioModel
from oracles.random_robots import describe_mix, random_parameters, random_robot, random_state
from oracles.test_emitted_agree import PACKAGED
from symgen.certify.lagrange import Lagrange, sampled
from symgen.description.robot import Robot
from symgen.errors import DescriptionError

ROBOTS = [planar_2r(), six_r(), *PACKAGED, *(random_robot(seed) for seed in range(30))]
TOLERANCE = 1e-10


def close(a, b, axis=None):
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    assert np.all(
        np.abs(a - b).max(axis=axis) <= TOLERANCE * np.maximum(np.abs(b).max(axis=axis), 1e-3)
    )


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda r: r.name)
def test_dynamics_and_kinematics(robot: Robot) -> None:
    lagrange, oracle = Lagrange(robot), PinocchioModel(robot)
    chi = random_parameters(robot, seed=1)
    q, qd, qdd = random_state(robot, 5, seed=2)
    states = list(zip(q, qd, qdd, strict=True))
    close(lagrange.regressor(q, qd, qdd), [oracle.regressor(*s) for s in states], axis=(0, 1))
    close(lagrange.torque(q, qd, qdd, chi), [oracle.torque(*s, chi) for s in states])
    close(lagrange.inertia_matrix(q, chi), [oracle.inertia_matrix(x, chi) for x in q])
    close(lagrange.torque(q, 0 * q, 0 * q, chi), [oracle.gravity(x, chi) for x in q])
    close(lagrange.poses(q), [oracle.poses(x) for x in q])
    for f in robot.frames:
        close(lagrange.jacobian(q, f.j), [oracle.jacobian(x, f.j) for x in q])
    close(lagrange.jacobian(q), lagrange.jacobian(q, robot.frames[-1].j))


def test_single_state_has_no_leading_axis() -> None:
    robot = planar_2r()
    q, qd, qdd = (x[0] for x in random_state(robot, 1, seed=3))
    model = Lagrange(robot)
    assert model.regressor(q, qd, qdd).shape == (2, len(robot.parameters))
    assert model.torque(q, qd, qdd, np.ones(len(robot.parameters))).shape == (2,)


def test_planar_2r_by_hand() -> None:
    """Inertia matrix and gravity of the two-link arm as in any textbook, z horizontal, gravity
    along -y.
    """
    robot = planar_2r()
    chi = dict.fromkeys(robot.parameters, 0.0) | {
        "ZZ1": 0.3,
        "ZZ2": 0.2,
        "MX1": 0.4,
        "MX2": 0.5,
        "M2": 2.0,
    }
    q, L, g = np.array([0.3, 0.8]), robot.constants["L1"], robot.constants["g"]
    model, x = Lagrange(robot), np.array(list(chi.values()))
    c2 = np.cos(q[1])
    coupling = 0.2 + 0.5 * L * c2
    close(
        model.inertia_matrix(q, x),
        [[0.3 + 0.2 + 2.0 * L**2 + 2 * 0.5 * L * c2, coupling], [coupling, 0.2]],
    )
    elbow = 0.5 * g * np.cos(q.sum())
    close(model.torque(q, 0 * q, 0 * q, x), [(0.4 + 2.0 * L) * g * np.cos(q[0]) + elbow, elbow])


def test_numeric_regressor() -> None:
    robot = six_r()
    W, names = sampled(robot, states=40, seed=5).W, robot.parameters
    assert W.shape == (6 * 40, len(names)) and names == robot.parameters
    assert (
        not W[:40, names.index("FV2")].any() and W[40:80, names.index("FV2")].all()
    )  # rows joint-major


def test_parallelogram_closes() -> None:
    """Opposite bars stay parallel: q2 = -q1, q3 = q1, q4 = q1, so G is constant."""
    model = Lagrange(four_bar())
    a, qd, qdd = np.array([[0.7], [-0.4]]), np.array([[1.3], [0.6]]), np.array([[-0.5], [0.9]])
    q, v, acc, G = model.motion(a, qd, qdd)
    ratio = np.array([1.0, -1.0, 1.0, 1.0])
    close(q, a * ratio)
    close(G[..., 0], np.tile(ratio, (2, 1)))
    close(v, qd * ratio)
    close(acc, qdd * ratio)
    T = model.poses(q)
    close(T[:, 3], T[:, 4])  # the twin coincides with the cut frame


def test_general_loop_moves_as_its_power_says() -> None:
    """Velocities and accelerations against central differences (step 1e-4 s); d(E + U)/dt = Gamma_a
    qda without friction.
    """
    robot = four_bar(rocker=0.45, start={1: 1.4, 2: -0.9, 3: 1.1, 4: 0.6})
    model, h = Lagrange(robot), 1e-4

    def path(t):
        t = np.asarray(t)[:, None]
        return 1.4 + 0.3 * np.sin(2 * t), 0.6 * np.cos(2 * t), -1.2 * np.sin(2 * t)

    times = np.array([0.1, 0.4, 0.8])
    (q0, v0, _, _), (q, v, acc, _), (q1, v1, _, _) = (
        model.motion(*path(times + k * h)) for k in (-1, 0, 1)
    )
    assert (
        np.isfinite(q).all()
        and np.allclose((q1 - q0) / (2 * h), v, atol=1e-6)
        and np.allclose((v1 - v0) / (2 * h), acc, atol=1e-6)
    )
    friction = [k for k, name in enumerate(robot.parameters) if name.startswith("F")]
    chi = random_parameters(robot, seed=4)
    chi[friction] = 0

    def energy(q, v):
        return 0.5 * np.einsum("ti,tij,tj->t", v, model.inertia_matrix(q, chi), v)

    weight = np.einsum("ti,ti->t", model.torque(q, 0 * q, 0 * q, chi), v)
    power = (energy(q1, v1) - energy(q0, v0)) / (2 * h) + weight
    actuated = model.actuated_regressor(*path(times)) @ chi
    assert np.allclose(actuated[:, 0] * path(times)[1][:, 0], power, atol=1e-5)


def test_numeric_regressor_of_loops() -> None:
    for robot in (four_bar(), four_bar(rocker=0.45, start={1: 1.4, 2: -0.9, 3: 1.1, 4: 0.6})):
        W = sampled(robot, states=30, seed=1).W
        assert W.shape == (30, len(robot.parameters)) and np.isfinite(W).all()
    with pytest.raises(DescriptionError, match="cannot coincide"):
        sampled(four_bar(rocker=3.0), states=5)


def test_mix_of_random_robots() -> None:
    mix = describe_mix(random_robot(seed) for seed in range(250))
    assert (
        mix["oblique axes"] >= 0.3
        and mix["prismatic"] >= 0.3
        and mix["zero or in-plane gravity"] >= 0.2
    )
    assert (
        min(
            mix[name]
            for name in (
                "tree",
                "fixed frame",
                "parallel axes",
                "perpendicular axes",
                "theta offset",
            )
        )
        >= 0.2
    )
    assert (
        min(
            mix[name]
            for name in (
                "symbolic angle",
                "massless links",
                "coupled or special elements",
                "gamma or b",
                "general gravity",
            )
        )
        >= 0.1
    )
