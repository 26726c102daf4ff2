"""The simulators of `benchmarks/truth.py` tell the truth, and its questions run."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

import truth
import truth_simulator as world

EVERY = pytest.mark.parametrize("name", list(world.ROBOTS))


@EVERY
def test_torques_are_those_of_pinocchio(name: str) -> None:
    """M qdd + h by the composite rigid bodies, plus friction by hand."""
    model = world.Truth(world.ROBOTS[name], 5)
    states = world.Motion(
        np.arange(20.0), *np.random.default_rng(2).uniform(-2, 2, (3, 20, model.robot.n))
    )
    tau, b = model.torque(states), model.bodies
    for q, qd, qdd, one in zip(states.q, states.qd, states.qdd, tau, strict=True):
        M = pin.crba(model.model, model.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.nonLinearEffects(model.model, model.data, q, qd)
        np.testing.assert_allclose(
            one, M @ qdd + h + b.viscous * qd + b.dry * np.sign(qd), rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize("name", ["planar", "scara", "rail"])
def test_the_emitted_regressor_spans_them(name: str) -> None:
    """`true_parameters` refuses where the emitted regressor leaves more than 1e-9 of them."""
    assert np.isfinite(truth.true_parameters(world.Truth(world.ROBOTS[name], 5))).all()


@pytest.mark.parametrize("motion", list(world.MOTIONS))
def test_motions_are_derivatives_of_each_other(motion: str) -> None:
    """Central differences of 1 ms; the ramps of a trapezoid have jumps of the jerk alone."""
    move = world.MOTIONS[motion](world.ROBOTS["scara"], 4, seconds=4.0)
    for x, rate in ((move.q, move.qd), (move.qd, move.qdd)):
        difference = (x[2:] - x[:-2]) / (move.t[2:] - move.t[:-2])[:, None]
        np.testing.assert_allclose(difference, rate[1:-1], atol=5e-3 * np.abs(rate).max())


def test_encoders_bound_the_position() -> None:
    robot = world.ROBOTS["scara"]
    move, even = world.fourier(robot, 3, seconds=2.0), world.Encoder(2 * np.pi / 1000)
    steps = even.steps(robot)
    told = world.encoded(robot, move, even, 3)
    assert np.abs(told - move.q).max(axis=0) == pytest.approx(steps / 2, rel=1e-2)
    lost = world.encoded(robot, move, world.replace(even, lost=3), 3) - told
    assert np.abs(lost[-1]) == pytest.approx(3 * steps)
    assert not lost[0].any()
    eccentric = world.encoded(robot, move, world.replace(even, eccentric=4.0), 3)
    assert 1 < (np.abs(eccentric - move.q).max(axis=0) / steps).max() < 4.6


def test_noise_has_its_deviation_and_correlation() -> None:
    tau = np.ones((200_000, 1))
    for rho in (0.0, 0.9, 0.99):
        e = world.noise(tau, rho, 0.02, 1)[:, 0]
        assert e.std() == pytest.approx(0.02, rel=0.05)
        assert (e[1:] @ e[:-1]) / (e @ e) == pytest.approx(rho, abs=0.01)


def test_the_loop_obeys_the_robot() -> None:
    """Forward dynamics integrated: the torque less friction is that of inverse dynamics, q follows."""
    robot = world.ROBOTS["planar"]
    model, encoder = world.Truth(robot, 6), world.Encoder(2 * np.pi / 4000)
    reference = world.fourier(robot, 6, seconds=1.0)
    move, told, tau = world.in_loop(model, reference, encoder, 6, share=0.0)
    assert np.abs(told - move.q).max() <= 0.5 * encoder.step * (1 + 1e-9)
    left = tau - model.torque(move)  # sign against tanh: at low speed alone
    fast = np.abs(move.qd) > 0.1 * np.abs(move.qd).max(axis=0)
    assert np.abs(left[fast]).max() < 1e-6 * np.abs(tau).max()
    np.testing.assert_allclose(np.diff(move.qd, axis=0), 1e-3 * move.qdd[:-1], atol=2e-2)


@pytest.mark.parametrize("question", ["coverage", "counts_random"])
def test_a_question_runs(question: str) -> None:
    rows = truth.asked(question, 2, "first")
    assert {row["record"] for row in rows} == {0, 1}
    assert not [row for row in rows if "broke" in row]
    table = truth.QUESTIONS[question][1](rows).splitlines()
    assert len({line.count("|") for line in table if line.startswith("|")}) == 1
