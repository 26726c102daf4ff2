"""Families of trajectories: derivatives, rest at both ends, chains, files, and the same text over
casadi.
"""

import casadi as ca
import numpy as np
import pytest

from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings import structure
from runtime.loop.trajectories import (
    AnyFamily,
    Fourier,
    Motion,
    Part,
    PointToPoint,
    Sinusoids,
    Triangular,
    motion_from_mapping,
)

EVERY = [
    Fourier(4.0, 3, 2),
    Sinusoids(5.0, 3, 0.8, 0.7),
    PointToPoint(5, 1.1, 0.25),
    Triangular(4, 1.5, 0.3, 0.4),
]


def coefficients(family: object, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([family.guess(rng, -1.0, 2.0, 3.0) for _ in range(2)]).T  # type: ignore[attr-defined]


@pytest.mark.parametrize("family", EVERY, ids=[own.family for own in EVERY])
def test_velocity_and_acceleration_are_derivatives(family: object) -> None:
    motion = Motion((Part(family, coefficients(family)),))  # type: ignore[arg-type]
    t = np.linspace(0.0, motion.duration, 40001)
    q, qd, qdd = motion.states(t)
    h = t[1] - t[0]
    assert np.abs((q[2:] - q[:-2]) / (2 * h) - qd[1:-1]).max() < 1e-5
    assert (
        np.abs((qd[2:] - qd[:-2]) / (2 * h) - qdd[1:-1]).max() < 2e-2
    )  # the acceleration has corners
    assert np.abs(np.diff(qdd, axis=0)).max() < 2e-2  # but no steps


@pytest.mark.parametrize("family", EVERY, ids=[own.family for own in EVERY])
def test_rest_at_both_ends(family: object) -> None:
    motion = Motion((Part(family, coefficients(family)),))  # type: ignore[arg-type]
    _, qd, qdd = motion.states(np.array([0.0, motion.duration]))
    assert np.abs(qd).max() < 1e-12
    assert np.abs(qdd).max() < 1e-11


@pytest.mark.parametrize("family", EVERY, ids=[own.family for own in EVERY])
def test_casadi_says_the_same(family: object) -> None:
    p = coefficients(family)[:, 0]
    t = np.linspace(0.0, family.duration, 37)  # type: ignore[attr-defined]
    symbol = ca.MX.sym("p", len(p))
    f = ca.Function("f", [symbol], list(family.joint(t, symbol, ca)))  # type: ignore[attr-defined]
    for ours, theirs in zip(family.joint(t, p, np), f(p), strict=True):  # type: ignore[attr-defined]
        assert np.allclose(ours, np.asarray(theirs).ravel(), rtol=0, atol=1e-13)


def test_points_are_reached_and_velocities_constant() -> None:
    p = np.array([[0.0], [1.0], [0.5]])
    still, turning = (
        Motion((Part(PointToPoint(3, 1.0, 0.2), p),)),
        Motion((Part(Triangular(3, 1.0, 0.2), p),)),
    )
    q, qd, _ = still.states(np.array([0.0, 1.0, 2.0, 0.5, 1.5]))
    assert np.allclose(q[:3], p, atol=1e-14)
    assert np.allclose(qd.ravel(), [0.0, 0.0, 0.0, 1.25, -0.625])  # (p1 - p0)/(travel - blend)
    _, qd, qdd = turning.states(np.array([0.6, 1.6]))
    assert np.allclose(qd.ravel(), [1.0, -0.5])
    assert np.allclose(qdd, 0.0)
    assert np.allclose(turning.states(np.array([turning.duration]))[0], p[-1])


def test_chain_and_file() -> None:
    one, two = PointToPoint(3, 1.0, 0.2), Sinusoids(2.0, 1, 1.0, 0.5)
    motion = Motion(
        (
            Part(one, np.array([[0.0], [1.0], [0.5]])),
            Part(two, np.array([[0.5], [0.1], [0.7], [0.3]])),
        )
    )
    assert motion.duration == pytest.approx(4.0)
    t, q, *_ = motion.sampled(1000.0)
    assert len(t) == 4001
    assert np.abs(np.diff(q, axis=0)).max() < 2e-3
    again = motion_from_mapping(motion.to_mapping())
    assert np.array_equal(again.states(t)[0], q)


def test_bad_input() -> None:
    with pytest.raises(InputError, match="no family 'spline'"):
        structure(AnyFamily, {"family": "spline"})
    with pytest.raises(SettingsError, match="unknown key order"):
        structure(AnyFamily, {"family": "fourier", "order": 3})
    with pytest.raises(SettingsError, match="expected more than 0"):
        structure(AnyFamily, {"family": "fourier", "period": 0})
    with pytest.raises(SettingsError, match="shorten the blend"):
        structure(AnyFamily, {"family": "point-to-point", "travel": 1, "blend": 0.6})
    with pytest.raises(SettingsError, match="shorten the ramp"):
        structure(AnyFamily, {"family": "sinusoids", "length": 1, "ramp": 0.6})
    with pytest.raises(InputError, match="coefficients of shape"):
        Part(Fourier(), np.zeros((3, 2)))
    with pytest.raises(InputError, match="parts"):
        motion_from_mapping({})
