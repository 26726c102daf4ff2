"""Identification of the Go2 as a free base: hung from a rope and on the floor, simulated by MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from moving_base.go2 import FILE, simulated

import runtime
import symgen
from runtime.compose import problem
from runtime.ground.errors import InputError
from symgen.derive.regressor import inertial_names

CALVES = (3, 6, 9, 12)
IMU = np.array([-0.02557, 0.0, 0.04232])  # place of the sensor in frame 0, m
ENCODER = 2 * np.pi / 16384
NOISE = np.array([0.3] * 3 + [0.02] * 3)  # of the wrenches, N and N m
SETTLED = 200  # samples

pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def module():
    return symgen.model(symgen.load_robot(FILE))


@pytest.fixture(scope="module")
def simulations():
    return {
        kind: simulated(kind, seconds)
        for kind, seconds in (("hung", 16), ("floor", 16), ("fall", 4))
    }


def truth_of(module):
    """X of the file without dry friction, which the simulation does not have."""
    chi = dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(module.VALUES)
    chi = {name: x * (not name.startswith("FS")) for name, x in chi.items()}
    return dict(zip(module.BASE_PARAMETERS, module.base_parameters(chi), strict=True))


def record_of(module, simulation, seed, torques=True):
    """A record with noise: gyroscope .005 rad/s, accelerometer .05 m/s**2, encoder steps, torques 0.1 N m."""
    s, rng = {key: x[SETTLED:] for key, x in simulation.items()}, np.random.default_rng(seed)
    q, w, wd, N = s["q"], s["w"], s["wd"], len(s["q"])
    f = s["a0"] + np.cross(wd, IMU) + np.cross(w, np.cross(w, IMU))
    imu = [w + 0.005 * rng.normal(size=w.shape), f + 0.05 * rng.normal(size=f.shape)]
    channels = {"base_imu": np.hstack([*imu, np.tile(IMU, (N, 1))]), "wrench0": s["rope"]}
    poses = module.frame_poses(q)
    for frame, wrench in zip(CALVES, np.split(s["feet"], 4, axis=1), strict=True):
        if wrench.any():
            R, P = poses[:, frame - 1, :3, :3], poses[:, frame - 1, :3, 3]
            F, M = np.hsplit(wrench, 2)
            own = [np.einsum("tba,tb->ta", R, x) for x in (F, M - np.cross(P, F))]
            channels[f"wrench{frame}"] = np.hstack(own)
    for name, x in channels.items():
        if name.startswith("wrench") and x.any():
            channels[name] = x + NOISE * rng.normal(size=x.shape)
    tau = s["tau"] + 0.1 * rng.normal(size=q.shape)
    q = np.round(q / ENCODER) * ENCODER
    return runtime.Record(np.arange(N) * 0.005, q, tau * torques, channels=channels)


WHOLE = replace(runtime.Study(), rows=replace(runtime.Study().rows, low_speed=0.0))
"""No row is left out as that of a joint at rest: the simulation has no dry friction."""


def fitted(model, records):
    return runtime.estimate(model, records, WHOLE)


def deviations(fit, truth):
    known = [k for k, s in enumerate(fit.sigma) if np.isfinite(s)]
    return np.array([(fit.X[k] - truth[fit.names[k]]) / fit.sigma[k] for k in known])


@pytest.mark.parametrize("rows", ["all", "joints", "base"])
def test_parameters_lie_within_their_intervals(module, simulations, rows):
    """Two records, hung and on the floor: .94 of all, .93 of the joint rows, .87 of the base rows alone."""
    model = symgen.model(symgen.load_robot(FILE, base="moving")) if rows == "joints" else module
    truth = truth_of(module) | truth_of(model)
    records = [
        record_of(module, simulations[kind], seed, torques=rows != "base")
        for seed, kind in enumerate(("hung", "floor"))
    ]
    fit = fitted(model, records)
    z = deviations(fit, truth)
    inertial = inertial_names(symgen.load_robot(FILE))
    of_links = sum(name.removesuffix("R") in inertial for name in fit.names)
    assert len(z) == (of_links if rows == "base" else len(fit.names))
    assert np.mean(np.abs(z) < 2) > (0.8 if rows == "base" else 0.87)
    if rows != "joints":
        mass = dict(zip(fit.names, fit.X, strict=True))["M0R"]
        assert abs(mass / truth["M0R"] - 1) < 0.005


def test_the_mass_is_found_on_the_floor_alone(module, simulations):
    """Within 2 %: contacts of the feet are measured."""
    fit = fitted(module, record_of(module, simulations["floor"], 5))
    mass, truth = dict(zip(fit.names, fit.X, strict=True))["M0R"], truth_of(module)["M0R"]
    assert abs(mass / truth - 1) < 0.02


BIAS = np.array([0.01, -0.005, 0.008, 0.1, -0.05, 0.15])


def biased(module, simulations, fit=False):
    """Two records, hung and on the floor, whose sensor has the BIAS."""
    records = []
    for k, kind in enumerate(("hung", "floor")):
        own = record_of(module, simulations[kind], 3 + k)
        imu = own.channels["base_imu"] + np.r_[BIAS, 0, 0, 0]
        start = {"base_biases": np.zeros((len(own), 6))} if fit else {}
        channels = {**own.channels, "base_imu": imu, **start}
        records.append(runtime.Record(own.t, own.q, own.tau, channels=channels))
    return records


def test_biases_of_the_sensor_leave_the_mass_within_two_percent(module, simulations):
    fit = fitted(module, biased(module, simulations))
    mass, truth = dict(zip(fit.names, fit.X, strict=True))["M0R"], truth_of(module)["M0R"]
    assert abs(mass / truth - 1) < 0.02


def test_biases_of_the_sensor_are_fitted(module, simulations):
    """Within three deviations; .94 of the parameters lie within theirs, .88 without the fit."""
    records = biased(module, simulations, fit=True)
    told = problem(module, records, WHOLE).noted("biases").result
    assert (np.abs(told.values - BIAS) < 3 * told.sigma).all()
    assert (told.sigma < [0.02] * 3 + [0.003] * 3).all()
    z = deviations(fitted(module, records), truth_of(module))
    assert np.mean(np.abs(z) < 2) > 0.9


def test_a_fall_tells_the_mass_by_the_torques_of_the_joints(module, simulations):
    """In flight nothing holds the robot, and all is known up to a factor, which the torques fix."""
    fit = fitted(module, record_of(module, simulations["fall"], 4))
    assert fit.status == "ok"
    names = dict(zip(fit.names, zip(fit.X, fit.sigma, strict=True), strict=True))
    assert names["M0R"][1] > 0.001 * truth_of(module)["M0R"]
    blind = record_of(module, simulations["fall"], 4, torques=False)
    with pytest.raises(InputError, match="all torques and all wrenches are zero"):
        fitted(module, blind)
