"""Derivatives of a simulated closed loop by the base parameters against central differences of
whole runs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

from runtime import load_model
from runtime.loop.control_law import parameters_of
from runtime.loop.reference import Reference, reference_of
from runtime.loop.simulation import Simulator
from runtime.settings.controller import Controller
from runtime.settings.schema import structure

GENERATED = Path(__file__).resolve().parents[2] / "generated"
X = np.array([95.0, 203.0, 20.0, -3.0])
CASCADE = {"kind": "cascade", "kp": 160.18, "kv": 243.45, "gain": 35.15}
PID = {"kind": "pid", "kp": 2e5, "kd": 6e3, "ki": 4e5}


def agree(
    simulator: Simulator, X: np.ndarray, reference: Reference, columns, tolerance: float
) -> np.ndarray:
    """Share of the deviation in q, qd, tau of every column; returns |qd| of the run."""
    found, tangent = simulator.sensitivity(X, reference)
    np.testing.assert_array_equal(found.q, simulator.run(X, reference, ideal=True).q)
    for k in columns:
        h = 1e-5 * max(abs(X[k]), 0.1)
        up, down = (
            simulator.run(X + sign * h * np.eye(len(X))[k], reference, ideal=True)
            for sign in (1, -1)
        )
        for name in ("q", "qd", "tau"):
            expected = (getattr(up, name) - getattr(down, name)) / (2 * h)
            deviation = np.linalg.norm(getattr(tangent, name)[:, :, k] - expected) / np.linalg.norm(
                expected
            )
            assert deviation < tolerance, (simulator.model.BASE_PARAMETERS[k], name, deviation)
    return np.abs(found.qd)


@pytest.mark.parametrize(
    "settings",
    [
        {"law": CASCADE, "delay": 1, "velocity": "averaged"},
        {"law": {**CASCADE, "ki": 2e3, "cv": 0.8, "ca": 2.0}, "record_every": 3},
        {"law": PID, "settle": 0.1, "pole_step": 0.02},
    ],
    ids=["cascade", "industrial", "pid"],
)
def test_reversals_of_one_axis(settings):
    """Five reversals, where the friction jumps and its instant moves: without that term the
    deviation is 5 %.
    """
    emps = load_model("emps", folder=GENERATED)
    t = np.arange(2500) / 1000
    reference = Reference.sampled((0.02 * np.sin(3.3 * t) + 0.01 * np.sin(7 * t))[:, None], 1000.0)
    simulator = Simulator(emps, structure(Controller, settings))
    qd = agree(simulator, X, reference, range(4), 1e-4)
    assert (np.diff(np.sign(np.gradient(reference.q[:, 0]))) != 0).sum() == 5 and qd.max() > 0.05


def test_an_axis_that_rests(tmp_path):
    """Steps: the axis rests between them, and its derivatives rest too."""
    emps = load_model("emps", folder=GENERATED)
    t = np.arange(1500) / 1000
    steps = np.interp(t, [0, 0.1, 0.4, 0.9, 1.2, 1.5], [0, 0, 0.02, 0.02, 0.005, 0.005])[:, None]
    simulator = Simulator(emps, structure(Controller, {"law": CASCADE}))
    qd = agree(simulator, X, Reference.sampled(steps, 1000.0), range(4), 2e-3)
    assert (qd == 0).mean() > 0.2


@campaign
def test_six_joints_with_the_coupled_wrist():
    tx40 = load_model("tx40", folder=GENERATED)
    law = {
        "kind": "pid",
        "kp": [341.87, 375.0, 190.34, 150.16, 183.24, 358.86],
        "kd": [2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954],
        "gain": [35.24, 32.04, 23.94, 9.05, 15.5, 6.56],
    }
    settings = structure(
        Controller, {"law": law, "rate": 5000, "reference": {"points": {"duration": 1.2}}}
    )
    whole = reference_of(settings, tx40)
    reference = replace(whole, q=whole.q[:1500], qd=whole.qd[:1500], qdd=whole.qdd[:1500])
    truth = parameters_of(tx40, settings)
    columns = [tx40.BASE_PARAMETERS.index(name) for name in ("ZZ1R", "FS3", "MX2R", "FSM6")]
    agree(Simulator(tx40, settings), truth, reference, columns, 1e-3)
