"""Joint stiffness as an element of the robot file: derived, told by the certificate's counts, and
identified on a simulated arm.

Torques come from pinocchio's recursion and the elements written out in plain numpy, not from the
emitted module.
"""

from __future__ import annotations

import numpy as np
import pytest

from oracles.pinocchio_model import PinocchioModel
from runtime import Record, observe
from runtime.compose import estimate_of
from runtime.core.model import load_model
from runtime.study import study_from_mapping
from symgen.description import load_robot
from symgen.emit.generate import generate_module

ROBOT = """
symgen: 1
name: sprung
gravity: [0, -g, 0]
constants: {D2: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}
elements:
  Ia:     {kind: inertia, along: all}
  FV:     {kind: viscous, along: all}
  OFFSET: {kind: offset, along: all}
  K:      {kind: stiffness, along: {1: q1, 2: q2 - q1}}      # a spring on joint 1, another between the two motors
"""
RATE = 400.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("sprung") / "sprung.yaml"
    path.write_text(ROBOT, encoding="utf-8")
    return load_robot(path)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_stiffness_is_identified(robot, tmp_path, noise: float) -> None:
    (tmp_path / "sprung.py").write_text(generate_module(robot), encoding="utf-8")
    model = load_model(tmp_path / "sprung.py", trust=True)
    assert model.UNITS["K1"] == model.UNITS["K2"] == "N*m/rad"
    chi = np.random.default_rng(4).uniform(0.2, 1.0, len(model.STANDARD_PARAMETERS))
    value = dict(zip(model.STANDARD_PARAMETERS, chi, strict=True)) | {
        "K1": 6.5,
        "K2": 2.25,
        "OFFSET1": 1.3,
        "OFFSET2": -0.7,
    }
    chi = np.array([value[name] for name in model.STANDARD_PARAMETERS])
    t = np.arange(6000) / RATE
    w = 2 * np.pi * np.array([[0.21, 0.53, 1.1], [0.27, 0.61, 1.3]])[:, :, None]
    a = np.array([0.9, 0.5, 0.2])[:, None]
    q, qd, qdd = (
        (a * x).sum(axis=1).T for x in (np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t))
    )
    oracle = PinocchioModel(robot)
    tau = np.array([oracle.torque(*state, chi) for state in zip(q, qd, qdd, strict=True)])
    tau += noise * np.random.default_rng(0).standard_normal(tau.shape)
    study = study_from_mapping(
        {"signals": {"median": 1, "lowpass": None, "decimate": {"factor": 4}}}
    )
    found = estimate_of(observe(model, Record(t, q, tau, rate=RATE), study), model=model)
    assert found.status == "ok"
    exact = 2e-3  # of central differences and the decimation filter
    for name in ("K1", "K2", "OFFSET1", "OFFSET2"):
        assert (
            abs(found[name] - value[name])
            < exact + 4 * noise * found.sigma[found.names.index(name)] / 0.05
        )
    truth = model.base_parameters(chi)
    np.testing.assert_allclose(found.X, truth, atol=exact + 0.5 * noise)
