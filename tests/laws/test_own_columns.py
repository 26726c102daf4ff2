"""Robots with columns of the user's own, simulated and excited: against an integration written
here, and against truth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from runtime.core.model import joint_units
from runtime.study import study_from_mapping

ARM = """
symgen: 1
name: own
gravity: [0, 0, -g]
constants: {g: 9.81, L: 0.4, B: 0.6, vs1: 0.1}
frames:
  1: {ant: 0, sigma: 0, alpha: pi/2, d: 0, theta: q1, r: 0}
elements:
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: all}
columns:
  STR: {kind: stribeck, along: 1, fit: {vs: {bounds: [0.02, 1]}}}
  SP: {along: 1, energy: "sqrt(B**2 + L**2 - 2*L*B*cos(q))", unit: N}
limits: {q: [2.5], qd: [6], qdd: [40], tau: [60]}
values: {XX1: 0, XY1: 0, XZ1: 0, YY1: 0, YZ1: 0, ZZ1: 0.8, MX1: 1.5, MY1: 0, MZ1: 0, M1: 5,
  FV1: 2, FS1: 3, STR1: 1.5, SP1: 30}
"""
STUDY = {
    "signals": {"median": 1, "lowpass": {"cutoff": 60}},
    "rows": {"low_speed": 0.05},
    "controller": {
        "law": {"kind": "pid", "kp": [2000], "kd": [60]},
        "rate": 1000,
        "torque": {"noise": 0.02},
        "reference": {
            "motion": {
                "parts": [
                    {
                        "family": "fourier",
                        "period": 6.0,
                        "harmonics": 3,
                        "p": [[0.1, 0.6, 0.3, 0.3, -0.2, 0.15, 0.1]],
                    }
                ]
            }
        },
    },
    "excitation": {
        "parts": [{"family": "fourier", "period": 6, "harmonics": 3}],
        "columns": "all",
        "starts": 2,
        "iterations": 40,
        "rate": 200,
    },
}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("own") / "own.yaml"
    path.write_text(ARM)
    return symgen.model(path)


def test_the_unit_of_a_law_says_nothing_about_its_joint(arm, tmp_path) -> None:
    """A spring whose constant is in N made its revolute joint one that slides, in metres."""
    path = tmp_path / "own.yaml"
    path.write_text(ARM)
    robot = symgen.load_robot(path)
    bare = replace(robot, elements=robot.elements[2:], values={})
    assert joint_units(arm) == ("rad",)
    assert joint_units(symgen.model(bare)) == ("rad",)


def acceleration(q: float, qd: float, tau: float) -> float:
    spring = 30 * 0.4 * 0.6 * np.sin(q) / np.sqrt(0.6**2 + 0.4**2 - 2 * 0.4 * 0.6 * np.cos(q))
    dry = (3 + 1.5 * np.exp(-((qd / 0.1) ** 2))) * np.sign(qd)
    return (tau - 9.81 * 1.5 * np.cos(q) - spring - 2 * qd - dry) / 0.8


@campaign
def test_simulation_with_a_curved_law_and_a_spring(arm) -> None:
    """The torque of the loop, integrated here in steps of 20 us from 1 s on, gives its motion; the
    record gives the parameters back."""
    study = study_from_mapping(STUDY)
    run = runtime.simulate(arm, study, ideal=True)
    start, steps = 1000, 50
    q, qd = float(run.q[start, 0]), float(run.qd[start, 0])
    error = []
    for k in range(start, start + 1500):
        error.append(abs(q - run.q[k, 0]))
        for _ in range(steps):
            middle = qd + 0.5e-3 / steps * acceleration(q, qd, run.tau[k, 0])
            q += 1e-3 / steps * middle
            qd += 1e-3 / steps * acceleration(q, middle, run.tau[k, 0])
    travel = np.ptp(run.q[start : start + 1500, 0])
    assert travel > 0.5 and max(error) < 2e-3 * travel
    noisy = runtime.simulate(arm, study)
    result = runtime.identify(arm, noisy.record(), study)
    fit = result.estimate
    for name in ("FV1", "FS1", "STR1"):
        assert fit[name] == pytest.approx(arm.VALUES[name], rel=0.05), name


@campaign
def test_excitation_judges_the_columns_too(arm) -> None:
    result = runtime.excite(arm, study=study_from_mapping({"excitation": STUDY["excitation"]}))
    _, q, qd, qdd, tau = (np.asarray(x) for x in result.sampled())
    own = [
        0.8 * a + x - 0.8 * acceleration(p, v, x)
        for p, v, a, x in zip(q[:, 0], qd[:, 0], qdd[:, 0], tau[:, 0], strict=True)
    ]
    moving = np.abs(qd[:, 0]) > 1e-3
    np.testing.assert_allclose(tau[moving, 0], np.array(own)[moving], atol=1e-9)
    assert np.abs(qd).max() < 6 and np.abs(tau).max() < 60
    assert {"STR1", "SP1"} <= result.relative_sigma.keys()
