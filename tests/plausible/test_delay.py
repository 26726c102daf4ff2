"""The delay between torques and positions, against delays put into simulated records, and its
deviation against the scatter.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import FULL, campaign
from scipy.stats import binom

import runtime
import symgen
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping

STUDY = study_from_mapping({"signals": {"median": 1, "lowpass": {"cutoff": 30}}})


def shifted_record(
    model,
    chi,
    seed: int,
    delay: float,
    *,
    rate: float = 1000.0,
    T: float = 8.0,
    noise: float = 0.02,
) -> runtime.Record:
    """Sums of sinusoids, torques of the instants t - delay, noise on both."""
    rng = np.random.default_rng([31, seed])
    n, t = len(model.JOINTS), np.arange(int(rate * T)) / rate
    k = rng.permuted(np.tile(np.arange(1, 16), (n, 1)), axis=1)[:, :5]
    a, phase = rng.uniform(0.3, 0.8, (n, 5)) / np.sqrt(k), rng.uniform(0, 2 * np.pi, (n, 5))

    def states(t):
        w = 2 * np.pi * k / T
        angle = w * t[:, None, None] + phase
        return (
            (a * np.sin(angle)).sum(-1),
            (a * w * np.cos(angle)).sum(-1),
            (-a * w**2 * np.sin(angle)).sum(-1),
        )

    tau = model.inverse_dynamics(*states(t - delay), model.base_parameters(chi))
    tau = tau + noise * tau.std(axis=0) * rng.standard_normal(tau.shape)
    return runtime.Record(t, states(t)[0] + 1e-5 * rng.standard_normal(tau.shape), tau)


def values_of(model) -> np.ndarray:
    return np.array([model.VALUES[name] for name in model.STANDARD_PARAMETERS])


@pytest.fixture(scope="module")
def planar():
    """A light arm of two joints at 1 kHz."""
    model = symgen.model("planar_2r")
    chi = {"ZZ": 0.3, "M": 2.0, "MX": 0.5, "Ia": 0.05, "FV": 0.4, "FS": 0.6}
    names = model.STANDARD_PARAMETERS
    return model, np.array([chi.get(name.rstrip("0123456789"), 0.02) for name in names])


@pytest.mark.parametrize("ms", [0.0, 1.0, 5.0, 20.0, -3.0])
def test_the_delay_put_in_is_found(planar, ms: float) -> None:
    model, chi = planar
    found = runtime.delay(model, shifted_record(model, chi, 1, ms / 1e3), STUDY)
    assert np.all(found.sigma < 3e-4) and np.all(np.abs(found.shift - ms / 1e3) < 4 * found.sigma)
    assert abs(found.common - ms / 1e3) < 3e-4


@campaign
@pytest.mark.parametrize("robot", ["planar_2r", "tx40"])
@pytest.mark.parametrize("ms", [0.0, 1.0, 5.0, 20.0])
def test_two_deviations_hold_95_percent(planar, robot: str, ms: float) -> None:
    """Over 50 records under SYMGEN_FULL, else 8: each joint's delay and the common one; binomial
    bounds at one in a thousand.

    The deviation of a light wrist is above 0.3 ms, since its torque is mostly friction, which tells
    instants by its jumps alone: there it is the deviation of the common delay, and of the three
    joints of the arm in the median, that is below.
    """
    model, chi = planar if robot == "planar_2r" else (symgen.model(robot), None)
    chi = values_of(model) if chi is None else chi
    runs = 50 if FULL else 8
    found = [
        runtime.delay(model, shifted_record(model, chi, seed, ms / 1e3), STUDY)
        for seed in range(runs)
    ]
    inside = np.array([np.abs(f.shift - ms / 1e3) < 2 * f.sigma for f in found])
    common = np.array([abs(f.common - ms / 1e3) < 2 * f.sigma_common for f in found])
    for hits in (inside, common):
        assert hits.sum() >= binom.ppf(1e-3, hits.size, 0.95)
    sigma = np.array([f.sigma for f in found])
    assert max(f.sigma_common for f in found) < 3e-4
    assert sigma.max() < 3e-4 if robot == "planar_2r" else np.median(sigma, axis=0)[:3].max() < 3e-4


def test_delays_beyond_the_record_are_refused(planar) -> None:
    model, chi = planar
    record = shifted_record(model, chi, 1, 0.0)
    with pytest.raises(InputError, match="at most a tenth"):
        runtime.delay(model, record, STUDY, longest=20.0)
    short = runtime.Record(record.t[:60], record.q[:60], record.tau[:60])
    with pytest.raises(InputError, match="longer record"):
        runtime.delay(model, short, STUDY, longest=0.005)
